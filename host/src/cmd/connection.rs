//! From the options of the command line to a conversation with a device.

use std::io::ErrorKind;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use control::Fault;
use device::{HandFailure, Stage};
use link::{HandStage, HomeSource, Refusal, Secret, SecretState, Status};
use signal_hook::iterator::Signals;

use super::{ErrorCode, Failure, Global, Output, interruption};
use lab::client::{Client, Halted, Interrupt};
use lab::device::{Device, OpenError};
use lab::error::{HostError, explain_blocked};
use lab::fault_guide::FaultGuide;
use lab::procedure::{self, ProcedureError, Readiness, StartupLook};
use lab::quoted;
use lab::secret_file::{self, SecretFileError};
use lab::simulation::{SimulationError, SimulationOptions};
use lab::startup_guide::{blocked_remedy, stage_remedy};
use lab::transport::{Address, TransportError};

/// Two signals within this time are one.
const SAME_SIGNAL: Duration = Duration::from_millis(500);

/// Opens the device that the options name and says hello. Ctrl-C then stops the arm and ends the command.
///
/// # Errors
/// No device is named, it is not there, does not answer, or does not fit this tool.
pub(super) fn open(
    global: &Global,
    doing: &str,
    adjust: impl FnOnce(&mut SimulationOptions),
) -> Result<Client<Device>, Failure> {
    let (device, owner) = reach(global, doing, adjust)?;
    let client = Client::connect(device, &owner).map_err(|error| error.into_failure(doing))?;
    let mut client = set_up(client, global);
    prove(&mut client, global, doing)?;
    Ok(client)
}

/// As [`open`], for whoever is going to change the secret of the device: that there is none is no warning.
///
/// # Errors
/// As [`open`]; the secret that is named is not that of the device, or its file cannot be read.
pub(super) fn open_to_change_secret(global: &Global, doing: &str) -> Result<Client<Device>, Failure> {
    let (device, owner) = reach(global, doing, |_| {})?;
    let client = Client::connect(device, &owner).map_err(|error| error.into_failure(doing))?;
    let mut client = set_up(client, global);
    if let Some(file) = &global.secret_file {
        let secret = read_secret(file, global.output()).map_err(|error| secret_failure(file, error, doing))?;
        client.unlock(&secret).map_err(|error| error.into_failure(doing))?;
    }
    Ok(client)
}

/// Reads the secret in a file, and warns where it is none to others.
///
/// # Errors
/// The file cannot be read, is none, or holds something else.
pub(super) fn read_secret(file: &Path, output: Output) -> Result<Secret, SecretFileError> {
    let secret = secret_file::read(file)?;
    if secret_file::is_open_to_others(file) {
        let (name, word) = (file.display(), quoted::path(file));
        output.warn(format!("others than its owner may read or change {name}: `chmod 600 {word}`"));
    }
    Ok(secret)
}

/// The failure of a file with a secret.
pub(super) fn secret_failure(file: &Path, error: SecretFileError, doing: &str) -> Failure {
    let code = error.code();
    let failure = Failure::new(code, doing, format!("{}: {error}", file.display()));
    match code {
        ErrorCode::WouldReplace => failure.help("name another file: a device may keep the secret of this one"),
        _ => failure,
    }
}

/// Proves the secret, if a file with one is named and the device keeps one. What only looks goes on without: all that
/// is wrong here is a warning, and the device refuses the rest.
fn prove(client: &mut Client<Device>, global: &Global, doing: &str) -> Result<(), Failure> {
    let Some(file) = &global.secret_file else { return Ok(()) };
    let output = global.output();
    let secret = match read_secret(file, output) {
        Ok(secret) => secret,
        Err(error) => {
            output.warn(format!("the secret in {} cannot be read: {error}", file.display()));
            return Ok(());
        }
    };
    match client.unlock(&secret) {
        Ok(SecretState::Kept) => {}
        Ok(SecretState::Nothing) => {
            output.warn("the device keeps no secret: whoever has its line may command it; `tactus secret set FILE`");
        }
        Ok(SecretState::Unreadable) => output.warn("the device keeps a secret that it cannot read"),
        Ok(SecretState::NotOffered) => output.warn("the device has no place to keep a secret"),
        Err(HostError::Refused { reason, .. }) => output.warn(format!("{}: {reason}", file.display())),
        Err(error) => return Err(error.into_failure(doing)),
    }
    Ok(())
}

