//! Handshake, repetition, one host at a time, silence.

use control::State;
use device::{Command, EventKind};
use link::frame::FRAME_BYTES;
use link::message::HostHello;
use link::{Capabilities, EventKind as LinkKind, LINK_VERSION, Refusal, Reply, Request, SCHEMA_HASH};

use crate::rig::{Rig, hello};

#[test]
fn nothing_is_answered_or_done_before_a_hello() {
    let mut rig = Rig::new();
    let requests = [
        Request::Ping,
        Request::Status,
        Request::Gravity,
        Request::Calibrate { home: [0.0; 7] },
        Request::Zero { home: [0.0; 7] },
        Request::Telemetry { every: 1 },
        Request::List { index: 0 },
        Request::Goodbye,
    ];
    for request in requests {
        assert_eq!(rig.refused(request), (Refusal::NoSession, [0, 0]));
    }
    rig.cycle(300, control::Fault::None);
    rig.event(EventKind::Arrived);
    assert!(rig.sent().is_empty(), "telemetry and events have no listener yet");
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn a_matching_hello_is_answered_with_who_the_device_is() {
    let mut rig = Rig::new();
    let device = rig.greet();
    assert_eq!((device.link_version, device.schema_hash), (LINK_VERSION, SCHEMA_HASH));
    assert_eq!(device.model_hash, control::MODEL_HASH);
    assert_eq!(device.capabilities, Capabilities { arm: true, hand: true, wrench: true });
    assert_eq!((device.board.as_str(), device.serial.as_str(), device.simulated), ("bench", "B-1", true));
    assert_eq!((device.slots, device.slot_bytes, device.cycles_per_second), (3, 4096, control::RATE_HZ as u16));
    rig.done(Request::Ping);
}

#[test]
fn c7_another_version_is_refused_with_both_named_and_nothing_else_is_answered() {
    let others = [
        (
            HostHello { link_version: LINK_VERSION + 1, ..hello() },
            Refusal::LinkVersion,
            [u32::from(LINK_VERSION) + 1, u32::from(LINK_VERSION)],
        ),
        (HostHello { schema_hash: 5, ..hello() }, Refusal::Schema, [5, SCHEMA_HASH]),
        (HostHello { model_hash: 6, ..hello() }, Refusal::Model, [6, control::MODEL_HASH]),
    ];
    for (other, reason, detail) in others {
        let mut rig = Rig::new();
        assert_eq!(rig.refused(Request::Hello(other)), (reason, detail));
        assert_eq!(rig.refused(Request::Status).0, Refusal::NoSession);
    }
}

#[test]
fn a_repeated_request_is_answered_again_but_done_once() {
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Gravity), None);
    rig.put(rig.sequence, 0, &Request::Gravity);
    assert_eq!(rig.answer(), None, "still being worked on");
    rig.event(EventKind::Accepted);
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
    rig.put(rig.sequence, 0, &Request::Gravity);
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })), "the answer was lost: said again");
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Gravity)]);
}

#[test]
fn a_request_that_was_overtaken_is_ignored() {
    let mut rig = Rig::greeted();
    rig.sequence = 10;
    rig.done(Request::Ping);
    rig.put(9, 0, &Request::Gravity);
    assert!(rig.sent().is_empty() && rig.bench.commands.is_empty());
}

#[test]
fn request_numbers_may_wrap() {
    let mut rig = Rig::new();
    rig.sequence = u16::MAX - 1;
    rig.greet();
    rig.done(Request::Ping);
    rig.done(Request::Ping);
    assert_eq!(rig.sequence, 1);
}

#[test]
fn c9_a_second_host_is_refused_until_the_first_has_been_silent() {
    let mut rig = Rig::greeted();
    rig.wait(100);
    (rig.number, rig.sequence) = (88, 0);
    assert_eq!(rig.refused(Request::Hello(hello())), (Refusal::Busy, [0, 400]));
    assert_eq!(rig.refused(Request::Status).0, Refusal::NoSession);
    rig.wait(400);
    rig.greet();
    rig.number = 77;
    assert_eq!(rig.refused(Request::Status).0, Refusal::NoSession, "the first has lost the session");
}

