//! The hand in the control cycle: who drives it, how it follows, and what it does with what it feels.

use control::command::{Command, RunOptions};
use control::model::ArmModel;
use control::sense::hand::LOST_CYCLES;
use control::time::periods;
use control::{Calibration, Event, PERIOD, Payload, Refusal, State, flags};

use crate::hand_plant::Hand;
use crate::primitives::{Design, GOAL, START, adapting, primitive};
use crate::rig::Rig;

const OPEN: [f64; 4] = [0.0, 0.25, 0.25, 0.25];

/// A rig that holds the start of the test primitives, with an opened hand, tared.
fn holding() -> Rig<f32> {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.plant.hand = Some(Hand::new(OPEN));
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig.command(Command::Tare);
    rig
}

fn hand(rig: &Rig<f32>) -> &Hand {
    rig.plant.hand.as_ref().expect("fitted")
}

/// The change that makes it fail: the zero of the gauges is taken only after that of a sensor, which is not there.
#[test]
fn an_arm_without_a_sensor_at_its_wrist_tares_the_gauges_of_its_hand() {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.cycle.calibrate(Calibration::nominal(Payload::None)).expect("idle");
    rig.plant.deaf = true;
    // A hand that weighs nothing: what hangs on the arm is not what this is about.
    rig.plant.model = ArmModel::new(Payload::None);
    // The pucks brake.
    rig.plant.coulomb *= 100.0;
    rig.run_for(0.5);
    let alone = rig.tick(Some(Command::Tare)).event;
    assert_eq!(alone, Some(Event::Refused(Refusal::WrenchMissing)), "there is neither sensor nor hand");
    let mut hand = Hand::new(OPEN);
    hand.unloaded += 100.0;
    rig.plant.hand = Some(hand);
    rig.run_for(0.5);
    let gauges = |rig: &Rig<f32>| rig.last.expect("ran").record.gauges;
    assert!(gauges(&rig).iter().all(|gauge| gauge.abs() > 0.02), "they are adrift: {:?}", gauges(&rig));
    rig.command(Command::Tare);
    rig.run_for(0.1);
    assert!(gauges(&rig).iter().all(|gauge| gauge.abs() < 2e-3), "{:?}", gauges(&rig));
}

/// A primitive that closes the fingers to `closed` (rad), in 3 s, on the spot.
fn closing(closed: f64, gauges: [f64; 3]) -> Design {
    Design {
        duration: 3.0,
        goal: START,
        bent: false,
        expected: Some([0.0; 6]),
        expected_gauges: gauges,
        closed,
        ..Design::default()
    }
}

#[test]
fn a_hand_is_moved_when_asked_to_and_its_worms_hold_it_otherwise() {
    for (state, driven_afterwards) in [(Command::Gravity, false), (Command::Hold, true)] {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.plant.hand = Some(Hand::new(OPEN));
        rig.command(state);
        rig.run_for(1.0);
        assert_eq!(hand(&rig).frames, 0, "nobody has asked for anything");
        assert!(rig.last.expect("ran").record.flags & flags::HAND_READY != 0);
        rig.command(Command::MoveHand { q: [1.0, 1.2, 1.3, 1.4], duration: 1.5 });
        let mut fastest = 0.0f64;
        for _ in 0..periods(2.5) {
            let record = rig.tick(None).record;
            fastest = fastest.max(hand(&rig).dq[3]);
            for digit in 0..4 {
                let error = f64::from(record.hand_d[digit]) - hand(&rig).q[digit];
                assert!(error.abs() < 0.08, "digit {digit}: {error} rad behind");
            }
        }
        let found = hand(&rig).q;
        for (digit, wanted) in [1.0, 1.2, 1.3, 1.4].into_iter().enumerate() {
            assert!((found[digit] - wanted).abs() < 0.05, "digit {digit}: {found:?}");
        }
        // Peak speed of a minimum jerk: 1.875 times the mean.
        assert!((fastest - 1.15 * 1.875 / 1.5).abs() < 0.1, "{fastest}");
        let driven = rig.tick(None).actuation.hand_frame().is_some();
        assert_eq!(driven, driven_afterwards, "{state:?}");
    }
}

