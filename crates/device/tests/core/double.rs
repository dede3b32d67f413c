//! A small double of the arm's bus: seven pucks, a force/torque sensor, a safety module and perhaps a hand, spoken to
//! in frames.
//!
//! It answers as docs/barrett-can.md says that devices answer, through the device side of the `puck` crate, and logs
//! every frame with its time. There is no arbitration and no physics: an arm of this double stands still.

use std::collections::VecDeque;

use crate::digit::Digit;
use control::CycleRecord;
use device::time::SLOT_HZ;
use device::{Command, Controller, ControllerIo, DeviceController, Event, EventKind, Slot, Stage};
use link::HandStage;
use pinned_init::InPlaceWrite;
use puck::device::{force_frame, position_frame, reply16, reply32, safety_broadcast, torque_frame};
use puck::{
    Action, CanFrame, Counts, Destination, Group, MotorMode, Node, Property, PropertyId, PropertyTable, PuckTorque,
    RawWrench, Request, Role, SafetyMode, Status,
};

/// From the last bit of a request to the first of its answer, us.
const LATENCY_US: u64 = 200;
/// From the wake to the first answer, us.
pub(crate) const BOOT_US: u64 = 500_000;
/// A start-up repeats its stop frames for so long, us, and no longer.
pub(crate) const STOPS_US: u64 = 510_000;
/// VERS of the boot loader: deliberately one that would choose wrong property numbers.
pub(crate) const MONITOR_VERSION: i32 = 90;

/// A motor puck.
#[derive(Clone, Debug)]
pub(crate) struct Puck {
    pub(crate) present: bool,
    pub(crate) never_wakes: bool,
    pub(crate) ignores_position_writes: bool,
    pub(crate) awake_at: Option<u64>,
    pub(crate) version: i32,
    pub(crate) position: Counts,
    /// Counts less the absolute angle of the motor; `None`: this puck has no such encoder.
    pub(crate) beyond_angle: Option<i32>,
    pub(crate) mode: MotorMode,
    pub(crate) torque: PuckTorque,
    pub(crate) groups: [i32; 3],
    pub(crate) place: i32,
    pub(crate) torque_limit: i32,
    pub(crate) poles: i32,
    pub(crate) torque_counts: i32,
    /// Answers to position requests that are lost from now on.
    pub(crate) lose: u32,
    /// The next answer to a position request comes this much later, us.
    pub(crate) delay_us: u64,
    /// Ordinary answers that are lost from now on.
    pub(crate) lose_properties: u32,
}

impl Puck {
    fn new(joint: usize) -> Puck {
        let wrist = joint >= 4;
        Puck {
            present: true,
            never_wakes: false,
            ignores_position_writes: false,
            awake_at: None,
            version: 200,
            position: Counts(100 + joint as i32),
            beyond_angle: Some(-1234 * joint as i32),
            mode: MotorMode::Idle,
            torque: PuckTorque::ZERO,
            groups: [0, if wrist { 2 } else { 1 }, 4],
            place: if wrist { joint as i32 - 3 } else { joint as i32 + 1 },
            torque_limit: [4860, 4860, 4860, 4320, 3900, 3900, 1600][joint],
            poles: [12, 12, 12, 12, 8, 8, 6][joint],
            torque_counts: [2472, 2472, 2472, 2472, 6105, 6105, 21400][joint],
            lose: 0,
            delay_us: 0,
            lose_properties: 0,
        }
    }

    /// Value of a property; `None` if it does not answer. Joints count from 0.
    fn value(&self, property: Property, awake: bool, joint: usize) -> Option<i32> {
        Some(match property {
            Property::Stat => if awake { Status::Ready } else { Status::Reset }.value(),
            Property::Role => self.beyond_angle.map_or(0, |_| Role::ABSOLUTE_ANGLE.into()),
            Property::Mech => self.position.0.wrapping_sub(self.beyond_angle?).rem_euclid(4096),
            Property::Vers => {
                if awake {
                    self.version
                } else {
                    MONITOR_VERSION
                }
            }
            Property::Cts => 4096,
            Property::Ipnm => self.torque_counts,
            Property::Pidx => self.place,
            Property::Grpa => self.groups[0],
            Property::Grpb => self.groups[1],
            Property::Grpc => self.groups[2],
            Property::Mt => self.torque_limit,
            Property::Poles => self.poles,
            Property::Mode => self.mode.value(),
            Property::Temp => 30 + joint as i32,
            // A puck that has reset under the slow polls: the number means something else to its monitor.
            _ if !awake => return None,
            other => panic!("the core asked puck {} for {other:?}", joint + 1),
        })
    }
}

