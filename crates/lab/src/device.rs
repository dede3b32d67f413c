//! The device behind an address, opened: one type for simulated and real ones.

use std::time::Duration;

use link::can::DeviceNumber;

use crate::simulation::{BoardCan, Engine, SimulatedCan, Simulation, SimulationError, SimulationOptions};
use crate::transport::{
    Address, CanTransport, LineKind, SerialTransport, SocketCan, StreamTransport, Transport, TransportError,
};

/// A way to a device that is simulated here, or reached over a line.
pub enum Device {
    /// Simulated in or below this process, in virtual time.
    Simulated(Box<Simulation>),
    /// The same, its host link on a simulated CAN bus.
    SimulatedCan(Box<CanTransport<SimulatedCan>>),
    /// Simulated, its host link on the bus inside the emulated board.
    BoardCan(Box<CanTransport<BoardCan>>),
    /// At the other end of a socket.
    Stream(StreamTransport),
    /// At the other end of a serial line.
    Serial(SerialTransport),
    /// On a CAN bus.
    Can(Box<CanTransport<SocketCan>>),
    /// Over a line of the caller's own.
    Own(Box<dyn Transport + Send>),
}

/// Why a device cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The line cannot be opened.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The simulation cannot be started.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}

impl Device {
    /// Opens the device at `address`. A simulated one boots; `adjust` may change how it is set up before.
    ///
    /// # Errors
    /// [`OpenError`]
    pub fn open(address: &Address, adjust: impl FnOnce(&mut SimulationOptions)) -> Result<Self, OpenError> {
        Ok(match address {
            Address::Simulated(kind, options) => {
                let mut options = SimulationOptions::from_address(*kind, options)?;
                adjust(&mut options);
                let simulation = Simulation::start(&options)?;
                match (options.line, &options.engine) {
                    (LineKind::Serial, _) => Self::Simulated(Box::new(simulation)),
                    (LineKind::Can, Engine::Board(_)) => {
                        let port = BoardCan::new(simulation);
                        Self::BoardCan(Box::new(CanTransport::new(port, DeviceNumber::FIRST)))
                    }
                    (LineKind::Can, _) => {
                        let port = SimulatedCan::attach(simulation, DeviceNumber::FIRST);
                        Self::SimulatedCan(Box::new(CanTransport::new(port, DeviceNumber::FIRST)))
                    }
                }
            }
            Address::Tcp(address) => Self::Stream(StreamTransport::tcp(address)?),
            Address::Unix(path) => Self::Stream(StreamTransport::unix(path)?),
            Address::Serial { port, baud } => Self::Serial(SerialTransport::open(port, *baud)?),
            Address::Can { interface, device } => {
                Self::Can(Box::new(CanTransport::new(SocketCan::open_link(interface, *device)?, *device)))
            }
        })
    }

    /// Most that the line carries, byte/s, where that is known whatever the adapter: on a CAN bus.
    pub fn line_rate(&self) -> Option<f64> {
        matches!(self, Self::Can(_) | Self::SimulatedCan(_) | Self::BoardCan(_))
            .then_some(link::can::LINE_BYTES_PER_SECOND)
    }

    fn line(&self) -> &dyn Transport {
        match self {
            Self::Simulated(device) => &**device,
            Self::SimulatedCan(device) => &**device,
            Self::BoardCan(device) => &**device,
            Self::Stream(device) => device,
            Self::Serial(device) => device,
            Self::Can(device) => &**device,
            Self::Own(device) => &**device,
        }
    }

    fn line_mut(&mut self) -> &mut dyn Transport {
        match self {
            Self::Simulated(device) => &mut **device,
            Self::SimulatedCan(device) => &mut **device,
            Self::BoardCan(device) => &mut **device,
            Self::Stream(device) => device,
            Self::Serial(device) => device,
            Self::Can(device) => &mut **device,
            Self::Own(device) => &mut **device,
        }
    }

    /// The simulation, if it is one.
    pub fn simulation(&mut self) -> Option<&mut Simulation> {
        match self {
            Self::Simulated(simulation) => Some(simulation),
            Self::SimulatedCan(device) => Some(device.port().simulation()),
            Self::BoardCan(device) => Some(device.port().simulation()),
            Self::Stream(_) | Self::Serial(_) | Self::Can(_) | Self::Own(_) => None,
        }
    }
}

impl Transport for Device {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.line_mut().send(bytes)
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        self.line_mut().receive(timeout, out)
    }

    fn now(&self) -> Duration {
        self.line().now()
    }

    fn is_virtual(&self) -> bool {
        self.line().is_virtual()
    }
}
