//! The safety module (node 10): it alone decides whether the arm may be driven.
//!
//! It has its own supply, so it always answers. It listens to torques (groups 1 and 2) and position replies (group 3),
//! and lowers the mode when a limit is passed; only the operator at the pendant raises it. On entering ACTIVE and IDLE
//! it sets the MODE of all motor pucks by a broadcast on 0x540. Rules: docs/barrett-can.md; each assumption is marked.

use crate::fault::Supervised;
use crate::inbox::Inbox;
use crate::operator::{PendantAction, PendantView};
use crate::properties::{Numbers, Values};
use crate::speed::SpeedMonitor;
use crate::time::{TICKS_PER_MILLISECOND, Ticks};
use puck::device::{reply16, reply32, safety_broadcast};
use puck::safety::{Button, Health};
use puck::{
    Action, CanFrame, Counts, Destination, Group, MotorMode, Node, PendantState, Property, PropertyTable, Reply,
    Request, Role, SafetyMode, Status, UnknownFirmware,
};

/// Set-up of the safety module.
#[derive(Clone, Debug, PartialEq)]
pub struct SafetyConfig {
    /// VERS; from 197 on software may lower the mode.
    pub version: i16,
    /// Longest time without a full set of position replies while ACTIVE; after it the mode falls to IDLE. **Assumed**:
    /// one driver reports a fault after at most 100 ms, the rule itself is not documented. `None`: not supervised.
    pub heartbeat: Option<Ticks>,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self { version: 200, heartbeat: Some(100 * TICKS_PER_MILLISECOND) }
    }
}

/// Time to carry out a SET. **Assumed**, so that SETs 10 ms apart, as the wiki asks, are safe and more than four at
/// once are lost.
const SET_TIME: Ticks = 2 * TICKS_PER_MILLISECOND;

/// Still too fast this long after a velocity fault: E-STOP.
const SECOND_LOOK: Ticks = 500 * TICKS_PER_MILLISECOND;

/// VL1, VL2 (4096 = 1 m/s), TL1, TL2 (packed torque units), VOLT limits (V), VNOM: values at power-up.
const FACTORY: [(Property, i32); 9] = [
    (Property::Vl1, 2048),
    (Property::Vl2, 4096),
    (Property::Tl1, 4731),
    (Property::Tl2, 5204),
    (Property::Voltl1, 36),
    (Property::Voltl2, 30),
    (Property::Volth1, 54),
    (Property::Volth2, 57),
    (Property::Vnom, 48),
];

/// Counts of VL1 and VL2 per m/s (or rad/s while the arm is not zeroed).
const VELOCITY_UNIT: f64 = 4096.0;

/// The segments of the pendant's display that show "0", no error.
const DISPLAY_ZERO: u8 = 0x3F;

/// The safety module.
#[derive(Clone, Debug)]
pub(crate) struct SafetyModule {
    config: SafetyConfig,
    numbers: Numbers,
    inbox: Inbox,
    mode: SafetyMode,
    button_latched: bool,
    zeroed_since: Option<Ticks>,
    limits: Values,
    /// Number of velocity faults that are still to be ignored (IFAULT).
    ignored_faults: i32,
    speed: SpeedMonitor,
    velocity_fault: bool,
    second_look: Option<Ticks>,
    torque: Health,
    heartbeat_fault: bool,
    /// Quantities it warns of whatever it hears: a fault to inject.
    warned: Vec<Supervised>,
    /// Since when full sets of positions have been flowing, and when the last one was complete.
    positions: Option<(Ticks, Ticks)>,
    /// When ACTIVE ends unless a full set comes before.
    heartbeat_due: Option<Ticks>,
    outgoing: Vec<CanFrame>,
}

impl SafetyModule {
    /// A module whose E-stop button is pressed. `speed` knows the arm's geometry.
    pub(crate) fn new(config: SafetyConfig, speed: SpeedMonitor) -> Result<Self, UnknownFirmware> {
        Ok(Self {
            numbers: Numbers::new(&PropertyTable::safety(config.version.into())?),
            config,
            inbox: Inbox::new(SET_TIME),
            mode: SafetyMode::EStop,
            button_latched: true,
            zeroed_since: None,
            limits: Values::new(&FACTORY),
            ignored_faults: 0,
            speed,
            velocity_fault: false,
            second_look: None,
            torque: Health::Safe,
            heartbeat_fault: false,
            warned: Vec::new(),
            positions: None,
            heartbeat_due: None,
            outgoing: Vec::new(),
        })
    }

    /// Starts in IDLE with a zeroed arm.
    pub(crate) fn resume(&mut self) {
        self.mode = SafetyMode::Idle;
        self.button_latched = false;
        self.zeroed_since = Some(0);
    }

    /// The mode; below IDLE the motors, and with them the pucks, have no power.
    pub(crate) fn mode(&self) -> SafetyMode {
        self.mode
    }

