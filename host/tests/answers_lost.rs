//! A line that carries nothing more from the device once that has answered a certain request.

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use link::frame::{Decoder, FRAME_BYTES, Message};
use link::{Reply, Request};
use serde_json::Value;

use crate::served_arm::Arm;
use crate::tool::{self, said};

/// No request yet; numbers of requests have 16 bits.
const NONE: u32 = u32::MAX;

/// The whole messages in what was read, with their ends; what is begun stays.
fn messages(begun: &mut Vec<u8>, read: &[u8]) -> Vec<Vec<u8>> {
    begun.extend_from_slice(read);
    let end = begun.iter().rposition(|byte| *byte == 0).map_or(0, |last| last + 1);
    let whole: Vec<u8> = begun.drain(..end).collect();
    whole.split_inclusive(|byte| *byte == 0).map(<[u8]>::to_vec).collect()
}

fn decoded<M: Message>(message: &[u8]) -> Option<(u16, M)> {
    Decoder::<FRAME_BYTES>::new().next::<M>(&mut &*message).map(|frame| (frame.envelope.sequence, frame.message))
}

/// Carries messages from one end to the other until `passes` says that no other follows; what comes later is read and
/// lost.
fn carry(mut from: UnixStream, mut to: UnixStream, mut passes: impl FnMut(&[u8]) -> bool) {
    let (mut buffer, mut begun, mut goes_on) = ([0; 4096], Vec::new(), true);
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        for message in messages(&mut begun, &buffer[..count]) {
            // Asked before: an answer may be quicker than whoever notes the request.
            let is_followed = passes(&message);
            if goes_on && to.write_all(&message).is_err() {
                return;
            }
            goes_on &= is_followed;
        }
    }
    let _ = to.shutdown(std::net::Shutdown::Write);
}

/// A command at the arm that is served in the folder, over a line that dies behind the answer to a request.
fn broken_behind(
    folder: &Path,
    mut is_last: impl FnMut(&Request) -> bool + Send + 'static,
    line: &str,
) -> std::process::Output {
    let place = folder.join("line.sock");
    let _ = std::fs::remove_file(&place);
    let listener = UnixListener::bind(&place).unwrap();
    let arm = folder.join("arm.sock");
    std::thread::spawn(move || {
        let (host, _) = listener.accept().unwrap();
        let device = UnixStream::connect(arm).unwrap();
        let last = Arc::new(AtomicU32::new(NONE));
        let (seen, ends) = (Arc::clone(&last), [host.try_clone().unwrap(), device.try_clone().unwrap()]);
        std::thread::spawn(move || {
            carry(host, device, move |message| {
                if let Some((number, _)) = decoded::<Request>(message).filter(|(_, request)| is_last(request)) {
                    seen.store(number.into(), Ordering::SeqCst);
                }
                true
            });
        });
        let [host, device] = ends;
        carry(device, host, |message| {
            let answers = decoded::<Reply>(message).and_then(|(_, reply)| reply.answers());
            answers.map(u32::from) != Some(last.load(Ordering::SeqCst))
        });
    });
    let mut command = tool::command(folder, line);
    command.env("TACTUS_DEVICE", "unix:line.sock").output().unwrap()
}

/// Faults of an arm to which nothing happens.
const NOTHING: &str =
    "[[scenario]]\nname = \"none\"\nfrom = \"power-up\"\ninject = [{ at = 1000, lasts = 0.1, what.payload = 0 }]\n";

/// The device kept the home, and the report said that it did not, because a question behind that had no answer.
///
/// The change that makes it fail: the status behind it is asked for with `?`.
#[test]
fn a_home_that_the_device_keeps_is_told_as_kept_whatever_becomes_of_the_line_then() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NOTHING);
    let line = "--non-interactive calibrate home --set 0.02,-1.97,0.01,3.1,0,0.03,-0.05 --report found.json";
    let output = broken_behind(at, |request| matches!(request, Request::Calibrate { .. }), line);
    let report: Value = serde_json::from_slice(&std::fs::read(at.join("found.json")).unwrap()).unwrap();
    assert_eq!(report["kept"], true, "{}", said(&output));
    // What it would have shown next is not to be had.
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    assert!(said(&output).contains("the home is stored in the device"), "{}", said(&output));
    let told = crate::served_arm::tactus(at, "--json calibrate show");
    let told: Value = serde_json::from_slice(&told.stdout).unwrap();
    assert_eq!(told["stored"], true, "{told}");
}

