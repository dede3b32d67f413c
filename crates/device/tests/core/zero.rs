//! G2: what makes the zero of the arm doubtful, and that nothing but a person's zeroing leads on.

use control::{Command as Control, Fault, State};
use device::{Command, Controller, DeviceController, EventKind, Refusal, Stage, StartupError};
use puck::{Action, Counts, Node, PropertyId, Request, SafetyMode};

use crate::double::{Bus, HOME, Puck, floating, silent_device, started};

/// Puck 4 begins to count anew, by so much that its joint seems 0.7 rad away.
fn restart_puck_4(bus: &mut Bus) {
    bus.pucks[3].position = Counts(bus.pucks[3].position.0 - 8_000);
}

/// Counts of motor 4, which turns 18 times as far as J4, the other way. J4 goes from -0.9 to 3.1 rad.
fn counts_of_j4(angle: f64) -> Counts {
    Counts((angle * -18.0 * 4096.0 / core::f64::consts::TAU) as i32)
}

/// Neither clearing nor arming leads on.
fn assert_nothing_leads_on(core: &mut DeviceController, bus: &mut Bus) {
    for command in [Control::ClearFault, Control::Hold, Control::Gravity] {
        bus.commands.push_back(command.into());
        bus.run(core, 0.05);
        let refused =
            bus.events.iter().rev().find(|event| matches!(event, EventKind::Refused(_) | EventKind::Accepted));
        let zero_lost = Refusal::Control(control::Refusal::ZeroLost);
        let waiting = Refusal::NotReady(Stage::WaitingForZero);
        assert!(
            [EventKind::Refused(zero_lost), EventKind::Refused(waiting)].iter().any(|event| Some(event) == refused),
            "{command:?}: {refused:?}"
        );
    }
    assert!(!core.health().zeroed && !core.health().state.has_torque());
    assert_eq!(core.stage(), Stage::WaitingForZero);
}

/// A person zeroes the arm, clears what is latched, activates and lets the arm hold.
fn assert_zeroing_leads_on(core: &mut DeviceController, bus: &mut Bus) {
    bus.press_idle();
    bus.run(core, 0.1);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(core, 0.05);
    bus.run_until(core, Stage::WaitingForActive);
    bus.run(core, 0.1);
    bus.commands.push_back(Control::ClearFault.into());
    bus.press_activate();
    bus.run_until(core, Stage::Ready);
    bus.commands.push_back(Control::Hold.into());
    bus.run(core, 0.2);
    let health = core.health();
    assert_eq!((health.state, health.fault, health.zeroed), (State::Hold, Fault::None, true), "{:?}", bus.events);
    assert!(health.blocked.is_none() && bus.safety_zero);
}

#[test]
fn g2_a_puck_that_had_to_be_woken_is_not_believed_whatever_the_safety_module_says() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.pucks[3].awake_at = None;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.run(&mut core, 0.1);
    let reason = StartupError::CountsAnew(Node::ARM[3]);
    assert_eq!(core.health().blocked, Some(reason));
    assert_eq!(bus.events.iter().filter(|event| **event == EventKind::Blocked(reason)).count(), 1);
    assert!(!bus.safety_zero, "the safety module no longer says so either");
    assert_nothing_leads_on(&mut core, &mut bus);
    assert_zeroing_leads_on(&mut core, &mut bus);
}

#[test]
fn g2_a_posture_beyond_the_stops_is_not_believed_whatever_the_safety_module_says() {
    for (joint, is_believed) in [(-1.05, true), (3.25, true), (-1.2, false), (3.4, false)] {
        let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
        bus.pucks[3].position = counts_of_j4(joint);
        bus.run(&mut core, 3.0);
        assert_eq!(core.health().zeroed, is_believed, "{joint}");
        if is_believed {
            assert_eq!((core.stage(), core.health().blocked), (Stage::WaitingForActive, None), "{joint}");
            continue;
        }
        assert_eq!(core.health().blocked, Some(StartupError::BeyondStops { joint: 4 }));
        assert!(!bus.safety_zero, "the safety module no longer says so either");
        bus.press_activate();
        bus.run(&mut core, 0.2);
        assert_nothing_leads_on(&mut core, &mut bus);
        assert_zeroing_leads_on(&mut core, &mut bus);
    }
}

