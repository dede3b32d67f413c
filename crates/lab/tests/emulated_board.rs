//! `--device board:` with a stand-in for the emulator: a script that speaks as much of the lock step as each test
//! needs.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

use lab::output_file::OutputError;
use lab::simulation::{
    BoardCan, BoardEngine, Engine, FlashSource, Simulation, SimulationError, SimulationOptions, WorldKind,
};
use lab::transport::can::CanPort;
use lab::transport::{Cancellation, ChipOptions, LineKind, Transport};
use link::ImageMetadata;
use sim::lockstep::REPLY_LENGTH;

use crate::elf::{elf, real};

/// The shell command that writes a request of this kind at this tick, with link bytes.
fn request(kind: u8, tick: u64, link: &[u8]) -> String {
    let mut bytes = vec![0; 24];
    bytes[0] = kind;
    bytes[1] = link.len() as u8;
    bytes[8..16].copy_from_slice(&tick.to_le_bytes());
    bytes.extend(link);
    let octal: String = bytes.iter().map(|byte| format!("\\{byte:03o}")).collect();
    format!("printf '{octal}'")
}

/// The question whether anything has come.
fn ask(tick: u64) -> String {
    request(2, tick, &[])
}

/// A folder with an image of `board` and an emulator that runs `script`.
fn laboratory(board: &'static str, script: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let image = elf(Some(&ImageMetadata { board, ..real() }.encode()), 0x0800_0000);
    fs::write(folder.path().join("arm.elf"), image).unwrap();
    let emulator = folder.path().join("emulator");
    fs::write(&emulator, format!("#!/bin/sh\ncd {}\n{script}\n", folder.path().display())).unwrap();
    fs::set_permissions(&emulator, fs::Permissions::from_mode(0o755)).unwrap();
    folder
}

/// The options of a board in the folder.
fn options(folder: &Path) -> SimulationOptions {
    let engine =
        BoardEngine { emulator: folder.join("emulator"), image: folder.join("arm.elf"), chip: ChipOptions::default() };
    SimulationOptions::new(Engine::Board(engine), 1, WorldKind::Simple)
}

fn start(options: &SimulationOptions) -> Result<Simulation, SimulationError> {
    Simulation::start(options)
}

#[test]
fn a_report_replaces_no_file_unless_it_is_forced_and_never_what_is_read() {
    let folder = laboratory("nucleo-h743zi2", "exit 3");
    let (report, flash) = (folder.path().join("report.json"), folder.path().join("bank2"));
    fs::write(&report, "precious").unwrap();
    fs::write(&flash, "precious").unwrap();
    let mut options = options(folder.path());
    options.board_report = Some(report.clone());
    assert!(matches!(refused(&options), SimulationError::BoardReport(OutputError::Exists { .. })));
    options.replace_logs = true;
    assert!(!matches!(refused(&options), SimulationError::BoardReport(_)));
    options.flash = FlashSource::File(flash.clone());
    options.board_report = Some(flash.clone());
    assert!(matches!(refused(&options), SimulationError::BoardReport(OutputError::IsInput { .. })));
    options.board_report = Some(folder.path().to_owned());
    assert!(matches!(refused(&options), SimulationError::BoardReport(OutputError::NotAFile { .. })));
    for file in [report, flash] {
        assert_eq!(fs::read(file).unwrap(), b"precious");
    }
}

fn refused(options: &SimulationOptions) -> SimulationError {
    start(options).err().expect("such a board cannot be switched on")
}

#[test]
fn every_option_reaches_the_emulator() {
    let folder = laboratory("nucleo-h743zi2", &format!("echo \"$@\" > words\n{}\ncat > /dev/null", ask(0)));
    let mut options = options(folder.path());
    drop(start(&options).unwrap());
    let words = || fs::read_to_string(folder.path().join("words")).unwrap();
    let image = folder.path().join("arm.elf");
    assert_eq!(words().trim(), format!("serve --image {} --host-line serial", image.display()));
    options.flash = FlashSource::File("bank2.bin".into());
    options.line = LineKind::Can;
    options.firmware_log = Some("log".into());
    options.board_report = Some("report.json".into());
    let Engine::Board(board) = &mut options.engine else { unreachable!() };
    board.chip = ChipOptions {
        cancellation: Some(Cancellation::Stuck),
        revision: Some(0x1003),
        faults: vec!["hang@5".into(), "bus-off@7:2".into()],
    };
    drop(start(&options).unwrap());
    assert_eq!(
        words().trim(),
        format!(
            "serve --image {} --bank2 bank2.bin --host-line can --log log --report report.json --cancellation stuck \
             --revision 0x1003 --fault hang@5 --fault bus-off@7:2",
            image.display()
        )
    );
}