/// C9: the time of the link is 32 bits of milliseconds, half of which are "before" the other half.
#[test]
fn c9_a_second_host_takes_over_from_a_silent_one_however_long_the_device_has_run() {
    for days in [0, 24, 25, 30, 49, 50, 75, 100] {
        let mut rig = Rig::new();
        rig.now_ms += days * 24 * 3_600_000;
        rig.greet();
        rig.wait(100);
        (rig.number, rig.sequence) = (88, 0);
        assert_eq!(rig.refused(Request::Hello(hello())), (Refusal::Busy, [0, 400]), "after {days} days");
        rig.wait(400);
        rig.greet();
    }
}

/// A host of another number sends a request; what the device says to it.
fn from_another(rig: &mut Rig, number: u16, request: Request) -> Vec<Reply> {
    let (own, sequence) = (std::mem::replace(&mut rig.number, number), rig.sequence);
    rig.put(9000, 60_000, &request);
    rig.event(EventKind::Accepted);
    (rig.number, rig.sequence) = (own, sequence);
    let said = rig.sent().into_iter().filter(|frame| frame.envelope.session == number);
    said.map(|frame| frame.message).collect()
}

#[test]
fn a_stop_is_honoured_from_anybody_and_the_session_stays_where_it_was() {
    for owned in [true, false] {
        for number in [0, 500] {
            let mut rig = Rig::new();
            if owned {
                rig.greet();
                rig.bench.state = State::Run;
            }
            let said = from_another(&mut rig, number, Request::Stop);
            assert_eq!(said, [Reply::Accepted { of: 9000 }], "session {number}, owned {owned}");
            assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
            if owned {
                // The owner goes on, and its silence is not forgiven by the stranger's word.
                rig.done(Request::Ping);
                rig.wait(490);
                from_another(&mut rig, number, Request::Stop);
                rig.wait(20);
                assert_eq!(rig.refused(Request::Ping).0, Refusal::NoSession);
            }
        }
    }
}

#[test]
fn a_host_without_a_session_can_do_nothing_but_stop() {
    let mut rig = Rig::greeted();
    let home = [0.0, -2.0, 0.0, 3.1, 0.0, 0.0, 0.0];
    let others =
        [Request::Gravity, Request::Release, Request::ClearFault, Request::Status, Request::Calibrate { home }];
    for request in others {
        let said = from_another(&mut rig, 500, request.clone());
        assert!(
            matches!(said[..], [Reply::Refused { reason: Refusal::NoSession, .. }]),
            "{request:?} was answered with {said:?}"
        );
    }
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn a_stop_that_is_repeated_by_a_stranger_stops_again_and_is_answered_each_time() {
    let mut rig = Rig::greeted();
    for count in 1..=5 {
        assert_eq!(from_another(&mut rig, 500, Request::Stop), [Reply::Accepted { of: 9000 }]);
        assert_eq!(rig.bench.commands.len(), count);
    }
}

#[test]
fn a_stop_of_a_stranger_that_the_control_half_never_answers_is_refused_to_the_stranger() {
    let mut rig = Rig::greeted();
    rig.number = 500;
    rig.put(9000, 0, &Request::Stop);
    rig.number = 77;
    rig.wait(250);
    let said: Vec<_> = rig.sent().into_iter().filter(|frame| frame.envelope.session == 500).collect();
    assert!(matches!(said[0].message, Reply::Refused { of: 9000, reason: Refusal::NoAnswer, .. }), "{said:?}");
}

#[test]
fn no_session_has_the_number_zero() {
    let mut rig = Rig::new();
    rig.number = 0;
    for hello in [Request::Hello(hello()), Request::Observe(hello())] {
        assert_eq!(rig.refused(hello), (Refusal::BadValue, [0, 0]));
    }
    assert_eq!(rig.refused(Request::Ping).0, Refusal::NoSession);
}

#[test]
fn a_stranger_is_not_answered_where_the_line_has_no_room_for_a_frame() {
    for (room, is_answered) in [(FRAME_BYTES, true), (FRAME_BYTES - 1, false)] {
        let mut rig = Rig::greeted();
        rig.number = 500;
        rig.put(9000, 0, &Request::Stop);
        rig.bench.room = room;
        rig.event(EventKind::Accepted);
        assert_eq!(rig.sent().len(), usize::from(is_answered), "{room} bytes");
    }
}

#[test]
fn an_event_that_finds_no_room_is_counted() {
    let mut rig = Rig::greeted();
    rig.bench.room = FRAME_BYTES - 1;
    rig.event(EventKind::Arrived);
    rig.bench.room = FRAME_BYTES;
    rig.event(EventKind::Arrived);
    assert_eq!(rig.sent().len(), 1);
    rig.bench.room = 4096;
    let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
    assert_eq!(statistics.events_dropped, 1);
}

#[test]
fn goodbye_frees_the_device_at_once() {
    let mut rig = Rig::greeted();
    rig.done(Request::Goodbye);
    assert_eq!(rig.refused(Request::Ping).0, Refusal::NoSession);
    rig.number = 88;
    rig.greet();
}

#[test]
fn c10_a_moving_arm_is_stopped_when_its_host_falls_silent_for_half_a_second() {
    for state in [State::Gravity, State::Approach, State::Run, State::Coast] {
        let mut rig = Rig::greeted();
        rig.bench.state = state;
        rig.wait(499);
        assert!(rig.bench.commands.is_empty(), "{state:?}");
        rig.wait(1);
        assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)], "{state:?}");
        let event = rig.sent().into_iter().find_map(|frame| match frame.message {
            Reply::Event(event) => Some(event),
            _ => None,
        });
        assert_eq!(event.map(|event| (event.kind, event.detail)), Some((LinkKind::LinkTimeout, 500)));
        assert_eq!(rig.refused(Request::Gravity).0, Refusal::NoSession, "the session is over");
    }
}

