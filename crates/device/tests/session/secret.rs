//! A device that keeps a secret: what it does for whom, what proves it, and for how long a proof is good.

use control::State;
use device::secret::{STORED_BYTES, encode};
use device::storage::{Library, Opening, SECRET_KEY, Work};
use device::{Command, EventKind, Store as _, StoreError};
use link::message::ChunkData;
use link::{Goal, Name, Refusal, Reply, Request, Secret, SecretReport, SecretState};

use crate::rig::{SLOT_BYTES, SLOTS, Store, hello, image};

type Rig<S = Store> = crate::rig::Rig<S>;

const SECRET: Secret = Secret::new(*b"sixteen bytes it");
const OTHER: Secret = Secret::new(*b"sixteen bytes is");

/// A store in memory with this secret.
fn keeping(secret: &Secret) -> Store {
    let mut store = Store::new();
    store.keep_secret(secret).unwrap();
    assert_eq!(store.finished(), Some(Ok(())));
    store
}

/// A session that has not proven anything.
fn locked() -> Rig {
    let mut rig = Rig::over(keeping(&SECRET));
    rig.greet();
    rig
}

/// A session over a library with these bytes of a secret on its flash; none: there was never one.
fn rig_with(kept: &[u8]) -> Rig<Library<SLOTS, SLOT_BYTES>> {
    let mut library = Library::new();
    library.restore(SECRET_KEY, kept);
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    rig
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn challenge<S: device::Store>(rig: &mut Rig<S>) -> u64 {
    match rig.ask(Request::Challenge) {
        Some(Reply::Challenge { nonce, .. }) => nonce,
        other => panic!("no challenge but {other:?}"),
    }
}

fn prove<S: device::Store>(rig: &mut Rig<S>, secret: &Secret) {
    let proof = secret.proof(challenge(rig), rig.number);
    rig.done(Request::Prove { proof });
}

fn report<S: device::Store>(rig: &mut Rig<S>) -> SecretReport {
    match rig.ask(Request::Secret) {
        Some(Reply::Secret { secret, .. }) => secret,
        other => panic!("no report but {other:?}"),
    }
}

fn is_locked<S: device::Store>(rig: &mut Rig<S>) -> bool {
    // Nothing is deleted either way: there is no such primitive.
    match rig.refused(Request::Delete { name: name("nothing") }).0 {
        Refusal::Locked => true,
        Refusal::NoSuchPrimitive => false,
        other => panic!("{other:?}"),
    }
}

/// All that moves something or changes what is kept.
fn guarded() -> Vec<Request> {
    vec![
        Request::Zero { home: [0.0; 7] },
        Request::Gravity,
        Request::Hold,
        Request::Approach { q: [0.0; 7], duration: 0.0 },
        Request::Run { name: name("reach"), options: Default::default() },
        Request::ClearFault,
        Request::SetGoal(Goal::default()),
        Request::SetSpeed { factor: 0.5 },
        Request::Release,
        Request::Tare,
        Request::InitialiseHand,
        Request::MoveHand { q: [0.0; 4], duration: 0.0 },
        Request::UploadBegin { name: name("new"), length: 500, crc: 1 },
        Request::UploadChunk { offset: 0, data: ChunkData::new() },
        Request::UploadCommit,
        Request::UploadAbort,
        Request::Delete { name: name("reach") },
        Request::Rename { name: name("reach"), to: name("other") },
        Request::Calibrate { home: *device::Home::of_model().angles() },
        Request::ForgetCalibration,
        Request::KeepWeight { hand: true, links: [[0.0; 4]; 7] },
        Request::ForgetWeight,
        Request::KeepSecret { secret: OTHER },
        Request::ForgetSecret,
    ]
}

/// All that is done for everybody.
fn free() -> Vec<Request> {
    vec![
        Request::Ping,
        Request::Status,
        Request::Statistics,
        Request::List { index: 0 },
        Request::Read { name: name("reach"), offset: 0 },
        Request::Telemetry { every: 0 },
        Request::Calibration,
        Request::Weight,
        Request::FaultRecord,
        Request::FaultCycle { record: 1, index: 0 },
        Request::Owner,
        Request::Secret,
    ]
}

#[test]
fn h9_without_its_secret_a_device_moves_nothing_and_keeps_what_it_has_and_with_it_does_all() {
    for request in guarded() {
        let mut store = keeping(&SECRET);
        let reach = image("reach", 2.0, 10);
        store.begin(reach.len()).and_then(|()| store.write(0, &reach)).and_then(|()| store.commit(0)).unwrap();
        assert_eq!(store.finished(), Some(Ok(())));
        let mut rig = Rig::over(store);
        rig.bench.state = State::Idle;
        rig.greet();
        assert_eq!(rig.refused(request.clone()), (Refusal::Locked, [0, 0]), "{request:?}");
        rig.wait(300);
        assert!(rig.bench.commands.is_empty() && rig.bench.loaded.is_empty(), "{request:?}");
        assert_eq!(rig.names(), ["reach"], "{request:?}");
        let store = rig.session.store();
        assert_eq!(store.secret(), device::StoredSecret::Kept(SECRET), "{request:?}");
        assert_eq!(store.home(), device::StoredHome::Nothing, "{request:?}");
        assert_eq!(store.weight(), device::StoredWeight::Nothing, "{request:?}");
        prove(&mut rig, &SECRET);
        let answer = rig.ask(request.clone());
        let is_locked = matches!(answer, Some(Reply::Refused { reason: Refusal::Locked, .. }));
        assert!(!is_locked, "{request:?}: {answer:?}");
    }
}

#[test]
fn looking_needs_no_secret() {
    let mut rig = locked();
    for request in free() {
        let answer = rig.ask(request.clone());
        let fine = match &answer {
            Some(Reply::Refused { reason, .. }) => *reason == Refusal::NoSuchPrimitive,
            answer => answer.is_some(),
        };
        assert!(fine, "{request:?}: {answer:?}");
    }
    assert_eq!(report(&mut rig), SecretReport { state: SecretState::Kept, proven: false, wrong_proofs: 0 });
    let guarded = guarded();
    assert!(free().iter().all(|request| !request.is_guarded()) && guarded.iter().all(Request::is_guarded));
}

#[test]
fn h9_a_stop_needs_no_secret_whoever_sends_it() {
    for number in [77, 500] {
        let mut rig = locked();
        rig.bench.state = State::Run;
        rig.number = number;
        rig.commanded(Request::Stop);
        assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)], "session {number}");
    }
}

