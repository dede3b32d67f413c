//! Uploads: only what is whole, sound and fit replaces what is there; and the store itself.

use control::State;
use device::{PrimitiveDefect, RamStore, Store, StoreError};
use link::message::ChunkData;
use link::{EventKind, Listing, Name, Refusal, Reply, Request, RunOptions};

use crate::rig::{Rig, SLOT_BYTES, image, image_with};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn listing(rig: &mut Rig, index: u8) -> Option<Listing> {
    match rig.ask(Request::List { index }) {
        Some(Reply::Listing { listing, .. }) => listing,
        other => panic!("no listing but {other:?}"),
    }
}

fn read_back(rig: &mut Rig, text: &str) -> Vec<u8> {
    let mut image = Vec::new();
    loop {
        match rig.ask(Request::Read { name: name(text), offset: image.len() as u32 }) {
            Some(Reply::Chunk { data, .. }) if data.is_empty() => return image,
            Some(Reply::Chunk { data, .. }) => image.extend_from_slice(&data),
            other => panic!("no chunk but {other:?}"),
        }
    }
}

/// Refusal of the commit of an upload, after a check that the old image has survived.
fn refused(rig: &mut Rig, text: &str, image: &[u8]) -> (Refusal, [u32; 2]) {
    let before: Vec<_> = (0..3).map(|slot| rig.session.store().image(slot).map(<[u8]>::to_vec)).collect();
    let answer = rig.upload(text, image);
    let after: Vec<_> = (0..3).map(|slot| rig.session.store().image(slot).map(<[u8]>::to_vec)).collect();
    assert_eq!(before, after, "a refused upload changed the store");
    match answer {
        Some(Reply::Refused { reason, detail, .. }) => (reason, detail),
        other => panic!("not refused but {other:?}"),
    }
}

#[test]
fn an_upload_is_stored_listed_and_read_back_to_the_last_byte() {
    let mut rig = Rig::greeted();
    let image = image("reach", 3.0, 25);
    rig.store("reach", &image);
    let listed = listing(&mut rig, 0).unwrap();
    assert_eq!((listed.name.as_str(), listed.length as usize, listed.kernels), ("reach", image.len(), 25));
    assert_eq!((listed.crc, listed.duration), (link::image::stored_crc(&image), 3.0));
    assert!(listed.loaded && !listed.expectation, "what came last is ready to run");
    assert_eq!(read_back(&mut rig, "reach"), image);
    assert_eq!(listing(&mut rig, 1), None);
    assert_eq!(rig.refused(Request::List { index: 3 }), (Refusal::NoSuchPrimitive, [3, 0]));
}

#[test]
fn an_image_may_fill_its_place_to_the_last_byte_and_the_status_tells_how_much_has_come() {
    let mut rig = Rig::greeted();
    let received = |rig: &mut Rig| match rig.ask(Request::Status) {
        Some(Reply::Status { status, .. }) => status.upload_received,
        other => panic!("no status but {other:?}"),
    };
    let begin = |length: usize| Request::UploadBegin { name: name("reach"), length: length as u32, crc: 0 };
    assert_eq!(
        rig.refused(begin(SLOT_BYTES + 1)),
        (Refusal::ImageTooLarge, [SLOT_BYTES as u32 + 1, SLOT_BYTES as u32])
    );
    assert_eq!(received(&mut rig), None);
    rig.done(begin(SLOT_BYTES));
    assert_eq!(received(&mut rig), Some(0));
    rig.done(Request::UploadChunk { offset: 0, data: ChunkData::from_slice(&[0; 100]).unwrap() });
    assert_eq!(received(&mut rig), Some(100));
}

#[test]
fn an_upload_tells_that_the_store_changed() {
    let mut rig = Rig::greeted();
    rig.send_parts("reach", &image("reach", 3.0, 10));
    rig.sequence += 1;
    rig.put(rig.sequence, 0, &Request::UploadCommit);
    let told = rig.sent().into_iter().find_map(|frame| match frame.message {
        Reply::Event(event) => Some((event.kind, event.code)),
        _ => None,
    });
    assert_eq!(told, Some((EventKind::Store, 0)));
}

