//! E1: every trigger in every state.

use control::guard::supervisor::{Transition, transition};
use control::guard::{Supervisor, Trigger};
use control::{Fault, Refusal, State};

/// Rank of the motion that a state allows: nothing, floating or stopping, moving.
fn authority(state: State) -> u8 {
    match state {
        State::Idle | State::Fault => 0,
        // A bridge carries on what was there.
        State::SoftStop | State::Gravity | State::Coast | State::Lower => 1,
        State::Hold | State::Approach | State::Run => 2,
    }
}

#[test]
fn e1_nothing_but_a_person_raises_authority() {
    for state in State::ALL {
        for trigger in Trigger::ALL {
            let Transition::Enter(next) = transition(state, trigger) else {
                continue;
            };
            if !trigger.is_command() {
                assert!(authority(next) <= authority(state), "{state:?} {trigger:?} {next:?}");
                assert!(!(state == State::Idle && next.has_torque()), "{trigger:?}");
            }
        }
    }
}

#[test]
fn e1_the_whole_table_is_as_documented() {
    use State::*;
    use Transition::{Enter, Refuse, Resume, Stay};
    // One row per state, one column per trigger in the order of Trigger::ALL:
    // Gravity Hold Approach Run Stop Release Clear | Missing Back SoftFault HardFault Dropped Arrived
    let table: [(State, [Transition; 13]); 9] = [
        (Idle, [Enter(Gravity), Enter(Hold), Refuse, Refuse, Stay, Stay, Stay, Stay, Stay, Stay, Stay, Stay, Stay]),
        (
            Gravity,
            [
                Stay,
                Enter(Hold),
                Enter(Approach),
                Enter(Run),
                Enter(SoftStop),
                Enter(Lower),
                Refuse,
                Enter(Coast),
                Stay,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Stay,
            ],
        ),
        (
            Hold,
            [
                Enter(Gravity),
                Stay,
                Enter(Approach),
                Enter(Run),
                Enter(SoftStop),
                Enter(Lower),
                Refuse,
                Enter(Coast),
                Stay,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Stay,
            ],
        ),
        (
            Approach,
            [
                Enter(Gravity),
                Enter(Hold),
                Refuse,
                Refuse,
                Enter(SoftStop),
                Enter(Lower),
                Refuse,
                Enter(Coast),
                Stay,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Enter(Hold),
            ],
        ),
        (
            Run,
            [
                Enter(Gravity),
                Enter(Hold),
                Refuse,
                Refuse,
                Enter(SoftStop),
                Enter(Lower),
                Refuse,
                Enter(Coast),
                Stay,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Enter(Hold),
            ],
        ),
        (
            Coast,
            [
                Refuse,
                Refuse,
                Refuse,
                Refuse,
                Enter(SoftStop),
                Enter(Lower),
                Refuse,
                Stay,
                Resume,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Stay,
            ],
        ),
        (
            SoftStop,
            [
                Enter(Gravity),
                Enter(Hold),
                Refuse,
                Refuse,
                Stay,
                Enter(Lower),
                Enter(Gravity),
                Stay,
                Stay,
                Stay,
                Enter(Fault),
                Enter(Idle),
                Stay,
            ],
        ),
        (Fault, [Refuse, Refuse, Refuse, Refuse, Stay, Stay, Enter(Idle), Stay, Stay, Stay, Stay, Stay, Stay]),
        (
            Lower,
            [
                Enter(Gravity),
                Enter(Hold),
                Refuse,
                Refuse,
                Enter(SoftStop),
                Stay,
                Refuse,
                Stay,
                Stay,
                Enter(SoftStop),
                Enter(Fault),
                Enter(Idle),
                Enter(Idle),
            ],
        ),
    ];
    for (state, row) in table {
        for (trigger, expected) in Trigger::ALL.into_iter().zip(row) {
            assert_eq!(transition(state, trigger), expected, "{state:?} {trigger:?}");
        }
    }
}

