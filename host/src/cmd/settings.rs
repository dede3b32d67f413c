//! `tactus config get, set, dump, diff, restore`: what the device keeps of its arm, by name and as a file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use link::HomeSource;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, Table, connection, files, storage};
use lab::client::Client;
use lab::device::Device;
use lab::error::{Capability, HostError};
use lab::input_file;
use lab::quoted;
use lab::settings::{self, Change, Key, Setting, Settings, SettingsFile, WriteError};

/// Actions on the settings that the device keeps.
#[derive(Debug, Clone, Subcommand)]
pub enum Action {
    /// Show settings of the device, all of them without a name
    Get(Get),
    /// Change settings of the device; each is read back
    Set(Set),
    /// Write all settings of the device as TOML; comments of a file that is replaced stay
    Dump(Dump),
    /// Compare the settings of the device with a file; ends with 6 if they differ
    Diff(FileOf),
    /// Have the device keep the settings of a file, and show what has changed; those of another arm need `--force`
    Restore(FileOf),
}

/// Which settings to show.
#[derive(Debug, Clone, Args)]
pub struct Get {
    /// Names such as `home.joint_4_rad`
    #[arg(value_name = "NAME")]
    pub names: Vec<String>,
}

/// Which settings to change.
#[derive(Debug, Clone, Args)]
pub struct Set {
    /// Names and values, such as `home.joint_4_rad=3.1`; `home.stored=false` forgets the home
    #[arg(value_name = "NAME=VALUE", required = true)]
    pub changes: Vec<String>,
}

/// Where the settings go.
#[derive(Debug, Clone, Args)]
pub struct Dump {
    /// The file, TOML; standard output if it is not given
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// A file of settings.
#[derive(Debug, Clone, Args)]
pub struct FileOf {
    /// The file, as `tactus config dump` writes it
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
}

/// Data of `tactus --json config get` and `dump`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Kept {
    /// Serial number of the device.
    pub serial: String,
    /// Hash of the robot model that the settings are for, hexadecimal.
    pub model: String,
    /// Settings by name, sorted; `null`: the device stores none, the robot model's counts.
    pub settings: BTreeMap<String, Option<Setting>>,
    /// The file that was written; `null`: none.
    pub file: Option<String>,
}

/// One setting that has changed, or differs.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Changed {
    /// Its name.
    pub key: String,
    /// Value in the device before; `null`: none is stored.
    pub before: Option<Setting>,
    /// Value afterwards, or in the file; `null`: none is stored.
    pub after: Option<Setting>,
}

/// Data of `tactus --json config set`, `diff` and `restore`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Compared {
    /// Serial number of the device.
    pub serial: String,
    /// Settings that have changed, or differ, sorted by name.
    pub changes: Vec<Changed>,
    /// Settings of the device that the file does not name; they keep their values.
    pub missing: Vec<String>,
}

/// Does what the command line asks for.
///
/// # Errors
/// The device cannot be reached or refuses; the file cannot be used; device and file differ.
pub(super) fn run(action: &Action, global: &Global) -> Result<(), Failure> {
    match action {
        Action::Get(command) => get(command, global),
        Action::Set(command) => set(command, global),
        Action::Dump(command) => dump(command, global),
        Action::Diff(command) => diff(&command.file, global),
        Action::Restore(command) => restore(&command.file, global),
    }
}

fn connect(global: &Global, doing: &'static str) -> Result<(Client<Device>, Settings), Failure> {
    let mut client = connection::open(global, doing, |_| {})?;
    client.require(Capability::Arm).map_err(|error| error.into_failure(doing))?;
    let settings = Settings::of_device(&mut client).map_err(|error| error.into_failure(doing))?;
    let missed = missed(&mut client).map_err(|error| error.into_failure(doing))?;
    if !missed.is_empty() {
        global.output().warn(format!(
            "{}: what the device was told last is lost, damaged or for another robot model; here there is none, or the \
             one of before, and a file that is written now tells the same",
            missed.join(", ")
        ));
    }
    Ok((client, settings))
}

/// Settings that count as none, or as those of before, because the newest cannot be used.
fn missed(client: &mut Client<Device>) -> Result<Vec<&'static str>, HostError> {
    let lost = storage::ask(client)?.map_or(Vec::new(), |storage| storage.settings_lost);
    let sources = [("home", client.calibration()?.source), ("weight", client.weight()?.source)];
    let is_missed = |(name, source): &(&str, HomeSource)| {
        lost.contains(name) || matches!(source, HomeSource::Damaged | HomeSource::Foreign)
    };
    Ok(sources.into_iter().filter(is_missed).map(|(name, _)| name).collect())
}