/// A1: an arm that holds does so without its host. A lost reply is bridged, and the host is no reason to stop then.
#[test]
fn a1_a_lost_reply_does_not_stop_an_arm_that_holds_without_its_host() {
    for leaves in [false, true] {
        let mut rig = Rig::greeted();
        if leaves {
            rig.done(Request::Goodbye);
        }
        rig.wait(600);
        (rig.bench.state, rig.bench.bridged) = (State::Coast, State::Hold);
        rig.wait(4);
        assert!(rig.bench.commands.is_empty(), "the host has left: {leaves}");
        rig.bench.bridged = State::Run;
        rig.wait(1);
        assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
    }
}

/// G2: zeroing first asks the safety module, three times if its answers are lost: 150 ms.
#[test]
fn g2_the_late_answer_to_zeroing_is_not_taken_for_that_to_the_next_command() {
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Zero { home: [0.0; 7] }), None);
    let of = rig.sequence;
    rig.wait(160);
    assert_eq!(rig.ask(Request::Hold), None);
    rig.event(EventKind::Accepted);
    let said: Vec<_> = rig.sent().into_iter().map(|frame| frame.message).collect();
    assert_eq!(said, [Reply::Accepted { of }]);
}

#[test]
fn g5_a_second_host_does_not_inherit_the_motion_of_a_silent_one() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Run;
    // The hello is on the line when the session looks for the first time after the half second.
    rig.now_ms += 500;
    (rig.number, rig.sequence) = (88, 0);
    rig.greet();
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn g5_no_host_is_admitted_while_the_stop_of_a_silent_one_finds_no_room() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Run;
    rig.bench.stuck = true;
    rig.now_ms += 500;
    (rig.number, rig.sequence) = (88, 0);
    assert_eq!(rig.ask(Request::Hello(hello())), None, "it waits");
    rig.bench.stuck = false;
    rig.poll();
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
    assert!(matches!(rig.answer(), Some(Reply::Hello { .. })));
}

#[test]
fn g5_a_host_that_follows_a_goodbye_at_once_does_not_inherit_the_motion() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Run;
    rig.bench.room = 0;
    rig.ask(Request::Goodbye);
    (rig.number, rig.sequence) = (88, 0);
    rig.ask(Request::Hello(hello()));
    rig.bench.room = 4096;
    rig.poll();
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn g11_a_hand_that_moves_is_stopped_when_its_host_falls_silent_for_half_a_second() {
    let mut rig = Rig::greeted();
    rig.bench.hand_moves = true;
    rig.wait(499);
    assert!(rig.bench.commands.is_empty());
    rig.wait(1);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn a_stop_after_silence_is_sent_once_and_tried_again_while_the_queue_is_full() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Run;
    rig.bench.stuck = true;
    rig.wait(600);
    rig.bench.stuck = false;
    rig.wait(50);
    assert_eq!(rig.bench.commands.len(), 1, "the arm needs a cycle to leave the run");
}

