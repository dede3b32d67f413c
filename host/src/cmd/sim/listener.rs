//! The socket at which `tactus sim` serves an arm.

use std::error::Error;
use std::fs::{File, Metadata, TryLockError};
use std::io::{self, ErrorKind};
use std::net::TcpListener;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lab::transport::{Address, AddressError};

use super::party::Peer;

/// Where an arm can be served.
const PLACES: &str = "listen on unix:PATH or tcp:HOST:PORT";

/// Longest wait for another simulator that looks at the same folder. Whoever keeps it for longer is none.
const KEPT_TIMEOUT: Duration = Duration::from_secs(2);

/// Time between two tries meanwhile.
const TRY: Duration = Duration::from_millis(5);

/// An address that is listened on.
pub(super) enum Listener {
    /// A socket in the file system.
    Unix {
        /// The socket.
        listener: UnixListener,
        /// Its name.
        path: PathBuf,
        /// The file behind that name as this program made it.
        made: Metadata,
    },
    /// A port.
    Tcp(TcpListener),
}

impl Listener {
    /// The address to name, with the port that the system chose where 0 was asked for.
    pub(super) fn address(&self, asked: &str) -> String {
        match self {
            Self::Tcp(listener) => listener.local_addr().map_or(asked.to_owned(), |address| format!("tcp:{address}")),
            Self::Unix { .. } => asked.to_owned(),
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        if let Self::Unix { path, made, .. } = self {
            let _kept = keep_folder(path);
            // Left behind it would only confuse the next one. Somebody may have removed it, and another simulator
            // serves at its place since: that one stays.
            if std::fs::symlink_metadata(&*path).is_ok_and(|found| is_same(&found, made)) {
                let _ = std::fs::remove_file(path);
            }
        }
    }
}

/// True for the same file. A socket that is listened on keeps its number, also when its name is gone.
fn is_same(one: &Metadata, other: &Metadata) -> bool {
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

/// Listens on this address.
///
/// # Errors
/// It is none that an arm can be served at, it is taken, or the system refuses.
pub(super) fn listen(text: &str) -> Result<Listener, Box<dyn Error + Send + Sync>> {
    let address = match text.parse() {
        Err(AddressError::Kind(_)) => return Err(PLACES.into()),
        address => address?,
    };
    match address {
        Address::Unix(path) => {
            let (listener, made) = bind(&path)?;
            listener.set_nonblocking(true)?;
            Ok(Listener::Unix { listener, path, made })
        }
        Address::Tcp(address) => {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            Ok(Listener::Tcp(listener))
        }
        _ => Err(PLACES.into()),
    }
}

/// A socket at this place, where nobody serves.
fn bind(path: &Path) -> io::Result<(UnixListener, Metadata)> {
    let _kept = keep_folder(path);
    let listener = match UnixListener::bind(path) {
        Err(error) if error.kind() == ErrorKind::AddrInUse && is_left_over(path)? => {
            std::fs::remove_file(path)?;
            UnixListener::bind(path)?
        }
        other => other?,
    };
    Ok((listener, std::fs::symlink_metadata(path)?))
}

/// True for a socket nobody answers on: the left-over of a program that was killed. Anything else is somebody's.
fn is_left_over(path: &Path) -> io::Result<bool> {
    let is_socket = std::fs::symlink_metadata(path)?.file_type().is_socket();
    Ok(is_socket && UnixStream::connect(path).is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused))
}

/// Keeps the folder for this program until the file is closed: of two simulators that find a left-over at once, one
/// would remove the new socket of the other, which is also a left-over between its first moment and the next.
fn keep_folder(path: &Path) -> Option<File> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // A file system without locks has none: this is about two that begin in the same moment.
    let file = File::open(folder).ok()?;
    let begun = Instant::now();
    while let Err(TryLockError::WouldBlock) = file.try_lock() {
        if begun.elapsed() > KEPT_TIMEOUT {
            return None;
        }
        std::thread::sleep(TRY);
    }
    Some(file)
}

/// The next one who connects, if there is one.
///
/// # Errors
/// The operating system's reason.
pub(super) fn accept(listener: &Listener) -> io::Result<Option<Box<dyn Peer>>> {
    let accepted: io::Result<Box<dyn Peer>> = match listener {
        Listener::Unix { listener, .. } => listener.accept().and_then(|(stream, _)| {
            stream.set_nonblocking(true)?;
            Ok(Box::new(stream) as Box<dyn Peer>)
        }),
        Listener::Tcp(listener) => listener.accept().and_then(|(stream, _)| {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            Ok(Box::new(stream) as Box<dyn Peer>)
        }),
    };
    match accepted {
        Ok(peer) => Ok(Some(peer)),
        Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixDatagram;
    use std::sync::Barrier;

    use super::*;

    fn address(path: &Path) -> String {
        format!("unix:{}", path.display())
    }

    /// The change that makes it fail: a simulator that ends removes whatever is at its place.
    #[test]
    fn a_simulator_that_ends_leaves_the_socket_of_another_one_at_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arm.sock");
        let first = listen(&address(&path)).unwrap();
        std::fs::remove_file(&path).unwrap();
        let second = listen(&address(&path)).unwrap();
        drop(first);
        assert!(UnixStream::connect(&path).is_ok(), "the second one still serves");
        drop(second);
        assert!(!path.exists(), "its own socket goes with it");
    }

    /// The change that makes it fail: `keep_folder` that keeps nothing.
    #[test]
    fn of_several_that_begin_at_once_over_a_left_over_one_serves() {
        const PROGRAMS: usize = 4;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arm.sock");
        for turn in 0..300 {
            drop(UnixListener::bind(&path).unwrap());
            let barrier = Barrier::new(PROGRAMS);
            let begun: Vec<_> = std::thread::scope(|threads| {
                let begin = || {
                    barrier.wait();
                    listen(&address(&path)).ok()
                };
                let programs: Vec<_> = (0..PROGRAMS).map(|_| threads.spawn(begin)).collect();
                programs.into_iter().filter_map(|program| program.join().unwrap()).collect()
            });
            assert_eq!(begun.len(), 1, "turn {turn}");
            assert!(UnixStream::connect(&path).is_ok(), "turn {turn}: it serves at the place");
        }
    }

    /// The change that makes it fail: every socket that takes no connection counts as left over.
    #[test]
    fn a_socket_of_another_kind_is_somebody_s() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.sock");
        let somebody = UnixDatagram::bind(&path).unwrap();
        assert!(listen(&address(&path)).is_err());
        assert!(UnixDatagram::unbound().unwrap().send_to(b"a", &path).is_ok());
        drop(somebody);
    }
}