#[test]
fn a_move_that_asks_for_too_much_speed_takes_longer_and_nonsense_is_refused() {
    let mut rig = holding();
    rig.command(Command::MoveHand { q: [0.0, 2.3, 2.3, 2.3], duration: 0.0 });
    let mut fastest = 0.0f64;
    for _ in 0..1200 {
        rig.tick(None);
        fastest = fastest.max(hand(&rig).dq[1]);
    }
    assert!(fastest < 1.65, "{fastest} rad/s");
    assert!((hand(&rig).q[1] - 2.3).abs() < 0.05);
    let mut refused = |q: [f32; 4], duration: f32| rig.tick(Some(Command::MoveHand { q, duration })).event;
    let out_of_range = Some(Event::Refused(Refusal::OutOfRange));
    assert_eq!(refused([0.0, 2.6, 0.0, 0.0], 1.0), out_of_range);
    assert_eq!(refused([-0.2, 0.0, 0.0, 0.0], 1.0), out_of_range);
    assert_eq!(refused([f32::NAN, 0.0, 0.0, 0.0], 1.0), out_of_range);
    assert_eq!(refused([0.0; 4], -1.0), out_of_range);
    assert_eq!(refused([0.0; 4], f32::NAN), out_of_range);
    rig.plant.hand = None;
    assert_eq!(
        rig.tick(Some(Command::MoveHand { q: [0.0; 4], duration: 1.0 })).event,
        Some(Event::Refused(Refusal::NoHand))
    );
    assert_eq!(rig.last.expect("ran").record.flags & (flags::HAND_READY | flags::HAND_LOST), 0);
}

#[test]
fn a_run_moves_the_fingers_and_the_hold_after_it_keeps_the_grip() {
    let mut rig = holding();
    rig.plant.hand.as_mut().expect("fitted").object = [Some((1.0, 30.0)); 3];
    rig.load(&primitive(&closing(1.6, [0.0; 3]))).expect("loads");
    rig.command(Command::Run(RunOptions::default()));
    let refused = rig.tick(Some(Command::MoveHand { q: [0.0; 4], duration: 1.0 })).event;
    assert_eq!(refused, Some(Event::Refused(Refusal::WrongState)));
    rig.until(State::Hold, 10.0);
    let gripping = hand(&rig).pressing(0);
    assert!(gripping > 0.8, "open loop presses with what the drive gives: {gripping} N m");
    let posture = START.map(|q| q as f32 + 0.1);
    rig.command(Command::Approach { q: posture, duration: 2.0 });
    rig.run_for(4.0);
    assert_eq!(rig.cycle.state(), State::Hold);
    assert!(hand(&rig).pressing(0) > 0.95 * gripping, "{} of {gripping}", hand(&rig).pressing(0));
    assert!(rig.last.expect("ran").actuation.hand_frame().is_some());
    // Floating, nothing drives the hand, and the worm keeps the grip.
    let frames = hand(&rig).frames;
    rig.command(Command::Gravity);
    rig.run_for(1.0);
    assert_eq!(hand(&rig).frames, frames);
    assert!(hand(&rig).pressing(0) > 0.9 * gripping);
}

#[test]
fn a_hand_far_from_where_the_primitive_starts_is_refused_and_no_hand_is_not() {
    let mut rig = holding();
    rig.load(&primitive(&closing(1.6, [0.0; 3]))).expect("loads");
    rig.plant.hand.as_mut().expect("fitted").q[2] += 0.2;
    rig.run_for(0.5);
    let event = rig.tick(Some(Command::Run(RunOptions::default()))).event;
    assert_eq!(event, Some(Event::Refused(Refusal::HandTooFar)));
    rig.plant.hand.as_mut().expect("fitted").q[2] -= 0.1;
    rig.run_for(0.5);
    rig.command(Command::Run(RunOptions::default()));
    let planned = rig.last.expect("ran").record.hand_d;
    assert!((f64::from(planned[2]) - hand(&rig).q[2]).abs() < 0.01, "from where the finger is: {planned:?}");
    rig.command(Command::Hold);
    rig.run_for(0.5);
    rig.plant.hand = None;
    rig.run_for(0.1);
    rig.command(Command::Run(RunOptions::default()));
    rig.until(State::Hold, 10.0);
}

