//! The home of an arm: told, kept when it is plausible and durable, forgotten, and never while the arm has torque.

use control::State;
use device::calibration::{HOME_BYTES, HOME_DISTANCE};
use device::storage::{HOME_KEY, Library, Opening, Work};
use device::{Home, Store as _, StoreError, StoredHome};
use link::{Calibration, HomeSource, Refusal, Reply, Request};

use crate::rig::{SLOT_BYTES, SLOTS, image};

type Rig = crate::rig::Rig<Library<SLOTS, SLOT_BYTES>>;

/// A home a few degrees beside the model's, within the reach of every joint.
const OWN: [f32; 7] = [0.06, -1.93, -0.04, 3.05, 0.1, -0.02, 0.2];

/// A session over a library whose flash is this test, with an arm at rest.
fn rig() -> Rig {
    rig_with(StoredHome::Nothing)
}

fn rig_with(home: StoredHome) -> Rig {
    let mut library = Library::new();
    library.open(Opening { home, ..Opening::default() });
    let mut rig = Rig::over(library);
    rig.bench.state = State::Idle;
    rig.greet();
    rig
}

fn told(rig: &mut Rig) -> Calibration {
    match rig.ask(Request::Calibration) {
        Some(Reply::Calibration { calibration, .. }) => calibration,
        other => panic!("no calibration but {other:?}"),
    }
}

/// The flash does what it is asked for; what was to be done.
fn keep(rig: &mut Rig, outcome: Result<(), StoreError>) -> (Option<Work>, Vec<u8>) {
    let mut copy = [0; SLOT_BYTES];
    let work = rig.session.store_mut().take(&mut copy);
    rig.session.store_mut().settle(outcome);
    rig.poll();
    (work, copy[..HOME_BYTES].to_vec())
}

fn model() -> [f32; 7] {
    *Home::of_model().angles()
}

#[test]
fn an_arm_without_a_home_of_its_own_has_the_model_s() {
    let mut rig = rig();
    assert_eq!(told(&mut rig), Calibration { home: model(), source: HomeSource::Model, zeroed_at: None });
    assert_eq!(model(), control::model::HOME.map(|angle| angle as f32));
    rig.bench.zeroed_at = Some(OWN);
    assert_eq!(told(&mut rig).zeroed_at, Some(OWN));
}

#[test]
fn a_home_is_kept_when_the_flash_has_it_and_not_before() {
    let mut rig = rig();
    assert_eq!(rig.ask(Request::Calibrate { home: OWN }), None, "answered before anything was written");
    assert_eq!(told(&mut rig).source, HomeSource::Model, "told before it was durable");
    // Another change has to wait until this one is durable.
    assert_eq!(rig.refused(Request::ForgetCalibration), (Refusal::StoreFailed, [StoreError::Busy.code(), 0]));
    let (work, bytes) = keep(&mut rig, Ok(()));
    assert_eq!(work, Some(Work::Save { slot: HOME_KEY, length: HOME_BYTES }));
    assert_eq!(StoredHome::read(&bytes), StoredHome::Kept(Home::new(OWN).unwrap()));
    assert_eq!(told(&mut rig), Calibration { home: OWN, source: HomeSource::Stored, zeroed_at: None });
    assert_eq!(rig.ask(Request::ForgetCalibration), None);
    assert_eq!(told(&mut rig).source, HomeSource::Stored);
    assert_eq!(keep(&mut rig, Ok(())).0, Some(Work::Delete { slot: HOME_KEY }));
    assert_eq!((told(&mut rig).home, told(&mut rig).source), (model(), HomeSource::Model));
}

#[test]
fn the_answer_to_a_calibration_says_whether_it_is_durable() {
    for (outcome, source) in [(Ok(()), HomeSource::Stored), (Err(StoreError::Medium), HomeSource::Model)] {
        let mut rig = rig();
        assert_eq!(rig.ask(Request::Calibrate { home: OWN }), None);
        keep(&mut rig, outcome);
        match (rig.answer(), outcome) {
            (Some(Reply::Accepted { .. }), Ok(())) => {}
            (Some(Reply::Refused { reason: Refusal::StoreFailed, .. }), Err(_)) => {}
            (answer, _) => panic!("{outcome:?} was told as {answer:?}"),
        }
        assert_eq!(told(&mut rig).source, source);
    }
}