/// Opens the device that the options name to look on, whoever commands its arm. Nothing can be changed, but stopped.
///
/// # Errors
/// As [`open`]; the device is busy only if too many look on.
pub(super) fn observe(global: &Global, doing: &str) -> Result<Client<Device>, Failure> {
    let (device, owner) = reach(global, doing, |_| {})?;
    let client = Client::observe(device, &owner).map_err(|error| error.into_failure(doing))?;
    Ok(set_up(client, global))
}

/// Stops the arm of the device that the options name, whoever commands it, and says hello then.
///
/// # Errors
/// As [`open`], except that a busy device is none.
pub(super) fn halt(global: &Global, doing: &str) -> Result<Halted<Device>, Failure> {
    let (device, owner) = reach(global, doing, |_| {})?;
    Ok(match Client::halt(device, &owner).map_err(|error| error.into_failure(doing))? {
        Halted::Ours(client) => {
            let mut client = set_up(*client, global);
            // The arm has stopped; clearing a fault may need it.
            prove(&mut client, global, doing)?;
            Halted::Ours(Box::new(client))
        }
        others => others,
    })
}

fn set_up(mut client: Client<Device>, global: &Global) -> Client<Device> {
    client.set_timeout(global.timeout);
    client.set_interrupt(interrupt());
    client
}

/// The device that the options name, and who asks for it.
fn reach(
    global: &Global,
    doing: &str,
    adjust: impl FnOnce(&mut SimulationOptions),
) -> Result<(Device, String), Failure> {
    let Some(address) = global.address(doing)? else {
        return Err(Failure::new(ErrorCode::NoDeviceNamed, doing, "no device is named"));
    };
    let adjust = |options: &mut SimulationOptions| {
        options.replace_logs = global.force;
        adjust(options);
    };
    let device = Device::open(&address, adjust).map_err(|error| match error {
        OpenError::Transport(error) => {
            let help = socket_help(&address, &error);
            let failure = HostError::Transport(error).into_failure(doing);
            match help {
                Some(help) => failure.help(help),
                None => failure,
            }
        }
        OpenError::Simulation(error) => simulation_failure(error, doing),
    })?;
    Ok((device, owner(matches!(address, Address::Simulated(..)))))
}

/// The help of a socket that cannot be opened; what only a serial line needs helps nobody there.
fn socket_help(address: &Address, error: &TransportError) -> Option<String> {
    let nobody = || {
        let address = quoted::text(&address.to_string());
        // Without the device, TACTUS_DEVICE would name this very socket, which can serve nothing.
        let serving = format!("tactus --device sil: sim --listen {address}");
        format!(
            "nobody serves there: `{serving}` serves a simulated arm, in a terminal of its own; a board at this \
             computer is `--device serial:PORT` or `can:INTERFACE`, and what else was to pass its line on there has to be \
             started first"
        )
    };
    match (address, error) {
        (Address::Unix(path), TransportError::Permission { .. }) => {
            Some(format!("check the rights of the socket with `ls -l {}`", quoted::path(path)))
        }
        // A socket whose program was killed is still there, and the next one takes its place.
        (Address::Unix(path), TransportError::NotFound { .. }) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(match (std::fs::metadata(path), folder.is_dir()) {
                (Ok(found), _) if !is_socket(&found) => {
                    format!("{} is no socket: correct the name, or have another one served", path.display())
                }
                (Err(_), false) => format!("there is no folder {}: correct the name", folder.display()),
                _ => nobody(),
            })
        }
        (Address::Tcp(_), TransportError::NotFound { cause, .. }) => Some(match cause.kind() {
            ErrorKind::ConnectionRefused => nobody(),
            _ => "check the name of the computer, and that it can be reached from here".to_owned(),
        }),
        _ => None,
    }
}

#[cfg(unix)]
fn is_socket(found: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    found.file_type().is_socket()
}

/// Unix sockets do not exist on this system.
#[cfg(not(unix))]
fn is_socket(_: &std::fs::Metadata) -> bool {
    false
}

/// Makes the arm ready, its hand too, and says what happens and what a person must do.
///
/// # Errors
/// The start-up does not get to its end.
pub(super) fn ready(client: &mut Client<Device>, at_home: bool, output: Output, doing: &str) -> Result<(), Failure> {
    started(client, output, doing, |client, tell| procedure::make_ready(client, at_home, tell))
}

