//! One puck of the hand (nodes 11..14): encoders, moves, streamed set-points, and HI.
//!
//! Positions mean nothing until HI has driven the digit to its open stop: with the main firmware the counters begin
//! anywhere. While HI runs MODE reads 4, afterwards 0, or 3 with HOLD; any request but GET MODE ends it at once,
//! uninitialised (trap T12 of docs/barrett-can.md). The puck's own controllers are ideal within their torque limit,
//! moves keep MV and stop without a ramp, and TSTOP ends every mode that drives once the motor has stood still for so
//! many milliseconds, torque mode included.

use super::drive::Demand;
use crate::firmware::{Firmware, Heard, Order};
use crate::noise::Noise;
use crate::time::{STEP_TICKS, TICKS_PER_MILLISECOND, Ticks, seconds};
use puck::device::{position_frame, secondary_position_frame};
use puck::hand::{HandCommand, INNER_LINK_RATIO, SECONDARY_RATIO, SPREAD_RATIO};
use puck::{Action, CanFrame, Counts, Group, MotorMode, Node, Property, PropertyId, Request, Role, UnknownFirmware};
use std::f64::consts::TAU;

/// Option of ROLE: strain gauge.
const STRAIN_GAUGE: i32 = 0x0800;
/// Option of ROLE: absolute magnetic encoder on the Hall input.
const MAGNETIC_ENCODER: i32 = 0x0200;

/// CTS: counts per revolution of motor and worm encoder.
const COUNTS_PER_REVOLUTION: i32 = 4096;

/// Standstill that tells HI that the stop is reached. Assumed.
const HI_STANDSTILL: Ticks = 100 * TICKS_PER_MILLISECOND;

/// Speed below which the motor counts as standing, rad/s at the link.
const STANDSTILL: f64 = 0.002;

/// Gain of the puck's position loop, 1/s. Assumed.
const POSITION_GAIN: f64 = 25.0;

/// Counters of a puck that was never initialised lie within this many counts of zero.
const MEANINGLESS: f64 = 150_000.0;

/// State of a digit's drive at the instant of a request, at the link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Motor angle over its ratio, rad.
    pub(crate) angle: f64,
    /// Its rate, rad/s.
    pub(crate) speed: f64,
    /// Angle of the inner link's worm over 50, rad; fingers only.
    pub(crate) secondary: Option<f64>,
}

/// One puck.
#[derive(Clone, Debug)]
pub(crate) struct Digit {
    firmware: Firmware,
    /// Motor revolutions per revolution of the link.
    ratio: f64,
    /// True torque constant, whatever IPNM says.
    units_per_newton_metre: f64,
    /// Offset of the counters from the true counts: motor, worm.
    offsets: [i64; 2],
    /// T as the master set it; what acts is clipped to MT.
    commanded: i32,
    /// Where MODE 3 holds, counts as the master counts.
    held: i32,
    is_initialising: bool,
    standing: Ticks,
    noise: Noise,
}

