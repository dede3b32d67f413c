//! A6: whatever the bus carries, decoding neither panics nor invents; what we encode, the other side reads back.

use embedded_can::{ExtendedId, Frame, Id};
use proptest::prelude::*;
use puck::device::{position_frame, quantise, reply16, reply32, torque_frame};
use puck::force_torque::NEWTON_PER_COUNT;
use puck::tactile::{TactileBlock, TactileTop};
use puck::{
    Action, CanFrame, CanId, Counts, Destination, GaugeStatus, Group, Node, PendantState, PropertyId, PuckTorque,
    Reply, ReplyError, Request, RequestError, get, packed_torques, set, set_short,
};

fn any_frame() -> impl Strategy<Value = CanFrame> {
    (0..=0x7FF_u16, prop::collection::vec(any::<u8>(), 0..=8))
        .prop_map(|(id, data)| CanFrame::from_slice(CanId::new(id).expect("eleven bits"), &data).expect("a frame"))
}

/// Number of random cases: that of the environment variable, which `cargo xtask fuzz` sets, or `usual`.
fn cases(variable: &str, usual: u32) -> u32 {
    std::env::var(variable).ok().and_then(|number| number.parse().ok()).unwrap_or(usual)
}

fn any_node() -> impl Strategy<Value = Node> {
    (1..=31_u8).prop_map(|number| Node::new(number).expect("a node"))
}

fn any_property() -> impl Strategy<Value = PropertyId> {
    (0..=127_u8).prop_map(|number| PropertyId::new(number).expect("a property"))
}

fn any_destination() -> impl Strategy<Value = Destination> {
    prop_oneof![
        any_node().prop_map(Destination::from),
        prop::sample::select(vec![0_u8, 1, 2, 4, 5, 13, 31])
            .prop_map(|number| Group::new(number).expect("a group").into()),
    ]
}

/// A driver's frame type that also has the frames our protocol does not know.
struct Foreign {
    id: Id,
    remote: bool,
    data: Vec<u8>,
}

impl Frame for Foreign {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Foreign> {
        (data.len() <= 8).then(|| Foreign { id: id.into(), remote: false, data: data.to_vec() })
    }
    fn new_remote(id: impl Into<Id>, _dlc: usize) -> Option<Foreign> {
        Some(Foreign { id: id.into(), remote: true, data: Vec::new() })
    }
    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }
    fn is_remote_frame(&self) -> bool {
        self.remote
    }
    fn id(&self) -> Id {
        self.id
    }
    fn dlc(&self) -> usize {
        self.data.len()
    }
    fn data(&self) -> &[u8] {
        &self.data
    }
}

#[test]
fn extended_and_remote_frames_are_refused() {
    let extended = Foreign::new(ExtendedId::new(0x426).expect("fits"), &[0x88, 0, 2, 0]).expect("a frame");
    assert_eq!(Reply::decode(&extended), Err(ReplyError::NotClassic));
    assert_eq!(Request::decode(&extended), Err(RequestError::NotClassic));
    assert_eq!(CanFrame::copy_of(&extended), None);
    let remote = Foreign::new_remote(CanId::new(0x426).expect("fits"), 4).expect("a frame");
    assert_eq!(Reply::decode(&remote), Err(ReplyError::NotClassic));
    assert_eq!(Request::decode(&remote), Err(RequestError::NotClassic));
    assert_eq!(CanFrame::copy_of(&remote), None);
    assert_eq!(<CanFrame as Frame>::new_remote(CanId::new(1).expect("fits"), 1), None);
    assert_eq!(<CanFrame as Frame>::new(ExtendedId::new(1).expect("fits"), &[]), None);
    assert_eq!(CanFrame::from_slice(CanId::new(1).expect("fits"), &[0; 9]), None);
}

