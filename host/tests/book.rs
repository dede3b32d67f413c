//! The tutorial and the how-to pages cannot rot: every command in them is executed, and must say what is shown.
//!
//! A page's blocks are read like a terminal: `$ tactus ...` runs in a temporary folder, `&` at its end leaves it
//! running until the page ends, `$ cp ../../FILE .` brings a file of the repository, `$ export NAME=VALUE` counts from
//! then on. A shown line must occur in the output, in order; ` ... ` in it stands for any words, `...` alone for any
//! lines. `error[E592]` among them means exit code 5; otherwise a command must succeed.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A command of a page with the lines that are shown below it.
#[derive(Default)]
struct Shown {
    line: usize,
    words: String,
    output: Vec<(usize, String)>,
}

/// A process that ends with its page.
struct Background(Child);

impl Drop for Background {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Commands of the blocks that have a prompt.
///
/// # Errors
/// A `tactus` command without a prompt: it would not be executed.
fn commands(text: &str) -> Result<Vec<Shown>, String> {
    let (mut inside, mut found) = (false, Vec::<Shown>::new());
    let mut follows = false;
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        if line.starts_with("```") {
            inside = !inside;
            follows = false;
        } else if let Some(words) = line.strip_prefix("$ ").filter(|_| inside) {
            let words = words.split(" #").next().unwrap_or_default().trim().to_owned();
            found.push(Shown { line: number, words, output: Vec::new() });
            follows = true;
        } else if inside && line.trim_start().starts_with("tactus ") {
            return Err(format!("{number}: a command without '$ ' is not executed"));
        } else if let Some(last) = found.last_mut().filter(|_| inside && follows && !line.trim().is_empty()) {
            last.output.push((number, line.to_owned()));
        }
    }
    Ok(found)
}

/// True if the words between the ` ... ` of a shown line stand in this line, in order, up to its ends.
fn fits(shown: &str, said: &str) -> bool {
    let parts: Vec<String> = shown.split("...").map(|part| squeezed(part.trim())).collect();
    let said = squeezed(said);
    let [first, others @ ..] = parts.as_slice() else { return false };
    let Some(mut rest) = said.strip_prefix(first.as_str()) else { return false };
    let Some((last, middle)) = others.split_last() else { return rest.is_empty() };
    for part in middle {
        let Some(at) = rest.find(part.as_str()) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last.as_str())
}

/// The words with one blank between them: the width of columns does not count.
fn squeezed(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Exit code that the shown lines announce: the hundreds of the error.
fn exit_code(shown: &Shown) -> i32 {
    let mut codes = shown.output.iter().filter_map(|(_, line)| line.strip_prefix("error[E")?.split(']').next());
    codes.next().and_then(|code| code.parse::<i32>().ok()).map_or(0, |code| code / 100)
}

/// Compares shown lines with both streams, each in its own order: a terminal mixes them.
fn compare(shown: &Shown, streams: [&str; 2]) -> Result<(), String> {
    let mut rest = streams.map(|stream| stream.lines().collect::<Vec<_>>());
    for (number, line) in shown.output.iter().filter(|(_, line)| line.trim() != "...") {
        let place = rest.iter().enumerate().find_map(|(stream, lines)| {
            lines.iter().position(|said| fits(line, said)).map(|position| (stream, position))
        });
        let (stream, position) =
            place.ok_or_else(|| format!("{number}: not said: {line}\n{}\n{}", streams[0], streams[1]))?;
        rest[stream].drain(..=position);
    }
    Ok(())
}

/// Plays the commands of a page in a folder.
fn play(text: &str, folder: &Path) -> Result<usize, String> {
    let (mut environment, mut background) = (Vec::<(String, String)>::new(), Vec::new());
    let mut executed = 0;
    for shown in commands(text)? {
        let line = shown.line;
        let words: Vec<&str> = shown.words.split_whitespace().collect();
        match words.as_slice() {
            ["cp", from, "."] => {
                let source = from.strip_prefix("../../").ok_or(format!("{line}: not a file of the repository"))?;
                let name = Path::new(source).file_name().ok_or(format!("{line}: no name"))?;
                fs::copy(repository().join(source), folder.join(name)).map_err(|error| format!("{line}: {error}"))?;
            }
            ["export", setting] => {
                let (name, value) = setting.split_once('=').ok_or(format!("{line}: no value"))?;
                environment.push((name.to_owned(), value.to_owned()));
            }
            ["tactus", arguments @ ..] => {
                executed += 1;
                let (arguments, stays) = match arguments.split_last() {
                    Some((&"&", before)) => (before, true),
                    _ => (arguments, false),
                };
                let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
                command.current_dir(folder).env("XDG_CONFIG_HOME", folder).env_remove("TACTUS_DEVICE");
                command.env_remove("TACTUS_TIMEOUT").envs(environment.iter().cloned());
                command.args(arguments).stdin(Stdio::null());
                if stays {
                    background.push(leave(&mut command, &shown)?);
                } else {
                    finish(&mut command, &shown)?;
                }
            }
            _ => return Err(format!("{line}: this test cannot execute '{}'", shown.words)),
        }
    }
    Ok(executed)
}

/// Runs a command to its end.
fn finish(command: &mut Command, shown: &Shown) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{}: {error}", shown.line))?;
    let [stdout, stderr] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let expected = exit_code(shown);
    if output.status.code() != Some(expected) {
        return Err(format!("{}: {} instead of {expected}\n{stdout}\n{stderr}", shown.line, output.status));
    }
    compare(shown, [&stdout, &stderr])
}

