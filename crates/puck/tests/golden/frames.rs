//! Every frame format against the golden vectors: what the manufacturer's library sends and accepts, byte for byte.

use crate::vectors::rows;
use puck::device::{
    acceleration_frame, force_frame, position_frame, reply16, reply32, secondary_position_frame, torque_frame,
};
use puck::force_torque::{ACCELERATION_PER_COUNT, scaled_counts};
use puck::safety::{Button, Health, LimitError, ignore_velocity_faults, torque_limits, velocity_limits};
use puck::tactile::TactileBlock;
use puck::{
    Action, CanFrame, CanId, Counts, Destination, GaugeStatus, Group, Node, PendantState, PropertyId, PropertyTable,
    PuckTorque, RawWrench, Reply, ReplyError, Request, get, packed_torques, set,
};

fn node(number: u8) -> Node {
    Node::new(number).expect("a node")
}

fn property(number: u8) -> PropertyId {
    PropertyId::new(number).expect("a property")
}

/// Vectors name a destination as a node, or as 1024 plus a group.
fn destination(number: u16) -> Destination {
    match number.checked_sub(1024) {
        Some(group) => Group::new(group as u8).expect("a group").into(),
        None => node(number as u8).into(),
    }
}

#[test]
fn a_frame_is_what_it_says_to_any_driver_and_to_a_person() {
    use embedded_can::{Frame, Id};
    let frame = CanFrame::from_slice(CanId::new(0x426).expect("eleven bits"), &[0x88, 0, 2, 0]).expect("short");
    assert!(!Frame::is_extended(&frame) && !Frame::is_remote_frame(&frame));
    assert_eq!((Frame::dlc(&frame), Frame::data(&frame)), (4, &[0x88, 0, 2, 0][..]));
    assert!(matches!(Frame::id(&frame), Id::Standard(id) if id.as_raw() == 0x426));
    assert_eq!(CanFrame::copy_of(&frame), Some(frame));
    assert_eq!(frame.convert::<CanFrame>(), Some(frame));
    assert_eq!(format!("{frame:?} {:?}", frame.can_id()), "0x426#88 00 02 00 0x426");
}

#[test]
fn what_is_no_reply_is_refused_with_its_reason() {
    let spread = node(14);
    let reply = |sender: Node, to: Group, bytes: &[u8]| {
        Reply::decode(&CanFrame::from_slice(CanId::encode(sender, to), bytes).expect("at most eight bytes"))
    };
    assert_eq!(reply(spread, Group::TACTILE_FULL_REPLIES, &[0; 7]), Err(ReplyError::Length));
    assert_eq!(reply(spread, Group::TACTILE_FULL_REPLIES, &[0xF0; 8]), Err(ReplyError::Sequence));
    assert_eq!(reply(spread, Group::TACTILE_TOP_REPLIES, &[0; 7]), Err(ReplyError::Length));
    assert!(matches!(reply(spread, Group::TACTILE_TOP_REPLIES, &[0; 8]), Ok(Reply::TactileTop { .. })));
    assert_eq!(reply(Node::SAFETY_MODULE, Group::ALL_MOTORS, &[0; 4]), Ok(Reply::SafetyBroadcast));
    assert_eq!(reply(spread, Group::ALL_MOTORS, &[0; 4]), Err(ReplyError::UnknownGroup));
    assert_eq!(reply(spread, Group::PROPERTY_REPLIES, &[0x80, 1, 0, 0]), Err(ReplyError::Header));
    assert_eq!(reply(spread, Group::PROPERTY_REPLIES, &[0x00, 0, 0, 0]), Err(ReplyError::Header));
    assert_eq!(reply(Node::HOST, Group::PROPERTY_REPLIES, &[0x80, 0, 0, 0]), Err(ReplyError::FromHost));
    assert_eq!(ReplyError::Header.to_string(), "malformed header of an ordinary reply");
}