#[test]
fn the_unsolicited_broadcasts_of_the_safety_module_are_recognised() {
    let frame = puck::device::safety_broadcast(puck::MotorMode::Torque);
    assert_eq!(format!("{frame:?}"), "0x540#88 00 02 00");
    assert_eq!(Reply::decode(&frame), Ok(Reply::SafetyBroadcast));
    // Whatever its payload turns out to be.
    let odd = CanFrame::from_slice(CanId::new(0x540).expect("fits"), &[1, 2, 3]).expect("a frame");
    assert_eq!(Reply::decode(&odd), Ok(Reply::SafetyBroadcast));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases("TACTUS_FUZZ_FRAMES", 20_000)))]

    #[test]
    fn a6_any_frame_is_read_or_refused_and_never_panics(frame in any_frame(), word in any::<i32>()) {
        let reply = Reply::decode(&frame);
        let request = Request::decode(&frame);
        let _ = PendantState::from_value(word).map(|state| state.display());
        // Nothing is both: a simulator and a master on one bus never mistake each other. The safety module's own
        // broadcast is the exception by its nature.
        prop_assert!(
            reply.is_err() || request.is_err() || frame.can_id().raw() == 0x540,
            "{frame:?} is both {reply:?} and {request:?}"
        );
        if frame.can_id().sender() == Node::HOST {
            prop_assert_eq!(reply, Err(ReplyError::FromHost));
        }
        // Through a driver's own frame type nothing changes.
        let foreign: Foreign = frame.convert().expect("a frame");
        prop_assert_eq!(Reply::decode(&foreign), reply);
        prop_assert_eq!(Request::decode(&foreign), request);
        prop_assert_eq!(CanFrame::copy_of(&foreign), Some(frame));
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn requests_round_trip(to in any_destination(), property in any_property(), value in any::<i32>()) {
        let expect = |action| Ok(Request { sender: Node::HOST, to, action });
        prop_assert_eq!(Request::decode(&get(to, property)), expect(Action::Get { property }));
        prop_assert_eq!(Request::decode(&set(to, property, value)), expect(Action::Set { property, value }));
        let short = set_short(to, property, value as i16);
        prop_assert_eq!(short.payload().len(), 4);
        prop_assert_eq!(Request::decode(&short), expect(Action::Set { property, value: value as i16 as i32 }));
    }

    #[test]
    fn packed_torques_round_trip(units in prop::array::uniform4(-8192..=8191_i16), property in any_property()) {
        let torques = units.map(|units| PuckTorque::new(units).expect("14 bits"));
        let to = Group::ARM_TORQUES;
        let request = Request::decode(&packed_torques(to, property, torques));
        let action = Action::PackedTorques { property, torques };
        prop_assert_eq!(request, Ok(Request { sender: Node::HOST, to: to.into(), action }));
    }

    #[test]
    fn torques_are_rounded_down_within_one_unit_and_saturated(units in -20_000.0..20_000.0_f64) {
        let packed = PuckTorque::from_units(units).expect("finite").units() as f64;
        let saturated = units.clamp(-8191.0, 8191.0);
        prop_assert!(packed <= saturated && saturated - packed < 1.0);
        prop_assert!(PuckTorque::new(8192).is_none() && PuckTorque::new(-8193).is_none());
    }

    #[test]
    fn replies_round_trip(node in any_node(), property in any_property(), value in any::<i32>()) {
        let short = value as i16;
        prop_assert_eq!(
            Reply::decode(&reply16(node, property, short)),
            Ok(Reply::Property { node, property, value: short as i32 })
        );
        prop_assert_eq!(Reply::decode(&reply32(node, property, value)), Ok(Reply::Property { node, property, value }));
    }

    #[test]
    fn positions_round_trip_in_22_bits(node in any_node(), primary in any::<i32>(), secondary in any::<Option<i32>>()) {
        let frame = position_frame(node, Counts(primary), secondary.map(Counts));
        let secondary = secondary.map(|counts| Counts(counts).wrapped());
        let primary = Counts(primary).wrapped();
        prop_assert!((-(1 << 21)..1 << 21).contains(&primary.0));
        prop_assert_eq!(Reply::decode(&frame), Ok(Reply::Position { node, primary, secondary }));
    }

    #[test]
    fn wrench_and_tactile_frames_round_trip(
        counts in any::<[i16; 3]>(),
        status in any::<Option<u8>>(),
        node in any_node(),
        sequence in 0..=4_u8,
        cells in prop::array::uniform5(0..4096_u16),
        map in 0..1_u32 << 24,
        values in prop::array::uniform10(0..16_u8),
    ) {
        let status = status.map(GaugeStatus);
        prop_assert_eq!(
            Reply::decode(&torque_frame(counts, status)),
            Ok(Reply::Torque { node: Node::FORCE_TORQUE, counts, status })
        );
        let block = TactileBlock { sequence, cells };
        prop_assert_eq!(Reply::decode(&block.frame(node)), Ok(Reply::TactileFull { node, block }));
        let top = TactileTop { map, values };
        prop_assert_eq!(Reply::decode(&top.frame(node)), Ok(Reply::TactileTop { node, top }));
    }

    #[test]
    fn a_sensor_saturates_instead_of_wrapping(newtons in -1000.0..1000.0_f64) {
        let counts = quantise(newtons, NEWTON_PER_COUNT);
        let read = counts as f64 * NEWTON_PER_COUNT;
        let saturated = newtons.clamp(-128.0, 127.99609375);
        prop_assert!((read - saturated).abs() < NEWTON_PER_COUNT, "{newtons} N became {read} N");
    }
}
