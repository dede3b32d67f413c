//! Instructions of the control cycles in which something begins, ends or goes wrong: the nominal run is not the worst.

use std::collections::BTreeMap;
use std::sync::OnceLock;
use std::time::Duration;

use control::{RATE_HZ, State};
use lab::client::Incoming;
use lab::primitive_file::PrimitiveFile;
use lab::procedure;
use link::{Goal, Name, RunOptions, Telemetry};
use sim::fault::{FaultKind, Injection, Supervised};
use system_tests::execution::prepare;
use system_tests::{Arm, command, expect, ready, simulation};

/// Instructions of a control cycle at its worst: a little more than is measured (29 860, of which some 600 watch for
/// joints that swing). `cargo xtask budget` allows 30 000.
const BOUND: u32 = 29_900;

/// Instructions per tick of the image's clock under `-icount shift=3`.
const PER_TICK: u32 = 5;

/// Control cycles after an order that count as its own.
const AFTER: u32 = 5;

/// Control cycles after which the mass matrix of the observer is renewed: a run is begun at each of their phases.
const RENEWAL: u32 = 8;

/// A movement with the most kernels that a device holds, with all that its sensors are to feel and by what it is
/// watched.
fn largest() -> &'static PrimitiveFile {
    static LARGEST: OnceLock<PrimitiveFile> = OnceLock::new();
    LARGEST.get_or_init(|| {
        let folder = expect(tempfile::tempdir());
        for words in [
            "--device sil: teach -o demo.csv",
            "learn demo.csv --kernels 100 -o largest.toml",
            "--device sil: rehearse largest.toml --trials 3 --record-dir runs",
            "statistics largest.toml runs/largest-1.csv runs/largest-2.csv runs/largest-3.csv",
        ] {
            command::tactus(folder.path(), &words.split(' ').collect::<Vec<_>>()).success();
        }
        expect(PrimitiveFile::read(&folder.path().join("largest.toml")))
    })
}

/// Everything that a run can have switched on; the plan of a stiff one does not bend.
fn all_on(compliant: bool) -> RunOptions {
    RunOptions { feedback: compliant, force_control: true, compliant, ..RunOptions::default() }
}

/// Time within which a joint comes to its limit: 30 s, in control cycles.
const LONG: u32 = 30 * RATE_HZ;

/// True if the plan is held back, and J6 within 0.1 rad of its soft limit (1.52 rad).
fn at_limit(cycle: &Telemetry) -> bool {
    cycle.flags & control::flags::CLAMPED != 0 && cycle.q[5].abs() > 1.42
}

/// Costs by what happened.
struct Costs {
    arm: Arm,
    worst: BTreeMap<&'static str, u32>,
}

impl Costs {
    /// The next control cycle, whose cost counts as that of `what`.
    fn cycle(&mut self, what: &'static str) -> Telemetry {
        loop {
            if let Incoming::Telemetry(cycle) =
                expect(self.arm.next(Duration::from_secs(1))).expect("telemetry for ever")
            {
                let worst = self.worst.entry(what).or_default();
                *worst = cycle.cost_ticks.max(*worst);
                return cycle;
            }
        }
    }

    fn cycles(&mut self, what: &'static str, count: u32) {
        for _ in 0..count {
            self.cycle(what);
        }
    }

    /// Gives an order, and counts the cycles after it as its own.
    fn order(&mut self, what: &'static str, order: impl FnOnce(&mut Arm)) {
        order(&mut self.arm);
        self.cycles(what, AFTER);
    }

    /// Brings the arm to where the movement starts; it holds there.
    fn go_to_the_start(&mut self) {
        expect(procedure::travel(&mut self.arm, largest().start.posture.map(|angle| angle as f32), |_| {}));
        expect(self.arm.set_telemetry(1));
        self.cycles("approached", RATE_HZ / 10);
    }

    /// Moves by a little, from a hold that is this many cycles older than the last one.
    fn approach(&mut self, later: u32) {
        self.cycles("held", later);
        let mut target = largest().start.posture.map(|angle| angle as f32);
        target[0] += 0.05;
        self.order("an approach begins", |arm| expect(arm.approach(target, 0.0)));
        while State::from_code(self.cycle("approaching").state) == Some(State::Approach) {}
    }

    fn begin(&mut self, compliant: bool) {
        let name = expect(Name::new(&largest().name));
        let what = if compliant { "a compliant run begins" } else { "a run begins" };
        self.order(what, |arm| expect(arm.run(&name, all_on(compliant))));
        self.cycles("run", RATE_HZ / 10);
    }

    /// Goes on until the plan was held back in as many cycles as the observer has phases, J6 being at its limit.
    fn at_a_limit(&mut self) {
        for _ in 0..RENEWAL {
            let mut left = LONG;
            while !at_limit(&self.cycle("run at a limit")) {
                left -= 1;
                assert!(left > 0, "no joint comes to its limit within {LONG} cycles");
            }
        }
    }

