//! Carries out injections: which faults are there now, and their effect on a frame.

use super::check::LARGEST_CLOCK_ERROR;
use super::{FaultKind, FrameKind, Frames, Injection, Supervised};
use crate::bus::Bus;
use crate::noise::Noise;
use crate::time::{Ticks, seconds, ticks};
use crate::wire::Passage;
use puck::{CanFrame, CanId, Node};
use std::collections::VecDeque;

/// Stream of noise that no node number names.
const STREAM: u64 = 0x0FA1;

/// Sender of a flood: no device of an arm has this number.
const FLOODER: Node = match Node::new(30) {
    Some(node) => node,
    None => unreachable!(),
};

/// Identifier that wins against every other.
const FIRST: CanId = match CanId::new(0) {
    Some(id) => id,
    None => unreachable!(),
};

/// One injection, once.
#[derive(Clone, Debug)]
struct Order {
    begins: Ticks,
    /// `Ticks::MAX` for ever.
    ends: Ticks,
    kind: FaultKind,
    phase: Phase,
    /// Frames it has met.
    hits: u32,
    /// First frame of each identifier since the begin.
    first: Vec<CanFrame>,
    /// When the next frame of a flood is due.
    flood_at: Ticks,
}

impl Order {
    /// Time between two frames of a flood, and their bytes.
    fn flood(&self) -> Option<(Ticks, u8)> {
        match self.kind {
            FaultKind::Flood { rate, bytes } if rate > 0.0 => Some((ticks(1.0 / rate).max(1), bytes.min(8))),
            _ => None,
        }
    }

    /// True if nothing comes of it any more.
    fn is_over(&self) -> bool {
        let is_of_a_moment =
            matches!(self.kind, FaultKind::CountJump { .. } | FaultKind::Restart { .. } | FaultKind::Pendant(_));
        self.phase == Phase::After || (self.phase == Phase::During && is_of_a_moment && self.ends == Ticks::MAX)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Before,
    During,
    After,
}

/// Fate of a frame on its way to the receivers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Treated {
    /// Nobody receives it.
    Lost,
    /// It comes by itself, later.
    Later,
    /// It is received as it is now; the co-controller receives so many copies.
    Received(CanFrame, usize),
}

/// Everything ordered.
#[derive(Clone, Debug)]
pub(crate) struct Faults {
    orders: Vec<Order>,
    /// Orders whose time begins with the first torque.
    on_torque: Vec<Injection>,
    noise: Noise,
    late: VecDeque<(Ticks, Passage)>,
}

impl Faults {
    /// Nothing ordered; `seed` draws frames and bits.
    pub(crate) fn new(seed: u64) -> Self {
        let noise = Noise::new(seed, STREAM);
        Self { orders: Vec::new(), on_torque: Vec::new(), noise, late: VecDeque::new() }
    }

    /// Orders faults whose times count from `zero`.
    pub(crate) fn order(&mut self, zero: Ticks, injections: &[Injection]) {
        self.orders.retain(|order| !order.is_over());
        for injection in injections {
            for time in 0..injection.times {
                let begins = zero + ticks(injection.at + injection.every * f64::from(time));
                let ends = begins.saturating_add(ticks(injection.lasts));
                let kind = injection.what.clone();
                self.orders.push(Order {
                    begins,
                    ends,
                    kind,
                    phase: Phase::Before,
                    hits: 0,
                    first: Vec::new(),
                    flood_at: 0,
                });
            }
        }
    }

    /// Orders faults whose times count from the first torque that is not zero.
    pub(crate) fn order_on_torque(&mut self, injections: Vec<Injection>) {
        self.on_torque = injections;
    }

    /// True while the first torque is awaited.
    pub(crate) fn awaits_torque(&self) -> bool {
        !self.on_torque.is_empty()
    }

    /// The first torque came at `now`.
    pub(crate) fn see_torque(&mut self, now: Ticks) {
        let injections = std::mem::take(&mut self.on_torque);
        self.order(now, &injections);
    }

