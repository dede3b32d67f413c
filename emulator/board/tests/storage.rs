//! A flash whose operation does not end: the host is told, and the arm holds as if nothing were.

mod common;

use common::{is_torque, tell_keeping};
use emulated_board::host::HOLD;
use link::Refusal;

/// The arm holds, and a weight has been kept.
const HANGS_US: u64 = 1_500_000;

/// The first sector takes nothing any more, as against a change that is still under way.
const FAILED: Option<(Refusal, u32)> = Some((Refusal::StoreWorn, 0));

#[test]
fn c5_a_flash_operation_that_never_ends_is_told_and_the_arm_holds_on() {
    // The first word of a change, and one in its middle.
    for operation in [0, 3] {
        let story = tell_keeping(2.5, &[format!("flash-hangs@{HANGS_US}:{operation}")]);
        assert!(story.resets().is_empty(), "{operation}: {:?}", story.resets());
        let findings = story.outcome.measured.findings.all();
        assert!(!findings.iter().any(|finding| finding.register == "bank 2"), "{operation}: {findings:#?}");
        let learned = story.learned.lock();
        assert_eq!(learned.kept.first(), Some(&None), "{operation}: it is kept before");
        assert_eq!(learned.kept.last(), Some(&FAILED), "{operation}: {:?}", learned.kept);
        assert_eq!(
            learned.storage.as_ref().and_then(|storage| storage.bad_sector),
            Some(0),
            "{operation}: {:?}",
            learned.storage
        );
        let status = learned.status.as_ref().expect("a status");
        assert_eq!((status.state, status.fault), (HOLD, 0), "{operation}: {status:?}");
        let statistics = learned.statistics.expect("statistics");
        assert_eq!((statistics.missed_deadlines, statistics.lost_replies), (0, 0), "{operation}");
        drop(learned);
        assert!(story.sent_since(2_490_000).iter().any(|(_, frame)| is_torque(frame)), "{operation}: no torque");
    }
}

#[test]
fn c5_a_restart_trusts_a_flash_again_that_hung() {
    let story = tell_keeping(4.0, &[format!("flash-hangs@{HANGS_US}:0"), "reset@2000000:pin".into()]);
    assert_eq!(story.resets().len(), 1, "{:?}", story.resets());
    let learned = story.learned.lock();
    let kept = |answer: &&Option<(Refusal, u32)>| answer.is_none();
    let failed = learned.kept.iter().position(|answer| *answer == FAILED).expect("a refusal");
    let [before, after] =
        [&learned.kept[..failed], &learned.kept[failed..]].map(|part| part.iter().filter(kept).count());
    assert!(before > 0 && after > 0, "{:?}", learned.kept);
    assert!(learned.storage.as_ref().is_some_and(|storage| storage.bad_sector.is_none()), "{:?}", learned.storage);
}

#[test]
fn a_bank_that_does_not_do_what_it_is_told_is_told_of_and_the_arm_holds_on() {
    for fault in ["flash-locked", "flash-deaf"] {
        let story = tell_keeping(2.5, &[format!("{fault}@{HANGS_US}")]);
        assert!(story.resets().is_empty(), "{fault}: {:?}", story.resets());
        let learned = story.learned.lock();
        assert_eq!(learned.kept.first(), Some(&None), "{fault}: it is kept before");
        let last = learned.kept.last().expect("an answer");
        assert!(last.is_some(), "{fault}: {:?}", learned.kept);
        let status = learned.status.as_ref().expect("a status");
        assert_eq!((status.state, status.fault), (HOLD, 0), "{fault}: {status:?}");
        assert_eq!(learned.statistics.expect("statistics").missed_deadlines, 0, "{fault}");
    }
}
