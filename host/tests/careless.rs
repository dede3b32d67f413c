//! The lines of careless people: nothing is lost, and what is wrong is named, for people and for scripts.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::tool::{self, Ended, Refusal, learned};

const DEVICE: &str = "--device sil:world=simple --non-interactive";

fn tactus(folder: &Path, line: &str) -> Output {
    tool::tactus(folder, &format!("--json {line}"))
}

#[track_caller]
fn succeeds(folder: &Path, line: &str) {
    tool::succeeds(folder, &format!("--json {line}"));
}

/// Exit code, code, message and help of a command that fails.
#[track_caller]
fn refused(folder: &Path, line: &str) -> (i32, String, String, String) {
    let Refusal { exit, code, message, help } = tool::refusal(folder, &format!("--json {line}"));
    (exit, code, message, help)
}

/// The change that makes it fail: the help of the code is given, which names no command.
#[test]
fn a_wrong_command_line_is_answered_with_a_line_that_shows_what_its_command_takes() {
    let folder = tempfile::tempdir().unwrap();
    for (line, advice) in [
        ("config set", "tactus config set --help"),
        ("--timeout 1e9 list", "tactus list --help"),
        ("--sped 1 check a.toml", "tactus check --help"),
        ("hand", "tactus hand --help"),
        ("nosuch", "tactus --help"),
        ("--json", "tactus --help"),
    ] {
        let (exit, code, _, help) = refused(folder.path(), line);
        assert_eq!((exit, code.as_str()), (2, "E200"));
        assert!(help.contains(&format!("`{advice}`")), "{line}: {help}");
        tool::succeeds(folder.path(), advice.trim_start_matches("tactus "));
    }
}

/// Guards that `learn` and `rename` give no name that `tactus run` would take for a file.
#[test]
fn no_primitive_gets_a_name_that_run_takes_for_a_file() {
    let folder = learned(3.0);
    let at = folder.path();
    let words = "`tactus run x.toml` means a file; without the ending it is `x`";
    for line in ["learn demo.csv --name x.toml -o y.toml", "learn demo.csv -o x.toml.toml"] {
        let (exit, code, message, _) = refused(at, line);
        assert!(exit == 2 && code == "E220" && message.contains(words), "{line}: {exit} {code}: {message}");
    }
    assert!(!at.join("y.toml").exists() && !at.join("x.toml.toml").exists());
    let (exit, code, message, _) = refused(at, &format!("{DEVICE} rename reach x.toml"));
    assert!(exit == 2 && code == "E200" && message.contains(words), "{exit} {code}: {message}");
}

/// Guards that a setting without a value is answered with the line that gives it one, and a wrong name with the names.
#[test]
fn a_setting_without_a_value_is_answered_with_the_line_that_sets_it() {
    let folder = tempfile::tempdir().unwrap();
    let (exit, code, _, help) = refused(folder.path(), &format!("{DEVICE} config set home.joint_4_rad 3.1"));
    assert_eq!((exit, code.as_str()), (2, "E238"));
    assert!(help.contains("`tactus config set home.joint_4_rad=VALUE`"), "{help}");
    let (_, _, _, help) = refused(folder.path(), &format!("{DEVICE} config set nosuch"));
    assert!(help.contains("`tactus config get`") && !help.contains("VALUE"), "{help}");
}

#[test]
fn a_script_is_told_what_is_wrong_with_a_command_line_as_a_person_is() {
    let folder = tempfile::tempdir().unwrap();
    for (line, words) in [
        ("learn", "<DEMO>"),
        ("statistics reach.toml", "<RECORDING>"),
        ("completions foo", "possible values: bash"),
        ("check --sped 1 a.toml", "--speed"),
        ("check a.toml --speed 7", "between 0.1 and 2"),
        ("hand", "a command or an option is missing"),
    ] {
        let (exit, code, message, _) = refused(folder.path(), line);
        assert!(exit == 2 && code == "E200" && message.contains(words), "{line}: {code}: {message}");
        assert!(!message.contains("Usage") && !message.contains('\n'), "{line}: {message}");
    }
}

