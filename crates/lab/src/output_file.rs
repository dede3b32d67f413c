//! A file that a command writes: opened before anything moves, filled beside its place, put there when it is whole.

use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::error_code::ErrorCode;
use crate::unfinished;

/// Most unfinished files of one name that lie beside it; there are more only if nobody ever looks.
const MOST_UNFINISHED: u32 = 99;

/// Why a file cannot be written.
#[derive(Debug, Error)]
pub enum OutputError {
    /// It is there already.
    #[error("{file} exists", file = file.display())]
    Exists {
        /// The file.
        file: PathBuf,
    },
    /// Something else than a regular file is there.
    #[error("{file} is {found}, not a file that can be replaced", file = file.display())]
    NotAFile {
        /// The place.
        file: PathBuf,
        /// The thing that is there.
        found: &'static str,
    },
    /// The command reads it.
    #[error("{file} is read by this command, and would be replaced", file = file.display())]
    IsInput {
        /// The file.
        file: PathBuf,
    },
    /// The command writes it a second time.
    #[error("{file} is to be written twice by this command", file = file.display())]
    Twice {
        /// The file.
        file: PathBuf,
    },
    /// The operating system refuses.
    #[error("{file}: cannot be written: {cause}", file = file.display())]
    System {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        #[source]
        cause: io::Error,
    },
}

impl OutputError {
    /// Its number.
    #[must_use]
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::Exists { .. } => ErrorCode::WouldReplace,
            Self::NotAFile { .. } => ErrorCode::OutputNotAFile,
            Self::IsInput { .. } | Self::Twice { .. } => ErrorCode::OutputIsInput,
            Self::System { cause, .. } => ErrorCode::of_file(cause).unwrap_or(ErrorCode::FileFailed),
        }
    }
}

impl From<OutputError> for io::Error {
    fn from(error: OutputError) -> Self {
        match error {
            OutputError::System { cause, .. } => cause,
            other => Self::other(other),
        }
    }
}

/// A file being written. Until [`commit`](Self::commit) its bytes are in a file of the same name with `.part` behind
/// it, and what was at its place before is untouched. Dropped without [`keep`](Self::keep) it leaves nothing; a process
/// that is killed leaves the part.
#[derive(Debug)]
pub struct OutputFile {
    target: PathBuf,
    part: PathBuf,
    output: Option<BufWriter<File>>,
    replaces: bool,
}

impl OutputFile {
    /// Opens the part. An existing regular file is accepted only with `force`; none of `inputs` ever is.
    ///
    /// # Errors
    /// [`OutputError`]; nothing was changed.
    pub fn create(target: &Path, force: bool, inputs: &[&Path]) -> Result<Self, OutputError> {
        let system = |cause| OutputError::System { file: target.to_owned(), cause };
        let (place, before) = may_write(target, force, inputs)?;
        if before.as_ref().is_some_and(|before| before.permissions().readonly()) {
            return Err(system(io::ErrorKind::PermissionDenied.into()));
        }
        let (part, file) = open_part(&place).map_err(system)?;
        let this = Self { target: place, part, output: Some(BufWriter::new(file)), replaces: force };
        if let (Some(before), Some(output)) = (before, &this.output) {
            output.get_ref().set_permissions(before.permissions()).map_err(system)?;
        }
        Ok(this)
    }

    /// Puts the file at its place, its bytes on the disk.
    ///
    /// # Errors
    /// [`OutputError`]; what was written so far is in [`part`](Self::part), which stays.
    pub fn commit(mut self) -> Result<PathBuf, OutputError> {
        let result = self.put();
        unfinished::end(&self.part);
        // Whether it is at its place or stays beside it: there is nothing to clear away.
        self.output = None;
        result.map(|()| self.target.clone())
    }

    fn put(&mut self) -> Result<(), OutputError> {
        let system = |cause| OutputError::System { file: self.target.clone(), cause };
        if let Some(output) = &mut self.output {
            output.flush().and_then(|()| output.get_ref().sync_all()).map_err(system)?;
        }
        let (place, before) = inspect(&self.target)?;
        if before.is_some() && !self.replaces {
            return Err(OutputError::Exists { file: place });
        }
        fs::rename(&self.part, &self.target).map_err(system)
    }

    /// Leaves what was written so far beside its place, and says where.
    #[must_use]
    pub fn keep(mut self) -> PathBuf {
        // What the disk did not take is lost; what it took is kept.
        if let Some(mut output) = self.output.take() {
            let _ = output.flush();
        }
        unfinished::end(&self.part);
        self.part.clone()
    }

