//! Names of the participants of the arm's bus.

use puck::{Destination, Group, Node};

/// A node in a word or two.
#[must_use]
pub fn node(node: Node) -> String {
    const ARM: [&str; 7] =
        ["M1 shoulder yaw", "M2 shoulder", "M3 shoulder", "M4 elbow", "M5 wrist", "M6 wrist", "M7 wrist roll"];
    const HAND: [&str; 4] = ["hand F1", "hand F2", "hand F3", "hand spread"];
    let name = match node {
        Node::HOST => Some("host"),
        Node::FORCE_TORQUE => Some("F/T sensor"),
        Node::SAFETY_MODULE => Some("safety module"),
        _ => node
            .arm_index()
            .and_then(|index| ARM.get(index))
            .or_else(|| node.hand_index().and_then(|index| HAND.get(index)))
            .copied(),
    };
    name.map_or_else(|| format!("node {}", node.number()), str::to_owned)
}

/// Where a frame goes, in a word or two. Replies go to groups that only the host listens to.
#[must_use]
pub fn destination(to: Destination) -> String {
    match to {
        Destination::Node(to) => node(to),
        Destination::Group(Group::ALL_MOTORS) => "all motors".to_owned(),
        Destination::Group(Group::ARM_TORQUES) => "M1 to M4".to_owned(),
        Destination::Group(Group::WRIST_TORQUES) => "M5 to M7".to_owned(),
        Destination::Group(Group::ARM) => "arm".to_owned(),
        Destination::Group(Group::HAND) => "hand".to_owned(),
        Destination::Group(group) if group.carries_only_replies() => "host".to_owned(),
        Destination::Group(group) => format!("group {}", group.number()),
    }
}

/// The nodes that listen to a group of requests, as Barrett delivers them.
#[must_use]
pub fn members(group: Group) -> &'static [Node] {
    const ALL: [Node; 11] = {
        let [a, b, c, d, e, f, g] = Node::ARM;
        let [h, i, j, k] = Node::HAND;
        [a, b, c, d, e, f, g, h, i, j, k]
    };
    const LOWER: [Node; 4] = {
        let [a, b, c, d, ..] = Node::ARM;
        [a, b, c, d]
    };
    const WRIST: [Node; 3] = {
        let [.., e, f, g] = Node::ARM;
        [e, f, g]
    };
    match group {
        Group::ALL_MOTORS => &ALL,
        Group::ARM_TORQUES => &LOWER,
        Group::WRIST_TORQUES => &WRIST,
        Group::ARM => &Node::ARM,
        Group::HAND => &Node::HAND,
        _ => &[],
    }
}