    /// Begins runs while the pendant warns: they are held to half of the taught speed.
    fn begin_warned(&mut self) {
        let warning = FaultKind::Warning(Supervised::Voltage);
        let warning = Injection { at: 0.0, lasts: f64::INFINITY, every: 0.0, times: 1, what: warning };
        simulation(self.arm.transport()).plant().inject(&[warning]);
        self.cycles("warned", 2 * RATE_HZ);
        for phase in 0..RENEWAL {
            for compliant in [true, false] {
                self.cycles("held", phase);
                self.begin(compliant);
                assert!(self.cycle("run").flags & control::flags::SLOWED != 0, "the pendant warns");
                self.order("run held", |arm| expect(arm.hold()));
                self.go_to_the_start();
            }
        }
    }

    fn state(&mut self) -> Option<State> {
        State::from_code(self.cycle("state").state)
    }

    /// Waits until the arm stands still, and clears the fault that stopped it, if one did.
    fn clear(&mut self) {
        self.cycles("stopped", RATE_HZ);
        self.order("cleared", |arm| expect(arm.clear_fault()));
        self.order("held", |arm| expect(arm.hold()));
    }
}

/// The change that makes it fail: `Mass::postpone` does nothing, so that a run may begin in the cycle in
/// which the mass matrix is renewed.
#[test]
fn no_order_and_no_stop_makes_a_control_cycle_longer_than_29_900_instructions() {
    let mut costs = Costs { arm: ready("sim:seed=51"), worst: BTreeMap::new() };
    prepare(&mut costs.arm, largest());
    costs.go_to_the_start();
    let goal = |lift: f32| {
        let [x, y, z] = largest().goal.position.map(|value| value as f32);
        Goal { position: Some([x, y, z + lift]), orientation: None }
    };
    for phase in 0..RENEWAL {
        for compliant in [true, false] {
            costs.cycles("held", phase);
            costs.begin(compliant);
            costs.order("goal moved", |arm| expect(arm.set_goal(goal(0.01))));
            costs.order("speed changed", |arm| expect(arm.set_speed(0.8)));
            costs.order("run held", |arm| expect(arm.hold()));
            costs.approach(phase);
            costs.go_to_the_start();
        }
    }
    for phase in 0..RENEWAL {
        costs.begin(true);
        costs.cycles("run", phase);
        simulation(costs.arm.transport()).world().push([0.0, 80.0, 0.0], [0.0; 3]);
        while State::from_code(costs.cycle("pushed").state) == Some(State::Run) {}
        costs.cycles("pushed", AFTER);
        simulation(costs.arm.transport()).world().push([0.0; 3], [0.0; 3]);
        assert_eq!(costs.state(), Some(State::SoftStop), "a push of 80 N stops a run");
        costs.clear();
        costs.go_to_the_start();
    }
    for compliant in [true, false] {
        costs.begin(compliant);
        // Up and aside, where J6 comes to its limit on the way.
        let aside = |y: f32| Goal { position: Some([0.3, y, 0.3]), orientation: None };
        costs.order("goal moved", |arm| expect(arm.set_goal(aside(0.6))));
        for phase in 0..RENEWAL {
            costs.at_a_limit();
            costs.cycles("run at a limit", phase);
            costs.order("goal moved at a limit", |arm| expect(arm.set_goal(aside(0.59 + 0.01 * (phase % 2) as f32))));
            costs.order("speed changed at a limit", |arm| expect(arm.set_speed(0.9 + 0.01 * phase as f32)));
        }
        costs.order("run held", |arm| expect(arm.hold()));
        costs.go_to_the_start();
    }
    for compliant in [true, false] {
        costs.begin(compliant);
        while State::from_code(costs.cycle("run to its end").state) == Some(State::Run) {}
        costs.go_to_the_start();
    }
    costs.begin_warned();
    costs.begin(true);
    costs.order("run stopped", |arm| expect(arm.stop()));
    costs.cycles("stopped", RATE_HZ);
    costs.order("held", |arm| expect(arm.hold()));
    costs.order("led", |arm| expect(arm.gravity()));
    costs.order("held", |arm| expect(arm.hold()));
    costs.order("released", |arm| expect(arm.release()));
    costs.cycles("lowered", RATE_HZ);
    for (what, ticks) in &costs.worst {
        println!("{:>8} instructions  {what}", ticks * PER_TICK);
    }
    let statistics = expect(costs.arm.statistics());
    println!("{:>8} instructions  since the start", statistics.cost_worst_ticks * PER_TICK);
    assert_eq!(statistics.missed_deadlines, 0);
    assert!(costs.worst.values().all(|ticks| *ticks > 1000 / PER_TICK), "a cycle was not measured: {:?}", costs.worst);
    assert!(statistics.cost_worst_ticks * PER_TICK <= BOUND, "{} instructions", statistics.cost_worst_ticks * PER_TICK);
}
