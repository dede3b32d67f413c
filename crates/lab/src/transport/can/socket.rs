//! A CAN interface of Linux (SocketCAN). On other systems opening one says that there are none.

use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use link::can::{DeviceNumber, Direction, filter};
use puck::CanFrame;

use super::{CanPort, CanProblem, TransportError};
use canlog::AnyFrame;

/// Where the kernel tells about its network interfaces.
const INTERFACES: &str = "/sys/class/net";

/// Time for which a queue may stay full before frames count as not leaving.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);

/// Pause before a full queue is tried again: about nine frames leave meanwhile.
const FULL_QUEUE_PAUSE: Duration = Duration::from_millis(1);

/// The kernel's view of an interface before it is opened.
///
/// # Errors
/// [`CanProblem`] if it cannot be used as it is.
fn inspect(interfaces: &Path, interface: &str) -> Result<(), CanProblem> {
    /// `ARPHRD_CAN` of `if_arp.h`.
    const CAN_TYPE: &str = "280";
    /// `IFF_UP` of `if.h`.
    const UP: u32 = 1;
    let tell = |name: &str, item: &str| {
        std::fs::read_to_string(interfaces.join(name).join(item)).ok().map(|text| text.trim().to_owned())
    };
    let known = || {
        let entries = std::fs::read_dir(interfaces).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.retain(|name| tell(name, "type").as_deref() == Some(CAN_TYPE));
        names.sort();
        names
    };
    let interface = interface.to_owned();
    // A name with a slash would lead elsewhere; the kernel allows none.
    if interface.contains('/') || !interfaces.join(&interface).exists() {
        return Err(CanProblem::NoInterface { interface, known: known() });
    }
    if tell(&interface, "type").is_some_and(|kind| kind != CAN_TYPE) {
        return Err(CanProblem::NotCan { interface, known: known() });
    }
    let flags = tell(&interface, "flags").and_then(|text| u32::from_str_radix(text.trim_start_matches("0x"), 16).ok());
    if flags.is_some_and(|flags| flags & UP == 0) {
        return Err(CanProblem::Down { interface });
    }
    // The drivers take the carrier away while the controller is bus-off.
    if tell(&interface, "carrier").as_deref() == Some("0") {
        return Err(CanProblem::BusOff { interface });
    }
    Ok(())
}

/// An open interface.
pub struct SocketCan {
    interface: String,
    #[cfg(target_os = "linux")]
    socket: socketcan::CanSocket,
    opened: Instant,
}

impl SocketCan {
    /// Opens an interface for the link with a device: nothing but its segments is received.
    ///
    /// # Errors
    /// [`TransportError::Can`] with the command that mends it, [`TransportError::Permission`].
    pub fn open_link(interface: &str, device: DeviceNumber) -> Result<Self, TransportError> {
        let (id, mask) = filter(Direction::ToHost, device);
        Self::open(interface, Some((id, mask)))
    }

    /// Opens an interface to listen to everything on it.
    ///
    /// # Errors
    /// As [`SocketCan::open_link`].
    pub fn open_listener(interface: &str) -> Result<Self, TransportError> {
        Self::open(interface, None)
    }

    /// The problem of the open interface, from an error of the system.
    fn failure(&self, cause: std::io::Error) -> TransportError {
        classify(Path::new(INTERFACES), &self.interface, cause)
    }
}

