//! The time of a control cycle on the bus with every stuff bit there can be: summed, and played through bit by bit.
//!
//! A standard frame of n data bytes has 47 + 8 n bits with the three bits behind it, and at worst one stuff bit for
//! every four bits after the first of the 34 + 8 n bits in which stuffing happens. One bit takes a microsecond.

use std::collections::BTreeMap;

use device::{DeviceController, Slot};
use puck::CanFrame;

use crate::double::{Bus, holding_with_ready_hand};

/// A control cycle of 300 Hz, us, whatever the rate is: what fits into it with every stuff bit is 125 % of one of
/// 500 Hz.
const CYCLE_US: f64 = 1e6 / 300.0;
/// Share of it that a full cycle may take in the worst case.
const MOST: f64 = 0.84;
/// From a request's end to its answers being ready, us.
const LATENCY_US: f64 = 75.0;

fn worst_us(payload: usize) -> f64 {
    (47 + 8 * payload + (34 + 8 * payload - 1) / 4) as f64
}

#[test]
fn the_bit_count_is_that_of_the_reference() {
    let table = [(1, 65.0), (3, 85.0), (4, 95.0), (6, 115.0), (7, 125.0), (8, 135.0)];
    assert!(table.into_iter().all(|(payload, worst)| worst_us(payload) == worst));
}

/// One frame of a cycle.
#[derive(Clone, Copy)]
struct Job {
    /// When its sender has it ready, us after the cycle's begin; for answers, after the end of their request.
    ready_us: f64,
    /// The request it answers, as an index of the cycle's jobs.
    answers: Option<usize>,
    frame: CanFrame,
}

/// The frames of one cycle as they happened: requests at their slots, answers behind their requests.
fn jobs(bus: &Bus, log_begin: usize, answers_begin: usize, begin_us: u64) -> Vec<Job> {
    let mut jobs: Vec<Job> = bus.log[log_begin..]
        .iter()
        .map(|(time, frame)| Job { ready_us: (time - begin_us) as f64, answers: None, frame: *frame })
        .collect();
    // Requests of one slot are answered in the order they were sent; which answers belong to which is told by their
    // group (3 positions, 6 properties, 10 and 11 the sensor) and their sender.
    let requests = jobs.clone();
    for (time, frame) in &bus.answers[answers_begin..] {
        let sender = frame.can_id().sender().number();
        let group = frame.can_id().raw() & 0x1F;
        let asked = |job: &Job| {
            let to = job.frame.can_id().raw();
            let property = job.frame.payload()[0];
            let reached = match to {
                0x404 => sender <= 7,
                0x405 => (11..=14).contains(&sender),
                node => node == u16::from(sender),
            };
            let fits = match group {
                3 => property == 48,
                6 => property == frame.payload()[0] & 0x7F,
                _ => property == 54,
            };
            job.ready_us == (time - begin_us) as f64 && reached && fits
        };
        let request = requests.iter().position(asked).expect("every answer has its request");
        jobs.push(Job { ready_us: LATENCY_US, answers: Some(request), frame: *frame });
    }
    jobs
}

/// Plays the cycle on the wire: whenever it is free the lowest identifier that is ready goes. When the last frame ends,
/// us.
fn played(jobs: &[Job]) -> f64 {
    let mut ends: Vec<Option<f64>> = vec![None; jobs.len()];
    let mut free = 0.0_f64;
    while ends.iter().any(Option::is_none) {
        let ready: Vec<(usize, f64)> = (0..jobs.len())
            .filter(|index| ends[*index].is_none())
            .filter_map(|index| match jobs[index].answers {
                None => Some((index, jobs[index].ready_us)),
                Some(request) => ends[request].map(|end| (index, end + jobs[index].ready_us)),
            })
            .collect();
        let earliest = ready.iter().map(|(_, at)| *at).fold(f64::INFINITY, f64::min).max(free);
        let (index, _) = ready
            .into_iter()
            .filter(|(_, at)| *at <= earliest)
            .min_by_key(|(index, _)| (jobs[*index].frame.can_id().raw(), *index))
            .expect("something is ready");
        free = earliest + worst_us(jobs[index].frame.payload().len());
        ends[index] = Some(free);
    }
    free
}

/// Runs cycles; the largest sum and the latest end, us.
fn measure(core: &mut DeviceController, bus: &mut Bus, cycles: usize) -> (f64, f64, BTreeMap<usize, usize>) {
    bus.run_to(core, Slot::Request);
    let (mut sum, mut end, mut counts) = (0.0_f64, 0.0_f64, BTreeMap::new());
    for _ in 0..cycles {
        let (log_begin, answers_begin) = (bus.log.len(), bus.answers.len());
        bus.run_slots(core, 1);
        let begin_us = bus.now_us;
        bus.run_slots(core, 2);
        let jobs = jobs(bus, log_begin, answers_begin, begin_us);
        sum = sum.max(jobs.iter().map(|job| worst_us(job.frame.payload().len())).sum());
        end = end.max(played(&jobs));
        *counts.entry(jobs.len()).or_default() += 1;
    }
    (sum, end, counts)
}

#[test]
fn a_full_cycle_fits_with_every_stuff_bit_and_ends_before_the_next_request() {
    let (mut core, mut bus) = holding_with_ready_hand();
    // A saturated sensor appends its status byte.
    bus.sensor.status = Some(puck::GaugeStatus(0x01));
    bus.commands.push_back(control::Command::MoveHand { q: [0.2, 0.6, 0.6, 0.6], duration: 1.0 }.into());
    let (sum, end, counts) = measure(&mut core, &mut bus, 3_000);
    println!(
        "worst sum {sum:.0} us, {:.1} %; last frame ends at {end:.0} us; frames per cycle {counts:?}",
        100.0 * sum / CYCLE_US
    );
    assert!(counts.keys().max() >= Some(&26), "all of it was there: {counts:?}");
    assert!(sum <= MOST * CYCLE_US, "{sum} us are {:.1} %", 100.0 * sum / CYCLE_US);
    assert!(end < CYCLE_US, "the last frame ends at {end} us");
}

#[test]
fn the_torques_of_the_arm_have_left_when_the_slow_slot_begins() {
    // Five frames of the host, the longest answer already on the wire when they are handed over.
    let last = CYCLE_US / 3.0 + worst_us(8) + 3.0 * worst_us(8) + 2.0 * worst_us(1);
    assert!(last < 2.0 * CYCLE_US / 3.0, "{last}");
}