#[test]
fn g2_a_posture_that_comes_to_be_beyond_the_stops_is_not_believed_any_longer() {
    for torque in [false, true] {
        let (mut core, mut bus) = if torque { floating() } else { started() };
        bus.press_activate();
        bus.run(&mut core, 0.2);
        // J4, led by a person to 3.4 rad, more slowly than an arm that falls (G7).
        while bus.pucks[3].position.0 > counts_of_j4(3.4).0 && core.health().blocked.is_none() {
            bus.pucks[3].position.0 -= 8;
            bus.run_slots(&mut core, 3);
        }
        let told = f64::from(bus.pucks[3].position.0) / f64::from(counts_of_j4(1.0).0);
        assert!(told > 3.3, "{told}: stops are where cables stretch");
        bus.run(&mut core, 0.1);
        assert_eq!(core.health().blocked, Some(StartupError::BeyondStops { joint: 4 }), "torque: {torque}");
        assert_eq!(core.health().fault, Fault::ImplausiblePosition);
        if !torque {
            assert_nothing_leads_on(&mut core, &mut bus);
        }
        assert_zeroing_leads_on(&mut core, &mut bus);
    }
}

#[test]
fn g2_counts_that_begin_anew_end_the_torque_and_the_zero_within_20_ms() {
    for torque in [false, true] {
        let (mut core, mut bus) = if torque { floating() } else { started() };
        bus.press_activate();
        bus.run(&mut core, 0.2);
        if torque {
            bus.commands.push_back(Control::Hold.into());
            bus.run(&mut core, 0.1);
            assert_eq!(core.health().state, State::Hold);
        }
        let begin = bus.now_us;
        restart_puck_4(&mut bus);
        while core.health().fault != Fault::ImplausiblePosition {
            bus.run_slots(&mut core, 1);
            assert!(bus.now_us - begin <= 20_000, "{:?}", core.health());
        }
        bus.run_slots(&mut core, 3);
        let state = if torque { State::SoftStop } else { State::Idle };
        assert_eq!((core.health().state, core.health().zeroed), (state, false));
        assert_eq!(core.stage(), Stage::WaitingForZero);
        bus.commands.push_back(Control::Release.into());
        bus.run(&mut core, 3.0);
        assert_nothing_leads_on(&mut core, &mut bus);
        assert!(!bus.safety_zero, "who asks the safety module is not told that the arm is zeroed");
        if torque {
            assert_zeroing_leads_on(&mut core, &mut bus);
        } else {
            // Not even a board that knows nothing of it goes on.
            bus.press_idle();
            let mut other = silent_device();
            bus.run_until(&mut other, Stage::WaitingForZero);
            assert_zeroing_leads_on(&mut other, &mut bus);
        }
    }
}

#[test]
fn g2_a_puck_that_resets_under_torque_costs_the_zero_with_its_name() {
    let (mut core, mut bus) = floating();
    bus.pucks[5].awake_at = None;
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().fault, Fault::BusFault);
    assert_eq!(bus.safety_mode, SafetyMode::Idle, "the brakes are on");
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().blocked, Some(StartupError::CountsAnew(Node::ARM[5])));
    assert!(!bus.safety_zero && !core.health().zeroed);
    assert_zeroing_leads_on(&mut core, &mut bus);
}