/// The device would refuse it: it has been written, and the primitive could not be run any more.
#[test]
fn statistics_are_not_put_into_a_primitive_that_no_device_would_take_then() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} run reach.toml --record run.csv"));
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    let (exit, code, _, help) = refused(at, "statistics reach.toml run.csv");
    assert!(exit == 6 && code == "E635" && help.contains("tactus rehearse reach.toml"), "{exit} {code}: {help}");
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    succeeds(at, &format!("{DEVICE} run reach.toml"));
}

#[test]
fn a_file_where_a_folder_is_expected_is_named_and_the_primitive_stays_as_it_is() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::write(at.join("there"), "precious").unwrap();
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    for line in [
        format!("{DEVICE} rehearse reach.toml --record-dir there"),
        format!("{DEVICE} run reach.toml --keep there"),
        "manual there".to_owned(),
    ] {
        let (exit, code, message, help) = refused(at, &line);
        assert!(exit == 2 && code == "E231" && message.contains("there"), "{line}: {exit} {code}: {message}");
        assert!(help.contains("folder"), "{line}: {help}");
    }
    assert_eq!(std::fs::read(at.join("reach.toml")).unwrap(), before);
    assert_eq!(std::fs::read(at.join("there")).unwrap(), b"precious");
}

/// Elsewhere it is standard output.
///
/// The change that makes it fail: a folder, or the file of a secret, may have any name.
#[test]
fn no_folder_and_no_secret_gets_the_name_of_standard_output() {
    let folder = learned(3.0);
    let at = folder.path();
    for line in [
        "manual -".to_owned(),
        "secret new -".to_owned(),
        format!("{DEVICE} run reach.toml --keep -"),
        format!("{DEVICE} rehearse reach.toml --record-dir -"),
    ] {
        let (exit, code, message, _) = refused(at, &line);
        assert!(exit == 2 && code == "E231" && message.contains("standard output"), "{line}: {code}: {message}");
        assert!(!at.join("-").exists(), "{line}");
    }
    succeeds(at, "manual ./-");
}

#[test]
fn an_image_that_is_not_there_is_a_wrong_command_line_and_the_reason_is_told() {
    let folder = tempfile::tempdir().unwrap();
    for (line, code, words) in [
        ("flash --dry-run --image nothing.elf", "E233", "No such file"),
        ("flash --dry-run --image .", "E236", "Is a directory"),
    ] {
        let (exit, found, message, _) = refused(folder.path(), line);
        assert!(exit == 2 && found == code && message.contains(words), "{line}: {exit} {found}: {message}");
    }
}

#[test]
fn a_speed_of_standing_still_that_is_none_is_refused_by_the_name_of_its_option() {
    let folder = learned(3.0);
    for value in ["nan", "inf", "-1", "0", "1e9"] {
        let (exit, code, message, _) =
            refused(folder.path(), &format!("learn demo.csv -o a.toml --still-speed {value}"));
        assert!(exit == 2 && code == "E221" && message.contains("--still-speed"), "{value}: {code}: {message}");
    }
}

/// The report of the empty hand is what later measurements are compared with.
#[test]
fn a_measurement_does_not_replace_the_report_that_it_is_compared_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let told = |kilograms: f64| {
        serde_json::json!({ "beyond_hand": {
            "mass_kg": kilograms, "mass_standard_error_kg": 0.01, "moment_kgm": [0.0, 0.0, 0.0],
            "moment_standard_error_kgm": [0.01, 0.01, 0.01], "repeat_standard_error": [0.01, 0.01, 0.01, 0.01],
        } })
    };
    let report = serde_json::json!({
        "action": "payload", "serial": "simulated",
        "found": { "sensor": told(0.0), "joints": told(0.0), "contradiction": null },
    });
    std::fs::write(at.join("empty.json"), report.to_string()).unwrap();
    let line = format!("{DEVICE} calibrate payload --measure --without empty.json --report ./empty.json --force");
    let (exit, code, ..) = refused(at, &line);
    assert_eq!((exit, code.as_str()), (2, "E232"));
    assert_eq!(std::fs::read_to_string(at.join("empty.json")).unwrap(), report.to_string());
}

