//! The text protocol of socketcand, with which programs reach a CAN bus over TCP: commands read, frames written.
//!
//! Served is what raw mode needs: `< open can0 >`, `< rawmode >`, `< send ID LENGTH BYTE... >` and `< echo >` are read,
//! `< frame ID SECONDS DATA >` is written. Numbers are hexadecimal but for the time. Broadcast manager, ISO-TP,
//! statistics and CAN FD are not served.

use puck::{CanFrame, CanId};

/// First words of the server.
pub const HELLO: &str = "< hi >";

/// The answer to a command that was obeyed and asks for nothing else.
pub const OK: &str = "< ok >";

/// The answer to `< echo >`.
pub const ECHO: &str = "< echo >";

/// Longest command, bytes; the longest that is served, `send` with eight bytes, has 43.
pub const LONGEST_COMMAND: usize = 256;

/// Class of an error frame of Linux that says: frames were lost because the receiver was too slow. `CAN_ERR_FLAG` and
/// `CAN_ERR_CRTL`.
const OVERFLOW: u32 = 0x2000_0004;

/// A command of a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Command {
    /// Use this interface.
    Open(String),
    /// Send and receive frames as they are.
    RawMode,
    /// Is somebody there?
    Echo,
    /// Put this frame on the bus.
    Send(CanFrame),
}

/// Why a command is not obeyed; its text stands in the answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CommandError {
    /// Not between `<` and `>`.
    #[error("a command looks like `open can0` between angle brackets")]
    Form,
    /// No end after [`LONGEST_COMMAND`] bytes.
    #[error("a command has at most {LONGEST_COMMAND} characters")]
    TooLong,
    /// Another word than those that are served.
    #[error("unknown command; open, rawmode, send and echo are served")]
    Unknown,
    /// A word too few, too many, or that is no number.
    #[error("usage: {0}")]
    Usage(&'static str),
    /// Neither three hexadecimal digits nor within 11 bits.
    #[error("identifiers of this bus have 11 bits, 000 to 7FF")]
    Identifier,
    /// More than eight bytes, or another number of them than was said.
    #[error("the length is 0 to 8, and as many bytes follow")]
    Length,
}

impl Command {
    /// Reads the words between `<` and `>`.
    ///
    /// # Errors
    /// [`CommandError`]
    pub fn parse(text: &str) -> Result<Self, CommandError> {
        let mut words = text.split_whitespace();
        let command = match words.next() {
            Some("open") => {
                let name = words.next().ok_or(CommandError::Usage("open can0"))?;
                Self::Open(name.to_owned())
            }
            Some("rawmode") => Self::RawMode,
            Some("echo") => Self::Echo,
            Some("send") => return send(words).map(Self::Send),
            _ => return Err(CommandError::Unknown),
        };
        if words.next().is_some() { Err(CommandError::Usage("open can0, rawmode, echo")) } else { Ok(command) }
    }
}

fn send<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<CanFrame, CommandError> {
    const USAGE: CommandError = CommandError::Usage("send 123 2 11 22");
    let number = |word: Option<&str>| {
        let word = word.filter(|word| word.bytes().all(|byte| byte.is_ascii_hexdigit())).ok_or(USAGE)?;
        u32::from_str_radix(word, 16).map_err(|_| USAGE).map(|value| (word.len(), value))
    };
    let (digits, id) = number(words.next())?;
    let (_, length) = number(words.next())?;
    let data =
        words.map(|word| u8::try_from(number(Some(word))?.1).map_err(|_| USAGE)).collect::<Result<Vec<_>, _>>()?;
    // Eight digits stand for 29 bits, however small the number.
    let id = u16::try_from(id).ok().filter(|_| digits <= 3).and_then(CanId::new).ok_or(CommandError::Identifier)?;
    let frame = CanFrame::from_slice(id, &data).filter(|frame| frame.payload().len() == length as usize);
    frame.ok_or(CommandError::Length)
}

/// Cuts the bytes of a connection into commands, whatever comes.
#[derive(Debug, Clone, Default)]
pub struct CommandReader {
    /// The text since `<`; `None` outside of a command.
    begun: Option<Vec<u8>>,
    /// Text outside of commands has been complained of already.
    complained: bool,
}

