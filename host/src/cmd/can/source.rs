//! Where lines come from: a file, standard input, or an interface.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Seek, Stdin};
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use super::{ErrorCode, Failure};
use crate::cmd::output::tell;
use canlog::{LineError, LogLine};
use lab::client::Interrupt;
use lab::error::HostError;
use lab::transport::SocketCan;

/// Lines that are reported one by one; of more only the number.
const REPORTED: u64 = 20;

/// Letters of a wrong line that are shown.
const SHOWN: usize = 60;

/// Bytes of the longest line that is read as one: candump's have less than a hundred.
const LONGEST_LINE: u64 = 4096;

/// Period at which a growing file and an interface are polled.
const PAUSE: Duration = Duration::from_millis(100);

/// A source of log lines.
pub(super) enum Source {
    /// A file that has an end, or `follow`s what is appended to it.
    File { reader: BufReader<File>, path: PathBuf, follow: bool },
    /// Standard input.
    Input(BufReader<Stdin>),
    /// An interface of this system.
    Interface { port: SocketCan, name: String },
}

/// Lines that could not be read.
#[derive(Debug, Default)]
pub(super) struct Garbage {
    /// Their number.
    pub(super) lines: u64,
    /// Number of the first one.
    first: Option<u64>,
}

impl Garbage {
    /// The cause of a refusal, if the log has such lines.
    pub(super) fn cause(&self) -> Option<String> {
        let (first, lines) = (self.first?, self.lines);
        Some(match lines {
            1 => format!("one line is not in candump's format: line {first}"),
            _ => format!("{lines} lines are not in candump's format, the first is line {first}"),
        })
    }

    /// Tells of a line, as long as there are few of them.
    fn tell(&mut self, number: u64, text: &str, error: &LineError) {
        self.lines += 1;
        self.first.get_or_insert(number);
        if self.lines <= REPORTED {
            let shown: String = text.trim_end().chars().take(SHOWN).collect();
            let rest = if shown.len() < text.trim_end().len() { "..." } else { "" };
            tell(format!("line {number}: {error}: `{}{rest}`", shown.escape_debug()));
        } else if self.lines == REPORTED + 1 {
            tell("more such lines are only counted");
        }
    }
}

/// True where the last line ended with a carriage return: a newline behind that is no line.
struct Returned(bool);

impl Returned {
    /// Reads to the end of a line, whatever it is: a newline, a carriage return or both; at most `room` bytes. Gives
    /// their number, 0 at the end of the file.
    fn read_line(&mut self, reader: &mut impl BufRead, room: u64, text: &mut Vec<u8>) -> std::io::Result<usize> {
        let mut count = 0;
        while (count as u64) < room {
            let bytes = match reader.fill_buf() {
                Err(cause) if cause.kind() == ErrorKind::Interrupted => continue,
                bytes => bytes?,
            };
            if self.0 && bytes.first() == Some(&b'\n') {
                self.0 = false;
                reader.consume(1);
                continue;
            }
            let bytes = &bytes[..bytes.len().min(room as usize - count)];
            let end = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
            let taken = end.map_or(bytes.len(), |end| end + 1);
            text.extend_from_slice(&bytes[..taken]);
            if taken == 0 {
                break;
            }
            self.0 = end.is_some_and(|end| bytes[end] == b'\r');
            reader.consume(taken);
            count += taken;
            if end.is_some() {
                break;
            }
        }
        Ok(count)
    }
}

impl Source {
    /// Opens a file, `-` for standard input, or without a file the interface.
    pub(super) fn open(
        file: Option<&Path>,
        interface: Option<&str>,
        follow: bool,
        doing: &str,
    ) -> Result<Self, Failure> {
        match (file, interface) {
            (Some(path), _) if path == Path::new("-") => Ok(Self::Input(BufReader::new(std::io::stdin()))),
            (Some(path), _) => {
                let file = File::open(path).map_err(|cause| {
                    Failure::of_file(
                        ErrorCode::LogUnreadable,
                        format!("{doing}: cannot read {}", path.display()),
                        cause,
                    )
                })?;
                Ok(Self::File { reader: BufReader::new(file), path: path.to_owned(), follow })
            }
            (None, Some(name)) => {
                let port =
                    SocketCan::open_listener(name).map_err(|error| HostError::Transport(error).into_failure(doing))?;
                Ok(Self::Interface { port, name: name.to_owned() })
            }
            (None, None) => Err(Failure::new(ErrorCode::NoLogNamed, doing, "neither a log nor an interface is named")),
        }
    }