impl Digit {
    /// Digit `index` (0..=3: F1, F2, F3, spread), without power. `noise`: of the wake-up and of the counters.
    pub(crate) fn new(
        index: usize,
        versions: (i16, i16),
        units_per_newton_metre: i16,
        torque_limit: i16,
        noise: [Noise; 2],
    ) -> Result<Self, UnknownFirmware> {
        let node = Node::HAND[index];
        let is_finger = index < 3;
        let pick = |finger: i32, spread: i32| if is_finger { finger } else { spread };
        let options = MAGNETIC_ENCODER | pick(STRAIN_GAUGE, 0);
        let number = i32::from(node.number());
        let factory = [
            (Property::Vers, versions.1.into()),
            (Property::Role, i32::from(Role::HAND) | options),
            (Property::Sn, 1000 + number),
            (Property::Id, number),
            (Property::Error, 0),
            (Property::Mode, MotorMode::Idle.value()),
            (Property::Temp, 36),
            (Property::Ptemp, 36),
            (Property::Otemp, 60),
            (Property::Therm, 33),
            (Property::Sg, 0),
            (Property::Jp, 0),
            (Property::Grpa, Group::ALL_MOTORS.number().into()),
            (Property::Grpb, 7),
            (Property::Grpc, Group::HAND.number().into()),
            (Property::Mt, torque_limit.into()),
            (Property::V, 0),
            (Property::Mv, 100),
            (Property::Mcv, 200),
            (Property::Mov, 200),
            (Property::Dp, pick(45_000, 17_975)),
            (Property::E, 0),
            (Property::Ot, 0),
            (Property::Ct, pick(195_000, 35_950)),
            (Property::Ds, 25_600),
            (Property::Cts, COUNTS_PER_REVOLUTION),
            (Property::Pidx, index as i32 + 1),
            (Property::Hsg, 0),
            (Property::Lsg, 0),
            (Property::Ivel, -75),
            (Property::Ioff, 0),
            (Property::Hold, pick(0, 1)),
            (Property::Tstop, pick(50, 150)),
            (Property::Kp, pick(500, 1000)),
            (Property::Kd, pick(2500, 10_000)),
            (Property::Ki, 0),
            (Property::Accel, 200),
            (Property::Jidx, number - 3),
            (Property::Ipnm, units_per_newton_metre.into()),
            (Property::Poles, 6),
            (Property::Ihit, pick(1700, 2200)),
        ];
        let [boot_noise, noise] = noise;
        Ok(Self {
            firmware: Firmware::new(node, versions.0, &factory, boot_noise)?,
            ratio: if is_finger { INNER_LINK_RATIO } else { SPREAD_RATIO },
            units_per_newton_metre: f64::from(units_per_newton_metre.max(1)),
            offsets: [0; 2],
            commanded: 0,
            held: 0,
            is_initialising: false,
            standing: 0,
            noise,
        })
    }

    /// The node number.
    pub(crate) fn node(&self) -> Node {
        self.firmware.node()
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        self.firmware.power_on(now);
    }

    /// The main firmware runs and HI is done: both lie in the past.
    pub(crate) fn run(&mut self) {
        self.firmware.run();
    }

    /// Motor power goes.
    pub(crate) fn power_off(&mut self) {
        self.firmware.power_off();
        self.forget();
    }