/// G2: the emergency stop is noticed behind the demand for zeroing, however often a person tries to zero.
#[test]
fn g2_an_emergency_stop_that_comes_while_zeroing_is_demanded_is_noticed_by_who_tries_to_zero() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.pucks[3].awake_at = None;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.press_emergency_stop();
    for _ in 0..10 {
        bus.commands.push_back(Command::Zero { home: HOME });
        bus.run(&mut core, 0.1);
    }
    assert_eq!(core.stage(), Stage::WaitingForIdle, "{:?}", bus.events);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForZero);
    assert_zeroing_leads_on(&mut core, &mut bus);
}

/// G2: counts that begin anew under a latched fault, which no Clear ends before the arm is zeroed.
#[test]
fn g2_an_arm_whose_zero_is_lost_under_a_fault_is_zeroed_and_then_cleared() {
    let (mut core, mut bus) = floating();
    // Torque frames do not leave for six cycles: the bus itself goes on.
    bus.refuse = 60;
    bus.run(&mut core, 0.2);
    assert_eq!((core.health().state, core.health().fault), (State::Fault, Fault::BusFault));
    assert_eq!(bus.refuse, 0);
    restart_puck_4(&mut bus);
    bus.run(&mut core, 0.1);
    bus.commands.push_back(Control::ClearFault.into());
    bus.run(&mut core, 0.05);
    assert_eq!(bus.events.last(), Some(&EventKind::Refused(Refusal::Control(control::Refusal::ZeroLost))));
    assert_zeroing_leads_on(&mut core, &mut bus);
}

/// G2: a joint that turns at `share` of its speed limit while the bus is started anew after an emergency stop; `jump`
/// counts more as soon as the start-up prepares the loop. True if the arm is still zeroed.
fn keeps_zero(joint: usize, share: f64, jump: i32) -> bool {
    let (mut core, mut bus) = floating();
    bus.safety_mode = SafetyMode::EStop;
    let turns = share * control::model::VELOCITY_MAX[joint] * control::model::JOINT_TO_MOTOR[joint][joint].abs();
    let (begin, from) = (bus.now_us, bus.pucks[joint].position.0);
    let mut jumped = 0;
    let mut last_cycles = 300;
    while bus.now_us < begin + 4_000_000 && last_cycles > 0 {
        bus.run_slots(&mut core, 1);
        if [Stage::WaitingForActive, Stage::WaitingForZero].contains(&core.stage()) {
            // No joint turns beyond its stops.
            last_cycles -= 1;
            continue;
        }
        if bus.now_us > begin + 200_000 && bus.safety_mode == SafetyMode::EStop {
            bus.press_idle();
        }
        if core.stage() == Stage::Preparing {
            jumped = jump;
        }
        let turned = turns * (bus.now_us - begin) as f64 * 1e-6 * 4096.0 / core::f64::consts::TAU;
        bus.pucks[joint].position = Counts(from + turned as i32 + jumped);
    }
    let health = core.health();
    assert_eq!(health.blocked, (!health.zeroed).then_some(StartupError::CountsJumped), "the reason is told");
    if !health.zeroed {
        bus.press_activate();
        bus.run(&mut core, 0.2);
        assert_nothing_leads_on(&mut core, &mut bus);
    }
    health.zeroed
}

#[test]
fn g2_an_arm_that_is_turned_by_hand_while_the_bus_is_started_anew_keeps_its_zero() {
    for joint in [0, 3, 6] {
        for share in [0.0, 0.5, 0.9] {
            assert!(keeps_zero(joint, share, 0), "M{} at {share} of its limit", joint + 1);
        }
        assert!(!keeps_zero(joint, 0.0, 4_000), "M{} jumps", joint + 1);
    }
}