    /// True if the file has less than was read of it: whoever writes it has begun it anew, and it is read from its
    /// beginning. A simulated device does so with `--force`.
    fn starts_anew(&mut self) -> bool {
        let Self::File { reader, path, .. } = self else { return false };
        let Ok(passed) = reader.stream_position() else { return false };
        let is_shorter = reader.get_ref().metadata().is_ok_and(|file| file.len() < passed);
        if !is_shorter || reader.rewind().is_err() {
            return false;
        }
        tell(format!("{} was begun anew", path.display()));
        true
    }

    /// Hands line after line, with its number, to `take` until the source ends, `take` says no, or the user interrupts;
    /// nothing where the next line may be long in coming.
    pub(super) fn read(
        mut self,
        interrupt: &Interrupt,
        doing: &str,
        mut take: impl FnMut(Option<(u64, LogLine)>) -> Result<bool, Failure>,
    ) -> Result<Garbage, Failure> {
        let mut garbage = Garbage::default();
        let mut number = 0;
        let mut text = Vec::new();
        let mut returned = Returned(false);
        while !interrupt.is_raised() {
            let (count, follow) = match &mut self {
                Self::Interface { port, name } => {
                    if !take(None)? {
                        break;
                    }
                    let heard = port.listen(PAUSE).map_err(|error| HostError::Transport(error).into_failure(doing))?;
                    let Some((time, frame)) = heard else { continue };
                    let time_us = time.duration_since(UNIX_EPOCH).unwrap_or_default().as_micros() as u64;
                    number += 1;
                    if !take(Some((number, LogLine { time_us, interface: name.as_str().into(), frame })))? {
                        break;
                    }
                    continue;
                }
                Self::File { reader, path, follow } => {
                    let room = LONGEST_LINE.saturating_sub(text.len() as u64);
                    let unreadable = |cause| {
                        let doing = format!("{doing}: cannot read {}", path.display());
                        Failure::of_file(ErrorCode::LogUnreadable, doing, cause)
                    };
                    (returned.read_line(reader, room, &mut text).map_err(unreadable)?, *follow)
                }
                Self::Input(reader) => {
                    if reader.buffer().is_empty() && !take(None)? {
                        break;
                    }
                    let count = returned.read_line(reader, LONGEST_LINE, &mut text).map_err(|cause| {
                        Failure::new(ErrorCode::LogUnreadable, format!("{doing}: cannot read standard input"), cause)
                    })?;
                    (count, false)
                }
            };
            let whole = text.ends_with(b"\n") || text.ends_with(b"\r");
            if text.len() as u64 >= LONGEST_LINE && !whole {
                let cause = format!("line {} has more than {LONGEST_LINE} bytes", number + 1);
                return Err(Failure::new(ErrorCode::LogLines, doing, cause));
            }
            if follow && count == 0 && self.starts_anew() {
                (number, text, returned) = (0, Vec::new(), Returned(false));
                continue;
            }
            if follow && !whole {
                if !take(None)? {
                    break;
                }
                // The rest of the line, or the next one, is still to be written.
                std::thread::sleep(PAUSE);
                continue;
            }
            if count == 0 && text.is_empty() {
                break;
            }
            number += 1;
            let line = String::from_utf8_lossy(&text);
            // Empty lines and notes are no garbage.
            if !line.trim().is_empty() && !line.starts_with('#') {
                match line.parse() {
                    Ok(line) => {
                        if !take(Some((number, line)))? {
                            break;
                        }
                    }
                    Err(error) => garbage.tell(number, &line, &error),
                }
            }
            text.clear();
        }
        Ok(garbage)
    }
}
