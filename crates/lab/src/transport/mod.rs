//! Ways to a device: anything that carries bytes both ways.
//!
//! A [`Transport`] knows nothing of frames; [`crate::client::Client`] does. Time is the transport's own: the wall
//! clock for real lines, the device's virtual clock for simulators, so that time-outs mean the same for both and
//! nothing in a simulated session depends on how busy the machine is.

mod address;
mod address_error;
pub mod can;
mod options;
mod serial;
mod stream;

use std::time::Duration;

pub use address::Address;
pub use address_error::AddressError;
pub use can::{CanProblem, CanTransport, SocketCan};
pub use options::{BoardOptions, Cancellation, ChipOptions, LineKind, SimulatorKind, SimulatorOptions};
pub use serial::SerialTransport;
pub use stream::StreamTransport;

/// A stream of bytes to and from one device.
pub trait Transport {
    /// Hands bytes over; they are on their way when this returns.
    ///
    /// # Errors
    /// [`TransportError`] if the connection is gone.
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError>;

    /// Appends what arrives to `out`. Returns as soon as something has arrived, or when `timeout` has passed in the
    /// device's time: virtual for simulators, wall clock for real lines.
    ///
    /// # Errors
    /// [`TransportError`] if the connection is gone.
    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError>;

    /// Time of the clock that `timeout` counts on; its zero is arbitrary.
    fn now(&self) -> Duration;

    /// True if that clock is virtual: time passes only inside [`Transport::receive`].
    fn is_virtual(&self) -> bool {
        false
    }
}

/// Why bytes cannot be carried.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// There is nothing at the address.
    #[error("no device at {address}: {cause}")]
    NotFound {
        /// The address.
        address: String,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The device is there but this user may not open it.
    #[error("no permission to open {address}: {cause}")]
    Permission {
        /// The address.
        address: String,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// Another program has the serial port, which is for one alone.
    #[error("{address} is in use by another program")]
    Busy {
        /// The address.
        address: String,
    },
    /// The other end closed the connection, or the cable was pulled.
    #[error("the connection is closed")]
    Closed,
    /// The program at the other end of a socket closed it, or ended.
    #[error("the program that serves the device has closed the connection")]
    HungUp,
    /// The system reports an error on an open connection.
    #[error("the connection failed: {0}")]
    Io(#[source] std::io::Error),
    /// A CAN interface cannot be used.
    #[error(transparent)]
    Can(#[from] CanProblem),
    /// A simulator could not be started or ended unexpectedly.
    #[error("{0}")]
    Other(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl TransportError {
    /// Wraps the error of a simulator.
    pub fn other(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Other(error.into())
    }

    /// Classifies an error of opening `address`.
    fn opening(address: &str, cause: std::io::Error) -> Self {
        let address = address.to_owned();
        if cause.kind() == std::io::ErrorKind::PermissionDenied {
            Self::Permission { address, cause }
        } else {
            Self::NotFound { address, cause }
        }
    }

    /// Classifies an error on an open connection.
    fn open(cause: std::io::Error) -> Self {
        use std::io::ErrorKind;
        match cause.kind() {
            ErrorKind::BrokenPipe
            | ErrorKind::ConnectionReset
            | ErrorKind::ConnectionAborted
            | ErrorKind::NotConnected
            | ErrorKind::UnexpectedEof => Self::Closed,
            _ => Self::Io(cause),
        }
    }
}