fn get(command: &Get, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "config get";
    let named = command.names.iter().map(|name| name.parse().map_err(|error| unknown(error, DOING)));
    let named = named.collect::<Result<Vec<Key>, Failure>>()?;
    let (client, settings) = connect(global, DOING)?;
    let shown = if named.is_empty() { Key::all() } else { named };
    let lines: Vec<String> = shown.iter().map(|key| format!("{key} = {}", words(settings.get(*key)))).collect();
    global.output().result(&kept(&client, &settings, &shown, None), lines.join("\n"))
}

fn set(command: &Set, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "config set";
    let changes = command.changes.iter().map(|change| {
        let (name, value) = change.split_once('=').ok_or_else(|| {
            let failure = unknown(format!("'{change}' has no `=`"), DOING);
            match change.parse::<Key>() {
                Ok(key) => failure.help(format!("`tactus config set {key}=VALUE`; `tactus config get {key}` shows it")),
                Err(_) => failure,
            }
        })?;
        let key = name.trim().parse::<Key>().map_err(|error| unknown(error, DOING))?;
        let value = value.trim().parse().map_err(|error| unknown(format!("{key}: '{value}' is {error}"), DOING))?;
        Ok((key, value))
    });
    let changes = changes.collect::<Result<Vec<(Key, Setting)>, Failure>>()?;
    let twice =
        changes.iter().enumerate().find(|(at, (key, _))| changes[..*at].iter().any(|(earlier, _)| earlier == key));
    if let Some((_, (key, _))) = twice {
        let cause = format!("'{key}' is given twice; one of the two would be ignored");
        return Err(unknown(cause, DOING).help("give each setting once"));
    }
    let (mut client, before) = connect(global, DOING)?;
    let after = before.with(&changes).map_err(|error| unknown(error, DOING))?;
    write(&mut client, &before, &after, Vec::new(), global, DOING)
}

fn dump(command: &Dump, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "config dump";
    let opened = command.output.as_deref().map(|path| {
        let file = files::create(path, global, &[], DOING)?;
        let before = path.exists().then(|| read_text(path, DOING)).transpose()?;
        Ok((file, path, before))
    });
    let opened = opened.transpose()?;
    let (client, settings) = connect(global, DOING)?;
    let hello = client.hello();
    let before = opened.as_ref().and_then(|(_, _, before)| before.as_deref());
    let text = settings::settings_text(&settings, hello.serial.as_str(), hello.model_hash, before)
        .map_err(|error| Failure::new(ErrorCode::SettingsInvalid, DOING, error).help("name another file"))?;
    let Some((file, path, _)) = opened else {
        return global.output().result(&kept(&client, &settings, &Key::all(), None), text);
    };
    files::fill(file, text.as_bytes(), DOING)?;
    let data = kept(&client, &settings, &Key::all(), Some(path));
    global.output().result(&data, format!("wrote {}", path.display()))
}

fn diff(path: &Path, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "config diff";
    let file = read(path, DOING)?;
    let (client, before) = connect(global, DOING)?;
    let (after, missing) = merged(&file, path, &client, &before, DOING)?;
    let data = compared(&client, &before.changes(&after), missing);
    let other = client.hello().serial.as_str() != file.serial;
    if other {
        global.output().warn(format!("{} is of the device '{}'", path.display(), file.serial));
    }
    if data.changes.is_empty() {
        return global.output().result(&data, format!("no difference{}", rest(&data)));
    }
    let mut count = format!("{} settings differ", data.changes.len());
    if data.changes.len() == 1 {
        count = "1 setting differs".to_owned();
    }
    global.output().say(format!("{}{}", table(&data, "device", "file").to_string().trim_end(), rest(&data)));
    let failure = Failure::new(ErrorCode::SettingsDiffer, DOING, count);
    Err(failure.data(serde_json::json!(data)).help(format!("`tactus config restore {}`", quoted::path(path))))
}

fn restore(path: &Path, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "config restore";
    let file = read(path, DOING)?;
    let (mut client, before) = connect(global, DOING)?;
    let (after, missing) = merged(&file, path, &client, &before, DOING)?;
    let serial = client.hello().serial.as_str().to_owned();
    if serial != file.serial && !global.force {
        let what = format!("{} is of the device '{}', this is '{serial}'", path.display(), file.serial);
        let again = format!("`tactus config restore {} --force`", quoted::path(path));
        return Err(Failure::new(ErrorCode::SettingsOfOthers, DOING, what)
            .help(format!("calibrate this arm; if it is the same arm with another board: {again}")));
    }
    write(&mut client, &before, &after, missing, global, DOING)
}