/// Its worms hold a hand that is silent for a moment where it is: it is as far from the start of the primitive as it
/// was. Such a run began, and the hand was thrown open at 2.23 rad/s once it was heard again.
///
/// The change that makes it fail: a hand that is lost as a run begins is taken for none.
#[test]
fn e2_a_run_is_refused_that_begins_while_its_hand_is_silent_and_far_from_its_start() {
    let mut rig = holding();
    rig.load(&primitive(&closing(0.25, [0.0; 3]))).expect("loads");
    rig.command(Command::MoveHand { q: [0.0, 1.2, 1.2, 1.2], duration: 1.5 });
    rig.run_for(3.0);
    rig.plant.hand.as_mut().expect("fitted").silent = true;
    rig.run_for(0.05);
    assert!(rig.last.expect("ran").record.flags & flags::HAND_LOST != 0);
    let event = rig.tick(Some(Command::Run(RunOptions::default()))).event;
    rig.run_for(0.1);
    rig.plant.hand.as_mut().expect("fitted").silent = false;
    let fastest = (0..periods(1.5)).fold(0.0f64, |fastest, _| {
        rig.tick(None);
        fastest.max(hand(&rig).dq[1].abs())
    });
    println!("{event:?}, {fastest:.2} rad/s");
    assert_eq!(event, Some(Event::Refused(Refusal::HandTooFar)));
    assert!(fastest < 0.1, "{fastest} rad/s");
}

/// Nobody has tared a hand since its start, a move closes it on something, and the first run is to hold that. Then the
/// hand is opened, empty, for a run that is to keep it so; how far that closes the hand (rad), how fast (rad/s), and
/// the torque that the first run was told of as it began (N m).
fn kept_open(tared: bool) -> (f64, f64, f64) {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.safety = puck::SafetyMode::Idle;
    rig.run_for(1.0);
    rig.safety = puck::SafetyMode::Active;
    rig.command(Command::Hold);
    rig.run_for(1.0);
    let object = [Some((0.2, 30.0)); 3];
    rig.plant.hand = Some(Hand { object, ..Hand::new([0.0, 0.05, 0.05, 0.05]) });
    rig.run_for(1.0);
    if tared {
        rig.command(Command::Tare);
    }
    rig.command(Command::MoveHand { q: [0.0, 0.33, 0.33, 0.33], duration: 1.0 });
    rig.run_for(2.5);
    rig.load(&primitive(&closing(0.33, [-0.45; 3]))).expect("loads");
    rig.command(Command::Run(adapting()));
    rig.run_for(0.1);
    let told = f64::from(rig.last.expect("ran").record.gauges[0]);
    rig.until(State::Hold, 10.0);
    rig.plant.hand.as_mut().expect("fitted").object = [None; 3];
    rig.command(Command::MoveHand { q: OPEN.map(|q| q as f32), duration: 1.0 });
    rig.run_for(2.0);
    rig.load(&primitive(&closing(OPEN[1], [0.0; 3]))).expect("loads");
    rig.command(Command::Run(adapting()));
    let (mut far, mut fast) = (0.0f64, 0.0f64);
    for _ in 0..periods(4.0) {
        rig.tick(None);
        (far, fast) = (far.max(hand(&rig).q[1]), fast.max(hand(&rig).dq[1].abs()));
    }
    (far, fast, told)
}

/// A grip that is taken for the zero is pulled on by every run behind it: one closed the empty hand at 1.65 rad/s.
///
/// The change that makes it fail: the first zero of the gauges is that of the first run, whatever is gripped by then.
#[test]
fn b5_a_grip_is_not_taken_for_the_zero_of_gauges_that_nobody_has_tared() {
    let (tared, untared) = (kept_open(true), kept_open(false));
    println!("{tared:.2?} tared by a person, {untared:.2?} not");
    for (far, fast, told) in [tared, untared] {
        assert!(told < -0.15, "{told} N m told of a grip");
        assert!(far < OPEN[1] + 0.1 && fast < 0.3, "{far} rad at {fast} rad/s with nothing in the hand");
    }
}

