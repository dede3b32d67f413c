//! Margins of the control laws on an arm with elastic cables and without friction: `cargo xtask margins`.
//!
//! The real control cycle, kicked in every pose, law and variation. A loop passes if less than [`PASSED`] of the kick
//! is left after 1.5 s, compared with the same arm that was not kicked. What does not pass yet is in [`OPEN`].

mod loops;
mod plant;

use std::collections::BTreeSet;

use control::law::Gains;
use loops::{Law, Move, Stop, beyond_limit, kick, left_on_the_way, shake};
use nalgebra::Vector3;
use plant::{SUBSTEPS, Variation};

/// Largest share of the kick that may be left.
const PASSED: f64 = 0.3;

/// Postures of demonstrations (before, at and after a grasp), the hand pointing down, a turned wrist, a stretched arm.
const POSES: [(&str, [f64; 7]); 6] = [
    ("start", [-0.20, 1.30, 1.20, 2.10, -0.30, -0.50, 1.40]),
    ("grasp", [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]),
    ("down", [0.0, 0.6, 0.0, 2.0, 0.0, 0.5, 0.0]),
    ("turned", [0.3, 0.9, -0.4, 1.6, -1.5, 0.9, 1.0]),
    ("lifted", [-0.3, 0.9, 1.0, 2.2, -0.4, 0.2, 1.2]),
    ("stretched", [0.2, 1.4, 0.1, 0.8, 0.3, 0.3, 0.2]),
];

/// Ranges from which other poses are drawn (rad).
const DRAWN: [(f64, f64); 7] =
    [(-2.0, 2.0), (-1.2, 1.7), (-2.0, 2.0), (0.3, 2.6), (-3.0, 1.0), (-1.2, 1.2), (-2.0, 2.0)];

/// Torque that presses a joint against its soft limit (N m): about 0.01 rad of the push back. An arm that floats is
/// pressed four times as hard: no distance stops it.
const PRESSED: [f64; 7] = [1.0, 1.0, 0.5, 0.5, 0.1, 0.1, 0.03];

/// Force that pushes the hand in runs with Eq (8) or Eq (12) (N): beyond the dead band, which else hides their loops,
/// and beyond what the tare follows in free motion. Joints and sensor feel it: an error of the sensor alone is
/// contradicted, and the arm stopped, before any loop is seen.
const PUSH: [f64; 3] = [0.8, 0.2, 0.0];

const fn run(compliant: bool, feedback: bool, force: bool) -> Law {
    Law::Run { compliant, feedback, force }
}

const LAWS: [(&str, Law); 10] = [
    ("hold", Law::Hold),
    ("approach", Law::Approach),
    ("teach", Law::Teach),
    ("soft stop", Law::SoftStop),
    ("run, stiff", run(false, false, false)),
    ("run, stiff, Eq 12", run(false, false, true)),
    ("run, compliant", run(true, false, false)),
    ("run, compliant, Eq 8", run(true, true, false)),
    ("run, compliant, Eq 12", run(true, false, true)),
    ("run, compliant, Eqs 8, 12", run(true, true, true)),
];

/// Loops that do not pass: the law, and the variations. One that passes has to leave the list.
const OPEN: [(&str, &[&str]); 4] = [
    // Nothing but gravity torque carries what the arm does not know of: it sinks, and a monitor stops it.
    ("teach", &["payload 1 kg"]),
    // Force control that presses on with a hard wall that holds on.
    ("run, compliant, Eq 12", &["3000 N/m y", "3000 N/m z"]),
    // A wall that holds on to a hand that gives way; and a kilogram nobody knows of, which a monitor finds once the
    // hand has given way by a quarter of a metre. No mode of the host has Eq (8) alone.
    ("run, compliant, Eq 8", &["payload 1 kg", "200 N/m y", "1000 N/m y", "3000 N/m y"]),
    ("run, compliant, Eqs 8, 12", &["1000 N/m y", "3000 N/m y"]),
];

/// Loops that do not pass either at 500 Hz: the gains are those of 300 Hz, nobody tuned them for another rate. The
/// swing of 3 Hz is the integral's (decision 0099).
const OPEN_AT_500: [(&str, &[&str]); 1] = [("hold", &["gain x0.5"])];

