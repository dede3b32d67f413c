//! JSON schemas of what commands write with `--json`, made from the very types that are written.
//!
//! `docs/schemas` holds them as files; `UPDATE_DOCUMENTS=1 cargo test -p tactus --test command schemas::` writes these.

use lab::failure::FailureData;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

use crate::cmd::{
    calibrate, can, completions, config, delete, doctor, experiment, explain, export, faults, flash, friction, get,
    hand, learn, list, manual, payload, plot, record, rehearse, rename, report, run_report, secret, settings, sim,
    statistics, status, stop, teach, upload, weigh,
};
use crate::monitor;

/// Every schema by the name of its command; `error` is that of any command that fails.
#[must_use]
pub fn all() -> Vec<(&'static str, Schema)> {
    vec![
        ("calibrate", of::<calibrate::HomeShown>()),
        ("calibrate-friction", of::<friction::Measured>()),
        ("calibrate-gravity", of::<weigh::Weighed>()),
        ("calibrate-gravity-show", of::<weigh::WeightShown>()),
        ("calibrate-home", of::<calibrate::HomeCorrected>()),
        ("calibrate-payload", of::<payload::data::Measured>()),
        ("calibrate-payload-show", of::<payload::PayloadShown>()),
        ("can-decode", of::<can::decode::Decoded<'_>>()),
        ("can-replay", of::<lab::replay::Outcome>()),
        ("check", of::<crate::check::CheckReport>()),
        ("compare", of::<lab::difference::Difference>()),
        ("completions", of::<completions::Completing>()),
        ("config", of::<config::Configured>()),
        ("config-diff", of::<settings::Compared>()),
        ("config-get", of::<settings::Kept>()),
        ("delete", of::<delete::Deleted>()),
        ("doctor", of::<doctor::Examined>()),
        ("error", of::<FailureData>()),
        ("statistics", of::<statistics::Known<'_>>()),
        ("experiment", of::<experiment::Tried>()),
        ("experiment-study", of::<experiment::Studied>()),
        ("experiment-lift", of::<experiment::Lifted>()),
        ("explain", of::<explain::Explained>()),
        ("export", of::<export::Exported>()),
        ("faults", of::<faults::FaultReport>()),
        ("flash", of::<flash::Flashed>()),
        ("get", of::<get::Gotten>()),
        ("hand", of::<hand::Moved>()),
        ("learn", of::<learn::Fitted<'_>>()),
        ("list", of::<list::Listed>()),
        ("manual", of::<manual::Written>()),
        ("monitor", of::<monitor::Streamed>()),
        ("plot", of::<plot::Drawn>()),
        ("record", of::<record::Recorded>()),
        ("rehearse", of::<rehearse::Report>()),
        ("rename", of::<rename::Renamed>()),
        ("report", of::<report::Reported>()),
        ("run", of::<run_report::Ran>()),
        ("secret", of::<secret::Shown>()),
        ("secret-new", of::<secret::Drawn>()),
        ("sim", of::<sim::Simulated>()),
        ("status", of::<status::StatusReport>()),
        ("stop", of::<stop::Stopped>()),
        ("tare", of::<lab::procedure::Tared>()),
        ("teach", of::<teach::Taught>()),
        ("upload", of::<upload::Uploaded>()),
    ]
}

fn of<T: JsonSchema>() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>()
}
