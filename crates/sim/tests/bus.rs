//! Arbitration, order and accounting on the bare bus.

use puck::{CanFrame, CanId, Node};
use sim::{Bus, FrameClass, Ticks, wire};

fn frame(id: u16) -> CanFrame {
    CanFrame::with_payload(CanId::new(id).unwrap(), [0x30])
}

/// Lets the bus run from event to event and returns the identifiers in the order of their frames.
fn run(bus: &mut Bus) -> Vec<u16> {
    let mut order = Vec::new();
    while let Some(next) = bus.next_time() {
        order.extend(bus.finish(next).map(|passage| passage.frame.can_id().raw()));
        bus.arbitrate(next);
    }
    order
}

#[test]
fn the_lowest_identifier_among_those_ready_goes_first() {
    let mut bus = Bus::default();
    for (node, id) in Node::ARM.into_iter().zip([0x463, 0x423, 0x4E3, 0x404]) {
        bus.queue(100, node, frame(id));
    }
    assert_eq!(run(&mut bus), [0x404, 0x423, 0x463, 0x4E3]);
}

#[test]
fn a_running_frame_is_never_interrupted() {
    let mut bus = Bus::default();
    bus.queue(100, Node::ARM[0], frame(0x7FF));
    bus.queue(101, Node::HOST, frame(0x001));
    assert_eq!(run(&mut bus), [0x7FF, 0x001]);
}

#[test]
fn one_node_sends_in_order_even_if_a_later_frame_has_priority() {
    let mut bus = Bus::default();
    bus.queue(0, Node::HOST, frame(0x404));
    bus.queue(0, Node::HOST, frame(0x008));
    bus.queue(0, Node::ARM[0], frame(0x403));
    assert_eq!(run(&mut bus), [0x403, 0x404, 0x008]);
}

#[test]
fn equal_identifiers_go_by_order_of_submission() {
    let mut bus = Bus::default();
    for (index, node) in Node::ARM.into_iter().enumerate().take(3) {
        let id = CanId::new(0x540).unwrap();
        bus.queue(0, node, CanFrame::with_payload(id, [index as u8]));
    }
    bus.record();
    run(&mut bus);
    let first_bytes: Vec<u8> = bus.recorded().iter().map(|passage| passage.frame.payload()[0]).collect();
    assert_eq!(first_bytes, [0, 1, 2]);
}

#[test]
fn frames_follow_each_other_without_gap_and_without_overlap() {
    let mut bus = Bus::default();
    bus.record();
    for id in [0x405, 0x400, 0x404] {
        bus.queue(40, Node::HOST, frame(id));
    }
    run(&mut bus);
    let mut free: Ticks = 40;
    for passage in bus.recorded() {
        assert_eq!(passage.start, free);
        assert_eq!(passage.end - passage.start, wire::frame_ticks(&passage.frame));
        free = passage.end;
    }
    assert_eq!(bus.trace().busy, free - 40);
    assert_eq!(bus.trace().count(FrameClass::GroupRequest), 3);
}

#[test]
fn a_node_without_power_sends_nothing_more() {
    let mut bus = Bus::default();
    bus.queue(0, Node::ARM[0], frame(0x423));
    bus.queue(0, Node::ARM[1], frame(0x443));
    bus.withdraw(Node::ARM[0]);
    assert_eq!(run(&mut bus), [0x443]);
}

#[test]
fn frames_outside_the_protocol_are_counted_as_invalid() {
    let mut bus = Bus::default();
    let node_to_node = CanFrame::with_payload(CanId::encode(Node::ARM[0], Node::HOST), [0x80, 0, 1, 0]);
    let short_set = CanFrame::with_payload(CanId::encode(Node::HOST, Node::ARM[0]), [0x88, 0]);
    let good = CanFrame::with_payload(CanId::encode(Node::HOST, Node::ARM[0]), [0x05]);
    for bad in [node_to_node, short_set, good] {
        bus.queue(0, bad.can_id().sender(), bad);
    }
    run(&mut bus);
    assert_eq!(bus.trace().invalid, 2);
    assert_eq!(bus.trace().invalid_examples.len(), 2);
    assert_eq!(bus.trace().total(), 3);
}