    /// Where the bytes are until the file is committed.
    #[must_use]
    pub fn part(&self) -> &Path {
        &self.part
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.output.as_mut().map_or(Ok(bytes.len()), |output| output.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(output) = self.output.take() {
            // Its last bytes need not be written any more.
            drop(output.into_parts());
            let _ = fs::remove_file(&self.part);
            unfinished::end(&self.part);
        }
    }
}

/// Refuses files that one command is to write and that are the same, by whatever names.
///
/// # Errors
/// [`OutputError::Twice`]
pub fn apart<'a>(targets: impl IntoIterator<Item = &'a Path>) -> Result<(), OutputError> {
    let mut places = Vec::new();
    for target in targets {
        // Of a file that is not there yet its folder may be.
        let place = target.canonicalize().ok().or_else(|| {
            let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(folder.canonicalize().ok()?.join(target.file_name()?))
        });
        let place = place.unwrap_or_else(|| target.to_owned());
        if places.contains(&place) {
            return Err(OutputError::Twice { file: target.to_owned() });
        }
        places.push(place);
    }
    Ok(())
}

/// Keeps a log for this program until it is closed: two programs at one would each cut off the other's lines.
///
/// # Errors
/// [`io::ErrorKind::ResourceBusy`] if another program writes it, or the operating system's reason.
pub fn lock(log: &File) -> io::Result<()> {
    log.try_lock().map_err(|cause| match cause {
        TryLockError::WouldBlock => io::Error::new(io::ErrorKind::ResourceBusy, "another program writes it"),
        TryLockError::Error(cause) => cause,
    })
}

/// A log that grows at its place, so that others can read it meanwhile.
///
/// # Errors
/// [`OutputError`]; an existing regular file is replaced only with `force`, and none of `inputs` ever is.
pub fn create_log(target: &Path, force: bool, inputs: &[&Path]) -> Result<File, OutputError> {
    let (place, _) = may_write(target, force, inputs)?;
    let opened = OpenOptions::new().write(true).create(true).truncate(false).open(place).and_then(|file| {
        lock(&file)?;
        file.set_len(0)?;
        Ok(file)
    });
    opened.map_err(|cause| OutputError::System { file: target.to_owned(), cause })
}

/// Writes a whole file in one piece: a reader sees the old content or the new, never half of it.
///
/// # Errors
/// [`OutputError`]; what was there before is untouched.
pub fn replace(target: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut output = OutputFile::create(target, true, &[])?;
    output.write_all(bytes).map_err(|cause| OutputError::System { file: target.to_owned(), cause })?;
    let part = output.part().to_owned();
    output.commit().map(|_| ()).inspect_err(|_| {
        // The content is at hand: half of it helps nobody.
        let _ = fs::remove_file(part);
    })
}

/// Refuses a file that another program is to write for this one, as [`OutputFile::create`] does.
///
/// # Errors
/// [`OutputError`]
pub fn refuse(target: &Path, force: bool, inputs: &[&Path]) -> Result<(), OutputError> {
    may_write(target, force, inputs).map(|_| ())
}

/// Refuses the name `-`: elsewhere that is standard output. Whoever wants a file or a folder of that name says `./-`.
///
/// # Errors
/// [`OutputError::NotAFile`]
pub fn refuse_standard_output(target: &Path) -> Result<(), OutputError> {
    match target.as_os_str() == "-" {
        true => Err(OutputError::NotAFile { file: target.to_owned(), found: "standard output" }),
        false => Ok(()),
    }
}

/// The place of a file that may be written, and what is there.
fn may_write(target: &Path, force: bool, inputs: &[&Path]) -> Result<(PathBuf, Option<Metadata>), OutputError> {
    let (place, before) = inspect(target)?;
    if let Some(before) = &before {
        refuse_inputs(target, before, inputs)?;
        if !force {
            return Err(OutputError::Exists { file: target.to_owned() });
        }
    }
    Ok((place, before))
}

/// The place behind links, and what is there.
fn inspect(target: &Path) -> Result<(PathBuf, Option<Metadata>), OutputError> {
    let refused = |found| Err(OutputError::NotAFile { file: target.to_owned(), found });
    refuse_standard_output(target)?;
    match fs::metadata(target) {
        Ok(found) if found.is_file() => {
            let is_link = fs::symlink_metadata(target).is_ok_and(|found| found.is_symlink());
            let place =
                if is_link { target.canonicalize().unwrap_or_else(|_| target.to_owned()) } else { target.to_owned() };
            Ok((place, Some(found)))
        }
        Ok(found) if found.is_dir() => refused("a folder"),
        Ok(_) => refused("a device, a pipe or a socket"),
        Err(cause) if cause.kind() == io::ErrorKind::NotFound => {
            if fs::symlink_metadata(target).is_ok() {
                return refused("a link to nothing");
            }
            if target.file_name().is_none() {
                return refused("no name of a file");
            }
            Ok((target.to_owned(), None))
        }
        Err(cause) => Err(OutputError::System { file: target.to_owned(), cause }),
    }
}

fn refuse_inputs(target: &Path, before: &Metadata, inputs: &[&Path]) -> Result<(), OutputError> {
    let same = |input: &&Path| fs::metadata(input).is_ok_and(|input| is_same(&input, before));
    if inputs.iter().any(same) { Err(OutputError::IsInput { file: target.to_owned() }) } else { Ok(()) }
}