#[test]
fn an_image_replaces_the_one_of_its_name_and_no_other() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.store("grasp", &image("grasp", 3.0, 10));
    rig.store("reach", &image("reach", 5.0, 12));
    assert_eq!(rig.names(), ["reach", "grasp"]);
    assert_eq!(listing(&mut rig, 0).unwrap().duration, 5.0);
}

#[test]
fn c4_a_connection_cut_at_any_chunk_leaves_the_old_primitive() {
    let old = image("reach", 3.0, 20);
    let new = image("reach", 5.0, 20);
    let chunks = new.len().div_ceil(192);
    for cut in 0..=chunks {
        let mut rig = Rig::greeted();
        rig.store("reach", &old);
        let crc = link::image::stored_crc(&new);
        rig.done(Request::UploadBegin { name: name("reach"), length: new.len() as u32, crc });
        for (index, part) in new.chunks(192).enumerate().take(cut) {
            let data = ChunkData::from_slice(part).unwrap();
            rig.done(Request::UploadChunk { offset: 192 * index as u32, data });
        }
        // The host is gone; another one comes.
        rig.wait(600);
        (rig.number, rig.sequence) = (88, 0);
        rig.greet();
        assert_eq!(read_back(&mut rig, "reach"), old, "cut after {cut} chunks");
        assert_eq!(rig.refused(Request::UploadCommit).0, Refusal::NoUpload);
        assert_eq!(rig.session.store().staged(), None);
    }
}

#[test]
fn an_aborted_upload_leaves_the_old_primitive() {
    let mut rig = Rig::greeted();
    let old = image("reach", 3.0, 10);
    rig.store("reach", &old);
    rig.send_parts("reach", &image("reach", 5.0, 10));
    rig.done(Request::UploadAbort);
    assert_eq!(rig.refused(Request::UploadCommit).0, Refusal::NoUpload);
    assert_eq!(read_back(&mut rig, "reach"), old);
}

/// Seen: a part that ended one byte behind the announced 300 was refused as one that ended at 384. The change that
/// makes it fail: the refusal tells where the longest part would have ended.
#[test]
fn chunks_must_come_in_order_and_stay_within_the_length() {
    let mut rig = Rig::greeted();
    let chunk = |offset: u32, count: usize| Request::UploadChunk {
        offset,
        data: ChunkData::from_slice(&vec![7; count]).unwrap(),
    };
    assert_eq!(rig.refused(chunk(0, 10)).0, Refusal::NoUpload);
    rig.done(Request::UploadBegin { name: name("reach"), length: 300, crc: 0 });
    rig.done(chunk(0, 192));
    assert_eq!(rig.refused(chunk(191, 10)), (Refusal::UploadOrder, [192, 191]));
    assert_eq!(rig.refused(chunk(0, 192)), (Refusal::UploadOrder, [192, 0]));
    assert_eq!(rig.refused(chunk(192, 109)), (Refusal::ImageTooLarge, [301, 300]));
    assert_eq!(rig.refused(Request::UploadCommit), (Refusal::UploadIncomplete, [192, 300]));
    rig.done(chunk(192, 108));
    let Some(Reply::Status { status, .. }) = rig.ask(Request::Status) else { panic!() };
    assert_eq!(status.upload_received, Some(300));
}

