//! The image boots and does what it must, from the first instruction to service.

mod common;

use common::{image, tell};
use emulated_board::check::check;
use emulated_board::setup::Setup;

#[test]
fn the_image_does_what_it_must() {
    let checked = check(&image()).expect("the emulation runs");
    assert!(checked.is_right(), "\n{}{}", checked.table(), checked.reasons.join("\n"));
}

#[test]
fn equal_runs_are_equal() {
    let [first, second] = [(), ()].map(|()| tell(1.5, Setup::default()));
    let hash = |story: &common::Story| story.learned.lock().bus_hash;
    assert_ne!(hash(&first), 0);
    assert_eq!(hash(&first), hash(&second));
    assert_eq!(first.outcome.measured.json(&image()), second.outcome.measured.json(&image()));
    assert_eq!(first.outcome.log, second.outcome.log);
}

#[test]
fn a_slow_core_meets_its_first_slot_too() {
    let story = tell(0.8, Setup { mips: 60, ..Setup::default() });
    let statistics = story.learned.lock().statistics.expect("statistics");
    assert_eq!(statistics.missed_deadlines, 0);
    let latency_us = statistics.latency_worst_ticks / 200;
    assert!(latency_us < 20, "{latency_us} us from the timer to the slot");
}

#[test]
fn the_second_can_bus_is_joined_only_on_silicon_without_the_erratum() {
    let sound = tell(0.1, Setup::default());
    assert!(sound.outcome.measured.second_bus);
    let old = tell(0.1, Setup { revision: 0x1003, ..Setup::default() });
    assert!(!old.outcome.measured.second_bus);
    assert!(!old.sent_since(0).is_empty(), "the arm's bus works all the same");
}
