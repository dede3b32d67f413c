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
fn broken_behind(folder: &Path, is_last: fn(&Request) -> bool, line: &str) -> std::process::Output {
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
            carry(host, device, |message| {
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

/// The device kept the home, and the report said that it did not, because a question behind that had no answer.
///
/// The change that makes it fail: the status behind it is asked for with `?`.
#[test]
fn a_home_that_the_device_keeps_is_told_as_kept_whatever_becomes_of_the_line_then() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _arm = Arm::start(
        at,
        "[[scenario]]\nname = \"none\"\nfrom = \"power-up\"\ninject = [{ at = 1000, lasts = 0.1, what.payload = 0 }]\n",
    );
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