#[test]
fn identifiers_equal_the_vectors_in_both_directions() {
    for row in rows("can_id") {
        let to: u16 = row.number("to");
        let group_bit = if row.number::<u8>("to_is_group") == 1 { 1024 } else { 0 };
        let id = CanId::encode(node(row.number("from")), destination(to + group_bit));
        assert_eq!(id.raw(), row.number::<u16>("bus_id_dec"), "{}", row.at());
        assert_eq!(id, row.id("bus_id_hex"), "{}", row.at());
        assert_eq!(id.sender().number(), row.number::<u8>("decoded_from"), "{}", row.at());
        // The library's decoder drops the group bit.
        assert_eq!(id.destination(), destination(row.number::<u16>("decoded_to") + group_bit), "{}", row.at());
    }
}

#[test]
fn sets_and_gets_equal_the_vectors_and_a_device_reads_them_back() {
    for row in rows("set_get") {
        let to = destination(row.number("id"));
        let property = property(row.number("prop"));
        let (frame, action) = match row.optional::<i32>("value") {
            Some(value) => (set(to, property, value), Action::Set { property, value }),
            None => (get(to, property), Action::Get { property }),
        };
        assert_eq!(frame, row.frame("can_id_hex", "data_hex"), "{}", row.at());
        assert_eq!(frame.payload().len(), row.number::<usize>("dlc"), "{}", row.at());
        match Request::decode(&frame) {
            Ok(request) => assert_eq!(request, Request { sender: Node::HOST, to, action }, "{}", row.at()),
            // Some rows address groups that carry only replies; no device may act on those.
            Err(error) => {
                assert_eq!(error, puck::RequestError::ReplyGroup, "{}", row.at());
                assert!(matches!(to, Destination::Group(group) if group.carries_only_replies()), "{}", row.at());
            }
        }
    }
}

#[test]
fn ordinary_replies_are_accepted_and_rejected_as_in_the_vectors() {
    for row in rows("std_reply") {
        let (from, asked) = (node(row.number("id")), property(row.number("prop")));
        let frame = row.frame("can_id_hex", "data_hex");
        let value = row.optional::<i32>("value");
        assert_eq!(value.is_some(), row.number::<u8>("ret") == 0);
        match (Reply::decode(&frame), value) {
            (Ok(Reply::Property { node, property, value }), Some(expected)) => {
                assert_eq!((node, property, value), (from, asked, expected), "{}", row.at());
                let sent = if frame.payload().len() == 4 {
                    reply16(from, asked, expected as i16)
                } else {
                    reply32(from, asked, expected)
                };
                assert_eq!(sent, frame, "{}: device side", row.at());
            }
            (Err(ReplyError::Header | ReplyError::Length), None) => {}
            // The library is told which property to expect; ours tells the caller which one it was.
            (Ok(Reply::Property { property, .. }), None) => {
                assert_ne!(property, asked, "{}", row.at())
            }
            (got, expected) => panic!("{}: {got:?}, expected {expected:?}", row.at()),
        }
    }
}

#[test]
fn positions_are_read_as_in_the_vectors_whatever_the_flag_bits() {
    const NO_SECONDARY: i32 = i32::MAX;
    for row in rows("position") {
        let from = node(row.number("id"));
        let data = row.payload("data_hex");
        let frame = CanFrame::from_slice(CanId::encode(from, Group::POSITION_REPLIES), &data).expect("a frame");
        let alone =
            CanFrame::from_slice(CanId::encode(from, Group::SECONDARY_POSITION_REPLIES), &data).expect("a frame");
        let Some(motor) = row.optional::<i32>("comb0") else {
            assert_eq!(Reply::decode(&frame), Err(ReplyError::Length), "{}", row.at());
            assert_eq!(Reply::decode(&alone), Err(ReplyError::Length), "{}", row.at());
            continue;
        };
        if let Some(motor_only) = row.optional::<i32>("motor") {
            assert_eq!(motor, motor_only);
        }
        let secondary = Some(row.number::<i32>("comb1")).filter(|counts| *counts != NO_SECONDARY).map(Counts);
        let expected = Reply::Position { node: from, primary: Counts(motor), secondary };
        assert_eq!(Reply::decode(&frame), Ok(expected), "{}", row.at());
        let sent = position_frame(from, Counts(row.number("sent_p")), row.optional("sent_s").map(Counts));
        assert_eq!(Reply::decode(&sent), Ok(expected), "{}: device side", row.at());
        assert!(sent.payload().iter().step_by(3).all(|byte| byte & 0xC0 == 0x80), "{}: flags of a device", row.at());
        match row.optional::<i32>("sec") {
            Some(counts) => {
                let expected = Reply::SecondaryPosition { node: from, secondary: Counts(counts) };
                assert_eq!(Reply::decode(&alone), Ok(expected), "{}", row.at());
                assert_eq!(Reply::decode(&secondary_position_frame(from, Counts(counts))), Ok(expected));
            }
            None => assert_eq!(Reply::decode(&alone), Err(ReplyError::Length), "{}", row.at()),
        }
    }
}

