//! A device answers noise, unknown hosts and bad primitives as it should: it drops, refuses with a reason, and goes on.

use lab::client::{Client, UploadOutcome};
use lab::error::HostError;
use lab::transport::Transport as _;
use link::frame::LINK_TIMEOUT_MS;
use link::{DeviceHello, HostHello, LINK_VERSION, LinkCounters, Name, Refusal, Reply, Request, SCHEMA_HASH, Text};
use std::io::Read as _;
use std::net::TcpListener;
use std::time::{Duration, Instant};
use system_tests::command::{one_object, stderr, tactus};
use system_tests::image::{self, Real};
use system_tests::{Arm, boot, connect, expect, raw, taught};

/// The firmware; the world plays no part here.
const DEVICE: &str = "sim:world=simple";

fn dropped(link: LinkCounters) -> u32 {
    link.bad_cobs + link.bad_crc + link.too_long + link.undecodable
}

#[test]
fn random_bytes_are_dropped_counted_and_survived() {
    let mut arm = connect(DEVICE);
    let before = expect(arm.statistics()).link;
    assert_eq!(dropped(before), 0);
    let mut frames = 0;
    for seed in 1..=4 {
        let mut noise = raw::noise(seed, 4096);
        noise.push(0);
        frames += noise.split(|byte| *byte == 0).filter(|frame| !frame.is_empty()).count() as u32;
        expect(arm.transport().send(&noise));
        let status = expect(arm.status());
        assert_eq!((status.state, status.fault), (0, 0), "noise changed the state");
    }
    let after = expect(arm.statistics()).link;
    println!("{frames} frames of noise: {after:?}");
    assert_eq!(dropped(after), frames, "{after:?}");
    assert!(after.accepted > before.accepted);
    // A long silence of zeros, and one endless frame.
    expect(arm.transport().send(&[0; 1000]));
    expect(arm.transport().send(&[0x55; 5000]));
    expect(arm.transport().send(&[0]));
    assert!(expect(arm.list()).is_empty());
    assert_eq!(expect(arm.statistics()).link.too_long, after.too_long + 1);
}

#[test]
fn cli_1_another_link_version_or_schema_is_refused_with_both_versions() {
    let other = LINK_VERSION + 1;
    match Client::connect_as(boot(DEVICE), "stranger", other, SCHEMA_HASH).err() {
        Some(HostError::Incompatible { what: Refusal::LinkVersion, host, device }) => {
            assert_eq!((host, device), (format!("version {other}"), format!("version {LINK_VERSION}")));
        }
        answer => panic!("{answer:?}"),
    }
    match Client::connect_as(boot(DEVICE), "stranger", LINK_VERSION, !SCHEMA_HASH).err() {
        Some(HostError::Incompatible { what: Refusal::Schema, host, device }) => {
            assert_eq!((host, device), (format!("{:#010x}", !SCHEMA_HASH), format!("{SCHEMA_HASH:#010x}")));
        }
        answer => panic!("{answer:?}"),
    }
}

#[test]
fn another_model_is_refused_with_both_hashes_and_nothing_is_answered_before_hello() {
    let mut device = boot(DEVICE);
    let refusal = |answer: Option<Reply>| match answer {
        Some(Reply::Refused { reason, detail, .. }) => (reason, detail),
        answer => panic!("{answer:?}"),
    };
    assert_eq!(refusal(raw::ask(&mut device, 9, 1, &Request::Status)).0, Refusal::NoSession);
    let hello = |model_hash, owner| {
        let owner = Text::new(owner);
        Request::Hello(HostHello { link_version: LINK_VERSION, schema_hash: SCHEMA_HASH, model_hash, owner })
    };
    let ours = control::MODEL_HASH;
    let answer = raw::ask(&mut device, 9, 2, &hello(!ours, "stranger"));
    assert_eq!(refusal(answer), (Refusal::Model, [!ours, ours]));
    assert_eq!(refusal(raw::ask(&mut device, 9, 3, &Request::Gravity)).0, Refusal::NoSession);
    // The right one is welcome on the same line, and a third is told that it is busy.
    let answer = raw::ask(&mut device, 9, 4, &hello(ours, "friend"));
    assert!(matches!(&answer, Some(Reply::Hello { hello: DeviceHello { model_hash, .. }, .. }) if *model_hash == ours));
    let (reason, [disclosed, wait]) = refusal(raw::ask(&mut device, 10, 1, &hello(ours, "third")));
    assert_eq!((reason, disclosed), (Refusal::Busy, 0));
    assert!(wait <= LINK_TIMEOUT_MS, "{wait} ms");
}

/// Uploads bytes that must be refused; gives the reason, and checks that the stored primitive is as before.
fn refused(arm: &mut Arm, name: &Name, sound: &[u8], bad: &[u8]) -> (Refusal, [u32; 2], String) {
    let listed = expect(arm.list());
    let error = image::upload_unseen(arm, name.as_str(), bad).expect_err("a bad image must be refused");
    let words = error.to_string();
    let HostError::Refused { reason, detail, .. } = error else { panic!("{words}") };
    assert_eq!(expect(arm.list()), listed, "the store changed after: {words}");
    assert_eq!(expect(arm.read_image(name, |_| {})), sound, "the stored image changed after: {words}");
    println!("{words}");
    (reason, detail, words)
}

