//! A signal that ends a command which has set nothing in motion: its unfinished files are taken away first.

use std::sync::atomic::{AtomicBool, Ordering};

use lab::unfinished;
use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

/// The command has an arm to stop, or a recording to keep: it has a way of its own to end.
static IS_ANOTHERS: AtomicBool = AtomicBool::new(false);

/// The signals that ask a program to end: Ctrl-C, `kill`, a terminal that is closed, and Ctrl-\ of whoever does not
/// wait for Ctrl-C.
pub(super) const ENDING: [i32; 4] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT];

/// From now on a signal ends the command as it would without this, but leaves no unfinished file behind.
pub(super) fn clear_away() {
    let heeded = ENDING.into_iter().filter(|signal| !is_ignored(*signal));
    // Without it unfinished files stay: nothing else is lost.
    let Ok(mut signals) = Signals::new(heeded) else { return };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            if IS_ANOTHERS.load(Ordering::SeqCst) {
                return;
            }
            let _held = unfinished::discard_all();
            let _ = emulate_default_handler(signal);
        }
    });
}

/// The signals that stop the arm of this command: all of them, but for a terminal that is closed where whoever started
/// it wants it to outlive that.
pub(super) fn of_an_arm() -> impl Iterator<Item = i32> {
    ENDING.into_iter().filter(|signal| *signal != SIGHUP || !is_ignored(*signal))
}

/// Leaves all signals from now on to whoever has just asked for them.
pub(super) fn leave_to_another() {
    IS_ANOTHERS.store(true, Ordering::SeqCst);
}

/// True if whoever started this program had the signal ignored, as `nohup` does.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask & (1 << (signal - 1)) != 0
}
