//! Everything at the other end of the co-controller's two wires, in virtual time.
//!
//! ```text
//! co-controller --submit--> bus --> pucks 1..7, F/T 8, hand 11..14, safety module 10 <-- operator
//!               <--event---  |         | torques        ^ angles at the latch
//!               <--link--> host        +----> world, one step every half slot
//! ```
//!
//! Time moves only when the co-controller says how far it has come ([`Plant::advance`], [`Plant::submit`],
//! [`Plant::event`]). Everything due until then happens in order of time; at equal times physics first, then the end of
//! a frame, the devices, the safety module, the operator, and arbitration last, when all who compete have spoken.
//! Nothing here looks at a clock of the computer, and no order depends on a hash: equal calls give equal runs.

mod recording;

use crate::bus::{Bus, FOREIGN};
use crate::fault::{FaultKind, Faults, FrameKind, Injection, Treated};
use crate::force_torque::{ForceTorque, ForceTorqueConfig};
use crate::hand::{Hand, HandConfig};
use crate::link_wire::{LinkLine, SerialLine};
use crate::motors::Motors;
use crate::noise::Noise;
use crate::operator::{Operator, OperatorConfig, PendantAction};
use crate::plant_error::PlantError;
use crate::puck_model::{Drive, Puck, PuckConfig};
use crate::safety::{SafetyConfig, SafetyModule};
use crate::speed::SpeedMonitor;
use crate::time::Ticks;
use crate::trace::BusTrace;
use crate::wire::Passage;
use crate::world::World;
use puck::{Action, CanFrame, Drives, Node, PendantState, Ratios, Request, SafetyMode, Transmission};
use std::collections::VecDeque;

/// Set-up of a plant. The default is a healthy seven-joint arm with a sensor and an obliging operator.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantConfig {
    /// Seed of everything random: wake delays and sensor noise.
    pub seed: u64,
    /// Gear ratios of the arm.
    pub ratios: Ratios,
    /// The motor pucks.
    pub pucks: PuckConfig,
    /// The safety module.
    pub safety: SafetyConfig,
    /// The force/torque sensor.
    pub force_torque: ForceTorqueConfig,
    /// The hand; `None`: the world may have one, but nobody answers for it on the bus.
    pub hand: Option<HandConfig>,
    /// The operator at the pendant.
    pub operator: OperatorConfig,
    /// True if the arm was started and zeroed before time 0: pucks, sensor and hand run, the hand is initialised,
    /// positions are the true ones, the safety module is in IDLE. The operator presses Shift-Activate as configured;
    /// with [`OperatorConfig::prompt`] without delay.
    pub started: bool,
    /// The hand stands alone on the bus, with power: no arm, no sensor, no safety module, and nobody at a pendant.
    pub hand_alone: bool,
    /// Delay of packed torques, arm's and hand's, on their way to the motors. The safety module judges them at once.
    pub torque_delay: Ticks,
}

impl Default for PlantConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            ratios: Ratios::WAM7,
            pucks: PuckConfig::default(),
            safety: SafetyConfig::default(),
            force_torque: ForceTorqueConfig::default(),
            hand: Some(HandConfig::default()),
            operator: OperatorConfig::default(),
            started: false,
            hand_alone: false,
            torque_delay: 0,
        }
    }
}

/// Result of one event for the co-controller's interrupt.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// A frame from another node.
    pub received: Option<CanFrame>,
    /// A frame of the co-controller has left the wire.
    pub transmitted: bool,
    /// Bytes of the host link that have arrived, at most [`CHUNK`](crate::CHUNK).
    pub link: Vec<u8>,
}

/// Something that awaits the co-controller's next event.
#[derive(Clone, Copy, Debug)]
struct Delivery {
    at: Ticks,
    /// `None`: its own frame is out.
    received: Option<CanFrame>,
}

/// Bus, pucks 1 to 7, safety module, force/torque sensor, hand, operator, world, and the wire of the host link.
pub struct Plant {
    now: Ticks,
    /// When anything but physics happens next: [`Plant::look_ahead`] as of the last change. Asked several times per
    /// event.
    next_happening: Option<Ticks>,
    bus: Bus,
    pucks: [Puck; 7],
    motors: Motors,
    safety: SafetyModule,
    force_torque: ForceTorque,
    hand: Option<Hand>,
    operator: Operator,
    torque_delay: Ticks,
    /// Packed torques that are still on their way to the motors, with the time they arrive.
    late_torques: VecDeque<(Ticks, Request)>,
    link: Box<dyn LinkLine>,
    hand_alone: bool,
    deliveries: VecDeque<Delivery>,
    faults: Faults,
    world: Box<dyn World>,
}