/// The poses: [`POSES`], or twelve that nobody chose gains on, drawn with the seed `TACTUS_MARGIN_SEED`.
fn poses() -> Vec<(String, [f64; 7])> {
    drawn().map_or_else(|| POSES.map(|(name, q)| (name.to_owned(), q)).into(), poses_of)
}

/// Twelve poses of this seed.
fn poses_of(seed: u64) -> Vec<(String, [f64; 7])> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut draw = |(min, max): (f64, f64)| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        min + (max - min) * (state >> 11) as f64 / (1u64 << 53) as f64
    };
    (1..=12).map(|number| (format!("drawn {seed}/{number}"), DRAWN.map(&mut draw))).collect()
}

fn drawn() -> Option<u64> {
    std::env::var("TACTUS_MARGIN_SEED").ok().map(|seed| seed.parse().expect("TACTUS_MARGIN_SEED is a number"))
}

/// True if what the wrist sensor measures acts on the arm.
fn feels(law: Law) -> bool {
    matches!(law, Law::Run { feedback, force, .. } if feedback || force)
}

/// The forces under which a loop is kicked (N). A plan that bends gives way by a quarter of a metre: pushed out, the
/// arm would end stretched, so it is pushed in.
fn pushes(law: Law) -> Vec<Vector3<f64>> {
    let (out, mut pushes) = (Vector3::from(PUSH), vec![Vector3::zeros()]);
    match law {
        Law::Run { feedback: true, .. } => pushes.push(Vector3::new(-out.x, out.y, out.z)),
        Law::Run { force: true, .. } => pushes.extend([out, Vector3::new(-out.x, out.y, out.z)]),
        _ => {}
    }
    pushes
}

fn variations(law: Law) -> Vec<(String, Variation)> {
    // A factor on gravity torque is no gain of a loop: where nothing else acts it is left out.
    let floats = matches!(law, Law::Teach | Law::SoftStop);
    let nominal = Variation::NONE;
    let mut all = vec![
        ("nominal".to_owned(), nominal),
        ("gain x1.4".to_owned(), Variation { gain: 1.4, ..nominal }),
        ("gain x2".to_owned(), Variation { gain: 2.0, ..nominal }),
        ("gain x0.5".to_owned(), Variation { gain: 0.5, ..nominal }),
        ("1 cycle late".to_owned(), Variation { delay: SUBSTEPS, ..nominal }),
        ("2 cycles late".to_owned(), Variation { delay: 2 * SUBSTEPS, ..nominal }),
        ("cables x0.8".to_owned(), Variation { cables: 0.8, ..nominal }),
        ("cables x1.2".to_owned(), Variation { cables: 1.2, ..nominal }),
        ("payload 1 kg".to_owned(), Variation { payload: 1.0, ..nominal }),
    ];
    for stiffness in [200.0, 1000.0, 3000.0] {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            all.push((format!("{stiffness} N/m {name}"), Variation { wall: (stiffness, axis), ..nominal }));
        }
    }
    // What feels has loops of its own, which do not bear twice their gain anywhere.
    if !feels(law) {
        for (joint, torque) in PRESSED.into_iter().enumerate() {
            for (torque, name) in [(-torque, "lower"), (torque, "upper")] {
                let (pressed, gain) =
                    (Some((joint, if floats { 4.0 * torque } else { torque })), if floats { 1.0 } else { 2.0 });
                all.push((format!("J{} {name} limit", joint + 1), Variation { pressed, gain, ..nominal }));
            }
        }
    }
    all.retain(|(what, _)| !(floats && what.starts_with("gain")));
    all
}

/// The worst pose of a law under a variation: what is left of the kick, and the words for it.
fn worst(law: Law, variation: Variation) -> (f64, String) {
    let mut worst = (-1.0, String::new());
    for (pose, q) in poses() {
        for push in pushes(law) {
            let (share, words) = match kick(&Gains::tuned(), law, q, variation, push) {
                Ok(rest) => {
                    let words = format!("{:8.3}  J{} {:5.1} Hz  {pose}", rest.share, rest.joint, rest.frequency);
                    (rest.share, words)
                }
                Err(_) => (f64::INFINITY, format!(" stopped               {pose}")),
            };
            if share > worst.0 {
                worst = (share, words);
            }
        }
    }
    worst
}

