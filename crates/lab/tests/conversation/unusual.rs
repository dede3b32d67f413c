//! Things in an unusual order: a user who interrupts between two steps, a device that begins to talk late.

use std::time::Duration;

use lab::client::{Client, Interrupt};
use lab::error::HostError;
use lab::transport::{Transport, TransportError};
use link::{Name, Refusal, RunOptions};

use super::fixture::{Device, connected};

/// Seen: Ctrl-C while `tactus run NAME` read and checked its movement. An arm without torque got it all the same; one
/// that held began to play and was stopped, which ended its hold.
///
/// The change that makes it fail: an interrupt is looked at only where something is waited for.
#[test]
fn nothing_is_begun_for_a_user_who_has_interrupted_before() {
    type Order = fn(&mut Client<Device>) -> Result<(), HostError>;
    let orders: [Order; 6] = [
        |client| client.hold(),
        |client| client.gravity(),
        |client| client.approach([0.1; 7], 0.0),
        |client| client.run(&Name::new("reach").unwrap(), RunOptions::default()),
        |client| client.move_hand([0.0; 4], 1.0),
        |client| client.initialise_hand(),
    ];
    for (place, order) in orders.into_iter().enumerate() {
        let mut client = connected();
        let interrupt = Interrupt::never();
        client.set_interrupt(interrupt.clone());
        interrupt.raise();
        let ended = order(&mut client);
        assert!(matches!(ended, Err(HostError::Left)), "order {place}: {ended:?}");
        assert!(client.transport().half.commands.is_empty(), "order {place}");
    }
}

/// The change that makes it fail: a hold is refused as well to whoever has heard of the interrupt, or ends a motion.
#[test]
fn an_arm_that_was_led_can_be_left_holding_by_a_user_who_interrupts() {
    for is_told_first in [true, false] {
        let mut client = connected();
        let interrupt = Interrupt::never();
        client.set_interrupt(interrupt.clone());
        client.gravity().unwrap();
        interrupt.raise();
        if is_told_first {
            let ended = client.next(Duration::from_secs(1));
            assert!(matches!(ended, Err(HostError::Interrupted)), "{ended:?}");
        }
        client.hold().unwrap();
    }
}

/// A device that says nothing for its first 2.2 s, as a board that is reset.
struct Waking(Device);

impl Waking {
    fn sleeps(&self) -> bool {
        self.0.now() < Duration::from_millis(2200)
    }
}

impl Transport for Waking {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        if self.sleeps() { Ok(()) } else { self.0.send(bytes) }
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        self.0.dead = self.sleeps();
        self.0.receive(timeout, out)
    }

    fn now(&self) -> Duration {
        self.0.now()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

/// Seen: `tactus monitor` beside a board that was just reset got no answer for 2 s, said hello as to an older device,
/// and had the session then: `tactus run` was refused, the arm was in use.
///
/// The change that makes it fail: whoever only looks keeps a session that was opened to ask for the version.
#[test]
fn who_looks_on_at_a_device_that_talks_late_does_not_take_its_session() {
    let mut client = Client::observe(Waking(Device::new()), "onlooker").unwrap();
    client.status().unwrap();
    let moves = client.gravity();
    assert!(matches!(moves, Err(HostError::Refused { reason: Refusal::Observing, .. })), "{moves:?}");
}

/// Seen: beside a board that was reset `tactus monitor` said that the monitor had been suspended; of the reset it said
/// nothing.
///
/// The change that makes it fail: every end of a place among those who look on is taken for that of a suspended host.
#[test]
fn a_device_that_was_started_anew_is_told_from_a_host_that_was_suspended() {
    for restarts in [true, false] {
        let mut client = Client::observe(Device::new(), "onlooker").unwrap();
        client.next(Duration::from_secs(1)).unwrap();
        if restarts {
            client.transport().restart();
        } else {
            client.transport().suspended = 2500 * 9 / 10;
        }
        let refused = loop {
            match client.next(Duration::from_secs(1)) {
                Ok(_) => {}
                Err(error) => break error,
            }
        };
        assert!(matches!(refused, HostError::Refused { reason: Refusal::NoSession, .. }), "{refused:?}");
        assert_eq!(client.observe_anew("onlooker").unwrap(), restarts);
    }
}