fn is_same(one: &Metadata, other: &Metadata) -> bool {
    (one.dev(), one.ino()) == (other.dev(), other.ino())
}

/// A part that is nobody else's: one that a killed program left holds what was recorded then.
fn open_part(place: &Path) -> io::Result<(PathBuf, File)> {
    let mut taken = io::ErrorKind::AlreadyExists.into();
    for number in 1..=MOST_UNFINISHED {
        let mut part = place.as_os_str().to_owned();
        part.push(if number == 1 { ".part".to_owned() } else { format!(".{number}.part") });
        let part = PathBuf::from(part);
        match unfinished::create(&part) {
            Ok(file) => return Ok((part, file)),
            Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => taken = cause,
            Err(cause) => return Err(cause),
        }
    }
    Err(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_was_there_stays_until_the_new_file_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        fs::write(&file, "old").unwrap();
        assert!(matches!(OutputFile::create(&file, false, &[]), Err(OutputError::Exists { .. })));
        let mut output = OutputFile::create(&file, true, &[]).unwrap();
        output.write_all(b"new").unwrap();
        output.flush().unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"old");
        output.commit().unwrap();
        assert_eq!((fs::read(&file).unwrap(), names(folder.path())), (b"new".to_vec(), vec!["a.csv".to_owned()]));
    }

    #[test]
    fn what_is_given_up_leaves_nothing_and_what_is_kept_stays_beside_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        let mut output = OutputFile::create(&file, false, &[]).unwrap();
        output.write_all(b"never").unwrap();
        drop(output);
        assert!(names(folder.path()).is_empty());
        for part in ["a.csv.part", "a.csv.2.part"] {
            let mut output = OutputFile::create(&file, false, &[]).unwrap();
            output.write_all(part.as_bytes()).unwrap();
            assert_eq!(output.keep(), folder.path().join(part));
        }
        assert_eq!(fs::read(folder.path().join("a.csv.part")).unwrap(), b"a.csv.part");
    }

    #[test]
    fn devices_folders_dead_links_inputs_and_files_without_rights_are_refused_even_by_force() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("input.csv");
        fs::write(&input, "input").unwrap();
        let (link, dead) = (folder.path().join("link.csv"), folder.path().join("dead.csv"));
        fs::hard_link(&input, &link).unwrap();
        std::os::unix::fs::symlink("nowhere", &dead).unwrap();
        for place in [Path::new("/dev/null"), folder.path(), dead.as_path(), Path::new("/dev/.."), Path::new("-")] {
            let refused = OutputFile::create(place, true, &[]);
            assert!(matches!(refused, Err(OutputError::NotAFile { .. })), "{}: {refused:?}", place.display());
        }
        let refused = OutputFile::create(&link, true, &[&input]);
        assert!(matches!(refused, Err(OutputError::IsInput { .. })), "{refused:?}");
        let missing = OutputFile::create(&folder.path().join("no/a.csv"), true, &[]).unwrap_err();
        assert_eq!(missing.code(), ErrorCode::FileMissing, "{missing}");
        let mut rights = fs::metadata(&input).unwrap().permissions();
        rights.set_readonly(true);
        fs::set_permissions(&input, rights).unwrap();
        assert_eq!(OutputFile::create(&input, true, &[]).unwrap_err().code(), ErrorCode::FileNotPermitted);
        assert_eq!(fs::read(&input).unwrap(), b"input");
    }

    #[test]
    fn files_of_one_command_that_are_the_same_by_other_names_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.png"), "").unwrap();
        std::os::unix::fs::symlink("a.png", at("link.png")).unwrap();
        for (one, other, is_same) in [
            ("a.png", "link.png", true),
            ("a.png", "./a.png", true),
            ("new.png", "./new.png", true),
            ("new.png", "a.png", false),
            ("no/new.png", "no/new.png", true),
        ] {
            let result = apart([at(one).as_path(), at("b.png").as_path(), at(other).as_path()]);
            assert_eq!(matches!(result, Err(OutputError::Twice { .. })), is_same, "{one} {other}");
        }
    }

    #[test]
    fn a_link_is_followed_and_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.csv"), folder.path().join("link.csv"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink("a.csv", &link).unwrap();
        replace(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn a_file_that_came_meanwhile_is_not_replaced_and_nothing_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        let mut output = OutputFile::create(&file, false, &[]).unwrap();
        output.write_all(b"mine").unwrap();
        fs::write(&file, "somebody else's").unwrap();
        assert!(matches!(output.commit(), Err(OutputError::Exists { .. })));
        assert_eq!(fs::read(&file).unwrap(), b"somebody else's");
        assert_eq!(fs::read(folder.path().join("a.csv.part")).unwrap(), b"mine");
    }
}
