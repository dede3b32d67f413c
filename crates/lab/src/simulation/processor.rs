//! One processor for two processes that never run at the same time.
//!
//! In the lock step either QEMU or this thread works, and each exchange hands over. On one processor that is a plain
//! switch; across two it wakes a sleeping one 20 000 times a second, which was measured to double the time of a run.
//! Results do not depend on it.

use std::process::{Child, Command};

/// Has an engine be a process that Ctrl-C does not reach. A terminal sends that to all it has started: the engine would
/// end at once, and with it the simulated arm that this program is about to stop.
pub(super) fn out_of_reach(command: &mut Command) -> &mut Command {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    command
}

/// While it lives, this thread and the child share the processor the thread was on. Does nothing where that is not
/// possible.
pub(super) struct SharedProcessor(());

/// Processors this program may use, as found before any was shared. The end of every sharing gives these back, so that
/// they may overlap and end in any order.
#[cfg(target_os = "linux")]
static ALL: std::sync::OnceLock<Option<rustix::thread::CpuSet>> = std::sync::OnceLock::new();

#[cfg(target_os = "linux")]
impl SharedProcessor {
    /// Takes the child to this thread's processor. Call before the child has started threads: they inherit the place.
    pub(super) fn share(child: &Child) -> Self {
        use rustix::thread::{CpuSet, Pid, sched_getaffinity, sched_getcpu, sched_setaffinity};
        ALL.get_or_init(|| sched_getaffinity(None).ok());
        let mut here = CpuSet::new();
        here.set(sched_getcpu());
        let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
        // Slower is all that a refusal means, so it is not an error.
        if let Some(pid) = pid
            && sched_setaffinity(Some(pid), &here).is_ok()
        {
            let _ = sched_setaffinity(None, &here);
        }
        Self(())
    }
}

#[cfg(target_os = "linux")]
impl Drop for SharedProcessor {
    fn drop(&mut self) {
        if let Some(Some(all)) = ALL.get() {
            let _ = rustix::thread::sched_setaffinity(None, all);
        }
    }
}

#[cfg(not(target_os = "linux"))]
impl SharedProcessor {
    pub(super) fn share(_child: &Child) -> Self {
        Self(())
    }
}
