//! JSON schemas of what commands write with `--json`, made from the very types that are written.
//!
//! `docs/schemas` holds them as files; `UPDATE_DOCUMENTS=1 cargo test -p tactus --test schemas` writes these.

use lab::failure::FailureData;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

use crate::cmd::{
    config, delete, doctor, explain, export, get, hand, list, manual, record, rename, run_report, settings, sim, stop,
};

/// Every schema by the name of its command; `error` is that of any command that fails.
#[must_use]
pub fn all() -> Vec<(&'static str, Schema)> {
    vec![
        ("config", of::<config::Configured>()),
        ("config-diff", of::<settings::Compared>()),
        ("config-get", of::<settings::Kept>()),
        ("delete", of::<delete::Deleted>()),
        ("doctor", of::<doctor::Examined>()),
        ("error", of::<FailureData>()),
        ("explain", of::<explain::Explained>()),
        ("export", of::<export::Exported>()),
        ("get", of::<get::Gotten>()),
        ("hand", of::<hand::Moved>()),
        ("list", of::<list::Listed>()),
        ("manual", of::<manual::Written>()),
        ("record", of::<record::Recorded>()),
        ("rename", of::<rename::Renamed>()),
        ("run", of::<run_report::Ran>()),
        ("sim", of::<sim::Simulated>()),
        ("stop", of::<stop::Stopped>()),
    ]
}

fn of<T: JsonSchema>() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<T>()
}