/// The bus with everything on it.
pub(crate) struct Bus {
    pub(crate) now_us: u64,
    pub(crate) slot: Slot,
    /// Every frame the core sent, with its time.
    pub(crate) log: Vec<(u64, CanFrame)>,
    pub(crate) events: Vec<EventKind>,
    pub(crate) records: Vec<CycleRecord>,
    pub(crate) commands: VecDeque<Command>,
    pub(crate) pucks: [Puck; 7],
    pub(crate) digits: [Digit; 4],
    pub(crate) powered: bool,
    pub(crate) safety_present: bool,
    pub(crate) safety_mode: SafetyMode,
    pub(crate) safety_version: i32,
    pub(crate) safety_role: i32,
    pub(crate) safety_zero: bool,
    /// VL1, VL2, TL1, TL2 of the safety module.
    pub(crate) safety_limits: [i32; 4],
    pub(crate) sensor_present: bool,
    pub(crate) sensor_awake_at: Option<u64>,
    pub(crate) sensor: RawWrench,
    /// True while its measurements do not arrive.
    pub(crate) lose_wrenches: bool,
    /// The controller has no room for this many more frames.
    pub(crate) refuse: u32,
    /// The controller takes no torque frames.
    pub(crate) refuse_torques: bool,
    /// Nobody hears the controller, though it takes its frames.
    pub(crate) deaf: bool,
    /// Writes to the safety module that are lost from now on.
    pub(crate) lose_safety_writes: u32,
    /// The mode that the safety module tells next, once, instead of its own.
    pub(crate) wrong_safety_mode: Option<SafetyMode>,
    /// When a button of the pendant was pressed last.
    pressed_us: u64,
    ticks: u64,
    /// Every answer of a device, with the time of its request.
    pub(crate) answers: Vec<(u64, CanFrame)>,
    on_the_wire: Vec<(u64, CanFrame)>,
    received: VecDeque<CanFrame>,
}

impl Bus {
    /// An arm in E-STOP that has just got power.
    pub(crate) fn in_emergency_stop() -> Bus {
        Bus {
            now_us: 0,
            slot: Slot::Request,
            log: Vec::new(),
            events: Vec::new(),
            records: Vec::new(),
            commands: VecDeque::new(),
            pucks: std::array::from_fn(Puck::new),
            digits: std::array::from_fn(Digit::new),
            powered: false,
            safety_present: true,
            safety_mode: SafetyMode::EStop,
            safety_version: 197,
            safety_role: 2,
            safety_zero: false,
            safety_limits: [2048, 4096, 4731, 5204],
            sensor_present: true,
            sensor_awake_at: None,
            sensor: RawWrench { force: [256, 0, 0], torque: [0, 0, 0], status: None },
            lose_wrenches: false,
            refuse: 0,
            refuse_torques: false,
            deaf: false,
            lose_safety_writes: 0,
            wrong_safety_mode: None,
            pressed_us: 0,
            ticks: 0,
            answers: Vec::new(),
            on_the_wire: Vec::new(),
            received: VecDeque::new(),
        }
    }

    /// An arm that a person has released and set to IDLE; its pucks sleep.
    pub(crate) fn idle() -> Bus {
        let mut bus = Bus::in_emergency_stop();
        bus.press_idle();
        bus
    }

    /// An arm that had been started and zeroed before the device was reset.
    pub(crate) fn already_zeroed() -> Bus {
        let mut bus = Bus::idle();
        bus.safety_zero = true;
        bus.sensor_awake_at = Some(0);
        for puck in &mut bus.pucks {
            puck.awake_at = Some(0);
        }
        bus
    }

    /// The same bus with a hand, asleep.
    pub(crate) fn with_hand(mut self) -> Bus {
        for digit in &mut self.digits {
            digit.present = true;
        }
        self
    }

    /// The emergency stop is released and Shift-Idle pressed.
    pub(crate) fn press_idle(&mut self) {
        if !self.powered {
            self.powered = true;
            self.safety_zero = false;
            self.sensor_awake_at = None;
            for puck in &mut self.pucks {
                puck.awake_at = None;
            }
            for digit in &mut self.digits {
                digit.lose_power();
            }
        }
        self.set_modes(SafetyMode::Idle, MotorMode::Idle);
    }

    /// Shift-Activate is pressed.
    pub(crate) fn press_activate(&mut self) {
        self.set_modes(SafetyMode::Active, MotorMode::Torque);
    }

