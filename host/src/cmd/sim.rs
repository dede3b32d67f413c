//! `tactus sim`: a simulated arm that stays, for other terminals to connect to.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;

use super::{ErrorCode, Failure, Global, connection};
use lab::client::Interrupt;
use lab::device::Device;
use lab::transport::{Address, Transport, TransportError};

/// Virtual time simulated between two looks at the socket: a human does not notice, a link time-out neither.
const STRIDE: Duration = Duration::from_millis(5);

/// Options of `sim`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where to listen: `unix:PATH` or `tcp:HOST:PORT`
    #[arg(long, value_name = "ADDRESS", default_value = "unix:tactus.sock")]
    pub listen: String,
    /// End after this much virtual time, s
    #[arg(long, value_name = "SECONDS", value_parser = super::teach::duration)]
    pub duration: Option<f64>,
    /// Do not wait for the wall clock: run as fast as this machine can
    #[arg(long)]
    pub fast: bool,
    /// Keep the device's flash in this file, so that its primitives are there again after a restart
    #[arg(long, value_name = "FILE")]
    pub flash: Option<PathBuf>,
    /// Let the faults of this script befall the arm: a file such as those of `tests/faults`, `FILE:2` for the second of
    /// its scenarios
    #[arg(long, value_name = "FILE")]
    pub faults: Option<String>,
}

/// A connection that can be read without waiting.
trait Peer: Read + Write {}
impl<T: Read + Write> Peer for T {}

enum Listener {
    Unix(UnixListener, PathBuf),
    Tcp(TcpListener),
}

/// Most connections at a time: the host that uses the arm, and others that may stop it. Each further one waits.
const GUESTS: usize = 4;

/// A message is shorter than this; what is longer without an end is none.
const LONGEST_MESSAGE: usize = 4096;

/// One connection. The others speak on the same line, so messages go on as wholes.
struct Guest {
    peer: Box<dyn Peer>,
    /// The beginning of a message.
    begun: Vec<u8>,
}

impl Guest {
    /// Messages that have arrived as wholes; `None`: nobody is there any more.
    fn messages(&mut self) -> Option<Vec<u8>> {
        let mut buffer = [0; 4096];
        match self.peer.read(&mut buffer) {
            Ok(0) => return None,
            Ok(count) => self.begun.extend_from_slice(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return None,
        }
        let end = self.begun.iter().rposition(|byte| *byte == 0).map_or(0, |zero| zero + 1);
        let messages = self.begun.drain(..end).collect();
        if self.begun.len() > LONGEST_MESSAGE {
            self.begun.clear();
        }
        Some(messages)
    }
}

/// Everybody who is connected.
#[derive(Default)]
struct Party(Vec<Guest>);

impl Party {
    /// Bytes sent to the device; those who are gone leave once their last words are heard.
    fn hear(&mut self) -> Vec<u8> {
        let mut said = Vec::new();
        self.0.retain_mut(|guest| guest.messages().map(|messages| said.extend(messages)).is_some());
        said
    }

    /// Hands over what the device says. One that does not read loses bytes, as on a serial line. Nobody leaves here:
    /// one that has hung up may have said its last words before.
    fn tell(&mut self, bytes: &[u8]) {
        for guest in &mut self.0 {
            let _ = guest.peer.write_all(bytes);
        }
    }
}

/// Serves a simulated arm until it is interrupted.
///
/// Bytes arrive when the wall clock brings them, so runs over a socket are not reproducible; `--device sim:` is.
///
/// # Errors
/// The simulation cannot be started, or the address cannot be listened on.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "sim";
    let output = global.output();
    let mut device = global.device.clone().unwrap_or_else(|| "sim:".to_owned());
    let flash = command.flash.as_ref().map(|file| format!("flash={}", file.display()));
    let faults = command.faults.as_ref().map(|file| format!("faults={file}"));
    for option in flash.into_iter().chain(faults) {
        let comma = if device.ends_with(':') { "" } else { "," };
        device = format!("{device}{comma}{option}");
    }
    let (mut device, interrupt) = connection::simulated(&device, global.force, DOING)?;
    let listener = listen(&command.listen).map_err(|cause| {
        Failure::new(ErrorCode::CannotListen, format!("sim: cannot listen on {}", command.listen), cause)
    })?;
    output.say(format!("a simulated arm listens; in another terminal: `tactus --device {} list`", command.listen));
    let served = serve(command, &mut device, &listener, &interrupt);
    if let Listener::Unix(_, path) = &listener {
        // Left behind it would only confuse the next one.
        let _ = std::fs::remove_file(path);
    }
    served.map_err(|error| lab::error::HostError::Transport(error).into_failure(DOING))?;
    let seconds = device.now().as_secs_f64();
    output.result(&serde_json::json!({ "simulated_s": seconds }), format!("{seconds:.1} s simulated"))
}

