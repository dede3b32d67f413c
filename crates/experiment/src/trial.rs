//! One trial: an arm at the start of the primitive, an object in a cell; play, lift, hold, judge.

use std::time::{Duration, Instant};

use control::law::gains::HAND_RADIUS;
use control::time::periods;
use lab::simulation::{CYCLE_TICKS, SLOT_TICKS};
use link::EventKind;
use sim::world::mujoco::Scene;
use sim::{TICKS_PER_MILLISECOND, Ticks};

use super::config::Config;
use super::grid::ApproachFrame;
use super::inverse;
use super::observation::{Milestones, Observation};
use super::observed::{ObservedWorld, Snapshot};
use super::outcome::{self, ArmConduct};
use super::plant::{self, Arm};
use super::results::{Key, PlanarPath, Report, Surprise};
use super::shaking::Shaking;
use super::trace::{Cycle, Trace};
use lab::client::{Client, Incoming, Interrupt};
use lab::device::Device;
use lab::error::HostError;
use lab::primitive_file::PrimitiveFileError;
use lab::procedure::{self, CHANNELS, ProcedureError, RunRequest};
use lab::simulation::{Simulation, SimulationError};

/// Height by which the arm lifts, m.
const LIFT: f64 = 0.10;
/// Duration of the lift, s.
const LIFT_SECONDS: f64 = 2.0;
/// A hand that is farther than this below the top of its lift is lifted by what is missing, m.
const LIFT_TOLERANCE: f64 = 0.005;
/// Most repetitions.
const CORRECTIONS: usize = 2;
/// Duration of such a correction, s.
const CORRECTION_SECONDS: f64 = 0.7;
/// Longest time to settle after a part of the lift, s.
const SETTLING_SECONDS: f64 = 2.0;
/// Time for which it then holds, s.
const HOLD_SECONDS: f64 = 2.0;
/// Time over which the height of a lifted hand is averaged, s.
const SETTLED_SECONDS: f64 = 1.0;
/// Rest between the end of the movement and the lift, s.
const REST_SECONDS: f64 = 0.3;
/// The plan of a movement that lifts by itself has begun to lift when it is this far above where the fingers close, m.
const RISEN: f64 = 0.005;
/// Times that a move is asked for, a rest apart, while the arm still swings.
const CALMING: usize = 10;
/// Requests that move the arm are sent at multiples of this many control cycles, 0.1 s.
const BEAT: Ticks = periods(0.1) as Ticks * CYCLE_TICKS;
/// An upload is followed by a longer one, 0.5 s: it takes 0.35 s, and on a board, which has to check it, 0.05 s more.
const BEAT_OF_UPLOAD: Ticks = periods(0.5) as Ticks * CYCLE_TICKS;
/// Time from the beginning of a cycle to the request, ticks. The request reaches the device before the next cycle
/// begins, even if the engine overruns this by a slot.
const AFTER_BEAT: Ticks = TICKS_PER_MILLISECOND / 2;
/// One tick, ns.
const NANOSECONDS_PER_TICK: u128 = 40;
/// Cycles between two points of a path: 0.1 s.
const PATH_EVERY: usize = 30;

/// Why a trial could not be carried through. What the arm does wrong is an outcome, not an error.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The simulation cannot be started.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The conversation with the device failed, or the device refused something.
    #[error(transparent)]
    Procedure(#[from] ProcedureError),
    /// The primitive cannot be played.
    #[error(transparent)]
    Primitive(#[from] PrimitiveFileError),
    /// The primitive ends without a direction of approach, or cannot be rolled out.
    #[error("the primitive cannot be tried: {0}")]
    Movement(&'static str),
}

impl From<HostError> for TrialError {
    fn from(error: HostError) -> Self {
        Self::Procedure(error.into())
    }
}

/// A trial with everything that was seen of it.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The report.
    pub report: Report,
    /// The device's telemetry.
    pub trace: Trace,
    /// Telemetry of run and lift as it came.
    pub telemetry: Vec<link::Telemetry>,
    /// The observation of the world.
    pub observation: Observation,
    /// Configurations for pictures.
    pub snapshots: Vec<Snapshot>,
    /// Table and object.
    pub scene: Scene,
    /// When its parts began.
    pub marks: Milestones,
}

/// The plan without feedback at the control rate: positions and orientations.
pub type Taught = Vec<([f64; 3], [f64; 4])>;

/// The data that all trials of an experiment share.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The image that is uploaded.
    pub image: Vec<u8>,
    /// Name of the primitive on the device.
    pub name: link::Name,
    /// Frame of the approach.
    pub frame: ApproachFrame,
    /// The plan without feedback.
    pub taught: Taught,
}