#[test]
fn a_device_without_a_secret_asks_for_none() {
    let mut rig = Rig::greeted();
    assert_eq!(report(&mut rig), SecretReport::default());
    assert!(!is_locked(&mut rig));
    rig.commanded(Request::Hold);
    assert_eq!(rig.refused(Request::Challenge).0, Refusal::NoSecret);
    assert_eq!(rig.refused(Request::Prove { proof: 1 }).0, Refusal::NoSecret);
    assert_eq!(report(&mut rig).wrong_proofs, 0);
}

#[test]
fn only_the_right_proof_counts_and_a_challenge_is_good_for_one_try() {
    // The secret of another device, the challenge or the session of another time, and every single wrong bit.
    let wrong: Vec<Box<dyn Fn(u64, u16) -> u64>> = vec![
        Box::new(|nonce, session| OTHER.proof(nonce, session)),
        Box::new(|nonce, session| SECRET.proof(nonce ^ 1, session)),
        Box::new(|nonce, session| SECRET.proof(nonce, session + 1)),
        Box::new(|_, _| 0),
    ];
    let bits = (0..64).map(|bit| -> Box<dyn Fn(u64, u16) -> u64> {
        Box::new(move |nonce, session| SECRET.proof(nonce, session) ^ (1 << bit))
    });
    for (case, wrong) in wrong.into_iter().chain(bits).enumerate() {
        let mut rig = locked();
        let nonce = challenge(&mut rig);
        let proof = wrong(nonce, rig.number);
        assert_eq!(rig.refused(Request::Prove { proof }).0, Refusal::WrongProof, "{case}");
        assert!(is_locked(&mut rig), "{case}");
        // The right one now is too late, half a second later too.
        rig.wait(600);
        let proof = SECRET.proof(nonce, rig.number);
        assert_eq!(rig.refused(Request::Prove { proof }).0, Refusal::WrongProof, "{case}");
        assert!(is_locked(&mut rig), "{case}");
        assert_eq!(report(&mut rig).wrong_proofs, 2, "{case}");
    }
    let mut rig = locked();
    let earlier = challenge(&mut rig);
    let nonce = challenge(&mut rig);
    assert_ne!(earlier, nonce);
    let proof = SECRET.proof(earlier, rig.number);
    assert_eq!(rig.refused(Request::Prove { proof }).0, Refusal::WrongProof, "a newer challenge has taken its place");
    rig.wait(600);
    let proof = SECRET.proof(challenge(&mut rig), rig.number);
    rig.done(Request::Prove { proof });
    assert!(report(&mut rig).proven && !is_locked(&mut rig));
    assert_eq!(rig.refused(Request::Prove { proof }).0, Refusal::WrongProof, "it was used before");
    assert!(is_locked(&mut rig), "a wrong proof takes what was proven");
}

