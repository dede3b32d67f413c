//! Where a device is: the text behind `--device` and in `TACTUS_DEVICE`.
//!
//! ```text
//! sim:[options]          the firmware under QEMU, with simulated bus and world
//! sil:[options]          the same application in this process
//! tcp:HOST:PORT          a socket
//! unix:PATH              a Unix socket
//! serial:PORT[@BAUD]     a serial port, 921600 baud unless said otherwise
//! options: seed=7,world=simple|mujoco, separated by commas
//! ```

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use super::serial::DEFAULT_BAUD;

/// Which simulated device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatorKind {
    /// `sim:`, the firmware image under QEMU.
    Qemu,
    /// `sil:`, the application in this process.
    InProcess,
}

/// Options of a simulated device; the simulator knows which of them it takes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SimulatorOptions {
    /// Seed of all noise; `None` lets the simulator take its own, always the same.
    pub seed: Option<u64>,
    /// Name of the world; `None` is the best one that was built in.
    pub world: Option<String>,
}

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
}

/// Why a text is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// The part before the colon names no kind of device.
    #[error("'{0}' names no kind of device; there are sim:, sil:, tcp:HOST:PORT, unix:PATH and serial:PORT[@BAUD]")]
    Kind(String),
    /// Something is missing behind the colon.
    #[error("'{0}' is incomplete; it should look like {1}")]
    Incomplete(String, &'static str),
    /// An option of a simulator that there is not.
    #[error("simulated devices have the options seed=NUMBER and world=NAME, not '{0}'")]
    Option(String),
    /// A value that is no number.
    #[error("'{0}' is not a whole number")]
    Number(String),
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (kind, rest) = text.split_once(':').ok_or_else(|| AddressError::Kind(text.to_owned()))?;
        match kind {
            "sim" => Ok(Self::Simulated(SimulatorKind::Qemu, options(rest)?)),
            "sil" => Ok(Self::Simulated(SimulatorKind::InProcess, options(rest)?)),
            "tcp" => match rest.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() => match port.parse::<u16>() {
                    Ok(_) => Ok(Self::Tcp(rest.to_owned())),
                    Err(_) => Err(AddressError::Number(port.to_owned())),
                },
                _ => Err(AddressError::Incomplete(text.to_owned(), "tcp:localhost:3333")),
            },
            "unix" if rest.is_empty() => Err(AddressError::Incomplete(text.to_owned(), "unix:/run/tactus.sock")),
            "unix" => Ok(Self::Unix(PathBuf::from(rest))),
            "serial" => {
                let (port, baud) = match rest.rsplit_once('@') {
                    Some((port, baud)) => (port, baud.parse().map_err(|_| AddressError::Number(baud.to_owned()))?),
                    None => (rest, DEFAULT_BAUD),
                };
                if port.is_empty() || baud == 0 {
                    return Err(AddressError::Incomplete(text.to_owned(), "serial:/dev/ttyACM0"));
                }
                Ok(Self::Serial { port: port.to_owned(), baud })
            }
            _ => Err(AddressError::Kind(text.to_owned())),
        }
    }
}

fn options(text: &str) -> Result<SimulatorOptions, AddressError> {
    let mut options = SimulatorOptions::default();
    for part in text.split(',').filter(|part| !part.is_empty()) {
        match part.split_once('=') {
            Some(("seed", value)) => {
                options.seed = Some(value.parse().map_err(|_| AddressError::Number(value.to_owned()))?);
            }
            Some(("world", value)) if !value.is_empty() => options.world = Some(value.to_owned()),
            _ => return Err(AddressError::Option(part.to_owned())),
        }
    }
    Ok(options)
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Simulated(kind, options) => {
                f.write_str(match kind {
                    SimulatorKind::Qemu => "sim:",
                    SimulatorKind::InProcess => "sil:",
                })?;
                let seed = options.seed.map(|seed| format!("seed={seed}"));
                let world = options.world.as_ref().map(|world| format!("world={world}"));
                let parts: Vec<String> = [seed, world].into_iter().flatten().collect();
                f.write_str(&parts.join(","))
            }
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Unix(path) => write!(f, "unix:{}", path.display()),
            Self::Serial { port, baud: DEFAULT_BAUD } => write!(f, "serial:{port}"),
            Self::Serial { port, baud } => write!(f, "serial:{port}@{baud}"),
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
            "sil:world=mujoco",
            "tcp:localhost:3333",
            "tcp:[::1]:3333",
            "unix:/run/tactus.sock",
            "serial:/dev/ttyACM0",
            "serial:/dev/ttyACM0@115200",
        ] {
            assert_eq!(parse(text).unwrap().to_string(), text);
        }
        let port = "COM3".to_owned();
        assert_eq!(parse("serial:COM3"), Ok(Address::Serial { port, baud: 921_600 }));
    }

    #[test]
    fn bad_addresses_say_what_is_wrong() {
        assert_eq!(parse("/dev/ttyACM0"), Err(AddressError::Kind("/dev/ttyACM0".into())));
        assert_eq!(parse("usb:1"), Err(AddressError::Kind("usb:1".into())));
        assert!(matches!(parse("tcp:localhost"), Err(AddressError::Incomplete(..))));
        assert!(matches!(parse("tcp::80"), Err(AddressError::Incomplete(..))));
        assert_eq!(parse("tcp:localhost:http"), Err(AddressError::Number("http".into())));
        assert!(matches!(parse("unix:"), Err(AddressError::Incomplete(..))));
        assert!(matches!(parse("serial:"), Err(AddressError::Incomplete(..))));
        assert_eq!(parse("serial:COM3@fast"), Err(AddressError::Number("fast".into())));
        assert_eq!(parse("sim:speed=2"), Err(AddressError::Option("speed=2".into())));
        assert_eq!(parse("sim:world="), Err(AddressError::Option("world=".into())));
        assert_eq!(parse("sim:seed=-1"), Err(AddressError::Number("-1".into())));
    }
}
