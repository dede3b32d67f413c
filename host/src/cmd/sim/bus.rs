//! The simulated arm's CAN bus, served to foreign programs by the protocol of socketcand.
//!
//! Nothing here waits: sockets are asked, not waited for, and whoever does not read loses frames and is told so.

use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use canlog::ARM_INTERFACE;
use canlog::socketcand::{Command, CommandReader, ECHO, HELLO, OK, error_text, frame_text, lost_text};
use lab::simulation::Simulation;
use puck::CanFrame;
use sim::{FOREIGN, Passage, TICKS_PER_MICROSECOND};

/// Programs that may use the bus at once.
const PLACES: usize = 8;

/// Bytes that wait for a program that does not read; about a second of the traffic of a control cycle.
const ROOM: usize = 256 * 1024;

/// Frames of one program that wait for the bus; who sends more is not read until they have gone.
const QUEUE: usize = 32;

/// A program that has just asked for raw mode gets no frame for this long, unless it speaks before: python-can wants
/// to read the answer and nothing behind it.
const SETTLING: Duration = Duration::from_millis(100);

/// Progress of a program through the protocol.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Connected,
    Opened,
    /// It hears the bus from then on.
    Raw(Instant),
}

/// A program that is connected.
struct Guest {
    number: u64,
    socket: TcpStream,
    stage: Stage,
    reader: CommandReader,
    /// Frames it wants to send.
    pending: VecDeque<CanFrame>,
    /// Its frames that wait for the bus.
    queued: usize,
    /// Bytes it has still to be told.
    out: VecDeque<u8>,
    /// Frames were lost because it does not read.
    has_lost: bool,
    gone: bool,
}

impl Guest {
    fn new(number: u64, socket: TcpStream) -> Self {
        let out = VecDeque::from(HELLO.as_bytes().to_vec());
        let (reader, pending) = (CommandReader::default(), VecDeque::new());
        Self { number, socket, stage: Stage::Connected, reader, pending, queued: 0, out, has_lost: false, gone: false }
    }

