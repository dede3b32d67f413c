//! The `tactus` command.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;

use signal_hook::consts::signal::SIGXFSZ;

fn main() -> ExitCode {
    // Without a handler a file that reaches the limit for files ends the program; with one it is a full disk.
    if let Err(cause) = signal_hook::flag::register(SIGXFSZ, Arc::default()) {
        let _ = writeln!(std::io::stderr(), "warning: a limit for files may end this program ({cause})");
    }
    match tactus::cmd::parse() {
        Ok(cli) => tactus::cmd::run(cli),
        Err(code) => code,
    }
}
