//! A puck of the hand in the double of the bus.

use puck::device::{position_frame, reply16, reply32};
use puck::{
    Action, CanFrame, Counts, Destination, MotorMode, Node, Property, PropertyId, PropertyTable, PuckTorque, Status,
};

use crate::double::{BOOT_US, MONITOR_VERSION};

/// CMD of the initialisation.
const INITIALISE: i32 = 13;

/// Position of a puck before its initialisation: anything.
const UNINITIALISED: Counts = Counts(-31_000);

/// A puck of the hand.
#[derive(Clone, Debug)]
pub(crate) struct Digit {
    pub(crate) present: bool,
    pub(crate) never_wakes: bool,
    pub(crate) awake_at: Option<u64>,
    pub(crate) version: i32,
    pub(crate) role: i32,
    pub(crate) position: Counts,
    pub(crate) secondary: Option<Counts>,
    pub(crate) gauge: i32,
    pub(crate) mode: MotorMode,
    pub(crate) torque: PuckTorque,
    pub(crate) groups: [i32; 3],
    pub(crate) place: i32,
    pub(crate) counts: i32,
    pub(crate) torque_counts: i32,
    pub(crate) holds: bool,
    pub(crate) stall_ms: i32,
    /// Duration of its initialisation, us.
    pub(crate) work_us: u64,
    /// When its initialisation ends.
    working_until: Option<u64>,
    /// It has been initialised since it has power.
    pub(crate) initialised: bool,
    /// CMDs that are lost from now on.
    pub(crate) lose_commands: u32,
    /// SETs of MODE that are lost from now on.
    pub(crate) lose_modes: u32,
    /// Words to brake that are lost from now on, also one that would end an initialisation.
    pub(crate) lose_brakes: u32,
    /// Its temperature, degrees C.
    pub(crate) celsius: i32,
    /// Answers to position and gauge requests that are lost from now on.
    pub(crate) lose: u32,
    /// Answers about GRPA, which a start-up asks once it is awake, that are lost from now on.
    pub(crate) lose_groups: u32,
}

impl Digit {
    pub(crate) fn new(index: usize) -> Digit {
        let finger = index < 3;
        Digit {
            present: false,
            never_wakes: false,
            awake_at: None,
            version: 200,
            role: if finger { 0x0A05 } else { 0x0205 },
            position: UNINITIALISED,
            secondary: finger.then_some(Counts(31)),
            gauge: 2000 + index as i32,
            mode: MotorMode::Idle,
            torque: PuckTorque::ZERO,
            groups: [0, 7, 5],
            place: index as i32 + 1,
            counts: 4096,
            torque_counts: 20_000,
            holds: !finger,
            stall_ms: if finger { 50 } else { 150 },
            work_us: if finger { 2_500_000 } else { 1_200_000 },
            working_until: None,
            initialised: false,
            lose_commands: 0,
            lose_modes: 0,
            lose_brakes: 0,
            celsius: 41 + index as i32,
            lose: 0,
            lose_groups: 0,
        }
    }

    pub(crate) fn lose_power(&mut self) {
        (self.awake_at, self.working_until, self.initialised) = (None, None, false);
        (self.mode, self.torque, self.position) = (MotorMode::Idle, PuckTorque::ZERO, UNINITIALISED);
    }

    /// Its initialisation ends without having come to the stop.
    pub(crate) fn break_off(&mut self) {
        (self.working_until, self.mode) = (None, MotorMode::Idle);
    }

    pub(crate) fn hears(&self, node: Node, to: Destination) -> bool {
        match to {
            Destination::Node(to) => to == node,
            Destination::Group(group) => self.groups.contains(&i32::from(group.number())),
        }
    }