#[test]
fn packed_torques_saturate_and_round_down_as_in_the_vectors() {
    for row in rows("packed_torque") {
        let group = Group::new(row.number("group")).expect("a group");
        let used: usize = row.number("num");
        let mut inputs: [f64; 4] = row.numbers("t", 0);
        inputs[used..].fill(0.0);
        let torques = inputs.map(|input| PuckTorque::from_units(input).expect("finite"));
        assert_eq!(torques.map(PuckTorque::units), row.numbers("i", 0), "{}", row.at());
        let frame = packed_torques(group, PropertyId::TORQUE, torques);
        assert_eq!(frame, row.frame("can_id_hex", "data_hex"), "{}", row.at());
        let request = Request::decode(&frame).expect("a device reads it");
        for (place, torque) in (1..=4).zip(torques) {
            assert_eq!(request.action.torque_for(place), Some(torque), "{}: PIDX {place}", row.at());
        }
        assert_eq!((request.action.torque_for(0), request.action.torque_for(5)), (None, None));
    }
}

#[test]
fn force_torque_frames_scale_as_in_the_vectors() {
    for row in rows("ft") {
        let data = row.payload("data_hex");
        let decode = |group| {
            let id = CanId::encode(Node::FORCE_TORQUE, group);
            Reply::decode(&CanFrame::from_slice(id, &data).expect("a frame"))
        };
        let replies =
            [decode(Group::FORCE_REPLIES), decode(Group::TORQUE_REPLIES), decode(Group::ACCELERATION_REPLIES)];
        if row.number::<u8>("ret") == 1 {
            assert_eq!(replies, [Err(ReplyError::Length); 3], "{}", row.at());
            continue;
        }
        let raw: [i16; 3] = row.numbers("raw", 0);
        let status = data.get(6).map(|byte| GaugeStatus(*byte));
        let (node, counts) = (Node::FORCE_TORQUE, raw);
        let expected = [
            Ok(Reply::Force { node, counts, status }),
            Ok(Reply::Torque { node, counts, status }),
            Ok(Reply::Acceleration { node, counts, status }),
        ];
        assert_eq!(replies, expected, "{}", row.at());
        let wrench = RawWrench { force: raw, torque: raw, status };
        let force = [row.number("fx"), row.number("fy"), row.number("fz")];
        let torque = [row.number("tx"), row.number("ty"), row.number("tz")];
        assert_eq!((wrench.newtons::<f64>(), wrench.newton_metres::<f64>()), (force, torque), "{}", row.at());
        let single = |values: [f64; 3]| values.map(|value| value as f32);
        assert_eq!((wrench.newtons::<f32>(), wrench.newton_metres::<f32>()), (single(force), single(torque)));
        let acceleration: [f64; 3] = scaled_counts(raw, ACCELERATION_PER_COUNT);
        assert_eq!(acceleration, [row.number("ax"), row.number("ay"), row.number("az")], "{}", row.at());
        assert_eq!(torque_frame(raw, status).payload(), data, "{}: device side", row.at());
        assert_eq!(force_frame(raw).payload(), &data[..6]);
        assert_eq!(acceleration_frame(raw).payload(), &data[..6]);
    }
}