#[test]
fn closing_on_an_object_reads_as_a_negative_gauge_whatever_its_zero() {
    for unloaded in [1900.0, 2000.0, 2100.0] {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.plant.hand = Some(Hand { unloaded, ..Hand::new(OPEN) });
        rig.command(Command::Hold);
        rig.run_for(1.0);
        rig.command(Command::Tare);
        rig.plant.hand.as_mut().expect("fitted").object[1] = Some((0.25 - 0.01, 30.0));
        rig.run_for(0.5);
        let gauges = rig.last.expect("ran").record.gauges.map(f64::from);
        assert!((gauges[1] + 0.3).abs() < 0.01, "{gauges:?}");
        assert!(gauges[0].abs() < 2e-3 && gauges[2].abs() < 2e-3, "{gauges:?}");
    }
}

/// A moment of a compliant run under force control, and what the hand is in contact with then.
#[derive(Clone, Copy, Default)]
struct Moment {
    /// Seconds after the beginning of the run.
    from: f64,
    /// Something is in the hand.
    held: bool,
    /// The drives of the hand have twice the friction of the model.
    worn: bool,
    /// The hand falls silent half a second before.
    unheard: bool,
    /// Force that leads the plan forwards from half a second before (N); without one the plan is not bent.
    leading: f64,
}

/// Torques of J1 (N m) for 0.3 s of such a run, while the sensor feels this force (N) sideways that has swung at 20 Hz
/// for half a second; and the speed of the plan at the end of it (m/s).
fn torques(design: &Design, moment: Moment, newtons: f64) -> (Vec<f64>, f64) {
    let mut rig = holding();
    if moment.held {
        rig.plant.hand.as_mut().expect("fitted").object = [Some((1.0, 30.0)); 3];
    }
    if moment.worn {
        rig.plant.hand.as_mut().expect("fitted").friction = 2.0;
    }
    rig.load(&primitive(design)).expect("loads");
    let options = RunOptions {
        force_control: true,
        compliant: true,
        feedback: moment.leading > 0.0,
        finger_feedback: false,
        ..RunOptions::default()
    };
    rig.command(Command::Run(options));
    // The first half second is for what is slow.
    rig.run_for(moment.from - 0.5);
    rig.plant.push[0] = moment.leading;
    rig.plant.hand.as_mut().expect("fitted").silent = moment.unheard;
    let mut place = [0.0; 3];
    let mut speed = 0.0;
    let torque = |cycle| {
        rig.plant.push[1] = newtons * (f64::from(cycle) * PERIOD * 20.0 * std::f64::consts::TAU).sin();
        let record = rig.tick(None).record;
        assert_eq!(record.state, State::Run);
        let [x, y, z, ..] = record.pose_d.map(f64::from);
        speed = [x, y, z].iter().zip(place).map(|(now, before)| (now - before).powi(2)).sum::<f64>().sqrt() / PERIOD;
        place = [x, y, z];
        f64::from(record.tau[0])
    };
    let torques = (0..periods(0.8)).map(torque).skip(usize::from(periods(0.5))).collect();
    (torques, speed)
}

/// Swing of the torque of J1 (N m) that 2 N make, see [`torques`]; and the speed of the plan (m/s).
fn swing(design: &Design, moment: Moment) -> (f64, f64) {
    let (still, speed) = torques(design, moment, 0.0);
    let moved = torques(design, moment, 2.0).0.into_iter().zip(still).map(|(moved, still)| moved - still);
    let (low, high) = moved.fold((f64::MAX, f64::MIN), |(low, high), torque| (low.min(torque), high.max(torque)));
    (high - low, speed)
}

/// An object in the hand weighs more than a joint of the wrist: without friction, its inertia and Eq (12) swung J1 at
/// 20 Hz. The change that makes it fail: Eq (12) takes what swings while something is gripped.
#[test]
fn g10_a_force_that_swings_in_a_grip_is_not_pressed_against() {
    let design = closing(1.6, [0.0; 3]);
    let [(held, _), (free, _)] =
        [true, false].map(|held| swing(&design, Moment { from: 2.5, held, ..Moment::default() }));
    println!("{held} N m, {free} N m with nothing in the hand");
    assert!(free > 0.2 && held < 0.3 * free, "{held} N m, {free} N m with nothing in the hand");
}