/// Two terminals: the second `sim` is refused, and the first one's log goes on.
#[test]
fn a_second_arm_at_the_same_place_is_refused_and_the_log_of_the_first_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut first = Command::new(env!("CARGO_BIN_EXE_tactus"));
    first.current_dir(at).args(["--device", "sil:world=simple,bus=arm.log", "sim", "--listen", "unix:arm.sock"]);
    first.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let first = Ended(first.spawn().unwrap());
    let grown = |bytes: u64| {
        let begun = std::time::Instant::now();
        while std::fs::metadata(at.join("arm.log")).map_or(0, |found| found.len()) < bytes {
            assert!(begun.elapsed().as_secs() < 60, "the log does not grow");
            std::thread::yield_now();
        }
    };
    grown(8_000);
    for (line, code) in [
        ("--device sil:world=simple,bus=arm.log --force sim --listen unix:arm.sock", "E3"),
        ("--device sil:world=simple,bus=arm.log --force sim --listen unix:other.sock --duration 1", "E208"),
        ("--device sil:world=simple,bus=arm.log --force list", "E208"),
    ] {
        let (_, found, message, _) = refused(at, line);
        assert!(found.starts_with(code), "{line}: {found}: {message}");
    }
    assert!(!at.join("other.sock").exists(), "the place of an arm that did not start is free again");
    assert!(at.join("arm.sock").exists());
    succeeds(at, "--device unix:arm.sock --non-interactive hand --at-home init");
    grown(60_000);
    drop(first);
    let log = std::fs::read(at.join("arm.log")).unwrap();
    assert!(log.starts_with(b"(0") && !log.contains(&0), "it has a hole where it was cut");
}

#[test]
fn an_arm_can_be_stopped_beside_a_configuration_file_that_cannot_be_used() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("tactus")).unwrap();
    std::fs::write(at.join("tactus/config.toml"), "timeout = \"x\"\n").unwrap();
    let stopped = tactus(at, &format!("{DEVICE} stop"));
    let said = String::from_utf8_lossy(&stopped.stderr).into_owned();
    assert!(stopped.status.success() && said.contains("warning: ") && said.contains("config.toml"), "{said}");
    for line in [format!("{DEVICE} list"), "stop".to_owned()] {
        assert_eq!(refused(at, &line).1, "E250", "{line}");
    }
}

#[test]
fn a_recording_that_could_not_be_read_again_is_not_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for command in ["record", "teach"] {
        for seconds in ["0.0001", "0.19", "nan", "3601"] {
            let (_, code, message, _) = refused(at, &format!("{DEVICE} {command} --duration {seconds} -o a.csv"));
            assert!(code == "E200" && message.contains("between 0.2 and 3600 s"), "{command}: {message}");
        }
        succeeds(at, &format!("{DEVICE} {command} --duration 0.2 -o {command}.csv"));
        lab::demonstration::Recording::read(&at.join(format!("{command}.csv"))).unwrap();
    }
    assert!(!at.join("a.csv").exists());
}

#[test]
fn what_is_given_twice_is_refused_because_one_of_the_two_would_be_ignored() {
    let folder = learned(3.0);
    let at = folder.path();
    for (line, code, words) in [
        ("--device sil:seed=1,seed=2 status", "E201", "'seed' is given twice"),
        ("--device sil:world=simple,flash=a.flash sim --flash b.flash", "E201", "'flash' is given twice"),
        ("--device sil:world=simple,faults=a.toml sim --faults b.toml", "E201", "'faults' is given twice"),
        ("--device sil:world=simple,bus=a.log run reach.toml --bus-log b.log", "E200", "`--bus-log` and `bus=`"),
        (
            "--device sil:world=simple config set home.joint_1_rad=0.1 home.joint_1_rad=0.2",
            "E238",
            "'home.joint_1_rad' is given twice",
        ),
        ("--device sil:world=simple experiment cup --vary mass=1.1,mass=1.2", "E200", "mass is given twice"),
        ("--device sil: --device sim: status", "E200", "cannot be used multiple times"),
    ] {
        let (exit, found, message, help) = refused(at, line);
        assert!(exit == 2 && found == code && message.contains(words), "{line}: {exit} {found}: {message}");
        assert!(!help.is_empty(), "{line}");
    }
    assert!(!at.join("a.log").exists() && !at.join("b.log").exists() && !at.join("a.flash").exists());
}

