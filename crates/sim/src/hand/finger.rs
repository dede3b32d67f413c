//! The drive of one finger: a motor, two worms, and the TorqueSwitch clutch between them.
//!
//! With the motor's angle reflected to the inner link, `d = m / 125`, the distal worm keeps `inner + outer = 4/3 d`
//! (1/93.75 = 4/3 x 1/125), always. The proximal worm turns with the motor through a clutch: `inner = d - s`, with the
//! slip `s` constant until, on closing, the torque through the clutch passes the threshold; then the inner link stays
//! where it is and `s` grows. The power balance gives what the drive feels: `inner_load + outer_load / 3` with the
//! clutch engaged, `4/3 outer_load` slipping; and the clutch carries `inner_load - outer_load`, because the distal path
//! holds the outer link against the palm.
//!
//! Worms cannot be driven back: a load can stop the motor but never turn it, and a load that would help the motor is
//! borne by the worm. Opening moves both links, slip kept, until the inner link and then the outer one are at the open
//! stop, where `s = 0`: the clutch is engaged again as after HI (docs/arm-model.md).

use super::drive::{Demand, Inertia};
use crate::time::STEP_SECONDS;

/// Largest angle of the inner link, 140 degrees, rad.
const INNER_RANGE: f64 = 2.443_460_953;

/// Largest angle of the outer link relative to the inner one, 48 degrees, rad.
const OUTER_RANGE: f64 = 0.837_758_041;

/// Sum of both links' angles per angle of the drive.
const BOTH_LINKS: f64 = 4.0 / 3.0;

/// Drive of one finger.
#[derive(Clone, Debug)]
pub(crate) struct Finger {
    /// Motor angle over 125, rad from the open stop.
    drive: f64,
    /// Its rate, rad/s.
    speed: f64,
    /// Slip of the clutch, rad at the inner link.
    slip: f64,
    is_slipping: bool,
    /// Torque at which the clutch lets go, N m.
    breakaway: f64,
    mass: Inertia,
}

impl Finger {
    /// A finger at rest with its links at these angles, rad.
    pub(crate) fn new(inner: f64, outer: f64, breakaway: f64, mass: Inertia) -> Self {
        let drive = ((inner + outer) / BOTH_LINKS).max(0.0);
        let slip = (drive - inner).max(0.0);
        Self { drive, speed: 0.0, slip, is_slipping: false, breakaway, mass }
    }

    /// Motor angle over 125, rad.
    pub(crate) fn drive(&self) -> f64 {
        self.drive
    }

    /// Rate of [`Finger::drive`], rad/s.
    pub(crate) fn speed(&self) -> f64 {
        self.speed
    }

    /// Where the proximal worm holds the inner link, rad; the secondary encoder sits on that worm.
    pub(crate) fn inner(&self) -> f64 {
        (self.drive - self.slip).max(0.0)
    }

    /// Rate of [`Finger::inner`], rad/s.
    pub(crate) fn inner_speed(&self) -> f64 {
        if self.is_slipping || self.inner() == 0.0 { 0.0 } else { self.speed }
    }

    /// Where the distal worm holds the outer link relative to the inner one, rad.
    pub(crate) fn outer(&self) -> f64 {
        BOTH_LINKS * self.drive - self.inner()
    }

    /// One step of physics under the loads the drive bears at both links (N m, positive closing).
    pub(crate) fn step(&mut self, demand: Demand, inner_load: f64, outer_load: f64) {
        let load = if self.is_slipping { BOTH_LINKS * outer_load } else { inner_load + outer_load / 3.0 };
        // What the motor cannot feel it need not work against.
        let wanted_load = |v: f64| if load * v > 0.0 { load } else { 0.0 };
        let torque = match demand {
            Demand::Velocity(v, _) => self.mass.torque(demand, self.speed, wanted_load(v)),
            _ => self.mass.torque(demand, self.speed, 0.0),
        };
        let driven = self.mass.driven(self.speed, torque, 0.0);
        let opposing = (load * driven.signum()).max(0.0);
        self.speed = self.mass.rubbed(driven, self.mass.coulomb + opposing, 0.0);
        if self.speed > 0.0 {
            self.close(inner_load - outer_load);
        } else if self.speed < 0.0 {
            self.open();
        }
    }

    fn close(&mut self, clutch_torque: f64) {
        let inner = self.inner();
        if clutch_torque > self.breakaway || inner >= INNER_RANGE {
            self.is_slipping = true;
        }
        self.drive += STEP_SECONDS * self.speed;
        if !self.is_slipping && self.drive - self.slip > INNER_RANGE {
            self.is_slipping = true;
            self.slip = self.drive - INNER_RANGE;
        } else if self.is_slipping {
            self.slip = self.drive - inner;
        }
        let end = (self.inner() + OUTER_RANGE) / BOTH_LINKS;
        if self.drive > end {
            self.slip -= if self.is_slipping { self.drive - end } else { 0.0 };
            self.drive = end;
            self.speed = 0.0;
        }
    }

