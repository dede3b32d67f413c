//! The image's log: what it puts into its ring buffer for a debug probe, read as a probe reads it.

use std::fs::File;
use std::io::Write;

use rigless::emulator::Host;
use rigless::soc::Width;

/// Offsets in the control block, which has one channel.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITE: u64 = 36;
const READ: u64 = 40;

/// "SEGG", the beginning of the control block's mark.
const MARK: u64 = 0x4747_4553;

/// Longest buffer believed.
const MOST_LINE_BYTES: u64 = 1 << 20;

/// Where the log goes: a file, and memory for tests and last words.
#[derive(Debug, Default)]
pub struct Log {
    /// Address of the control block.
    control: u32,
    file: Option<File>,
    /// Everything read so far.
    pub bytes: Vec<u8>,
}

impl Log {
    /// Reads the buffer whose control block is here.
    #[must_use]
    pub fn new(control: u32, file: Option<File>) -> Self {
        Self { control, file, bytes: Vec::new() }
    }

    /// Takes what is new, and tells the image where it was read to.
    pub fn drain(&mut self, host: &mut dyn Host) {
        let at = |offset: u64| u64::from(self.control) + offset;
        let mut word = |address: u64| host.read(address, Width::W32).unwrap_or(0);
        if word(at(0)) != MARK {
            return;
        }
        let (buffer, size, write) = (word(at(BUFFER)), word(at(SIZE)), word(at(WRITE)));
        let mut read = word(at(READ));
        if size == 0 || size > MOST_LINE_BYTES || write >= size || read >= size || read == write {
            return;
        }
        let from = self.bytes.len();
        while read != write {
            self.bytes.push(host.read(buffer + read, Width::W8).unwrap_or(0) as u8);
            read = (read + 1) % size;
        }
        // A block that cannot be written is one that is not there.
        let _ = host.write(at(READ), Width::W32, read);
        if let Some(file) = &mut self.file
            && file.write_all(self.bytes.get(from..).unwrap_or(&[])).is_err()
        {
            eprintln!("the log's file cannot be written; the log goes nowhere from here on");
            self.file = None;
        }
    }
}
