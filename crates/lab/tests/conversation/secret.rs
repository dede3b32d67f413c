//! A device that keeps a secret, and hosts that know it, know another one, or none.

use std::time::Duration;

use device::Store as _;
use lab::client::Client;
use lab::error::HostError;
use link::{Name, Refusal, Secret, SecretReport, SecretState};

use crate::fixture::{Device, connected, image};

const SECRET: Secret = Secret::new(*b"sixteen bytes it");
const OTHER: Secret = Secret::new(*b"sixteen bytes is");

/// A device that keeps the secret.
fn locked() -> Device {
    let mut device = Device::new();
    device.session.store_mut().keep_secret(&SECRET).unwrap();
    device
}

fn reason<T: std::fmt::Debug>(outcome: Result<T, HostError>) -> Refusal {
    match outcome {
        Err(HostError::Refused { reason, .. }) => reason,
        other => panic!("not refused but {other:?}"),
    }
}

fn delete(client: &mut Client<Device>) -> Refusal {
    reason(client.delete(&Name::new("nothing").unwrap()))
}

#[test]
fn a_host_without_the_secret_looks_and_one_that_proves_it_commands() {
    let mut client = Client::connect(locked(), "test").unwrap();
    assert!(client.status().is_ok() && client.list().is_ok() && client.statistics().is_ok());
    assert_eq!(delete(&mut client), Refusal::Locked);
    assert!(client.stop().is_ok());
    assert_eq!(client.unlock(&SECRET).unwrap(), SecretState::Kept);
    client.upload(&image("reach", 2.0), |_, _, _| {}).unwrap();
    assert_eq!(client.list().unwrap().len(), 1);
    assert_eq!(client.secret().unwrap(), SecretReport { state: SecretState::Kept, proven: true, wrong_proofs: 0 });
}

#[test]
fn a_wrong_secret_is_told_at_once_and_the_right_one_is_taken_half_a_second_later() {
    let mut client = Client::connect(locked(), "test").unwrap();
    let started = client.now();
    assert_eq!(reason(client.unlock(&OTHER)), Refusal::WrongProof);
    assert!(client.now() - started < Duration::from_millis(100));
    assert_eq!(delete(&mut client), Refusal::Locked);
    assert_eq!(client.unlock(&SECRET).unwrap(), SecretState::Kept);
    assert!(client.now() - started > Duration::from_millis(500));
    assert_eq!(delete(&mut client), Refusal::NoSuchPrimitive);
}

#[test]
fn a_refusal_for_want_of_the_secret_says_how_to_give_it() {
    let mut client = Client::connect(locked(), "test").unwrap();
    let error = client.delete(&Name::new("nothing").unwrap()).unwrap_err();
    assert_eq!((error.code().exit() as u8, error.code().to_string()), (5, "E550".to_owned()));
    let failure = error.into_failure("delete").to_string();
    assert!(failure.contains("`--secret-file FILE`") && failure.contains("TACTUS_SECRET_FILE"), "{failure}");
}

#[test]
fn a_secret_is_kept_changed_and_forgotten_and_each_step_needs_the_present_one() {
    let mut client = connected();
    assert_eq!(client.unlock(&SECRET).unwrap(), SecretState::Nothing);
    client.keep_secret(&SECRET).unwrap();
    assert_eq!(reason(client.keep_secret(&OTHER)), Refusal::Locked);
    client.unlock(&SECRET).unwrap();
    client.keep_secret(&OTHER).unwrap();
    assert_eq!(reason(client.forget_secret()), Refusal::Locked);
    client.unlock(&OTHER).unwrap();
    client.forget_secret().unwrap();
    assert_eq!(client.secret().unwrap(), SecretReport::default());
    assert_eq!(delete(&mut client), Refusal::NoSuchPrimitive);
}

#[test]
fn a_proof_gets_through_on_a_line_that_loses_requests_and_answers() {
    for (requests, answers) in [(2, 0), (0, 2), (3, 4), (5, 2)] {
        let mut device = locked();
        (device.lose_every, device.lose_answers_every) = (requests, answers);
        let mut client = Client::connect(device, "test").unwrap();
        assert_eq!(client.unlock(&SECRET).unwrap(), SecretState::Kept, "{requests}, {answers}");
        assert_eq!(delete(&mut client), Refusal::NoSuchPrimitive, "{requests}, {answers}");
        assert_eq!(client.secret().unwrap().wrong_proofs, 0, "{requests}, {answers}");
    }
}