#[test]
fn what_is_not_sound_or_not_fit_is_refused_with_its_reason() {
    let mut rig = Rig::greeted();
    let good = image("reach", 3.0, 10);
    rig.store("reach", &good);

    let mut flipped = good.clone();
    flipped[500] ^= 4;
    let announced = link::image::stored_crc(&flipped);
    let stored = link::image::stored_crc(&good);
    assert_eq!(refused(&mut rig, "reach", &flipped), (Refusal::UploadCrc, [announced, stored]), "wrong when it left");
    rig.send_parts_as("reach", stored ^ 1, &flipped);
    let on_the_way = rig.refused(Request::UploadCommit);
    assert_eq!(on_the_way, (Refusal::UploadCrc, [announced, stored ^ 1]), "not as announced");

    let mut schema = good.clone();
    schema[4] = 9;
    assert_eq!(refused(&mut rig, "reach", &schema), (Refusal::ImageInvalid, [3, 9]));

    assert_eq!(refused(&mut rig, "other", &good).0, Refusal::ImageName);

    let foreign = image_with("reach", 3.0, 10, |content| content.model_hash = 5);
    assert_eq!(refused(&mut rig, "reach", &foreign), (Refusal::ImageModel, [5, control::MODEL_HASH]));

    let mut crowded = good.clone();
    crowded[48..50].copy_from_slice(&142_u16.to_le_bytes());
    let end = crowded.len() - 4;
    let crc = link::image::stored_crc(&crowded).to_le_bytes();
    crowded[end..].copy_from_slice(&crc);
    assert_eq!(refused(&mut rig, "reach", &crowded), (Refusal::TooManyKernels, [142, 100]));

    assert_eq!(read_back(&mut rig, "reach"), good);
}

#[test]
fn a_primitive_outside_the_limits_of_the_arm_is_refused_in_words() {
    let mut rig = Rig::greeted();
    let mut words = |change: fn(&mut link::image::ImageContent<&[f32]>)| {
        let (reason, detail) = refused(&mut rig, "reach", &image_with("reach", 3.0, 10, change));
        assert_eq!(reason, Refusal::PrimitiveInvalid);
        PrimitiveDefect(detail).to_string()
    };
    assert!(words(|content| content.start.posture[3] = 9.0).contains("J4"));
    assert!(words(|content| content.goal.position = [3.0, 0.0, 0.0]).contains("out of reach"));
    assert!(words(|content| content.goal.position[0] += 0.2).contains("does not belong"));
    assert!(words(|content| content.duration = 0.1).contains("duration"));
    assert!(words(|content| content.stiffness[1] = -1.0).contains("orientation: stiffness"));
    assert!(words(|content| content.goal.orientation = [2.0, 0.0, 0.0, 0.0]).contains("unit quaternion"));
    assert!(words(|content| content.alpha = 1.0).contains("alpha"));
    static NEGATIVE: [f32; 10] = [-1.0; 10];
    static ONE: [f32; 9] = [1.0; 9];
    assert!(words(|content| (content.k1, content.k2) = (&NEGATIVE, &ONE)).contains("feedback"));
    let expectation = |content: &mut link::image::ImageContent<&[f32]>| {
        content.expected_mean = &ONE;
        content.marks.filter_cutoff = 15.0;
    };
    assert!(words(expectation).contains("expectation"), "recorded in no time");
    let statistics = |content: &mut link::image::ImageContent<&[f32]>| {
        (content.statistics_mean, content.statistics_spread, content.statistics_trials) = (&TWELVE, &TWELVE, 0);
        content.marks.filter_cutoff = 15.0;
    };
    assert!(words(statistics).contains("statistics"), "no run behind it");
}

