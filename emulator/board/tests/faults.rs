//! Frames that leave on the bus when something goes wrong, and the report of the next start.

mod common;

use common::{Story, image, is_torque, safe_frames, tell, tell_holding, tell_with};
use emulated_board::setup::Setup;
use fdcan_model::Cancellation;
use puck::CanFrame;
use sim::HOME;

/// In service: the arm is ready, since 0.03 s.
const SERVICE_US: u64 = 600_000;

/// Somewhat later an arm whose host has it hold is under torque.
const UNDER_TORQUE_US: u64 = 800_000;

/// True if the four safe frames are among `sent`, in order, with nothing but their like between the first and the last.
fn holds_safe_frames(sent: &[(u64, CanFrame)]) -> bool {
    let wanted = safe_frames();
    sent.windows(wanted.len()).any(|window| window.iter().zip(wanted).all(|((_, frame), wanted)| *frame == wanted))
}

/// The next life begins with the safe frames.
fn begins_safely(story: &Story, reset_us: u64) {
    let sent = story.sent_since(reset_us);
    let first: Vec<CanFrame> = sent.iter().take(4).map(|(_, frame)| *frame).collect();
    assert_eq!(first, safe_frames(), "first frames after the restart at {reset_us} us");
}

/// The image ended by itself after a fault at `us`: four last frames, a restart, and a start that says why.
fn ended_in_order(story: &Story, us: u64, words: &str) {
    let resets = story.resets();
    assert_eq!(resets.len(), 1, "{resets:?}");
    let (reset_us, cause) = resets[0];
    assert_eq!(cause, "Core", "by itself");
    assert!(reset_us - us < 9_000, "{} us after the fault", reset_us - us);
    let last: Vec<(u64, CanFrame)> = story.sent_since(us).into_iter().filter(|(at, _)| *at < reset_us).collect();
    assert!(holds_safe_frames(&last), "{last:?}");
    begins_safely(story, reset_us);
    assert!(story.log_says(words), "no {words:?} in the log: {:#?}", story.log());
}

/// The watchdog ended it within its window.
fn ended_by_watchdog(story: &Story, us: u64) {
    let resets = story.resets();
    assert!(!resets.is_empty(), "nothing was reset");
    let (reset_us, cause) = resets[0];
    assert_eq!(cause, "Model(\"IWDG\")");
    assert!((5_000..=11_000).contains(&(reset_us - us)), "{} us after the fault", reset_us - us);
    begins_safely(story, reset_us);
    assert!(story.log_says("watchdog"), "{:#?}", story.log());
}

fn both_readings(seconds: f64, faults: &[&str], judge: impl Fn(&Story)) {
    for cancellation in [Cancellation::Skipped, Cancellation::Stuck] {
        let faults = faults.iter().map(|text| text.parse().expect("a fault")).collect();
        judge(&tell(seconds, Setup { faults, cancellation, ..Setup::default() }));
    }
}

#[test]
fn d4_a_panic_with_frames_queued_sends_the_last_frames_and_the_next_start_tells_the_words() {
    // Instants across a whole control cycle, so that the queue is full in some of them.
    for step in 0..3 {
        let us = SERVICE_US + 1_300 * step;
        both_readings(us as f64 / 1e6 + 0.1, &[&format!("panic@{us}")], |story| {
            ended_in_order(story, us, "called `Option::unwrap()` on a `None` value");
        });
    }
}

#[test]
fn d4_a_panic_whose_last_frames_cannot_be_read_in_time_sends_them_again() {
    // Before they are handed over, and with none to three of them on the bus; they begin after 0.8 ms.
    for after_us in [0, 820, 950, 1_100] {
        let faults = [format!("panic@{SERVICE_US}"), format!("transmit-starved@{}", SERVICE_US + after_us)];
        let story = tell_with(SERVICE_US as f64 / 1e6 + 0.1, &faults.each_ref().map(String::as_str));
        ended_in_order(&story, SERVICE_US, "called `Option::unwrap()` on a `None` value");
    }
}