/// The settings were kept and read back, and the command ended with E702 because it could not tell whether the arm
/// counts from its old zero.
///
/// The change that makes it fail: the status behind them is asked for with `?`.
#[test]
fn settings_that_the_device_keeps_are_told_as_kept_whatever_becomes_of_the_line_then() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NOTHING);
    let mut is_written = false;
    let read_back = move |request: &Request| {
        is_written |= matches!(request, Request::Calibrate { .. });
        is_written && matches!(request, Request::Weight)
    };
    let output = broken_behind(at, read_back, "--json config set home.joint_4_rad=3.1");
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let changes = told["changes"].as_array().unwrap();
    let home = changes.iter().find(|change| change["key"] == "home.joint_4_rad");
    assert_eq!(home.map(|change| &change["after"]), Some(&3.1.into()), "{told}");
}

/// Nobody told that the device asks for the secret from now on, or asks for none any more.
///
/// The changes that make it fail: what is to be said comes behind the proof, or behind the question what is kept.
#[test]
fn a_secret_that_the_device_keeps_or_forgets_is_told_whatever_becomes_of_the_line_then() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NOTHING);
    crate::tool::tactus(at, "secret new lab.secret");
    let kept = |request: &Request| matches!(request, Request::KeepSecret { .. });
    let output = broken_behind(at, kept, "secret set lab.secret");
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    assert!(said(&output).contains("from now on: `--secret-file lab.secret`"), "{}", said(&output));
    let told = crate::served_arm::tactus(at, "--json secret status");
    let told: Value = serde_json::from_slice(&told.stdout).unwrap();
    assert_eq!(told["secret"], "kept", "{told}");
    let forgotten = |request: &Request| matches!(request, Request::ForgetSecret);
    let output = broken_behind(at, forgotten, "--secret-file lab.secret secret clear");
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    assert!(said(&output).contains("the device has forgotten the secret"), "{}", said(&output));
}

/// The device kept what it was told, and the command ended as if nothing had been: what is asked behind it, only to be
/// shown, had no answer.
///
/// The change that makes it fail: the failure of what is shown is told alone.
#[test]
fn what_the_device_keeps_is_told_as_kept_though_it_cannot_be_shown() {
    type Last = fn(&Request) -> bool;
    let cases: [(&str, Last, &str); 3] = [
        ("tare --at-home", |request| matches!(request, Request::Tare), "the zero is taken"),
        ("calibrate payload hand", |request| matches!(request, Request::KeepWeight { .. }), "keeps the declaration"),
        ("calibrate gravity --reset", |request| matches!(request, Request::ForgetWeight), "forgotten the measured"),
    ];
    for (line, last, words) in cases {
        let folder = tempfile::tempdir().unwrap();
        let _arm = Arm::start(folder.path(), NOTHING);
        let output = broken_behind(folder.path(), last, &format!("--non-interactive {line}"));
        let told = format!("{}{}", said(&output), String::from_utf8_lossy(&output.stdout));
        assert!(told.contains(words), "{line}: {told}");
        assert_eq!(output.status.code(), Some(7), "{line}: {told}");
    }
}

/// The line dies before the device has answered that it keeps the home. The report said that it does not.
///
/// The change that makes it fail: whatever is no success is reported as not kept.
#[test]
fn a_home_whose_answer_is_lost_is_reported_as_nobody_knows() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(at, NOTHING);
    let line = "--non-interactive calibrate home --set 0.02,-1.97,0.01,3.1,0,0.03,-0.05 --report found.json";
    let output = broken_behind(at, |request| matches!(request, Request::Hello(_)), line);
    let report: Value = serde_json::from_slice(&std::fs::read(at.join("found.json")).unwrap()).unwrap();
    assert_eq!(report["kept"], Value::Null, "{}", said(&output));
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    assert!(said(&output).contains("`tactus calibrate show` tells"), "{}", said(&output));
    let told = crate::served_arm::tactus(at, "--json calibrate show");
    let told: Value = serde_json::from_slice(&told.stdout).unwrap();
    assert_eq!(told["stored"], true, "the device keeps it: {told}");
}