/// Values that no robot needs, each told by its place.
#[test]
fn a_primitive_beyond_all_bounds_is_refused_with_the_value_that_is() {
    let mut rig = Rig::greeted();
    let mut words = |change: fn(&mut link::image::ImageContent<&[f32]>)| {
        let (reason, detail) = refused(&mut rig, "reach", &image_with("reach", 3.0, 10, change));
        assert_eq!(reason, Refusal::PrimitiveInvalid);
        PrimitiveDefect(detail).to_string()
    };
    static HUGE: [f32; 170] = [1e30; 170];
    static LARGE: [f32; 170] = [1e6; 170];
    let weights = "the weights of position row 0 at kernel 0 (both from 0) are larger than any movement needs";
    assert_eq!(words(|content| content.weights = &HUGE), weights);
    assert_eq!(words(|content| content.weights = &LARGE), weights);
    static ONE_OF_HAND: [f32; 170] = {
        let mut weights = [0.0; 170];
        weights[164] = -1e6;
        weights
    };
    assert!(words(|content| content.weights = &ONE_OF_HAND).starts_with("the weights of hand row 3 at kernel "));
    assert_eq!(
        words(|content| content.start_velocity.posture[6] = 1e30),
        "posture value 6 (from 0) of the start velocity is larger than any movement needs"
    );
    static ONE_PER_ROW: [f32; 10] = [1.0; 10];
    static ENDLESS: [f32; 10] = [1e30; 10];
    assert_eq!(
        words(|content| {
            (content.k1, content.k2) = (&ONE_PER_ROW, &NINE);
            content.clamps.position = 1e30;
        }),
        "the limit of the displacement is larger than anything real"
    );
    assert_eq!(
        words(|content| (content.k1, content.k2) = (&ENDLESS, &NINE)),
        "the sensitivity at point 0, column 0 (from 0) is larger than anything real"
    );
    static EXPECTED: [f32; 18] = {
        let mut statistics = [1.0; 18];
        statistics[16] = 1e30;
        statistics
    };
    assert_eq!(
        words(|content| {
            content.expected_mean = &EXPECTED;
            (content.marks.recorded_duration, content.marks.filter_cutoff) = (3.0, 15.0);
        }),
        "the expected value at point 1, column 7 (from 0) is larger than anything real"
    );
    static KNOWN: [f32; 12] = {
        let mut known = [1.0; 12];
        known[11] = 1e30;
        known
    };
    assert_eq!(
        words(|content| {
            (content.statistics_mean, content.statistics_spread, content.statistics_trials) = (&KNOWN, &TWELVE, 3);
            content.marks.filter_cutoff = 15.0;
        }),
        "the mean of the statistics at point 0, column 11 (from 0) is larger than anything real"
    );
}

#[test]
fn every_place_of_a_value_survives_its_two_numbers() {
    use control::plan::load::LoadError;
    use control::plan::primitive::RowGroup;
    use dmp::{Group, Part, PrimitiveError};
    for row in 0..17 {
        for kernel in [0, 1, 99] {
            let (group, index) = Group::of_weights(row, 1);
            let error = LoadError::Primitive(PrimitiveError::WeightTooLarge { group, index: index as u8, kernel });
            assert_eq!(PrimitiveDefect::from(error).to_string(), error.to_string());
        }
    }
    for part in [Part::Start, Part::Goal, Part::StartVelocity] {
        for (part_of_arm, last) in RowGroup::ALL.into_iter().zip([2, 2, 6, 3]) {
            let (group, index) = part_of_arm.row(last);
            let error = LoadError::Primitive(PrimitiveError::TooLarge { part, group, index });
            assert_eq!(PrimitiveDefect::from(error).to_string(), error.to_string());
        }
    }
}

static TWELVE: [f32; 12] = [1.0; 12];
static NINE: [f32; 9] = [1.0; 9];

#[test]
fn an_expectation_recorded_through_another_filter_is_refused_with_both() {
    let mut rig = Rig::greeted();
    let mut through = |filter_cutoff: f32| {
        let with_expectation = |content: &mut link::image::ImageContent<&[f32]>| {
            content.expected_mean = &NINE;
            content.marks.recorded_duration = 3.0;
            content.marks.filter_cutoff = filter_cutoff;
        };
        match rig.upload("reach", &image_with("reach", 3.0, 10, with_expectation)) {
            Some(Reply::Accepted { .. }) => Ok(()),
            Some(Reply::Refused { reason, detail, .. }) => Err((reason, detail)),
            other => panic!("{other:?}"),
        }
    };
    let device = control::sense::wrench::WRENCH_CUT_OFF as f32;
    assert_eq!(through(device), Ok(()));
    assert_eq!(through(0.5 * device), Err((Refusal::ImageFilter, [500 * device as u32, 1000 * device as u32])));
    assert_eq!(through(0.0), Err((Refusal::ImageFilter, [0, 1000 * device as u32])));
}

