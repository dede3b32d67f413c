//! The command line: one subcommand a file, each with a `Cmd` (its options) and a `run`.

pub mod calibrate;
mod calibration_report;
pub mod can;
pub mod check;
pub mod compare;
pub mod completions;
pub mod config;
mod connection;
pub mod delete;
pub mod doctor;
mod examples;
pub mod experiment;
mod experiment_values;
pub mod explain;
pub mod export;
pub mod faults;
mod files;
pub mod flash;
pub mod friction;
pub mod get;
pub mod hand;
mod interruption;
pub mod learn;
pub mod list;
pub mod logs;
pub mod manual;
pub mod monitor;
pub mod output;
pub mod payload;
pub mod plot;
pub mod preflight;
mod progress;
pub mod record;
pub mod rehearse;
pub mod rename;
pub mod report;
pub mod run;
mod run_folder;
pub mod run_report;
pub mod secret;
pub mod settings;
pub mod sim;
pub mod statistics;
pub mod status;
pub mod stop;
mod storage;
mod swallowed;
pub mod tare;
pub mod teach;
pub mod upload;
pub mod weigh;

use std::io::{IsTerminal as _, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

pub use output::Output;

use lab::error::HostError;
use lab::error_code::ErrorCode;
use lab::failure::Failure;
use lab::table::Table;
use lab::transport::Address;

use crate::config::{self as configuration, Config, DEVICE_VARIABLE, Origin, Origins, TIMEOUT_VARIABLE, seconds};

/// Teach, learn, check, upload, run and watch movement primitives on a Barrett WAM.
///
/// Data goes to stdout, words and progress to stderr. Exit codes: 0 success, 1 internal error, 2 usage or a file,
/// 3 device not found, 4 incompatible versions, 5 device refused or faulted, 6 validation failed, 7 link lost,
/// 130 interrupted after a confirmed stop.
#[derive(Debug, Parser)]
#[command(name = "tactus", version, propagate_version = true, disable_help_flag = true, disable_version_flag = true, after_help = examples::ALL)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// The action.
    #[command(subcommand)]
    pub command: Command,
}

/// Options that every command has.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Write data as JSON: one object, or one a line for streams.
    #[arg(long, global = true)]
    pub json: bool,
    /// Say nothing but results, warnings and errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Never ask; what would be asked is refused.
    #[arg(long, global = true, hide_short_help = true)]
    pub non_interactive: bool,
    /// Replace files that exist.
    #[arg(long, global = true)]
    pub force: bool,
    /// Show this help; `--help-all` shows more of it.
    #[arg(long, short, global = true, action = ArgAction::HelpShort)]
    pub help: Option<bool>,
    /// Show the help with every explanation.
    #[arg(long, global = true, action = ArgAction::HelpLong, hide_short_help = true)]
    pub help_all: Option<bool>,
    /// Print the version.
    #[arg(long, short = 'V', global = true, action = ArgAction::Version)]
    pub version: Option<bool>,
    /// The device, such as `sil:` or `serial:PATH`; `tactus --help` lists them.
    #[arg(long, global = true, env = DEVICE_VARIABLE, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Longest wait for an answer of the device, s.
    #[arg(long, global = true, env = TIMEOUT_VARIABLE, default_value = "2", value_parser = seconds, value_name = "SECONDS")]
    pub timeout: Duration,
    /// File with the secret of a device that keeps one (`tactus secret`).
    #[arg(long, global = true, env = "TACTUS_SECRET_FILE", value_name = "FILE", hide_short_help = true)]
    pub secret_file: Option<PathBuf>,
    /// Where the values of these options come from.
    #[arg(skip)]
    pub origins: Origins,
}

impl Global {
    /// True if the device is simulated in this process: nobody else can use it.
    fn is_simulated_here(&self) -> bool {
        let address = self.device.as_deref().map(str::parse::<Address>);
        matches!(address, Some(Ok(Address::Simulated(..))))
    }

    /// True if the device is simulated in this process and keeps nothing in a file: what it stores ends with the
    /// command.
    fn forgets(&self) -> bool {
        let address = self.device.as_deref().map(str::parse::<Address>);
        matches!(address, Some(Ok(Address::Simulated(_, options))) if options.flash.is_none())
    }