/// Fingers that clamp make a contact that is too stiff for the fast path of Eq (12): J1 swung at 16 Hz with up to 4 N
/// until two of them counted as held up. A hand that closes on its way meets what is in the way, and shall feel that.
///
/// The changes that make it fail: a hand that closes is an open one; one that closes on its way is not.
#[test]
fn g10_a_force_that_swings_while_the_hand_closes_where_it_stands_is_not_pressed_against() {
    let standing = closing(1.6, [0.0; 3]);
    let moving = Design { goal: GOAL, ..closing(1.6, [0.0; 3]) };
    let open = Design { goal: GOAL, ..closing(0.0, [0.0; 3]) };
    let moment = Moment { from: 1.3, ..Moment::default() };
    let [(standing, _), (moving, _), (open, _)] = [standing, moving, open].map(|design| swing(&design, moment));
    println!("{standing} N m where it stands, {moving} on its way, {open} with an open hand");
    assert!(open > 0.2 && moving > 0.9 * open && standing < 0.3 * open, "{standing} {moving} {open}");
}

/// Drives with more friction than the model's are behind their plan all the way. That is no grip: such a hand meets
/// what is in its way on the fast path, as any other does.
///
/// The change that makes it fail: a finger that is behind its plan counts as held up, whether it moves or not.
#[test]
fn g10_a_finger_that_lags_for_its_friction_is_not_held_up() {
    let moving = Design { goal: GOAL, ..closing(1.6, [0.0; 3]) };
    let [(worn, _), (new, _)] = [true, false].map(|worn| {
        let moment = Moment { from: 1.7, worn, ..Moment::default() };
        swing(&moving, moment)
    });
    println!("{worn} N m with twice the friction, {new} N m");
    assert!(new > 0.2 && worn > 0.8 * new, "{worn} {new}");
}

/// The plan of a hand that nobody hears goes on without its fingers: that is no grip. One that gripped still does, by
/// its worms.
///
/// The changes that make it fail: the last angles of a lost hand are compared with the plan; a lost hand is an open
/// one.
#[test]
fn g10_a_hand_that_falls_silent_goes_on_with_what_it_did() {
    let moving = Design { goal: GOAL, ..closing(1.6, [0.0; 3]) };
    let [(unheard, _), (heard, _)] =
        [true, false].map(|unheard| swing(&moving, Moment { from: 0.6, unheard, ..Moment::default() }));
    println!("{unheard} N m while it closes unheard on its way, {heard} N m heard");
    assert!(heard > 0.2 && unheard > 0.9 * heard, "{unheard} {heard}");
    let still = closing(1.6, [0.0; 3]);
    let [(unheard, _), (heard, _)] =
        [true, false].map(|unheard| swing(&still, Moment { from: 2.5, held: true, unheard, ..Moment::default() }));
    println!("{unheard} N m in a grip that is not heard, {heard} N m heard");
    assert!(unheard < 0.3 && heard < 0.3, "{unheard} {heard}");
}

/// An object between closing fingers leads the plan of a hand that adapts: at up to 9 cm/s, seen in the experiments,
/// where J1 went on swinging with 2 N. That is no hand that closes on its way.
///
/// The change that makes it fail: a hand that closes stops standing as soon as its plan is as fast as it may be in the
/// beginning.
#[test]
fn g10_a_force_that_swings_while_it_leads_a_hand_that_closes_is_not_pressed_against() {
    let (closing, open) = (closing(1.6, [0.0; 3]), closing(0.0, [0.0; 3]));
    let led = Moment { from: 1.3, leading: 2.0, ..Moment::default() };
    let [(closing, speed), (open, _)] = [closing, open].map(|design| swing(&design, led));
    println!("{closing} N m while it closes, led at {speed} m/s, {open} with an open hand");
    assert!(open > 0.5 && closing < 0.3 * open && (0.025..0.055).contains(&speed), "{closing} {open} {speed}");
}

/// Torque with which F2 presses on an object at the end of a run that closes on it.
fn grip(options: RunOptions, reversed_gauges: bool, expected: f64) -> f64 {
    let mut rig = holding();
    {
        let hand = rig.plant.hand.as_mut().expect("fitted");
        hand.object = [Some((1.0, 30.0)); 3];
        hand.reversed_gauges = reversed_gauges;
    }
    rig.load(&primitive(&closing(1.2, [expected; 3]))).expect("loads");
    rig.command(Command::Run(options));
    rig.run_for(2.9);
    assert_eq!(rig.cycle.state(), State::Run);
    hand(&rig).pressing(1)
}