/// A supervisor driven into a state by triggers alone.
fn in_state(state: State) -> Supervisor {
    let path: &[Trigger] = match state {
        State::Idle => &[],
        State::Gravity => &[Trigger::Gravity],
        State::Hold => &[Trigger::Hold],
        State::Approach => &[Trigger::Hold, Trigger::Approach],
        State::Run => &[Trigger::Hold, Trigger::Run],
        State::Coast => &[Trigger::Hold, Trigger::Run, Trigger::RepliesMissing],
        State::SoftStop => &[Trigger::Hold, Trigger::SoftFault],
        State::Fault => &[Trigger::Hold, Trigger::HardFault],
        State::Lower => &[Trigger::Hold, Trigger::Release],
    };
    let mut supervisor = Supervisor::new();
    for trigger in path {
        let fault = match trigger {
            Trigger::SoftFault => Fault::JointLimit,
            Trigger::HardFault => Fault::BusFault,
            _ => Fault::None,
        };
        supervisor.take(*trigger, fault).expect("allowed");
    }
    assert_eq!(supervisor.state(), state);
    supervisor
}

#[test]
fn e1_every_pair_does_what_the_table_says_and_latches_its_fault() {
    for state in State::ALL {
        for trigger in Trigger::ALL {
            let mut supervisor = in_state(state);
            let before = supervisor.fault();
            let result = supervisor.take(trigger, Fault::TipSpeed);
            match transition(state, trigger) {
                Transition::Refuse => {
                    assert_eq!(result, Err(Refusal::WrongState));
                    assert_eq!((supervisor.state(), supervisor.fault()), (state, before));
                }
                Transition::Stay => assert_eq!((result, supervisor.state()), (Ok(false), state)),
                Transition::Resume => {
                    assert_eq!((result, supervisor.state()), (Ok(false), State::Run))
                }
                Transition::Enter(State::Coast) => {
                    assert_eq!((supervisor.state(), supervisor.law()), (State::Coast, state));
                    assert_eq!(supervisor.fault(), before, "a bridge is no fault");
                }
                Transition::Enter(next) => {
                    assert_eq!(supervisor.state(), next);
                    if matches!(trigger, Trigger::SoftFault | Trigger::HardFault | Trigger::SafetyDropped) {
                        let first = if before == Fault::None { Fault::TipSpeed } else { before };
                        assert_eq!(supervisor.fault(), first, "{state:?} {trigger:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn g6_the_first_cause_outlives_every_pair_of_events_until_a_person_clears_it() {
    for state in State::ALL {
        for first in Trigger::ALL {
            for second in Trigger::ALL {
                let mut supervisor = in_state(state);
                for (trigger, fault) in [(first, Fault::TipSpeed), (second, Fault::SafetyDropped)] {
                    let takes_away =
                        matches!(trigger, Trigger::SoftFault | Trigger::HardFault | Trigger::SafetyDropped);
                    let fault = if takes_away { fault } else { Fault::None };
                    let (before, from) = (supervisor.fault(), supervisor.state());
                    let taken = supervisor.take(trigger, fault);
                    let what = format!("{state:?} {first:?} {second:?}: {:?}", supervisor.fault());
                    let cleared = trigger == Trigger::Clear && taken.is_ok();
                    if cleared {
                        assert_eq!(supervisor.fault(), Fault::None, "{what}");
                    } else if before != Fault::None {
                        assert_eq!(supervisor.fault(), before, "{what}");
                    } else if supervisor.state() != from {
                        assert_eq!(supervisor.fault(), fault, "{what}");
                    }
                }
            }
        }
    }
}

#[test]
fn g6_a_fault_that_comes_during_a_stop_that_a_person_asked_for_is_kept() {
    for next in [Trigger::SafetyDropped, Trigger::HardFault, Trigger::Release] {
        let mut supervisor = in_state(State::Hold);
        supervisor.take(Trigger::Stop, Fault::None).expect("allowed");
        supervisor.take(Trigger::SoftFault, Fault::RepliesLost).expect("no command");
        supervisor.take(next, Fault::SafetyDropped).expect("allowed");
        assert_eq!(supervisor.fault(), Fault::RepliesLost, "{next:?}");
    }
}

#[test]
fn codes_are_stable_and_unique() {
    assert_eq!(State::ALL.map(State::code), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    // `docs/errors.md` holds the number of each.
    assert!(Fault::ALL.into_iter().map(Fault::code).eq(0..Fault::ALL.len() as u8));
    assert_eq!(Refusal::ALL.map(Refusal::code), [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17]);
    for state in State::ALL {
        assert_eq!(State::from_code(state.code()), Some(state));
    }
    for fault in Fault::ALL {
        assert_eq!(Fault::from_code(fault.code()), Some(fault));
        assert!(fault.explanation().len() > 5);
        assert_eq!(fault.to_string(), fault.explanation());
    }
    for refusal in Refusal::ALL {
        assert_eq!(Refusal::from_code(refusal.code()), Some(refusal));
    }
    assert_eq!((State::from_code(9), Fault::from_code(u8::MAX), Refusal::from_code(0)), (None, None, None));
}

#[test]
fn a1_each_bridge_leads_back_to_the_state_that_it_began_in() {
    let mut supervisor = in_state(State::Hold);
    for command in [None, Some(Trigger::Run), Some(Trigger::Hold), Some(Trigger::Gravity)] {
        if let Some(command) = command {
            supervisor.take(command, Fault::None).expect("allowed");
        }
        let before = supervisor.state();
        supervisor.take(Trigger::RepliesMissing, Fault::None).expect("no command");
        assert_eq!((supervisor.state(), supervisor.law()), (State::Coast, before));
        supervisor.take(Trigger::RepliesBack, Fault::None).expect("no command");
        assert_eq!(supervisor.state(), before);
    }
}

#[test]
fn a15_whichever_command_arms_the_arm_again_clears_the_drop_of_the_safety_module() {
    for arming in [Trigger::Gravity, Trigger::Hold] {
        let mut supervisor = in_state(State::Hold);
        supervisor.take(Trigger::SafetyDropped, Fault::SafetyDropped).expect("no command");
        assert_eq!((supervisor.state(), supervisor.fault()), (State::Idle, Fault::SafetyDropped));
        supervisor.take(arming, Fault::None).expect("allowed");
        assert_eq!(supervisor.fault(), Fault::None, "{arming:?}");
    }
}

#[test]
fn g6_a_loss_of_replies_that_goes_on_is_told_as_such_and_never_the_other_way_round() {
    for (first, then) in
        [(Fault::RepliesLost, Fault::RepliesLostForLong), (Fault::RepliesLostForLong, Fault::RepliesLost)]
    {
        let mut supervisor = in_state(State::Hold);
        supervisor.latch(first);
        supervisor.latch(then);
        assert_eq!(supervisor.fault(), Fault::RepliesLostForLong);
    }
}

#[test]
fn torque_is_sent_in_every_state_but_idle_and_fault() {
    for state in State::ALL {
        assert_eq!(state.has_torque(), !matches!(state, State::Idle | State::Fault), "{state}");
    }
}

#[test]
fn every_state_is_shown_to_a_person_by_the_name_that_documents_and_scripts_use() {
    let names = ["idle", "gravity", "hold", "approach", "run", "coast", "soft stop", "fault", "lowering"];
    assert_eq!(State::ALL.map(State::name), names);
    assert_eq!(State::ALL.map(|state| state.to_string()), names);
}

#[test]
fn e1_a_command_is_allowed_exactly_where_the_table_does_not_refuse_it() {
    for state in State::ALL {
        for trigger in Trigger::ALL {
            let refused = transition(state, trigger) == Transition::Refuse;
            let expected = if refused { Err(Refusal::WrongState) } else { Ok(()) };
            assert_eq!(in_state(state).allows(trigger), expected, "{state} {trigger:?}");
        }
    }
}

#[test]
fn a_limit_that_is_passed_without_torque_latches_nothing() {
    let mut supervisor = Supervisor::new();
    assert_eq!(supervisor.take(Trigger::SoftFault, Fault::JointLimit), Ok(false));
    assert_eq!((supervisor.state(), supervisor.fault()), (State::Idle, Fault::None));
}

/// A supervisor in each state, with what led there.
fn in_every_state() -> Vec<Supervisor> {
    use Trigger::{Approach, Hold, RepliesMissing, Run};
    let ways: [&[Trigger]; 12] = [
        &[],
        &[Trigger::Gravity],
        &[Hold],
        &[Hold, Approach],
        &[Hold, Run],
        &[Trigger::Gravity, RepliesMissing],
        &[Hold, RepliesMissing],
        &[Hold, Approach, RepliesMissing],
        &[Hold, Run, RepliesMissing],
        &[Hold, Trigger::SoftFault],
        &[Hold, Trigger::HardFault],
        &[Hold, Trigger::Release],
    ];
    let states: Vec<Supervisor> = ways
        .iter()
        .map(|way| {
            let mut supervisor = Supervisor::new();
            for trigger in *way {
                supervisor.take(*trigger, cause(*trigger)).expect("a way there");
            }
            supervisor
        })
        .collect();
    for state in State::ALL {
        assert!(states.iter().any(|supervisor| supervisor.state() == state), "{state:?}");
    }
    states
}

/// The fault that a trigger comes with.
fn cause(trigger: Trigger) -> Fault {
    match trigger {
        Trigger::SoftFault => Fault::ContactForce,
        Trigger::HardFault => Fault::BusFault,
        Trigger::SafetyDropped => Fault::SafetyDropped,
        _ => Fault::None,
    }
}

/// One step of a sequence: what must hold between the supervisor before and after it.
fn step(before: Supervisor, trigger: Trigger, way: &[Trigger]) -> Supervisor {
    let mut after = before;
    let taken = after.take(trigger, cause(trigger));
    let (was, is) = (before.state(), after.state());
    if taken.is_err() {
        assert!(trigger.is_command(), "{way:?}: {trigger:?} is refused");
        assert_eq!((was, before.fault()), (is, after.fault()), "{way:?}: {trigger:?} was refused");
    }
    // Torque begins by a person's command to float or to hold, motion by one to move.
    if is.has_torque() && !was.has_torque() {
        assert!(matches!(trigger, Trigger::Gravity | Trigger::Hold), "{way:?}: {trigger:?} gives torque");
    }
    if authority(after.law()) > authority(before.law()) {
        assert!(trigger.is_command(), "{way:?}: {trigger:?} raises {:?} to {:?}", before.law(), after.law());
    }
    if matches!(after.law(), State::Approach | State::Run) && after.law() != before.law() {
        assert!(matches!(trigger, Trigger::Approach | Trigger::Run), "{way:?}: {trigger:?} moves the arm");
    }
    // What is bridged has torque, and is not a bridge.
    if is == State::Coast {
        assert!(!matches!(after.law(), State::Coast | State::Idle | State::Fault), "{way:?}: {trigger:?}");
    }
    // The first cause stays until a person clears it, or arms again after the safety module's drop.
    if before.fault() != Fault::None && after.fault() != before.fault() {
        let arms = matches!(trigger, Trigger::Gravity | Trigger::Hold) && before.fault() == Fault::SafetyDropped;
        assert!(trigger == Trigger::Clear || arms, "{way:?}: {trigger:?} overwrites {:?}", before.fault());
        assert_eq!(after.fault(), Fault::None, "{way:?}");
    }
    // Whatever takes torque away has a name.
    if was.has_torque() && !is.has_torque() && trigger != Trigger::Arrived {
        assert_ne!(after.fault(), Fault::None, "{way:?}: {trigger:?} without a cause");
    }
    after
}

/// From wherever a sequence has led, a stop ends motion and torque does not rise; clear and hold lead back.
fn leads_back(mut supervisor: Supervisor, way: &[Trigger]) {
    supervisor.take(Trigger::Stop, Fault::None).expect("a stop is never refused");
    assert!(authority(supervisor.law()) < 2, "{way:?}: goes on after a stop as {:?}", supervisor.law());
    supervisor.take(Trigger::Clear, Fault::None).expect("a stop or a fault is cleared");
    assert_eq!(supervisor.fault(), Fault::None, "{way:?}");
    supervisor.take(Trigger::Hold, Fault::None).expect("armed again");
    assert_eq!((supervisor.state(), supervisor.fault()), (State::Hold, Fault::None), "{way:?}");
}

#[test]
fn e1_every_sequence_of_four_triggers_from_every_state_keeps_the_rules_and_leads_back() {
    let mut sequences = 0_u32;
    for start in in_every_state() {
        for first in Trigger::ALL {
            let one = step(start, first, &[]);
            for second in Trigger::ALL {
                let two = step(one, second, &[first]);
                for third in Trigger::ALL {
                    let three = step(two, third, &[first, second]);
                    for fourth in Trigger::ALL {
                        let way = [first, second, third, fourth];
                        leads_back(step(three, fourth, &way[..3]), &way);
                        sequences += 1;
                    }
                }
            }
        }
    }
    assert_eq!(sequences, 12 * 13_u32.pow(4));
}
