//! Power that fails in the middle of an operation of bank 2, and the start after it.

mod common;

use std::fs;

use common::{Story, tell};
use emulated_board::setup::Setup;

/// Operations of the first start, which makes an empty library, that power is cut in: each of them would take too long
/// here.
const CUTS: [u64; 2] = [0, 1];

fn starts_well(story: &Story) {
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    assert!(story.outcome.measured.faults.is_empty(), "{:?}", story.outcome.measured.faults);
    let statistics = story.learned.lock().statistics.expect("statistics");
    assert_eq!((statistics.missed_deadlines, statistics.lost_replies), (0, 0));
}

#[test]
fn a_start_after_power_failed_in_the_library_finds_its_way() {
    let folder = std::env::temp_dir().join(format!("emulated-board-power-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    for cut in CUTS {
        let bank = folder.join(format!("bank2-{cut}"));
        let faults = vec![format!("power-cut@0:{cut}").parse().expect("a fault")];
        let first = tell(12.0, Setup { bank2: Some(bank.clone()), faults, ..Setup::default() });
        assert!(first.outcome.power_cut.is_some(), "operation {cut} never came");
        let second = tell(9.0, Setup { bank2: Some(bank.clone()), ..Setup::default() });
        starts_well(&second);
        assert!(second.log_says("storage"), "{:#?}", second.log());
    }
    fs::remove_dir_all(&folder).unwrap();
}
