//! Options of a simulated device that count for nothing in an experiment, which has arm, noise and world of its own.

use lab::transport::{LineKind, SimulatorKind, SimulatorOptions};

/// The options of this device that an experiment would ignore, as they were given, each with what to do instead.
pub(super) fn ignored(kind: SimulatorKind, options: &SimulatorOptions) -> Vec<(String, String)> {
    let SimulatorOptions { seed, arm, held, world, line, bus, flash, faults, board } = options;
    let file = |name: &str, file: &std::path::Path| format!("{name}={}", file.display());
    let nothing = || "leave it out".to_owned();
    let of_trials = || "leave it out; `tactus run` heeds it".to_owned();
    let by_seed =
        |number: u64| format!("a seed of the experiment is an arm: `--seed {number}`, or `--seeds` for several");
    let found = [
        seed.map(|seed| (format!("seed={seed}"), by_seed(seed))),
        arm.map(|arm| (format!("arm={arm}"), by_seed(arm))),
        held.as_ref().map(|held| {
            (
                format!("held={held}"),
                "the hand is empty before it grasps; `--vary mass=FACTOR` makes the object heavier".to_owned(),
            )
        }),
        // The MuJoCo world is the one that has objects.
        world.as_ref().filter(|world| *world != "mujoco").map(|world| (format!("world={world}"), nothing())),
        (*line != LineKind::default()).then(|| ("line=can".to_owned(), nothing())),
        bus.as_ref().map(|bus| (file("bus", bus), "`--keep-recordings` keeps the telemetry of every trial".to_owned())),
        flash.as_ref().map(|flash| (file("flash", flash), nothing())),
        faults.as_ref().map(|faults| (format!("faults={faults}"), of_trials())),
        board.report.as_ref().map(|report| (file("report", report), of_trials())),
        (kind == SimulatorKind::Hand)
            .then(|| ("hand:".to_owned(), "an experiment needs an arm: `--device sil:`".to_owned())),
    ];
    found.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use lab::transport::Address;

    use super::*;

    fn of(text: &str) -> Vec<(String, String)> {
        let Ok(Address::Simulated(kind, options)) = text.parse() else { panic!("{text}") };
        ignored(kind, &options)
    }

    /// The change that makes it fail: the engine alone is taken from the address, and the rest ignored in silence.
    #[test]
    fn an_option_of_the_device_that_counts_for_nothing_is_named_with_what_to_use_instead() {
        for (option, help) in [
            ("seed=7", "`--seed 7`"),
            ("arm=3", "`--seed 3`"),
            ("held=2", "`--vary mass=FACTOR`"),
            ("world=simple", "leave it out"),
            ("line=can", "leave it out"),
            ("bus=x.log", "`--keep-recordings`"),
            ("flash=zz", "leave it out"),
            ("faults=a.toml:2", "`tactus run`"),
        ] {
            let found = of(&format!("sil:{option}"));
            assert!(found.len() == 1 && found[0].0 == option && found[0].1.contains(help), "{option}: {found:?}");
        }
        assert_eq!(of("board:report=a.json")[0].0, "report=a.json");
        assert_eq!(of("hand:")[0].0, "hand:");
        assert_eq!(of("sil:seed=7,arm=3,flash=zz").len(), 3, "all are named at once");
        for heeded in ["sil:", "sim:", "sil:world=mujoco", "board:revision=0x1003,fault=hang@7:2"] {
            assert_eq!(of(heeded), [], "{heeded}");
        }
    }
}
