//! Where a device is: the text behind `--device` and in `TACTUS_DEVICE`.
//!
//! ```text
//! sim:[options]          the firmware under QEMU, with simulated bus and world
//! sil:[options]          the same application in this process
//! board:[options]        the image for the STM32H743 on an emulated board, with simulated bus and world
//! hand:[options]         the hand image under QEMU, with a hand alone on the simulated bus and something to grip
//! tcp:HOST:PORT          a socket
//! unix:PATH              a Unix socket
//! serial:PORT[@BAUD]     a serial port, 921600 baud unless said otherwise
//! can:INTERFACE[/N]      device number N (0 unless said otherwise) on a CAN interface
//! options: seed=7,arm=7,world=simple|mujoco,line=serial|can,bus=FILE,flash=FILE,faults=FILE, separated by commas;
//! two commas in the name of a FILE are one of it
//! of board: also report=FILE,cancellation=skipped|stuck,revision=0xNNNN,fault=KIND@MICROSECONDS[:ARGUMENT]
//! ```

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use link::can::DeviceNumber;

use super::AddressError;
use super::options::{SimulatorKind, SimulatorOptions};
use super::serial::DEFAULT_BAUD;

/// Where a device is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A simulated device, started on connecting.
    Simulated(SimulatorKind, SimulatorOptions),
    /// `host:port`.
    Tcp(String),
    /// Path of a socket.
    Unix(PathBuf),
    /// A serial port.
    Serial {
        /// Its name, e.g. `/dev/ttyACM0`.
        port: String,
        /// Its speed.
        baud: u32,
    },
    /// A CAN interface of this system.
    Can {
        /// Its name, e.g. `can0`.
        interface: String,
        /// Which of the devices on its bus.
        device: DeviceNumber,
    },
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        if text.contains(char::REPLACEMENT_CHARACTER) {
            return Err(AddressError::NotText(text.to_owned()));
        }
        let (kind, rest) = text.split_once(':').ok_or_else(|| AddressError::Kind(text.to_owned()))?;
        match kind {
            "sim" => simulated(SimulatorKind::Qemu, rest),
            "sil" => simulated(SimulatorKind::InProcess, rest),
            "hand" => simulated(SimulatorKind::Hand, rest),
            "board" => simulated(SimulatorKind::Board, rest),
            "tcp" => match rest.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() => match port.parse::<u16>() {
                    Ok(_) => Ok(Self::Tcp(rest.to_owned())),
                    Err(_) => Err(AddressError::Number(port.to_owned(), u16::MAX.into())),
                },
                _ => Err(AddressError::Incomplete(text.to_owned(), "tcp:localhost:3333")),
            },
            "unix" if rest.is_empty() => Err(AddressError::Incomplete(text.to_owned(), "unix:/run/tactus.sock")),
            "unix" => Ok(Self::Unix(PathBuf::from(rest))),
            "serial" => {
                let (port, baud) = match rest.rsplit_once('@') {
                    Some((port, baud)) => {
                        (port, baud.parse().map_err(|_| AddressError::Number(baud.to_owned(), u32::MAX.into()))?)
                    }
                    None => (rest, DEFAULT_BAUD),
                };
                if port.is_empty() || baud == 0 {
                    return Err(AddressError::Incomplete(text.to_owned(), "serial:/dev/ttyACM0"));
                }
                Ok(Self::Serial { port: port.to_owned(), baud })
            }
            "can" => {
                let (interface, number) = rest.split_once('/').unwrap_or((rest, "0"));
                if interface.is_empty() {
                    return Err(AddressError::Incomplete(text.to_owned(), "can:can0 or can:can0/1"));
                }
                let device = number.parse().ok().and_then(DeviceNumber::new);
                let device = device.ok_or_else(|| AddressError::DeviceNumber(number.to_owned()))?;
                Ok(Self::Can { interface: interface.to_owned(), device })
            }
            _ => Err(AddressError::Kind(text.to_owned())),
        }
    }
}

