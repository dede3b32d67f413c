//! Classes of requests and replies, and numbers that never change their meaning: pinned one by one.

use crate::samples::{replies, request_index, requests};
use link::{HandStage, HomeSource, ImageError, Refusal, Request, SecretState};

/// True if a request can move the arm. One that does, and is old, is refused: forget one here and a host that was
/// suspended moves an arm that somebody stands beside by now.
fn can_move(request: &Request) -> bool {
    match request {
        Request::Zero { .. }
        | Request::Gravity
        | Request::Hold
        | Request::Approach { .. }
        | Request::Run { .. }
        | Request::ClearFault
        | Request::SetGoal(_)
        | Request::SetSpeed { .. }
        | Request::Release
        | Request::Tare
        | Request::InitialiseHand
        | Request::MoveHand { .. } => true,
        // Stopping must not depend on age; the others only talk, or change what a later request uses.
        Request::Hello(_)
        | Request::Goodbye
        | Request::Ping
        | Request::Status
        | Request::Statistics
        | Request::List { .. }
        | Request::Stop
        | Request::Telemetry { .. }
        | Request::UploadBegin { .. }
        | Request::UploadChunk { .. }
        | Request::UploadCommit
        | Request::UploadAbort
        | Request::Delete { .. }
        | Request::Read { .. }
        | Request::Calibration
        | Request::Calibrate { .. }
        | Request::ForgetCalibration
        | Request::Observe(_)
        | Request::Rename { .. }
        | Request::FaultRecord
        | Request::FaultCycle { .. }
        | Request::Weight
        | Request::KeepWeight { .. }
        | Request::ForgetWeight
        | Request::Owner
        | Request::Secret
        | Request::Challenge
        | Request::Prove { .. }
        | Request::KeepSecret { .. }
        | Request::ForgetSecret
        | Request::Storage { .. } => false,
    }
}

#[test]
fn every_request_that_can_move_the_arm_is_known_as_such() {
    let moving: Vec<usize> = requests().iter().filter(|request| request.moves()).map(request_index).collect();
    assert_eq!(moving, [6, 7, 8, 9, 10, 12, 13, 14, 22, 23, 24, 25]);
    for request in requests() {
        assert_eq!(request.moves(), can_move(&request), "{request:?}");
    }
}

#[test]
fn a_device_that_keeps_a_secret_asks_for_its_proof_before_all_that_moves_or_changes_and_never_before_a_stop() {
    let guarded: Vec<usize> = requests().iter().filter(|request| request.is_guarded()).map(request_index).collect();
    let changing = [16, 17, 18, 19, 20, 27, 28, 30, 34, 35, 40, 41];
    let mut expected: Vec<usize> = [6, 7, 8, 9, 10, 12, 13, 14, 22, 23, 24, 25].into_iter().chain(changing).collect();
    expected.sort_unstable();
    assert_eq!(guarded, expected);
    assert!(!Request::Stop.is_guarded());
    // Exhaustive by number: whoever adds a request decides here whether it is guarded.
    assert_eq!(requests().len(), 43);
}

#[test]
fn every_request_has_a_word_of_its_own() {
    let words: std::collections::BTreeSet<&str> = requests().iter().map(Request::name).collect();
    assert_eq!(words.len(), requests().len());
    assert_eq!(Request::Stop.name(), "stop");
    assert_eq!(Request::SetSpeed { factor: 1.0 }.name(), "set speed");
}

#[test]
fn every_reply_names_the_request_it_answers_and_the_unasked_ones_name_none() {
    let answers: Vec<Option<u16>> = replies().iter().map(|reply| reply.answers()).collect();
    let numbers = [1, 300, 3, 4, 5, 6, 7, 0, 0, 9, 10, 11, 12, 13, 14, 15, 16];
    assert_eq!(answers, numbers.map(|number| (number != 0).then_some(number)));
}