impl Plant {
    /// A plant at time 0 with the E-stop pressed: only the safety module has power.
    ///
    /// # Panics
    /// If the configuration describes no arm; see [`Plant::try_new`] for configurations that come from outside.
    #[must_use]
    pub fn new(config: PlantConfig, world: Box<dyn World>) -> Self {
        match Self::try_new(config, world) {
            Ok(plant) => plant,
            Err(error) => panic!("invalid plant configuration: {error}"),
        }
    }

    /// As [`Plant::new`].
    ///
    /// # Errors
    /// [`PlantError`] if the configuration describes no arm.
    pub fn try_new(config: PlantConfig, world: Box<dyn World>) -> Result<Self, PlantError> {
        // One stream of noise per source: 0 is the sensor, the node numbers are the wake delays.
        let stream = |node: Node| Noise::new(config.seed, node.number().into());
        let transmission = Transmission::new(&config.ratios)?;
        let drives =
            Drives::new([config.pucks.counts_per_revolution; 7], config.pucks.units_per_newton_metre.map(i32::from))?;
        let [a, b, c, d, e, f, g] =
            std::array::from_fn(|index| Puck::new(index, &config.pucks, stream(Node::ARM[index])));
        let boot_noise = stream(Node::FORCE_TORQUE);
        let hand = config.hand.map(|hand| Hand::new(hand, &*world, |number| Noise::new(config.seed, number)));
        // What has happened already need not happen again.
        let idle_at = config.operator.idle_at.filter(|_| !config.started);
        let operator = if config.hand_alone {
            OperatorConfig { idle_at: None, activate_after: None, holds_until_active_for: None, script: Vec::new() }
        } else {
            OperatorConfig { idle_at, ..config.operator }
        };
        let mut plant = Self {
            now: 0,
            next_happening: None,
            bus: Bus::default(),
            pucks: [a?, b?, c?, d?, e?, f?, g?],
            motors: Motors::new(transmission, &drives, &*world, operator.holds_until_active_for),
            safety: SafetyModule::new(config.safety, SpeedMonitor::new(transmission, drives))?,
            force_torque: ForceTorque::new(config.force_torque, boot_noise, stream(Node::HOST)),
            hand: hand.transpose()?,
            operator: Operator::new(operator),
            torque_delay: config.torque_delay,
            late_torques: VecDeque::new(),
            link: Box::new(SerialLine::default()),
            hand_alone: config.hand_alone,
            deliveries: VecDeque::new(),
            faults: Faults::new(config.seed),
            world,
        };
        if config.hand_alone {
            plant.hand.iter_mut().for_each(|hand| if config.started { hand.run() } else { hand.power_on(0) });
        } else if config.started {
            plant.resume();
        }
        plant.next_happening = plant.look_ahead();
        Ok(plant)
    }

    /// Everything is up and the arm zeroed, as if by somebody before.
    fn resume(&mut self) {
        self.safety.resume();
        self.operator.resume();
        self.motors.set_powered(true);
        self.pucks.iter_mut().for_each(Puck::run);
        self.force_torque.run();
        self.hand.iter_mut().for_each(Hand::run);
    }

    /// The co-controller hands a frame to its CAN controller at time `t`.
    ///
    /// A `t` before the time already reached counts as that time: the past is decided.
    pub fn submit(&mut self, t: Ticks, frame: CanFrame) {
        self.run_to(t);
        self.bus.queue(self.now, Node::HOST, frame);
        self.arbitrate();
    }

    /// Somebody who is neither co-controller nor device of the arm hands a frame to the bus, now. All receive it,
    /// the co-controller too, and whoever its identifier names as the sender.
    pub fn submit_foreign(&mut self, frame: CanFrame) {
        self.bus.queue(self.now, FOREIGN, frame);
        self.arbitrate();
    }

    /// The co-controller takes back every frame that has not begun on the wire, at time `t`: it cancels them, has left
    /// the bus or is reset. Whether one of its frames has begun, whose end [`Plant::event`] has still to tell.
    pub fn withdraw(&mut self, t: Ticks) -> bool {
        self.run_to(t);
        self.bus.withdraw(Node::HOST);
        self.next_happening = self.look_ahead();
        self.bus.sender() == Some(Node::HOST) || self.deliveries.iter().any(|delivery| delivery.received.is_none())
    }

