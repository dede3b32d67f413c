//! `Survey`: the properties that are read of the arm's pucks during start-up, the answers of all devices, and the
//! checks that they must pass. The properties of the hand's pucks are in `hand.rs`.

use control::{Calibration, Payload};
use puck::{Node, Property, PropertyId, PropertyTable, Role};

use crate::stage::StartupError;

/// Number of nodes an identifier can name.
const NODES: usize = 32;

/// Answers of one node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// STAT, once it answered at all.
    pub(crate) status: Option<i32>,
    /// VERS, as last read: of the monitor while STAT is 0.
    pub(crate) version: Option<i32>,
    /// ROLE of a puck of the arm.
    pub(crate) role: Option<Role>,
}

/// Properties that are read of each arm puck, in this order.
pub(crate) const DRIVE_PROPERTIES: [Property; 8] = [
    Property::Cts,
    Property::Ipnm,
    Property::Pidx,
    Property::Grpa,
    Property::Grpb,
    Property::Grpc,
    Property::Mt,
    Property::Poles,
];

/// Poles of the wrist motor M7. Gimbals have 8 on that puck, and another kinematics.
const WRIST_POLES: i32 = 6;
/// Largest torque a packed frame can carry; an MT beyond it is a misread value.
pub(super) const PACKING_LIMIT: i32 = 8191;

/// The numbers of the safety module's properties that the device uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SafetyProperties {
    pub(crate) default: PropertyId,
    pub(crate) load: PropertyId,
    /// VL1, VL2, TL1, TL2: reloaded because their power-up values are not the stored ones.
    pub(crate) limits: [PropertyId; 4],
    pub(crate) zero: PropertyId,
    pub(crate) ignore_faults: PropertyId,
    pub(crate) pendant: PropertyId,
    /// True if MODE may be written (to a lower one): from VERS 197.
    pub(crate) mode_is_writable: bool,
}

/// First safety firmware that accepts a SET of MODE.
const WRITABLE_MODE: i32 = 197;

impl SafetyProperties {
    /// The numbers for this VERS; `None` if there is no table for it or it lacks one.
    fn new(version: i32) -> Option<SafetyProperties> {
        let table = PropertyTable::safety(version).ok()?;
        Some(SafetyProperties {
            default: table.id(Property::Def)?,
            load: table.id(Property::Load)?,
            limits: [
                table.id(Property::Vl1)?,
                table.id(Property::Vl2)?,
                table.id(Property::Tl1)?,
                table.id(Property::Tl2)?,
            ],
            zero: table.id(Property::Zero)?,
            ignore_faults: table.id(Property::Ifault)?,
            pendant: table.id(Property::Pen)?,
            mode_is_writable: version >= WRITABLE_MODE,
        })
    }
}

#[cfg(test)]
impl SafetyProperties {
    /// Those of VERS 197.
    pub(crate) fn for_tests() -> SafetyProperties {
        SafetyProperties::new(197).expect("a known firmware")
    }
}

/// Everything the start-up has learned about the bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Survey {
    nodes: [Seen; NODES],
    drives: [[i32; DRIVE_PROPERTIES.len()]; 7],
}

impl Survey {
    /// Nothing known.
    pub(crate) const fn new() -> Survey {
        Survey {
            nodes: [Seen { status: None, version: None, role: None }; NODES],
            drives: [[0; DRIVE_PROPERTIES.len()]; 7],
        }
    }

    /// Answers of a node so far.
    pub(crate) fn seen(&self, node: Node) -> Seen {
        self.nodes.get(usize::from(node.number())).copied().unwrap_or_default()
    }

    /// The place to note what a node says.
    fn entry(&mut self, node: Node) -> &mut Seen {
        // A node number is at most 31; the remainder only spares a panic path.
        &mut self.nodes[usize::from(node.number()) % NODES]
    }

    /// The node answered with this STAT.
    pub(crate) fn note_status(&mut self, node: Node, status: i32) {
        self.entry(node).status = Some(status);
    }

    /// The node answered with this VERS.
    pub(crate) fn note_version(&mut self, node: Node, version: i32) {
        self.entry(node).version = Some(version);
    }

    /// True if the node answered in the latest enumeration.
    pub(crate) fn is_present(&self, node: Node) -> bool {
        self.seen(node).status.is_some()
    }