impl CommandReader {
    /// Takes the next byte; gives the command or the error that it completes.
    pub fn take(&mut self, byte: u8) -> Option<Result<Command, CommandError>> {
        match (&mut self.begun, byte) {
            (_, b'<') => {
                self.begun = Some(Vec::new());
                self.complained = false;
                None
            }
            (Some(begun), b'>') => {
                let command = std::str::from_utf8(begun).map_err(|_| CommandError::Form).and_then(Command::parse);
                self.begun = None;
                Some(command)
            }
            (Some(begun), byte) => {
                begun.push(byte);
                if begun.len() < LONGEST_COMMAND {
                    return None;
                }
                self.begun = None;
                self.complained = true;
                Some(Err(CommandError::TooLong))
            }
            (None, byte) => {
                if self.complained || byte.is_ascii_whitespace() {
                    return None;
                }
                self.complained = true;
                Some(Err(CommandError::Form))
            }
        }
    }
}

/// A frame that was received at this time, us.
#[must_use]
pub fn frame_text(time_us: u64, frame: &CanFrame) -> String {
    let data: String = frame.payload().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("< frame {:03X} {} {data} >", frame.can_id().raw(), seconds(time_us))
}

/// Frames before this time, us, were lost because the program did not read: the error frame of a controller whose
/// receive buffer is full.
#[must_use]
pub fn lost_text(time_us: u64) -> String {
    format!("< error {OVERFLOW:08X} {} >", seconds(time_us))
}

/// The answer to a command that is not obeyed.
#[must_use]
pub fn error_text(reason: impl std::fmt::Display) -> String {
    format!("< error {reason} >")
}

fn seconds(time_us: u64) -> String {
    format!("{}.{:06}", time_us / 1_000_000, time_us % 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(id: u16, data: &[u8]) -> CanFrame {
        CanFrame::from_slice(CanId::new(id).unwrap(), data).unwrap()
    }

    fn said(text: &[u8]) -> Vec<Result<Command, CommandError>> {
        let mut reader = CommandReader::default();
        text.iter().filter_map(|byte| reader.take(*byte)).collect()
    }

    #[test]
    fn commands_are_read_as_programs_write_them() {
        assert_eq!(
            said(b"< open can0 >< rawmode >\n<send 00A 1 5>< send 7FF 0  >< send 1 2 a FF >< echo >"),
            [
                Ok(Command::Open("can0".to_owned())),
                Ok(Command::RawMode),
                Ok(Command::Send(frame(0x00A, &[5]))),
                Ok(Command::Send(frame(0x7FF, &[]))),
                Ok(Command::Send(frame(1, &[0x0A, 0xFF]))),
                Ok(Command::Echo),
            ]
        );
    }

    #[test]
    fn what_is_wrong_with_a_command_is_said_once_and_the_next_one_is_heard() {
        for (text, error) in [
            ("< >", CommandError::Unknown),
            ("< bcmmode >", CommandError::Unknown),
            ("< open >", CommandError::Usage("open can0")),
            ("< rawmode now >", CommandError::Usage("open can0, rawmode, echo")),
            ("< send >", CommandError::Usage("send 123 2 11 22")),
            ("< send +12 0 >", CommandError::Usage("send 123 2 11 22")),
            ("< send 123 1 100 >", CommandError::Usage("send 123 2 11 22")),
            ("< send 800 0 >", CommandError::Identifier),
            ("< send 00000123 0 >", CommandError::Identifier),
            ("< send 123 1 >", CommandError::Length),
            ("< send 123 9 1 2 3 4 5 6 7 8 9 >", CommandError::Length),
            ("hello\r\nworld", CommandError::Form),
        ] {
            assert_eq!(said(format!("{text}< echo >").as_bytes()), [Err(error), Ok(Command::Echo)], "{text}");
        }
        let giant = [b"< ".to_vec(), vec![b'x'; 100_000], b" >< echo >".to_vec()].concat();
        assert_eq!(said(&giant), [Err(CommandError::TooLong), Ok(Command::Echo)]);
    }

    #[test]
    fn frames_are_written_as_socketcand_writes_them() {
        assert_eq!(frame_text(1_000_023, &frame(0x00A, &[5, 0xAB])), "< frame 00A 1.000023 05AB >");
        assert_eq!(frame_text(0, &frame(0x7FF, &[])), "< frame 7FF 0.000000  >");
        assert_eq!(lost_text(2_500_000), "< error 20000004 2.500000 >");
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_and_little_is_kept(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut reader = CommandReader::default();
            for byte in bytes {
                let _ = reader.take(byte);
                prop_assert!(reader.begun.as_ref().is_none_or(|begun| begun.len() < LONGEST_COMMAND));
            }
        }
    }
}