#[test]
fn a_proof_that_is_sent_again_is_answered_again_and_counts_once() {
    let mut rig = locked();
    let proof = SECRET.proof(challenge(&mut rig), rig.number);
    rig.done(Request::Prove { proof });
    rig.put(rig.sequence, 0, &Request::Prove { proof });
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
    assert!(!is_locked(&mut rig));
    assert_eq!(report(&mut rig).wrong_proofs, 0);
}

#[test]
fn a_wrong_proof_is_followed_by_half_a_second_without_challenges_also_for_the_next_host() {
    let mut rig = locked();
    challenge(&mut rig);
    assert_eq!(rig.refused(Request::Prove { proof: 1 }).0, Refusal::WrongProof);
    assert_eq!(rig.refused(Request::Challenge), (Refusal::ProofTooSoon, [500, 0]));
    rig.wait(100);
    rig.done(Request::Goodbye);
    rig.number = 88;
    rig.greet();
    assert_eq!(rig.refused(Request::Challenge), (Refusal::ProofTooSoon, [400, 0]));
    rig.wait(399);
    assert_eq!(rig.refused(Request::Challenge), (Refusal::ProofTooSoon, [1, 0]));
    rig.wait(1);
    prove(&mut rig, &SECRET);
    assert!(!is_locked(&mut rig));
    assert_eq!(report(&mut rig), SecretReport { state: SecretState::Kept, proven: true, wrong_proofs: 1 });
}

#[test]
fn a_proof_is_good_until_its_session_ends_however_that_ends() {
    let unlocked = || {
        let mut rig = locked();
        prove(&mut rig, &SECRET);
        assert!(!is_locked(&mut rig));
        rig
    };
    let mut rig = unlocked();
    rig.wait(60_000);
    assert!(!is_locked(&mut rig), "nobody else has come");
    // A goodbye and the same number again; a hello in the middle, under the same number; another host.
    let mut rig = unlocked();
    rig.done(Request::Goodbye);
    rig.greet();
    assert!(is_locked(&mut rig), "after a goodbye");
    let mut rig = unlocked();
    rig.greet();
    assert!(is_locked(&mut rig), "after another hello");
    let mut rig = unlocked();
    rig.wait(501);
    (rig.number, rig.sequence) = (88, 0);
    rig.greet();
    assert!(is_locked(&mut rig), "after a take-over");
    // Silence during a motion ends the session: the same host has to say hello and prove it again.
    let mut rig = unlocked();
    rig.bench.state = State::Run;
    rig.wait(501);
    rig.event(EventKind::Accepted);
    rig.bench.state = State::Hold;
    assert_eq!(rig.refused(Request::Hold).0, Refusal::NoSession);
    rig.greet();
    assert!(is_locked(&mut rig), "after a time-out");
}

#[test]
fn a_challenge_does_not_outlive_its_session_either() {
    let mut rig = locked();
    let nonce = challenge(&mut rig);
    rig.greet();
    let proof = SECRET.proof(nonce, rig.number);
    assert_eq!(rig.refused(Request::Prove { proof }).0, Refusal::WrongProof);
    assert!(is_locked(&mut rig));
}

