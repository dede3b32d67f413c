//! The lab guide cannot rot: every `tactus` command line in it is one that this tool takes.

use clap::Parser;
use clap::error::ErrorKind;
use tactus::cmd::Cli;

const GUIDE: &str = include_str!("../../docs/lab-guide.md");

/// Command lines of the guide with their line numbers: in code blocks the lines that begin with `tactus` (after a
/// prompt or a variable), in prose what stands between backticks and begins with it.
fn command_lines(guide: &str) -> Vec<(usize, String)> {
    let mut inside = false;
    let mut found = Vec::new();
    for (index, line) in guide.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
            continue;
        }
        let spans: Vec<&str> =
            if inside { line.split(" | ").collect() } else { line.split('`').skip(1).step_by(2).collect() };
        found.extend(spans.into_iter().filter_map(command).map(|text| (index + 1, text)));
    }
    found
}

/// The words of a `tactus` command, without prompt, variables, comment, redirection and `&`.
fn command(text: &str) -> Option<String> {
    let mut words = text.split_whitespace().skip_while(|word| *word == "$" || word.contains("TACTUS_"));
    let first = words.next()?;
    let rest: Vec<&str> = words.take_while(|word| !word.starts_with(['#', '>', '&', '<']) && *word != "2>").collect();
    (first == "tactus" && !rest.is_empty()).then(|| format!("tactus {}", rest.join(" ")))
}

#[test]
fn every_command_of_the_lab_guide_is_taken_by_the_tool() {
    let commands = command_lines(GUIDE);
    assert!(commands.len() >= 30, "only {} commands were found: the guide or this test has changed", commands.len());
    for (line, text) in commands {
        let parsed = Cli::try_parse_from(text.split(' '));
        if let Err(error) = parsed
            && !matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion)
        {
            panic!("docs/lab-guide.md:{line}: `{text}`\n{error}");
        }
    }
}

#[test]
fn the_guide_names_every_thing_a_person_must_do_at_the_pendant_in_the_words_of_the_device() {
    use device::Stage;
    for stage in [Stage::WaitingForIdle, Stage::WaitingForZero, Stage::WaitingForActive] {
        assert!(GUIDE.contains(stage.explanation()), "docs/lab-guide.md does not say '{}'", stage.explanation());
    }
}

#[test]
fn a_command_is_found_in_a_block_in_a_pipe_and_in_prose_and_a_wrong_one_is_refused() {
    let text = "say `tactus stop`\n```\n$ TACTUS_DEVICE=sil: tactus list > file # note\ncandump can0 | tactus can decode -\noutput of tactus\n```\n";
    let found: Vec<String> = command_lines(text).into_iter().map(|(_, command)| command).collect();
    assert_eq!(found, ["tactus stop", "tactus list", "tactus can decode -"]);
    assert!(Cli::try_parse_from(["tactus", "run", "a.toml", "--sped", "0.3"]).is_err());
}
