//! The tours of `tactus calibrate gravity` and `friction`: every posture is passed upwards and downwards.

use std::time::Duration;

use control::model::{LinkWeight, WeightCorrection};
use control::{Payload, State, flags};
use link::EventKind;

use super::travel;
use super::{ProcedureError, after};
use crate::client::{Client, Incoming};
use crate::demonstration::RATE;
use crate::device::Device;
use crate::weigh::{Crossing, HALF_WAY, PASS_SECONDS, Sample, WINDOW, is_held_out};

/// Telemetry of every third cycle, 100 Hz.
const EVERY: u8 = 3;

/// Shortest move from posture to posture, s. An arm that is not weighed yet asks for more than its model says where
/// all joints set out at once, and what nobody knows of looks like a push.
const UNHURRIED: f32 = 3.0;

/// Longest pass, s.
const TIMEOUT: u64 = 30;

/// Measurements of a tour, by postures.
#[derive(Debug, Clone, Default)]
pub struct Crossings {
    /// Postures to regress from.
    pub fitted: Vec<Crossing>,
    /// Postures to judge by.
    pub held_out: Vec<Crossing>,
}

/// The payload of the arm, and the weight that its device computes with now.
///
/// # Errors
/// As [`Client::request`].
pub fn weight_in_use(client: &mut Client<Device>) -> Result<WeightCorrection, ProcedureError> {
    let payload = match client.status()?.wrench_zeroed {
        Some(_) => Payload::SensorAndHand,
        None => Payload::None,
    };
    let told = client.weight()?;
    let links = told.links.map(|[share, x, y, z]| LinkWeight { share, shift: [x, y, z] });
    let own = WeightCorrection::new(payload, links).ok().filter(|_| told.in_use);
    Ok(own.unwrap_or(WeightCorrection::none(payload)))
}

/// Moves the arm through the postures (rad). It holds in the last one. `progress` hears which one is next.
///
/// # Errors
/// As [`travel`].
pub fn cross_postures(
    client: &mut Client<Device>,
    postures: &[[f32; 7]],
    mut progress: impl FnMut(usize),
) -> Result<Crossings, ProcedureError> {
    let mut crossings = Crossings::default();
    for (index, posture) in postures.iter().enumerate() {
        progress(index);
        let (below, above) = (posture.map(|q| q - HALF_WAY), posture.map(|q| q + HALF_WAY));
        travel::within(client, below, UNHURRIED, |_| {})?;
        let mut pass = |target| pass_posture(client, target, posture, PASS_SECONDS);
        let crossing = Crossing { up: pass(above)?, down: pass(below)? };
        if is_held_out(index) {
            crossings.held_out.push(crossing);
        } else {
            crossings.fitted.push(crossing);
        }
    }
    Ok(crossings)
}

/// Moves the arm through the postures (rad), each at every one of these durations of a pass (s). It holds in the last
/// one. `progress` hears which posture is next.
///
/// # Errors
/// As [`travel`].
pub fn slide_postures(
    client: &mut Client<Device>,
    postures: &[[f32; 7]],
    durations: &[f32],
    mut progress: impl FnMut(usize),
) -> Result<Vec<Crossing>, ProcedureError> {
    let mut crossings = Vec::with_capacity(postures.len() * durations.len());
    for (index, posture) in postures.iter().enumerate() {
        progress(index);
        let (below, above) = (posture.map(|q| q - HALF_WAY), posture.map(|q| q + HALF_WAY));
        travel::within(client, below, UNHURRIED, |_| {})?;
        for seconds in durations {
            let mut pass = |target| pass_posture(client, target, posture, *seconds);
            crossings.push(Crossing { up: pass(above)?, down: pass(below)? });
        }
    }
    Ok(crossings)
}

/// Moves to `target` (rad) through the posture within `seconds`, or longer where the device asks for it; what was
/// measured near it.
fn pass_posture(
    client: &mut Client<Device>,
    target: [f32; 7],
    posture: &[f32; 7],
    seconds: f32,
) -> Result<Vec<Sample>, ProcedureError> {
    client.take_events();
    client.set_telemetry(EVERY)?;
    travel::approach(client, target, seconds)?;
    let samples = watch(client, posture[0].into());
    client.set_telemetry(0)?;
    samples
}

fn watch(client: &mut Client<Device>, first: f64) -> Result<Vec<Sample>, ProcedureError> {
    let started = client.now();
    let (mut samples, mut first_cycle, mut moves) = (Vec::new(), None, false);
    loop {
        if client.now().saturating_sub(started) > Duration::from_secs(TIMEOUT) {
            client.stop()?;
            return Err(ProcedureError::TooLong { what: "the pass through a posture", seconds: TIMEOUT });
        }
        match client.next(Duration::from_millis(100))? {
            Some(Incoming::Telemetry(cycle)) => {
                let [q, torque, speed] = [cycle.q, cycle.tau, cycle.dq].map(|joints| joints.map(f64::from));
                let time = f64::from(cycle.cycle.wrapping_sub(*first_cycle.get_or_insert(cycle.cycle))) / RATE;
                let sample = Sample { time, q, torque, speed, wrench: cycle.wrench.map(f64::from) };
                let measured = cycle.flags & flags::POSITIONS_KNOWN != 0 && cycle.lost_replies == 0;
                if measured && (sample.q[0] - first).abs() <= WINDOW {
                    samples.push(sample);
                }
                let state = State::from_code(cycle.state);
                moves |= state == Some(State::Approach);
                if moves && state == Some(State::Hold) {
                    // The event may have been lost; the state cannot.
                    return Ok(samples);
                }
            }
            Some(Incoming::Event(event)) if event.kind == EventKind::Arrived => return Ok(samples),
            Some(Incoming::Event(event)) if event.kind == EventKind::State => after(event.code, event.detail)?,
            _ => {}
        }
    }
}