#[test]
fn the_code_of_an_image_error_is_never_given_to_another() {
    let errors = [
        (ImageError::TooShort { length: 101 }, 101),
        (ImageError::Magic, 0),
        (ImageError::Schema { found: 103 }, 103),
        (ImageError::Length { expected: 1, found: 104 }, 104),
        (ImageError::Crc { computed: 105, stored: 2 }, 105),
        (ImageError::Name, 0),
        (ImageError::Flags { found: 107 }, 107),
        (ImageError::Kernels { found: 108 }, 108),
        (ImageError::GainPoints { found: 109 }, 109),
        (ImageError::ExpectationPoints { found: 110 }, 110),
        (ImageError::NotFinite { real: 111 }, 111),
        (ImageError::Shape, 0),
        (ImageError::StatisticsPoints { found: 113 }, 113),
    ];
    for (code, (error, number)) in (1..).zip(errors) {
        assert_eq!((error.code(), error.number()), (code, number), "{error:?}");
        // Exhaustive: a new error does not compile here, and so is not forgotten above.
        let at = match error {
            ImageError::TooShort { .. } => 0,
            ImageError::Magic => 1,
            ImageError::Schema { .. } => 2,
            ImageError::Length { .. } => 3,
            ImageError::Crc { .. } => 4,
            ImageError::Name => 5,
            ImageError::Flags { .. } => 6,
            ImageError::Kernels { .. } => 7,
            ImageError::GainPoints { .. } => 8,
            ImageError::ExpectationPoints { .. } => 9,
            ImageError::NotFinite { .. } => 10,
            ImageError::Shape => 11,
            ImageError::StatisticsPoints { .. } => 12,
        };
        assert_eq!(errors[at].0, error);
    }
}

#[test]
fn the_code_of_a_refusal_is_its_place_on_the_wire() {
    for refusal in Refusal::ALL {
        let mut buffer = [0; 4];
        let bytes = postcard::to_slice(&refusal, &mut buffer).unwrap();
        assert_eq!(bytes, [refusal.code()], "{refusal:?}");
    }
    // The frozen ones, by which two versions find out that they do not fit.
    let frozen = [Refusal::LinkVersion, Refusal::Schema, Refusal::Model, Refusal::NoSession, Refusal::Busy];
    assert_eq!(frozen.map(|refusal| refusal.code() as u32), [0, 1, 2, 3, 4]);
}

#[test]
fn every_refusal_has_a_reason_of_its_own_and_a_remedy() {
    let reasons: std::collections::BTreeSet<&str> = Refusal::ALL.iter().map(|refusal| refusal.explanation()).collect();
    assert_eq!(reasons.len(), Refusal::ALL.len());
    for refusal in Refusal::ALL {
        let (reason, remedy) = (refusal.explanation(), refusal.remedy());
        // Half a sentence goes on behind others: neither a full stop nor a single word.
        for words in [reason, remedy] {
            assert!(words.contains(' ') && !words.ends_with('.'), "{refusal:?}: {words}");
        }
        assert_eq!(refusal.to_string(), reason);
    }
    assert_eq!(Refusal::Faulted.explanation(), "a fault is latched");
    assert_eq!(Refusal::Faulted.remedy(), "remove the cause, then `tactus stop --clear-fault`");
}

#[test]
fn the_stage_of_a_hand_is_found_by_its_number_and_has_words() {
    use HandStage::{Absent, Failed, Initialising, NotInitialised, Ready};
    let stages = [Absent, NotInitialised, Initialising, Ready, Failed];
    for (code, stage) in (0..).zip(stages) {
        assert_eq!((stage.code(), HandStage::from_code(code)), (code, Some(stage)));
    }
    assert_eq!(HandStage::from_code(5), None);
    let words = ["absent", "not initialised", "initialising", "ready", "failed"];
    assert_eq!(stages.map(HandStage::name), words);
}

#[test]
fn whose_home_counts_and_what_is_known_of_a_secret_is_told_in_words() {
    use HomeSource::{Damaged, Foreign, Model, Stored};
    use SecretState::{Kept, NotOffered, Nothing, Unreadable};
    let sources = [
        "the model's",
        "stored in the device",
        "the model's, because the stored one is damaged",
        "the model's, because the stored one is for another robot model or layout",
    ];
    assert_eq!([Model, Stored, Damaged, Foreign].map(HomeSource::name), sources);
    let secrets = ["none", "kept", "unreadable", "not offered"];
    assert_eq!([Nothing, Kept, Unreadable, NotOffered].map(SecretState::name), secrets);
}