/// G2: under the emergency stop the counts of a motor jump by less than it could have turned since they were looked at.
/// True if the arm is still zeroed when the bus has been started anew.
fn believes_jump(joint: usize, jump: i32, puck: fn(&mut Puck)) -> bool {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks.iter_mut().for_each(puck);
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    bus.safety_mode = SafetyMode::EStop;
    bus.run(&mut core, 0.1);
    // The counter jumps, the motor does not turn.
    let puck = &mut bus.pucks[joint];
    puck.position = Counts(puck.position.0 + jump);
    puck.beyond_angle = puck.beyond_angle.map(|counts| counts + jump);
    bus.run(&mut core, 0.2);
    bus.press_idle();
    bus.run(&mut core, 4.0);
    let health = core.health();
    assert_eq!(health.blocked, (!health.zeroed).then_some(StartupError::CountsJumped), "the reason is told");
    if !health.zeroed {
        bus.press_activate();
        bus.run(&mut core, 0.2);
        assert_nothing_leads_on(&mut core, &mut bus);
        assert_zeroing_leads_on(&mut core, &mut bus);
    }
    health.zeroed
}

#[test]
fn g2_a_jump_that_could_have_been_a_motion_is_told_by_the_absolute_angle_of_the_motor() {
    for joint in 0..7 {
        assert!(believes_jump(joint, 0, |_| {}), "M{} stands", joint + 1);
        for jump in [500, -2_000] {
            assert!(!believes_jump(joint, jump, |_| {}), "M{} by {jump}", joint + 1);
        }
    }
    assert!(!believes_jump(0, 500, |puck| puck.version = 118), "the first firmware that tells it");
    // What nothing tells: decision 0107.
    assert!(believes_jump(0, 500, |puck| puck.version = 117), "firmware that does not");
    assert!(believes_jump(0, 500, |puck| puck.beyond_angle = None), "no such encoder");
    assert!(believes_jump(0, 4096, |_| {}), "by a whole revolution");
}

/// G2: a zeroing of an arm that is zeroed comes to nothing: the safety module is not heard, or the arm is activated
/// behind it. Meanwhile the counts of a motor `jump`, and the old zero is to go on. True if the arm is still zeroed.
fn keeps_zero_of_before(is_heard: bool, joint: usize, jump: i32) -> bool {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    // Such a motor tells its counts alone.
    bus.pucks[joint].beyond_angle = None;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.2);
    bus.deaf = !is_heard;
    bus.commands.push_back(Command::Zero { home: HOME });
    if is_heard {
        bus.run_slots(&mut core, 8);
        bus.press_activate();
    } else {
        bus.run_until(&mut core, Stage::Blocked);
        bus.deaf = false;
        bus.run(&mut core, 0.1);
    }
    bus.pucks[joint].position.0 += jump;
    bus.run(&mut core, 4.0);
    let health = core.health();
    assert!(bus.events.iter().any(|event| matches!(event, EventKind::Refused(_))), "{:?}", bus.events);
    if !health.zeroed {
        assert_nothing_leads_on(&mut core, &mut bus);
        assert_zeroing_leads_on(&mut core, &mut bus);
    }
    health.zeroed
}

#[test]
fn g2_counts_that_jump_while_a_zeroing_comes_to_nothing_cost_the_zero_of_before() {
    for is_heard in [true, false] {
        for (joint, jump) in [(0, 12_000), (3, 8_000), (6, -12_000)] {
            assert!(keeps_zero_of_before(is_heard, joint, 0), "M{} stands", joint + 1);
            assert!(!keeps_zero_of_before(is_heard, joint, jump), "M{} by {jump}, heard: {is_heard}", joint + 1);
        }
    }
}

/// G2: the counts of a second zero differ from those of the first, and the motors have not turned.
#[test]
fn g2_a_second_zero_is_not_compared_with_the_angles_of_the_first() {
    let (mut core, mut bus) = started();
    bus.press_idle();
    bus.run(&mut core, 0.2);
    let home = [0.5, -1.9, 0.1, 2.8, 0.1, 0.1, 0.1];
    bus.commands.push_back(Command::Zero { home });
    bus.run(&mut core, 0.05);
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert!(core.health().zeroed);
    // It is the one that later start-ups compare with.
    bus.safety_mode = SafetyMode::EStop;
    bus.run(&mut core, 0.3);
    bus.press_idle();
    bus.run(&mut core, 4.0);
    assert!(core.health().zeroed && core.health().blocked.is_none());
}

