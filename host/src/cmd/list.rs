//! `tactus list`: the primitives a device stores.

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::storage::{self, Storage};
use super::{Failure, Global, Table, connection};

/// Options of `list`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {}

/// Lists what is stored.
///
/// # Errors
/// The device cannot be reached.
pub fn run(_command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "list";
    let mut client = connection::observe(global, DOING)?;
    let stored = client.list().map_err(|error| error.into_failure(DOING))?;
    let storage = storage::ask(&mut client).map_err(|error| error.into_failure(DOING))?;
    let mut table = Table::new(["name", "duration", "kernels", "bytes", "checksum", "expectation", "in use"]);
    for listing in &stored {
        table.row([
            listing.name.as_str().to_owned(),
            format!("{:.2} s", listing.duration),
            listing.kernels.to_string(),
            listing.length.to_string(),
            format!("0x{:08x}", listing.crc),
            yes_or_no(listing.expectation).to_owned(),
            yes_or_no(listing.loaded).to_owned(),
        ]);
    }
    let primitives: Vec<_> = stored
        .iter()
        .map(|listing| Stored {
            name: listing.name.as_str().to_owned(),
            place: listing.index,
            duration_s: listing.duration,
            kernels: listing.kernels,
            bytes: listing.length,
            crc: format!("0x{:08x}", listing.crc),
            expectation: listing.expectation,
            loaded: listing.loaded,
        })
        .collect();
    let (taken, places) = (stored.len(), usize::from(client.hello().slots));
    let free = places.saturating_sub(taken);
    let help = if free == 0 { "; `tactus delete NAME` frees one" } else { "" };
    let complaints = storage.as_ref().map(storage::complaints).unwrap_or_default();
    let complaints: String = complaints.iter().map(|line| format!("\n{line}")).collect();
    global.output().result(
        &Listed { primitives, places, free, storage },
        format!("{table}{taken} of {places} places taken, {free} free{help}{complaints}"),
    )
}

/// Data of `tactus --json list`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Listed {
    /// Primitives that the device stores.
    pub primitives: Vec<Stored>,
    /// Places it has.
    pub places: usize,
    /// Places that are free.
    pub free: usize,
    /// Losses and condition of the storage; null while the device reads it.
    pub storage: Option<Storage>,
}

/// A stored primitive.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Stored {
    /// Its name.
    pub name: String,
    /// Number of its place.
    pub place: u8,
    /// Duration as taught, s.
    pub duration_s: f32,
    /// Kernels of each row.
    pub kernels: u16,
    /// Length of its image.
    pub bytes: u32,
    /// Check sum of its image, hexadecimal.
    pub crc: String,
    /// True if it has expected forces.
    pub expectation: bool,
    /// True if the control cycle has it.
    pub loaded: bool,
}

fn yes_or_no(yes: bool) -> &'static str {
    if yes { "yes" } else { "no" }
}