    /// Says that what the device has just been told to keep is gone with the command, where it is.
    fn tell_forgotten(&self) {
        if self.forgets() {
            self.output().say(
                "this simulated device ends with the command, and what it keeps with it: `flash=FILE` in its address \
                 keeps it, `tactus sim` serves one that stays",
            );
        }
    }

    /// The address that the options name, if any.
    ///
    /// # Errors
    /// It is none. The help names the place to correct it.
    fn address(&self, doing: &str) -> Result<Option<Address>, Failure> {
        let Some(text) = &self.device else { return Ok(None) };
        let address = text.parse().map_err(|error| {
            let failure = HostError::Address(error).into_failure(doing);
            match (self.origins.device, &self.origins.file) {
                (Origin::File, Some(file)) => {
                    failure.help(format!("correct `device` in {}, or give `--device`", file.display()))
                }
                (Origin::Environment, _) => failure.help("correct TACTUS_DEVICE, or give `--device`"),
                _ => failure,
            }
        })?;
        Ok(Some(address))
    }

    /// Where output goes.
    pub fn output(&self) -> Output {
        Output { json: self.json, quiet: self.quiet }
    }
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Serve a simulated arm to other terminals
    #[command(after_help = examples::SIM)]
    Sim(sim::Cmd),
    /// Make the arm weightless and record what a person shows
    #[command(after_help = examples::TEACH)]
    Teach(teach::Cmd),
    /// Make a primitive from a demonstration
    #[command(after_help = examples::LEARN)]
    Learn(learn::Cmd),
    /// Run a primitive without feedback and record the forces that it should expect
    #[command(after_help = examples::REHEARSE)]
    Rehearse(rehearse::Cmd),
    /// Learn the usual forces of successful runs, so that the device notices an unusual one
    #[command(alias = "experience", after_help = examples::STATISTICS)]
    Statistics(statistics::Cmd),
    /// Validate a primitive before it moves an arm
    #[command(after_help = examples::CHECK)]
    Check(check::Cmd),
    /// Put a primitive into the device
    #[command(after_help = examples::UPLOAD)]
    Upload(upload::Cmd),
    /// List the primitives in the device
    #[command(after_help = examples::LIST)]
    List(list::Cmd),
    /// Read a primitive back from the device into a file
    #[command(after_help = examples::GET)]
    Get(get::Cmd),
    /// Give a primitive in the device another name
    #[command(after_help = examples::RENAME)]
    Rename(rename::Cmd),
    /// Delete a primitive in the device
    #[command(after_help = examples::DELETE)]
    Delete(delete::Cmd),
    /// Play a primitive on the arm
    #[command(after_help = examples::RUN)]
    Run(run::Cmd),
    /// Show what the device says of itself and its arm
    #[command(after_help = examples::STATUS)]
    Status(status::Cmd),
    /// Show, measure or declare the home, weight, friction and payload of this arm
    #[command(after_help = examples::CALIBRATE)]
    Calibrate(calibrate::Cmd),
    /// Take the present readings of force sensor and strain gauges as zero
    #[command(after_help = examples::TARE)]
    Tare(tare::Cmd),
    /// Initialise, open, close or move the hand
    #[command(after_help = examples::HAND)]
    Hand(hand::Cmd),
    /// Show the present and the last fault, what to do, and the second before it
    #[command(after_help = examples::FAULTS)]
    Faults(faults::Cmd),
    /// Bring the arm to rest
    #[command(after_help = examples::STOP)]
    Stop(stop::Cmd),
    /// Watch the arm on one screen, beside whoever commands it
    #[command(after_help = examples::MONITOR)]
    Monitor(monitor::Cmd),
    /// Record what the arm does, as CSV
    #[command(after_help = examples::RECORD)]
    Record(record::Cmd),
    /// Write the firmware image to a board
    #[command(after_help = examples::FLASH)]
    Flash(flash::Cmd),
    /// Show what a device logs
    #[command(after_help = examples::LOGS)]
    Logs(logs::Cmd),
    /// Grasp simulated objects that stand elsewhere than taught
    #[command(after_help = examples::EXPERIMENT)]
    Experiment(experiment::Cmd),
    /// Draw demonstration, plan and execution
    #[command(after_help = examples::PLOT)]
    Plot(plot::Cmd),
    /// Write a page of HTML about one run or several
    #[command(after_help = examples::REPORT)]
    Report(report::Cmd),
    /// Convert a recording to MCAP, for robotics viewers
    #[command(after_help = examples::EXPORT)]
    Export(export::Cmd),
    /// Explain an error or a fault
    #[command(after_help = examples::EXPLAIN)]
    Explain(explain::Cmd),
    /// Write what a shell needs to complete command lines
    #[command(after_help = examples::COMPLETIONS)]
    Completions(completions::Cmd),
    /// Write a page of the manual for each command
    #[command(after_help = examples::MANUAL)]
    Manual(manual::Cmd),
    /// Show the tool's settings, or read, change, compare and restore the device's
    #[command(after_help = examples::CONFIG)]
    Config(config::Cmd),
    /// Let nobody command the device who does not know a secret
    #[command(after_help = examples::SECRET)]
    Secret(secret::Cmd),
    /// Check everything that a command needs, and say what is missing
    #[command(after_help = examples::DOCTOR)]
    Doctor(doctor::Cmd),
    /// Compare two recordings of the same movement
    #[command(after_help = examples::COMPARE)]
    Compare(compare::Cmd),
    /// Decode logs of the arm's CAN bus, or replay them to the control code
    #[command(after_help = examples::CAN)]
    Can(can::Cmd),
}

