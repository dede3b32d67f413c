//! Starts a cold arm with a hand, runs ten seconds of 300 Hz cycles with zero torques, and says how fast that went.
//!
//! `cargo run --release -p sim --example speed`

use puck::{
    CanFrame, Group, Node, Property, PropertyId, PropertyTable, PuckTorque, force_torque, get, packed_torques, set,
};
use sim::{FrameClass, FreeJoints, HOME, Plant, PlantConfig, TICKS_PER_MILLISECOND, Ticks, period_ticks, seconds};
use std::time::Instant;

/// A third of a control cycle of 300 Hz.
const SLOT_TICKS: Ticks = period_ticks(900);

/// Lets virtual time pass as a co-controller does that has nothing to do: from event to event.
fn wait(plant: &mut Plant, until: Ticks) -> u64 {
    let mut events = 0;
    while let Some(next) = plant.next_event()
        && next <= until
    {
        plant.event(next.max(plant.now()));
        events += 1;
    }
    plant.advance(until);
    events
}

fn main() {
    let mut plant = Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(HOME)));
    wait(&mut plant, 100 * TICKS_PER_MILLISECOND);
    for node in Node::ARM.into_iter().chain(Node::HAND).chain([Node::FORCE_TORQUE]) {
        let now = plant.now();
        plant.submit(now, set(node, PropertyId::STAT, 2));
        wait(&mut plant, now + 10 * TICKS_PER_MILLISECOND);
    }
    wait(&mut plant, 1400 * TICKS_PER_MILLISECOND);

    let (begun, busy_before, started) = (plant.now(), plant.trace().busy, Instant::now());
    let cycles: Ticks = 3000;
    let mut events = 0;
    let zero = [PuckTorque::ZERO; 4];
    let gauges =
        PropertyTable::motor(200).ok().and_then(|table| table.id(Property::Sg)).expect("hand pucks have gauges");
    let torques = |group| packed_torques(group, PropertyId::TORQUE, zero);
    let requests = vec![get(Group::ARM, PropertyId::POSITION), force_torque::get_wrench()];
    let commands: Vec<CanFrame> = [Group::ARM_TORQUES, Group::WRIST_TORQUES, Group::HAND].map(torques).into();
    let hand = [get(Group::HAND, PropertyId::POSITION), get(Group::HAND, gauges)];
    let slots = [requests, commands.into_iter().chain(hand).collect()];
    for cycle in 0..cycles {
        for (slot, frames) in slots.iter().enumerate() {
            let t = begun + (3 * cycle + slot as Ticks) * SLOT_TICKS;
            events += wait(&mut plant, t);
            frames.iter().for_each(|frame| plant.submit(t, *frame));
        }
    }
    events += wait(&mut plant, begun + 3 * cycles * SLOT_TICKS);

    let (virtual_time, wall) = (seconds(plant.now() - begun), started.elapsed().as_secs_f64());
    let trace = plant.trace();
    println!("{virtual_time:.1} s virtual in {wall:.3} s: {:.0} times real time, {events} events", virtual_time / wall);
    println!("bus load {:.1} %", 100.0 * seconds(trace.busy - busy_before) / virtual_time);
    for class in FrameClass::ALL {
        println!("{:>8} {class}", trace.count(class));
    }
    println!("invalid {}, hash {:016x}", trace.invalid, trace.hash);
}