/// As [`ready`], but nothing is commanded: the hand is left as it is.
///
/// # Errors
/// As [`ready`].
pub(super) fn unmoved(client: &mut Client<Device>, at_home: bool, output: Output, doing: &str) -> Result<(), Failure> {
    started(client, output, doing, |client, tell| procedure::start_up(client, at_home, Stage::Ready, tell))
}

fn started(
    client: &mut Client<Device>,
    output: Output,
    doing: &str,
    start: impl FnOnce(&mut Client<Device>, &mut dyn FnMut(&StartupLook)) -> Result<Readiness, ProcedureError>,
) -> Result<(), Failure> {
    let readiness = watch(client, output, doing, start)?;
    if readiness.wrench_zeroed == Some(false) {
        output.warn(
            "the force sensor has no zero: the arm has not rested since its bus was started, or the sensor is silent; \
             modes `force` and `adapt` need it",
        );
    }
    let simulated = client.is_simulated();
    let hello = client.hello();
    let kind = if simulated { "simulated " } else { "" };
    let what = if hello.capabilities.arm { "arm" } else { "hand" };
    output.say(format!("{kind}{what} ready on {} ({})", hello.board.as_str(), hello.firmware.as_str()));
    Ok(())
}

/// Brings the arm as far as its joint angles are read, zeroing it on the way, and commands nothing.
///
/// # Errors
/// The start-up does not get there.
pub(super) fn joints_read(
    client: &mut Client<Device>,
    at_home: bool,
    output: Output,
    doing: &str,
) -> Result<(), Failure> {
    watch(client, output, doing, |client, tell| procedure::start_up(client, at_home, Stage::WaitingForActive, tell))?;
    Ok(())
}

/// Says what happens in a start-up and what a person must do, and what is wrong with the home the arm was zeroed at.
fn watch(
    client: &mut Client<Device>,
    output: Output,
    doing: &str,
    start: impl FnOnce(&mut Client<Device>, &mut dyn FnMut(&StartupLook)) -> Result<Readiness, ProcedureError>,
) -> Result<Readiness, Failure> {
    let simulated = client.is_simulated();
    let spinner = output.spinner("starting up");
    let mut blocked = None;
    let result = start(client, &mut |look| {
        let stage = look.stage;
        spinner.set_message(look.explanation());
        // It is tried again each second; the reason is said once.
        if look.blocked.is_some() && look.blocked != blocked {
            blocked.clone_from(&look.blocked);
            spinner.suspend(|| output.say(look.explanation()));
        }
        // People at a simulated pendant need no reminder; at a real one the words must stay on the screen.
        if !simulated && matches!(stage, Stage::WaitingForIdle | Stage::WaitingForZero | Stage::WaitingForActive) {
            spinner.suspend(|| output.say(stage.explanation()));
        }
    });
    spinner.finish_and_clear();
    let readiness = result.map_err(|error| failed(client, error, doing))?;
    if let Some(words) = readiness.zeroed_at.and_then(doubtful_zero) {
        output.warn(words);
    }
    Ok(readiness)
}

/// The warning of a zeroing at a home that is not the arm's own, though it has one.
fn doubtful_zero(source: HomeSource) -> Option<String> {
    let is_doubtful = matches!(source, HomeSource::Damaged | HomeSource::Foreign);
    let name = source.name();
    is_doubtful.then(|| format!("the arm was zeroed at another home than its own: {name}; `tactus calibrate show`"))
}

/// The failure of a request that the device refused.
pub(super) fn refused(client: &mut Client<Device>, error: HostError, doing: &str) -> Failure {
    explained(client, error.into_failure(doing))
}

/// The failure of a procedure of an arm that may not have got ready.
pub(super) fn failed(client: &mut Client<Device>, error: ProcedureError, doing: &str) -> Failure {
    explained(client, failure(error, doing))
}

/// A failure of an arm that does not get ready helps with what its start-up waits for or is blocked by, if the device
/// tells.
fn explained(client: &mut Client<Device>, failure: Failure) -> Failure {
    if !matches!(failure.code, ErrorCode::NotReady | ErrorCode::Refused(Refusal::NotReady)) {
        return failure;
    }
    let Ok(status) = client.status() else { return failure };
    let Status { blocked: Some(reason), .. } = status else {
        return match Stage::from_code(status.startup_stage).and_then(stage_remedy) {
            Some(remedy) => failure.help(remedy),
            None => failure,
        };
    };
    match blocked_remedy(reason) {
        Some(remedy) if failure.cause.to_string().contains(&explain_blocked(reason)) => failure.help(remedy),
        Some(remedy) => failure.help(format!("{}; {remedy}", explain_blocked(reason))),
        None => failure,
    }
}