    /// Reads and obeys what has arrived, as long as its frames and its answers find room.
    fn hear(&mut self) {
        let mut buffer = [0; 1024];
        while !self.gone && self.pending.is_empty() && self.out.len() < ROOM {
            match self.socket.read(&mut buffer) {
                Ok(0) => self.gone = true,
                Ok(count) => buffer[..count].iter().for_each(|byte| self.take(*byte)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.gone = true,
            }
        }
    }

    fn take(&mut self, byte: u8) {
        let Some(command) = self.reader.take(byte) else { return };
        let answer = match command {
            Err(error) => error_text(error),
            Ok(Command::Echo) => ECHO.to_owned(),
            Ok(Command::Open(name)) if name == ARM_INTERFACE => {
                self.stage = Stage::Opened;
                OK.to_owned()
            }
            Ok(Command::Open(_)) => error_text(format_args!("the bus of the arm is {ARM_INTERFACE}")),
            Ok(_) if self.stage == Stage::Connected => error_text(format_args!("open {ARM_INTERFACE} first")),
            Ok(Command::RawMode) => {
                self.stage = Stage::Raw(Instant::now() + SETTLING);
                OK.to_owned()
            }
            Ok(Command::Send(frame)) => match self.stage {
                Stage::Raw(_) => {
                    self.stage = Stage::Raw(Instant::now());
                    return self.pending.push_back(frame);
                }
                _ => error_text("choose rawmode first"),
            },
        };
        self.out.extend(answer.as_bytes());
    }

    /// Keeps a frame of the bus for the program.
    fn tell(&mut self, time_us: u64, text: &str) {
        if !matches!(self.stage, Stage::Raw(from) if from <= Instant::now()) {
            return;
        }
        // Who has lost frames gets the next ones when half of the others are read.
        let room = if self.has_lost { ROOM / 2 } else { ROOM };
        if self.out.len() + text.len() > room {
            self.has_lost = true;
            return;
        }
        if std::mem::take(&mut self.has_lost) {
            self.out.extend(lost_text(time_us).as_bytes());
        }
        self.out.extend(text.as_bytes());
    }

    /// Hands over as much as the socket takes.
    fn flush(&mut self) {
        while !self.gone && !self.out.is_empty() {
            match self.socket.write(self.out.as_slices().0) {
                Ok(count) => drop(self.out.drain(..count)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.gone = true,
            }
        }
    }
}

/// The bus and everybody who is connected to it.
pub(super) struct BusServer {
    listener: TcpListener,
    guests: Vec<Guest>,
    arrivals: u64,
    /// Whose the foreign frames are that wait for the bus, in their order.
    authors: VecDeque<u64>,
    /// Frames whose end has not come, with their author if they are foreign.
    under_way: VecDeque<(Passage, Option<u64>)>,
}

impl BusServer {
    /// Serves the bus at `HOST:PORT`.
    pub(super) fn listen(address: &str) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, guests: Vec::new(), arrivals: 0, authors: VecDeque::new(), under_way: VecDeque::new() })
    }

    /// Where it listens, with the port that the system chose where none was named.
    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Tells the programs what the bus has carried, and gives the bus what they send.
    pub(super) fn serve(&mut self, simulation: &mut Simulation) -> io::Result<()> {
        while let Some(socket) = self.accept()? {
            self.arrivals += 1;
            if self.guests.len() < PLACES {
                self.guests.push(Guest::new(self.arrivals, socket));
            } else {
                // A new connection takes one line at once; then it is closed.
                let _ = (&socket).write(error_text(format_args!("{PLACES} programs use this bus")).as_bytes());
            }
        }
        self.tell(simulation);
        for guest in &mut self.guests {
            guest.hear();
            while guest.queued < QUEUE
                && let Some(frame) = guest.pending.pop_front()
            {
                simulation.plant().submit_foreign(frame);
                self.authors.push_back(guest.number);
                guest.queued += 1;
            }
            guest.flush();
        }
        self.guests.retain(|guest| !guest.gone || !guest.pending.is_empty());
        Ok(())
    }

    fn accept(&self) -> io::Result<Option<TcpStream>> {
        match self.listener.accept() {
            Ok((socket, _)) => {
                socket.set_nonblocking(true)?;
                socket.set_nodelay(true)?;
                Ok(Some(socket))
            }
            // It has hung up again: nobody to serve.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::ConnectionAborted) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn tell(&mut self, simulation: &mut Simulation) {
        for passage in simulation.take_traffic() {
            let author = if passage.sender == FOREIGN { self.authors.pop_front() } else { None };
            if let Some(guest) = self.guests.iter_mut().find(|guest| Some(guest.number) == author) {
                guest.queued -= 1;
            }
            self.under_way.push_back((passage, author));
        }
        while let Some((passage, author)) =
            self.under_way.pop_front_if(|(passage, _)| passage.end <= simulation.ticks())
        {
            let time_us = passage.end / TICKS_PER_MICROSECOND;
            let text = frame_text(time_us, &passage.frame);
            for guest in self.guests.iter_mut().filter(|guest| Some(guest.number) != author) {
                guest.tell(time_us, &text);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_does_not_read_loses_frames_and_is_told_before_the_next_one() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut program = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (socket, _) = listener.accept().unwrap();
        socket.set_nonblocking(true).unwrap();
        let mut guest = Guest { stage: Stage::Raw(Instant::now()), ..Guest::new(1, socket) };
        let mut sent = 0_usize;
        while !guest.has_lost {
            sent += 1;
            guest.tell(1, "< frame 123 0.000001 01 >");
            guest.flush();
            assert!(guest.out.len() <= ROOM && sent < 10_000_000);
        }
        assert!(!guest.gone);
        let mut heard = Vec::new();
        program.set_nonblocking(true).unwrap();
        let read = |guest: &mut Guest, program: &mut TcpStream, heard: &mut Vec<u8>| {
            for _ in 0..100_000 {
                guest.flush();
                let mut buffer = [0; 65536];
                match program.read(&mut buffer) {
                    Ok(count) => heard.extend(&buffer[..count]),
                    Err(_) if guest.out.is_empty() => return,
                    Err(_) => std::thread::yield_now(),
                }
            }
        };
        read(&mut guest, &mut program, &mut heard);
        guest.tell(2_000_000, "< frame 123 2.000000 02 >");
        guest.flush();
        std::thread::sleep(Duration::from_millis(50));
        read(&mut guest, &mut program, &mut heard);
        let text = String::from_utf8(heard).unwrap();
        assert!(text.starts_with("< hi >< frame 123 0.000001 01 >"));
        assert!(
            text.ends_with("01 >< error 20000004 2.000000 >< frame 123 2.000000 02 >"),
            "{}",
            &text[text.len() - 100..]
        );
        assert_eq!(text.matches("0.000001").count(), sent - 1, "the last one was lost");
    }
}