    /// The operator's view of the pendant.
    pub(crate) fn view(&self) -> PendantView {
        PendantView {
            mode: self.mode,
            zeroed_since: self.zeroed_since,
            positions_since: self.positions.map(|(since, _)| since),
        }
    }

    /// Both pendants, as PEN reports them.
    pub(crate) fn pendant(&self) -> PendantState {
        let velocity = match self.speed.latest() {
            _ if self.velocity_fault => Health::Fault,
            Some(speed) if speed > self.velocity_limit(Property::Vl1) => Health::Warning,
            _ => Health::Safe,
        };
        let heartbeat = if self.heartbeat_fault { Health::Fault } else { Health::Safe };
        let warned = |quantity: Supervised, health: Health| match health {
            Health::Safe if self.warned.contains(&quantity) => Health::Warning,
            health => health,
        };
        PendantState {
            velocity: warned(Supervised::Velocity, velocity),
            torque: warned(Supervised::Torque, self.torque),
            voltage: warned(Supervised::Voltage, Health::Safe),
            heartbeat: warned(Supervised::Heartbeat, heartbeat),
            other: warned(Supervised::Other, Health::Safe),
            segments: DISPLAY_ZERO,
            idle_light: self.mode == SafetyMode::Idle,
            activate_light: self.mode == SafetyMode::Active,
            button: if self.button_latched { Button::EmergencyStop } else { Button::None },
        }
    }

    /// Warns of a quantity from now on, or no longer.
    pub(crate) fn warn(&mut self, quantity: Supervised, is_on: bool) {
        self.warned.retain(|other| *other != quantity);
        self.warned.extend(is_on.then_some(quantity));
    }

    /// The operator acts at the pendant.
    pub(crate) fn press(&mut self, now: Ticks, action: PendantAction) {
        match action {
            PendantAction::PressEStop => {
                self.button_latched = true;
                self.emergency_stop();
            }
            PendantAction::ReleaseEStop => self.button_latched = false,
            PendantAction::ShiftIdle if !self.button_latched => {
                self.velocity_fault = false;
                self.second_look = None;
                self.torque = Health::Safe;
                self.heartbeat_fault = false;
                self.idle();
            }
            PendantAction::ShiftActivate if self.mode == SafetyMode::Idle && !self.pendant().has_faults() => {
                self.mode = SafetyMode::Active;
                self.heartbeat_due = self.config.heartbeat.map(|longest| now + longest);
                self.outgoing.push(safety_broadcast(MotorMode::Torque));
            }
            PendantAction::ShiftIdle | PendantAction::ShiftActivate => {}
        }
    }

    /// Any frame on the bus, complete at `at`.
    pub(crate) fn hear(&mut self, at: Ticks, frame: &CanFrame) {
        if let Ok(Reply::Position { node, primary, .. }) = Reply::decode(frame) {
            self.hear_position(at, node, primary);
        } else if let Ok(request) = Request::decode(frame) {
            self.hear_request(at, &request);
        }
    }