/// Starts a command that stays, and waits until it has said on stderr what is shown.
fn leave(command: &mut Command, shown: &Shown) -> Result<Background, String> {
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut running = Background(child.map_err(|error| format!("{}: {error}", shown.line))?);
    let stderr = running.0.stderr.take().ok_or("stderr is a pipe")?;
    let mut said = BufReader::new(stderr).lines().map_while(Result::ok);
    for (number, line) in shown.output.iter().filter(|(_, line)| line.trim() != "...") {
        if !said.any(|said| fits(line, &said)) {
            return Err(format!("{number}: it ended without saying: {line}"));
        }
    }
    // Read on, so that the pipe never is full and never is closed.
    std::thread::spawn(move || said.for_each(drop));
    Ok(running)
}

#[track_caller]
fn page(name: &str) {
    let text = fs::read_to_string(repository().join("docs").join(name)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    match play(&text, folder.path()) {
        Ok(executed) => assert!(executed > 0, "docs/{name} has no command"),
        Err(error) => panic!("docs/{name}:{error}"),
    }
}

/// At 300 Hz: the pages show figures of that rate.
///
/// One test a page, so that they run side by side, and a test that no page is forgotten.
macro_rules! pages {
    ($($test:ident $name:literal)*) => {
        const PAGES: &[&str] = &[$($name),*];
        $(#[test] fn $test() { page($name) })*
    };
}

pages! {
    the_tutorial_does_what_it_shows "tutorial.md"
    watching_does_what_its_page_shows "how-to/watch-a-run.md"
    moving_settings_does_what_its_page_shows "how-to/move-settings.md"
    a_failed_run_is_found_out_as_its_page_shows "how-to/why-a-run-failed.md"
    reading_recordings_does_what_its_page_shows "how-to/read-recordings.md"
}

/// The rest of the lab guide needs an arm, or a second person; this section needs neither.
#[test]
fn a_fault_looks_as_the_lab_guide_shows() {
    let guide = fs::read_to_string(repository().join("docs/lab-guide.md")).unwrap();
    let (_, section) = guide.split_once("## 13. What faults look like").unwrap();
    let (section, _) = section.split_once("`tactus stop` says which fault is latched").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let scripts = folder.path().join("tests/faults");
    fs::create_dir_all(&scripts).unwrap();
    fs::copy(repository().join("tests/faults/a3.toml"), scripts.join("a3.toml")).unwrap();
    let before = "```\n$ cp ../../docs/examples/reach.csv .\n$ tactus learn reach.csv --output first.toml\n```\n";
    assert_eq!(play(&format!("{before}{section}"), folder.path()), Ok(4));
}

#[test]
fn every_how_to_page_is_played() {
    for entry in fs::read_dir(repository().join("docs/how-to")).unwrap() {
        let name = format!("how-to/{}", entry.unwrap().file_name().to_str().unwrap());
        assert!(PAGES.contains(&name.as_str()), "docs/{name} is not in the list of this test");
    }
}

#[test]
fn a_page_that_shows_something_else_is_refused_with_its_line() {
    assert!(fits("ms ... 0", "ms  0.1 0") && fits("a ... c ...", "a b c d") && !fits("a ... b", "a b c"));
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str| play(text, folder.path()).unwrap_err();
    let shown = "```\n$ tactus explain E702\nE702: ... did not answer in time\n```\n";
    assert_eq!(play(shown, folder.path()), Ok(1));
    assert!(refused(&shown.replace("in time", "at all")).starts_with("3: not said"));
    assert!(refused(&shown.replace("E702: ... did", "... did not")).starts_with("3: not said"));
    assert!(refused(&shown.replace("explain E702", "explain E999")).starts_with("2: exit status: 2 instead of 0"));
    assert!(refused("```\ntactus list\n```\n").starts_with("2: a command without"));
    assert!(refused("```\n$ rm -r .\n```\n").starts_with("2: this test cannot execute"));
    assert!(refused("```\n$ tactus explain E999 &\nready\n```\n").starts_with("3: it ended without saying"));
}