/// The error of an interface in words: what the kernel tells about the interface says more than the number.
fn classify(interfaces: &Path, interface: &str, cause: std::io::Error) -> TransportError {
    /// `EAFNOSUPPORT` and `EPROTONOSUPPORT` of Linux: a kernel without CAN, or without its raw protocol.
    const NO_CAN: [i32; 2] = [97, 93];
    if cause.raw_os_error().is_some_and(|number| NO_CAN.contains(&number)) {
        return CanProblem::Unsupported(cause).into();
    }
    match inspect(interfaces, interface) {
        Err(problem) => problem.into(),
        Ok(()) => TransportError::opening(&format!("can:{interface}"), cause),
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use super::*;
    use socketcan::{CanFilter, CanSocket, EmbeddedFrame, Frame as _, Socket, SocketOptions};

    /// `CAN_EFF_FLAG` and `CAN_RTR_FLAG`: in a mask they demand data frames of eleven bits.
    const FORM: u32 = 0xC000_0000;
    /// `CAN_ERR_BUSOFF` of `can/error.h`.
    const BUS_OFF: u32 = 0x40;
    /// `ENOBUFS`: the queue of the interface is full.
    const QUEUE_FULL: i32 = 105;

    impl SocketCan {
        pub(super) fn open(interface: &str, only: Option<(u16, u16)>) -> Result<Self, TransportError> {
            inspect(Path::new(INTERFACES), interface)?;
            let failed = |cause| classify(Path::new(INTERFACES), interface, cause);
            let socket = CanSocket::open(interface).map_err(failed)?;
            match only {
                Some((id, mask)) => {
                    socket.set_filters(&[CanFilter::new(id.into(), u32::from(mask) | FORM)]).map_err(failed)?;
                    socket.set_error_filter(BUS_OFF).map_err(failed)?;
                }
                None => socket.set_error_filter_accept_all().map_err(failed)?,
            }
            socket.set_recv_timestamp(true).map_err(failed)?;
            socket.set_write_timeout(SEND_TIMEOUT).map_err(failed)?;
            Ok(Self { interface: interface.to_owned(), socket, opened: Instant::now() })
        }

        /// The next frame of any kind and when it came; `None` if none comes within `timeout`.
        ///
        /// # Errors
        /// [`TransportError`] if the interface cannot be used any more.
        pub fn listen(&mut self, timeout: Duration) -> Result<Option<(SystemTime, AnyFrame)>, TransportError> {
            use std::io::ErrorKind;
            // None at all would mean for ever.
            self.socket.set_read_timeout(timeout.max(Duration::from_micros(1))).map_err(|cause| self.failure(cause))?;
            match self.socket.read_frame_with_timestamp() {
                Ok((frame, time)) => Ok(Some((time, any(&frame)))),
                Err(cause)
                    if matches!(cause.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) =>
                {
                    Ok(None)
                }
                Err(cause) => Err(self.failure(cause)),
            }
        }
    }

    fn any(frame: &socketcan::CanFrame) -> AnyFrame {
        let extended = frame.is_extended();
        match frame {
            socketcan::CanFrame::Error(error) => {
                AnyFrame::Error { class: error.error_bits(), data: error.data().to_vec() }
            }
            socketcan::CanFrame::Remote(remote) => {
                AnyFrame::Remote { id: remote.raw_id(), extended, length: remote.dlc() as u8 }
            }
            socketcan::CanFrame::Data(data) => match CanFrame::copy_of(data) {
                Some(frame) => AnyFrame::Data(frame),
                None => AnyFrame::Extended { id: data.raw_id(), data: data.data().to_vec() },
            },
        }
    }

    impl CanPort for SocketCan {
        fn send(&mut self, frame: CanFrame) -> Result<(), TransportError> {
            let frame: socketcan::CanDataFrame =
                frame.convert().ok_or_else(|| TransportError::other("a frame that SocketCAN does not take"))?;
            let started = Instant::now();
            loop {
                let cause = match self.socket.write_frame(&frame) {
                    Ok(()) => return Ok(()),
                    Err(cause) => cause,
                };
                // A full queue is reported at once, whatever the time-out; waiting for room works by trying again.
                let full = cause.raw_os_error() == Some(QUEUE_FULL) || cause.kind() == std::io::ErrorKind::WouldBlock;
                if !full {
                    return Err(self.failure(cause));
                }
                if started.elapsed() >= SEND_TIMEOUT {
                    inspect(Path::new(INTERFACES), &self.interface)?;
                    let seconds = SEND_TIMEOUT.as_secs();
                    return Err(CanProblem::NotSent { interface: self.interface.clone(), seconds }.into());
                }
                std::thread::sleep(FULL_QUEUE_PAUSE);
            }
        }

        fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, TransportError> {
            let deadline = Instant::now() + timeout;
            loop {
                match self.listen(deadline.saturating_duration_since(Instant::now()))? {
                    Some((_, AnyFrame::Data(frame))) => return Ok(Some(frame)),
                    Some((_, AnyFrame::Error { class, .. })) if class & BUS_OFF != 0 => {
                        return Err(CanProblem::BusOff { interface: self.interface.clone() }.into());
                    }
                    Some(_) => {}
                    None => return Ok(None),
                }
            }
        }

        fn now(&self) -> Duration {
            self.opened.elapsed()
        }

        fn is_virtual(&self) -> bool {
            false
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod elsewhere {
    use super::*;

    impl SocketCan {
        pub(super) fn open(_interface: &str, _only: Option<(u16, u16)>) -> Result<Self, TransportError> {
            Err(CanProblem::Unsupported(std::io::ErrorKind::Unsupported.into()).into())
        }

        /// There are no interfaces on this system.
        ///
        /// # Errors
        /// Always.
        pub fn listen(&mut self, _timeout: Duration) -> Result<Option<(SystemTime, AnyFrame)>, TransportError> {
            Err(TransportError::Closed)
        }
    }

    impl CanPort for SocketCan {
        fn send(&mut self, _frame: CanFrame) -> Result<(), TransportError> {
            Err(TransportError::Closed)
        }

        fn receive(&mut self, _timeout: Duration) -> Result<Option<CanFrame>, TransportError> {
            Err(TransportError::Closed)
        }

        fn now(&self) -> Duration {
            self.opened.elapsed()
        }

        fn is_virtual(&self) -> bool {
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interface(folder: &Path, name: &str, items: &[(&str, &str)]) {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        for (item, text) in items {
            std::fs::write(folder.join(name).join(item), format!("{text}\n")).unwrap();
        }
    }

    fn told(folder: &Path, name: &str) -> Result<(), String> {
        inspect(folder, name).map_err(|problem| problem.to_string())
    }

    #[test]
    fn each_thing_that_may_be_wrong_with_an_interface_is_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        interface(folder, "can0", &[("type", "280"), ("flags", "0x400c1"), ("carrier", "1")]);
        interface(folder, "can1", &[("type", "280"), ("flags", "0x40080")]);
        interface(folder, "can2", &[("type", "280"), ("flags", "0x400c1"), ("carrier", "0")]);
        interface(folder, "vcan0", &[("type", "280"), ("flags", "0xc1"), ("carrier", "1")]);
        interface(folder, "eth0", &[("type", "1"), ("flags", "0x1003"), ("carrier", "1")]);
        assert_eq!(told(folder, "can0"), Ok(()));
        assert_eq!(told(folder, "vcan0"), Ok(()));
        assert!(told(folder, "can1").unwrap_err().contains("'can1' is down"));
        assert!(told(folder, "can2").unwrap_err().contains("bus-off"));
        assert!(told(folder, "eth0").unwrap_err().contains("no CAN interface; there is can0, can1, can2, vcan0"));
        assert!(told(folder, "can9").unwrap_err().contains("there is no network interface 'can9'"));
        assert!(told(folder, "../can0").is_err());
    }

    #[test]
    fn a_failure_of_the_system_is_told_as_what_the_interface_shows() {
        let folder = tempfile::tempdir().unwrap();
        interface(folder.path(), "can0", &[("type", "280"), ("flags", "0x400c1"), ("carrier", "1")]);
        interface(folder.path(), "can1", &[("type", "280"), ("flags", "0x40080")]);
        let tell = |name: &str, number| classify(folder.path(), name, std::io::Error::from_raw_os_error(number));
        assert!(matches!(tell("can1", 100), TransportError::Can(CanProblem::Down { .. })), "ENETDOWN");
        assert!(matches!(tell("can0", 97), TransportError::Can(CanProblem::Unsupported(_))), "EAFNOSUPPORT");
        assert!(matches!(tell("can0", 1), TransportError::Permission { .. }), "EPERM");
        assert!(matches!(tell("gone", 19), TransportError::Can(CanProblem::NoInterface { .. })), "ENODEV");
    }
}
