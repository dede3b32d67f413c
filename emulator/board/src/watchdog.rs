//! The independent watchdog (RM0433 chapter 45), with registers that take time to pass to its own clock.
//!
//! A write of PR, RLR or WINR sets its flag in SR and takes effect some periods of the oscillator later; until then the
//! counter is reloaded from the old value. The counter runs at the oscillator's rate over the prescaler and resets the
//! chip when it ends.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::soc::stm32h743::peripherals::rcc::IWDG_STARTED;
use rigless::time::{EventId, VirtualNanos};

/// Keys of KR.
const FEED: u64 = 0xAAAA;
const OPEN: u64 = 0x5555;
const START: u64 = 0xCCCC;

/// Flags of SR.
const PVU: u64 = 1;
const RVU: u64 = 2;
const WVU: u64 = 4;

/// Periods of the oscillator, at the prescaler of 1, until a written register has taken effect: "up to five" (RM0433
/// 45.4.4).
const CROSSING: u64 = 5;

/// Reload value after a reset.
const FULL: u64 = 0xFFF;

/// Counters of the watchdog, for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watched {
    /// Time from a feeding to a reset, ns, as it is now; 0 before it is started.
    pub window_ns: u64,
    /// The longest such time since it was started.
    pub longest_window_ns: u64,
    /// The least time that was left at a feeding since [`SharedWatch::forget`], ns.
    pub nearest_ns: Option<u64>,
    /// Feedings.
    pub feedings: u64,
    /// When the window last changed, ns.
    pub changed_at: u64,
    /// When it was started, ns.
    pub started_at: Option<u64>,
    /// A fault: what is written to PR, RLR and WINR is lost.
    pub deaf: bool,
}

/// [`Watched`], shared with who reports it.
#[derive(Clone, Debug, Default)]
pub struct SharedWatch(Arc<Mutex<Watched>>);

impl SharedWatch {
    fn lock(&self) -> MutexGuard<'_, Watched> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counters so far.
    #[must_use]
    pub fn get(&self) -> Watched {
        *self.lock()
    }

    /// From now on it takes no value: what is written to its registers is lost, and no flag tells.
    pub fn deafen(&self) {
        self.lock().deaf = true;
    }

    /// From now on the nearest feeding is a new one: service has begun.
    pub fn forget(&self) {
        self.lock().nearest_ns = None;
    }
}

/// The watchdog.
#[derive(Debug)]
pub struct Watchdog {
    watch: SharedWatch,
    hz: u64,
    started: bool,
    open: bool,
    /// Register values in effect, and those on their way with the time they take effect.
    prescaler: u64,
    reload: u64,
    window: u64,
    crossing: [Option<(u64, u64)>; 3],
    /// When the counter ends, if it runs.
    ends: Option<u64>,
}

impl Watchdog {
    /// As after power-up.
    #[must_use]
    pub fn new(watch: SharedWatch) -> Self {
        Self {
            watch,
            hz: 0,
            started: false,
            open: false,
            prescaler: 4,
            reload: FULL,
            window: FULL,
            crossing: [None; 3],
            ends: None,
        }
    }

    /// Nanoseconds of a full count.
    fn span(&self) -> Option<u64> {
        (self.hz > 0).then(|| (self.reload + 1) * self.prescaler * 1_000_000_000 / self.hz)
    }

    /// Loads the counter.
    fn feed(&mut self, context: &mut DeviceContext<'_>) {
        if !self.started {
            return;
        }
        let now = context.now().0;
        let Some(span) = self.span() else { return };
        let mut watched = self.watch.lock();
        watched.feedings += 1;
        if let Some(left) = self.ends.map(|ends| ends.saturating_sub(now)) {
            watched.nearest_ns = Some(watched.nearest_ns.map_or(left, |nearest| nearest.min(left)));
        }
        if watched.window_ns != span {
            watched.window_ns = span;
            watched.changed_at = now;
        }
        watched.longest_window_ns = watched.longest_window_ns.max(span);
        self.ends = Some(now + span);
        context.schedule(VirtualNanos(now + span));
    }