#[test]
fn tactile_blocks_equal_the_vectors() {
    for row in rows("tactile_full") {
        let data = row.payload("data_hex");
        let spread = Node::SPREAD;
        let frame = CanFrame::from_slice(CanId::encode(spread, Group::TACTILE_FULL_REPLIES), &data).expect("a frame");
        let reply = Reply::decode(&frame);
        if row.number::<u8>("ret") == 1 {
            assert_eq!(reply, Err(ReplyError::Sequence), "{}", row.at());
            continue;
        }
        let Ok(Reply::TactileFull { node, block }) = reply else { panic!("{}: {reply:?}", row.at()) };
        assert_eq!((node, block.sequence), (spread, row.number("seq")), "{}", row.at());
        let pressures: [f64; 5] = block.pressures();
        let single: [f32; 5] = block.pressures();
        for index in 0..block.cell_count() {
            assert_eq!(block.cells[index], row.number::<u16>(&format!("c{index}")), "{}", row.at());
            let pressure: f64 = row.number(&format!("p{index}"));
            assert_eq!((pressures[index], single[index]), (pressure, pressure as f32), "{}", row.at());
        }
        assert_eq!(row.optional::<f64>("p4").is_some(), block.cell_count() == 5, "{}", row.at());
        assert_eq!(TactileBlock { ..block }.frame(spread), frame, "{}: device side", row.at());
    }
}

#[test]
fn pendant_words_are_read_as_in_the_vectors() {
    for row in rows("pendant") {
        let word = u32::from_str_radix(row.text("pen_hex").trim_start_matches("0x"), 16).expect("a word") as i32;
        let state = PendantState::from_value(word);
        if row.number::<u8>("ok") == 0 {
            assert!(state.is_err(), "{}", row.at());
            continue;
        }
        let state = state.expect("one-hot fields");
        let button = match state.button {
            Button::EmergencyStop => "ESTOP",
            Button::Activate => "ACTIVATE",
            Button::Idle => "IDLE",
            Button::None => "NONE",
        };
        assert!(row.text("button").starts_with(button), "{}: {button} is {}", row.at(), row.text("button"));
        assert_eq!(state.activate_light, row.number::<u8>("activate_light") == 1, "{}", row.at());
        assert_eq!(state.idle_light, row.number::<u8>("idle_light") == 1, "{}", row.at());
        assert_eq!(format!("0x{:02X}", state.segments), row.text("char_hex"), "{}", row.at());
        for (column, health) in ["velocity", "torque", "voltage", "heartbeat", "other"].into_iter().zip(state.health())
        {
            let name = match health {
                Health::Safe => "SAFE",
                Health::Warning => "WARNING",
                Health::Fault => "FAULT",
            };
            assert_eq!(name, row.text(column), "{}: {column}", row.at());
        }
        assert_eq!(state.all_safe(), row.number::<u8>("all_safe") == 1, "{}", row.at());
        assert_eq!(state.has_faults(), row.number::<u8>("has_faults") == 1, "{}", row.at());
        assert_eq!(PendantState::from_value(state.value()), Ok(state), "{}: device side", row.at());
    }
}