#[test]
fn the_words_of_a_panic_are_told_even_if_a_bit_of_them_falls_over() {
    let panic = format!("panic@{SERVICE_US}");
    let whole = tell_with(SERVICE_US as f64 / 1e6 + 0.1, &[&panic]);
    let (reset_us, _) = whole.resets()[0];
    let place = image().kept_words.expect("a place of the last words");
    // Of the mark, the length, the check sum, the text; an upper bit of the length would be beyond the words.
    for (word, bit) in [(0, 7), (4, 0), (4, 30), (8, 31), (12, 3)] {
        let flip = format!("flip@{}:{:#x}/{bit}", reset_us + 1_000, place + word);
        let story = tell_with(SERVICE_US as f64 / 1e6 + 0.1, &[&panic, &flip]);
        ended_in_order(&story, SERVICE_US, "` on a `None` val");
    }
}

#[test]
fn a_panic_while_the_controller_leaves_the_bus_sends_the_last_frames_when_it_is_back() {
    // From the first disturbed frame to bus-off, whose INIT is read half a millisecond after its flag, and beyond.
    for after_us in [300, 1_200, 1_500, 1_900, 2_600] {
        let faults = [format!("bus-off@{SERVICE_US}:500"), format!("panic@{}", SERVICE_US + after_us)];
        let story = tell_with(SERVICE_US as f64 / 1e6 + 0.1, &faults.each_ref().map(String::as_str));
        ended_in_order(&story, SERVICE_US + after_us, "called `Option::unwrap()` on a `None` value");
    }
}

#[test]
fn d4_a_hard_fault_sends_the_last_frames_and_records_its_cause() {
    let story = tell_with(0.7, &["hard-fault@600000"]);
    ended_in_order(&story, SERVICE_US, "hard fault");
    assert!(story.log_says("0x00010000"), "CFSR: undefined instruction; {:#?}", story.log());
}

#[test]
fn d5_a_stack_at_its_guard_sends_the_last_frames() {
    let story = tell_with(0.7, &["guard@600000"]);
    ended_in_order(&story, SERVICE_US, "memory fault");
}

#[test]
fn d4_a_non_maskable_interrupt_sends_the_last_frames() {
    let story = tell_with(0.7, &["nmi@600000"]);
    ended_in_order(&story, SERVICE_US, "non-maskable interrupt");
}

#[test]
fn d4_an_image_that_ends_under_torque_gives_none_any_more_even_if_it_fails_twice() {
    // The arm holds; a second fault befalls the first while its last frames leave.
    let at = |kind: &str, after: u64| format!("{kind}@{}", UNDER_TORQUE_US + after);
    for (faults, words) in [
        (vec![at("panic", 0)], "called `Option::unwrap()` on a `None` value"),
        (vec![at("hard-fault", 700)], "hard fault"),
        (vec![at("guard", 1_500)], "memory fault"),
        (vec![at("panic", 0), at("panic", 150)], ""),
        (vec![at("panic", 0), at("hard-fault", 150)], ""),
        (vec![at("hard-fault", 0), at("below-guard", 150)], ""),
    ] {
        let story = tell_holding(1.3, &faults);
        let first = UNDER_TORQUE_US + if faults.len() == 1 { 0 } else { 150 };
        let before = story.sent_since(UNDER_TORQUE_US - 5_000);
        assert!(before.iter().any(|(at, frame)| *at < UNDER_TORQUE_US && is_torque(frame)), "{faults:?}: no torque");
        let (reset_us, _) = *story.resets().first().unwrap_or_else(|| panic!("{faults:?}: it goes on"));
        assert!((first..first + 12_000).contains(&reset_us), "{faults:?}: {:?}", story.resets());
        begins_safely(&story, reset_us);
        // What was in the queue of the bus may still leave; nothing else.
        let stale: Vec<_> = story.sent_since(first + 2_000).into_iter().filter(|(_, frame)| is_torque(frame)).collect();
        assert!(stale.is_empty(), "{faults:?}: {stale:?}");
        assert!(story.log_says(words), "{faults:?}: {:#?}", story.log());
    }
}

#[test]
fn d3_a_hang_ends_by_the_watchdog() {
    ended_by_watchdog(&tell_with(0.7, &["hang@600000"]), SERVICE_US);
}

#[test]
fn d3_a_hang_before_the_first_slot_ends_by_the_watchdog_as_fast() {
    // After the clocks are set up, before the first slot.
    ended_by_watchdog(&tell_with(0.2, &["hang@4600"]), 4_600);
}

#[test]
fn d3_a_core_that_stands_still_is_reset_by_the_watchdog() {
    ended_by_watchdog(&tell_with(0.7, &["stall@600000:20000"]), SERVICE_US);
}