    /// Frames of the co-controller that wait for the bus.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.bus.waiting(Node::HOST)
    }

    /// When the co-controller has to call [`Plant::event`] next, as far as can be known before it gets there.
    ///
    /// A time that has passed means: at once. `None` means never, unless it submits something.
    #[must_use]
    pub fn next_event(&self) -> Option<Ticks> {
        let waiting = self.deliveries.front().map(|delivery| delivery.at);
        // While a frame is on the wire nothing else can change what the co-controller will see next.
        let on_bus = if self.bus.is_busy() { self.bus.next_time() } else { self.next_happening };
        [waiting, on_bus, self.link.next_time()].into_iter().flatten().min()
    }

    /// Returns what the co-controller finds at time `t`. One frame at a time: ask [`Plant::next_event`] again
    /// afterwards.
    pub fn event(&mut self, t: Ticks) -> Event {
        self.run_to(t);
        let delivery = self.deliveries.pop_front();
        Event {
            received: delivery.and_then(|delivery| delivery.received),
            transmitted: delivery.is_some_and(|delivery| delivery.received.is_none()),
            link: self.link.take_to_device(self.now),
        }
    }

    /// "The co-controller has reached time `t`": everything due until then happens.
    pub fn advance(&mut self, t: Ticks) {
        self.run_to(t);
    }

    /// The time the co-controller has reached.
    #[must_use]
    pub fn now(&self) -> Ticks {
        self.now
    }

    /// The co-controller hands bytes to its UART at time `t`.
    pub fn link_from_device(&mut self, t: Ticks, bytes: &[u8]) {
        self.run_to(t);
        self.link.send_from_device(self.now, bytes);
    }

    /// Bytes for the host whose time on the line has passed.
    pub fn take_from_device(&mut self) -> Vec<u8> {
        self.link.take_from_device(self.now)
    }

    /// Bytes from the device that are still on their way: how far its UART is behind.
    #[must_use]
    pub fn link_backlog(&self) -> usize {
        self.link.backlog_from_device(self.now)
    }

    /// The host sends bytes; they leave at the time reached, or when the line is free.
    pub fn link_to_device(&mut self, bytes: &[u8]) {
        self.link.send_to_device(self.now, bytes);
    }

    /// Puts another line in place of the serial one; what was under way on the old one is lost.
    pub fn set_link_line(&mut self, line: Box<dyn LinkLine>) {
        self.link = line;
    }

    /// Somebody other than the scripted operator does something at the pendant, now.
    pub fn press(&mut self, action: PendantAction) {
        self.operator.observe(action);
        self.safety.press(self.now, action);
        self.settle_power();
        self.arbitrate();
    }

    /// The operator takes the arm where it lies and carries it home within a second, if there is one who holds it.
    pub fn carry_home(&mut self) {
        self.motors.carry_home(self.now);
    }

    /// Mode of the safety module.
    #[must_use]
    pub fn safety_mode(&self) -> SafetyMode {
        self.safety.mode()
    }

    /// True if no motor of the arm pulls or brakes.
    #[must_use]
    pub fn is_free(&self) -> bool {
        self.pucks.iter().all(|puck| puck.drive(self.now) == Drive::Torque(0))
    }

    /// Both pendants.
    #[must_use]
    pub fn pendant(&self) -> PendantState {
        self.safety.pendant()
    }

    /// Requests that pucks lost because they came too fast.
    #[must_use]
    pub fn lost_requests(&self) -> u64 {
        let arm: u64 = self.pucks.iter().map(Puck::lost_requests).sum();
        arm + self.hand.as_ref().map_or(0, Hand::lost_requests)
    }

    /// Statistics of the bus so far.
    #[must_use]
    pub fn trace(&self) -> BusTrace {
        self.bus.trace().clone()
    }

    /// From now on the force/torque sensor errs by more and more, after `over` by `error` (N and N m, sensor axes), and
    /// stays so: an error that no tare before it can catch.
    pub fn creep_force_torque(&mut self, error: [f64; 6], over: Ticks) {
        self.force_torque.creep(error, self.now, self.now + over);
    }

    /// Orders faults; their times count from now.
    pub fn inject(&mut self, injections: &[Injection]) {
        self.faults.order(self.now, injections);
        self.next_happening = self.look_ahead();
    }

    /// Orders faults whose times count from the first torque on the bus that is not zero.
    pub fn inject_on_torque(&mut self, injections: Vec<Injection>) {
        self.faults.order_on_torque(injections);
    }

    /// True while a fault keeps the co-controller's CAN controller off the bus.
    #[must_use]
    pub fn is_bus_off(&self) -> bool {
        self.faults.is_bus_off()
    }

    /// Frames that the co-controller's CAN controller does not take now, because of faults.
    #[must_use]
    pub fn refused(&self) -> Vec<FrameKind> {
        self.faults.refused()
    }

    /// Share by which the co-controller's clock is slow, because of a fault.
    #[must_use]
    pub fn clock_error(&self) -> f64 {
        self.faults.clock_error()
    }

    /// The physical world.
    pub fn world(&mut self) -> &mut dyn World {
        &mut *self.world
    }

    fn run_to(&mut self, t: Ticks) {
        while let Some(next) = self.next_moment()
            && next <= t
        {
            self.move_clock(next);
            self.happen();
        }
        self.move_clock(t);
    }

    /// Moves the clock and charges the interval to the motors as they are driven now.
    fn move_clock(&mut self, t: Ticks) {
        if t > self.now {
            let drives = std::array::from_fn(|motor| self.pucks[motor].drive(self.now));
            self.motors.drive(&drives, t - self.now);
            self.now = t;
        }
    }

    /// The next time at which anything happens, physics included.
    fn next_moment(&self) -> Option<Ticks> {
        [Some(self.motors.next_step()), self.next_happening].into_iter().flatten().min()
    }

    /// The next time at which something happens that can put a frame on the bus or take it off.
    fn look_ahead(&self) -> Option<Ticks> {
        let pucks = self.pucks.iter().filter_map(Puck::next_time).min();
        [
            self.bus.next_time(),
            pucks,
            self.force_torque.next_time(),
            self.hand.as_ref().and_then(Hand::next_time),
            self.late_torques.front().map(|(at, _)| *at),
            self.safety.next_time(),
            self.operator.next_time(&self.safety.view()),
            self.faults.next_time(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Everything that is due now, in the order the head of this file gives.
    fn happen(&mut self) {
        let now = self.now;
        if self.motors.next_step() <= now {
            if let Some(hand) = &mut self.hand {
                hand.drive(now, &mut *self.world);
            }
            self.motors.step(&mut *self.world, &self.faults.friction());
            if self.force_torque.has_memory() {
                let strained = self.wrist_wrench();
                self.force_torque.follow(&strained);
            }
        }
        self.befall();
        while let Some((_, request)) = self.late_torques.pop_front_if(|(at, _)| *at <= now) {
            self.instruct(now, &request);
        }
        if let Some(passage) = self.bus.finish(now) {
            self.deliver(&passage);
        }
        if self.pucks.iter().any(|puck| puck.next_time().is_some_and(|at| at <= now)) {
            // All pucks latch at the same request, hence at the same angles.
            let angles = self.motors.angles(now);
            for (index, puck) in self.pucks.iter_mut().enumerate() {
                while puck.next_time().is_some_and(|at| at <= now) {
                    if let Some(reply) = puck.step(now, angles[index]) {
                        self.bus.queue(now, Node::ARM[index], reply);
                    }
                }
            }
        }
        while self.force_torque.next_time().is_some_and(|at| at <= now) {
            let strained = self.wrist_wrench();
            for reply in self.force_torque.step(now, &strained).into_iter().flatten() {
                self.bus.queue(now, Node::FORCE_TORQUE, reply);
            }
        }
        if let Some(hand) = &mut self.hand {
            hand.step(now, |digit, reply| self.bus.queue(now, digit, reply));
        }
        while self.safety.next_time().is_some_and(|at| at <= now) {
            self.safety.step(now);
        }
        self.settle_power();
        while let Some(action) = self.operator.act(now, &self.safety.view()) {
            self.safety.press(now, action);
            self.settle_power();
        }
        self.arbitrate();
    }

    /// Comes last whatever happens: lets the bus choose, and looks what is next.
    fn arbitrate(&mut self) {
        self.bus.arbitrate(self.now);
        self.next_happening = self.look_ahead();
    }

    /// Wrench on the sensor with the errors that are injected, N and N m.
    fn wrist_wrench(&self) -> [f64; 6] {
        let (wrench, error) = (self.world.wrist_wrench(), self.faults.sensor_error(self.now));
        std::array::from_fn(|axis| wrench[axis] + error[axis])
    }

    /// Faults that begin or end now, and frames they made late.
    fn befall(&mut self) {
        while let Some((kind, begins)) = self.faults.change(self.now) {
            let puck = |node: u8| usize::from(node.clamp(1, 7)) - 1;
            match kind {
                FaultKind::CountJump { node, by } => self.pucks[puck(node)].jump(by, begins),
                FaultKind::Restart { node } if begins && self.motors.are_powered() => self.restart(node),
                FaultKind::Temperature { node, .. } => self.pucks[puck(node)].heat(self.faults.temperature(node)),
                FaultKind::Pendant(action) if begins => {
                    self.operator.observe(action);
                    self.safety.press(self.now, action);
                }
                FaultKind::Warning(quantity) => self.safety.warn(quantity, self.faults.warns_of(quantity)),
                FaultKind::Push { .. } | FaultKind::Payload(_) => self.world.push(self.faults.push(), [0.0; 3]),
                _ => {}
            }
        }
        self.faults.send_floods(self.now, &mut self.bus);
        while let Some(passage) = self.faults.take_late(self.now) {
            self.receive(&passage, passage.end, usize::from(!self.faults.is_bus_off()));
        }
    }

    /// A node loses its power for an instant.
    fn restart(&mut self, number: u8) {
        let Some(node) = Node::new(number) else { return };
        self.bus.withdraw(node);
        match (node.arm_index(), node.hand_index(), &mut self.hand) {
            (Some(motor), ..) => self.pucks[motor].restart(self.now),
            (_, Some(digit), Some(hand)) => hand.restart(digit, self.now),
            _ if node == Node::FORCE_TORQUE => {
                self.force_torque.power_off();
                self.force_torque.power_on(self.now);
            }
            _ => {}
        }
    }

    /// A frame has left the wire: its sender knows, and the others receive it unless a fault keeps it from them.
    fn deliver(&mut self, passage: &Passage) {
        if passage.sender == Node::HOST {
            self.deliveries.push_back(Delivery { at: passage.end, received: None });
            self.bus.note_heard(passage);
        }
        if let Treated::Received(frame, copies) = self.faults.treat(self.now, passage) {
            self.receive(&Passage { frame, ..*passage }, passage.received_at(), copies);
        }
    }

    /// Everybody but its sender has a frame, at time `at`; the co-controller has so many `copies` of it.
    fn receive(&mut self, passage: &Passage, at: Ticks, copies: usize) {
        if passage.sender != Node::HOST {
            let delivery = Delivery { at: passage.end, received: Some(passage.frame) };
            self.deliveries.extend(std::iter::repeat_n(delivery, copies));
            self.bus.note_heard(passage);
        }
        if let Ok(request) = Request::decode(&passage.frame)
            // What a puck says is a request to nobody; the safety module is the only device that gives orders.
            && matches!(request.sender, Node::HOST | Node::SAFETY_MODULE)
        {
            let delay = self.torque_delay + self.faults.torque_delay();
            if let Action::PackedTorques { torques, .. } = request.action
                && self.faults.awaits_torque()
                && torques.iter().any(|torque| torque.units() != 0)
            {
                self.faults.see_torque(self.now);
            }
            // A torque overtakes none that is under way.
            let due = self.late_torques.back().map_or(at, |(latest, _)| *latest).max(at + delay);
            if due > at && matches!(request.action, Action::PackedTorques { .. }) {
                self.late_torques.push_back((due, request));
            } else {
                self.instruct(at, &request);
            }
        }
        if !self.hand_alone {
            self.safety.hear(at, &passage.frame);
        }
    }

    /// A request reaches pucks, sensor and hand.
    fn instruct(&mut self, at: Ticks, request: &Request) {
        if !self.hand_alone {
            for puck in &mut self.pucks {
                puck.receive(at, request);
            }
            self.force_torque.receive(at, request);
        }
        if let Some(hand) = &mut self.hand {
            hand.receive(at, request);
        }
    }

    /// Sends what the safety module has to say, and lets motor power follow its mode.
    fn settle_power(&mut self) {
        for frame in self.safety.take_outgoing() {
            self.bus.queue(self.now, Node::SAFETY_MODULE, frame);
        }
        if self.safety.mode() == SafetyMode::Active {
            self.motors.see_active(self.now);
        }
        let should_be_powered = self.safety.mode() != SafetyMode::EStop;
        if should_be_powered == self.motors.are_powered() {
            return;
        }
        self.motors.set_powered(should_be_powered);
        for (puck, node) in self.pucks.iter_mut().zip(Node::ARM) {
            if should_be_powered {
                puck.power_on(self.now);
            } else {
                puck.power_off();
                self.bus.withdraw(node);
            }
        }
        if should_be_powered {
            self.force_torque.power_on(self.now);
            self.hand.iter_mut().for_each(|hand| hand.power_on(self.now));
        } else {
            self.force_torque.power_off();
            self.bus.withdraw(Node::FORCE_TORQUE);
            self.hand.iter_mut().for_each(Hand::power_off);
            Node::HAND.into_iter().for_each(|digit| self.bus.withdraw(digit));
        }
    }
}