#[test]
fn safety_limits_equal_the_vectors_and_zero_is_refused() {
    let table = PropertyTable::safety(197).expect("a known firmware");
    for row in rows("safety_limits") {
        let first = row.frame("frame1_id", "frame1_hex");
        let frames = match row.text("kind") {
            "ifault" => {
                assert_eq!(ignore_velocity_faults(&table, 5), Ok(first), "{}", row.at());
                continue;
            }
            kind => {
                let fault: f64 = row.number("fault");
                let warning = row.optional("warning").unwrap_or(0.9 * fault);
                match kind {
                    "vel" => velocity_limits(&table, fault, warning),
                    _ => torque_limits(&table, fault, warning, row.number("ipnm")),
                }
            }
        };
        if row.number::<f64>("fault") == 0.0 {
            // The library sends it; to the module it means "never fault".
            assert_eq!(frames, Err(LimitError::NotPositive), "{}", row.at());
            continue;
        }
        if row.text("kind") == "torque" && row.number::<f64>("fault") * row.number::<f64>("ipnm") >= 8191.0 {
            // The library sends it, but no command in a packed frame is larger: "never fault" as well.
            assert_eq!(frames, Err(LimitError::NeverExceeded), "{}", row.at());
            continue;
        }
        assert_eq!(frames, Ok([first, row.frame("frame2_id", "frame2_hex")]), "{}", row.at());
    }
    assert_eq!(velocity_limits(&table, f64::NAN, 0.5), Err(LimitError::NotFinite));
    for endless in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(torque_limits(&table, endless, 0.5, 2700), Err(LimitError::NotFinite));
        assert_eq!(torque_limits(&table, 0.5, endless, 2700), Err(LimitError::NotFinite));
    }
    assert_eq!(velocity_limits(&table, 0.5, 0.6), Err(LimitError::Order));
    assert_eq!(velocity_limits(&table, 8.0, 0.6), Err(LimitError::Range));
    // The largest command that is ever packed is 8191: the largest limit that can trip is one less.
    assert!(torque_limits(&table, 8190.0, 0.0, 1).is_ok());
    for never in [8191.0, 32_767.0, 1e9] {
        assert_eq!(torque_limits(&table, never, 0.0, 1), Err(LimitError::NeverExceeded));
    }
}

/// Two signs cancel, and what is below one unit is cut to 0.
#[test]
fn a_negative_limit_is_refused_whatever_it_is_multiplied_with() {
    let table = PropertyTable::safety(197).expect("a known firmware");
    for ipnm in [-1000, -1, 0, i32::MIN] {
        assert_eq!(torque_limits(&table, -3.0, -1.0, ipnm), Err(LimitError::UnitsPerNewtonMetre), "{ipnm}");
        assert_eq!(torque_limits(&table, 3.0, 1.0, ipnm), Err(LimitError::UnitsPerNewtonMetre), "{ipnm}");
    }
    assert_eq!(torque_limits(&table, 3.0, -1e-5, 1000), Err(LimitError::Order));
    assert_eq!(velocity_limits(&table, 0.5, -1e-5), Err(LimitError::Order));
    assert_eq!(torque_limits(&table, -3.0, -4.0, 1000), Err(LimitError::NotPositive));
    assert!(torque_limits(&table, 3.0, 0.0, 1000).is_ok() && torque_limits(&table, 3.0, -0.0, 1000).is_ok());
}

/// A device that reads what it should not acts on it: a question with the bit of an order, or the other way round.
#[test]
fn a_request_whose_first_byte_contradicts_its_length_is_refused_with_words() {
    let read = |to: Destination, bytes: &[u8]| {
        let id = puck::CanId::encode(Node::HOST, to);
        Request::decode(&puck::CanFrame::from_slice(id, bytes).expect("a frame"))
    };
    let group = Destination::from(puck::Group::ARM_TORQUES);
    let node = Destination::from(puck::Node::new(3).expect("a node"));
    assert!(read(node, &[0x05]).is_ok() && read(group, &[0xAA, 0, 0, 0, 0, 0, 0, 0]).is_ok());
    for (to, bytes, error, words) in [
        (node, &[0x85][..], puck::RequestError::Header, "malformed header"),
        (group, &[0x2A, 0, 0, 0, 0, 0, 0, 0], puck::RequestError::Header, "malformed header"),
        (node, &[0xAA, 0, 0, 0, 0, 0, 0, 0], puck::RequestError::PackedToNode, "packed torques to a single node"),
        (node, &[], puck::RequestError::Length, "no request has this length"),
    ] {
        let refused = read(to, bytes);
        assert_eq!(refused, Err(error), "{bytes:02x?}");
        assert_eq!(error.to_string(), words);
    }
}
