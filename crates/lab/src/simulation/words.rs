//! The standard error of a process, kept for the case that it ends by itself.

use std::fs::File;
use std::io::{Read, Write};
use std::process::ChildStderr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Bytes that are kept.
const KEPT: usize = 4096;

/// The thread that reads, and what it keeps.
pub(super) struct Words {
    reader: Option<JoinHandle<()>>,
    kept: Arc<Mutex<Vec<u8>>>,
}

impl Words {
    /// Reads until the process closes the stream; everything goes to `file` as well, if there is one.
    ///
    /// The stream must be drained while the process runs, or it would block on a full pipe, and with it virtual time.
    pub(super) fn of(mut stderr: ChildStderr, mut file: Option<File>) -> Self {
        let kept = Arc::new(Mutex::new(Vec::new()));
        let keeper = Arc::clone(&kept);
        let reader = std::thread::spawn(move || {
            let mut buffer = [0; 1024];
            while let Ok(count @ 1..) = stderr.read(&mut buffer) {
                if let Some(file) = &mut file {
                    // A full disk must not stop the arm; the log is then short.
                    let _ = file.write_all(&buffer[..count]);
                }
                let mut words = keeper.lock().unwrap_or_else(PoisonError::into_inner);
                words.extend_from_slice(&buffer[..count]);
                let surplus = words.len().saturating_sub(KEPT);
                words.drain(..surplus);
            }
        });
        Self { reader: Some(reader), kept }
    }

    /// The last bytes of all, once the process has ended.
    pub(super) fn last(&mut self) -> Vec<u8> {
        self.finish();
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn finish(&mut self) {
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

impl Drop for Words {
    /// The file is complete when this returns. The process must have ended.
    fn drop(&mut self) {
        self.finish();
    }
}