#[test]
fn the_power_is_off_when_the_emulator_has_written_everything() {
    let script = format!("{}\ncat > /dev/null\nsleep 0.3\necho done > bank2", ask(0));
    let folder = laboratory("nucleo-h743zi2", &script);
    let mut board = start(&options(folder.path())).unwrap();
    // One exchange; then it asks no more, but nobody waits for that.
    board.receive(Duration::from_nanos(1), &mut Vec::new()).unwrap();
    drop(board);
    assert_eq!(fs::read_to_string(folder.path().join("bank2")).unwrap(), "done\n");
}

#[test]
fn what_the_board_says_arrives_without_delay() {
    let folder = laboratory(
        "nucleo-h743zi2",
        &format!("{}\n{}\n{}\ncat > /dev/null", ask(0), request(4, 100, &[0x5A]), ask(10_000)),
    );
    let mut board = start(&options(folder.path())).unwrap();
    let mut heard = Vec::new();
    board.receive(Duration::from_millis(1), &mut heard).unwrap();
    assert_eq!((heard, board.ticks()), (vec![0x5A], 100));
}

#[test]
fn an_image_for_another_board_is_refused_and_both_are_named() {
    let folder = laboratory("mps2-an500", &format!("echo started > words\n{}", ask(0)));
    let error = refused(&options(folder.path())).to_string();
    assert!(error.contains("'mps2-an500'") && error.contains("'nucleo-h743zi2'"), "{error}");
    fs::write(folder.path().join("arm.elf"), elf(None, 0x0800_0000)).unwrap();
    let error = refused(&options(folder.path())).to_string();
    assert!(error.contains("does not say what it is"), "{error}");
    assert!(!folder.path().join("words").exists(), "the emulator was started all the same");
}

#[test]
fn a_flash_of_this_program_cannot_be_put_in() {
    let folder = laboratory("nucleo-h743zi2", &ask(0));
    let options = SimulationOptions { flash: FlashSource::Chip(Default::default()), ..options(folder.path()) };
    assert!(matches!(refused(&options), SimulationError::FlashOfItsOwn));
}

#[test]
fn an_emulator_that_refuses_or_ends_is_quoted() {
    let folder = laboratory("nucleo-h743zi2", "echo 'no such fault: flood' >&2\nexit 2");
    let error = refused(&options(folder.path()));
    assert!(matches!(&error, SimulationError::BoardRefused(words) if words == "no such fault: flood"), "{error}");

    let folder = laboratory("nucleo-h743zi2", &format!("{}\necho 'unmodelled: DTS at 0x58006800' >&2\nexit 3", ask(0)));
    let mut board = start(&options(folder.path())).unwrap();
    let error = board.receive(Duration::from_secs(1), &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("exit status: 3") && error.contains("unmodelled: DTS at 0x58006800"), "{error}");
}

#[test]
fn an_emulator_that_does_not_end_is_ended() {
    // It closes its output, which looks like an end, and stays.
    let folder = laboratory("nucleo-h743zi2", &format!("{}\nexec sleep 60 >&- 2>&-", ask(0)));
    let started = Instant::now();
    let mut board = start(&options(folder.path())).unwrap();
    let error = board.receive(Duration::from_secs(1), &mut Vec::new()).unwrap_err().to_string();
    assert!(error.contains("had to be killed"), "{error}");
    assert!(started.elapsed() < Duration::from_secs(30), "{:?}", started.elapsed());
}

#[test]
fn a_missing_emulator_is_no_riddle() {
    let folder = laboratory("nucleo-h743zi2", &ask(0));
    let mut options = options(folder.path());
    let Engine::Board(board) = &mut options.engine else { unreachable!() };
    board.emulator = folder.path().join("nothing");
    let error = refused(&options).to_string();
    assert!(error.contains("nothing") && error.contains("cannot be started"), "{error}");
}

#[test]
fn frames_cross_as_whole_records_when_the_host_line_is_can() {
    let record = [0x1D, 4, 2, b'A', b'B', 0, 0, 0, 0, 0, 0];
    let script = format!("{}\n{}\n{}\ncat > heard", ask(0), request(4, 100, &record), ask(200));
    let folder = laboratory("nucleo-h743zi2", &script);
    let options = SimulationOptions { line: LineKind::Can, ..options(folder.path()) };
    let mut port = BoardCan::new(start(&options).unwrap());
    let frame = port.receive(Duration::from_millis(1)).unwrap().unwrap();
    assert_eq!((frame.can_id().raw(), frame.payload()), (0x41D, &b"AB"[..]));
    port.send(frame).unwrap();
    assert_eq!(port.receive(Duration::from_nanos(40)).unwrap(), None);
    drop(port);
    let heard = fs::read(folder.path().join("heard")).unwrap();
    assert_eq!(heard.len(), 3 * REPLY_LENGTH + 11);
    assert_eq!(heard[3 * REPLY_LENGTH..], record);
}