    fn open(&mut self) {
        self.is_slipping = false;
        self.drive += STEP_SECONDS * self.speed;
        if self.drive <= 0.0 {
            self.drive = 0.0;
            self.speed = 0.0;
        }
        // The inner link is at its stop: what the drive still opens, the clutch gives back.
        self.slip = self.slip.min(self.drive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS: Inertia = Inertia { inertia: 0.0022, viscous: 0.4918, coulomb: 0.1 };

    fn finger() -> Finger {
        Finger::new(0.0, 0.0, 0.9, MASS)
    }

    fn steps(finger: &mut Finger, count: usize, torque: f64, load: impl Fn(&Finger) -> (f64, f64)) {
        for _ in 0..count {
            let (inner, outer) = load(finger);
            finger.step(Demand::Torque(torque), inner, outer);
        }
    }

    #[test]
    fn a_free_finger_reaches_the_published_speed_and_both_links_move_three_to_one() {
        let mut finger = finger();
        steps(&mut finger, 900, 1.3, |_| (0.0, 0.0));
        assert!((finger.speed() - 2.44).abs() < 0.01, "{}", finger.speed());
        assert!((finger.outer() - finger.inner() / 3.0).abs() < 1e-12);
        assert_eq!(finger.slip, 0.0);
    }

    #[test]
    fn no_load_drives_the_worm_back() {
        for load in [5.0, -5.0, 500.0, -500.0] {
            let mut finger = Finger::new(0.6, 0.2, 0.9, MASS);
            for demand in [Demand::Idle, Demand::Torque(0.0), Demand::Torque(0.09), Demand::Torque(-0.09)] {
                let before = (finger.inner(), finger.outer());
                (0..2000).for_each(|_| finger.step(demand, load, load / 5.0));
                assert_eq!((finger.inner(), finger.outer()), before, "{load} {demand:?}");
            }
        }
    }

    #[test]
    fn a_load_stops_a_closing_finger_and_a_helping_one_does_not_speed_it_up() {
        let settled = |load: f64| {
            let mut finger = Finger::new(0.5, 0.5 / 3.0, f64::INFINITY, MASS);
            steps(&mut finger, 300, 1.0, |_| (load, 0.0));
            finger.speed()
        };
        assert_eq!(settled(0.95), 0.0);
        assert!(settled(0.5) > 0.0 && settled(0.5) < settled(0.0));
        assert_eq!(settled(-3.0), settled(0.0));
    }

    #[test]
    fn the_clutch_slips_at_its_threshold_and_the_outer_link_goes_on() {
        let mut finger = finger();
        let wall = |finger: &Finger| (50.0 * (finger.inner() - 0.8).max(0.0), 0.0);
        steps(&mut finger, 3000, 1.3, wall);
        // Breakaway at 0.9 N m: 18 mrad into the spring, one step of travel more at most.
        assert!((finger.inner() - 0.818).abs() < 0.0015, "{}", finger.inner());
        assert!((finger.outer() - OUTER_RANGE).abs() < 1e-9, "the outer link closes to its end: {}", finger.outer());
        // Motor and worm then disagree as the drivers' breakaway test expects: m / 125 > s / 50.
        assert!(finger.drive() > finger.inner() + 0.4);
    }

    #[test]
    fn fingertip_contact_alone_does_not_break_the_clutch_away() {
        // At rest before the object: an impact at full speed may well break it away.
        let mut finger = Finger::new(0.75, 0.25, 0.9, MASS);
        // A force at the tip has 56 mm about the outer joint and about 126 mm about the inner one.
        let tip = |finger: &Finger| {
            let force = 400.0 * ((finger.inner() + finger.outer()) - 1.0).max(0.0);
            (0.126 * force, 0.056 * force)
        };
        steps(&mut finger, 3000, 1.3, tip);
        assert_eq!(finger.slip, 0.0);
        assert_eq!(finger.speed(), 0.0);
    }

    #[test]
    fn slip_stays_until_the_finger_has_been_at_the_open_stop() {
        let mut finger = finger();
        steps(&mut finger, 3000, 1.3, |finger| (50.0 * (finger.inner() - 0.8).max(0.0), 0.0));
        let slip = finger.slip;
        assert!(slip > 0.1);
        steps(&mut finger, 200, -1.3, |_| (0.0, 0.0));
        assert!(finger.inner() < 0.7, "both links open");
        assert!((finger.slip - slip).abs() < 1e-12, "and stay shifted");
        steps(&mut finger, 200, 1.3, |_| (0.0, 0.0));
        assert!((finger.outer() - finger.inner() / 3.0).abs() > 0.1, "closing again does not mend it");
        steps(&mut finger, 4000, -1.3, |_| (0.0, 0.0));
        assert_eq!((finger.drive(), finger.inner(), finger.outer(), finger.slip), (0.0, 0.0, 0.0, 0.0));
        steps(&mut finger, 500, 1.3, |_| (0.0, 0.0));
        assert!((finger.outer() - finger.inner() / 3.0).abs() < 1e-12, "engaged again");
    }
}