#[test]
fn every_loop_that_is_not_listed_is_stable_without_friction_and_every_listed_one_is_not() {
    let at_500 = OPEN_AT_500.iter().filter(|_| control::RATE_HZ == 500);
    let open: BTreeSet<(String, String)> = OPEN
        .iter()
        .chain(at_500)
        .flat_map(|(law, variations)| variations.iter().map(|variation| ((*law).to_owned(), (*variation).to_owned())))
        .collect();
    let rows = std::thread::scope(|scope| {
        let workers = LAWS.map(|(name, law)| {
            scope.spawn(move || {
                let all = variations(law).into_iter();
                all.map(|(what, variation)| (name, worst(law, variation), what)).collect::<Vec<_>>()
            })
        });
        workers.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect::<Vec<_>>()
    });
    let mut wrong = Vec::new();
    println!("left of the kick, its joint and frequency, worst pose");
    for (law, (share, words), what) in rows {
        let fails = share > PASSED || share.is_nan();
        let listed = open.contains(&(law.to_owned(), (*what).to_owned()));
        let mark = if fails { if listed { "open" } else { "FAILS" } } else { "" };
        println!("{law:26} {what:19} {words:32} {mark}");
        if fails != listed {
            wrong.push(format!("{law}, {what}: {words}"));
        }
    }
    assert!(drawn().is_some() || wrong.is_empty(), "not as listed:\n{}", wrong.join("\n"));
}

/// Seeds of the poses on which no gain was chosen; the rates of the posture's integral were, among others. What fails
/// in poses that were looked at once is in decision 0149.
const UNSEEN: [u64; 2] = [21, 22];

/// Largest part of the pushes that may bring the arm to a limit of its joints, or to a singular posture, before any
/// kick: a quarter of a metre from a pose that was drawn may lead anywhere.
const UNREACHED: f64 = 0.1;

/// Variations for poses that were drawn: gain, delay and cables.
const MARGINS: [&str; 7] =
    ["nominal", "gain x1.4", "gain x2", "gain x0.5", "1 cycle late", "cables x0.8", "cables x1.2"];

/// Every law that the host asks for, in poses that nobody chose gains on. At half the gain a run has half of the
/// gravity torque: there it is left out.
///
/// The changes that make it fail: P of Eq (12) without what is 10 ms old; a plan that bends without a mass; the posture
/// integral with its whole rate at the edge of its band.
#[test]
fn every_law_of_the_host_has_its_margins_in_poses_on_which_no_gain_was_chosen() {
    let laws: Vec<_> = LAWS.into_iter().filter(|(name, _)| *name != "run, compliant, Eq 8").collect();
    let poses: Vec<_> = UNSEEN.into_iter().flat_map(poses_of).collect();
    let mut jobs = Vec::new();
    for (name, law) in laws {
        let half = matches!(law, Law::Run { .. });
        let all = variations(law).into_iter().filter(|(what, _)| MARGINS.contains(&what.as_str()));
        for (what, variation) in all.filter(|(what, _)| !(half && what == "gain x0.5")) {
            for (pose, q) in &poses {
                for push in pushes(law) {
                    jobs.push((name, law, what.clone(), variation, pose, *q, push));
                }
            }
        }
    }
    let half = jobs.len() / 2;
    let outcomes = std::thread::scope(|scope| {
        let workers = [&jobs[..half], &jobs[half..]].map(|jobs| {
            scope.spawn(move || {
                let kicked = |job: &(_, Law, _, Variation, _, [f64; 7], Vector3<f64>)| {
                    kick(&Gains::tuned(), job.1, job.5, job.3, job.6)
                };
                jobs.iter().map(kicked).collect::<Vec<_>>()
            })
        });
        workers.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect::<Vec<_>>()
    });
    let (mut wrong, mut worst, mut unreached) = (Vec::new(), 0.0f64, 0);
    for ((name, _, what, _, pose, q, push), outcome) in jobs.iter().zip(outcomes) {
        match outcome {
            Ok(rest) if rest.share <= PASSED => worst = worst.max(rest.share),
            Err(Stop::Before) => unreached += 1,
            other => wrong.push(format!("{name}, {what}, {pose} {q:.2?}, pushed by {} N: {other:.3?}", push.x)),
        }
    }
    println!("{} kicks, {unreached} not reached, {worst:.3} left at most\n{}", jobs.len(), wrong.join("\n"));
    let few = f64::from(unreached) <= UNREACHED * jobs.len() as f64;
    assert!(wrong.is_empty() && few, "{} of {} fail, {unreached} not reached", wrong.len(), jobs.len());
}

