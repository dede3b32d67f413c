//! A firmware that dies takes nobody with it: the host says so and ends.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use lab::client::Client;
use lab::device::Device;
use lab::error::HostError;
use lab::simulation::{Engine, SimulationError};
use lab::transport::TransportError;
use system_tests::command::{signal, start, tactus};
use system_tests::expect;

/// Returns the error that ended a conversation, if it was the end of the simulated firmware.
fn ended(error: HostError) -> Option<String> {
    let HostError::Transport(TransportError::Other(cause)) = error else {
        return None;
    };
    match cause.downcast_ref()? {
        error @ SimulationError::Ended { .. } => Some(error.to_string()),
        _ => None,
    }
}

#[test]
fn an_image_that_is_no_firmware_ends_with_its_last_words() {
    let folder = expect(tempfile::tempdir());
    let no_image = folder.path().join("no-firmware.elf");
    // QEMU takes it for a flat binary; the processor locks up at its first instruction.
    expect(fs::write(&no_image, [b"\x7fELF\x02\x01\x01".as_slice(), &[0xFF; 57]].concat()));
    let device = Device::open(&expect("sim:world=simple".parse()), |options| {
        options.engine = Engine::Qemu { image: no_image };
    });
    let started = Instant::now();
    let error = Client::connect(expect(device), "system test").err().expect("there is no firmware");
    let shown = error.to_string();
    let words = ended(error).unwrap_or_else(|| panic!("{shown}"));
    println!("{words}");
    assert!(words.contains("last words: qemu"), "{words}");
    assert!(started.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_killed_firmware_ends_the_command_with_a_message() {
    let folder = expect(tempfile::tempdir());
    let arguments = ["--device", "sim:world=simple", "sim", "--listen", "unix:arm.sock"];
    let mut served = start(folder.path(), &arguments);
    served.hear("listens");
    tactus(folder.path(), &["--device", "unix:arm.sock", "list"]).success();
    let qemu = child_of(served.id()).expect("QEMU runs below the command");
    let killed = Instant::now();
    signal(qemu, "-KILL");
    let output = served.finish();
    let took = killed.elapsed();
    let words = String::from_utf8_lossy(&output.stderr);
    println!("took {:.2} s: {words}", took.as_secs_f64());
    assert!(took < Duration::from_secs(10), "{took:?}");
    assert_eq!(output.status.code(), Some(1), "{words}");
    assert!(words.contains("the firmware under QEMU ended (signal: 9"), "{words}");
    assert!(!folder.path().join("arm.sock").exists(), "a socket nobody answers on was left behind");
}

#[test]
fn a_missing_image_names_the_command_that_builds_it() {
    let folder = expect(tempfile::tempdir());
    let mut command = assert_cmd::Command::new(system_tests::command::program());
    command.current_dir(folder.path()).env("TACTUS_IMAGE", "nowhere.elf");
    let failed = command.args(["--device", "sim:world=simple", "list"]).assert().code(3);
    let words = system_tests::command::stderr(&failed);
    assert!(words.contains("nowhere.elf") && words.contains("cargo xtask build"), "{words}");
}

/// The first child of a process.
fn child_of(parent: u32) -> Option<u32> {
    processes().find_map(|(process, above)| (above == parent).then_some(process))
}

/// Every process: its number and its parent's.
fn processes() -> impl Iterator<Item = (u32, u32)> {
    let entries = fs::read_dir(Path::new("/proc")).expect("these tests need a Linux /proc");
    entries.flatten().filter_map(|entry| {
        let process: u32 = entry.file_name().to_str()?.parse().ok()?;
        // Number, name in parentheses (which may hold anything), state, parent.
        let stat = fs::read_to_string(entry.path().join("stat")).ok()?;
        let (_, tail) = stat.rsplit_once(") ")?;
        let parent = tail.split(' ').nth(1)?.parse().ok()?;
        Some((process, parent))
    })
}