#[test]
fn a_file_of_another_kind_is_named_once_and_the_help_says_what_it_is_good_for() {
    let folder = learned(3.0);
    let at = folder.path();
    std::fs::write(at.join("nil"), "").unwrap();
    std::fs::create_dir(at.join("nest")).unwrap();
    for (line, file) in [
        ("check nil", "nil"),
        ("check demo.csv", "demo.csv"),
        ("check nowhere.toml", "nowhere.toml"),
        ("check nest", "nest"),
        ("learn nil -o a.toml", "nil"),
        ("learn nest", "nest"),
        ("learn reach.toml -o a.toml", "reach.toml"),
        ("plot -p demo.csv -o a.svg", "demo.csv"),
        ("plot -d nil -o a.svg", "nil"),
        ("report reach.toml -o a.html", "reach.toml"),
        ("export reach.toml -o a.mcap", "reach.toml"),
        ("compare demo.csv nil", "nil"),
        ("can decode nowhere.log", "nowhere.log"),
        ("can replay nest", "nest"),
        ("--device sil:world=simple upload demo.csv", "demo.csv"),
        ("--device sil:world=simple run demo.csv", "demo.csv"),
        ("--device sil:world=simple rehearse demo.csv", "demo.csv"),
        ("--device sil:world=simple config restore nil", "nil"),
        ("--device sil:world=simple config diff nest", "nest"),
        ("--device sil:world=simple secret set nil", "nil"),
        ("--device sil:world=simple,faults=nil status", "nil"),
        ("--device sil:world=simple,faults=nest status", "nest"),
        ("--device sil:world=simple,flash=demo.csv status", "demo.csv"),
        ("statistics demo.csv reach.toml", "demo.csv"),
        ("flash --dry-run --image demo.csv", "demo.csv"),
        ("secret new demo.csv", "demo.csv"),
    ] {
        let (_, code, message, help) = refused(at, line);
        assert_eq!(message.matches(file).count(), 1, "{line}: {code}: {message}");
        assert!(!help.is_empty(), "{line}: {code}: {message}");
        if line.contains("demo.csv") && ["E630", "E610"].contains(&code.as_str()) {
            assert!(help.contains("this is a recording: `tactus learn demo.csv`"), "{line}: {help}");
        }
    }
}

#[test]
fn results_that_are_not_there_leave_no_folder_behind() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (_, code, ..) = refused(at, "experiment cup --figures-only");
    assert!(["E242", "E310"].contains(&code.as_str()), "{code}");
    assert_eq!(std::fs::read_dir(at).unwrap().count(), 0);
    for (line, words) in [("--rotate nan", "degrees"), ("--shift 1e9,0", "100 cm"), ("--learn-speed 0", "0.1 to 10")] {
        let (_, code, message, _) = refused(at, &format!("experiment cup {line}"));
        assert!(code == "E200" && message.contains(words), "{line}: {message}");
    }
}

#[test]
fn what_is_wrong_with_a_setting_is_told_by_the_place_where_it_was_set() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let file = at.join("tactus/config.toml");
    std::fs::create_dir(at.join("tactus")).unwrap();
    for (text, words) in [
        ("device = \"sil:\"\ndevice = \"sim:\"", "duplicate key"),
        ("devise = \"sil:\"", "unknown field `devise`"),
        ("secret_file = \"\"", "secret_file = \"\""),
        ("device = \"\"", "device = \"\""),
        ("timeout = nan", "timeout = NaN"),
    ] {
        std::fs::write(&file, text).unwrap();
        let (exit, code, message, help) = refused(at, "list");
        assert!(exit == 2 && code == "E250" && message.contains(words), "{text}: {code}: {message}");
        assert!(message.contains("tactus/config.toml") && !help.is_empty(), "{text}: {message}");
    }
    std::fs::remove_file(&file).unwrap();
    let run = |line: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(at).env("XDG_CONFIG_HOME", at).env("TACTUS_TIMEOUT", "2,5").args(line.split_whitespace());
        command.stdin(Stdio::null()).output().unwrap()
    };
    let output = run(&format!("{DEVICE} list"));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.starts_with("error[E200]: TACTUS_TIMEOUT: `2,5`") && said.contains("  help: correct TACTUS_TIMEOUT"),
        "{said}"
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(run(&format!("{DEVICE} --timeout 2 list")).status.success());
    assert!(run(&format!("{DEVICE} stop")).status.success());
}