fn listen(text: &str) -> Result<Listener, Box<dyn std::error::Error + Send + Sync>> {
    match text.parse::<Address>()? {
        Address::Unix(path) => {
            let listener = match UnixListener::bind(&path) {
                // A socket nobody answers on is the left-over of one that was killed.
                Err(error)
                    if error.kind() == ErrorKind::AddrInUse
                        && std::os::unix::net::UnixStream::connect(&path).is_err() =>
                {
                    std::fs::remove_file(&path)?;
                    UnixListener::bind(&path)?
                }
                other => other?,
            };
            listener.set_nonblocking(true)?;
            Ok(Listener::Unix(listener, path))
        }
        Address::Tcp(address) => {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            Ok(Listener::Tcp(listener))
        }
        _ => Err("listen on unix:PATH or tcp:HOST:PORT".into()),
    }
}

fn accept(listener: &Listener) -> std::io::Result<Option<Box<dyn Peer>>> {
    let accepted: std::io::Result<Box<dyn Peer>> = match listener {
        Listener::Unix(listener, _) => listener.accept().and_then(|(stream, _)| {
            stream.set_nonblocking(true)?;
            Ok(Box::new(stream) as Box<dyn Peer>)
        }),
        Listener::Tcp(listener) => listener.accept().and_then(|(stream, _)| {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            Ok(Box::new(stream) as Box<dyn Peer>)
        }),
    };
    match accepted {
        Ok(peer) => Ok(Some(peer)),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(None),
        Err(error) => Err(error),
    }
}

fn serve(command: &Cmd, device: &mut Device, listener: &Listener, interrupt: &Interrupt) -> Result<(), TransportError> {
    let started = Instant::now();
    let mut party = Party::default();
    let mut bytes = Vec::new();
    while !interrupt.is_raised() {
        if command.duration.is_some_and(|limit| device.now().as_secs_f64() >= limit) {
            break;
        }
        while party.0.len() < GUESTS
            && let Some(peer) = accept(listener).map_err(TransportError::Io)?
        {
            party.0.push(Guest { peer, begun: Vec::new() });
        }
        let said = party.hear();
        if !said.is_empty() {
            device.send(&said)?;
        }
        let target = device.now() + STRIDE;
        while device.now() < target {
            bytes.clear();
            device.receive(target.saturating_sub(device.now()), &mut bytes)?;
            party.tell(&bytes);
        }
        if !command.fast {
            std::thread::sleep(device.now().saturating_sub(started.elapsed()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;

    #[test]
    fn the_last_words_of_one_who_has_hung_up_are_heard_whatever_he_is_told_meanwhile() {
        let (mut host, arm) = UnixStream::pair().unwrap();
        arm.set_nonblocking(true).unwrap();
        let mut party = Party(vec![Guest { peer: Box::new(arm), begun: Vec::new() }]);
        assert_eq!((party.hear(), party.0.len()), (Vec::new(), 1), "who says nothing is still there");
        // A stop and a goodbye, and the process ends while telemetry goes on.
        host.write_all(b"stop\0goodbye\0").unwrap();
        drop(host);
        party.tell(b"telemetry");
        party.tell(b"telemetry");
        assert_eq!(party.hear(), b"stop\0goodbye\0");
        assert_eq!((party.hear(), party.0.len()), (Vec::new(), 0), "who is gone has left");
    }
}