    /// Takes over what has passed to the oscillator's side, and resets the chip when the counter has ended.
    fn settle(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let now = context.now().0;
        for place in 0..self.crossing.len() {
            let Some((value, at)) = self.crossing[place].filter(|(_, at)| *at <= now) else { continue };
            self.crossing[place] = None;
            match place {
                0 => {
                    // What is left of the count goes on at the new rate.
                    if let Some(ends) = self.ends {
                        let left = ends.saturating_sub(at) * value / self.prescaler;
                        self.ends = Some(at + left);
                        context.schedule(VirtualNanos(at + left));
                    }
                    self.prescaler = value;
                }
                1 => self.reload = value,
                _ => self.window = value,
            }
        }
        let flags = [PVU, RVU, WVU].into_iter().zip(&self.crossing);
        registers.set(Register::Sr, flags.filter(|(_, crossing)| crossing.is_some()).map(|(flag, _)| flag).sum());
        if self.ends.is_some_and(|ends| ends <= now) {
            self.ends = None;
            context.request_reset();
        }
    }

    fn write_guarded(&mut self, place: usize, value: u64, context: &mut DeviceContext<'_>) {
        let name = ["PR", "RLR", "WINR"][place];
        if !self.open {
            context.tell(
                name,
                "RM0433 45.4.1: this register is written only after the key 0x5555, and the write is ignored",
            );
            return;
        }
        if self.crossing[place].is_some() {
            context.tell(
                name,
                "RM0433 45.4.4: written while its update flag in SR stands: the value may be lost, and is lost here",
            );
            return;
        }
        if self.watch.lock().deaf {
            return;
        }
        // Without its oscillator nothing passes.
        let crossing = (CROSSING * 1_000_000_000).checked_div(self.hz);
        let at = crossing.map_or(u64::MAX, |time| context.now().0 + time);
        self.crossing[place] = Some((value, at));
        if at < u64::MAX {
            context.schedule(VirtualNanos(at));
        }
    }
}

impl Device for Watchdog {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.settle(registers, context);
        // Read back from the oscillator's side, and valid once the update flag has gone (RM0433 45.4.2, 45.4.3).
        match register {
            Register::Pr => Some(u64::from(self.prescaler.trailing_zeros()) - 2),
            Register::Rlr => Some(self.reload),
            Register::Winr => Some(self.window),
            Register::Kr | Register::Sr => None,
        }
    }

    fn write(&mut self, register: Register, value: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.settle(registers, context);
        match register {
            Register::Kr => match value & 0xFFFF {
                START => {
                    self.open = false;
                    if !self.started {
                        self.started = true;
                        self.watch.lock().started_at = Some(context.now().0);
                        context.request(IWDG_STARTED, Level::High);
                    }
                    self.feed(context);
                }
                OPEN => self.open = true,
                key => {
                    self.open = false;
                    if key == FEED {
                        if self.window < self.reload {
                            context.tell("WINR", "the window option is not modelled");
                        }
                        self.feed(context);
                    }
                }
            },
            Register::Pr => self.write_guarded(0, 4 << (value & 7).min(6), context),
            Register::Rlr => self.write_guarded(1, value & FULL, context),
            Register::Winr => self.write_guarded(2, value & FULL, context),
            Register::Sr => {}
        }
        self.settle(registers, context);
    }

    fn on_event(&mut self, _event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.settle(registers, context);
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let began = self.hz == 0 && hz > 0;
        self.hz = hz;
        if began {
            // The counter and the registers written so far begin to move now.
            let at = context.now().0 + CROSSING * 1_000_000_000 / hz;
            for crossing in self.crossing.iter_mut().flatten() {
                crossing.1 = at;
                context.schedule(VirtualNanos(at));
            }
            self.feed(context);
        }
        self.settle(registers, context);
    }

    /// A reset of the chip stops the watchdog: it is started by software here.
    fn reset(&mut self) {
        *self = Self { watch: self.watch.clone(), ..Self::new(SharedWatch::default()) };
    }
}