impl Prepared {
    /// Makes image and plan of the primitive.
    ///
    /// # Errors
    /// The primitive cannot be played.
    pub fn of(config: &Config) -> Result<Prepared, TrialError> {
        let primitive = config.primitive.to_primitive()?;
        let references = lab::plan::roll_out(&primitive).map_err(|_| TrialError::Movement("it has no valid start"))?;
        let taught = references
            .iter()
            .map(|reference| (reference.poses[0].position.x, lab::plan::orientation(reference)))
            .collect();
        Ok(Prepared {
            image: config.primitive.to_image()?,
            name: link::Name::new(&config.primitive.name)
                .map_err(|_| TrialError::Movement("its name is none that a device takes"))?,
            frame: config.frame().ok_or(TrialError::Movement("it arrives from nowhere"))?,
            taught,
        })
    }
}

/// Carries a trial through.
///
/// # Errors
/// [`TrialError`]: the device cannot be had, or refuses. An arm that stops by itself is no error but an outcome.
pub fn run(config: &Config, prepared: &Prepared, key: Key, interrupt: &Interrupt) -> Result<Trial, TrialError> {
    let started = Instant::now();
    let object = config.object_at(&prepared.frame, key.cell);
    let scene = Scene::with(object);
    let arm = Arm {
        engine: config.engine.clone(),
        kind: config.plant,
        variation: config.variation,
        // A seed of the experiment is an arm; cells differ in object and noise only.
        seed: key.seed,
    };
    let options = plant::options(&arm, config.trial_seed(&key), config.primitive.start.posture, scene);
    let mut client = connect(&options, interrupt)?;
    furnish(&mut client, config, prepared, key)?;
    let ready = wait_for_beat(&mut client, BEAT_OF_UPLOAD)
        .and_then(|()| procedure::make_ready(&mut client, true, |_| {}))
        .and_then(|_| procedure::go_to_start(&mut client, &config.primitive.start, |_| {}))
        .and_then(|()| wait_for_beat(&mut client, BEAT));
    let mut telemetry = Vec::new();
    if let Some(simulation) = client.transport().simulation() {
        simulation.plant().creep_force_torque(plant::bias(&arm), plant::BIAS_OVER);
    }
    let begin = client.now().as_secs_f64();
    let mut attempt = Attempt { client: &mut client, telemetry: &mut telemetry };
    let played = ready.and_then(|()| attempt.play(config, prepared, key));
    let arrived = attempt.client.now().as_secs_f64();
    // What the arm did wrong has become an outcome; everything else ends the experiment.
    let (mut fault, surprises, first_cycle) = match played {
        Ok(outcome) => (None, outcome.surprises, outcome.first_cycle),
        Err(error) => (Some(fault(error)?), Vec::new(), telemetry.first().map_or(0, |cycle| cycle.cycle)),
    };
    let mut hold = arrived;
    if fault.is_none() {
        let on_time = wait_for_beat(&mut client, BEAT);
        let mut attempt = Attempt { client: &mut client, telemetry: &mut telemetry };
        let lifted = on_time.and_then(|()| if config.scenario.lifts_itself() { Ok(()) } else { attempt.lift() });
        hold = attempt.client.now().as_secs_f64();
        if let Err(error) = lifted.and_then(|()| attempt.watch(HOLD_SECONDS)) {
            fault = Some(self::fault(error)?);
        }
    }
    let end = client.now().as_secs_f64();
    let trace = Trace { cycles: telemetry.iter().map(|cycle| Cycle::of(cycle, first_cycle)).collect() };
    // The first cycle of the run comes some milliseconds after it was asked for: one sample of the observer at most.
    let run = begin;
    let lift = if config.scenario.lifts_itself() { run + rise(&trace, arrived - run) } else { arrived };
    let marks = Milestones { run, lift, hold };
    let (observation, snapshots) = take_observation(&mut client);
    let conduct = ArmConduct { fault: fault.as_deref(), shaking: Shaking::of(&telemetry) };
    let (outcome, mut measures) = outcome::judge(&observation, &marks, config.rule(), conduct);
    (measures.finger_asked_n, measures.chatter_n) = (asked(config), trace.chatter(measures.closed(), measures.lift_s));
    let movement = (config.primitive.movement.duration / config.variation.speed).min(measures.lift_s);
    let (adaptation_m, adaptation_deg) = trace.adaptation(&prepared.taught, config.variation.speed, movement);
    let report = Report {
        key,
        trial_seed: config.trial_seed(&key),
        object: object.position,
        outcome,
        measures,
        adaptation_m,
        adaptation_deg,
        // A movement that lifts by itself is measured against its own plan: behind it the arm holds whatever it has
        // reached.
        sag_m: match (&fault, config.scenario.lifts_itself()) {
            (Some(_), _) => None,
            (None, true) => trace.lifted_sag(),
            (None, false) => trace.sag(end - run - SETTLED_SECONDS, end - run),
        },
        free_sag_m: trace.free_sag(measures.free_until()),
        surprise: surprises.first().map(|surprise| Surprise {
            phase: surprise.phase,
            channel: CHANNELS.iter().position(|name| *name == surprise.channel).map_or(u8::MAX, |index| index as u8),
            time_s: surprise.time_s,
        }),
        path: path(&trace, measures.lift_s),
        virtual_s: end,
        wall_s: Some(started.elapsed().as_secs_f64()),
    };
    Ok(Trial { report, trace, telemetry, observation, snapshots, scene, marks })
}

