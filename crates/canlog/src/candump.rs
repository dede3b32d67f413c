//! Lines of `candump -L`: `(1436509052.249713) can0 123#0102`, read and written.
//!
//! Everything candump writes is read: data, remote and error frames of eleven and 29 bits, frames of CAN FD, and the
//! direction that newer versions put at the end. Time keeps its microseconds exactly; further decimals are cut off.

use std::fmt;
use std::str::FromStr;

use embedded_can::Frame as _;
use puck::{CanFrame, CanId};

/// One frame of any kind that a bus can carry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AnyFrame {
    /// A data frame with an eleven-bit identifier: all that Barrett's devices and our link use.
    Data(CanFrame),
    /// A data frame with a 29-bit identifier.
    Extended {
        /// Its identifier.
        id: u32,
        /// Up to eight bytes.
        data: Vec<u8>,
    },
    /// A remote frame: it asks for the frame of this identifier.
    Remote {
        /// Its identifier.
        id: u32,
        /// True if that has 29 bits.
        extended: bool,
        /// The length it asks for.
        length: u8,
    },
    /// No frame of the wire: what the controller says about errors.
    Error {
        /// Classes of errors, a bit each, as in Linux' `can/error.h`.
        class: u32,
        /// Details.
        data: Vec<u8>,
    },
    /// A frame of CAN FD, which has no place on an arm's bus.
    FlexibleRate {
        /// Its identifier.
        id: u32,
        /// Its flags.
        flags: u8,
        /// Up to 64 bytes.
        data: Vec<u8>,
    },
}

impl AnyFrame {
    /// The bytes it carries.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        match self {
            Self::Data(frame) => frame.payload(),
            Self::Extended { data, .. } | Self::Error { data, .. } | Self::FlexibleRate { data, .. } => data,
            Self::Remote { .. } => &[],
        }
    }

    /// The identifier as candump writes it.
    #[must_use]
    pub fn id_text(&self) -> String {
        match self {
            Self::Data(frame) => format!("{:03X}", frame.can_id().raw()),
            Self::Remote { id, extended: false, .. } => format!("{id:03X}"),
            Self::Extended { id, .. } | Self::Remote { id, .. } => format!("{id:08X}"),
            Self::Error { class, .. } => format!("{:08X}", class | ERROR_FLAG),
            Self::FlexibleRate { id, .. } if *id <= 0x7FF => format!("{id:03X}"),
            Self::FlexibleRate { id, .. } => format!("{id:08X}"),
        }
    }

    /// The data in hexadecimal, without blanks.
    #[must_use]
    pub fn data_text(&self) -> String {
        self.data().iter().map(|byte| format!("{byte:02X}")).collect()
    }
}

/// `CAN_ERR_FLAG` of Linux: the identifier stands for errors.
const ERROR_FLAG: u32 = 0x2000_0000;

/// A frame with the time and the interface at which it was seen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogLine {
    /// When it had been received, us of the logging computer's clock.
    pub time_us: u64,
    /// On which interface.
    pub interface: Box<str>,
    /// What.
    pub frame: AnyFrame,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (seconds, rest) = (self.time_us / 1_000_000, self.time_us % 1_000_000);
        write!(f, "({seconds:010}.{rest:06}) {} {}#", self.interface, self.frame.id_text())?;
        match &self.frame {
            AnyFrame::Remote { length: 0, .. } => f.write_str("R"),
            AnyFrame::Remote { length, .. } => write!(f, "R{length:X}"),
            AnyFrame::FlexibleRate { flags, .. } => write!(f, "#{flags:X}{}", self.frame.data_text()),
            frame => f.write_str(&frame.data_text()),
        }
    }
}

/// Why a line is not in candump's format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// Not `(time) interface id#data`.
    #[error("a line looks like `(12.345678) can0 123#0102`")]
    Form,
    /// The text in parentheses is no time in seconds.
    #[error("'{0}' is no time in seconds")]
    Time(String),
    /// The identifier has neither three nor eight hexadecimal digits, or is too large.
    #[error("'{0}' is no CAN identifier (3 or 8 hexadecimal digits)")]
    Identifier(String),
    /// The data are no hexadecimal digits, two a byte.
    #[error("'{0}' are no data bytes (two hexadecimal digits each)")]
    Data(String),
    /// More bytes than such a frame holds.
    #[error("{found} data bytes, at most {most} fit")]
    Length {
        /// Data bytes found.
        found: usize,
        /// Most data bytes of such a frame.
        most: usize,
    },
}

