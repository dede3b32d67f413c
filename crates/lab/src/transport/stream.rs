//! `tcp:` and `unix:`: a socket behind which a device or its emulator is.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use super::{Transport, TransportError};

/// Longest time for connecting.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

/// Longest time for handing bytes over before the connection counts as dead.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);

/// The operations of both kinds of socket.
trait Socket: Read + Write + Send {
    /// A zero timeout means none at all to the system, so callers give at least 1 ms.
    fn set_timeout(&self, timeout: Duration) -> std::io::Result<()>;
}

impl Socket for TcpStream {
    fn set_timeout(&self, timeout: Duration) -> std::io::Result<()> {
        self.set_read_timeout(Some(timeout))
    }
}

#[cfg(unix)]
impl Socket for std::os::unix::net::UnixStream {
    fn set_timeout(&self, timeout: Duration) -> std::io::Result<()> {
        self.set_read_timeout(Some(timeout))
    }
}

/// A connected socket.
pub struct StreamTransport {
    socket: Box<dyn Socket>,
    opened: Instant,
}

impl StreamTransport {
    /// Connects to `host:port`.
    ///
    /// # Errors
    /// [`TransportError::NotFound`] if nobody answers there within two seconds.
    pub fn tcp(host_and_port: &str) -> Result<Self, TransportError> {
        let failed = |cause| TransportError::opening(&format!("tcp:{host_and_port}"), cause);
        let mut last = std::io::Error::from(ErrorKind::AddrNotAvailable);
        for address in host_and_port.to_socket_addrs().map_err(failed)? {
            match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
                Ok(socket) => {
                    // A stop request must not wait for more bytes to fill a packet.
                    socket.set_nodelay(true).map_err(failed)?;
                    socket.set_write_timeout(Some(SEND_TIMEOUT)).map_err(failed)?;
                    return Ok(Self { socket: Box::new(socket), opened: Instant::now() });
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }

    /// Connects to the socket at `path`.
    ///
    /// # Errors
    /// [`TransportError::NotFound`] or [`TransportError::Permission`].
    #[cfg(unix)]
    pub fn unix(path: &std::path::Path) -> Result<Self, TransportError> {
        let failed = |cause| TransportError::opening(&format!("unix:{}", path.display()), cause);
        let socket = std::os::unix::net::UnixStream::connect(path).map_err(failed)?;
        socket.set_write_timeout(Some(SEND_TIMEOUT)).map_err(failed)?;
        Ok(Self { socket: Box::new(socket), opened: Instant::now() })
    }

    /// Unix sockets do not exist on this system.
    ///
    /// # Errors
    /// Always [`TransportError::NotFound`].
    #[cfg(not(unix))]
    pub fn unix(path: &std::path::Path) -> Result<Self, TransportError> {
        let cause = std::io::Error::from(ErrorKind::Unsupported);
        Err(TransportError::opening(&format!("unix:{}", path.display()), cause))
    }
}

impl Transport for StreamTransport {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        let sent = self.socket.write_all(bytes).and_then(|()| self.socket.flush());
        sent.map_err(|error| hung_up(TransportError::open(error)))
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        self.socket.set_timeout(timeout.max(Duration::from_millis(1))).map_err(TransportError::open)?;
        read_some(&mut self.socket, out).map_err(hung_up)
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }
}

/// A socket has no cable of its own: who has closed it is a program.
fn hung_up(error: TransportError) -> TransportError {
    if matches!(error, TransportError::Closed) { TransportError::HungUp } else { error }
}

/// One read; a time-out is no error, the end of the stream is.
pub(super) fn read_some(source: &mut dyn Read, out: &mut Vec<u8>) -> Result<(), TransportError> {
    let mut buffer = [0; 4096];
    match source.read(&mut buffer) {
        Ok(0) => Err(TransportError::Closed),
        Ok(count) => {
            out.extend_from_slice(&buffer[..count]);
            Ok(())
        }
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {
            Ok(())
        }
        Err(error) => Err(TransportError::open(error)),
    }
}