/// G2: a zeroing that breaks off has told some motors where they stand and others not. The safety module had an older
/// zero, and nobody may take its word for the mixture: neither the device nor one that restarts meanwhile.
#[test]
fn g2_a_zeroing_that_breaks_off_leaves_no_zero_that_anybody_believes() {
    for (restarts, lost_words) in [(false, 0), (false, 2), (true, 0)] {
        let (mut core, mut bus) = started();
        bus.run(&mut core, 0.2);
        bus.pucks[3].ignores_position_writes = true;
        bus.lose_safety_writes = lost_words;
        let home = [0.5, -2.0, 0.0, 2.8, 0.0, 0.0, 0.0];
        bus.commands.push_back(Command::Zero { home });
        bus.run_until(&mut core, Stage::Blocked);
        assert_eq!(core.health().blocked, Some(StartupError::ZeroNotTaken(Node::ARM[3])));
        if restarts {
            core = silent_device();
        }
        bus.run(&mut core, 4.0);
        assert_eq!((core.stage(), core.health().zeroed), (Stage::WaitingForZero, false), "{:?}", bus.events);
        assert_nothing_leads_on(&mut core, &mut bus);
        assert!(!bus.safety_zero);
        bus.pucks[3].ignores_position_writes = false;
        assert_zeroing_leads_on(&mut core, &mut bus);
    }
}

/// G2: a puck has restarted and is woken, and then the board restarts: to it the puck looks as if it had never slept.
/// Or the start-up is blocked behind the wake, and a person switches the board off and on.
///
/// The change that makes it fail: the safety module is not told before the first puck is woken.
#[test]
fn g2_a_puck_that_was_woken_is_not_believed_by_a_board_that_restarts_at_any_moment() {
    for declared in [None, Some(control::Payload::None)] {
        for slots in (0..2800).step_by(40) {
            let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
            if let Some(payload) = declared {
                // The sensor that answers is none that was declared.
                let weight = control::model::WeightCorrection::none(payload);
                assert!(core.weigh(&device::weight::StoredWeight::Kept(weight)));
            }
            bus.pucks[3].awake_at = None;
            bus.run_slots(&mut core, slots);
            let mut other = silent_device();
            bus.run(&mut other, 4.0);
            assert_eq!(
                (other.stage(), other.health().zeroed),
                (Stage::WaitingForZero, false),
                "{declared:?}, after {slots} slots"
            );
        }
    }
}

/// G2: the words by which the safety module is to forget its zero have no acknowledge. One is lost, and the board
/// restarts: whoever believes the module takes counts that began anew for those of a zeroed arm.
#[test]
fn g2_a_lost_word_to_the_safety_module_leaves_no_zero_that_a_board_that_restarts_believes() {
    // Counts that jump in the loop, a puck that restarts, and a zeroing that breaks off: behind its IFAULT.
    for (case, lost) in [("jump", 1), ("jump", 2), ("puck", 1), ("zeroing", 2), ("zeroing", 3)] {
        let (mut core, mut bus) = started();
        bus.run(&mut core, 0.2);
        match case {
            "jump" => {
                bus.lose_safety_writes = lost;
                // To where J4 can be: its posture tells nothing.
                bus.pucks[3].position.0 += 8_000;
                bus.run(&mut core, 0.3);
            }
            "puck" => {
                core = silent_device();
                bus.pucks[3].awake_at = None;
                bus.run_until(&mut core, Stage::Waking);
                bus.lose_safety_writes = lost;
                bus.run_until(&mut core, Stage::WaitingForZero);
                bus.run(&mut core, 0.3);
            }
            _ => {
                bus.lose_safety_writes = lost;
                bus.pucks[3].ignores_position_writes = true;
                bus.commands.push_back(Command::Zero { home: [0.5, -2.0, 0.0, 2.8, 0.0, 0.0, 0.0] });
                bus.run_until(&mut core, Stage::Blocked);
                bus.pucks[3].ignores_position_writes = false;
            }
        }
        let mut other = silent_device();
        bus.run(&mut other, 4.0);
        assert_eq!((other.stage(), other.health().zeroed), (Stage::WaitingForZero, false), "{case}, {lost} lost");
        assert_eq!(bus.lose_safety_writes, 0, "{case}");
        assert_zeroing_leads_on(&mut other, &mut bus);
    }
}