#[test]
fn a_home_that_cannot_be_that_of_this_arm_is_refused_with_the_joint() {
    let mut rig = rig();
    let mut refused = |joint: usize, angle: f32| {
        let mut home = OWN;
        home[joint] = angle;
        let (reason, detail) = rig.refused(Request::Calibrate { home });
        assert_eq!((reason, detail[0]), (Refusal::HomeImplausible, joint as u32), "J{} at {angle}", joint + 1);
        detail[1]
    };
    for joint in 0..7 {
        assert_eq!([f32::NAN, f32::INFINITY, f32::NEG_INFINITY].map(|angle| refused(joint, angle)), [0; 3]);
    }
    // Home is at the stops of J2 and J4, so these leave the joint's range first.
    assert_eq!([(1, -2.2), (3, 3.3)].map(|(joint, angle)| refused(joint, angle)), [1; 2]);
    for (joint, home) in model().into_iter().enumerate() {
        let inward = if joint == 3 { home - HOME_DISTANCE } else { home + HOME_DISTANCE };
        assert_eq!(refused(joint, inward + 0.01 * (inward - home).signum()), 2);
    }
    // Degrees taken for radians, a wrong sign, J2 and J4 exchanged.
    assert_eq!(refused(3, 179.3), 1);
    assert_eq!(refused(1, 2.0), 2);
    assert_eq!(rig.refused(Request::Calibrate { home: [0.0, 3.13, 0.0, -2.0, 0.0, 0.0, 0.0] }).1, [1, 1]);
    assert_eq!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]), None, "one of them went to the flash");
}

#[test]
fn nothing_about_the_home_changes_while_the_arm_has_torque() {
    let mut rig = rig();
    for state in State::ALL {
        rig.bench.state = state;
        for request in [Request::Calibrate { home: OWN }, Request::ForgetCalibration] {
            let refused = match rig.ask(request) {
                Some(Reply::Refused { reason: Refusal::HasTorque, detail, .. }) => {
                    assert_eq!(detail, [state.code().into(), 0]);
                    true
                }
                None => false,
                other => panic!("{state}: {other:?}"),
            };
            assert_eq!(refused, state.has_torque(), "{state}");
            assert_eq!(keep(&mut rig, Ok(())).0.is_some(), !refused, "{state}");
        }
        assert_eq!(told(&mut rig).source, HomeSource::Model);
    }
}

#[test]
fn a_damaged_or_foreign_home_is_told_and_the_model_s_counts() {
    for (stored, source) in [(StoredHome::Damaged, HomeSource::Damaged), (StoredHome::Foreign, HomeSource::Foreign)] {
        let mut rig = rig_with(stored);
        assert_eq!(told(&mut rig), Calibration { home: model(), source, zeroed_at: None });
        assert_eq!(rig.ask(Request::Calibrate { home: OWN }), None);
        keep(&mut rig, Ok(()));
        assert_eq!(told(&mut rig).source, HomeSource::Stored);
    }
}

#[test]
fn an_upload_under_way_survives_a_calibration_that_fails_and_one_that_does_not() {
    for outcome in [Err(StoreError::Full), Ok(())] {
        let mut rig = rig();
        let reach = image("reach", 2.0, 10);
        rig.send_parts("reach", &reach);
        assert_eq!(rig.ask(Request::Calibrate { home: OWN }), None);
        // The flash is busy with the home, so the commit has to wait; but what was sent is not lost by the outcome.
        let calibration = rig.sequence;
        keep(&mut rig, outcome);
        assert!(rig.sent().iter().any(|frame| frame.message.answers() == Some(calibration)));
        assert_eq!(rig.ask(Request::UploadCommit), None);
        rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
        rig.session.store_mut().settle(Ok(()));
        rig.poll();
        assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
        assert_eq!(rig.session.store().image(0), Some(reach.as_slice()));
    }
}

#[test]
fn every_damaged_bit_of_a_kept_home_is_seen() {
    let sound = Home::new(OWN).unwrap().encode();
    for place in 0..8 * HOME_BYTES {
        let mut bytes = sound;
        bytes[place / 8] ^= 1 << (place % 8);
        assert_eq!(StoredHome::read(&bytes), StoredHome::Damaged, "bit {place}");
    }
    for length in 1..HOME_BYTES {
        assert_eq!(StoredHome::read(&sound[..length]), StoredHome::Damaged, "{length} bytes");
    }
    assert_eq!(StoredHome::read(&[]), StoredHome::Nothing);
}

#[test]
fn a_sound_home_of_another_model_layout_or_bound_is_foreign() {
    let resealed = |place: usize, bits: u8| {
        let mut bytes = Home::new(OWN).unwrap().encode();
        bytes[place] ^= bits;
        let (body, sum) = bytes.split_last_chunk_mut::<4>().unwrap();
        *sum = link::frame::CRC.checksum(body).to_le_bytes();
        StoredHome::read(&bytes)
    };
    assert_eq!(resealed(0, 0), StoredHome::Kept(Home::new(OWN).unwrap()));
    // Magic, layout, model hash, and the sign of J4.
    for (place, bits) in [(0, 0x20), (4, 2), (5, 1), (8, 1), (11, 0x80), (27, 0x80)] {
        assert_eq!(resealed(place, bits), StoredHome::Foreign, "byte {place}");
    }
}
