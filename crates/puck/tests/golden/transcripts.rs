//! Whole conversations of the manufacturer's library, spoken by our encoders: the constructor of its safety driver and
//! the initialisation of the hand. Checks identifiers, order and property numbers together.

use crate::vectors::rows;
use puck::device::{reply16, reply32};
use puck::hand::{HandCommand, HandCommander};
use puck::{
    Action, CanFrame, Destination, Group, Node, Property, PropertyId, PropertyTable, Reply, Request, Status, get, set,
};

/// The recorded frames; replies are decoded and encoded once on the way.
fn transcript(name: &str) -> Vec<CanFrame> {
    let mut frames = Vec::new();
    for row in rows(name) {
        let frame = row.frame("can_id_hex", "data_hex");
        assert_eq!(frame.payload().len(), row.number::<usize>("dlc"), "{}", row.at());
        match row.text("dir") {
            "T" => assert!(Request::decode(&frame).is_ok(), "{}: a device cannot read {frame:?}", row.at()),
            _ => assert!(matches!(Reply::decode(&frame), Ok(Reply::Property { .. })), "{}: {frame:?}", row.at()),
        }
        frames.push(frame);
    }
    frames
}

/// A conversation under construction: each request is followed by the replies of a table of values.
struct Conversation<'a> {
    frames: Vec<CanFrame>,
    answer: &'a dyn Fn(Node, PropertyId) -> (i32, bool),
    hand: &'a [Node],
}

impl Conversation<'_> {
    fn send(&mut self, frame: CanFrame) {
        self.frames.push(frame);
        let request = Request::decode(&frame).expect("a device reads it");
        let Action::Get { property } = request.action else {
            return;
        };
        let nodes = match request.to {
            Destination::Node(node) => vec![node],
            Destination::Group(group) if group == Group::HAND => self.hand.to_vec(),
            other => panic!("nobody listens to {other:?}"),
        };
        for node in nodes {
            let (value, wide) = (self.answer)(node, property);
            self.frames.push(if wide { reply32(node, property, value) } else { reply16(node, property, value as i16) });
        }
    }
}

#[test]
fn the_safety_constructor_is_reproduced_frame_by_frame() {
    let safety = Node::SAFETY_MODULE;
    let table = PropertyTable::safety(197).expect("known");
    let id = |property| table.id(property).expect("a property of the module");
    let answer = |_, property| match property {
        PropertyId::ROLE => (2, false),
        PropertyId::VERS => (197, false),
        PropertyId::STAT => (2, false),
        other => panic!("asked for {other:?}"),
    };
    let mut conversation = Conversation { frames: Vec::new(), answer: &answer, hand: &[] };
    for property in [PropertyId::ROLE, PropertyId::VERS, PropertyId::STAT] {
        conversation.send(get(safety, property));
    }
    for limit in [Property::Vl1, Property::Vl2, Property::Tl1, Property::Tl2] {
        let number = id(limit).number() as i32;
        conversation.send(set(safety, id(Property::Def), number));
        conversation.send(set(safety, id(Property::Load), number));
        conversation.send(get(safety, PropertyId::STAT));
    }
    assert_eq!(conversation.frames, transcript("transcript_safety_ctor"));
}

#[test]
fn the_hand_initialisation_is_reproduced_frame_by_frame() {
    let awake = std::cell::Cell::new(false);
    let table = PropertyTable::motor(175).expect("known");
    let id = |property| table.id(property).expect("a property of the hand");
    let answer = |node: Node, property: PropertyId| {
        let name = table.property(property).expect("a name");
        let value = match name {
            Property::Role if node == Node::SPREAD => 0x0205,
            Property::Role => 0x0A05,
            Property::Vers => 175,
            Property::Stat if awake.get() => Status::Ready.value(),
            Property::Stat => Status::Reset.value(),
            Property::Cts => 4096,
            Property::Ipnm => 20_000,
            Property::Hold => (node == Node::SPREAD) as i32,
            Property::Mode => 0,
            other => panic!("asked for {other:?}"),
        };
        (value, name.is_wide())
    };
    let mut conversation = Conversation { frames: Vec::new(), answer: &answer, hand: &Node::HAND };
    for node in Node::HAND {
        for property in [PropertyId::ROLE, PropertyId::VERS, PropertyId::STAT] {
            conversation.send(get(node, property));
        }
    }
    for node in Node::HAND {
        conversation.send(set(node, PropertyId::STAT, Status::Ready.value()));
    }
    awake.set(true);
    for node in Node::HAND {
        for property in [PropertyId::STAT, PropertyId::VERS, PropertyId::STAT] {
            conversation.send(get(node, property));
        }
    }
    for node in Node::HAND {
        conversation.send(get(node, id(Property::Cts)));
        conversation.send(get(node, id(Property::Ipnm)));
    }
    conversation.send(get(Group::HAND, id(Property::Hold)));
    let commander = HandCommander::new(&table).expect("a hand firmware");
    for finger in Node::FINGERS {
        conversation.send(commander.command(finger, HandCommand::Initialise));
    }
    conversation.send(get(Group::HAND, PropertyId::MODE));
    conversation.send(commander.command(Node::SPREAD, HandCommand::Initialise));
    conversation.send(get(Group::HAND, PropertyId::MODE));
    assert_eq!(conversation.frames, transcript("transcript_hand_init"));
}