/// G2: a zeroing whose question finds no room on the bus is refused before its host gives it up, and is not carried out
/// when there is room again: the arm may stand elsewhere by then.
#[test]
fn g2_a_zeroing_that_the_bus_has_no_room_for_is_refused_and_never_carried_out_later() {
    let (mut core, mut bus) = started();
    bus.run(&mut core, 0.2);
    let before = bus.pucks[0].position;
    // The controller takes nothing: the cable is out.
    bus.refuse = u32::MAX;
    bus.commands.push_back(Command::Zero { home: [0.5, -2.0, 0.0, 2.8, 0.0, 0.0, 0.0] });
    bus.run(&mut core, 0.19);
    let answers = |bus: &Bus| {
        let is_answer = |event: &&EventKind| matches!(event, EventKind::Accepted | EventKind::Refused(_));
        bus.events.iter().filter(is_answer).copied().collect::<Vec<_>>()
    };
    assert!(matches!(answers(&bus)[..], [EventKind::Accepted, EventKind::Refused(_)]), "{:?}", answers(&bus));
    bus.run(&mut core, 5.0);
    bus.refuse = 0;
    bus.run(&mut core, 5.0);
    assert_eq!(bus.pucks[0].position, before, "zeroed after its host had given it up");
    assert_eq!((core.stage(), core.health().zeroed), (Stage::WaitingForActive, true));
}

/// The same where the room goes in the middle of it, between any two slots. The change that makes it fail: the looks at
/// the arm wait for room without end. Its answer came behind that of the next command, and was taken for it.
#[test]
fn g2_a_zeroing_that_loses_the_bus_on_its_way_is_answered_in_time() {
    for slots in (0..75).step_by(3) {
        let (mut core, mut bus) = started();
        bus.run(&mut core, 0.2);
        bus.events.clear();
        bus.commands.push_back(Command::Zero { home: [0.5, -2.0, 0.0, 2.8, 0.0, 0.0, 0.0] });
        bus.run_slots(&mut core, slots);
        bus.refuse = u32::MAX;
        bus.run(&mut core, 0.19);
        let is_answer = |event: &&EventKind| matches!(event, EventKind::Accepted | EventKind::Refused(_));
        assert_eq!(bus.events.iter().filter(is_answer).count(), 1, "after {slots} slots: {:?}", bus.events);
        bus.commands.push_back(Control::Stop.into());
        bus.run(&mut core, 0.1);
        assert_eq!(bus.events.iter().filter(is_answer).count(), 2, "a stop behind it, after {slots} slots");
    }
}

/// G2: the cable of the bus is out in the middle of a zeroing, and in again when a person has activated the arm, which
/// may stand elsewhere. The change that makes it fail: the words with the counts wait for room without end.
#[test]
fn g2_no_count_is_written_long_after_a_person_has_said_where_the_arm_stands() {
    let mut broken_off = 0;
    for slots in 0..110 {
        let (mut core, mut bus) = started();
        bus.run(&mut core, 0.2);
        bus.commands.push_back(Command::Zero { home: [0.5, -2.0, 0.0, 2.8, 0.0, 0.0, 0.0] });
        bus.run_slots(&mut core, slots);
        let (out_us, seen) = (bus.now_us, bus.log.len());
        bus.refuse = u32::MAX;
        bus.run(&mut core, 1.0);
        bus.press_activate();
        bus.refuse = 0;
        bus.run(&mut core, 0.5);
        let late = bus.log[seen..].iter().filter(|(time, _)| *time > out_us + 200_000);
        let written = late.filter(|(_, frame)| {
            let action = Request::decode(frame).map(|request| request.action);
            matches!(action, Ok(Action::Set { property: PropertyId::POSITION, .. }))
        });
        assert_eq!(written.count(), 0, "after {slots} slots");
        if bus.events.contains(&EventKind::Blocked(StartupError::ZeroUnfinished)) {
            broken_off += 1;
            assert!(!core.health().zeroed);
            bus.press_idle();
            bus.run_until(&mut core, Stage::WaitingForZero);
            assert_zeroing_leads_on(&mut core, &mut bus);
        }
    }
    assert!(broken_off > 5, "{broken_off}");
}