    /// Its answers to a frame.
    pub(crate) fn serve(&mut self, node: Node, now_us: u64, action: Action) -> Vec<CanFrame> {
        let awake = match self.awake_at {
            Some(at) if now_us < at => return Vec::new(),
            Some(_) => true,
            None => false,
        };
        if self.working_until.is_some_and(|until| now_us >= until) {
            self.working_until = None;
            self.initialised = true;
            self.position = Counts(0);
            self.secondary = self.secondary.map(|_| Counts(0));
            self.mode = if self.holds { MotorMode::Position } else { MotorMode::Idle };
        }
        let table = if awake { PropertyTable::motor(self.version).expect("known") } else { PropertyTable::monitor() };
        if self.working_until.is_some() {
            let harmless = matches!(
                action,
                Action::Get { property: PropertyId::MODE } | Action::Set { property: PropertyId::MODE, value: 0 }
            );
            assert!(harmless, "digit {} was disturbed in its initialisation by {action:?}", self.place);
        }
        match action {
            Action::Get { property: PropertyId::POSITION } if awake => {
                if self.is_lost() {
                    Vec::new()
                } else {
                    vec![position_frame(node, self.position, self.secondary)]
                }
            }
            Action::Get { property } => {
                let name = table.property(property);
                let value = name.and_then(|name| Some((name.is_wide(), self.value(name, awake)?)));
                match value {
                    None => Vec::new(),
                    Some((true, value)) => vec![reply32(node, property, value)],
                    Some((false, value)) => vec![reply16(node, property, value as i16)],
                }
            }
            Action::Set { property: PropertyId::STAT, value } => {
                assert_eq!(value, Status::Ready.value(), "the core reset a puck of the hand");
                if !awake && !self.never_wakes {
                    self.awake_at = Some(now_us + BOOT_US);
                }
                Vec::new()
            }
            Action::Set { .. } if !awake => Vec::new(),
            Action::Set { property, value } => {
                self.set(table.property(property), value, now_us);
                Vec::new()
            }
            Action::PackedTorques { property, .. } => {
                assert_eq!(property, PropertyId::TORQUE);
                let some = action.torque_for(self.place as u8).is_some_and(|torque| torque != PuckTorque::ZERO);
                assert!(self.initialised || !awake || !some, "torque to a hand that was never initialised");
                if let (true, MotorMode::Torque, Some(torque)) = (awake, self.mode, action.torque_for(self.place as u8))
                {
                    self.torque = torque;
                }
                Vec::new()
            }
        }
    }

    /// Value of a property; `None` if it does not answer.
    fn value(&mut self, property: Property, awake: bool) -> Option<i32> {
        let [group_a, group_b, group_c] = self.groups;
        Some(match property {
            Property::Sg if self.is_lost() => return None,
            Property::Grpa if self.lose_groups > 0 => {
                self.lose_groups -= 1;
                return None;
            }
            Property::Stat => if awake { Status::Ready } else { Status::Reset }.value(),
            Property::Role => self.role,
            Property::Vers => {
                if awake {
                    self.version
                } else {
                    MONITOR_VERSION
                }
            }
            Property::Cts => self.counts,
            Property::Ipnm => self.torque_counts,
            Property::Pidx => self.place,
            Property::Grpa => group_a,
            Property::Grpb => group_b,
            Property::Grpc => group_c,
            Property::Hold => i32::from(self.holds),
            Property::Mode => self.mode.value(),
            Property::Tstop => self.stall_ms,
            Property::Temp if awake => self.celsius,
            Property::Sg => self.gauge,
            _ if !awake => return None,
            other => panic!("the core asked digit {} for {other:?}", self.place),
        })
    }

    fn set(&mut self, property: Option<Property>, value: i32, now_us: u64) {
        match property {
            Some(Property::Cmd) => {
                assert_eq!(value, INITIALISE, "the core gave a digit another command");
                if self.lose_commands > 0 {
                    self.lose_commands -= 1;
                    return;
                }
                self.mode = MotorMode::Velocity;
                self.working_until = Some(now_us + self.work_us);
            }
            Some(Property::Mode) if value == MotorMode::Idle.value() && self.lose_brakes > 0 => {
                self.lose_brakes -= 1;
                // It works on, and may be asked what it does.
                self.working_until = None;
            }
            Some(Property::Mode) => {
                // Not the one that ends an initialisation: a new start of the bus asks it again, and must not be
                // blamed.
                if self.lose_modes > 0 && self.working_until.is_none() {
                    self.lose_modes -= 1;
                    return;
                }
                self.mode = MotorMode::from_value(value).expect("a mode");
                assert!(matches!(self.mode, MotorMode::Idle | MotorMode::Torque), "the core set {:?}", self.mode);
                self.torque = PuckTorque::ZERO;
                self.working_until = None;
            }
            Some(Property::Tstop) => self.stall_ms = value,
            other => panic!("the core set {other:?} of digit {} to {value}", self.place),
        }
    }

    fn is_lost(&mut self) -> bool {
        let lost = self.lose > 0;
        self.lose -= u32::from(lost);
        lost
    }
}
