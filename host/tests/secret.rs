//! `tactus secret`: a device that keeps one takes commands from those who name its file, and shows it to nobody.

use std::path::Path;

use assert_cmd::Command;
use assert_cmd::assert::Assert;

use crate::tool::{command, judge};

/// A device whose flash is a file: it keeps its secret from one command to the next.
const DEVICE: &str = "--device sil:world=simple,flash=arm.flash --non-interactive";

fn tactus(folder: &Path, line: &str, secret: Option<&str>) -> Assert {
    let mut command = command(folder, line);
    command.envs(secret.map(|file| ("TACTUS_SECRET_FILE", file)));
    judge(command)
}

fn said(assert: &Assert) -> String {
    let output = assert.get_output();
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

#[test]
fn h9_a_device_with_a_secret_is_commanded_by_those_who_name_its_file_and_no_secret_is_ever_shown() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut heard = String::new();
    let mut run = |line: &str, secret: Option<&str>, code: i32, words: &[&str]| {
        let said = said(&tactus(at, line, secret).code(code));
        words.iter().for_each(|word| assert!(said.contains(word), "{line}: {word} is missing in {said}"));
        heard += &said;
        said
    };
    run("secret new lab.secret", None, 0, &["lab.secret"]);
    run("secret new other.secret", None, 0, &[]);
    run("secret new lab.secret", None, 2, &["E230", "name another file"]);
    let on = |line: &str| format!("{DEVICE} {line}");
    run(&on("secret status"), None, 0, &["none: whoever has its line"]);
    run(&on("secret set lab.secret"), None, 0, &["kept", "TACTUS_SECRET_FILE=lab.secret"]);
    run(&on("--json secret status"), None, 0, &[r#"{"secret":"kept","wrong_proofs":0}"#]);

    // Looking and stopping need none, whatever is wrong with the one that is named.
    for secret in [None, Some("lab.secret"), Some("other.secret"), Some("missing.secret")] {
        for line in ["list", "status", "stop", "calibrate show"] {
            let said = run(&on(line), secret, 0, &[]);
            // Whoever only looks on has no use for a secret; a stop may be followed by what does.
            let is_warned = matches!(secret, Some("other.secret" | "missing.secret")) && line == "stop";
            assert_eq!(said.contains("warning: "), is_warned, "{line}, {secret:?}: {said}");
        }
    }
    run(&on("delete nothing"), None, 5, &["E550", "TACTUS_SECRET_FILE"]);
    run(&on("calibrate payload hand"), None, 5, &["E550"]);
    run(&on("hand init"), None, 5, &["E550"]);
    run(&on("delete nothing"), Some("other.secret"), 5, &["E550", "warning: other.secret"]);
    run(&on("delete nothing"), Some("lab.secret"), 5, &["E513"]);
    run(&on("--secret-file lab.secret delete nothing"), Some("other.secret"), 5, &["E513"]);
    run(&on("calibrate payload hand"), Some("lab.secret"), 0, &["declared: hand"]);

    run(&on("secret set other.secret"), None, 5, &["E550"]);
    run(&on("secret clear"), Some("other.secret"), 5, &["E551"]);
    run(&on("secret set other.secret"), Some("lab.secret"), 0, &["kept"]);
    run(&on("delete nothing"), Some("lab.secret"), 5, &["E550"]);
    run(&on("secret clear"), Some("other.secret"), 0, &["none"]);
    run(&on("delete nothing"), None, 5, &["E513"]);
    run(&on("delete nothing"), Some("lab.secret"), 5, &["E513", "warning: the device keeps no secret"]);

    std::fs::write(at.join("words.secret"), "correct horse battery staple").unwrap();
    run(&on("secret set words.secret"), None, 2, &["E239"]);
    for file in ["lab.secret", "other.secret"] {
        let digits = std::fs::read_to_string(at.join(file)).unwrap();
        assert!(!heard.contains(digits.trim()), "{file} was shown");
    }
    assert!(!heard.contains("battery"), "{heard}");
}

#[test]
fn a_secret_that_is_no_file_is_told_at_once_and_one_that_others_may_read_with_the_command_that_helps() {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    tactus(at, "secret new lab.secret", None).success();
    std::fs::create_dir(at.join("folder")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(at.join("pipe")).status().unwrap().success());
    for (name, kind) in [("folder", "a folder"), ("pipe", "a pipe")] {
        // Nobody ever writes into the pipe: to read it would be to wait for ever.
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        let command = command.current_dir(at).timeout(std::time::Duration::from_secs(60));
        let line = format!("{DEVICE} secret set {name}");
        let refused = said(&command.args(line.split_whitespace()).assert().code(2));
        assert!(refused.contains("E239") && refused.contains(kind), "{refused}");
    }
    let set = |mode: u32| {
        let file = at.join("lab.secret");
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).unwrap();
        let _ = std::fs::remove_file(at.join("arm.flash"));
        let kept = said(&tactus(at, &format!("{DEVICE} secret set lab.secret"), None).success());
        kept + &said(&tactus(at, &format!("{DEVICE} hand init"), Some("lab.secret")).success())
    };
    assert!(!set(0o600).contains("warning"));
    for mode in [0o644, 0o620] {
        assert_eq!(set(mode).matches("`chmod 600 lab.secret`").count(), 2, "{mode:o}");
    }
    // A shell hands over what another program says as a pipe of its own.
    let line = format!("\"$0\" {DEVICE} --secret-file <(cat lab.secret) delete nothing");
    let mut shell = Command::new("bash");
    let shell = shell.current_dir(at).args(["-c", &line, env!("CARGO_BIN_EXE_tactus")]).assert().code(5);
    assert!(said(&shell).contains("E513"), "{}", said(&shell));
}

#[test]
fn the_file_with_the_secret_may_stand_in_the_configuration_and_is_shown_with_its_origin() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("tactus")).unwrap();
    std::fs::write(folder.path().join("tactus/config.toml"), "secret_file = \"lab.secret\"\n").unwrap();
    let shown = said(&tactus(folder.path(), "config --json", None).success());
    assert!(shown.contains(r#""secret_file":{"value":"lab.secret","origin":"file"}"#), "{shown}");
    let shown = said(&tactus(folder.path(), "config --json", Some("other.secret")).success());
    assert!(shown.contains(r#""secret_file":{"value":"other.secret","origin":"environment"}"#), "{shown}");
}
