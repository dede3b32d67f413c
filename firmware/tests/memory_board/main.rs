//! The application of the arm image on a third board, which is made of memory: the same code as in the images, on the
//! host.

mod board;
mod host;
mod names;

use control::{Fault, State};
use device::Stage;
use flash::{Flash, FlashChip, FlashTimes};
use host::Host;
use link::message::RunOptions;
use link::{EventKind, HandStage, Name, Reply, Request};

/// Starts the arm up, from the released E-stop to the initialised hand.
fn start_up(host: &mut Host) {
    let mut zeroed = false;
    for _ in 0..400 {
        host.wait(0.02);
        let status = host.status();
        match Stage::from_code(status.startup_stage) {
            Some(Stage::WaitingForZero) if !zeroed => {
                host.accepted(Request::Zero { home: control::model::HOME.map(|angle| angle as f32) });
                zeroed = true;
            }
            Some(Stage::Ready) if status.hand_stage == HandStage::NotInitialised => {
                host.accepted(Request::InitialiseHand);
            }
            Some(Stage::Ready) if status.hand_stage == HandStage::Ready && status.safety_mode == Some(2) => return,
            _ => {}
        }
    }
    panic!("the start-up did not end: {:?}", host.status());
}

#[test]
fn the_application_starts_up_takes_an_upload_runs_it_and_stops() {
    let chip = FlashChip::new(Flash::blank(FlashTimes::TYPICAL));
    let mut host = Host::new(chip.clone());
    host.greet();
    start_up(&mut host);
    // The operator has let go of the arm, whose wrist sinks onto its stop.
    host.wait(5.0);
    host.greet();
    host.accepted(Request::Hold);
    let image = host::image("reach");
    host.upload("reach", &image);
    assert!(chip.lock().operations() > 50, "the upload was accepted before it was on the flash");
    host.accepted(Request::Approach { q: host::start_posture(), duration: 0.0 });
    host.wait_for("the approach", |event| event.kind == EventKind::Arrived);
    host.accepted(Request::Run {
        name: Name::new("reach").expect("a name"),
        options: RunOptions {
            goal: Default::default(),
            speed: 1.0,
            feedback: false,
            force_control: false,
            acceleration: Default::default(),
            finger_feedback: false,
            compliant: false,
        },
    });
    host.stay(0.8);
    let running = host.status();
    assert_eq!(running.state, State::Run.code());
    assert!(running.phase > 0.1, "{running:?}");
    host.accepted(Request::Stop);
    host.stay(1.0);
    let stopped = host.status();
    assert_ne!(stopped.state, State::Run.code());
    assert_eq!(stopped.fault, 0);
    let Some(Reply::Statistics { statistics, .. }) = host.ask(Request::Statistics) else { panic!("no statistics") };
    assert_eq!(statistics.missed_deadlines, 0);
    assert_eq!(statistics.lost_replies, 0);
    assert!(host.log().events > 5, "the log heard nothing");
}

/// Nobody but the session hears a stop, or a host that falls silent, and the watchdog is fed by the slots alone. The
/// change that makes it fail: records that nobody takes are counted by nobody.
#[test]
fn d2_a_session_that_hangs_stops_an_arm_that_moves_and_lets_one_that_holds_be() {
    let mut host = Host::new(FlashChip::new(Flash::blank(FlashTimes::TYPICAL)));
    host.greet();
    start_up(&mut host);
    host.wait(5.0);
    host.greet();
    host.accepted(Request::Hold);
    host.stay(1.0);
    host.hang(true);
    host.wait(2.0);
    assert_eq!(host.core(), (State::Hold, Fault::None));
    host.hang(false);
    host.greet();
    host.accepted(Request::Approach { q: host::start_posture(), duration: 20.0 });
    host.stay(1.0);
    assert_eq!(host.core(), (State::Approach, Fault::None));
    host.hang(true);
    // A session that works for long in one go is none that hangs.
    host.wait(0.4);
    assert_eq!(host.core(), (State::Approach, Fault::None));
    host.wait(0.3);
    assert_eq!(host.core(), (State::SoftStop, Fault::Overrun));
    // It comes back: cleared, the arm holds and moves again.
    host.hang(false);
    host.stay(1.0);
    host.greet();
    host.accepted(Request::ClearFault);
    host.accepted(Request::Hold);
    host.accepted(Request::Approach { q: host::start_posture(), duration: 0.0 });
    host.wait_for("the approach", |event| event.kind == EventKind::Arrived);
    assert_eq!(host.core(), (State::Hold, Fault::None));
}

#[test]
fn the_library_is_there_again_after_a_restart_and_a_deleted_primitive_is_not() {
    let chip = FlashChip::new(Flash::blank(FlashTimes::TYPICAL));
    let mut host = Host::new(chip.clone());
    host.greet();
    host.upload("one", &host::image("one"));
    host.upload("two", &host::image("two"));
    host.accepted(Request::Delete { name: Name::new("one").expect("a name") });
    drop(host);
    let mut host = Host::new(chip);
    host.greet();
    assert_eq!(host.names(), ["two"]);
    assert_eq!(host.log().opening.map(|opening| opening.found), Some(1));
}

#[test]
fn the_session_answers_while_a_sector_is_erased() {
    // Every erase takes 4 s here, and a foreign flash needs eight of them before the first word can be written.
    let chip = FlashChip::new(Flash::with_content(vec![0; flash::FLASH_BYTES], FlashTimes::SLOW));
    let mut host = Host::new(chip.clone());
    host.wait(1.1);
    host.greet();
    let name = Name::new("early").expect("a name");
    let refused = host.ask(Request::UploadBegin { name, length: 100, crc: 0 });
    assert!(matches!(refused, Some(Reply::Refused { reason: link::Refusal::StoreFailed, .. })), "{refused:?}");
    for _ in 0..100 {
        host.accepted(Request::Ping);
        host.wait(0.05);
    }
    assert!(!host.is_library_open());
    host.wait(40.0);
    assert!(host.is_library_open());
    host.greet();
    host.upload("late", &host::image("late"));
    assert_eq!(host.names(), ["late"]);
}
