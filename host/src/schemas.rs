//! JSON schemas of what commands write with `--json`, made from the very types that are written.
//!
//! `docs/schemas` holds them as files; `UPDATE_DOCUMENTS=1 cargo test -p tactus --test schemas` writes these.

use lab::failure::FailureData;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

use crate::cmd::{
    config, delete, doctor, experiment, explain, export, get, hand, learn, list, manual, payload, plot, record,
    rehearse, rename, report, run_report, secret, settings, sim, statistics, stop, teach, upload,
};

/// Every schema by the name of its command; `error` is that of any command that fails.
#[must_use]
pub fn all() -> Vec<(&'static str, Schema)> {
    vec![
        ("calibrate-payload", of::<payload::data::Measured>()),
        ("can-replay", of::<lab::replay::Outcome>()),
        ("check", of::<crate::check::CheckReport>()),
        ("compare", of::<lab::difference::Difference>()),
        ("config", of::<config::Configured>()),
        ("config-diff", of::<settings::Compared>()),
        ("config-get", of::<settings::Kept>()),
        ("delete", of::<delete::Deleted>()),
        ("doctor", of::<doctor::Examined>()),
        ("error", of::<FailureData>()),
        ("statistics", of::<statistics::Known<'_>>()),
        ("experiment", of::<experiment::Tried>()),
        ("experiment-study", of::<experiment::Studied>()),
        ("explain", of::<explain::Explained>()),
        ("export", of::<export::Exported>()),
        ("get", of::<get::Gotten>()),
        ("hand", of::<hand::Moved>()),
        ("learn", of::<learn::Fitted<'_>>()),
        ("list", of::<list::Listed>()),
        ("manual", of::<manual::Written>()),
        ("plot", of::<plot::Drawn>()),
        ("record", of::<record::Recorded>()),
        ("rehearse", of::<rehearse::Report>()),
        ("rename", of::<rename::Renamed>()),
        ("report", of::<report::Reported>()),
        ("run", of::<run_report::Ran>()),
        ("secret", of::<secret::Shown>()),
        ("secret-new", of::<secret::Drawn>()),
        ("sim", of::<sim::Simulated>()),
        ("stop", of::<stop::Stopped>()),
        ("teach", of::<teach::Taught>()),
        ("upload", of::<upload::Uploaded>()),
    ]
}

fn of<T: JsonSchema>() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>()
}