    /// The emergency stop is pressed: the pucks lose power.
    pub(crate) fn press_emergency_stop(&mut self) {
        self.safety_mode = SafetyMode::EStop;
        self.powered = false;
    }

    /// The safety module sets the pucks' mode and says so on 0x540.
    fn set_modes(&mut self, safety: SafetyMode, motors: MotorMode) {
        self.safety_mode = safety;
        self.pressed_us = self.now_us;
        for puck in &mut self.pucks {
            puck.mode = motors;
            puck.torque = PuckTorque::ZERO;
        }
        self.inject(safety_broadcast(motors));
    }

    /// A frame that appears on the bus by itself.
    pub(crate) fn inject(&mut self, frame: CanFrame) {
        self.on_the_wire.push((self.now_us, frame));
    }

    /// Runs the core for some slots.
    pub(crate) fn run_slots(&mut self, core: &mut DeviceController, slots: usize) {
        for _ in 0..slots {
            self.now_us = self.ticks * 1_000_000 / u64::from(SLOT_HZ);
            self.on_the_wire.sort_by_key(|(due, _)| *due);
            let due = self.on_the_wire.partition_point(|(due, _)| *due <= self.now_us);
            self.received.extend(self.on_the_wire.drain(..due).map(|(_, frame)| frame));
            let slot = self.slot;
            core.slot(slot, self.now_us, self);
            self.slot = slot.next();
            self.ticks += 1;
        }
    }

    /// Runs the core for this long, s.
    pub(crate) fn run(&mut self, core: &mut DeviceController, seconds: f64) {
        self.run_slots(core, (seconds * f64::from(SLOT_HZ)) as usize);
    }

    /// Runs until the core has reached a stage; panics after ten seconds.
    pub(crate) fn run_until(&mut self, core: &mut DeviceController, stage: Stage) {
        for _ in 0..9_000 {
            if core.stage() == stage {
                return;
            }
            self.run_slots(core, 1);
        }
        panic!("stuck in {:?}, {:?}; events {:?}", core.stage(), core.health().blocked, self.events);
    }

    /// Runs until the next slot is this one.
    pub(crate) fn run_to(&mut self, core: &mut DeviceController, slot: Slot) {
        while self.slot != slot {
            self.run_slots(core, 1);
        }
    }