#[test]
fn an_observer_and_a_stranger_cannot_prove_anything() {
    let mut rig = locked();
    prove(&mut rig, &SECRET);
    rig.number = 500;
    assert_eq!(rig.refused(Request::Challenge).0, Refusal::NoSession);
    assert_eq!(rig.refused(Request::Prove { proof: 1 }).0, Refusal::NoSession);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
    assert_eq!(report(&mut rig), SecretReport { state: SecretState::Kept, proven: false, wrong_proofs: 0 });
    assert_eq!(rig.refused(Request::Challenge).0, Refusal::Observing);
    assert_eq!(rig.refused(Request::Prove { proof: 1 }).0, Refusal::Observing);
    rig.number = 77;
    assert_eq!(report(&mut rig), SecretReport { state: SecretState::Kept, proven: true, wrong_proofs: 0 });
}

/// Lets the keeper do what was asked of the library; gives the work and its bytes.
fn settle(rig: &mut Rig<Library<SLOTS, SLOT_BYTES>>, outcome: Result<(), StoreError>) -> (Option<Work>, Vec<u8>) {
    let mut copy = [0; SLOT_BYTES];
    let work = rig.session.store_mut().take(&mut copy);
    rig.session.store_mut().settle(outcome);
    rig.poll();
    (work, copy[..STORED_BYTES].to_vec())
}

#[test]
fn a_secret_locks_from_the_moment_at_which_it_is_durable_and_opens_when_it_is_forgotten() {
    let mut rig = rig_with(&[]);
    assert_eq!(rig.ask(Request::KeepSecret { secret: SECRET }), None, "answered before anything was written");
    assert!(!is_locked(&mut rig), "locked before it was durable");
    rig.sequence -= 1;
    let (work, bytes) = settle(&mut rig, Ok(()));
    assert_eq!(work, Some(Work::Save { slot: SECRET_KEY, length: STORED_BYTES }));
    assert_eq!(bytes, encode(&SECRET));
    assert!(matches!(rig.answer(), Some(Reply::Accepted { .. })));
    rig.sequence += 1;
    assert!(is_locked(&mut rig), "who sets a secret has to prove it as well");
    prove(&mut rig, &SECRET);
    // Another one: what was proven does not count for it.
    assert_eq!(rig.ask(Request::KeepSecret { secret: OTHER }), None);
    assert!(!is_locked(&mut rig));
    settle(&mut rig, Ok(()));
    assert!(is_locked(&mut rig));
    assert_eq!(rig.refused(Request::ForgetSecret).0, Refusal::Locked);
    assert_eq!(rig.refused(Request::KeepSecret { secret: SECRET }).0, Refusal::Locked);
    prove(&mut rig, &OTHER);
    assert_eq!(rig.ask(Request::ForgetSecret), None);
    assert_eq!(settle(&mut rig, Ok(())).0, Some(Work::Delete { slot: SECRET_KEY }));
    (rig.number, rig.now_ms) = (88, rig.now_ms + 600);
    rig.greet();
    assert!(!is_locked(&mut rig));
    assert_eq!(report(&mut rig).state, SecretState::Nothing);
}

#[test]
fn a_secret_that_the_flash_did_not_take_changes_nothing() {
    let mut rig = rig_with(&encode(&SECRET));
    assert!(is_locked(&mut rig));
    prove(&mut rig, &SECRET);
    for request in [Request::KeepSecret { secret: OTHER }, Request::ForgetSecret] {
        assert_eq!(rig.ask(request), None);
        settle(&mut rig, Err(StoreError::Medium));
        assert!(matches!(rig.answer(), Some(Reply::Refused { reason: Refusal::StoreFailed, .. })));
        assert!(report(&mut rig).proven && !is_locked(&mut rig));
    }
}