#[test]
fn degrees_and_absurd_numbers_are_told_as_such_on_one_line() {
    let folder = learned(3.0);
    let at = folder.path();
    let (_, code, message, _) = refused(at, "learn demo.csv -o a.toml --hand-goal 0,90,90,90");
    assert!(code == "E200" && message.contains("90 rad: are these degrees?"), "{message}");
    let text = std::fs::read_to_string(at.join("demo.csv")).unwrap();
    let line = text.lines().nth(50).unwrap();
    let mut fields: Vec<&str> = line.split(',').collect();
    let joint = text.lines().find(|line| line.contains("q1_rad")).unwrap().split(',').position(|name| name == "q1_rad");
    for (value, told, words) in [
        ("1e9", "E621", "1.0e9 rad: are these degrees?"),
        ("1e300", "E620", "1e300 is larger than any value of a recording"),
    ] {
        fields[joint.unwrap()] = value;
        std::fs::write(at.join("absurd.csv"), text.replace(line, &fields.join(","))).unwrap();
        let (_, code, message, _) = refused(at, "learn absurd.csv -o a.toml");
        assert!(code == told && message.contains(words), "{code}: {message}");
    }
    let (_, code, _, help) = refused(at, "learn demo.csv -o a.toml --dwell -1");
    assert!(code == "E221" && help.contains("tactus learn --help"), "{code}: {help}");
}

#[test]
fn a_place_where_no_arm_can_be_served_is_told_with_those_where_one_can() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (option, words, remedy) in [
        ("--listen foo", "listen on unix:PATH or tcp:HOST:PORT", "--listen"),
        ("--listen sil:", "listen on unix:PATH or tcp:HOST:PORT", "--listen"),
        ("--listen tcp:localhost:99999", "'99999'", "--listen"),
        ("--can-only --can foo", "foo", "`--can 127.0.0.1:29536`"),
    ] {
        let (exit, code, message, help) = refused(at, &format!("--device sil:world=simple sim --duration 1 {option}"));
        assert!(exit == 3 && code == "E320" && message.contains(words), "{option}: {code}: {message}");
        assert!(help.contains(remedy), "{option}: {help}");
    }
}

/// The change that makes it fail: the example of the help is always the same.
#[test]
fn another_address_than_the_one_that_is_taken_is_advised() {
    let folder = tempfile::tempdir().unwrap();
    // Held by this test or by another program: either will do.
    let taken = std::net::TcpListener::bind("127.0.0.1:29536");
    let line = "--device sil:world=simple sim --duration 1 --can-only --can 127.0.0.1:29536";
    let (exit, code, _, help) = refused(folder.path(), line);
    assert!(exit == 3 && code == "E320" && !help.contains("29536") && help.contains("`--can 127.0.0.1:"), "{help}");
    drop(taken);
}

/// Nobody stands beside the arm of the simple world, a served or a real one: a person was asked to guide it.
#[test]
fn options_of_the_simulated_teacher_are_refused_where_there_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for option in ["--movement cup", "--teacher 5"] {
        let (exit, code, message, help) = refused(at, &format!("{DEVICE} teach --duration 1 -o a.csv {option}"));
        assert!(
            exit == 2 && code == "E200" && message.contains(option.split(' ').next().unwrap()),
            "{code}: {message}"
        );
        assert!(help.contains("sil:"), "{help}");
        assert!(!at.join("a.csv").exists() && !at.join("a.csv.part").exists());
    }
    succeeds(at, &format!("{DEVICE} teach --duration 1 -o a.csv"));
}