/// G2: what a person says of an arm that sinks is no longer so once it is written. `counts` of motor 4 in each slot.
fn is_zeroed_while_turning(slots: usize, counts: i32, lose: u32) -> (bool, Vec<EventKind>) {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.pucks[5].lose = lose;
    for slot in 0..200 {
        if slot % slots == 0 && core.stage() == Stage::WaitingForZero {
            bus.pucks[3].position.0 += counts;
        }
        bus.run_slots(&mut core, 1);
    }
    let is_written = bus.sets().any(|(_, _, property, _)| property == PropertyId::POSITION);
    assert_eq!(is_written, core.health().zeroed, "counts are written if the arm is zeroed, and not otherwise");
    (core.health().zeroed, bus.events.iter().filter(|event| !matches!(event, EventKind::Startup(_))).copied().collect())
}

#[test]
fn g2_an_arm_that_still_moves_is_not_zeroed_and_no_count_is_written() {
    // A slot is 1.11 ms long: 1 rad/s of a motor is 0.72 counts in a slot.
    for (slots, counts, stands) in [(1, 0, true), (2, 1, true), (1, 1, false), (1, -1, false), (1, 20, false)] {
        let (zeroed, events) = is_zeroed_while_turning(slots, counts, 0);
        assert_eq!(zeroed, stands, "{counts} counts in {slots} slots: {events:?}");
        let refused = events.contains(&EventKind::Refused(Refusal::ZeroNeedsIdle));
        assert_eq!(refused, !stands, "{counts} counts in {slots} slots: {events:?}");
    }
    // A look of which an answer is lost is repeated.
    assert!(is_zeroed_while_turning(1, 0, 3).0);
    assert!(!is_zeroed_while_turning(1, 1, 3).0);
}

/// The change that makes it fail: one of torque and an ACTIVE safety module is enough to refuse a zeroing, and the
/// other leads to the start-up, which asks no puck for a position meanwhile.
#[test]
fn g2_a_zeroing_of_an_active_arm_is_refused_in_the_loop_with_and_without_torque() {
    for holds in [false, true] {
        let (mut core, mut bus) = started();
        bus.run_until(&mut core, Stage::WaitingForActive);
        bus.press_activate();
        bus.run_until(&mut core, Stage::Ready);
        if holds {
            bus.commands.push_back(Control::Hold.into());
        }
        bus.run(&mut core, 0.2);
        assert_eq!(core.health().state.has_torque(), holds);
        let cycles = |core: &DeviceController| core.health().counters.cycles;
        let before = cycles(&core);
        bus.events.clear();
        bus.commands.push_back(Command::Zero { home: HOME });
        for _ in 0..60 {
            bus.run(&mut core, 1.0 / 300.0);
            assert_eq!(core.stage(), Stage::Ready, "holds: {holds}");
        }
        assert!((59..=61).contains(&(cycles(&core) - before)), "holds: {holds}: {}", cycles(&core) - before);
        assert!(bus.events.contains(&EventKind::Refused(Refusal::ZeroNeedsIdle)), "{:?}", bus.events);
        assert_eq!(core.health().state.has_torque(), holds);
    }
}