#[test]
fn expectation_and_statistics_reach_the_control_half() {
    let mut rig = Rig::greeted();
    let whole = |content: &mut link::image::ImageContent<&[f32]>| {
        content.expected_mean = &NINE;
        (content.statistics_mean, content.statistics_spread, content.statistics_trials) = (&TWELVE, &TWELVE, 5);
        content.marks.recorded_duration = 3.0;
        content.marks.filter_cutoff = control::sense::wrench::WRENCH_CUT_OFF as f32;
    };
    rig.store("sensing", &image_with("sensing", 3.0, 10, whole));
    rig.store("plain", &image("plain", 4.0, 10));
    for (text, expects) in [("sensing", true), ("plain", false), ("sensing", true)] {
        rig.commanded(Request::Run { name: name(text), options: link::RunOptions::default() });
        let loaded = rig.bench.primitive.as_ref().expect("a primitive");
        assert_eq!(loaded.expected().is_some(), expects, "{text}: nothing may be left of the one before");
        assert_eq!(loaded.statistics().map(|statistics| statistics.trials()), expects.then_some(5));
    }
}

#[test]
fn a_full_store_refuses_a_new_name_before_anything_is_sent() {
    let mut rig = Rig::greeted();
    for text in ["a", "b", "c"] {
        rig.store(text, &image(text, 3.0, 5));
    }
    let begin = |text| Request::UploadBegin { name: name(text), length: 1000, crc: 0 };
    assert_eq!(rig.refused(begin("d")), (Refusal::StoreFull, [3, 0]));
    rig.done(begin("b"));
    let large = Request::UploadBegin { name: name("b"), length: SLOT_BYTES as u32 + 1, crc: 0 };
    assert_eq!(rig.refused(large), (Refusal::ImageTooLarge, [SLOT_BYTES as u32 + 1, SLOT_BYTES as u32]));
    rig.done(Request::Delete { name: name("b") });
    rig.store("d", &image("d", 3.0, 5));
    assert_eq!(rig.names(), ["a", "d", "c"]);
}

#[test]
fn c8_an_upload_during_a_run_is_stored_and_the_running_primitive_stays() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.commanded(Request::Run { name: name("reach"), options: RunOptions::default() });
    rig.bench.state = State::Run;
    rig.store("reach", &image("reach", 5.0, 10));
    assert_eq!(rig.bench.loaded, [3.0], "not loaded");
    assert!(!listing(&mut rig, 0).unwrap().loaded, "what is stored is not what runs");
}

#[test]
fn a_primitive_in_use_is_not_deleted() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.commanded(Request::Run { name: name("reach"), options: RunOptions::default() });
    assert!(listing(&mut rig, 0).unwrap().loaded);
    rig.bench.state = State::Run;
    assert_eq!(rig.refused(Request::Delete { name: name("reach") }).0, Refusal::InUse);
    rig.bench.state = State::Hold;
    rig.done(Request::Delete { name: name("reach") });
    assert_eq!(rig.refused(Request::Delete { name: name("reach") }).0, Refusal::NoSuchPrimitive);
    assert_eq!(rig.names(), Vec::<String>::new());
}

#[test]
fn a_store_keeps_what_is_there_until_the_commit() {
    let mut store = RamStore::<2, 8>::new();
    assert_eq!(store.commit(0), Err(StoreError::NotOpen));
    assert_eq!(store.begin(9), Err(StoreError::TooLarge));
    assert_eq!(store.begin(0), Err(StoreError::TooLarge));
    store.begin(4).unwrap();
    store.write(0, &[1, 2, 3, 4]).unwrap();
    assert_eq!((store.image(0), store.staged()), (None, Some([1, 2, 3, 4].as_slice())));
    assert_eq!(store.write(3, &[9, 9]), Err(StoreError::NotOpen), "beyond the announced length");
    assert_eq!(store.write(usize::MAX, &[9]), Err(StoreError::NotOpen));
    assert_eq!(store.commit(2), Err(StoreError::NoPlace));
    store.commit(0).unwrap();
    assert_eq!((store.image(0), store.staged()), (Some([1, 2, 3, 4].as_slice()), None));

    store.begin(2).unwrap();
    store.write(0, &[7, 8]).unwrap();
    store.abort();
    assert_eq!(store.commit(0), Err(StoreError::NotOpen));
    assert_eq!(store.image(0), Some([1, 2, 3, 4].as_slice()));

    store.delete(0).unwrap();
    assert_eq!(store.image(0), None);
    assert_eq!(store.delete(0), Err(StoreError::NoPlace));
    assert_eq!(store.delete(5), Err(StoreError::NoPlace));
}