    /// A request on the bus at time `at`.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) {
        let heard = self.firmware.receive(at, request);
        if heard == Heard::Nothing {
            return;
        }
        if self.is_initialising && request.action != (Action::Get { property: PropertyId::MODE }) {
            self.is_initialising = false;
            self.enter(MotorMode::Idle);
        }
        if let Heard::Torque(units) = heard {
            self.command(units);
        }
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.firmware.next_time()
    }

    /// Carries out one request that is done by `now`; `gauge` reads the strain gauge.
    pub(crate) fn step(&mut self, now: Ticks, motion: &Motion, gauge: impl FnOnce() -> u16) -> Option<CanFrame> {
        let node = self.node();
        match self.firmware.take(now)? {
            Order::Answer(frame) => frame,
            Order::Get { property: Property::P, .. } => {
                let secondary = motion.secondary.map(|angle| self.secondary(angle));
                Some(position_frame(node, Counts(self.position(motion.angle)), secondary))
            }
            Order::Get { property: Property::Jp, .. } => {
                motion.secondary.map(|angle| secondary_position_frame(node, self.secondary(angle)))
            }
            Order::Get { property: Property::T, id } => Some(self.firmware.reply(Property::T, id, self.commanded)),
            Order::Get { property: Property::Sg, id } => Some(self.firmware.reply(Property::Sg, id, gauge().into())),
            Order::Get { property, id } => self.firmware.answer(property, id),
            Order::Set { property, value } => {
                self.set(property, value, motion);
                None
            }
            Order::Restarted => {
                self.forget();
                self.offsets = [(); 2].map(|()| self.noise.uniform(-MEANINGLESS, MEANINGLESS) as i64);
                None
            }
        }
    }

    /// Returns the puck's demand on its drive during the step that begins at `now`.
    pub(crate) fn demand(&mut self, now: Ticks, motion: &Motion) -> Demand {
        if !self.firmware.is_ready(now) {
            return Demand::Idle;
        }
        let mode = MotorMode::from_value(self.firmware.value(Property::Mode)).unwrap_or(MotorMode::Idle);
        if mode == MotorMode::Idle {
            return Demand::Idle;
        }
        self.standing = if motion.speed.abs() < STANDSTILL { self.standing + STEP_TICKS } else { 0 };
        if self.is_initialising {
            return self.initialise(motion);
        }
        let limit = self.firmware.value(Property::Mt).max(0);
        let patience = Ticks::try_from(self.firmware.value(Property::Tstop)).unwrap_or(0) * TICKS_PER_MILLISECOND;
        let is_holding = mode == MotorMode::Position && self.firmware.value(Property::Hold) != 0;
        if patience > 0 && self.standing >= patience && !is_holding {
            return self.finish(motion);
        }
        match mode {
            MotorMode::Idle | MotorMode::Duty => Demand::Idle,
            MotorMode::Torque => Demand::Torque(self.link_torque(self.commanded.clamp(-limit, limit))),
            MotorMode::Position => self.towards(self.held, motion, limit),
            MotorMode::Velocity => {
                Demand::Velocity(self.link_speed(self.firmware.value(Property::V)), self.link_torque(limit))
            }
            MotorMode::Trapezoidal => {
                let target = self.firmware.value(Property::E);
                if self.distance(target, motion).abs() <= 1 {
                    return self.finish(motion);
                }
                self.towards(target, motion, limit)
            }
        }
    }

    /// Requests lost to a full receive buffer.
    pub(crate) fn lost_requests(&self) -> u64 {
        self.firmware.lost_requests()
    }

    fn set(&mut self, property: Property, value: i32, motion: &Motion) {
        let mode = self.firmware.value(Property::Mode);
        match property {
            Property::P if mode == MotorMode::Position.value() => self.held = value,
            // Redefines the position of an idle or limp motor; a move that is under way takes no notice.
            Property::P if mode <= MotorMode::Torque.value() => {
                self.offsets[0] += i64::from(value) - i64::from(self.position(motion.angle));
            }
            Property::P => {}
            Property::T => self.command(value),
            Property::Mode => {
                self.held = self.position(motion.angle);
                self.standing = 0;
                self.commanded = 0;
                self.firmware.store(Property::Mode, value);
            }
            Property::M => self.move_to(value),
            Property::Cmd => self.carry_out(value, motion),
            other => self.firmware.store(other, value),
        }
    }

    fn carry_out(&mut self, command: i32, motion: &Motion) {
        const INITIALISE: i32 = HandCommand::Initialise as i32;
        const CLOSE: i32 = HandCommand::Close as i32;
        const OPEN: i32 = HandCommand::Open as i32;
        const MOVE: i32 = HandCommand::Move as i32;
        const INCREMENT_CLOSE: i32 = HandCommand::IncrementClose as i32;
        const INCREMENT_OPEN: i32 = HandCommand::IncrementOpen as i32;
        const TERMINATE: i32 = HandCommand::Terminate as i32;
        let (here, step) = (self.position(motion.angle), self.firmware.value(Property::Ds));
        match command {
            INITIALISE => {
                self.enter(MotorMode::Velocity);
                self.is_initialising = true;
            }
            CLOSE => self.move_to(self.firmware.value(Property::Ct)),
            OPEN => self.move_to(self.firmware.value(Property::Ot)),
            MOVE => self.move_to(self.firmware.value(Property::Dp)),
            INCREMENT_CLOSE => self.move_to(here.saturating_add(step)),
            INCREMENT_OPEN => self.move_to(here.saturating_sub(step)),
            TERMINATE => self.enter(MotorMode::Idle),
            _ => {}
        }
    }

    fn move_to(&mut self, target: i32) {
        self.firmware.store(Property::E, target);
        self.enter(MotorMode::Trapezoidal);
    }

    fn enter(&mut self, mode: MotorMode) {
        self.firmware.store(Property::Mode, mode.value());
        self.standing = 0;
        self.commanded = 0;
    }

    /// HI: towards the open stop until the motor stands, then P = 0.
    fn initialise(&mut self, motion: &Motion) -> Demand {
        if self.standing < HI_STANDSTILL {
            let limit = self.link_torque(self.firmware.value(Property::Ihit).max(0));
            return Demand::Velocity(self.link_speed(self.firmware.value(Property::Ivel)), limit);
        }
        self.is_initialising = false;
        let scale = self.counts_per_radian();
        self.offsets =
            [-quantised(motion.angle * scale), -quantised(motion.secondary.unwrap_or(0.0) * worm_counts_per_radian())];
        self.finish(motion)
    }

    /// The end of a move: hold, or let go.
    fn finish(&mut self, motion: &Motion) -> Demand {
        self.held = self.position(motion.angle);
        self.enter(if self.firmware.value(Property::Hold) != 0 { MotorMode::Position } else { MotorMode::Idle });
        Demand::Idle
    }

    fn towards(&self, target: i32, motion: &Motion, limit: i32) -> Demand {
        let wanted = POSITION_GAIN * self.distance(target, motion) as f64 / self.counts_per_radian();
        // MV = 0 means no limit.
        let fastest = match self.firmware.value(Property::Mv) {
            0 => f64::INFINITY,
            limit => self.link_speed(limit).abs(),
        };
        Demand::Velocity(wanted.clamp(-fastest, fastest), self.link_torque(limit))
    }

    /// Counts to the target, or to the end of the travel before it. Both ends are anybody's to set.
    fn distance(&self, target: i32, motion: &Motion) -> i64 {
        i64::from(self.within_travel(target)) - i64::from(self.position(motion.angle))
    }

    fn within_travel(&self, target: i32) -> i32 {
        target.min(self.firmware.value(Property::Ct)).max(self.firmware.value(Property::Ot))
    }

    fn command(&mut self, units: i32) {
        let is_torque_mode = self.firmware.value(Property::Mode) == MotorMode::Torque.value();
        self.commanded = if is_torque_mode { units } else { 0 };
    }

    fn forget(&mut self) {
        self.offsets = [0; 2];
        self.commanded = 0;
        self.held = 0;
        self.is_initialising = false;
        self.standing = 0;
    }

    /// Torque at the link without losses, N m, from current units.
    fn link_torque(&self, units: i32) -> f64 {
        f64::from(units) * self.ratio / self.units_per_newton_metre
    }

    /// Speed of the link, rad/s, from counts per ms.
    fn link_speed(&self, counts_per_millisecond: i32) -> f64 {
        let interval = seconds(TICKS_PER_MILLISECOND);
        f64::from(counts_per_millisecond) / interval / self.counts_per_radian()
    }

    fn counts_per_radian(&self) -> f64 {
        self.ratio * f64::from(COUNTS_PER_REVOLUTION) / TAU
    }

    /// Motor counts as the master sees them, before they wrap.
    fn position(&self, angle: f64) -> i32 {
        (quantised(angle * self.counts_per_radian()) + self.offsets[0]) as i32
    }

    fn secondary(&self, angle: f64) -> Counts {
        Counts((quantised(angle * worm_counts_per_radian()) + self.offsets[1]) as i32)
    }
}

/// Counts toward minus infinity.
fn quantised(counts: f64) -> i64 {
    counts.floor() as i64
}

fn worm_counts_per_radian() -> f64 {
    SECONDARY_RATIO * f64::from(COUNTS_PER_REVOLUTION) / TAU
}
