//! `tactus can decode`: every frame of a log, or of a bus, in words.

use std::io::{BufWriter, ErrorKind, Write};
use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::source::Source;
use super::{ErrorCode, Failure, Global, Output, connection};
use crate::cmd::output;
use canlog::{BusKind, Interface, InterfaceTotals, LogLine, Meaning, Reader, Summary};
use lab::table::Table;

/// Options of `can decode`.
///
/// Lines go to stdout, and behind them a summary. Lines of the log that cannot be read go to stderr with their
/// numbers; the exit code is then 6.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// A log as `candump -L` writes it; `-` is standard input
    #[arg(value_name = "LOG")]
    pub log: Option<PathBuf>,
    /// Live from this CAN interface; of a log, only the lines of this interface
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// Wait for what is appended to the log, until Ctrl-C
    #[arg(long)]
    pub follow: bool,
    /// Only the summary
    #[arg(long)]
    pub summary: bool,
}

/// Times of a log beyond this one are those of a computer's clock, us: 2001 and later.
const SINCE_1970: u64 = 1_000_000_000_000_000;

/// A line of `tactus --json can decode`.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Decoded<'a> {
    /// A frame.
    Frame(Data<'a>),
    /// The last line.
    Summary {
        /// All that was read.
        summary: Sum<'a>,
    },
}

/// One frame as data.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Data<'a> {
    /// Time since the first frame; in a log of a simulation, since power-up, s.
    pub time_s: f64,
    /// The interface.
    pub interface: &'a str,
    /// Identifier, hexadecimal.
    pub id: String,
    /// The bytes, hexadecimal.
    pub data: String,
    /// The meaning.
    #[serde(flatten)]
    pub meaning: &'a Meaning,
}

/// The summary as data.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Sum<'a> {
    /// By interface, the arm's first.
    pub interfaces: &'a [Summary],
    /// Lines that are not in candump's format.
    pub unreadable_lines: u64,
    /// Times that time goes back by more than a second: the clock was set back, or these are several logs. The times
    /// behind it count from there on.
    pub times_set_back: u64,
    /// Segments of the host's link that are missing.
    pub link_segment_gaps: u32,
    /// Messages of the link that were damaged.
    pub link_damaged_messages: u32,
}

/// Reads a log or a bus.
///
/// # Errors
/// It cannot be opened, or holds lines that are not in candump's format.
pub(super) fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "can decode";
    let source = Source::open(command.log.as_deref(), command.interface.as_deref(), command.follow, DOING)?;
    let interrupt = connection::interrupt();
    let mut out = Printer::new(global.output(), !command.summary);
    let mut reader = Reader::default();
    let mut totals: Vec<InterfaceTotals> = Vec::new();
    let mut clock = Clock::default();
    let garbage = source.read(&interrupt, DOING, |heard| {
        // Whoever looks on wants to see what there is, and not what fills a buffer.
        let Some((number, mut line)) = heard else { return out.flush() };
        if let Some(said) = clock.put_forward(number, &mut line) {
            totals.iter_mut().for_each(InterfaceTotals::leap);
            global.output().warn(said);
        }
        if command.interface.as_deref().is_some_and(|only| *only != *line.interface) {
            return Ok(true);
        }
        let (meaning, _) = reader.read(&line);
        let place = reader.interfaces().iter().position(|interface| interface.name == line.interface).unwrap_or(0);
        totals.resize_with(reader.interfaces().len(), InterfaceTotals::default);
        if let Some(totals) = totals.get_mut(place) {
            totals.note(&line, &meaning);
        }
        out.line(&line, &meaning)
    })?;
    let mut seen: Vec<(&Interface, &InterfaceTotals)> = reader.interfaces().iter().zip(&totals).collect();
    // What is looked for is the arm's.
    seen.sort_by_key(|(interface, _)| interface.kind() == BusKind::Host);
    let summaries: Vec<Summary> =
        seen.iter().map(|(interface, totals)| totals.sum(&interface.name, &interface.decoder)).collect();
    let damage: Vec<(u32, u32)> = seen.iter().map(|(interface, _)| interface.link.damage()).collect();
    out.summaries(&summaries, &damage, garbage.lines, clock.set_back)?;
    garbage.cause().map_or(Ok(()), |cause| Err(Failure::new(ErrorCode::LogLines, DOING, cause)))
}

/// Farthest that a line may lie before the latest one, us: interfaces are not always logged in order.
const LONGEST_STEP_BACK_US: u64 = 1_000_000;

/// The time of a log whose clock was set back, or which is several logs one behind the other: it goes on.
#[derive(Debug, Default)]
struct Clock {
    /// Latest time as the log has it, and as it counts, us.
    latest_us: (u64, u64),
    /// Added to the times of the log, us.
    added_us: u64,
    /// Times that it was set back.
    set_back: u64,
}

impl Clock {
    /// Lets the time of a line go on; words for whoever reads if the log's does not.
    fn put_forward(&mut self, number: u64, line: &mut LogLine) -> Option<String> {
        let (at, (latest, counted)) = (line.time_us, self.latest_us);
        let is_back = latest.saturating_sub(at) > LONGEST_STEP_BACK_US;
        if is_back {
            self.added_us = counted.saturating_sub(at);
            self.set_back += 1;
            self.latest_us.0 = at;
        }
        line.time_us = at.saturating_add(self.added_us);
        self.latest_us = (self.latest_us.0.max(at), counted.max(line.time_us));
        is_back.then(|| {
            let (from, to) = (latest as f64 * 1e-6, at as f64 * 1e-6);
            format!("line {number}: time goes back from {from:.6} s to {to:.6} s: the clock was set back, or this is another log; what follows counts from there on")
        })
    }
}