impl FromStr for LogLine {
    type Err = LineError;

    fn from_str(line: &str) -> Result<Self, LineError> {
        // Some editors put a mark before the first line.
        let rest = line.trim_start_matches('\u{feff}').trim().strip_prefix('(').ok_or(LineError::Form)?;
        let (time, rest) = rest.split_once(')').ok_or(LineError::Form)?;
        let mut words = rest.split_whitespace();
        let (Some(interface), Some(frame)) = (words.next(), words.next()) else {
            return Err(LineError::Form);
        };
        // Newer versions say whether the frame was received or sent by the logging computer.
        if words.next().is_some_and(|word| !matches!(word, "R" | "T")) || words.next().is_some() {
            return Err(LineError::Form);
        }
        let (id, data) = frame.split_once('#').ok_or(LineError::Form)?;
        Ok(Self { time_us: microseconds(time)?, interface: interface.into(), frame: frame_of(id, data)? })
    }
}

/// Seconds with decimals to microseconds, without a detour through floating point.
fn microseconds(text: &str) -> Result<u64, LineError> {
    let wrong = || LineError::Time(text.to_owned());
    let (seconds, decimals) = text.split_once('.').unwrap_or((text, ""));
    if seconds.is_empty() || !text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.') || decimals.contains('.') {
        return Err(wrong());
    }
    let kept = decimals.get(..6).unwrap_or(decimals);
    let fraction: u64 = format!("{kept:0<6}").parse().map_err(|_| wrong())?;
    let whole = seconds.parse::<u64>().ok().and_then(|seconds| seconds.checked_mul(1_000_000));
    whole.and_then(|whole| whole.checked_add(fraction)).ok_or_else(wrong)
}

fn frame_of(id_text: &str, data_text: &str) -> Result<AnyFrame, LineError> {
    let wrong = || LineError::Identifier(id_text.to_owned());
    let long = match id_text.len() {
        3 => false,
        8 => true,
        _ => return Err(wrong()),
    };
    let id = u32::from_str_radix(id_text, 16).map_err(|_| wrong())?;
    if id_text.starts_with('+') || id > if long { ERROR_FLAG | 0x1FFF_FFFF } else { 0x7FF } {
        return Err(wrong());
    }
    if long && id & ERROR_FLAG != 0 {
        return Ok(AnyFrame::Error { class: id & !ERROR_FLAG, data: bytes(data_text, 8)? });
    }
    let no_data = || LineError::Data(data_text.to_owned());
    // A length code of 9 to F may follow the eight bytes, or their number; it still means eight.
    let (classic, code) = data_text.split_once('_').map_or((data_text, None), |(data, code)| (data, Some(code)));
    let follows_eight = code.is_none_or(|code| matches!(code.as_bytes(), [b'9' | b'A'..=b'F' | b'a'..=b'f']));
    if let Some(length) = classic.strip_prefix('R') {
        let length = match length.as_bytes() {
            [] => 0,
            [digit @ b'0'..=b'8'] => digit - b'0',
            _ => return Err(no_data()),
        };
        if code.is_some() && length != 8 || !follows_eight {
            return Err(no_data());
        }
        return Ok(AnyFrame::Remote { id, extended: long, length });
    }
    if let Some(rest) = data_text.strip_prefix('#') {
        let (flags, rest) = rest.split_at_checked(1).ok_or_else(no_data)?;
        let flags = u8::from_str_radix(flags, 16).map_err(|_| no_data())?;
        return Ok(AnyFrame::FlexibleRate { id, flags, data: bytes(rest, 64)? });
    }
    let data = bytes(classic, 8)?;
    if code.is_some() && data.len() != 8 || !follows_eight {
        return Err(no_data());
    }
    if long {
        return Ok(AnyFrame::Extended { id, data });
    }
    let frame = u16::try_from(id).ok().and_then(CanId::new).and_then(|id| CanFrame::new(id, &data));
    frame.map(AnyFrame::Data).ok_or_else(wrong)
}

