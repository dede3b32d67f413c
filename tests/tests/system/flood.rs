//! A line that somebody floods while the image under QEMU runs a movement.

use std::time::Duration;

use control::State;
use lab::transport::Transport;
use link::frame::{self, Envelope, FRAME_BYTES};
use link::message::RunOptions;
use link::{LinkCounters, Name, Request};
use system_tests::bus::{arm_torques, torque_jitter};
use system_tests::execution::prepare;
use system_tests::{Arm, expect, raw, ready, simulation, taught};

/// Bytes that the line carries in the time of [`TURN`] at 921 600 baud.
const FULL: usize = 460;

/// Time between two portions of the flood.
const TURN: Duration = Duration::from_millis(5);

/// Ticks of the virtual clock in a microsecond.
const MICROSECOND: u64 = 25;

/// One portion: what is no frame, and sound requests of a host that has no session.
fn portion(turn: u64) -> Vec<u8> {
    let mut bytes = raw::noise(turn + 1, FULL / 2);
    let mut buffer = [0; FRAME_BYTES];
    for sequence in 0.. {
        let envelope = Envelope { session: 99, sequence, time_ms: 0 };
        let length = expect(frame::encode(envelope, &Request::Status, &mut buffer).map_err(|error| error.to_string()));
        if bytes.len() + 1 + length > FULL {
            break;
        }
        // Ends the noise before it.
        bytes.push(0);
        bytes.extend_from_slice(&buffer[..length]);
    }
    bytes
}

/// Lets time pass until `end`, every turn with a portion of the flood if there is one.
fn pass(arm: &mut Arm, end: Duration, floods: bool) {
    let mut turn = 0;
    while arm.now() < end {
        if floods {
            expect(arm.transport().send(&portion(turn)));
            turn += 1;
        }
        let next = arm.now() + TURN;
        while arm.now() < next {
            expect(arm.next(next.saturating_sub(arm.now())));
        }
    }
}

/// Frames that were none.
fn dropped(link: &LinkCounters) -> u32 {
    link.bad_cobs + link.bad_crc + link.too_long + link.undecodable
}

#[test]
fn c3_d6_a_flooded_line_delays_no_torque_frame_and_ends_no_run() {
    let mut arm = ready("sim:world=simple");
    prepare(&mut arm, taught());
    let name = expect(Name::new(&taught().name));
    expect(arm.run(&name, RunOptions { speed: 0.5, ..RunOptions::default() }));
    let lasts = Duration::from_secs(3);
    let quiet_from = simulation(arm.transport()).ticks();
    let end = arm.now() + lasts;
    pass(&mut arm, end, false);
    let before = expect(arm.statistics());
    let flood_from = simulation(arm.transport()).ticks();
    let end = arm.now() + lasts;
    pass(&mut arm, end, true);
    let flood_until = simulation(arm.transport()).ticks();
    let after = expect(arm.statistics());
    let status = expect(arm.status());
    let quiet = torque_jitter(&arm_torques(&mut arm, quiet_from, flood_from));
    let starts = arm_torques(&mut arm, flood_from, flood_until);
    let flooded = torque_jitter(&starts);
    println!(
        "torque frames wander by {:.1} us, by {:.1} us while the line is flooded; {} frames dropped, {} requests too many",
        quiet as f64 / MICROSECOND as f64,
        flooded as f64 / MICROSECOND as f64,
        dropped(&after.link) - dropped(&before.link),
        after.link.overrun - before.link.overrun
    );
    assert_eq!((status.state, status.fault), (State::Run.code(), 0), "the run goes on, its host is heard");
    assert!(starts.len() as f64 > 0.99 * lasts.as_secs_f64() * control::RATE, "{} torque frames", starts.len());
    assert!(flooded <= quiet + 50 * MICROSECOND, "torques left late: {flooded} ticks, {quiet} without");
    assert_eq!(after.missed_deadlines, before.missed_deadlines);
    assert_eq!(after.lost_replies, before.lost_replies);
    // What was too much is counted.
    assert!(after.link.overrun > before.link.overrun + 100 && dropped(&after.link) > dropped(&before.link) + 100);
}