/// The settings that device and file have together, and what the file leaves out.
fn merged(
    file: &SettingsFile,
    path: &Path,
    client: &Client<Device>,
    before: &Settings,
    doing: &str,
) -> Result<(Settings, Vec<Key>), Failure> {
    let model = settings::model_text(client.hello().model_hash);
    if file.model != model {
        let what = format!("{} is for the robot model {}, the device has {model}", path.display(), file.model);
        return Err(Failure::new(ErrorCode::SettingsModel, doing, what));
    }
    let after = before.with(&file.values).map_err(|error| invalid(error, path, doing))?;
    Ok((after, file.missing(before)))
}

/// Has the device keep the settings, and shows what has changed.
fn write(
    client: &mut Client<Device>,
    before: &Settings,
    after: &Settings,
    missing: Vec<Key>,
    global: &Global,
    doing: &'static str,
) -> Result<(), Failure> {
    if let Err(error) = after.write(client) {
        let failure = match error {
            WriteError::Impossible(error) => unknown(error, doing),
            WriteError::Device(error) => error.into_failure(doing),
            WriteError::OtherPayload { .. } => Failure::new(ErrorCode::WeightOfOtherPayload, doing, error),
            WriteError::ReadBack(_) => Failure::new(ErrorCode::SettingsNotKept, doing, error),
        };
        // What was kept before the failure is told, if the device still answers.
        let Ok(kept) = Settings::of_device(client) else {
            global.output().say("whether the device keeps the new settings `tactus config get` tells");
            return Err(failure);
        };
        return Err(failure.data(serde_json::json!(compared(client, &before.changes(&kept), Vec::new()))));
    }
    let changes = before.changes(after);
    let changed = |wanted: Key| changes.iter().any(|change| change.key.stored() == wanted);
    // The settings are kept and read back: what is only told beside them fails nothing.
    if changed(Key::HomeStored) && client.status().is_ok_and(|status| status.zeroed) {
        global.output().say("the arm still counts from its old zero: emergency stop, bring it home, zero it again");
    }
    if changed(Key::WeightStored) {
        global.output().say("the new weight counts when the arm has no torque next");
    }
    let data = compared(client, &changes, missing);
    if data.changes.is_empty() {
        return global.output().result(&data, format!("nothing to change{}", rest(&data)));
    }
    global.tell_forgotten();
    let text = format!("{}stored in the device, and read back{}", table(&data, "before", "now"), rest(&data));
    global.output().result(&data, text)
}

fn table(data: &Compared, before: &str, after: &str) -> Table {
    let mut table = Table::new(["setting", before, after]);
    for change in &data.changes {
        table.row([change.key.clone(), words(change.before), words(change.after)]);
    }
    table
}

/// The words for settings that a file leaves out.
fn rest(data: &Compared) -> String {
    match data.missing.as_slice() {
        [] => String::new(),
        missing => format!("\nnot in the file, so not changed: {}", missing.join(", ")),
    }
}

fn words(value: Option<Setting>) -> String {
    value.map_or_else(|| "(the robot model's)".to_owned(), |value| value.to_string())
}

fn kept(client: &Client<Device>, settings: &Settings, shown: &[Key], file: Option<&Path>) -> Kept {
    Kept {
        serial: client.hello().serial.as_str().to_owned(),
        model: settings::model_text(client.hello().model_hash),
        settings: shown.iter().map(|key| (key.to_string(), settings.get(*key))).collect(),
        file: file.map(files::text),
    }
}

fn compared(client: &Client<Device>, changes: &[Change], missing: Vec<Key>) -> Compared {
    let changed = |change: &Change| Changed { key: change.key.to_string(), before: change.before, after: change.after };
    Compared {
        serial: client.hello().serial.as_str().to_owned(),
        changes: changes.iter().map(changed).collect(),
        missing: missing.iter().map(Key::to_string).collect(),
    }
}

fn read_text(path: &Path, doing: &str) -> Result<String, Failure> {
    input_file::read_text(path).map_err(|cause| {
        if cause.kind() == std::io::ErrorKind::InvalidData {
            return invalid(cause, path, doing);
        }
        Failure::of_file(ErrorCode::FileFailed, format!("{doing}: {}", path.display()), cause)
    })
}

fn read(path: &Path, doing: &str) -> Result<SettingsFile, Failure> {
    SettingsFile::parse(&read_text(path, doing)?).map_err(|error| invalid(error, path, doing))
}

fn invalid(error: impl std::fmt::Display, path: &Path, doing: &str) -> Failure {
    Failure::new(ErrorCode::SettingsInvalid, doing, format!("{}: {error}", path.display()))
}

fn unknown(error: impl std::fmt::Display, doing: &str) -> Failure {
    Failure::new(ErrorCode::UnknownSetting, doing, error.to_string())
}