fn bytes(text: &str, most: usize) -> Result<Vec<u8>, LineError> {
    let wrong = || LineError::Data(text.to_owned());
    // Dots between the bytes are allowed in log files.
    let digits: Vec<u32> = text
        .chars()
        .filter(|letter| *letter != '.')
        .map(|letter| letter.to_digit(16).ok_or_else(wrong))
        .collect::<Result<_, _>>()?;
    let (pairs, []) = digits.as_chunks::<2>() else {
        return Err(wrong());
    };
    if pairs.len() > most {
        return Err(LineError::Length { found: pairs.len(), most });
    }
    Ok(pairs.iter().map(|[high, low]| (high << 4 | low) as u8).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<LogLine, LineError> {
        text.parse()
    }

    #[test]
    fn every_kind_of_line_reads_as_it_is_written() {
        for text in [
            "(1436509052.249713) can0 426#88000200",
            "(0000000000.000001) vcan0 404#30",
            "(0000000012.345678) can1 7FF#",
            "(0000000012.345678) can0 123#R",
            "(0000000012.345678) can0 123#R8",
            "(0000000012.345678) can0 12345678#0102030405060708",
            "(0000000012.345678) can0 00000123#R",
            "(0000000012.345678) can0 20000040#0000000000000000",
            "(0000000012.345678) can0 123##1AABBCC",
        ] {
            assert_eq!(read(text).unwrap().to_string(), text);
        }
    }

    #[test]
    fn times_are_exact_and_direction_and_blanks_do_not_matter() {
        assert_eq!(read("(1700000000.123456789)  can0  123#01  T").unwrap().time_us, 1_700_000_000_123_456);
        assert_eq!(read("(3.5) can0 123#01 R\r\n").unwrap().time_us, 3_500_000);
        assert_eq!(read("(7) can0 123#01.02").unwrap().frame.data(), [1, 2]);
        assert_eq!(read("\u{feff}(7) can0 123#01").unwrap().frame.data(), [1]);
    }

    #[test]
    fn a_length_code_above_eight_is_read_as_eight_bytes_and_nothing_else_may_follow() {
        assert_eq!(read("(1.0) can0 123#0102030405060708_B").unwrap().frame.data(), [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(read("(1.0) can0 123#R8_F").unwrap().to_string(), "(0000000001.000000) can0 123#R8");
        for data in ["0102030405060708_", "0102030405060708_8", "0102030405060708_BB", "0102_B", "R8_", "R7_B", "R+8"] {
            let line = format!("(1.0) can0 123#{data}");
            assert_eq!(read(&line), Err(LineError::Data(data.into())), "{line}");
        }
    }

    #[test]
    fn what_is_wrong_with_a_line_is_said() {
        assert_eq!(read(""), Err(LineError::Form));
        assert_eq!(read("can0 123#01"), Err(LineError::Form));
        assert_eq!(read("(1.0) can0 123 01"), Err(LineError::Form));
        assert_eq!(read("(1.0) can0 123#01 X"), Err(LineError::Form));
        assert_eq!(read("(now) can0 123#01"), Err(LineError::Time("now".into())));
        assert_eq!(read("(-1.0) can0 123#01"), Err(LineError::Time("-1.0".into())));
        assert_eq!(read("(1.2.3) can0 123#01"), Err(LineError::Time("1.2.3".into())));
        assert_eq!(read("(99999999999999999999.0) can0 123#"), Err(LineError::Time("99999999999999999999.0".into())));
        assert_eq!(read("(1.0) can0 12#01"), Err(LineError::Identifier("12".into())));
        assert_eq!(read("(1.0) can0 8FF#01"), Err(LineError::Identifier("8FF".into())));
        assert_eq!(read("(1.0) can0 FFFFFFFF#01"), Err(LineError::Identifier("FFFFFFFF".into())));
        assert_eq!(read("(1.0) can0 123#0"), Err(LineError::Data("0".into())));
        assert_eq!(read("(1.0) can0 123#0G"), Err(LineError::Data("0G".into())));
        assert_eq!(read("(1.0) can0 123#010203040506070809"), Err(LineError::Length { found: 9, most: 8 }));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused_and_what_is_read_is_written_alike(text in "\\PC{0,60}") {
            if let Ok(line) = read(&text) {
                prop_assert_eq!(read(&line.to_string()), Ok(line));
            }
        }

        #[test]
        fn any_data_frame_survives(time_us in 0_u64..4_000_000_000_000_000, id in 0_u16..0x800, data in prop::collection::vec(any::<u8>(), 0..9)) {
            let frame = AnyFrame::Data(CanFrame::new(CanId::new(id).unwrap(), &data).unwrap());
            let line = LogLine { time_us, interface: "can0".into(), frame };
            prop_assert_eq!(read(&line.to_string()), Ok(line));
        }
    }
}