    /// All torques that were sent since the frame with this index of the log.
    pub(crate) fn torques_since(&self, index: usize) -> impl Iterator<Item = PuckTorque> + '_ {
        self.log[index..].iter().flat_map(|(_, frame)| match Request::decode(frame).map(|request| request.action) {
            Ok(Action::PackedTorques { torques, .. }) => torques.to_vec(),
            _ => Vec::new(),
        })
    }

    /// Place of the first frame of the cyclic loop in the log, if it has begun: a request for positions, and in the
    /// same slot one for a wrench, or torques in the next. Torques before `STOPS_US` are stop frames.
    pub(crate) fn loop_begins(&self) -> Option<usize> {
        let begins = |(time, frame): &(u64, CanFrame)| match Request::decode(frame).expect("a request").action {
            Action::Get { property: PropertyId::FORCE_TORQUE } => true,
            Action::PackedTorques { .. } => *time > STOPS_US,
            _ => false,
        };
        Some(self.log.iter().position(begins)? - 1)
    }

    /// All SETs that were sent, with their time.
    pub(crate) fn sets(&self) -> impl Iterator<Item = (u64, Destination, PropertyId, i32)> + '_ {
        self.log.iter().filter_map(|(time, frame)| match Request::decode(frame) {
            Ok(Request { to, action: Action::Set { property, value }, .. }) => Some((*time, to, property, value)),
            _ => None,
        })
    }

    fn answer(&mut self, delay_us: u64, frame: CanFrame) {
        self.answers.push((self.now_us, frame));
        self.on_the_wire.push((self.now_us + LATENCY_US + delay_us, frame));
    }

    fn answer_value(&mut self, node: Node, property: PropertyId, value: i32, wide: bool) {
        let frame = if wide { reply32(node, property, value) } else { reply16(node, property, value as i16) };
        self.answer(0, frame);
    }

    /// Has the devices act on a frame of the controller.
    fn serve(&mut self, frame: CanFrame) {
        let request = Request::decode(&frame).expect("every frame of the core is a valid request");
        assert_eq!(request.sender, Node::HOST);
        if self.safety_present && request.to == Destination::Node(Node::SAFETY_MODULE) {
            self.serve_safety(request.action);
        }
        if !self.powered {
            return;
        }
        for (joint, node) in Node::ARM.into_iter().enumerate() {
            let member = match request.to {
                Destination::Node(to) => to == node,
                Destination::Group(group) => self.pucks[joint].groups.contains(&i32::from(group.number())),
            };
            if member && self.pucks[joint].present {
                self.serve_puck(joint, node, request.action);
            }
        }
        for (index, node) in Node::HAND.into_iter().enumerate() {
            if self.digits[index].present && self.digits[index].hears(node, request.to) {
                for frame in self.digits[index].serve(node, self.now_us, request.action) {
                    self.answer(75 * index as u64, frame);
                }
            }
        }
        if self.sensor_present && request.to == Destination::Node(Node::FORCE_TORQUE) {
            self.serve_sensor(request.action);
        }
    }

    fn serve_safety(&mut self, action: Action) {
        let table = PropertyTable::safety(self.safety_version.clamp(1, 255)).expect("in range");
        let node = Node::SAFETY_MODULE;
        match action {
            Action::Get { property } => {
                let value = match table.property(property) {
                    Some(Property::Stat) => Status::Ready.value(),
                    Some(Property::Role) => self.safety_role,
                    Some(Property::Vers) => self.safety_version,
                    Some(Property::Mode) => self.wrong_safety_mode.take().unwrap_or(self.safety_mode).value(),
                    Some(Property::Zero) => i32::from(self.safety_zero),
                    Some(Property::Pen) => 0x0F3F_1249,
                    Some(Property::Vl1) => self.safety_limits[0],
                    Some(Property::Vl2) => self.safety_limits[1],
                    Some(Property::Tl1) => self.safety_limits[2],
                    Some(Property::Tl2) => self.safety_limits[3],
                    other => panic!("the core asked the safety module for {other:?}"),
                };
                self.answer_value(node, property, value, table.property(property) == Some(Property::Pen));
            }
            Action::Set { .. } if self.lose_safety_writes > 0 => self.lose_safety_writes -= 1,
            Action::Set { property, value } => match table.property(property) {
                Some(Property::Zero) => self.safety_zero = value == 1,
                Some(Property::Mode) => {
                    if value < self.safety_mode.value() {
                        assert_eq!(value, SafetyMode::Idle.value(), "the core pulled the emergency stop");
                        self.press_idle();
                    }
                }
                Some(Property::Def | Property::Load | Property::Ifault) => {}
                other => panic!("the core wrote {other:?} of the safety module"),
            },
            Action::PackedTorques { .. } => panic!("torques to the safety module"),
        }
    }

    fn serve_puck(&mut self, joint: usize, node: Node, action: Action) {
        let now_us = self.now_us;
        let puck = &mut self.pucks[joint];
        let awake = match puck.awake_at {
            // Silent while it boots.
            Some(at) if now_us < at => return,
            Some(_) => true,
            None => false,
        };
        let table = if awake { PropertyTable::motor(puck.version).ok() } else { Some(PropertyTable::monitor()) };
        // An unknown firmware still answers the properties that never move.
        let table = table.unwrap_or(PropertyTable::monitor());
        match action {
            Action::Get { property: PropertyId::POSITION } if awake => {
                if puck.lose > 0 {
                    puck.lose -= 1;
                    return;
                }
                let delay_us = std::mem::take(&mut puck.delay_us) + 75 * joint as u64;
                let frame = position_frame(node, puck.position, None);
                self.answer(delay_us, frame);
            }
            Action::Get { property } => {
                // An unknown property has no answer.
                let Some(name) = table.property(property) else {
                    return;
                };
                if puck.lose_properties > 0 {
                    puck.lose_properties -= 1;
                    return;
                }
                if let Some(value) = puck.value(name, awake, joint) {
                    self.answer_value(node, property, value, name.is_wide());
                }
            }
            Action::Set { property: PropertyId::STAT, value } => {
                assert_eq!(value, Status::Ready.value(), "the core reset a puck");
                if !awake && !puck.never_wakes {
                    puck.awake_at = Some(now_us + BOOT_US);
                }
            }
            // The monitor knows nothing but STAT.
            Action::Set { .. } if !awake => {}
            Action::Set { property: PropertyId::MODE, value } => {
                assert_eq!(value, MotorMode::Idle.value(), "only the safety module may set TORQUE");
                puck.mode = MotorMode::Idle;
            }
            Action::Set { property: PropertyId::POSITION, value } => {
                // A person may activate between the question and the write; nobody can prevent that.
                let active = puck.mode != MotorMode::Idle && now_us > self.pressed_us + 100_000;
                assert!(!active, "zeroed under torque");
                if !puck.ignores_position_writes {
                    puck.beyond_angle =
                        puck.beyond_angle.map(|counts| counts.wrapping_add(value).wrapping_sub(puck.position.0));
                    puck.position = Counts(value);
                }
            }
            Action::Set { property, value } => {
                panic!("the core set {property:?} of puck {} to {value}", joint + 1)
            }
            Action::PackedTorques { property, .. } if awake => {
                assert_eq!(property, PropertyId::TORQUE);
                if let (MotorMode::Torque, Some(torque)) = (puck.mode, action.torque_for(puck.place as u8)) {
                    puck.torque = torque;
                }
            }
            Action::PackedTorques { .. } => {}
        }
    }

    fn serve_sensor(&mut self, action: Action) {
        let awake = match self.sensor_awake_at {
            Some(at) if self.now_us < at => return,
            Some(_) => true,
            None => false,
        };
        match action {
            Action::Get { property: PropertyId::STAT } => {
                let status = if awake { Status::Ready } else { Status::Reset };
                self.answer_value(Node::FORCE_TORQUE, PropertyId::STAT, status.value(), false);
            }
            Action::Get { property: PropertyId::FORCE_TORQUE } if self.lose_wrenches => {}
            Action::Get { property: PropertyId::FORCE_TORQUE } if awake => {
                self.answer(0, force_frame(self.sensor.force));
                self.answer(0, torque_frame(self.sensor.torque, self.sensor.status));
            }
            Action::Set { property: PropertyId::STAT, .. } if !awake => {
                self.sensor_awake_at = Some(self.now_us + BOOT_US);
            }
            // Woken once more by a core to which something else said that it sleeps.
            Action::Set { property: PropertyId::STAT, .. } => {}
            Action::Set { property: PropertyId::FORCE_TORQUE, value: 0 } => {}
            // The monitor knows nothing but STAT.
            _ if !awake => {}
            other => panic!("the core asked the sensor for {other:?}"),
        }
    }
}

