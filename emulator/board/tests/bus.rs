//! The arm's CAN controller leaves the bus or sends no more: the arm has a fault, the controller comes back, and after
//! a person has armed it again the arm holds as before.

mod common;

use common::{Story, is_torque, tell_armed_again, tell_holding};
use emulated_board::host::HOLD;
use emulated_board::setup::Setup;
use fdcan_model::Cancellation;

/// The arm holds, ready long before.
const HOLDS_US: u64 = 800_000;
/// A person arms it again, when its wrist has sunk onto its stop: an arm that moves is not cleared.
const AGAIN_US: u64 = 3_800_000;
/// The end.
const END_S: f64 = 4.8;

/// The fault of the bus as it travels.
const BUS_FAULT: u8 = 12;

/// True if torques were on the bus in this stretch.
fn pulls(story: &Story, from_us: u64, to_us: u64) -> bool {
    story.sent_since(from_us).iter().any(|(at, frame)| *at < to_us && is_torque(frame))
}

/// Runs into the bus fault and out of it: the torque ends within `within_us`, none leaves until a person arms the arm
/// again, and then it holds.
fn falls_and_holds_again(fault: &str, cancellation: Cancellation, within_us: u64) {
    let (kind, argument) = fault.split_once(':').map_or((fault, String::new()), |(kind, us)| (kind, format!(":{us}")));
    let faults = vec![format!("{kind}@{HOLDS_US}{argument}").parse().expect("a fault")];
    let story = tell_armed_again(END_S, Setup { faults, cancellation, ..Setup::default() }, AGAIN_US);
    assert!(story.resets().is_empty(), "{fault}: {:?}", story.resets());
    assert!(pulls(&story, HOLDS_US - 5_000, HOLDS_US), "{fault}: no torque before");
    assert!(!pulls(&story, HOLDS_US + within_us, AGAIN_US), "{fault}: torque that nobody wants");
    let learned = story.learned.lock();
    let statistics = learned.statistics.expect("statistics");
    assert!(statistics.bus_errors > 0, "{fault}: not counted");
    let record = learned.fault_record.unwrap_or_else(|| panic!("{fault}: no record of a fault"));
    assert_eq!(record.fault, BUS_FAULT, "{fault}: {record:?}");
    assert_eq!(learned.status.as_ref().map(|status| status.state), Some(HOLD), "{fault}: {:?}", learned.status);
    drop(learned);
    assert!(pulls(&story, (END_S * 1e6) as u64 - 10_000, u64::MAX), "{fault}: it does not hold again");
}

#[test]
fn a10_a_controller_in_restricted_operation_is_a_fault_at_once_and_is_brought_back() {
    for cancellation in [Cancellation::Skipped, Cancellation::Stuck] {
        falls_and_holds_again("transmit-starved", cancellation, 8_000);
    }
}

#[test]
fn a10_bus_off_whose_init_is_read_late_is_a_fault_all_the_same_and_is_brought_back() {
    // Read with the flag; while the interrupt is answered; after that; after several cycles, whose torques wait.
    for fault in ["bus-off", "bus-off:1", "bus-off:40", "bus-off:9000"] {
        falls_and_holds_again(fault, Cancellation::Stuck, 30_000);
    }
}

#[test]
fn a_received_frame_that_could_not_be_stored_is_counted_and_the_arm_holds_on() {
    let story = tell_holding(1.3, &[format!("receive-starved@{HOLDS_US}")]);
    let learned = story.learned.lock();
    let statistics = learned.statistics.expect("statistics");
    assert!(statistics.bus_errors == 1 && statistics.lost_replies <= 1, "{statistics:?}");
    assert_eq!(learned.status.as_ref().map(|status| status.state), Some(HOLD), "{:?}", learned.status);
}

#[test]
fn a_bit_of_a_setting_that_falls_over_is_a_fault_and_the_controller_is_set_up_anew() {
    for bit in [
        // Divider of the bit timing; what matches no filter is taken; the interrupt of a received frame.
        "0x4000a01c/16",
        "0x4000a080/5",
        "0x4000a054/0",
        // Places of the receive queue; the filter of a joint's replies; that of the safety module's.
        "0x4000a0a0/21",
        "0x4000ac08/20",
        "0x4000ac2c/5",
    ] {
        falls_and_holds_again(&format!("flip:{bit}"), Cancellation::Skipped, 60_000);
    }
}

#[test]
fn a_receive_queue_that_lets_nothing_go_is_a_fault_and_is_opened_anew() {
    falls_and_holds_again("receive-stuck", Cancellation::Skipped, 60_000);
}