/// Gives the device the weight of its arm, if that was measured, and the primitive.
fn furnish(client: &mut Client<Device>, config: &Config, prepared: &Prepared, key: Key) -> Result<(), HostError> {
    config.weights.get(&key.seed).map_or(Ok(()), |weight| client.keep_weight(weight))?;
    client.upload(&prepared.image, |_, _, _| {}).map(|_| ())
}

/// Starts a simulated device and says hello.
///
/// # Errors
/// The simulation cannot be started, or the user has interrupted: whoever does that waits for none that is not begun.
pub(super) fn connect(
    options: &lab::simulation::SimulationOptions,
    interrupt: &Interrupt,
) -> Result<Client<Device>, TrialError> {
    if interrupt.is_raised() {
        return Err(HostError::Interrupted.into());
    }
    let device = Device::Simulated(Box::new(Simulation::start(options)?));
    let mut client = Client::connect(device, "tactus")?;
    client.set_interrupt(interrupt.clone());
    Ok(client)
}

/// Lets time pass until the next multiple of `beat`. Checking an upload takes a device its time, one in this process
/// none; from here on both are at the same cycle, and what is asked for comes in the same one.
fn wait_for_beat(client: &mut Client<Device>, beat: Ticks) -> Result<(), ProcedureError> {
    let now = (client.now().as_nanos() / NANOSECONDS_PER_TICK) as Ticks;
    // The first slot of a cycle is the tenth since power-up, and every third from there.
    let phase = SLOT_TICKS + AFTER_BEAT;
    let next = (now.saturating_sub(phase) / beat + 1) * beat + phase;
    let until = Duration::from_nanos(next * NANOSECONDS_PER_TICK as u64);
    procedure::pass(client, until.saturating_sub(client.now()), procedure::EndCondition::OnAnyStop)
}

/// The name of what stopped the arm, or the error that is none of the arm's.
fn fault(error: ProcedureError) -> Result<String, TrialError> {
    match error {
        ProcedureError::Stopped(fault) => Ok(fault.to_string()),
        ProcedureError::Diverted(state) => Ok(format!("went to {state}")),
        ProcedureError::TooLong { .. } => Ok("did not arrive".to_owned()),
        other => Err(other.into()),
    }
}

/// An arm at work, with everything it tells.
struct Attempt<'a> {
    client: &'a mut Client<Device>,
    telemetry: &'a mut Vec<link::Telemetry>,
}