/// The changes that make it fail: surroundings that are not there are ignored; nothing is none of the simple world's.
#[test]
fn surroundings_are_refused_where_there_are_none() {
    let folder = learned(3.0);
    let at = folder.path();
    let mut serve = Command::new(env!("CARGO_BIN_EXE_tactus"));
    serve.current_dir(at).args(["--device", "sil:world=simple", "sim"]).stdin(Stdio::null());
    let mut served = Ended(serve.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    while !at.join("tactus.sock").exists() {
        assert_eq!(served.0.try_wait().unwrap(), None, "the simulated arm does not listen");
        std::thread::yield_now();
    }
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    for (device, surroundings) in [
        ("--device unix:tactus.sock", "nothing"),
        ("--device unix:tactus.sock", "table"),
        (DEVICE, "table"),
        (DEVICE, "object"),
    ] {
        let (exit, code, message, help) =
            refused(at, &format!("{device} rehearse reach.toml --trials 1 --surroundings {surroundings}"));
        assert!(exit == 2 && code == "E200" && message.contains("`--surroundings`"), "{code}: {message}");
        assert!(help.contains("leave it out"), "{help}");
        assert!(std::fs::read(at.join("reach.toml")).unwrap() == before, "nothing was remembered");
    }
    drop(served);
    succeeds(at, &format!("{DEVICE} rehearse reach.toml --trials 1 --surroundings nothing"));
    succeeds(at, &format!("{DEVICE} rehearse reach.toml --trials 1"));
}

/// A newcomer leaves out the ending, or expects that a simulated device remembers the last command.
#[test]
fn a_primitive_that_is_not_there_is_named_with_the_place_where_it_may_be() {
    let folder = learned(3.0);
    let at = folder.path();
    for line in ["upload reach", "check reach", "rehearse reach"] {
        let (exit, code, message, help) = refused(at, &format!("{DEVICE} {line}"));
        assert!(exit == 2 && code == "E233" && message.contains("reach: "), "{line}: {code}: {message}");
        assert_eq!(help, "there is a file reach.toml", "{line}");
    }
    for line in ["run reach", "get reach -o a.toml", "delete reach", "rename reach grasp"] {
        let (exit, code, message, help) = refused(at, &format!("{DEVICE} {line}"));
        assert!(exit == 5 && code == "E513" && message.contains("'reach'"), "{line}: {code}: {message}");
        assert!(help.contains("`tactus upload reach.toml`"), "{line}: {help}");
    }
    for line in ["run grasp", "delete grasp"] {
        let (_, _, message, help) = refused(at, &format!("{DEVICE} {line}"));
        assert!(message.contains("'grasp'") && help.contains("`flash=FILE`"), "{line}: {message}: {help}");
        let (_, _, _, help) = refused(at, &format!("--device sil:world=simple,flash=arm.flash {line}"));
        assert!(help.contains("`tactus list`"), "{line}: {help}");
    }
}

/// The change that makes it fail: a recording that reads well is a success.
#[test]
fn a_run_that_missed_its_goal_is_no_success_and_its_report_says_so() {
    let folder = learned(3.0);
    let at = folder.path();
    succeeds(at, &format!("{DEVICE} run reach.toml --mode open --record run.csv"));
    let text = std::fs::read_to_string(at.join("run.csv")).unwrap();
    let names: Vec<&str> = text.lines().find(|line| line.starts_with("cycle,")).unwrap().split(',').collect();
    let x = names.iter().position(|name| *name == "x_m").unwrap();
    let moved = |line: &str| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Some(Ok(value)) = fields.get(x).map(|field| field.parse::<f64>()) {
            fields[x] = (value + 0.1).to_string();
        }
        fields.join(",") + "\n"
    };
    std::fs::write(at.join("missed.csv"), text.lines().map(moved).collect::<String>()).unwrap();
    let before = std::fs::read(at.join("reach.toml")).unwrap();
    let (_, code, message, help) = refused(at, "statistics reach.toml run.csv missed.csv");
    assert!(code == "E640" && message.contains("missed.csv: the arm ended 1"), "{code} {message}");
    assert!(help.contains("leave this one out"), "{help}");
    assert!(std::fs::read(at.join("reach.toml")).unwrap() == before, "nothing was remembered");
    succeeds(at, "report missed.csv");
    let page = std::fs::read_to_string(at.join("report.html")).unwrap();
    assert!(page.contains("away from its goal") && !page.contains("arrived, and held"), "the report tells it");
}

/// Seen: a spring of 0.05 passed the check of the option, which said that every number above 0 is taken; the fit then
/// failed with the advice to show the movement again.
#[test]
fn a_spring_that_no_primitive_can_have_is_refused_by_the_name_of_its_option() {
    let folder = learned(3.0);
    for option in ["--stiffness", "--orientation-stiffness"] {
        let (exit, code, message, _) =
            refused(folder.path(), &format!("--force learn demo.csv -o soft.toml {option} 0.05"));
        assert_eq!((exit, code.as_str()), (2, "E221"), "{message}");
        assert!(message.contains(option) && message.contains("from 0.1 to"), "{message}");
        succeeds(folder.path(), &format!("--force learn demo.csv -o soft.toml {option} 0.1"));
    }
}
