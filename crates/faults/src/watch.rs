//! Watching the arm through a scenario: what it tells, and what is true in the simulated world.

use std::time::Duration;

use control::{Fault, MODEL_HASH, State, flags};
use lab::client::Incoming;
use lab::error::HostError;
use lab::simulation::CYCLE_TICKS;
use lab::transport::Transport as _;
use link::frame::Decoder;
use link::{EventKind, Goal, HostHello, LINK_VERSION, Name, Reply, Request, SCHEMA_HASH, Statistics, Telemetry, Text};
use puck::SafetyMode;
use sim::{Passage, Ticks};

use crate::bench::{Arm, Failure, plant};
use crate::entry::{Answer, From, Given, Scenario};
use crate::movement::{GOAL, movement};

/// Telemetry missing for so long makes the runner ask for the state.
const SILENT: f64 = 0.05;

/// The arm at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Time since time 0 of the scenario, s.
    pub time: f64,
    /// Virtual time.
    pub ticks: Ticks,
    /// State last told.
    pub state: State,
    /// Fault last told.
    pub fault: Fault,
    /// Joint angles and planned position of the hand, if they were told just now, rad and m.
    pub told: Option<([f64; 7], [f64; 3])>,
    /// True if the limiter cut the torque of the cycle told just now.
    pub is_limited: bool,
    /// True joint angles, rad.
    pub q: [f64; 7],
    /// True joint velocities, rad/s.
    pub dq: [f64; 7],
    /// True position of the hand, m.
    pub hand: [f64; 3],
    /// Mode of the safety module.
    pub safety: SafetyMode,
    /// True if no motor pulls or brakes.
    pub is_free: bool,
}

/// Everything seen of one scenario.
#[derive(Debug)]
pub struct Watched {
    /// Moments in order.
    pub moments: Vec<Moment>,
    /// Frames on the arm's bus.
    pub bus: Vec<Passage>,
    /// Counters before.
    pub before: Statistics,
    /// Counters afterwards.
    pub after: Statistics,
    /// Orders that were not answered as they must be.
    pub surprises: Vec<String>,
    /// Times at which a person ended a fault, s: with a clear, or by arming again after the safety module's drop.
    pub clears: Vec<f64>,
}

/// Lets the faults of a scenario befall the arm from now on, watches it, and gives the orders on the way. Time 0 is the
/// moment from which the faults count: asking for anything between the two would make every stop look sooner.
///
/// # Errors
/// The device does not answer.
pub fn watch(arm: &mut Arm, scenario: &Scenario, with_faults: bool) -> Result<Watched, Failure> {
    let before = arm.statistics()?;
    let status = arm.status()?;
    // The faults of a power-up are ordered before it, and its frames are kept: the arm's clock begins there.
    let zero = if scenario.from == From::PowerUp {
        0
    } else {
        plant(arm).take_recorded();
        if with_faults {
            plant(arm).inject(&scenario.inject);
        }
        plant(arm).now()
    };
    let mut observer = Observer {
        zero,
        state: State::from_code(status.state).ok_or("a state that is not documented")?,
        fault: Fault::from_code(status.fault).ok_or("a fault that is not documented")?,
        heard: 0.0,
        moments: Vec::new(),
    };
    let (mut surprises, mut clears) = (Vec::new(), Vec::new());
    let mut orders = scenario.order.clone();
    orders.sort_by(|a, b| b.at.total_cmp(&a.at));
    while observer.time(arm) < scenario.watch {
        let now = observer.time(arm);
        if let Some(order) = orders.pop_if(|order| order.at <= now) {
            let answer = observer.give(arm, order.give, scenario)?;
            let arms = matches!(order.give, Given::Hold | Given::Gravity) && observer.fault == Fault::SafetyDropped;
            if (order.give == Given::Clear || arms) && answer.is_ok() {
                clears.push(now);
            }
            let expected = match order.answer {
                Some(Answer::Accepted) => answer.is_ok(),
                Some(Answer::Refused) => answer.is_err(),
                None => true,
            };
            if !expected {
                let answer = answer.err().map_or("accepted".to_owned(), |refusal| refusal.to_string());
                surprises.push(format!("{:?} at {now:.2} s: {answer}", order.give));
            }
        }
        observer.look(arm)?;
    }
    let bus = plant(arm).take_recorded();
    let after = arm.statistics()?;
    Ok(Watched { moments: observer.moments, bus, before, after, surprises, clears })
}

struct Observer {
    zero: Ticks,
    state: State,
    fault: Fault,
    /// Time of the last telemetry, s.
    heard: f64,
    moments: Vec<Moment>,
}

impl Observer {
    fn time(&self, arm: &mut Arm) -> f64 {
        sim::seconds(plant(arm).now() - self.zero)
    }

