//! `serial:`: the board's UART.

use std::time::{Duration, Instant};

use super::stream::read_some;
use super::{Transport, TransportError};

/// Speed of the board's UART, baud.
pub(super) const DEFAULT_BAUD: u32 = 921_600;

/// An open serial port, 8N1 without flow control.
pub struct SerialTransport {
    port: Box<dyn serialport::SerialPort>,
    opened: Instant,
}

impl SerialTransport {
    /// Opens `path` at `baud`.
    ///
    /// # Errors
    /// [`TransportError::NotFound`], [`TransportError::Permission`] or [`TransportError::Busy`], told apart because
    /// their remedies differ.
    pub fn open(path: &str, baud: u32) -> Result<Self, TransportError> {
        let port = serialport::new(path, baud)
            .timeout(Duration::from_millis(10))
            .open()
            .map_err(|error| unopened(path, error))?;
        Ok(Self { port, opened: Instant::now() })
    }
}

/// Why a port could not be opened.
fn unopened(path: &str, error: serialport::Error) -> TransportError {
    use serialport::ErrorKind;
    let address = format!("serial:{path}");
    let is_there = std::path::Path::new(path).exists();
    match error.kind {
        // What is there and has "no device" could not be locked.
        ErrorKind::NoDevice if is_there => TransportError::Busy { address },
        ErrorKind::Unknown if is_there => {
            TransportError::opening(&address, std::io::Error::other(format!("it is no serial port ({error})")))
        }
        _ => TransportError::opening(&address, error.into()),
    }
}

impl Transport for SerialTransport {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        use std::io::Write as _;
        // The port's time-out holds for writing too; the last reading may have left a very short one.
        self.port.set_timeout(Duration::from_secs(1)).map_err(|error| TransportError::open(error.into()))?;
        self.port.write_all(bytes).map_err(TransportError::open)
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        let timeout = timeout.max(Duration::from_millis(1));
        self.port.set_timeout(timeout).map_err(|error| TransportError::open(error.into()))?;
        read_some(&mut self.port, out)
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }
}