#[test]
fn bad_images_are_refused_with_the_reason_and_the_stored_one_stays() {
    let mut arm = connect(DEVICE);
    let sound = expect(taught().to_image());
    let name = expect(Name::new(&taught().name));
    assert!(matches!(expect(arm.upload(&sound, |_, _, _| {})), UploadOutcome::Stored(_)));
    let mut refused = |bad: &[u8]| refused(&mut arm, &name, &sound, bad);

    let (reason, [computed, carried], _) = refused(&image::with_wrong_crc(&sound));
    assert_eq!((reason, computed), (Refusal::UploadCrc, link::image::stored_crc(&sound)));
    assert_ne!(computed, carried, "the message must name the two check sums that differ");
    let (reason, detail, _) = refused(&image::of_schema(&sound, 7));
    assert_eq!((reason, detail), (Refusal::ImageInvalid, [3, 7]), "schema, with the version found");
    let (reason, detail, _) = refused(&image::of_model(&sound, !control::MODEL_HASH));
    assert_eq!((reason, detail), (Refusal::ImageModel, [!control::MODEL_HASH, control::MODEL_HASH]));
    let (reason, detail, words) = refused(&image::with_kernels(&sound, 142));
    assert_eq!((reason, detail), (Refusal::TooManyKernels, [142, 100]), "{words}");
    for value in [f32::NAN, f32::INFINITY] {
        let (reason, detail, _) = refused(&image::with_real(&sound, Real::GoalJoint2, value));
        assert_eq!((reason, detail), (Refusal::ImageInvalid, [11, Real::GoalJoint2 as u32]), "not finite");
    }
    let outside = [
        (Real::GoalJoint2, 3.0),
        (Real::GoalJoint2, -2.6),
        (Real::Duration, 0.0),
        (Real::Duration, 1e9),
        (Real::Stiffness, -100.0),
        (Real::Stiffness, 1e30),
        (Real::StartOrientation, 4.0),
    ];
    for (real, value) in outside {
        let (reason, _, words) = refused(&image::with_real(&sound, real, value));
        assert_eq!(reason, Refusal::PrimitiveInvalid, "{real:?} = {value}: {words}");
    }
    // After all of that the device takes a sound one as ever.
    assert!(matches!(expect(arm.upload(&sound, |_, _, _| {})), UploadOutcome::AlreadyThere(_)));
    let other = expect(Name::new("other"));
    assert!(expect(arm.find(&other)).is_none());
}

#[test]
fn host_refuses_the_same_images_before_it_sends_anything() {
    let mut arm = connect("sil:world=simple");
    let sound = expect(taught().to_image());
    let bad = [
        image::with_wrong_crc(&sound),
        image::of_schema(&sound, 7),
        image::with_kernels(&sound, 142),
        image::with_real(&sound, Real::Duration, f32::NAN),
        sound[..sound.len() - 1].to_vec(),
        Vec::new(),
    ];
    for image in bad {
        let before = arm.round_trips().count;
        let error = arm.upload(&image, |_, _, _| {}).expect_err("it is bad");
        assert!(matches!(error, HostError::Image(_)), "{error}");
        assert_eq!(arm.round_trips().count, before, "something was sent");
    }
}

#[test]
fn check_refuses_what_the_device_would_refuse() {
    let folder = expect(tempfile::tempdir());
    let mut file = taught().clone();
    let path = folder.path().join("bad.toml");
    file.goal.posture[1] = 3.0;
    expect(file.write(&path));
    let checked = tactus(folder.path(), &["check", "bad.toml"]).code(6);
    println!("{}", stderr(&checked));
    assert!(stderr(&checked).contains("E6"), "{}", stderr(&checked));
    let uploaded = tactus(folder.path(), &["--device", "sil:world=simple", "run", "bad.toml"]).code(6);
    assert!(stderr(&uploaded).starts_with("error"), "{}", stderr(&uploaded));
    file = taught().clone();
    file.model_hash ^= 1;
    expect(file.write(&path));
    let checked = tactus(folder.path(), &["check", "bad.toml"]).code(4);
    assert!(stderr(&checked).contains(&format!("{:08x}", control::MODEL_HASH)), "{}", stderr(&checked));
}

#[test]
fn a_device_that_does_not_answer_is_reported_within_two_seconds() {
    let listener = expect(TcpListener::bind("127.0.0.1:0"));
    let address = format!("tcp:{}", expect(listener.local_addr()));
    let mute = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("tactus connects");
        let mut heard = Vec::new();
        // Hears everything, says nothing, until the other end has given up.
        let _ = stream.read_to_end(&mut heard);
        heard.len()
    });
    let started = Instant::now();
    let folder = expect(tempfile::tempdir());
    let failed = tactus(folder.path(), &["--device", &address, "--json", "list"]).code(7);
    let took = started.elapsed();
    println!("took {:.2} s", took.as_secs_f64());
    // It gives up after 2 s; the rest is for a computer that does something else as well.
    assert!(took >= Duration::from_millis(1900) && took < Duration::from_secs(10), "{took:?}");
    assert!(stderr(&failed).contains("did not answer"), "{}", stderr(&failed));
    let object = one_object(&failed.get_output().stdout);
    assert!(object.to_string().contains("E702"), "{object}");
    assert!(mute.join().expect("it only reads") > 0, "nothing was asked");
}