    /// Lets a cycle pass, at most.
    fn look(&mut self, arm: &mut Arm) -> Result<(), Failure> {
        let told = match arm.next(cycle())? {
            Some(Incoming::Telemetry(telemetry)) => Some(telemetry),
            Some(Incoming::Event(event)) if event.kind == EventKind::State => {
                self.enter(event.code.try_into()?, event.detail.try_into()?)?;
                None
            }
            _ => None,
        };
        let now = self.time(arm);
        if told.is_none() && now - self.heard > SILENT {
            let status = arm.status()?;
            self.enter(status.state, status.fault)?;
            self.heard = now;
        }
        self.note(arm, told)
    }

    /// Gives an order; the refusal, if it is refused.
    fn give(&mut self, arm: &mut Arm, order: Given, scenario: &Scenario) -> Result<Result<(), HostError>, Failure> {
        let answer = match order {
            Given::Stop => arm.stop(),
            Given::Clear => arm.clear_fault(),
            Given::Hold => arm.hold(),
            Given::Gravity => arm.gravity(),
            Given::Release => arm.release(),
            Given::Speed(factor) => arm.set_speed(factor as f32),
            Given::Goal(shift) => {
                let (taught, _) = lab::arm::tool_pose(&GOAL);
                let position = std::array::from_fn(|axis| (taught[axis] + shift[axis]) as f32);
                arm.set_goal(Goal { position: Some(position), orientation: None })
            }
            Given::Silence(seconds) => return self.be_silent(arm, seconds).map(Ok),
            Given::Approach => arm.approach(GOAL.map(|angle| angle as f32), 0.0),
            Given::Run => arm.run(&Name::new(&movement().name)?, scenario.mode.options()),
            Given::Hand(q) => arm.move_hand(q.map(|angle| angle as f32), 0.0),
            Given::InitialiseHand => arm.initialise_hand(),
            Given::Tare => arm.request(&Request::Tare).map(|_| ()),
            Given::Upload => arm.upload(&movement().to_image()?, |_, _, _| {}).map(|_| ()),
        };
        match answer {
            Err(error) if !matches!(error, HostError::Refused { .. } | HostError::NotStopped { .. }) => {
                Err(error.into())
            }
            answer => Ok(answer),
        }
    }

    /// Says nothing for so many seconds, and goes on listening.
    fn be_silent(&mut self, arm: &mut Arm, seconds: f64) -> Result<(), Failure> {
        let end = self.time(arm) + seconds;
        let mut decoder = Decoder::<{ link::frame::FRAME_BYTES }>::new();
        while self.time(arm) < end {
            let mut bytes = Vec::new();
            arm.transport().receive(cycle(), &mut bytes)?;
            let mut rest = bytes.as_slice();
            let mut told = None;
            while let Some(frame) = decoder.next::<Reply>(&mut rest) {
                match frame.message {
                    Reply::Telemetry(telemetry) => told = Some(telemetry),
                    Reply::Event(event) if event.kind == EventKind::State => {
                        self.enter(event.code.try_into()?, event.detail.try_into()?)?;
                    }
                    _ => {}
                }
            }
            self.note(arm, told)?;
        }
        // The device may have ended the session. A host that wakes up opens it again and wants its telemetry.
        let owner = Text::new("fault catalogue");
        arm.request(&Request::Hello(HostHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: MODEL_HASH,
            owner,
        }))?;
        arm.set_telemetry(1)?;
        Ok(())
    }

    fn enter(&mut self, state: u8, fault: u8) -> Result<(), Failure> {
        self.state = State::from_code(state).ok_or("a state that is not documented")?;
        self.fault = Fault::from_code(fault).ok_or("a fault that is not documented")?;
        Ok(())
    }

    fn note(&mut self, arm: &mut Arm, told: Option<Telemetry>) -> Result<(), Failure> {
        let time = self.time(arm);
        if let Some(telemetry) = &told {
            self.enter(telemetry.state, telemetry.fault)?;
            self.heard = time;
        }
        let (state, fault) = (self.state, self.fault);
        let cuts = flags::JOINT_LIMITED | flags::MOTOR_LIMITED | flags::RATE_LIMITED;
        let is_limited = told.as_ref().is_some_and(|cycle| cycle.flags & cuts != 0);
        let told = told.map(|cycle| {
            let plan = [cycle.pose_d[0], cycle.pose_d[1], cycle.pose_d[2]];
            (cycle.q.map(f64::from), plan.map(f64::from))
        });
        let plant = plant(arm);
        let (ticks, safety, is_free) = (plant.now(), plant.safety_mode(), plant.is_free());
        let world = plant.world();
        let (q, dq, hand) = (world.joint_positions(), world.joint_velocities(), world.grasp_pose().position);
        self.moments.push(Moment { time, ticks, state, fault, told, is_limited, q, dq, hand, safety, is_free });
        Ok(())
    }
}

/// One control cycle.
fn cycle() -> Duration {
    Duration::from_secs_f64(sim::seconds(CYCLE_TICKS))
}
