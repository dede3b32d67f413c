//! The weight of the links: told, kept when it is plausible and durable, and in use once the arm has no torque.

use control::model::{LinkWeight, WeightCorrection};
use control::{Payload, State};
use device::StoreError;
use device::storage::{Library, Opening, WEIGHT_KEY, Work};
use device::weight::{WEIGHT_BYTES, encode};
use link::{HomeSource, Refusal, Reply, Request, Weight};

use crate::rig::{SLOT_BYTES, SLOTS};

type Rig = crate::rig::Rig<Library<SLOTS, SLOT_BYTES>>;

const LINKS: [[f32; 4]; 7] = [[0.05, 0.001, -0.002, 0.003]; 7];

/// With these bytes of a weight on the flash; none of a weight that was never kept.
fn rig_with(kept: &[u8]) -> Rig {
    let mut library = Library::new();
    library.restore(WEIGHT_KEY, kept);
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.bench.state = State::Idle;
    rig.greet();
    rig
}

fn own() -> WeightCorrection {
    let links = LINKS.map(|[share, x, y, z]| LinkWeight { share, shift: [x, y, z] });
    WeightCorrection::new(Payload::SensorAndHand, links).expect("an arm can weigh that")
}

fn told(rig: &mut Rig) -> Weight {
    match rig.ask(Request::Weight) {
        Some(Reply::Weight { weight, .. }) => weight,
        other => panic!("no weight but {other:?}"),
    }
}

fn settle(rig: &mut Rig, outcome: Result<(), StoreError>) -> (Option<Work>, Vec<u8>) {
    let mut copy = [0; SLOT_BYTES];
    let work = rig.session.store_mut().take(&mut copy);
    rig.session.store_mut().settle(outcome);
    rig.poll();
    (work, copy[..WEIGHT_BYTES].to_vec())
}

fn keep() -> Request {
    Request::KeepWeight { hand: true, links: LINKS }
}

#[test]
fn a_weight_is_kept_when_the_flash_has_it_and_used_then() {
    let mut rig = rig_with(&[]);
    let model = Weight { hand: true, ..Weight::default() };
    assert_eq!(told(&mut rig), model);
    assert_eq!(rig.ask(keep()), None, "answered before anything was written");
    assert_eq!(told(&mut rig), model, "told before it was durable");
    assert!(!rig.bench.weights.contains(&own()), "used before it was durable");
    let (work, bytes) = settle(&mut rig, Ok(()));
    assert_eq!(work, Some(Work::Save { slot: WEIGHT_KEY, length: WEIGHT_BYTES }));
    assert_eq!(bytes, encode(&own()));
    assert_eq!(told(&mut rig), Weight { hand: true, links: LINKS, source: HomeSource::Stored, in_use: true });
    assert_eq!(rig.bench.weights.last(), Some(&own()));
    // Another tool: what was measured with the hand does not count for the bare arm.
    rig.bench.payload = Payload::None;
    assert!(!told(&mut rig).in_use);
    rig.bench.payload = Payload::SensorAndHand;
    assert_eq!(rig.ask(Request::ForgetWeight), None);
    assert_eq!(settle(&mut rig, Ok(())).0, Some(Work::Delete { slot: WEIGHT_KEY }));
    assert_eq!(told(&mut rig), model);
    assert_eq!(rig.bench.weights.last(), Some(&WeightCorrection::none(Payload::SensorAndHand)));
}

#[test]
fn a_weight_that_the_flash_did_not_take_is_not_used() {
    let mut rig = rig_with(&[]);
    assert_eq!(rig.ask(keep()), None);
    settle(&mut rig, Err(StoreError::Medium));
    assert!(matches!(rig.answer(), Some(Reply::Refused { reason: Refusal::StoreFailed, .. })));
    assert_eq!(told(&mut rig).source, HomeSource::Model);
    assert!(!rig.bench.weights.contains(&own()));
}

#[test]
fn a_weight_waits_until_the_arm_has_no_torque() {
    let mut rig = rig_with(&[]);
    rig.bench.state = State::Hold;
    assert_eq!(rig.ask(keep()), None);
    settle(&mut rig, Ok(()));
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
    let weight = told(&mut rig);
    assert_eq!((weight.source, weight.in_use), (HomeSource::Stored, false));
    assert!(!rig.bench.weights.contains(&own()));
    rig.bench.state = State::Idle;
    rig.poll();
    assert_eq!(rig.bench.weights.last(), Some(&own()));
    assert!(told(&mut rig).in_use);
}

#[test]
fn a_stored_weight_is_used_from_the_start_and_a_damaged_one_is_said() {
    let mut rig = rig_with(&encode(&own()));
    assert_eq!(rig.bench.weights.last(), Some(&own()));
    assert!(told(&mut rig).in_use);
    let mut damaged = encode(&own());
    damaged[20] ^= 1;
    let mut foreign = encode(&own());
    foreign[4] += 1;
    let (body, sum) = foreign.split_last_chunk_mut::<4>().expect("a check sum");
    *sum = link::frame::CRC.checksum(body).to_le_bytes();
    for (kept, source) in [(damaged, HomeSource::Damaged), (foreign, HomeSource::Foreign)] {
        let mut rig = rig_with(&kept);
        assert_eq!(told(&mut rig), Weight { hand: true, source, ..Weight::default() });
        assert_eq!(rig.bench.weights.last(), Some(&WeightCorrection::none(Payload::SensorAndHand)));
    }
}

#[test]
fn a_weight_that_no_arm_has_is_refused_with_its_link() {
    let mut rig = rig_with(&[]);
    for (link, number, value, fault) in
        [(0, 0, f32::NAN, 0), (2, 3, f32::INFINITY, 0), (4, 0, 0.51, 1), (5, 0, -0.51, 1), (6, 2, 0.051, 2)]
    {
        let mut links = LINKS;
        links[link][number] = value;
        let refused = rig.refused(Request::KeepWeight { hand: true, links });
        assert_eq!(refused, (Refusal::WeightImplausible, [link as u32, fault]));
    }
    assert_eq!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]), None, "one of them went to the flash");
}