/// Says how much faster than life a simulated device was. In words only: data must be the same in every run.
pub(super) fn tell_speed(client: &Client<Device>, started: Instant, output: Output) {
    let (simulated, taken) = (client.now().as_secs_f64(), started.elapsed().as_secs_f64());
    if client.is_virtual() && taken > 0.0 {
        output.say(format!("simulated {simulated:.1} s in {taken:.1} s: {:.1} times real time", simulated / taken));
    }
}

/// The failure of a procedure.
pub(super) fn failure(error: ProcedureError, doing: &str) -> Failure {
    let code = match error {
        ProcedureError::Stopped(fault) if fault != Fault::None => {
            let FaultGuide { cause, check, clear, .. } = FaultGuide::of(fault);
            let help = format!("usually {cause}; check {check}; then {clear}. `tactus faults` shows the second before");
            return Failure::new(ErrorCode::ArmStopped, doing, error).help(help);
        }
        ProcedureError::Host(error) => return error.into_failure(doing),
        ProcedureError::NotReady(_) => ErrorCode::NotReady,
        ProcedureError::Faulted(_) => ErrorCode::Refused(Refusal::Faulted),
        ProcedureError::NotZeroed => ErrorCode::NotZeroed,
        ProcedureError::ZeroOfOthers => ErrorCode::ZeroUnknown,
        ProcedureError::Moves { .. } => ErrorCode::ArmMoves,
        ProcedureError::Loaded { .. } | ProcedureError::Grips { .. } => ErrorCode::HandLoaded,
        ProcedureError::HandMoves { .. } => {
            return Failure::new(ErrorCode::ArmMoves, doing, error).help("let the hand come to rest, and try again");
        }
        ProcedureError::NothingToTare { hand: HandStage::Absent } => {
            return Failure::new(ErrorCode::NoHand, doing, error)
                .help("check the cables of force sensor and hand; they are looked for when the arm's bus starts");
        }
        ProcedureError::NothingToTare { .. } => {
            return Failure::new(ErrorCode::HandNotReady, doing, error)
                .help("`tactus hand init`, then `tactus tare`; the fingers will open");
        }
        ProcedureError::Stopped(_) => ErrorCode::ArmStopped,
        ProcedureError::Diverted(_) => ErrorCode::Diverted,
        ProcedureError::TooLong { .. } => ErrorCode::TooLong,
        ProcedureError::Hand(_) => ErrorCode::HandNotReady,
        // Nothing holds its fingers.
        ProcedureError::HandLost
        | ProcedureError::HandPuck {
            failure: HandFailure::Missing | HandFailure::NoAnswer | HandFailure::Silent,
            ..
        } => {
            return Failure::new(ErrorCode::HandNotReady, doing, error)
                .help("check the hand's cable, then `tactus hand init`; the fingers will open");
        }
        ProcedureError::HandPuck { .. } => ErrorCode::HandNotReady,
        ProcedureError::Recording(_) => return Failure::of_file(ErrorCode::RecordingNotWritten, doing, error),
    };
    Failure::new(code, doing, error)
}

/// A failure as it is told when the command has ended. A fault of a device that was simulated in this process is gone
/// with it: nothing is left to be cleared, and nobody can be asked for the second before.
pub(super) fn afterwards(failure: Failure, global: &Global) -> Failure {
    let Some(ProcedureError::Stopped(fault)) = failure.cause.downcast_ref() else { return failure };
    if *fault == Fault::None || !global.is_simulated_here() {
        return failure;
    }
    let FaultGuide { cause, check, .. } = FaultGuide::of(*fault);
    failure.help(format!(
        "usually {cause}; check {check}. This simulated arm ended with the command, and its fault with it: `tactus \
         sim` serves one that stays, and `tactus faults` shows its second before the fault"
    ))
}

