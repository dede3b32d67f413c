//! The files that commands write: one rule for all of them, and a recording that outlives whatever ends it.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use lab::demonstration::{Origin, Played};
use lab::output_file::{self, OutputError, OutputFile};
use lab::primitive_file::PrimitiveFile;

use super::{ErrorCode, Failure, Global, Output};
use lab::client::Client;
use lab::device::Device;
use lab::procedure::CycleWriter;

/// Opens a file to be written; none of `inputs` is replaced, and nothing is without `--force` or a person's yes.
///
/// # Errors
/// It cannot be written, or is there already.
pub(super) fn create(path: &Path, global: &Global, inputs: &[&Path], doing: &str) -> Result<OutputFile, Failure> {
    let mut opened = OutputFile::create(path, global.force, inputs);
    let exists = matches!(opened, Err(OutputError::Exists { .. }));
    if exists && super::ask(global, &format!("{} exists; replace it?", path.display())) {
        opened = OutputFile::create(path, true, inputs);
    }
    opened.map_err(|error| failure(error, doing))
}

/// Makes a folder, and those above it.
///
/// # Errors
/// A file has its name, standard output has it, or the system refuses.
pub(super) fn create_folder(folder: &Path, doing: &str) -> Result<(), Failure> {
    output_file::refuse_standard_output(folder).map_err(|error| failure(error, doing))?;
    std::fs::create_dir_all(folder).map_err(|cause| {
        let doing = format!("{doing}: making the folder {}", folder.display());
        match cause.kind() {
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
                Failure::new(ErrorCode::OutputNotAFile, doing, "a file has that name, or the name of a folder above it")
                    .help("name a folder, or one that does not exist yet")
            }
            _ => Failure::of_file(ErrorCode::FileFailed, doing, cause),
        }
    })
}

/// Fills a file and puts it at its place.
///
/// # Errors
/// The system refuses; nothing is left then.
pub(super) fn fill(mut file: OutputFile, bytes: &[u8], doing: &str) -> Result<(), Failure> {
    let part = file.part().to_owned();
    let written = file.write_all(bytes).map_err(|cause| OutputError::System { file: part.clone(), cause });
    written.and_then(|()| file.commit().map(|_| ())).map_err(|error| {
        // The content is at hand: half of it helps nobody.
        let _ = std::fs::remove_file(&part);
        failure(error, doing)
    })
}

/// The failure of a file that cannot be written.
pub(super) fn failure(error: OutputError, doing: &str) -> Failure {
    Failure::new(error.code(), doing, error)
}

/// A path as text for data: names that are no Unicode are shown as well as can be.
pub(super) fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Where a recording comes from, as its first lines say.
pub(super) fn origin(client: &Client<Device>, file: Option<&PrimitiveFile>) -> Origin {
    let hello = client.hello();
    let simulated = if client.is_simulated() { " (simulated arm)" } else { "" };
    Origin {
        primitive: file.map(|file| Played { name: file.name.clone(), movement: file.movement_checksum() }),
        device: Some(format!("{}{simulated}", hello.board.as_str())),
        firmware: Some(hello.firmware.as_str().to_owned()),
        // Where time is simulated a recording is the same whenever it is made.
        date: (!client.is_virtual()).then(Origin::now),
        ..Origin::default()
    }
}

/// A recording being written. Opened before anything moves; what a failure leaves is kept beside its place.
pub(super) struct RecordingFile {
    /// Where the recorder writes.
    pub(super) file: Counted,
    path: PathBuf,
    doing: &'static str,
}

/// A file that knows how many lines it has.
pub(super) struct Counted {
    file: OutputFile,
    head: usize,
    lines: usize,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.lines += bytes[..count].iter().filter(|byte| **byte == b'\n').count();
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl RecordingFile {
    /// Opens it.
    ///
    /// # Errors
    /// As [`create`].
    pub(super) fn create(path: &Path, global: &Global, inputs: &[&Path], doing: &'static str) -> Result<Self, Failure> {
        let file = Counted { file: create(path, global, inputs, doing)?, head: 0, lines: 0 };
        Ok(Self { file, path: path.to_owned(), doing })
    }

    /// Begins the recording with its notes.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn begin<'a>(&'a mut self, notes: &str) -> std::io::Result<CycleWriter<impl Write + use<'a>>> {
        self.expect_notes(notes);
        CycleWriter::new(&mut self.file, notes)
    }

    /// Says how many lines stand above the first sample.
    pub(super) fn expect_notes(&mut self, notes: &str) {
        self.file.head = notes.lines().count() + 1;
    }

    /// Ends the recording. After a success it is put at its place; after a failure what there is stays beside it, and
    /// the failure names it.
    ///
    /// # Errors
    /// The failure that was given, or the system refuses the file.
    pub(super) fn end<T>(self, outcome: Result<T, Failure>, output: Output) -> Result<T, Failure> {
        let Counted { file, head, lines } = self.file;
        let samples = lines.saturating_sub(head);
        match outcome {
            Ok(value) => {
                let part = file.part().to_owned();
                file.commit().map_err(|error| failure(error, self.doing).kept(part))?;
                output.say(format!("wrote {}", self.path.display()));
                Ok(value)
            }
            Err(failure) if samples > 0 => Err(failure.kept(file.keep())),
            Err(failure) => Err(failure),
        }
    }
}
