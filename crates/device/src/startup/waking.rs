//! The first half of the start-up: from an unknown bus to pucks that are awake, checked and read.

use control::act::limit::MOTOR_COUNTS_LIMIT;
use puck::{Group, MotorMode, Node, PropertyId, SafetyMode, Status, get, set, stop_frames};

use super::survey::{DRIVE_PROPERTIES, PACKING_LIMIT, Survey};
use super::{
    ENUMERATED, Next, POLL_US, REVOCATIONS, STOP_PACE_US, STOPPING_US, STOPS_ONLY_US, Startup, Step, Stopping, after,
};
use crate::bus::{Answer, Outlet};
use crate::stage::StartupError;

/// Longest time to an answer in an enumeration, us: a puck that boots needs up to 50 ms.
const LISTEN_US: u64 = 50_000;
/// Times that the bus is searched for the pucks after IDLE: they get power at that moment and need time to boot.
const ENUMERATIONS: u8 = 6;
/// Silence after the last wake, us: whoever talks while transceivers come up may be put off the bus.
const WAKE_SILENCE_US: u64 = 1_000_000;

/// Places of the limits that end in a fault.
const VL2: u8 = 1;
const TL2: u8 = 3;
/// Largest velocity fault limit of the safety module (counts): 1 m/s. The control code stops at 0.8 m/s.
const VL2_COUNTS: i32 = 4096;

impl Startup {
    pub(super) fn take_torque_off(&self, frame: u8, outlet: &mut impl Outlet) -> Next {
        match stop_frames().get(usize::from(frame)) {
            Some(content) => after(outlet.send(*content), Step::ZeroTorques { frame: frame + 1 }),
            None => Next::Go(Step::Enumerate { node: *ENUMERATED.start(), powered: false }),
        }
    }

    /// Repeats a stop frame if one is due, for half a second: pucks keep the torque they have, or the arm falls because
    /// nothing brakes it, and a frame can be lost. Goes on while a start-up rests that has not
    /// found the pucks: they may be heard again at any time, with the torque of then. Ends before a puck is woken, for
    /// then the bus has to be quiet. True if the slot is used.
    pub(super) fn repeats_stop(&mut self, outlet: &mut impl Outlet) -> bool {
        let rests = match self.step {
            Step::Enumerate { powered: false, .. }
            | Step::Listen { powered: false, .. }
            | Step::IdentifySafety { .. }
            | Step::LoadLimit { .. }
            | Step::AwaitIdle { .. } => false,
            Step::Blocked { .. } => true,
            _ => return false,
        };
        let now_us = outlet.now_us();
        let Some(Stopping { since_us, next_us, frame }) = &mut self.stopping else { return false };
        let since_us = *since_us.get_or_insert(now_us);
        let is_over = now_us > since_us + STOPPING_US && !rests;
        if now_us < *next_us || is_over {
            return false;
        }
        // The brakes hold whatever the torque is, so their frame goes more often: as many in a second as in the cycles
        // before.
        let [arm, wrist, brake, brake_hand] = stop_frames();
        let order = [
            brake, brake, brake, brake, arm, brake, brake, brake, brake, wrist, brake, brake, brake, brake, brake_hand,
        ];
        let sent = outlet.send(order.get(usize::from(*frame)).copied().unwrap_or(brake));
        if sent {
            *frame = (*frame + 1) % order.len() as u8;
            *next_us = if now_us < since_us + STOPS_ONLY_US { now_us } else { now_us + STOP_PACE_US };
        }
        sent
    }

    pub(super) fn enumerate(&mut self, number: u8, powered: bool, outlet: &mut impl Outlet) -> Next {
        let Some(node) = Node::new(number).filter(|_| ENUMERATED.contains(&number)) else {
            return Next::Go(Step::Listen { until_us: outlet.now_us() + LISTEN_US, powered });
        };
        after(outlet.send(get(node, PropertyId::STAT)), Step::Enumerate { node: number + 1, powered })
    }

    /// The pucks have power, and their answers are awaited: asks the safety module about the zero meanwhile. Whoever of
    /// them sleeps has lost it, and nobody sees that any more once it is awake.
    pub(super) fn listen(&mut self, powered: bool, outlet: &mut impl Outlet) -> Next {
        if let (true, None, Some(safety)) = (powered, self.zero_before, self.safety)
            && let Answer::Value(zero) = self.exchange.ask(Node::SAFETY_MODULE, safety.zero, outlet)
        {
            self.zero_before = Some(zero != 0);
        }
        Next::Stay
    }