#[test]
fn d3_a_watchdog_that_does_not_take_its_window_lets_nothing_move() {
    let story = tell_with(0.05, &["watchdog-deaf@1000"]);
    let resets = story.resets();
    // Eleven starts; each is translated anew, which is what takes the time.
    assert!(resets.len() > 10 && resets.iter().all(|(_, cause)| *cause == "Core"), "{resets:?}");
    assert!(story.log_says("the watchdog does not take its window"), "{:#?}", story.log());
    assert!(!story.sent_since(0).iter().any(|(_, frame)| is_torque(frame)));
}

#[test]
fn d8_a_time_that_stands_still_stops_the_arm() {
    let story = tell_holding(1.8, &["time-stands@800000".into()]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    let learned = story.learned.lock();
    let status = learned.status.as_ref().expect("a status");
    // Soft stop, for cycles that are late.
    assert_eq!((status.state, status.fault), (6, 13), "{status:?}");
}

#[test]
fn a_usb_controller_without_a_clock_costs_the_usb_line_and_nothing_else() {
    let story = tell_with(1.1, &["usb-dead@0"]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    assert!(story.is_up(), "{:?}", story.learned.lock().status);
}

#[test]
fn c3_a_usb_line_that_stays_up_keeps_the_session_from_nothing() {
    let quiet = tell_with(1.6, &[]).learned.lock().answered;
    let story = tell_with(1.6, &["usb-held@600000"]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    let learned = story.learned.lock();
    assert!(learned.answered + 3 > quiet, "{} of {} questions, {quiet} without", learned.answered, learned.asked);
    let statistics = learned.statistics.expect("statistics");
    assert_eq!(statistics.missed_deadlines, 0);
}

#[test]
fn a_usb_queue_that_never_says_that_it_is_empty_costs_the_usb_line_and_nothing_else() {
    let quiet = tell_with(1.6, &[]).learned.lock().answered;
    let story = tell_with(1.6, &["usb-flush-held@600000"]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    let learned = story.learned.lock();
    assert!(learned.answered + 3 > quiet, "{} of {} questions, {quiet} without", learned.answered, learned.asked);
    assert_eq!(learned.statistics.expect("statistics").missed_deadlines, 0);
}

#[test]
fn a_serial_line_that_says_for_good_that_a_byte_has_come_costs_that_line_and_nothing_else() {
    let story = tell_holding(1.3, &["serial-held@800000".into()]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    // Nobody can ask any more: the arm is held by 300 cycles a second as before.
    let torques =
        |from: u64, to: u64| story.sent_since(from).iter().filter(|(at, frame)| *at < to && is_torque(frame)).count();
    let (before, after) = (torques(700_000, 800_000), torques(1_200_000, 1_300_000));
    assert!(before >= 29 && after.abs_diff(before) <= 2, "{before} torques in a tenth of a second, then {after}");
}

#[test]
fn a_can_line_that_stays_up_ends_the_torque_and_the_session_answers() {
    let story = tell_holding(1.8, &["can-held@800000".into()]);
    assert!(story.resets().is_empty(), "{:?}", story.resets());
    let learned = story.learned.lock();
    assert!(learned.answered + 3 > learned.asked, "{} of {} questions", learned.answered, learned.asked);
    assert_eq!(learned.fault_record.map(|record| record.fault), Some(12), "a fault of the bus");
    assert!(!story.sent_since(900_000).iter().any(|(_, frame)| is_torque(frame)), "torque all the same");
}

#[test]
fn a_second_reset_at_any_time_of_a_start_ends_the_torque_as_the_first_would_have() {
    // In the copying before main, in the clock tree, in the set-up of the controllers, around the first frames.
    for after_us in [300, 2_500, 4_500, 6_000, 8_000] {
        let resets = [format!("reset@{UNDER_TORQUE_US}:pin"), format!("reset@{}:pin", UNDER_TORQUE_US + after_us)];
        let story = tell_holding(0.9, &resets);
        assert_eq!(story.resets().len(), 2, "{after_us}: {:?}", story.resets());
        begins_safely(&story, UNDER_TORQUE_US + after_us);
        assert!(!story.sent_since(UNDER_TORQUE_US + 500).iter().any(|(_, frame)| is_torque(frame)), "{after_us}");
        let first = story.sent_since(UNDER_TORQUE_US + after_us)[0].0 - UNDER_TORQUE_US - after_us;
        assert!(first < 12_000, "{after_us}: {first} us after the second one");
    }
}

#[test]
fn after_bus_off_the_arm_is_started_up_again_and_nothing_stale_leaves() {
    both_readings(2.7, &["bus-off@600000"], |story| {
        assert!(story.resets().is_empty(), "{:?}", story.resets());
        let learned = story.learned.lock();
        let statistics = learned.statistics.expect("statistics");
        assert!(statistics.bus_errors > 0, "the image counts it");
        drop(learned);
        assert!(story.is_up(), "{:?}", story.learned.lock().status);
    });
}

#[test]
fn a_bus_without_another_node_is_borne_until_it_is_there_again() {
    both_readings(2.7, &["no-acknowledge@600000:200000"], |story| {
        assert!(story.resets().is_empty(), "{:?}", story.resets());
        assert!(story.is_up(), "{:?}", story.learned.lock().status);
    });
}

#[test]
fn a_bus_held_dominant_is_borne_until_it_is_free() {
    both_readings(2.7, &["dominant@600000:50000"], |story| {
        assert!(story.resets().is_empty(), "{:?}", story.resets());
        assert!(story.is_up(), "{:?}", story.learned.lock().status);
    });
}

#[test]
fn d7_every_kind_of_reset_is_told_by_its_name() {
    for (kind, words) in [("pin", "button"), ("power", "power"), ("brown-out", "power"), ("probe", "debug")] {
        let story = tell_with(0.8, &[&format!("reset@{SERVICE_US}:{kind}")]);
        assert_eq!(story.resets().len(), 1, "{kind}");
        begins_safely(&story, SERVICE_US);
        let log = story.log();
        let told = log.iter().rev().find(|line| line.contains(words));
        assert!(told.is_some(), "{kind}: no {words:?} in {log:#?}");
    }
}

#[test]
fn a_crystal_that_is_dead_from_the_start_does_not_leave_the_image_waiting_for_ever() {
    let story = tell_with(0.35, &["hse-dead@0"]);
    let resets = story.resets();
    assert!(resets.first().is_some_and(|(us, cause)| *cause == "Core" && *us < 400_000), "{resets:?}");
    assert!(story.sent_since(0).is_empty(), "the bus is not touched at a rate that is not exact");
}

#[test]
fn a_crystal_that_dies_under_torque_ends_the_torque_by_the_chips_own_oscillator() {
    let story = tell_holding(1.7, &["hse-dead@800000".into()]);
    assert!(
        story.sent_since(UNDER_TORQUE_US - 10_000).iter().any(|(at, frame)| *at < UNDER_TORQUE_US && is_torque(frame)),
        "no torque"
    );
    let (reset_us, _) = story.resets()[0];
    let last = story.sent_since(reset_us);
    let frames: Vec<CanFrame> = last.iter().map(|(_, frame)| *frame).collect();
    // Once, and nothing else: the rate is not exact.
    assert_eq!(frames, safe_frames());
    assert!(last.iter().all(|(at, _)| at - UNDER_TORQUE_US < 12_000), "{last:?}");
    // It goes on trying as a board does that never had a clock.
    assert!(story.resets().len() >= 3, "{:?}", story.resets());
}

#[test]
fn a_crystal_that_dies_under_torque_ends_it_even_if_the_chip_is_reset_while_it_waits() {
    // As by a debug probe that starts anew: its clock ends, and then it pulls the reset pin.
    // In the copying before main, in the wait, while the frames leave.
    for after_us in [300, 2_500, 4_500, 5_600] {
        let reset_us = UNDER_TORQUE_US + after_us;
        let story = tell_holding(0.9, &[format!("hse-dead@{UNDER_TORQUE_US}"), format!("reset@{reset_us}:pin")]);
        let sent = story.sent_since(reset_us);
        let frames: Vec<CanFrame> = sent.iter().map(|(_, frame)| *frame).collect();
        assert_eq!(frames, safe_frames(), "{after_us}: {:?}", story.resets());
        assert!(sent[0].0 - reset_us < 12_000, "{after_us}: {sent:?}");
    }
}

#[test]
fn a_crystal_that_dies_in_service_ends_the_image_and_not_the_arm() {
    let story = tell_with(0.7, &["hse-dead@600000"]);
    let resets = story.resets();
    assert!(!resets.is_empty(), "it goes on at another rate");
    assert!(resets[0].0 - SERVICE_US < 12_000, "{resets:?}");
}

/// The image ends within a few hundredths of a second after a bit has fallen over, and its successor says which.
fn ends_for_a_setting(fault: &str, address: &str) {
    let story = tell_with(0.9, &[fault]);
    let resets = story.resets();
    assert_eq!(resets.len(), 1, "{fault}: {resets:?}");
    let (reset_us, cause) = resets[0];
    assert_eq!(cause, "Core", "{fault}: by itself");
    assert!(reset_us - SERVICE_US < 100_000, "{fault}: {} us after the fault", reset_us - SERVICE_US);
    begins_safely(&story, reset_us);
    assert!(story.log_says("a setting of the chip has changed"), "{fault}: {:#?}", story.log());
    assert!(story.log_says(address), "{fault}: {:#?}", story.log());
}

#[test]
fn a_bit_of_a_setting_of_the_chip_that_falls_over_ends_the_image_and_the_next_one_tells_it() {
    for (address, bit) in [
        // Divider of the slots; wait states of the flash; source of the CAN clock; pin of the arm's bus; rate of the
        // serial line; priority of the slots; protection unit; the watchdog, which a debugger lets stand in a halt.
        ("0x40000028", 0),
        ("0x52002000", 3),
        ("0x58024450", 29),
        ("0x58020c20", 5),
        ("0x4000480c", 9),
        ("0xe000e41c", 5),
        ("0xe000ed94", 1),
        ("0x5c001054", 18),
    ] {
        ends_for_a_setting(&format!("flip@{SERVICE_US}:{address}/{bit}"), address);
    }
}

#[test]
fn a_loop_that_loses_its_lock_ends_the_image() {
    for number in [0, 2] {
        ends_for_a_setting(&format!("loop-lost@{SERVICE_US}:{number}"), "0x58024400");
    }
}

/// Runs the image for a second beyond a fault that ends in a restart.
fn restarted(fault: &str, us: u64) -> Story {
    let story =
        tell(us as f64 / 1e6 + 1.0, Setup { faults: vec![fault.parse().expect("a fault")], ..Setup::default() });
    assert_eq!(story.resets().len(), 1, "{fault}: {:?}", story.resets());
    assert!(story.learned.lock().hello.is_some(), "{fault}: the host was let in again");
    story
}

#[test]
fn the_last_second_before_a_restart_is_kept_if_the_memory_has_kept_its_power() {
    const RESTART_US: u64 = 900_000;
    const LATER_US: u64 = 100_000;
    let newest = |fault: &str, us: u64| {
        let story = restarted(fault, us);
        let learned = story.learned.lock();
        let record = learned.fault_record.unwrap_or_else(|| panic!("{fault}: no record"));
        assert_eq!((record.number, record.fault, record.latched), (1, 0, false), "{fault}");
        let cycle = learned.fault_cycle.unwrap_or_else(|| panic!("{fault}: no cycle of {record:?}"));
        // Nothing holds the arm, so it has begun to sink by some thousandths.
        for (told, stands) in cycle.q.iter().zip(HOME) {
            assert!((f64::from(*told) - stands).abs() < 0.01, "{fault}: {:?}", cycle.q);
        }
        (cycle.cycle, record.cycles)
    };
    let pressed = newest(&format!("reset@{RESTART_US}:pin"), RESTART_US);
    // A watchdog and a panic end it a few cycles later.
    for fault in ["hang", "panic"] {
        let (number, _) = newest(&format!("{fault}@{RESTART_US}"), RESTART_US);
        assert!((pressed.0..pressed.0 + 4).contains(&number), "{fault}: {number}, button: {}", pressed.0);
    }
    // A tenth of a second later there are thirty cycles more: the newest of all was kept, and none is missing.
    let us = RESTART_US + LATER_US;
    let later = newest(&format!("reset@{us}:pin"), us);
    assert!((29..=31).contains(&(later.0 - pressed.0)), "{pressed:?} {later:?}");
    assert!((29..=31).contains(&(later.1 - pressed.1)), "{pressed:?} {later:?}");
    // Power was away: whatever the memory holds then is not a record.
    let story = restarted(&format!("reset@{RESTART_US}:power"), RESTART_US);
    assert_eq!(story.learned.lock().fault_record, None);
}
