//! The lab guide cannot rot: every `tactus` command line in it is one that this tool takes.

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use tactus::cmd::Cli;

const GUIDE: &str = include_str!("../../docs/lab-guide.md");
const ERRORS: &str = include_str!("../../docs/errors.md");

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
fn the_guide_shows_the_link_and_the_words_of_today() {
    use lab::error::HostError;
    let shown = |name: &str| {
        let line = GUIDE.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("no line of {name}"));
        line.trim_start_matches(name).trim().to_owned()
    };
    assert_eq!(shown("link version"), link::LINK_VERSION.to_string());
    assert_eq!(shown("schema"), format!("0x{:08x}", link::SCHEMA_HASH));
    assert_eq!(shown("robot model"), format!("0x{:08x}", control::MODEL_HASH));
    let owner = link::SessionOwner { name: link::Text::new("anna@lab3 (process 4711)"), since_ms: 12_000 };
    let failure = HostError::InUse { owner: Some(owner), wait_ms: 440 }.into_failure("delete").to_string();
    assert!(GUIDE.contains(&failure), "{failure}");
}

/// Options of the tool and of all its commands, each with the values that it takes; none: any.
fn options(command: &clap::Command) -> Vec<(String, Vec<String>)> {
    let values =
        |argument: &clap::Arg| argument.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect();
    let own = command.get_arguments().flat_map(|argument| {
        let names = argument.get_long_and_visible_aliases().unwrap_or_default();
        names.into_iter().map(|name| (name.to_owned(), values(argument))).collect::<Vec<_>>()
    });
    own.chain(command.get_subcommands().flat_map(options)).collect()
}

/// The options in the code spans of a document that are not about other programs, each with its value, if there is one.
fn options_named(document: &str) -> Vec<(usize, String, Option<String>)> {
    let spans = document.lines().enumerate().flat_map(|(index, line)| {
        line.split('`').skip(1).step_by(2).map(move |span| (index + 1, span)).collect::<Vec<_>>()
    });
    let ours =
        spans.filter(|(_, span)| span.starts_with("--") || span.starts_with("tactus ") || span.starts_with("run "));
    let named = |(line, span): (usize, &str)| {
        let words: Vec<String> = span.split_whitespace().map(str::to_owned).collect();
        let option = |at: usize| {
            let value = words.get(at + 1).filter(|value| !value.starts_with('-')).cloned();
            Some((line, words[at].strip_prefix("--")?.to_owned(), value))
        };
        (0..words.len()).filter_map(option).collect::<Vec<_>>()
    };
    ours.flat_map(named).collect()
}

#[test]
fn every_option_that_an_error_advises_is_one_of_the_tool_with_a_value_it_takes() {
    let known = options(&Cli::command());
    let named = options_named(ERRORS);
    assert!(named.len() >= 30, "only {} options were found: the errors or this test have changed", named.len());
    for (line, option, value) in named {
        let takes = |values: &[String]| value.as_ref().is_none_or(|value| values.is_empty() || values.contains(value));
        // A switch takes none of what follows it.
        let is_taken = |values: &[String]| takes(values) || values == ["true", "false"];
        assert!(
            option == "help" || known.iter().any(|(name, values)| *name == option && is_taken(values)),
            "docs/errors.md:{line}: --{option} {}",
            value.unwrap_or_default()
        );
    }
}

#[test]
fn a_command_is_found_in_a_block_in_a_pipe_and_in_prose_and_a_wrong_one_is_refused() {
    let text = "say `tactus stop`\n```\n$ TACTUS_DEVICE=sil: tactus list > file # note\ncandump can0 | tactus can decode -\noutput of tactus\n```\n";
    let found: Vec<String> = command_lines(text).into_iter().map(|(_, command)| command).collect();
    assert_eq!(found, ["tactus stop", "tactus list", "tactus can decode -"]);
    assert!(Cli::try_parse_from(["tactus", "run", "a.toml", "--sped", "0.3"]).is_err());
}
