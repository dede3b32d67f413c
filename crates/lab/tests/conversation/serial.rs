//! The host on a serial port of the system, a pseudo-terminal: opened, used, busy, pulled out.

use std::io::{Read as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use control::State;
use lab::client::{Client, UploadOutcome};
use lab::error::HostError;
use lab::transport::{SerialTransport, Transport, TransportError};
use serialport::{SerialPort as _, TTYPort};

use super::fixture::{Device, STEP, image};

/// A device at the far end of a serial line, in the time of the wall clock.
struct Board {
    path: String,
    pulled: Arc<AtomicBool>,
    served: Option<JoinHandle<Device>>,
}

impl Board {
    fn new() -> Self {
        let (mut far, near) =
            TTYPort::pair().expect("a pseudo-terminal; if there is none: mount -t devpts devpts /dev/pts");
        let path = near.name().expect("has a name");
        // Without a user at the near end the far one is told that the line is gone; this one leaves it to others.
        let kept = std::fs::File::open(&path).expect("opens");
        drop(near);
        let pulled = Arc::new(AtomicBool::new(false));
        let until = Arc::clone(&pulled);
        let served = std::thread::spawn(move || {
            let _kept = kept;
            far.set_timeout(Duration::from_millis(1)).expect("takes a time-out");
            let (mut device, begin) = (Device::new(), Instant::now());
            let mut bytes = [0; 4096];
            while !until.load(Ordering::Relaxed) {
                if let Ok(length @ 1..) = far.read(&mut bytes) {
                    device.send(&bytes[..length]).expect("takes the bytes");
                }
                let mut out = Vec::new();
                while device.now() < begin.elapsed() {
                    device.receive(STEP, &mut out).expect("answers");
                }
                // What does not fit is lost, as on a line that nobody reads.
                let _ = far.write(&out);
            }
            device
        });
        Board { path, pulled, served: Some(served) }
    }

    fn open(&self) -> Client<SerialTransport> {
        Client::connect(SerialTransport::open(&self.path, 921_600).expect("opens"), "test").expect("answers")
    }

    /// Pulls the cable out, and returns what was at its end.
    fn pull(&mut self) -> Device {
        self.pulled.store(true, Ordering::Relaxed);
        self.served.take().expect("is pulled once").join().expect("ends")
    }
}

#[test]
fn a_serial_port_carries_a_session_and_the_next_one_begins_where_the_last_was_broken_off() {
    let mut board = Board::new();
    let mut client = board.open();
    let outcome = client.upload(&image("reach", 3.0), |_, _, _| ()).expect("takes it");
    assert!(matches!(outcome, UploadOutcome::Stored(_)), "{outcome:?}");
    client.gravity().expect("moves");
    // Cycle after cycle comes in, and nobody reads it: the program ends.
    client.set_telemetry(1).expect("tells every cycle");
    drop(client);

    let mut next = board.open();
    assert_eq!(next.list().expect("lists").len(), 1);
    next.stop().expect("stops");
    drop(next);
    assert_eq!(board.pull().half.state, State::SoftStop);
}

/// A second program was told to check the cable: the port could not be locked, and that was taken for no port.
///
/// The change that makes it fail: a port that cannot be had alone is one that is not there.
#[test]
fn a_serial_port_that_another_program_uses_is_told_from_one_that_is_not_there() {
    let mut board = Board::new();
    let client = board.open();
    let busy = HostError::from(SerialTransport::open(&board.path, 921_600).err().expect("is in use"));
    assert_eq!((busy.code().to_string(), busy.code().exit() as u8), ("E307".to_owned(), 3), "{busy}");
    assert!(busy.code().remedy().contains("Ctrl-C") && !busy.code().remedy().contains("cable"));

    // Who had it leaves it to the next.
    drop(client);
    board.open().stop().expect("stops");
    let path = board.path.clone();
    drop(board.pull());
    let missing = HostError::from(SerialTransport::open(&path, 921_600).err().expect("is gone"));
    assert_eq!(missing.code().to_string(), "E301");
}

/// The console of another board.
struct Console(Duration);

impl Transport for Console {
    fn send(&mut self, _: &[u8]) -> Result<(), TransportError> {
        Ok(())
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        out.extend(b"\r\nlogin: \0");
        self.0 += timeout;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.0
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

/// The change that makes it fail: a line on which no message comes is one without an answer.
#[test]
fn the_console_of_another_board_is_told_from_a_board_that_is_silent() {
    let console = || Console(Duration::ZERO);
    let of = [
        Client::connect(console(), "test").err(),
        Client::observe(console(), "test").err(),
        Client::halt(console(), "test").err(),
    ];
    for error in of {
        let error = error.expect("it is no device");
        assert_eq!((error.code().to_string(), error.code().exit() as u8), ("E706".to_owned(), 7), "{error}");
    }
}

#[test]
fn a_file_that_is_no_serial_port_is_named_as_such() {
    for path in ["/dev/null", "Cargo.toml"] {
        let error = HostError::from(SerialTransport::open(path, 921_600).err().expect("is none"));
        assert_eq!(error.code().to_string(), "E301");
        assert!(error.to_string().contains("is no serial port"), "{error}");
    }
}

#[test]
fn a_serial_cable_that_is_pulled_out_closes_the_connection() {
    let mut board = Board::new();
    let mut client = board.open();
    board.pull();
    let error = client.status().expect_err("nobody is there");
    assert_eq!(error.code().to_string(), "E701", "{error}");
}