/// The failure of a simulated device.
pub(super) fn simulation_failure(error: SimulationError, doing: &str) -> Failure {
    let code = match &error {
        SimulationError::UnknownWorld(_) => ErrorCode::UnknownWorld,
        SimulationError::NotHeld(_) => {
            return Failure::new(ErrorCode::AddressInvalid, doing, error)
                .help("for example `--device sil:held=0.5`, or `--device sil:held=0.5@0.02:0:0.15`");
        }
        SimulationError::WithoutMujoco => ErrorCode::WithoutMujoco,
        SimulationError::NoImage(_) => ErrorCode::NoQemuImage,
        SimulationError::NoQemu(_) => ErrorCode::NoQemu,
        SimulationError::NoEmulator(_) => ErrorCode::NoEmulator,
        SimulationError::NoBoardImage(_) => ErrorCode::NoBoardImage,
        SimulationError::BoardImage(_) => ErrorCode::BoardImageUnreadable,
        SimulationError::OtherBoard { .. } => ErrorCode::ImageOfOtherBoard,
        SimulationError::BoardRefused(_) => ErrorCode::BoardOption,
        SimulationError::BoardEnded { .. } => {
            return Failure::new(ErrorCode::SimulatorFailed, doing, error)
                .help("`cargo xtask board` checks emulator and image");
        }
        SimulationError::BusLog(cause) => match cause.code() {
            ErrorCode::FileFailed => ErrorCode::BusLogFile,
            code => code,
        },
        SimulationError::BoardReport(cause) => cause.code(),
        SimulationError::Flash(_, cause) => {
            let is_used = cause.kind() == std::io::ErrorKind::ResourceBusy;
            let failure = Failure::of_file(ErrorCode::FlashFile, doing, error);
            return if is_used { failure.help("end the command that uses it, or name another file") } else { failure };
        }
        SimulationError::Faults(..) => ErrorCode::FaultScript,
        _ => ErrorCode::SimulatorFailed,
    };
    Failure::new(code, doing, error)
}

/// Who this is, for people who find the device busy. Nobody else finds a simulated device of this process, and what
/// is said to it must be the same in every run, or its virtual times would not be.
pub(super) fn owner(simulated: bool) -> String {
    if simulated {
        return "tactus".to_owned();
    }
    let user = std::env::var("USER").unwrap_or_else(|_| "somebody".to_owned());
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let host = host.trim();
    let at = if host.is_empty() { "" } else { "@" };
    format!("{user}{at}{host} (process {})", std::process::id())
}

/// Raised by the first signal that asks a program to end ([`interruption::of_an_arm`]). A second one ends the process
/// at once, unless it is the same one, delivered twice: by the terminal and by the program that started this one.
pub(super) fn interrupt() -> Interrupt {
    let interrupt = Interrupt::never();
    let flag = interrupt.flag();
    match Signals::new(interruption::of_an_arm()) {
        Ok(mut signals) => {
            interruption::leave_to_another();
            std::thread::spawn(move || {
                let mut first: Option<Instant> = None;
                for _ in signals.forever() {
                    if first.get_or_insert_with(Instant::now).elapsed() > SAME_SIGNAL {
                        std::process::exit(lab::error_code::Exit::Interrupted as i32);
                    }
                    flag.store(true, Ordering::SeqCst);
                }
            });
        }
        Err(cause) => Output::default().warn(format!("Ctrl-C will not stop the arm before the program ends ({cause})")),
    }
    interrupt
}

/// Opens a simulated device without a conversation, together with the flag that Ctrl-C raises; `adjust` may change how
/// it is set up before.
///
/// # Errors
/// The address is not that of a simulated device, or the simulation cannot be started.
pub(super) fn simulated(
    address: &Address,
    text: &str,
    doing: &str,
    adjust: impl FnOnce(&mut SimulationOptions),
) -> Result<(Device, Interrupt), Failure> {
    if !matches!(address, Address::Simulated(..)) {
        return Err(Failure::new(ErrorCode::NotSimulated, doing, format!("'{text}' is not a simulated device")));
    }
    let device = Device::open(address, adjust).map_err(|error| match error {
        OpenError::Transport(error) => HostError::Transport(error).into_failure(doing),
        OpenError::Simulation(error) => simulation_failure(error, doing),
    })?;
    Ok((device, interrupt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: a zeroing at the model's home, or at any other, is told of, or none is.
    #[test]
    fn a_zeroing_at_a_home_that_cannot_be_read_is_told_and_any_other_is_not() {
        for (source, words) in [(HomeSource::Damaged, "damaged"), (HomeSource::Foreign, "another")] {
            let told = doubtful_zero(source).unwrap_or_default();
            assert!(told.contains("at another home than its own: ") && told.contains(words), "{told}");
            assert!(told.ends_with("`tactus calibrate show`"), "{told}");
        }
        assert_eq!([HomeSource::Model, HomeSource::Stored].map(doubtful_zero), [None, None]);
    }
}