#[test]
fn g10_a_loop_that_shakes_is_stopped_within_half_a_second_by_its_name_and_then_stands() {
    // Gains as some arm may turn out to have them; the soft stop keeps its own. Before a joint that swings was left to
    // the model, the stop went on shaking with 1.7 rad/s.
    let mut shook = 0;
    for (joint, factor) in [(0, 8.0), (1, 8.0), (3, 4.0), (3, 8.0)] {
        let mut gains = Gains::tuned();
        gains.stiff.stiffness[joint] *= factor;
        for (pose, q) in POSES {
            let Some(stopped) = shake(&gains, q, 0.6) else { continue };
            println!("J{} x{factor} {pose}: {stopped:?}", joint + 1);
            // An arm that is stretched shakes its hand so fast that another limit is broken first.
            shook += u32::from(stopped.fault == control::Fault::Shaking);
            assert!(matches!(stopped.fault, control::Fault::Shaking | control::Fault::TipSpeed), "{pose}: {stopped:?}");
            assert!(stopped.after < 0.5 && stopped.left < 0.1, "{pose}: {stopped:?}");
            // The arm can be led by hand again; held with the same gains it is stopped again.
            let [led, held] = stopped.then;
            assert_eq!(led, control::Fault::None, "{pose}: {stopped:?}");
            assert_ne!(held, control::Fault::None, "{pose}: {stopped:?}");
        }
    }
    assert!(shook >= 15, "{shook} shook");
}

/// Moves at full speed: one that shook while a simulated arm was weighed, and those between postures.
fn moves() -> Vec<Move> {
    let found = ([-0.41, -0.31, 0.77, 1.86, -1.03, 0.76, 0.0], [0.15, -0.13, 0.03, 0.46, -1.59, -0.64, 0.90]);
    let between = (0..POSES.len()).map(|at| (POSES[at].1, POSES[(at + 1) % POSES.len()].1));
    let there = std::iter::once(found).chain(between);
    let all = there.flat_map(|(from, to)| [(from, to), (to, from)]);
    all.flat_map(|(from, to)| [0.6, 1.0, 1.4].map(|kicked| Move { from, to, kicked })).collect()
}

/// A joint that follows a fast plan is not thrown by anybody. Kept within 0.1 rad/s of what is measured, the observed
/// velocity had the swing of the cables in it: J4 and J5 shook at 37 Hz.
///
/// The change that makes it fail: the speed from which a joint is fast is not the one beyond its plan.
#[test]
fn g10_an_arm_that_moves_fast_does_not_shake_without_friction() {
    // Twice the gain would be twice the torque of gravity, which changes on the way.
    let nominal = Variation::NONE;
    let variations = [
        ("nominal", nominal),
        ("1 cycle late", Variation { delay: SUBSTEPS, ..nominal }),
        ("cables x0.8", Variation { cables: 0.8, ..nominal }),
        ("cables x1.2", Variation { cables: 1.2, ..nominal }),
    ];
    let (mut wrong, mut worst) = (Vec::new(), 0.0);
    for (what, variation) in variations {
        for place in moves() {
            let left = left_on_the_way(&place, variation);
            worst = f64::max(worst, left.unwrap_or(f64::INFINITY));
            if left.is_none_or(|left| left > 2.5) {
                wrong.push(format!("{what}, {place:?}: {left:?}"));
            }
        }
    }
    println!("left of the kick on the way: {worst:.3} at most");
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), variations.len() * moves().len(), wrong.join("\n"));
}

#[test]
fn b8_a_joint_beyond_its_bound_is_told_in_every_state() {
    for (name, law) in LAWS.into_iter().filter(|(_, law)| !feels(*law)) {
        let (mut beyond, mut wrong) = (0, 0);
        for (joint, torque) in PRESSED.into_iter().enumerate() {
            for torque in [-3.0 * torque, 3.0 * torque] {
                let pressed = Variation { pressed: Some((joint, torque)), ..Variation::NONE };
                let (out, untold) = beyond_limit(law, POSES[0].1, pressed);
                (beyond, wrong) = (beyond + out, wrong + untold);
            }
        }
        assert!(beyond > 500, "{name}: no joint was beyond its bound ({beyond})");
        assert_eq!(wrong, 0, "{name}, of {beyond} control periods beyond a bound");
    }
}