    /// When the module acts next by itself.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        [self.inbox.next_time(), self.heartbeat_due, self.positions_stale_at(), self.second_look]
            .into_iter()
            .flatten()
            .min()
    }

    /// Does one thing that is due by `now`.
    pub(crate) fn step(&mut self, now: Ticks) {
        if self.heartbeat_due.is_some_and(|due| due <= now) {
            self.heartbeat_fault = true;
            self.idle();
        } else if self.positions_stale_at().is_some_and(|due| due <= now) {
            self.positions = None;
        } else if self.second_look.is_some_and(|due| due <= now) {
            self.second_look = None;
            if self.is_too_fast() {
                self.emergency_stop();
            }
        } else if let Some(action) = self.inbox.take(now) {
            self.carry_out(now, action);
        }
    }

    /// Frames to send, in order.
    pub(crate) fn take_outgoing(&mut self) -> Vec<CanFrame> {
        std::mem::take(&mut self.outgoing)
    }

    /// Longest pause between positions before the flow counts as broken.
    fn positions_stale_at(&self) -> Option<Ticks> {
        const GAP: Ticks = 100 * TICKS_PER_MILLISECOND;
        self.positions.map(|(_, latest)| latest + GAP)
    }

    fn hear_position(&mut self, at: Ticks, node: Node, counts: Counts) {
        if self.mode == SafetyMode::EStop || !self.speed.hear(at, node, counts, self.zeroed_since.is_some()) {
            return;
        }
        let since = self.positions.map_or(at, |(since, _)| since);
        self.positions = Some((since, at));
        if self.mode == SafetyMode::Active {
            self.heartbeat_due = self.config.heartbeat.map(|longest| at + longest);
        }
        if self.is_too_fast() {
            if self.ignored_faults > 0 {
                self.ignored_faults -= 1;
                self.speed.forgive();
                return;
            }
            self.velocity_fault = true;
            self.second_look = self.second_look.or(Some(at + SECOND_LOOK));
            if self.mode == SafetyMode::Active {
                self.idle();
            }
        }
    }

    fn hear_request(&mut self, at: Ticks, request: &Request) {
        let is_arm_torque = matches!(request.to, Destination::Group(Group::ARM_TORQUES | Group::WRIST_TORQUES));
        match request.action {
            Action::PackedTorques { torques, .. } if is_arm_torque => {
                let largest = torques.iter().map(|torque| i32::from(torque.units()).abs()).max().unwrap_or(0);
                self.judge_torque(largest);
            }
            action if request.to == Destination::Node(Node::SAFETY_MODULE) => self.inbox.receive(at, action),
            _ => {}
        }
    }

    /// The torque *commanded on the bus* counts, whatever MT would clip it to (trap T7).
    fn judge_torque(&mut self, largest: i32) {
        if self.mode == SafetyMode::EStop || self.torque == Health::Fault {
            return;
        }
        self.torque = if largest > self.limit(Property::Tl2) {
            Health::Fault
        } else if largest > self.limit(Property::Tl1) {
            Health::Warning
        } else {
            Health::Safe
        };
        if self.torque == Health::Fault && self.mode == SafetyMode::Active {
            self.idle();
        }
    }

    fn carry_out(&mut self, now: Ticks, action: Action) {
        match action {
            Action::Get { property: id } => {
                let Some(property) = self.numbers.property(id) else {
                    return;
                };
                let Some(value) = self.value(property) else {
                    return;
                };
                let node = Node::SAFETY_MODULE;
                // PEN needs 28 bits although no second number is reserved for it.
                let is_wide = property.is_wide() || property == Property::Pen;
                self.outgoing.push(if is_wide { reply32(node, id, value) } else { reply16(node, id, value as i16) });
            }
            Action::Set { property: id, value } => {
                if let Some(property) = self.numbers.property(id) {
                    self.set(now, property, i32::from(value as i16));
                }
            }
            Action::PackedTorques { .. } => {}
        }
    }

    fn value(&self, property: Property) -> Option<i32> {
        Some(match property {
            Property::Vers => self.config.version.into(),
            Property::Role => Role::SAFETY.into(),
            Property::Stat => Status::Ready.value(),
            Property::Id => Node::SAFETY_MODULE.number().into(),
            Property::Sn | Property::Error | Property::Safe => 0,
            Property::Mode => self.mode.value(),
            Property::Zero => self.zeroed_since.is_some().into(),
            Property::Pen => self.pendant().value(),
            other => self.limits.get(other)?,
        })
    }

    fn set(&mut self, now: Ticks, property: Property, value: i32) {
        match property {
            // Software can only go down, and only newer firmware listens at all.
            Property::Mode if self.config.version >= 197 => match SafetyMode::from_value(value) {
                Some(SafetyMode::EStop) => self.emergency_stop(),
                Some(SafetyMode::Idle) if self.mode == SafetyMode::Active => self.idle(),
                _ => {}
            },
            Property::Zero if value != 0 => self.zeroed_since = self.zeroed_since.or(Some(now)),
            Property::Zero => self.zeroed_since = None,
            Property::Ifault => self.ignored_faults = value.max(0),
            // The value of LOAD names a property; the library sends DEF with the same value just before.
            Property::Load => {
                let named =
                    u8::try_from(value).ok().and_then(puck::PropertyId::new).and_then(|id| self.numbers.property(id));
                if let Some((property, default)) = FACTORY.iter().find(|(property, _)| Some(*property) == named) {
                    self.limits.set(*property, *default);
                }
            }
            other => self.limits.set(other, value),
        }
    }

    fn is_too_fast(&self) -> bool {
        let limit = self.velocity_limit(Property::Vl2);
        // VL2 = 0 switches the supervision off.
        limit > 0.0 && self.speed.latest().is_some_and(|speed| speed > limit)
    }

    fn velocity_limit(&self, property: Property) -> f64 {
        f64::from(self.limit(property)) / VELOCITY_UNIT
    }

    fn limit(&self, property: Property) -> i32 {
        self.limits.of(property)
    }

    fn idle(&mut self) {
        self.mode = SafetyMode::Idle;
        self.heartbeat_due = None;
        self.outgoing.push(safety_broadcast(MotorMode::Idle));
    }

    /// Motor power goes, and with it the positions: the arm is no longer zeroed (ZERO = 0 here is assumed).
    fn emergency_stop(&mut self) {
        self.mode = SafetyMode::EStop;
        self.zeroed_since = None;
        self.heartbeat_due = None;
        self.second_look = None;
        self.positions = None;
        self.ignored_faults = 0;
        self.speed.clear();
    }
}
