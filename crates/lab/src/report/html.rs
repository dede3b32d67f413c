//! The page of a report.

use std::fmt::Write as _;

use crate::primitive_file::PrimitiveFile;

use super::{ReportedRun, figures};

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#222}\
h1{font-size:1.6em}h2{font-size:1.2em;margin-top:2em;border-bottom:1px solid #ddd}\
table{border-collapse:collapse;margin:.6em 0}td,th{text-align:left;padding:.15em 1.2em .15em 0;vertical-align:top}\
th{font-weight:normal;color:#666}.good{color:#006b3c;font-weight:bold}.bad{color:#b00020;font-weight:bold}\
svg{width:100%;height:auto;display:block;font-family:sans-serif}";

/// The report of these runs; `title` is its heading.
pub fn page(title: &str, runs: &[ReportedRun], primitive: Option<&PrimitiveFile>) -> String {
    let title = escaped(title);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n<h2>What was asked</h2>\n"
    );
    html += &asked(runs, primitive);
    html += "<h2>What happened</h2>\n";
    for run in runs {
        html += &happened(run);
    }
    for (heading, figure) in figures::all(runs, primitive) {
        // Writing into a String cannot fail.
        let _ = write!(html, "<h2>{heading}</h2>\n{}\n", figure.draw().to_inline_svg());
    }
    html += "</body></html>\n";
    html
}

fn table(rows: &[(&str, String)]) -> String {
    let rows: String = rows.iter().map(|(name, value)| format!("<tr><th>{name}</th><td>{value}</td></tr>\n")).collect();
    format!("<table>\n{rows}</table>\n")
}

fn asked(runs: &[ReportedRun], primitive: Option<&PrimitiveFile>) -> String {
    let mut rows = Vec::new();
    match primitive {
        None => rows.push(("primitive", "not given; `tactus report --primitive FILE` adds what it expects".to_owned())),
        Some(file) => {
            rows.push(("primitive", escaped(&file.name)));
            rows.push(("content", format!("0x{:08x}", file.checksum())));
            rows.push(("as taught", format!("{:.2} s, {} kernels", file.movement.duration, file.kernels())));
            let rehearsed = file
                .expectation
                .as_ref()
                .map(|table| format!("{} run(s) of {:.2} s", table.trials, table.recorded_duration));
            rows.push(("expectation", rehearsed.unwrap_or_else(|| "none: never rehearsed".to_owned())));
            let statistics = file.statistics.as_ref().map(|table| format!("{} successful run(s)", table.trials));
            rows.push(("statistics", statistics.unwrap_or_else(|| "none".to_owned())));
        }
    }
    for run in runs {
        let notes: Vec<String> = run.notes.iter().map(|note| escaped(note)).collect();
        rows.push(("recording", format!("{}: {}", escaped(&run.name), notes.join("<br>"))));
    }
    table(&rows)
}

fn happened(run: &ReportedRun) -> String {
    let class = if run.outcome.is_good() { "good" } else { "bad" };
    let at = |(value, progress): (f64, f64), unit: &str| format!("{value:.2} {unit} at {:.0} %", 100.0 * progress);
    let mut rows = Vec::new();
    if run.runs > 1 {
        rows.push(("told here", format!("the last of {} runs in the recording", run.runs)));
    }
    rows.push(("outcome", format!("<span class=\"{class}\">{}</span>", escaped(&run.outcome.words()))));
    let duration = format!("{:.2} s", run.duration());
    match run.progress.last() {
        None => rows.push(("recorded", duration)),
        Some(progress) => rows.extend([("duration", duration), ("came to", format!("{:.0} %", 100.0 * progress))]),
    }
    if let Some(tracking) = &run.tracking {
        let [rms, max, end] =
            [tracking.position_rms_m, tracking.position_max_m, tracking.position_end_m].map(|m| 1e3 * m);
        let words = format!(
            "{rms:.2} mm RMS, {max:.2} mm at most, {end:.2} mm and {:.2} deg at the end",
            tracking.orientation_end_rad.to_degrees()
        );
        rows.push(("beside its plan", words));
    }
    rows.extend(run.largest_force().map(|peak| ("largest force", at(peak, "N"))));
    rows.extend(run.largest_surprise().filter(|peak| peak.0 > 0.0).map(|peak| ("largest surprise", at(peak, ""))));
    rows.push(("samples missing", run.missing.to_string()));
    let mut html = format!("<h3>{}</h3>\n{}", escaped(&run.name), table(&rows));
    html += "<table>\n<tr><th>time</th><th>progress</th><th>event</th></tr>\n";
    for happening in &run.happenings {
        let _ = writeln!(
            html,
            "<tr><td>{:.2} s</td><td>{:.0} %</td><td>{}</td></tr>",
            happening.time,
            100.0 * happening.progress,
            escaped(&happening.words)
        );
    }
    html + "</table>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