impl Attempt<'_> {
    fn play(
        &mut self,
        config: &Config,
        prepared: &Prepared,
        key: Key,
    ) -> Result<procedure::RunOutcome, ProcedureError> {
        let options = link::RunOptions { speed: config.variation.speed as f32, ..key.mode.options() };
        let mut request = RunRequest::new(prepared.name.clone(), config.primitive.movement.duration, options);
        request.rest = REST_SECONDS;
        let telemetry = &mut *self.telemetry;
        procedure::play(self.client, &request, &mut |cycle| telemetry.push(*cycle))
    }

    /// Straight up from where the hand is. A load that the controller does not know of pulls the arm below its
    /// reference; what is missing then is lifted as well, in every mode alike, so that an object is judged by the
    /// grasp and not by the arm's stiffness.
    fn lift(&mut self) -> Result<(), ProcedureError> {
        let ([x, y, z], orientation) = lab::arm::tool_pose(&self.posture()?);
        let top = z + LIFT;
        let mut aim = top;
        let mut seconds = LIFT_SECONDS;
        for _ in 0..=CORRECTIONS {
            let q = self.posture()?;
            // What cannot be reached is not lifted to, and judged.
            let Some(target) = inverse::reach([x, y, aim], orientation, q) else { break };
            self.client.take_events();
            if !self.approach(target.map(|angle| angle as f32), seconds as f32)? {
                break;
            }
            // An arm that does not settle, under a load or against something, takes no further command.
            if !self.arrive(seconds + SETTLING_SECONDS)? {
                break;
            }
            let ([_, _, reached], _) = lab::arm::tool_pose(&self.posture()?);
            if top - reached < LIFT_TOLERANCE {
                break;
            }
            aim += (top - reached).min(LIFT_TOLERANCE * 10.0);
            seconds = CORRECTION_SECONDS;
        }
        Ok(())
    }

    /// Asks for the move until the arm is calm enough to take it; `false` if it never is.
    fn approach(&mut self, target: [f32; 7], seconds: f32) -> Result<bool, ProcedureError> {
        for _ in 0..CALMING {
            match self.client.approach(target, seconds) {
                Ok(()) => return Ok(true),
                Err(HostError::Refused { reason: link::Refusal::Moving, .. }) => self.watch(REST_SECONDS)?,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(false)
    }

    fn posture(&mut self) -> Result<[f64; 7], ProcedureError> {
        Ok(self.client.status()?.q.map(f64::from))
    }

    /// Listens until the arm has arrived; `false` if it has not after so many seconds. It must not stop meanwhile.
    fn arrive(&mut self, seconds: f64) -> Result<bool, ProcedureError> {
        self.listen(seconds, true)
    }

    /// Listens for a time; the arm must not stop meanwhile.
    fn watch(&mut self, seconds: f64) -> Result<(), ProcedureError> {
        self.listen(seconds, false).map(|_| ())
    }

    fn listen(&mut self, seconds: f64, until_arrived: bool) -> Result<bool, ProcedureError> {
        self.client.set_telemetry(1)?;
        let until = self.client.now() + Duration::from_secs_f64(seconds);
        let mut arrived = false;
        while self.client.now() < until && !(arrived && until_arrived) {
            match self.client.next(until.saturating_sub(self.client.now()))? {
                Some(Incoming::Telemetry(cycle)) => self.telemetry.push(cycle),
                Some(Incoming::Event(event)) => match event.kind {
                    EventKind::Arrived => arrived = true,
                    EventKind::State => procedure::after(event.code, event.detail)?,
                    _ => {}
                },
                None => {}
            }
        }
        self.client.set_telemetry(0)?;
        Ok(arrived)
    }
}

/// Force that the primitive asks of a finger at the end of its movement, the largest of the three, N.
fn asked(config: &Config) -> f64 {
    let last = config.primitive.expectation.as_ref().and_then(|expectation| expectation.mean.last());
    let gauges = last.and_then(|sensors| sensors.get(6..)).unwrap_or(&[0.0]);
    gauges.iter().map(|gauge| control::law::hand::asked(*gauge)).fold(0.0, f64::max) / HAND_RADIUS
}

/// Time at which the plan of a movement that lifts by itself begins to rise from its lowest point, s after its start.
fn rise(trace: &Trace, end: f64) -> f64 {
    let last = trace.cycles.iter().rposition(|cycle| cycle.time <= end).unwrap_or(0);
    let cycles = trace.cycles.get(..last).unwrap_or(&[]);
    // Backwards from the top: the last time the plan was as low as where the fingers closed.
    let lowest = cycles.iter().skip(cycles.len() / 2).map(|cycle| cycle.position_d[2]).fold(f64::INFINITY, f64::min);
    let low = cycles.iter().rposition(|cycle| cycle.position_d[2] < lowest + RISEN);
    low.and_then(|index| cycles.get(index)).map_or(end, |cycle| cycle.time)
}

fn path(trace: &Trace, end: f64) -> PlanarPath {
    let cycles = || trace.cycles.iter().filter(|cycle| (0.0..=end).contains(&cycle.time)).step_by(PATH_EVERY);
    // A tenth of a millimetre is more than a picture shows.
    let point = |[x, y, _]: [f64; 3]| [x, y].map(|value: f64| (value * 1e4).round() / 1e4);
    PlanarPath {
        measured: cycles().map(|cycle| point(cycle.position)).collect(),
        planned: cycles().map(|cycle| point(cycle.position_d)).collect(),
    }
}

fn take_observation(client: &mut Client<Device>) -> (Observation, Vec<Snapshot>) {
    let Some(simulation) = client.transport().simulation() else {
        return Default::default();
    };
    let world: &mut dyn std::any::Any = simulation.world();
    world.downcast_mut::<ObservedWorld>().map(ObservedWorld::take).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use lab::simulation::{Engine, FlashSource, SimulationOptions, WorldKind};

    use super::*;

    /// The change that makes it fail: an interrupt is looked at once the simulation has been started.
    #[test]
    fn nothing_is_started_for_a_user_who_has_interrupted() {
        let mut options = SimulationOptions::new(Engine::InProcess, 1, WorldKind::Simple);
        // A folder is no flash: this simulation cannot be started.
        options.flash = FlashSource::File(std::env::temp_dir());
        let interrupt = Interrupt::never();
        assert!(matches!(connect(&options, &interrupt), Err(TrialError::Simulation(_))));
        interrupt.raise();
        let Err(TrialError::Procedure(ended)) = connect(&options, &interrupt) else { panic!("it was started") };
        assert!(matches!(ended, ProcedureError::Host(HostError::Interrupted)), "{ended}");
    }
}