/// Reads the command line of this process, with the defaults of the configuration file.
///
/// # Errors
/// The command line is wrong, or asks for help; or what was asked for cannot be done with the configuration file there
/// is.
pub fn parse() -> Result<Cli, ExitCode> {
    let file = configuration::path();
    let config = file.as_deref().map_or(Ok(Config::default()), Config::read);
    let defaults = config.as_ref().ok().cloned().unwrap_or_default();
    let (mut cli, matches) = read(defaults.defaults(Cli::command()))?;
    cli.global.origins = defaults.origins(&matches, file);
    // What explains the error is not to fail with it.
    let needs_none = matches!(
        cli.command,
        Command::Config(config::Cmd { action: None })
            | Command::Doctor(_)
            | Command::Explain(_)
            | Command::Completions(_)
            | Command::Manual(_)
    );
    let Err(failure) = config else { return Ok(cli) };
    // An arm is not left moving because of a file that only saves typing.
    if matches!(cli.command, Command::Stop(_)) {
        let origins = &mut cli.global.origins;
        if let (None, Some(file)) = (&cli.global.device, &origins.file) {
            cli.global.device = Config::device_named(file);
            origins.device = Origin::File;
        }
        if cli.global.device.is_some() {
            cli.global.output().warn(format!("{}: {}", failure.doing, failure.cause));
            return Ok(cli);
        }
    }
    if !needs_none {
        return Err(tell(&failure, cli.global.json));
    }
    cli.global.origins.problem = Some(format!("{}: {}", failure.doing, failure.cause));
    Ok(cli)
}

/// Reads the command line of this process. A time-out in the environment that is none does not prevent a stop.
fn read(mut command: clap::Command) -> Result<(Cli, ArgMatches), ExitCode> {
    let parsed = |command: &mut clap::Command| {
        let matches = command.try_get_matches_from_mut(std::env::args_os())?;
        let cli = Cli::from_arg_matches(&matches).map_err(|error| error.format(command))?;
        Ok::<_, clap::Error>((cli, matches))
    };
    // Parsing completes a command, so that what follows begins with another.
    let another = command.clone();
    let error = match parsed(&mut command) {
        Ok(read) => return Ok(read),
        Err(error) => error,
    };
    let Some((cause, mut without)) = configuration::without_wrong_timeout(another) else { return Err(usage(&error)) };
    // Nobody has typed the option that clap names.
    let Ok(read) = parsed(&mut without) else { return Err(usage(&error)) };
    let output = read.0.global.output();
    // clap looks at the variable even where the option is given.
    let (mut is_given, mut matches) = (false, &read.1);
    loop {
        is_given |= matches.value_source("timeout") == Some(ValueSource::CommandLine);
        let Some((_, inner)) = matches.subcommand() else { break };
        matches = inner;
    }
    if is_given {
        return Ok(read);
    }
    if matches!(read.0.command, Command::Stop(_)) {
        output.warn(format!("{TIMEOUT_VARIABLE} is ignored: {cause}"));
        return Ok(read);
    }
    let failure = Failure::new(ErrorCode::CommandLine, TIMEOUT_VARIABLE, cause)
        .help(format!("correct {TIMEOUT_VARIABLE} in the environment, or give `--timeout`"));
    Err(tell(&failure, output.json))
}