fn simulated(kind: SimulatorKind, options: &str) -> Result<Address, AddressError> {
    Ok(Address::Simulated(kind, SimulatorOptions::parse(options, kind)?))
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated(kind, options) => {
                f.write_str(match kind {
                    SimulatorKind::Qemu => "sim:",
                    SimulatorKind::InProcess => "sil:",
                    SimulatorKind::Hand => "hand:",
                    SimulatorKind::Board => "board:",
                })?;
                write!(f, "{options}")
            }
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Unix(path) => write!(f, "unix:{}", path.display()),
            Self::Serial { port, baud: DEFAULT_BAUD } => write!(f, "serial:{port}"),
            Self::Serial { port, baud } => write!(f, "serial:{port}@{baud}"),
            Self::Can { interface, device: DeviceNumber::FIRST } => write!(f, "can:{interface}"),
            Self::Can { interface, device } => write!(f, "can:{interface}/{device}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Address, AddressError> {
        text.parse()
    }

    #[test]
    fn every_kind_of_address_reads_as_it_is_written() {
        for text in [
            "sim:",
            "sil:",
            "sim:seed=7,world=simple",
            "sil:seed=7,arm=3,world=simple",
            "sil:world=mujoco",
            "hand:seed=3",
            "tcp:localhost:3333",
            "tcp:[::1]:3333",
            "unix:/run/tactus.sock",
            "serial:/dev/ttyACM0",
            "serial:/dev/ttyACM0@115200",
            "can:can0",
            "can:slcan1/15",
            "sil:seed=3,line=can,bus=run.log",
            "sil:seed=3,faults=tests/faults/a3.toml:2",
            "board:",
            "board:seed=3,flash=bank2.bin,report=board.json,cancellation=stuck,revision=0x1003,fault=bus-off@5000000,fault=hang@7:2",
        ] {
            assert_eq!(parse(text).unwrap().to_string(), text);
        }
        let port = "COM3".to_owned();
        assert_eq!(parse("serial:COM3"), Ok(Address::Serial { port, baud: 921_600 }));
    }

    /// The change that makes it fail: every comma ends an option.
    #[test]
    fn two_commas_in_the_name_of_a_file_are_one_of_it_and_elsewhere_nothing() {
        let text = "board:seed=3,bus=a,,b,flash=,,c,,,,d,faults=e,,f.toml:2,report=g,,";
        let Ok(Address::Simulated(SimulatorKind::Board, options)) = parse(text) else { panic!("{:?}", parse(text)) };
        let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.to_string_lossy().into_owned());
        assert_eq!(path(&options.bus).as_deref(), Some("a,b"));
        assert_eq!(path(&options.flash).as_deref(), Some(",c,,d"));
        assert_eq!(path(&options.board.report).as_deref(), Some("g,"));
        assert_eq!(options.faults.as_deref(), Some("e,f.toml:2"));
        assert_eq!(parse(text).unwrap().to_string(), text);
        assert_eq!(parse("sil:seed=7,,world=simple,"), parse("sil:seed=7,world=simple"));
        let words = parse("sil:flash=a,b").unwrap_err().to_string();
        assert!(words.contains("two commas"), "{words}");
    }

    /// The change that makes it fail: `-` is a name like any other.
    #[test]
    fn no_file_of_a_simulated_device_gets_the_name_of_standard_output() {
        for part in ["flash=-", "bus=-", "report=-"] {
            assert_eq!(parse(&format!("board:{part}")), Err(AddressError::StandardOutput(part.into())));
        }
        assert!(parse("sil:flash=./-,bus=-a").is_ok());
        let mut options = SimulatorOptions::default();
        let refused = options.add_files(SimulatorKind::InProcess, Some(std::path::Path::new("-")), None);
        assert_eq!(refused, Err(AddressError::StandardOutput("flash=-".into())));
    }

    #[test]
    fn bad_addresses_say_what_is_wrong() {
        assert_eq!(parse("/dev/ttyACM0"), Err(AddressError::Kind("/dev/ttyACM0".into())));
        assert_eq!(parse("usb:1"), Err(AddressError::Kind("usb:1".into())));
        assert!(matches!(parse("tcp:localhost"), Err(AddressError::Incomplete(..))));
        assert!(matches!(parse("tcp::80"), Err(AddressError::Incomplete(..))));
        assert_eq!(parse("tcp:localhost:http"), Err(AddressError::Number("http".into(), 65_535)));
        assert!(matches!(parse("unix:"), Err(AddressError::Incomplete(..))));
        assert!(matches!(parse("serial:"), Err(AddressError::Incomplete(..))));
        assert_eq!(parse("serial:COM3@fast"), Err(AddressError::Number("fast".into(), 4_294_967_295)));
        assert!(matches!(parse("can:"), Err(AddressError::Incomplete(..))));
        assert_eq!(parse("can:can0/16"), Err(AddressError::DeviceNumber("16".into())));
        assert_eq!(parse("can:can0/"), Err(AddressError::DeviceNumber(String::new())));
        assert_eq!(parse("sil:line=tin"), Err(AddressError::Option("line=tin".into())));
        assert_eq!(parse("sil:bus="), Err(AddressError::Option("bus=".into())));
        assert_eq!(parse("sil:flash="), Err(AddressError::Option("flash=".into())));
        assert_eq!(parse("sim:speed=2"), Err(AddressError::Option("speed=2".into())));
        assert_eq!(parse("sim:world="), Err(AddressError::Option("world=".into())));
        assert_eq!(parse("sil:seed=1,seed=2"), Err(AddressError::Twice("seed".into())));
        assert_eq!(parse("sil:seed=1,world=simple,seed=1"), Err(AddressError::Twice("seed".into())));
        assert_eq!(parse("board:report=a.json,report=b.json"), Err(AddressError::Twice("report".into())));
        assert_eq!(parse("hand:flash=a.flash"), Err(AddressError::HandOption("flash=a.flash".into())));
        assert_eq!(parse("hand:arm=3"), Err(AddressError::HandOption("arm=3".into())));
        assert_eq!(parse("sim:fault=hang@1"), Err(AddressError::Option("fault=hang@1".into())));
        assert_eq!(parse("sil:report=a.json"), Err(AddressError::Option("report=a.json".into())));
        for part in ["speed=2", "fault=", "report", "cancellation=maybe", "revision=2003", "revision=0x12345"] {
            assert_eq!(parse(&format!("board:seed=1,{part}")), Err(AddressError::BoardOption(part.into())));
        }
        for (text, largest) in
            [("tcp:localhost:99999", "65535"), ("sil:arm=99999999999999999999", "18446744073709551615")]
        {
            let words = parse(text).unwrap_err().to_string();
            assert!(words.contains(&format!("from 0 to {largest}")), "{words}");
        }
        assert!(matches!(parse("unix:/tmp/\u{fffd}.sock"), Err(AddressError::NotText(_))));
        assert_eq!(parse("sim:seed=-1"), Err(AddressError::Number("seed=-1".into(), u64::MAX)));
    }
}
