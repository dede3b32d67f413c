//! The environment and the configuration file: what is wrong in them never keeps an arm moving, and what is empty is
//! not there.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::tool::{command, said};

fn tactus(folder: &Path, variables: &[(&str, &str)], line: &str) -> Output {
    command(folder, line).envs(variables.iter().copied()).output().unwrap()
}

fn configure(folder: &Path, text: &str) {
    std::fs::create_dir_all(folder.join("tactus")).unwrap();
    std::fs::write(folder.join("tactus/config.toml"), text).unwrap();
}

const SIMULATED: (&str, &str) = ("TACTUS_DEVICE", "sil:world=simple");

#[test]
fn a_time_out_that_is_none_does_not_keep_an_arm_moving() {
    let folder = tempfile::tempdir().unwrap();
    for timeout in ["5s", "", "-1", "nan"] {
        let variables = [SIMULATED, ("TACTUS_TIMEOUT", timeout)];
        let output = tactus(folder.path(), &variables, "stop");
        assert_eq!(output.status.code(), Some(0), "'{timeout}': {}", said(&output));
        assert_eq!(said(&output).contains("TACTUS_TIMEOUT"), !timeout.is_empty(), "{}", said(&output));
        // Only a stop goes on without; an empty variable is none for anybody.
        let output = tactus(folder.path(), &variables, "list");
        assert_eq!(output.status.code(), Some(if timeout.is_empty() { 0 } else { 2 }), "{}", said(&output));
    }
    // A mistake in the line itself is told, and not the variable.
    let output = tactus(folder.path(), &[SIMULATED, ("TACTUS_TIMEOUT", "5s")], "stop --clear");
    assert_eq!(output.status.code(), Some(2));
    let output = tactus(folder.path(), &[SIMULATED], "stop --timeout 5s");
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn an_empty_variable_counts_as_none_and_the_file_counts() {
    let folder = tempfile::tempdir().unwrap();
    let empty = [("TACTUS_DEVICE", ""), ("TACTUS_TIMEOUT", ""), ("TACTUS_SECRET_FILE", "")];
    let output = tactus(folder.path(), &empty, "list");
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("no device is named"), "{}", said(&output));
    configure(folder.path(), "device = \"sil:world=simple\"\ntimeout = 3\n");
    let output = tactus(folder.path(), &empty, "--json config");
    let shown: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (name, value) in [("device", "sil:world=simple"), ("timeout", "3")] {
        let setting = &shown["settings"][name];
        assert_eq!((setting["value"].as_str(), setting["origin"].as_str()), (Some(value), Some("file")), "{shown}");
    }
    assert_eq!(shown["settings"]["secret_file"]["origin"], "default");
}

#[cfg(unix)]
#[test]
fn a_device_in_the_environment_that_is_no_text_is_told_and_counts_for_nobody_who_names_another() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = tempfile::tempdir().unwrap();
    // What the file names is not taken instead: somebody meant another arm.
    configure(folder.path(), "device = \"sil:world=simple\"\n");
    let ask = |line: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(folder.path()).env("XDG_CONFIG_HOME", folder.path());
        command.env("TACTUS_DEVICE", std::ffi::OsStr::from_bytes(b"unix:/tmp/\xff.sock"));
        command.args(line.split_whitespace()).stdin(Stdio::null()).output().unwrap()
    };
    for line in ["list", "stop", "--json status"] {
        let output = ask(line);
        assert_eq!(output.status.code(), Some(2), "{line}: {}", said(&output));
        let words = said(&output);
        assert!(words.contains("E201") && words.contains("no text") && words.contains("TACTUS_DEVICE"), "{words}");
    }
    for line in ["--device sil:world=simple list", "explain E504", "completions bash", "--help"] {
        assert_eq!(ask(line).status.code(), Some(0), "{line}: {}", said(&ask(line)));
    }
    let shown: Value = serde_json::from_slice(&ask("--json config").stdout).unwrap();
    assert_eq!(shown["settings"]["device"]["origin"], "environment", "{shown}");
}

#[test]
fn a_stop_takes_the_device_from_a_file_in_which_something_else_is_wrong() {
    for wrong in ["timeout = -1", "timeout = \"soon\"", "tiemout = 3", "secret_file = 7"] {
        let folder = tempfile::tempdir().unwrap();
        configure(folder.path(), &format!("device = \"sil:world=simple\"\n{wrong}\n"));
        let output = tactus(folder.path(), &[], "stop");
        assert_eq!(output.status.code(), Some(0), "{wrong}: {}", said(&output));
        assert!(said(&output).contains("config.toml"), "{wrong}: {}", said(&output));
        assert_eq!(tactus(folder.path(), &[], "list").status.code(), Some(2), "{wrong}");
    }
    // Without a device there is nothing that could be stopped, and the file is to blame.
    let folder = tempfile::tempdir().unwrap();
    configure(folder.path(), "device = \n");
    let output = tactus(folder.path(), &[], "stop");
    assert!(output.status.code() == Some(2) && said(&output).contains("E250"), "{}", said(&output));
}

/// The change that makes it fail: the help names the settings, whatever is wrong with the file.
#[test]
fn a_configuration_file_that_cannot_be_read_is_answered_with_the_line_that_shows_why() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tactus/config.toml");
    std::fs::create_dir_all(&file).unwrap();
    let output = tactus(folder.path(), &[], "list");
    let words = said(&output);
    assert!(output.status.code() == Some(2) && words.contains("error[E250]"), "{words}");
    assert!(words.contains(&format!("help: `ls -ld {}`", lab::quoted::path(&file))), "{words}");
}