/// Runs what the command line asks for and reports failures; gives the exit code of the process.
pub fn run(cli: Cli) -> ExitCode {
    interruption::clear_away();
    let global = cli.global;
    let result = match cli.command {
        Command::Sim(command) => sim::run(&command, &global),
        Command::Teach(command) => teach::run(&command, &global),
        Command::Upload(command) => upload::run(&command, &global),
        Command::List(command) => list::run(&command, &global),
        Command::Get(command) => get::run(&command, &global),
        Command::Rename(command) => rename::run(&command, &global),
        Command::Delete(command) => delete::run(&command, &global),
        Command::Run(command) => run::run(&command, &global),
        Command::Stop(command) => stop::run(&command, &global),
        Command::Status(command) => status::run(&command, &global),
        Command::Faults(command) => faults::run(&command, &global),
        Command::Calibrate(command) => calibrate::run(&command, &global),
        Command::Tare(command) => tare::run(&command, &global),
        Command::Monitor(command) => monitor::run(&command, &global),
        Command::Record(command) => record::run(&command, &global),
        Command::Learn(command) => learn::run(&command, &global),
        Command::Check(command) => check::run(&command, &global),
        Command::Rehearse(command) => rehearse::run(&command, &global),
        Command::Statistics(command) => statistics::run(&command, &global),
        Command::Hand(command) => hand::run(&command, &global),
        Command::Flash(command) => flash::run(&command, &global),
        Command::Logs(command) => logs::run(&command, &global),
        Command::Experiment(command) => experiment::run(&command, &global),
        Command::Plot(command) => plot::run(&command, &global),
        Command::Report(command) => report::run(&command, &global),
        Command::Export(command) => export::run(&command, &global),
        Command::Explain(command) => explain::run(&command, &global),
        Command::Completions(command) => completions::run(&command, &global),
        Command::Manual(command) => manual::run(&command, &global),
        Command::Config(command) => config::run(&command, &global),
        Command::Secret(command) => secret::run(&command, &global),
        Command::Doctor(command) => doctor::run(&command, &global),
        Command::Compare(command) => compare::run(&command, &global),
        Command::Can(command) => can::run(&command, &global),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => tell(&connection::afterwards(failure, &global), global.json),
    }
}

/// Tells a failure; gives the exit code of the process.
fn tell(failure: &Failure, json: bool) -> ExitCode {
    // Nobody may be there any more to read it; the exit code still tells.
    if json {
        let _ = writeln!(std::io::stdout(), "{}", failure.to_json());
    }
    let _ = writeln!(std::io::stderr(), "{failure}");
    ExitCode::from(failure.code.exit() as u8)
}

