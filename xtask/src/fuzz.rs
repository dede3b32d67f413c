//! Random frames and sessions: the property tests of links, buses and devices with as many cases as are wanted.

use anyhow::Result;

use crate::shell;

/// Number of frames of a run that does not say: what a change must pass.
pub(crate) const USUAL: u32 = 1_000_000;

/// Tests that take their number of cases from the environment: target, part of the name.
const TESTS: [(&str, &str); 5] = [
    ("link", "c1_noise_is_dropped"),
    ("link", "c1_a_damaged_request"),
    ("arbitrary_frames", "a6_any_frame"),
    ("core", "arbitrary::"),
    ("session", "c2_any_sequence"),
];

/// `count` frames on each bus, a tenth of it sessions, a thousandth of it whole stories of an arm.
///
/// # Errors
/// If a test fails. What failed is written beside it and is the first case of the next run.
pub(crate) fn run(count: u32) -> Result<()> {
    shell::step(&format!("{count} random frames on link and bus, {} sessions", count / 10));
    for (target, name) in TESTS {
        shell::run(
            // As at the root, with the overflow checks of the development profile.
            shell::cargo()
                .args(["test", "--quiet", "--test", target, name])
                .env("TACTUS_FUZZ_FRAMES", count.to_string())
                .env("TACTUS_FUZZ_SESSIONS", (count / 10).to_string())
                .env("TACTUS_FUZZ_STORIES", (count / 1000).to_string()),
        )?;
    }
    Ok(())
}
