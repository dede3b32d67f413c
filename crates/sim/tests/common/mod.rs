//! A master of the bus for tests: it sends frames, lets virtual time pass and keeps what it hears.

#![allow(
    dead_code,
    missing_docs,
    unreachable_pub,
    reason = "each test program compiles this file for itself and uses a part of it"
)]

use puck::{
    CanFrame, Counts, Drives, Group, Node, Property, PropertyId, PropertyTable, Ratios, Reply, Transmission, get, set,
};
use sim::{FreeJoints, HOME, Plant, PlantConfig, TICKS_PER_MILLISECOND, Ticks, World};

/// Firmware of the simulated pucks.
pub const VERSION: i32 = 200;

/// One slot of a master with a control rate of 300 Hz, three a cycle.
pub const SLOT_TICKS: Ticks = sim::period_ticks(900);

/// One control cycle of that master.
pub const CYCLE_TICKS: Ticks = 3 * SLOT_TICKS;

pub struct Master {
    pub plant: Plant,
    pub now: Ticks,
    pub heard: Vec<(Ticks, CanFrame)>,
    pub sent: usize,
}

impl Master {
    /// A master before an arm at home that nobody has switched on.
    pub fn new(config: PlantConfig) -> Self {
        Self::with_world(config, FreeJoints::new(HOME))
    }

    pub fn with_world(config: PlantConfig, world: FreeJoints) -> Self {
        Self::with_any_world(config, Box::new(world))
    }

    pub fn with_any_world(config: PlantConfig, world: Box<dyn World>) -> Self {
        Self { plant: Plant::new(config, world), now: 0, heard: Vec::new(), sent: 0 }
    }

    /// Lets time pass and keeps every frame that arrives.
    pub fn wait(&mut self, duration: Ticks) {
        let until = self.now + duration;
        while let Some(next) = self.plant.next_event() {
            if next > until {
                break;
            }
            self.now = self.now.max(next);
            let event = self.plant.event(self.now);
            self.sent += usize::from(event.transmitted);
            self.heard.extend(event.received.map(|frame| (self.now, frame)));
        }
        self.now = until;
        self.plant.advance(until);
    }

    pub fn wait_ms(&mut self, milliseconds: u64) {
        self.wait(milliseconds * TICKS_PER_MILLISECOND);
    }

    pub fn send(&mut self, frame: CanFrame) {
        self.plant.submit(self.now, frame);
    }

    /// Sends, waits 2 ms and returns the replies that came, broadcasts of the safety module left out.
    pub fn ask(&mut self, frame: CanFrame) -> Vec<Reply> {
        self.heard.clear();
        self.send(frame);
        self.wait_ms(2);
        let replies = self.heard.iter().map(|(_, frame)| Reply::decode(frame).expect("a valid reply"));
        replies.filter(|reply| *reply != Reply::SafetyBroadcast).collect()
    }

    /// The value of a property of one node, if it answers.
    pub fn value(&mut self, node: Node, property: PropertyId) -> Option<i32> {
        match self.ask(get(node, property)).as_slice() {
            [] => None,
            [Reply::Property { node: from, property: answered, value }] => {
                assert_eq!((*from, *answered), (node, property));
                Some(*value)
            }
            other => panic!("one reply expected, not {other:?}"),
        }
    }

    pub fn motor_value(&mut self, node: Node, property: Property) -> Option<i32> {
        self.value(node, motor_id(property))
    }

    pub fn safety_value(&mut self, property: Property) -> i32 {
        self.value(Node::SAFETY_MODULE, safety_id(property)).expect("the safety module always answers")
    }

    /// SET, then the silence that the receiver needs: 1 ms for a puck, 10 ms for the safety module.
    pub fn set(&mut self, node: Node, property: PropertyId, value: i32) {
        self.send(set(node, property, value));
        self.wait_ms(if node == Node::SAFETY_MODULE { 10 } else { 1 });
    }

    /// One round of positions; `None` where a puck is silent.
    pub fn positions(&mut self) -> [Option<Counts>; 7] {
        let mut positions = [None; 7];
        for reply in self.ask(get(Group::ARM, PropertyId::POSITION)) {
            if let Reply::Position { node, primary, .. } = reply {
                positions[node.arm_index().expect("an arm puck")] = Some(primary);
            }
        }
        positions
    }

    /// Position rounds at 300 Hz.
    pub fn poll(&mut self, milliseconds: u64) {
        let until = self.now + milliseconds * TICKS_PER_MILLISECOND;
        while self.now < until {
            self.send(get(Group::ARM, PropertyId::POSITION));
            self.wait(CYCLE_TICKS);
        }
    }

    /// Section 4.2 up to the pucks' main firmware.
    pub fn wake(&mut self) {
        while self.safety_value(Property::Mode) == 0 {
            self.wait_ms(20);
        }
        self.wait_ms(50);
        for node in Node::ARM.into_iter().chain([Node::FORCE_TORQUE]) {
            self.send(set(node, PropertyId::STAT, 2));
            self.wait_ms(10);
        }
        self.wait_ms(1050);
    }

    /// Section 4.3: the arm is at home, says the operator.
    pub fn zero(&mut self) {
        self.set(Node::SAFETY_MODULE, safety_id(Property::Ifault), 8);
        for (node, counts) in Node::ARM.into_iter().zip(home_counts()) {
            self.set(node, PropertyId::POSITION, counts.0);
        }
        self.positions();
        self.set(Node::SAFETY_MODULE, safety_id(Property::Zero), 1);
        self.set(Node::SAFETY_MODULE, safety_id(Property::Ifault), 5);
    }

    /// ACTIVE on an arm whose encoders start at its pose: for worlds that begin at q = 0, where P = 0 is right.
    pub fn activate_unzeroed(&mut self) {
        self.wake();
        self.set(Node::SAFETY_MODULE, safety_id(Property::Zero), 1);
        // Nobody polls in these tests, and the module would stop an arm that nobody watches or that moves too fast.
        self.set(Node::SAFETY_MODULE, safety_id(Property::Vl2), 0);
        self.poll(20);
        self.plant.press(sim::PendantAction::ShiftActivate);
        self.wait_ms(1);
        assert_eq!(self.plant.safety_mode(), puck::SafetyMode::Active);
    }

    /// Everything up to ACTIVE, with the default operator.
    pub fn activate(&mut self) {
        self.wake();
        self.zero();
        self.poll(400);
        assert_eq!(self.plant.safety_mode(), puck::SafetyMode::Active);
    }
}

pub fn motor_id(property: Property) -> PropertyId {
    PropertyTable::motor(VERSION).unwrap().id(property).unwrap()
}

pub fn safety_id(property: Property) -> PropertyId {
    PropertyTable::safety(VERSION).unwrap().id(property).unwrap()
}

/// Expected readings of the encoders at home.
pub fn home_counts() -> [Counts; 7] {
    counts_at(&HOME)
}

/// Expected readings of zeroed encoders at these joint angles.
pub fn counts_at(q: &[f64; 7]) -> [Counts; 7] {
    let motors = Transmission::new(&Ratios::WAM7).unwrap().motor_from_joint(q);
    Drives::new([4096; 7], [2472; 7]).unwrap().counts(&motors).unwrap()
}