    pub(super) fn count_pucks(&mut self) -> Result<Next, StartupError> {
        self.enumerations += 1;
        // One damaged question is not to decide what the arm carries.
        let sensor_may_come = !self.has_sensor() && self.enumerations < 2;
        let hand_may_come = self.survey.hand_is_partial() && self.enumerations < ENUMERATIONS;
        match self.survey.missing_puck() {
            None if !hand_may_come && !sensor_may_come => {
                self.stopping = None;
                self.survey_hand();
                Ok(Next::Go(Step::Identify { device: 0 }))
            }
            None => Ok(Next::Go(Step::Enumerate { node: *ENUMERATED.start(), powered: true })),
            Some(node) if self.enumerations >= ENUMERATIONS => Err(StartupError::MissingPuck(node)),
            Some(_) => Ok(Next::Go(Step::Enumerate { node: *ENUMERATED.start(), powered: true })),
        }
    }

    pub(super) fn identify_safety(&mut self, item: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let node = Node::SAFETY_MODULE;
        if item == 0 {
            let Some(role) = self.ask_safety(PropertyId::ROLE, outlet)? else {
                return Ok(Next::Stay);
            };
            self.survey.check_role(node, role)?;
            return Ok(Next::Go(Step::IdentifySafety { item: 1 }));
        }
        let Some(version) = self.ask_safety(PropertyId::VERS, outlet)? else {
            return Ok(Next::Stay);
        };
        self.survey.note_version(node, version);
        if self.survey.seen(node).status != Some(Status::Ready.value()) {
            return Err(StartupError::DidNotWake(node));
        }
        self.safety = Some(self.survey.safety_properties()?);
        Ok(Next::Go(Step::LoadLimit { limit: 0, part: 0 }))
    }

    pub(super) fn load_limit(&mut self, limit: u8, part: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let safety = *self.safety()?;
        let Some(property) = safety.limits.get(usize::from(limit)) else {
            return Ok(Next::Go(Step::AwaitIdle { next_us: outlet.now_us() }));
        };
        let command = match part {
            0 => safety.default,
            1 => safety.load,
            // The question after the two SETs gives the module time and proves that it still listens.
            2 => {
                let answered = self.ask_safety(PropertyId::STAT, outlet)?.is_some();
                return Ok(after(answered, Step::LoadLimit { limit, part: 3 }));
            }
            _ => {
                let Some(value) = self.ask_safety(*property, outlet)? else { return Ok(Next::Stay) };
                check_limit(limit, value)?;
                return Ok(Next::Go(Step::LoadLimit { limit: limit + 1, part: 0 }));
            }
        };
        let frame = set(Node::SAFETY_MODULE, command, i32::from(property.number()));
        Ok(after(outlet.send(frame), Step::LoadLimit { limit, part: part + 1 }))
    }

    pub(super) fn await_idle(&mut self, next_us: u64, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        if outlet.now_us() < next_us {
            return Ok(Next::Stay);
        }
        let Some(mode) = self.ask_safety(PropertyId::MODE, outlet)? else {
            return Ok(Next::Stay);
        };
        // ACTIVE is not good enough: pucks must not be woken or zeroed with torque on.
        if SafetyMode::from_value(mode) == Some(SafetyMode::Idle) {
            self.survey = Survey::new();
            self.hand = self.hand.again();
            self.enumerations = 0;
            return Ok(Next::Go(Step::Enumerate { node: *ENUMERATED.start(), powered: true }));
        }
        // What went wrong before no longer matters: a person is at work.
        self.error = None;
        self.hand.tried = 0;
        Ok(Next::Go(Step::AwaitIdle { next_us: outlet.now_us() + POLL_US }))
    }

    pub(super) fn identify(&mut self, index: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let next = Step::Identify { device: index + 1 };
        match self.device(index) {
            None => Ok(Next::Go(Step::Wake { device: 0, woken: false })),
            Some(Node::FORCE_TORQUE) => Ok(Next::Go(next)),
            Some(node) if node.hand_index().is_some() => Ok(self.identify_digit(node, next, outlet)),
            Some(node) => {
                let Some(role) = self.ask(node, PropertyId::ROLE, outlet)? else {
                    return Ok(Next::Stay);
                };
                self.survey.check_role(node, role)?;
                self.survey.note_role(node, role);
                Ok(Next::Go(next))
            }
        }
    }