/// Says what is wrong with the command line, or shows the help or version that was asked for; gives the exit code of
/// the process. With `--json` anywhere on the line the error is an object too.
pub fn usage(error: &clap::Error) -> ExitCode {
    let words: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    let wants_json = words.iter().any(|word| word == "--json");
    let hint = swallowed::hint(error, &words);
    if error.use_stderr() && wants_json {
        let failure = Failure::new(ErrorCode::CommandLine, "tactus", reason(&error.render().to_string()));
        let failure = failure.help(hint.clone().unwrap_or_else(|| help_of(&words)));
        // Nobody may be there any more to read it.
        let _ = writeln!(std::io::stdout(), "{}", failure.to_json());
    }
    let shown = error.print();
    if let Some(hint) = hint {
        let _ = writeln!(std::io::stderr(), "  help: {hint}");
    }
    if !error.use_stderr()
        && let Err(failure) = output::written(shown)
    {
        return tell(&failure, wants_json);
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}

/// The help of the command that these words name.
fn help_of(words: &[String]) -> String {
    let (mut command, mut named) = (Cli::command(), String::new());
    for word in words {
        if let Some(inner) = command.find_subcommand(word) {
            named = format!("{named} {}", inner.get_name());
            command = inner.clone();
        }
    }
    format!("`tactus{named} --help` shows what it takes")
}

/// The mistake in a command line, on one line: all that stands above the usage, or a word on a command that is
/// missing, for which the whole help is shown.
fn reason(text: &str) -> String {
    let Some(text) = text.strip_prefix("error: ") else { return "a command or an option is missing".to_owned() };
    let lines =
        text.lines().take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"));
    lines.map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Asks a person on a terminal; false where nobody may be asked, or for any answer but yes.
fn ask(global: &Global, question: &str) -> bool {
    if global.non_interactive || !std::io::stdin().is_terminal() || !std::io::stderr().is_terminal() {
        return false;
    }
    // Who cannot be asked does not agree.
    if write!(std::io::stderr(), "{question} [y/N] ").is_err() {
        return false;
    }
    let mut answer = String::new();
    let read = std::io::stdin().read_line(&mut answer);
    read.is_ok() && matches!(answer.trim(), "y" | "Y" | "yes")
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};
    use lab::procedure::Mode;

    use super::{Cli, Command};

    #[test]
    fn command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_help_fits_a_screen_and_has_examples_that_the_tool_takes() {
        // Whether clap wraps depends on what else is built with it: a screen of 120 columns in either case.
        let mut all = Cli::command().term_width(120);
        all.build();
        let mut commands = vec![all.clone()];
        commands.extend(all.get_subcommands().filter(|command| command.get_name() != "help").cloned());
        for mut command in commands {
            let name = command.get_name().to_owned();
            let help = command.render_help().to_string();
            let lines: usize = help.lines().map(|line| line.chars().count().max(1).div_ceil(120)).sum();
            assert!(lines <= 60, "{name}: {lines} lines\n{help}");
            let examples: Vec<&str> = help.lines().map(str::trim).filter(|line| line.starts_with("tactus ")).collect();
            assert!(!examples.is_empty(), "{name} has no example");
            for example in examples {
                let parsed = Cli::try_parse_from(example.split_whitespace());
                assert!(
                    parsed.is_ok(),
                    "{name}: {example}\n{}",
                    parsed.err().map(|e| e.to_string()).unwrap_or_default()
                );
            }
        }
    }

    /// The change that makes it fail: a limit that only the refusal tells.
    #[test]
    fn options_tell_the_limits_of_their_numbers() {
        let mut all = Cli::command().term_width(400);
        all.build();
        for (command, option, limit) in [
            ("learn", "--kernels", "2 to 100"),
            ("learn", "--cutoff", "Hz, below 150"),
            ("learn", "--still-speed", "m/s, at most 1"),
            ("learn", "--speed", "0.1 to 10"),
            ("learn", "--dwell", "at most 60 s"),
            ("rehearse", "--trials", "1 to 50"),
            ("rehearse", "--payload", "at most 4 kg"),
            ("rehearse", "--speed", "0.1 to 2"),
            ("run", "--speed", "0.1 to 2"),
            ("record", "--duration", "0.2 to 3600 s"),
            ("teach", "--duration", "0.2 to 3600 s"),
            ("monitor", "--duration", "at most 3600 s"),
            ("sim", "--duration", "at most 3600 s"),
        ] {
            let help = all.find_subcommand_mut(command).unwrap().render_help().to_string();
            let told = help.split_once(&format!("{option} <")).unwrap().1;
            assert!(told.lines().take(2).any(|line| line.contains(limit)), "{command} {option}: {limit}\n{told}");
        }
    }

    #[test]
    fn experiments_name_modes_by_letter_and_runs_by_word() {
        let parse = |line: &str| Cli::try_parse_from(line.split(' ')).map(|cli| cli.command);
        let Ok(Command::Experiment(experiment)) = parse("tactus experiment cup --modes a,d") else { panic!("letters") };
        assert_eq!(experiment.modes, [Mode::OpenLoop, Mode::RigidFingers]);
        let Ok(Command::Run(run)) = parse("tactus run reach.toml --mode adapt") else { panic!("a word") };
        assert_eq!(run.mode, Mode::Adaptive);
        assert!(
            parse("tactus experiment cup --modes adapt").is_err() && parse("tactus run reach.toml --mode c").is_err()
        );
    }
}