#[test]
fn a_secret_that_cannot_be_read_opens_nothing_and_locks_nobody_out() {
    let sealed = |mut bytes: Vec<u8>| {
        let (body, sum) = bytes.split_last_chunk_mut::<4>().expect("longer than a check sum");
        *sum = link::frame::CRC.checksum(body).to_le_bytes();
        bytes
    };
    let changed = |at: usize| {
        let mut bytes = encode(&SECRET).to_vec();
        bytes[at] ^= 1;
        bytes
    };
    let longer = [encode(&SECRET).to_vec(), vec![0; 4]].concat();
    let unreadable = [changed(3), changed(20), changed(27), sealed(changed(4)), sealed(changed(0)), sealed(longer)];
    for (case, bytes) in unreadable.into_iter().chain([vec![0; 3], vec![0; 300]]).enumerate() {
        for mend in [Request::KeepSecret { secret: OTHER }, Request::ForgetSecret] {
            let mut rig = rig_with(&bytes);
            assert_eq!(report(&mut rig).state, SecretState::Unreadable, "{case}");
            let mending = |request: &Request| matches!(request, Request::KeepSecret { .. } | Request::ForgetSecret);
            for request in guarded().into_iter().filter(|request| !mending(request)) {
                assert_eq!(rig.refused(request).0, Refusal::SecretUnreadable, "{case}");
            }
            assert_eq!(rig.refused(Request::Challenge).0, Refusal::SecretUnreadable, "{case}");
            rig.commanded(Request::Stop);
            assert_eq!(rig.ask(mend.clone()), None, "{case}");
            settle(&mut rig, Ok(()));
            assert_eq!(is_locked(&mut rig), mend != Request::ForgetSecret, "{case}");
        }
    }
}

#[test]
fn as_long_as_it_is_not_known_whether_there_is_a_secret_nothing_moves() {
    let mut rig = Rig::over(Library::<SLOTS, SLOT_BYTES>::new());
    rig.wait(1100);
    rig.greet();
    assert_eq!(rig.refused(Request::Hold), (Refusal::StoreFailed, [StoreError::Busy.code(), 0]));
    assert!(rig.bench.commands.is_empty());
    rig.commanded(Request::Stop);
    rig.session.store_mut().restore(SECRET_KEY, &encode(&SECRET));
    rig.session.store_mut().open(Opening::default());
    rig.poll();
    assert!(is_locked(&mut rig));
    prove(&mut rig, &SECRET);
    rig.commanded(Request::Hold);
}

/// A whole session of a host that knows the secret, if there is one: it uploads, commands, and goes.
fn session(rig: &mut Rig, image: &[u8]) {
    rig.greet();
    if report(rig).state == SecretState::Kept {
        prove(rig, &SECRET);
    }
    rig.store("reach", image);
    rig.commanded(Request::Hold);
    rig.done(Request::Goodbye);
}

/// Puts recorded bytes on the line, a frame a millisecond.
fn replay(rig: &mut Rig, said: &[u8]) {
    for frame in said.split_inclusive(|byte| *byte == 0) {
        rig.session.receive(frame);
        rig.wait(1);
    }
}

#[test]
fn h9_a_whole_session_that_is_replayed_brings_nothing_back_and_moves_nothing() {
    let (old, new) = (image("reach", 2.0, 10), image("reach", 3.0, 20));
    for (secret, restarted) in [(None, false), (Some(SECRET), false), (Some(SECRET), true)] {
        let mut rig = Rig::over(secret.as_ref().map_or_else(Store::new, keeping));
        session(&mut rig, &old);
        let recorded = std::mem::take(&mut rig.said);
        // The primitive is made anew, and everybody has gone.
        (rig.number, rig.sequence) = (88, 0);
        session(&mut rig, &new);
        if restarted {
            let store = rig.session.store().clone();
            rig = Rig::over(store);
            // As soon after the start as it was recorded, but for a millisecond.
            rig.now_ms += 1;
        } else {
            rig.wait(10_000);
        }
        rig.bench.commands.clear();
        replay(&mut rig, &recorded);
        assert!(rig.bench.commands.is_empty(), "{secret:?}, {restarted}: {:?}", rig.bench.commands);
        let is_old = rig.session.store().image(0) == Some(old.as_slice());
        assert!(is_old || rig.session.store().image(0) == Some(new.as_slice()));
        assert_eq!(is_old, secret.is_none(), "{restarted}: without a secret this is what a replay does");
    }
}
