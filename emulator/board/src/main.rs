//! The emulated board as a program: `serve` for the lock step with a host, `check` by itself.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand, ValueEnum};
use emulated_board::can::HostLine;
use emulated_board::fault::{Fault, SYNTAX};
use emulated_board::image::Image;
use emulated_board::run::run;
use emulated_board::setup::{MIPS, REVISION_V, Setup};
use emulated_board::world::Lockstep;
use fdcan_model::Cancellation;
use serde_json::Value;

/// The NUCLEO-H743ZI2, emulated.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs an image in lock step with a host on standard input and output (docs/lockstep.md).
    Serve {
        /// The image, an ELF file.
        #[arg(long)]
        image: PathBuf,
        /// Content of bank 2, 1 MiB; made if it does not exist.
        #[arg(long)]
        bank2: Option<PathBuf>,
        /// The line the host is on.
        #[arg(long, value_enum, default_value_t = Line::Serial)]
        host_line: Line,
        /// Where the image's log goes, as it comes from its buffer.
        #[arg(long)]
        log: Option<PathBuf>,
        /// Where the report goes.
        #[arg(long)]
        report: Option<PathBuf>,
        /// Effect of a cancelled place in the transmit queue of the CAN controller.
        #[arg(long, value_enum, default_value_t = Reading::Skipped)]
        cancellation: Reading,
        /// Revision of the silicon, REV_ID of DBGMCU.IDC.
        #[arg(long, value_parser = hexadecimal, default_value_t = REVISION_V)]
        revision: u16,
        /// Million instructions a second of virtual time.
        #[arg(long, default_value_t = MIPS)]
        mips: u32,
        #[arg(long = "fault", help = SYNTAX)]
        faults: Vec<Fault>,
    },
    /// Boots an image against an arm in this process and compares what it does with what it must do.
    Check {
        /// The image, an ELF file.
        #[arg(long)]
        image: PathBuf,
        /// One JSON object on standard output instead of a table.
        #[arg(long)]
        json: bool,
    },
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Line {
    Serial,
    Can,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Reading {
    Skipped,
    Stuck,
}

fn hexadecimal(text: &str) -> Result<u16, std::num::ParseIntError> {
    u16::from_str_radix(text.trim_start_matches("0x"), 16)
}

/// Exit status of a check: something is not as it must be.
const DEVIATION: u8 = 1;
/// Exit status: the arguments or the image cannot be used.
const BAD_IMAGE: u8 = 2;
/// Exit status: the image did what it must not, or the emulation cannot go on.
const FAILED: u8 = 3;

fn main() -> ExitCode {
    match Arguments::parse().command {
        Command::Serve { image, bank2, host_line, log, report, cancellation, revision, mips, faults } => {
            let setup = Setup {
                host: match host_line {
                    Line::Serial => HostLine::Serial,
                    Line::Can => HostLine::Can,
                },
                cancellation: match cancellation {
                    Reading::Skipped => Cancellation::Skipped,
                    Reading::Stuck => Cancellation::Stuck,
                },
                revision,
                bank2,
                log,
                mips,
                faults,
                tells: true,
                ..Setup::default()
            };
            serve(&image, &setup, report)
        }
        Command::Check { image, json } => check(&image, json),
    }
}

fn read(path: &Path) -> Result<Arc<Image>, ExitCode> {
    Image::read(path).map(Arc::new).map_err(|error| {
        eprintln!("{error}");
        ExitCode::from(BAD_IMAGE)
    })
}

fn check(image: &Path, json: bool) -> ExitCode {
    let image = match read(image) {
        Ok(image) => image,
        Err(code) => return code,
    };
    let checked = match emulated_board::check::check(&image) {
        Ok(checked) => checked,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(FAILED);
        }
    };
    let is_right = checked.is_right();
    if json {
        println!("{:#}", Value::Object(checked.report));
    } else {
        println!("{}: {}, {}", image.path.display(), image.firmware, image.hash);
        print!("{}", checked.table());
    }
    if is_right {
        return ExitCode::SUCCESS;
    }
    for reason in &checked.reasons {
        eprintln!("{reason}");
    }
    ExitCode::from(DEVIATION)
}

fn serve(image: &Path, setup: &Setup, report: Option<PathBuf>) -> ExitCode {
    let image = match read(image) {
        Ok(image) => image,
        Err(code) => return code,
    };
    let world = Lockstep::new(io::stdin(), io::stdout());
    let outcome = match run(&image, setup, Box::new(world)) {
        Ok(outcome) => outcome,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(FAILED);
        }
    };
    if let Some(path) = report {
        let text = format!("{:#}\n", Value::Object(outcome.measured.json(&image)));
        if let Err(error) = fs::write(&path, text) {
            eprintln!("{}: {error}", path.display());
            return ExitCode::from(FAILED);
        }
    }
    if let Some(operation) = outcome.power_cut {
        eprintln!("power failed in the middle of an operation of bank 2: {operation}");
    }
    match outcome.cut_short {
        None => ExitCode::SUCCESS,
        Some(reason) => {
            eprintln!("the run ends here: {reason}");
            ExitCode::from(FAILED)
        }
    }
}