/// Writes lines until nobody reads them any more.
struct Printer {
    out: BufWriter<std::io::StdoutLock<'static>>,
    output: Output,
    lines: bool,
    first_us: Option<u64>,
    closed: bool,
}

impl Printer {
    fn new(output: Output, lines: bool) -> Self {
        let out = BufWriter::new(std::io::stdout().lock());
        Self { out, output, lines, first_us: None, closed: false }
    }

    /// One frame; whether there is still a reader.
    fn line(&mut self, line: &LogLine, meaning: &Meaning) -> Result<bool, Failure> {
        // Logs of simulations count from power-up; those of a computer's clock are told from their first frame.
        let zero = if line.time_us < SINCE_1970 { 0 } else { line.time_us };
        let first = *self.first_us.get_or_insert(zero);
        if !self.lines {
            return Ok(true);
        }
        let time = line.time_us.saturating_sub(first) as f64 * 1e-6;
        let (id, data) = (line.frame.id_text(), line.frame.data_text());
        let text = if self.output.json {
            let data = Decoded::Frame(Data { time_s: time, interface: &line.interface, id, data, meaning });
            serde_json::to_string(&data).map_err(|cause| broken(cause.into()))?
        } else {
            let parties = format!("{} > {}", meaning.from, meaning.to);
            format!("{time:12.6}  {:5} {id:>8}  {data:16}  {parties:32}  {}", line.interface, meaning.sentence())
        };
        self.write(&text)
    }

    fn summaries(
        &mut self,
        summaries: &[Summary],
        damage: &[(u32, u32)],
        garbage: u64,
        times_set_back: u64,
    ) -> Result<(), Failure> {
        if self.output.json {
            let gaps: u32 = damage.iter().map(|(gaps, _)| gaps).sum();
            let bad: u32 = damage.iter().map(|(_, bad)| bad).sum();
            let summary = Sum {
                interfaces: summaries,
                unreadable_lines: garbage,
                times_set_back,
                link_segment_gaps: gaps,
                link_damaged_messages: bad,
            };
            let text = serde_json::to_string(&Decoded::Summary { summary }).map_err(|cause| broken(cause.into()))?;
            self.write(&text)?;
        } else {
            for (place, (summary, (gaps, bad))) in summaries.iter().zip(damage).enumerate() {
                let before = if self.lines || place > 0 { "\n" } else { "" };
                self.write(format!("{before}{}", summary_text(summary)).trim_end_matches('\n'))?;
                if gaps + bad > 0 {
                    self.write(&format!("host link: {gaps} gaps between segments, {bad} damaged messages"))?;
                }
            }
            if summaries.is_empty() {
                self.write("no frames")?;
            }
        }
        self.flush().map(|_| ())
    }

    /// Shows what was written; whether there is still a reader.
    fn flush(&mut self) -> Result<bool, Failure> {
        match self.out.flush() {
            Err(cause) if cause.kind() != ErrorKind::BrokenPipe => return Err(broken(cause.into())),
            Err(_) => self.closed = true,
            Ok(()) => {}
        }
        Ok(!self.closed)
    }

    fn write(&mut self, text: &str) -> Result<bool, Failure> {
        if self.closed {
            return Ok(false);
        }
        match writeln!(self.out, "{text}") {
            Ok(()) => Ok(true),
            // `tactus can decode log | head` is a way to use it.
            Err(cause) if cause.kind() == ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(false)
            }
            Err(cause) => Err(broken(cause.into())),
        }
    }
}

fn broken(cause: Box<dyn std::error::Error + Send + Sync>) -> Failure {
    Failure::of_file(ErrorCode::ResultNotWritten, output::WRITING, cause)
}

/// The summary of one interface for a terminal.
fn summary_text(summary: &Summary) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut text = format!(
        "{}: {} frames in {:.3} s, bus load {} (busiest 0.1 s: {}), {}\n",
        summary.interface,
        summary.frames,
        summary.seconds,
        percent(summary.load),
        percent(summary.load_busiest),
        match summary.unnamed {
            0 => "every frame is known".to_owned(),
            count => format!("{count} unknown frames"),
        }
    );
    let mut table = Table::new(["kind", "frames", "per second", "load"]);
    for kind in &summary.kinds {
        let rate = format!("{:.1}", kind.per_second);
        table.row([kind.kind.name().to_owned(), kind.frames.to_string(), rate, percent(kind.load)]);
    }
    text += &format!("\n{table}");
    if !summary.nodes.is_empty() {
        let mut table =
            Table::new(["node", "firmware", "replies owed", "came", "lost", "unasked", "delay mean", "worst"]);
        for node in &summary.nodes {
            table.row([
                node.name.clone(),
                node.firmware.map_or("-".to_owned(), |version| version.to_string()),
                node.asked.to_string(),
                node.answered.to_string(),
                node.lost.to_string(),
                node.unasked.to_string(),
                format!("{:.0} us", node.delay_mean_us),
                format!("{} us", node.delay_worst_us),
            ]);
        }
        text += &format!("\n{table}");
    }
    if let Some(cycle) = &summary.cycle {
        text += &format!(
            "\ncontrol cycle: {} cycles, {:.2} us ({:.2} Hz), deviation {:.2} us, {} to {} us, 99 % within {} us\n",
            cycle.cycles,
            cycle.mean_us,
            1e6 / cycle.mean_us,
            cycle.deviation_us,
            cycle.shortest_us,
            cycle.longest_us,
            cycle.p99_us
        );
    }
    text
}