    pub(super) fn wake(&mut self, index: u8, woken: bool, outlet: &mut impl Outlet) -> Next {
        let Some(node) = self.device(index) else {
            return Next::Go(if woken {
                Step::Silence { until_us: outlet.now_us() + WAKE_SILENCE_US }
            } else {
                Step::Verify { device: 0, item: 0 }
            });
        };
        if self.survey.seen(node).status == Some(Status::Ready.value()) {
            return Next::Go(Step::Wake { device: index + 1, woken });
        }
        if node.arm_index().is_some() {
            // Its counts began with its firmware. The safety module hears of it before the puck is woken: a board that
            // restarts later would take its word.
            let doubt = *self.doubt.get_or_insert(StartupError::CountsAnew(node));
            let told = self.zero_before.replace(false);
            if told == Some(true) {
                self.error = Some(doubt);
            }
            if told != Some(false) {
                self.revocations = REVOCATIONS;
            }
            if self.revocations > 0 {
                self.revoke_zero(outlet);
                return Next::Stay;
            }
        }
        // A sensor that slept has forgotten its tare.
        self.tared &= node != Node::FORCE_TORQUE;
        let frame = set(node, PropertyId::STAT, Status::Ready.value());
        after(outlet.send(frame), Step::Wake { device: index + 1, woken: true })
    }

    pub(super) fn verify(&mut self, index: u8, item: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let Some(node) = self.device(index) else {
            return Ok(Next::Go(Step::Brake { hand: false }));
        };
        if node.hand_index().is_some() {
            return Ok(self.verify_digit(node, index, item, outlet));
        }
        let next = Step::Verify { device: index + 1, item: 0 };
        if item == 0 {
            let status = match self.exchange.ask(node, PropertyId::STAT, outlet) {
                Answer::Pending => return Ok(Next::Stay),
                Answer::Value(status) => status,
                Answer::Silent => return Err(StartupError::DidNotWake(node)),
            };
            if status != Status::Ready.value() {
                return Err(StartupError::DidNotWake(node));
            }
            // A sensor may report no usable version; its properties are chosen by its node number.
            let sensor = node == Node::FORCE_TORQUE;
            return Ok(Next::Go(if sensor { next } else { Step::Verify { device: index, item: 1 } }));
        }
        // The version read in the monitor was the monitor's; only this one chooses property numbers.
        let Some(version) = self.ask(node, PropertyId::VERS, outlet)? else {
            return Ok(Next::Stay);
        };
        self.survey.note_version(node, version);
        self.survey.motor_table(node)?;
        Ok(Next::Go(next))
    }

    pub(super) fn brake(&mut self, hand: bool, outlet: &mut impl Outlet) -> Next {
        // Only ever IDLE: the safety module alone sets TORQUE of the arm, when a person activates.
        let group = if hand { Group::HAND } else { Group::ARM };
        let next = if hand || !self.survey.has_digits() {
            Step::Read { joint: 0, item: 0 }
        } else {
            Step::Brake { hand: true }
        };
        after(outlet.send(set(group, PropertyId::MODE, MotorMode::Idle.value())), next)
    }

    pub(super) fn read(&mut self, joint: u8, item: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let Some(node) = Node::ARM.get(usize::from(joint)).copied() else {
            self.calibration = Some(self.survey.calibration()?);
            if let Some(contradiction) = self.contradiction() {
                return Err(contradiction);
            }
            return Ok(Next::Go(Step::ReadHand { digit: 0, item: 0 }));
        };
        let Some(property) = DRIVE_PROPERTIES.get(usize::from(item)).copied() else {
            return Ok(Next::Go(Step::Read { joint: joint + 1, item: 0 }));
        };
        let table = self.survey.motor_table(node)?;
        let version = self.survey.seen(node).version.unwrap_or_default();
        let id = table.id(property).ok_or(StartupError::UnknownFirmware { node, version })?;
        let Some(value) = self.ask(node, id, outlet)? else {
            return Ok(Next::Stay);
        };
        self.survey.note_drive(usize::from(joint), usize::from(item), value);
        Ok(Next::Go(Step::Read { joint, item: item + 1 }))
    }
}

/// Checks a limit of the safety module that was read back, by its place in
/// [`SafetyProperties::limits`](super::SafetyProperties). Those that only warn may have any value.
fn check_limit(limit: u8, value: i32) -> Result<(), StartupError> {
    match limit {
        VL2 if !(1..=VL2_COUNTS).contains(&value) => Err(StartupError::SafetyVelocity { limit: value }),
        TL2 if value <= MOTOR_COUNTS_LIMIT as i32 || value > PACKING_LIMIT => {
            Err(StartupError::SafetyTorque { limit: value })
        }
        _ => Ok(()),
    }
}