    /// The puck of the arm answered with this ROLE.
    pub(crate) fn note_role(&mut self, node: Node, role: i32) {
        self.entry(node).role = Some(Role::from_value(role));
    }

    /// Counts of a motor's revolution (CTS), as read; 0 before that.
    pub(crate) fn counts_per_revolution(&self, joint: usize) -> i32 {
        self.drives.get(joint).map_or(0, |[counts, ..]| *counts)
    }

    /// The first puck of the arm that is missing.
    pub(crate) fn missing_puck(&self) -> Option<Node> {
        Node::ARM.into_iter().find(|node| !self.is_present(*node))
    }

    /// The devices of the arm that answered: pucks 1 to 7, then the force/torque sensor.
    pub(crate) fn devices(&self) -> impl Iterator<Item = Node> + use<> {
        let sensor = self.is_present(Node::FORCE_TORQUE).then_some(Node::FORCE_TORQUE);
        Node::ARM.into_iter().chain(sensor)
    }

    /// Checks ROLE of a device of the arm, or of the safety module.
    pub(crate) fn check_role(&self, node: Node, role: i32) -> Result<(), StartupError> {
        let role = Role::from_value(role);
        let expected = match node {
            // Some sensors report no usable role.
            Node::FORCE_TORQUE => return Ok(()),
            Node::SAFETY_MODULE => Role::SAFETY,
            _ => Role::MOTOR,
        };
        if role.kind() == expected { Ok(()) } else { Err(StartupError::WrongRole { node, role: role.0 }) }
    }

    /// The property numbers of the safety module.
    pub(crate) fn safety_properties(&self) -> Result<SafetyProperties, StartupError> {
        let node = Node::SAFETY_MODULE;
        let version = self.seen(node).version.ok_or(StartupError::NoAnswer(node))?;
        SafetyProperties::new(version).ok_or(StartupError::UnknownFirmware { node, version })
    }

    /// The table of an arm puck that is awake. Firmware whose P and T are not 48 and 42 is refused: group requests and
    /// packed torques carry one number for all pucks.
    pub(crate) fn motor_table(&self, node: Node) -> Result<PropertyTable, StartupError> {
        let version = self.seen(node).version.ok_or(StartupError::NoAnswer(node))?;
        let unknown = StartupError::UnknownFirmware { node, version };
        let table = PropertyTable::motor(version).map_err(|_| unknown)?;
        let same_generation =
            table.id(Property::T) == Some(PropertyId::TORQUE) && table.id(Property::P) == Some(PropertyId::POSITION);
        if same_generation { Ok(table) } else { Err(unknown) }
    }

    /// One of [`DRIVE_PROPERTIES`] of an arm puck.
    pub(crate) fn note_drive(&mut self, joint: usize, item: usize, value: i32) {
        if let Some(place) = self.drives.get_mut(joint).and_then(|drive| drive.get_mut(item)) {
            *place = value;
        }
    }

    /// Checks everything read of the pucks and turns it into the scales of this arm.
    ///
    /// A puck in the wrong group, or at the wrong place of the torque frame, would apply the torque of another joint.
    pub(crate) fn calibration(&self) -> Result<Calibration<f32>, StartupError> {
        for (joint, (node, drive)) in (0_i32..).zip(Node::ARM.into_iter().zip(self.drives)) {
            let [_, _, place, group_a, group_b, group_c, limit, poles] = drive;
            let wrist = joint >= 4;
            let groups = [0, if wrist { 2 } else { 1 }, 4];
            if [group_a, group_b, group_c] != groups {
                return Err(StartupError::WrongGroups(node));
            }
            if place != if wrist { joint - 3 } else { joint + 1 } {
                return Err(StartupError::WrongPlace { node, place });
            }
            if !(1..=PACKING_LIMIT).contains(&limit) {
                return Err(StartupError::WrongTorqueLimit { node, limit });
            }
            if joint == 6 && poles != WRIST_POLES {
                return Err(StartupError::NotAWrist { poles });
            }
        }
        let payload = if self.is_present(Node::FORCE_TORQUE) { Payload::SensorAndHand } else { Payload::None };
        let counts_per_revolution = self.drives.map(|[counts, ..]| counts);
        let torque_counts = self.drives.map(|[_, torque, ..]| torque);
        Calibration::new(counts_per_revolution, torque_counts, payload).map_err(StartupError::Calibration)
    }
}
