//! Hosts that have no session: floods of them, a stop in any disguise, replays of what was said before.

use control::State;
use device::{Command, EventKind};
use link::frame::{self, Envelope, FRAME_BYTES};
use link::{Refusal, Reply, Request};

use crate::rig::{Rig, hello};

#[test]
fn h7_a_stop_is_obeyed_whatever_its_number_and_whoever_sends_it() {
    for behind in [0, 1, 5, 300, 0x7FFF, 0x8000, 0xFFFF] {
        let mut rig = Rig::greeted();
        rig.sequence = 500;
        rig.done(Request::Ping);
        let number = 501_u16.wrapping_sub(behind);
        rig.put(number, 60_000, &Request::Stop);
        assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)], "{behind} behind");
        rig.event(EventKind::Accepted);
        let said: Vec<_> = rig.sent().into_iter().map(|frame| frame.message).collect();
        assert_eq!(said, [Reply::Accepted { of: number }], "{behind} behind");
        // Its owner goes on as if nothing had been.
        rig.sequence = 501;
        rig.done(Request::Ping);
    }
}

/// A host that writes and does not read: its line is full, and so is the device's end of it.
#[test]
fn h6_a_stop_needs_no_room_on_the_line() {
    for number in [77, 88, 500] {
        let mut rig = Rig::greeted();
        rig.number = 88;
        assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
        rig.bench.state = State::Run;
        rig.bench.room = 0;
        (rig.number, rig.sequence) = (number, 40);
        for _ in 0..3 {
            assert_eq!(rig.ask(Request::Status), None);
        }
        assert_eq!(rig.ask(Request::Stop), None);
        assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)], "session {number}");
        let stop = rig.sequence;
        rig.event(EventKind::Accepted);
        assert!(rig.sent().is_empty(), "session {number}: there is no room");
        // The answer is told to whoever asks again.
        rig.bench.room = 4096;
        rig.put(stop, 0, &Request::Stop);
        rig.event(EventKind::Accepted);
        let told = rig.sent().into_iter().any(|frame| frame.message == Reply::Accepted { of: stop });
        assert!(told, "session {number}");
    }
}

#[test]
fn h7_a_stop_that_is_repeated_by_its_owner_stops_again() {
    let mut rig = Rig::greeted();
    for count in 1..=3 {
        rig.put(9, 0, &Request::Stop);
        rig.event(EventKind::Accepted);
        assert_eq!(rig.bench.commands.len(), count);
        assert_eq!(rig.sent().last().map(|frame| frame.message.clone()), Some(Reply::Accepted { of: 9 }));
    }
}

#[test]
fn a_stop_of_the_owner_is_a_sign_of_life_and_one_of_a_stranger_is_none() {
    for (number, is_stopped_again) in [(77, false), (500, true)] {
        let mut rig = Rig::greeted();
        rig.bench.state = State::Run;
        rig.wait(400);
        let owner = std::mem::replace(&mut rig.number, number);
        rig.commanded(Request::Stop);
        rig.number = owner;
        rig.wait(400);
        assert_eq!(rig.bench.commands.len() > 1, is_stopped_again, "session {number}: its host has fallen silent");
    }
}

#[test]
fn h9_no_replay_keeps_the_run_of_a_dead_host_alive() {
    // The newest request again, an older one, and one that belongs to no session.
    for (session, behind) in [(77, 0), (77, 1), (77, 4), (0, 0), (500, 0)] {
        let mut rig = Rig::greeted();
        (0..4).for_each(|_| rig.done(Request::Ping));
        rig.bench.state = State::Run;
        let (number, newest) = (rig.number, rig.sequence);
        for _ in 0..6 {
            rig.wait(90);
            rig.number = session;
            rig.put(newest - behind, 0, &Request::Ping);
            rig.number = number;
        }
        let stopped = rig.bench.commands == [Command::Control(control::Command::Stop)];
        assert!(stopped, "session {session}, {behind} behind");
    }
}

#[test]
fn h9_a_refused_host_does_not_learn_the_number_of_the_session() {
    let mut rig = Rig::greeted();
    rig.wait(100);
    (rig.number, rig.sequence) = (88, 0);
    assert_eq!(rig.refused(Request::Hello(hello())), (Refusal::Busy, [0, 400]));
}

/// Bytes that other hosts send in each millisecond, by number.
fn flood(kind: usize, stranger: u16) -> Vec<u8> {
    let request = match kind {
        0 => Request::Stop,
        1 => Request::Hello(hello()),
        2 => Request::Ping,
        _ => return (0..40).map(|byte: u16| (byte.wrapping_mul(stranger) % 255) as u8 + 1).chain([0]).collect(),
    };
    let mut buffer = [0; FRAME_BYTES];
    let envelope = Envelope { session: 1000 + stranger, sequence: 7, time_ms: 0 };
    let length = frame::encode(envelope, &request, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

#[test]
fn g13_ten_strangers_who_flood_the_line_delay_their_owners_commands_by_five_milliseconds_at_most() {
    const LINE_PER_MS: usize = 92;
    const LINE_BUFFER: usize = 1024;
    for kinds in [&[0][..], &[1], &[2], &[3], &[0, 1, 2, 3]] {
        let mut rig = Rig::greeted();
        rig.bench.room = LINE_BUFFER;
        let (mut answered, mut to_others, mut worst, mut asked) = (0, 0, 0, None);
        let mut on_the_way = std::collections::VecDeque::new();
        for ms in 0..2000_u64 {
            // The control half answers a command 3 ms after it has come.
            while on_the_way.front().is_some_and(|due| *due <= ms) {
                on_the_way.pop_front();
                rig.bench.events.push_back(device::Event { cycle: 1, kind: EventKind::Accepted });
            }
            for n in 0..3 {
                let stranger = (3 * ms + n) % 10;
                let bytes = flood(kinds[(ms + n) as usize % kinds.len()], stranger as u16);
                rig.session.receive(&bytes);
            }
            let before = rig.bench.commands.len();
            if ms % 10 == 0 && asked.is_none() {
                rig.sequence = rig.sequence.wrapping_add(1);
                asked = Some(ms);
                rig.put(rig.sequence, 0, &Request::Hold);
            }
            rig.wait(1);
            on_the_way.extend((before..rig.bench.commands.len()).map(|_| ms + 3));
            let sent = rig.bench.line.len();
            for frame in rig.sent() {
                let is_ours = frame.envelope.session == rig.number;
                to_others += usize::from(!is_ours);
                if is_ours && frame.message == (Reply::Accepted { of: rig.sequence }) {
                    worst = worst.max(ms - asked.take().unwrap());
                    answered += 1;
                }
            }
            rig.bench.room = (rig.bench.room + LINE_PER_MS).saturating_sub(sent).min(LINE_BUFFER);
        }
        assert_eq!(answered, 200, "{kinds:?}");
        assert!(worst <= 3 + 5, "{kinds:?}: {worst} ms");
        // Others cost the line one answer in 2 ms beside those to stops, and the control half one stop at a time.
        let stops = rig.bench.commands.iter().filter(|c| **c == Command::Control(control::Command::Stop)).count();
        assert!(to_others <= 1000 + 9 + stops, "{kinds:?}: {to_others} answers, {stops} stops");
        assert!(stops <= 2000 / 3 + 1, "{kinds:?}: {stops} stops");
        assert_eq!(stops > 100, kinds.contains(&0), "{kinds:?}: {stops} stops");
    }
}