#[test]
fn a_finger_under_force_control_yields_to_an_object_it_did_not_expect() {
    let open = RunOptions::default();
    let force = RunOptions { force_control: true, ..open };
    let adapting = RunOptions { force_control: true, feedback: true, ..open };
    let (stiff, soft, bent) = (grip(open, false, 0.0), grip(force, false, 0.0), grip(adapting, false, 0.0));
    println!("grip: {stiff} N m open loop, {soft} with Eq (14), {bent} with Eq (8) as well");
    assert!(soft < 0.9 * stiff, "{soft} of {stiff}");
    assert!(bent < 0.7 * soft, "the plan of the finger gives way as well: {bent} of {soft}");
    // Negative control: with gauges of the wrong sign the finger presses harder instead.
    let wrong = grip(adapting, true, 0.0);
    assert!(wrong > soft, "{wrong}");
    // What is expected is pressed, as far as the drive goes.
    let pressing = grip(adapting, false, -0.6);
    assert!(pressing > bent + 0.15, "{pressing} against {bent}");
    // Without the gauges the plan of the fingers stays what it was.
    let unbent = grip(RunOptions { finger_feedback: false, ..adapting }, false, 0.0);
    assert!((unbent - soft).abs() < 0.05, "{unbent} {soft}");
}

#[test]
fn an_inner_link_that_closes_on_a_hard_thing_presses_at_most_half_more_than_it_was_asked_to() {
    // Without Eq (8): where the expectation misses its object from the start on, that would throw the fingers shut.
    let options = RunOptions { force_control: true, ..RunOptions::default() };
    // The gauge feels the outer link only: what an inner link presses on is known to nobody.
    for (expected, asked) in [(0.0, 0.45), (-0.25, 0.25)] {
        let mut rig = holding();
        {
            let hand = rig.plant.hand.as_mut().expect("fitted");
            hand.object = [Some((1.0, 100.0)); 3];
            hand.unfelt = true;
        }
        // Within 3 s the finger's own speed, which the worm holds, would be 0.5 N m of it.
        let design = Design { duration: 6.0, ..closing(1.6, [expected; 3]) };
        rig.load(&primitive(&design)).expect("loads");
        rig.command(Command::Run(options));
        let mut hardest = 0.0f64;
        assert_eq!(rig.cycle.state(), State::Run);
        while rig.cycle.state() == State::Run {
            rig.tick(None);
            hardest = hardest.max(hand(&rig).pressing(0));
        }
        rig.run_for(1.0);
        let held = hand(&rig).pressing(0).max(hardest);
        println!("asked {asked} N m: {held} N m");
        assert!(held <= 1.5 * asked, "asked {asked}: {held}");
        assert!(held >= 0.4 * asked, "it presses at all: {held}");
    }
}

#[test]
fn a_hand_that_falls_silent_is_bridged_then_left_to_its_worms_and_taken_up_again() {
    let mut rig = holding();
    rig.command(Command::MoveHand { q: [0.0, 1.2, 1.2, 1.2], duration: 1.5 });
    rig.run_for(0.7);
    let before = hand(&rig).torque;
    rig.plant.hand.as_mut().expect("fitted").silent = true;
    for cycle in 1..=20u8 {
        let output = rig.tick(None);
        assert_eq!(output.actuation.hand_frame().is_some(), cycle <= LOST_CYCLES, "cycle {cycle}");
        assert_eq!(output.record.flags & flags::HAND_LOST != 0, cycle > LOST_CYCLES);
        assert_eq!(output.record.flags & flags::HAND_READY != 0, cycle <= LOST_CYCLES);
        if cycle <= LOST_CYCLES {
            assert!((hand(&rig).torque[1] - before[1]).abs() < 0.1, "the last torque stays");
        }
    }
    assert_eq!(rig.cycle.state(), State::Hold, "the arm is not concerned");
    let mut torque = 0.0f64;
    rig.plant.hand.as_mut().expect("fitted").silent = false;
    for _ in 0..periods(2.0) {
        rig.tick(None);
        let step = (hand(&rig).torque[1] - torque).abs();
        assert!(step < 1.2 / f64::from(periods(0.05)) + 1e-3, "{step} N m in one cycle");
        torque = hand(&rig).torque[1];
    }
    assert!((hand(&rig).q[1] - 1.2).abs() < 0.05, "{:?}", hand(&rig).q);
}