impl ControllerIo<DeviceController> for Bus {
    fn receive(&mut self) -> Option<CanFrame> {
        self.received.pop_front()
    }

    fn transmit(&mut self, frame: CanFrame) -> bool {
        if self.refuse > 0 {
            self.refuse -= 1;
            return false;
        }
        let is_torque =
            || matches!(Request::decode(&frame), Ok(request) if matches!(request.action, Action::PackedTorques { .. }));
        if self.refuse_torques && is_torque() {
            return false;
        }
        self.log.push((self.now_us, frame));
        if !self.deaf {
            self.serve(frame);
        }
        true
    }

    fn command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    fn record(&mut self, record: CycleRecord) {
        self.records.push(record);
    }

    fn event(&mut self, event: Event) {
        self.events.push(event.kind);
    }
}

/// Home of the arm, rad.
pub(crate) const HOME: [f32; 7] = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];

/// A core that has just got power.
pub(crate) fn silent_device() -> Box<DeviceController> {
    let Ok(core) = Box::new_uninit().write_init(DeviceController::init());
    core
}

/// A core and its bus, started, zeroed at home and waiting for Shift-Activate.
pub(crate) fn started() -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    (core, bus)
}

/// A core and its bus with a hand, activated, holding; the hand is not initialised.
pub(crate) fn holding_with_hand() -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: [0.1, 0.5, 0.1, 1.5, 0.1, 0.2, 0.1] });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    bus.run(&mut core, 0.1);
    bus.commands.push_back(control::Command::Hold.into());
    bus.run(&mut core, 1.0);
    assert_eq!(core.health().state, control::State::Hold, "{:?}", bus.events);
    (core, bus)
}

/// The same, with an initialised hand.
pub(crate) fn holding_with_ready_hand() -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = holding_with_hand();
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 7.0);
    assert_eq!(core.health().hand, HandStage::Ready, "{:?}", bus.events);
    (core, bus)
}

/// The same as [`started`], activated and floating under gravity compensation away from the joint limits.
pub(crate) fn floating() -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: [0.1, 0.5, 0.1, 1.5, 0.1, 0.2, 0.1] });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    bus.run(&mut core, 0.1);
    bus.commands.push_back(control::Command::Gravity.into());
    bus.run(&mut core, 1.0);
    assert_eq!(core.health().state, control::State::Gravity, "{:?}", bus.events);
    (core, bus)
}

/// True if the group's members are the whole arm.
pub(crate) const ARM: Destination = Destination::Group(Group::ARM);