    /// When the next fault begins or ends, or the next late frame comes.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        let changes = self.orders.iter().filter_map(|order| match order.phase {
            Phase::Before => Some(order.begins),
            Phase::During if order.ends < Ticks::MAX => Some(order.ends),
            _ => None,
        });
        let flood = self.present().filter(|order| order.flood().is_some()).map(|order| order.flood_at);
        changes.chain(self.late.front().map(|(at, _)| *at)).chain(flood).min()
    }

    /// Begins or ends one fault whose time has come: the fault, and true if it begins.
    pub(crate) fn change(&mut self, now: Ticks) -> Option<(FaultKind, bool)> {
        for order in &mut self.orders {
            match order.phase {
                Phase::Before if order.begins <= now => order.phase = Phase::During,
                Phase::During if order.ends <= now => order.phase = Phase::After,
                _ => continue,
            }
            return Some((order.kind.clone(), order.phase == Phase::During));
        }
        None
    }

    /// A late frame whose time has come.
    pub(crate) fn take_late(&mut self, now: Ticks) -> Option<Passage> {
        self.late.pop_front_if(|(at, _)| *at <= now).map(|(_, passage)| passage)
    }

    /// Sends the frames of floods that are due, in place of those that could not leave.
    pub(crate) fn send_floods(&mut self, now: Ticks, bus: &mut Bus) {
        let mut is_first = true;
        for order in self.orders.iter_mut().filter(|order| order.phase == Phase::During && order.flood_at <= now) {
            let Some((every, bytes)) = order.flood() else { continue };
            order.flood_at = now + every;
            if std::mem::take(&mut is_first) {
                bus.withdraw(FLOODER);
            }
            if let Some(frame) = CanFrame::from_slice(FIRST, &[0x55; 8][..usize::from(bytes)]) {
                bus.queue(now, FLOODER, frame);
            }
        }
    }

    /// Share by which the co-controller's clock is slow.
    pub(crate) fn clock_error(&self) -> f64 {
        let errors = self.present().map(|order| if let FaultKind::Clock(share) = order.kind { share } else { 0.0 });
        // Each is within the same bounds.
        errors.sum::<f64>().clamp(-LARGEST_CLOCK_ERROR, LARGEST_CLOCK_ERROR)
    }

    /// Fate of a frame that has just left the wire.
    pub(crate) fn treat(&mut self, now: Ticks, passage: &Passage) -> Treated {
        let (mut frame, mut copies) = (passage.frame, 1);
        for order in self.orders.iter_mut().filter(|order| order.phase == Phase::During) {
            match &order.kind {
                FaultKind::BusOff if passage.sender == Node::HOST => return Treated::Lost,
                FaultKind::BusOff => copies = 0,
                FaultKind::Drop(frames) if order.hits < frames.most && frames.mean(passage, &mut self.noise) => {
                    order.hits += 1;
                    return Treated::Lost;
                }
                FaultKind::Delay { frames, by }
                    if order.hits < frames.most && frames.mean(passage, &mut self.noise) =>
                {
                    order.hits += 1;
                    let at = now + ticks(*by);
                    let place = self.late.partition_point(|(other, _)| *other <= at);
                    self.late.insert(place, (at, Passage { end: at, frame, ..*passage }));
                    return Treated::Later;
                }
                FaultKind::Repeat(frames) if order.hits < frames.most && frames.mean(passage, &mut self.noise) => {
                    order.hits += 1;
                    copies = 2 * copies.min(1);
                }
                FaultKind::Flip(frames) if order.hits < frames.most && frames.mean(passage, &mut self.noise) => {
                    order.hits += 1;
                    frame = flipped(&frame, &mut self.noise);
                }
                FaultKind::Freeze(frames) if order.hits < frames.most && frames.mean(passage, &mut self.noise) => {
                    order.hits += 1;
                    match order.first.iter().find(|first| first.can_id() == frame.can_id()) {
                        Some(first) => frame = *first,
                        None => order.first.push(frame),
                    }
                }
                _ => {}
            }
        }
        Treated::Received(frame, copies)
    }

    /// Error of the sensor at `now`, N and N m, sensor axes.
    pub(crate) fn sensor_error(&self, now: Ticks) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for order in self.present() {
            if let FaultKind::Sensor { error, drift } = &order.kind {
                let age = seconds(now.saturating_sub(order.begins));
                (0..6).for_each(|axis| sum[axis] += error[axis] + drift[axis] * age);
            }
        }
        sum
    }

    /// Force of everything that pushes, or hangs, at the grasp point, N, world frame.
    pub(crate) fn push(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for order in self.present() {
            match &order.kind {
                FaultKind::Push { force } => (0..3).for_each(|axis| sum[axis] += force[axis]),
                FaultKind::Payload(mass) => sum[2] -= 9.81 * mass,
                _ => {}
            }
        }
        sum
    }

    /// Viscous friction beyond the world's own, N m s/rad.
    pub(crate) fn friction(&self) -> [f64; 7] {
        let mut sum = [0.0; 7];
        for order in self.present() {
            if let FaultKind::Friction(added) = &order.kind {
                (0..7).for_each(|joint| sum[joint] += added[joint]);
            }
        }
        sum
    }

    /// Delay of packed torques beyond the plant's own.
    pub(crate) fn torque_delay(&self) -> Ticks {
        let delays =
            self.present().map(|order| if let FaultKind::TorqueDelay(by) = order.kind { ticks(by) } else { 0 });
        delays.sum()
    }

    /// True while the co-controller is off the bus.
    pub(crate) fn is_bus_off(&self) -> bool {
        self.present().any(|order| order.kind == FaultKind::BusOff)
    }

    /// Frames that the co-controller's CAN controller does not take.
    pub(crate) fn refused(&self) -> Vec<FrameKind> {
        let kinds = self.present().filter_map(|order| match order.kind {
            FaultKind::Refuse(kind) => Some(kind),
            FaultKind::BusOff => Some(FrameKind::Any),
            _ => None,
        });
        kinds.collect()
    }

    /// Temperature that a puck tells, degree Celsius, by the last order of those that are present.
    pub(crate) fn temperature(&self, of: u8) -> Option<i32> {
        let told = self.present().filter_map(|order| match order.kind {
            FaultKind::Temperature { node, celsius } if node == of => Some(celsius),
            _ => None,
        });
        told.last()
    }

    /// True while the pendant warns of a quantity whatever the safety module hears.
    pub(crate) fn warns_of(&self, quantity: Supervised) -> bool {
        self.present().any(|order| order.kind == FaultKind::Warning(quantity))
    }

    fn present(&self) -> impl Iterator<Item = &Order> {
        self.orders.iter().filter(|order| order.phase == Phase::During)
    }
}

impl Frames {
    /// True if the fault is meant for this frame; draws if only a share is.
    fn mean(&self, passage: &Passage, noise: &mut Noise) -> bool {
        (self.from.is_empty() || self.from.contains(&passage.sender.number()))
            && (self.kind == FrameKind::Any || self.kind.fits(&passage.frame))
            && (self.share >= 1.0 || noise.uniform(0.0, 1.0) < self.share)
    }
}

/// The frame with one wrong bit in its data.
fn flipped(frame: &CanFrame, noise: &mut Noise) -> CanFrame {
    let mut bytes = [0; 8];
    let length = frame.payload().len();
    bytes[..length].copy_from_slice(frame.payload());
    // The cast cuts: a bit of the payload, or none of an empty one.
    let bit = noise.uniform(0.0, 8.0 * length as f64) as usize;
    if let Some(byte) = bytes.get_mut(bit / 8) {
        *byte ^= 1 << (bit % 8);
    }
    CanFrame::from_slice(frame.can_id(), &bytes[..length]).unwrap_or(*frame)
}