#[test]
fn an_arm_at_rest_is_left_alone_however_long_the_host_is_silent() {
    for state in [State::Idle, State::Hold, State::SoftStop, State::Fault] {
        let mut rig = Rig::greeted();
        rig.bench.state = state;
        rig.wait(5000);
        assert!(rig.bench.commands.is_empty(), "{state:?}");
        rig.done(Request::Ping);
    }
}

#[test]
fn pings_keep_a_motion_alive() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Run;
    for _ in 0..50 {
        rig.wait(100);
        rig.done(Request::Ping);
    }
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn a_motion_whose_host_said_goodbye_is_stopped() {
    let mut rig = Rig::greeted();
    rig.bench.state = State::Gravity;
    rig.done(Request::Goodbye);
    rig.wait(3);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn c10_an_old_request_does_not_move_the_arm_but_an_old_stop_stops_it() {
    let mut rig = Rig::greeted();
    rig.sequence += 1;
    rig.put(rig.sequence, 500, &Request::Hold);
    assert_eq!(rig.bench.commands.pop(), Some(Command::Control(control::Command::Hold)), "just in time");
    rig.event(EventKind::Accepted);
    rig.sequence += 1;
    rig.put(rig.sequence, 501, &Request::Gravity);
    let answer = rig.answer();
    assert!(matches!(answer, Some(Reply::Refused { reason: Refusal::Stale, detail: [501, 500], .. })), "{answer:?}");
    rig.sequence += 1;
    rig.put(rig.sequence, 60_000, &Request::Stop);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn answers_wait_for_room_on_the_line() {
    let mut rig = Rig::greeted();
    // An answer and an event may come of a request.
    rig.bench.room = 2 * FRAME_BYTES - 1;
    assert_eq!(rig.ask(Request::Ping), None);
    rig.bench.room = 2 * FRAME_BYTES;
    rig.poll();
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
}

#[test]
fn a_stop_is_heard_even_behind_a_flood() {
    let mut rig = Rig::greeted();
    rig.bench.room = 0;
    for _ in 0..20 {
        rig.ask(Request::Status);
    }
    rig.ask(Request::Stop);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
    rig.bench.room = 4096;
    rig.event(EventKind::Accepted);
    rig.sent();
    let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
    assert_eq!(statistics.link.overrun, 17, "20 requests and a stop into 4 places");
}

#[test]
fn replies_are_numbered_without_gaps_and_carry_the_time() {
    let mut rig = Rig::greeted();
    rig.sequence += 1;
    rig.put(rig.sequence, 0, &Request::Ping);
    rig.sequence += 1;
    rig.put(rig.sequence, 0, &Request::Status);
    let frames = rig.sent();
    assert_eq!(frames.len(), 2);
    assert_eq!(frames[1].envelope.sequence, frames[0].envelope.sequence + 1);
    assert_eq!((frames[1].envelope.session, frames[1].envelope.time_ms), (77, 10_000));
}

#[test]
fn noise_on_the_line_is_counted_and_changes_nothing() {
    let mut rig = Rig::greeted();
    let noise: Vec<u8> = (0..20_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    rig.session.receive(&noise);
    rig.session.receive(&[0]);
    rig.poll();
    assert!(rig.sent().is_empty() && rig.bench.commands.is_empty());
    let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
    let link = statistics.link;
    assert!(link.bad_cobs + link.bad_crc + link.too_long > 10);
    assert_eq!((link.accepted, link.undecodable), (2, 0));
}

/// C9: a host that died and is started anew under the number that it had says hello with a number of a request that is
/// behind.
#[test]
fn c9_a_host_that_is_started_anew_under_its_old_number_gets_its_session_after_half_a_second() {
    let mut rig = Rig::greeted();
    for _ in 0..300 {
        rig.done(Request::Ping);
    }
    rig.wait(100);
    rig.sequence = 0;
    assert_eq!(rig.ask(Request::Hello(hello())), None, "it may be a replay");
    rig.wait(400);
    rig.sequence = 0;
    rig.greet();
    rig.done(Request::Ping);
}
