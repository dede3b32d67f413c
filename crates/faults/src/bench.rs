//! A simulated arm, brought into the state in which a scenario begins.

use std::error::Error;
use std::time::Duration;

use control::State;
use lab::client::{Client, Incoming};
use lab::device::Device;
use lab::procedure::{self, EndCondition};
use lab::simulation::{Simulation, SimulationOptions};
use lab::transport::{SimulatorKind, SimulatorOptions};
use link::Name;
use sim::{OperatorConfig, Plant, PlantConfig, TICKS_PER_MILLISECOND, Ticks};

use crate::entry::{From, Scenario};
use crate::movement::{GOAL, START, movement};

/// A conversation with the simulated arm.
pub type Arm = Client<Device>;

/// A step of a scenario that could not be taken.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Time for which the operator still holds the arm after its torque has come.
const LET_GO: Ticks = 900 * TICKS_PER_MILLISECOND;

/// Longest time for a movement to begin.
const BEGIN: Duration = Duration::from_millis(200);

/// The arm of a scenario, in the state where it begins, its telemetry on. Faults of a power-up are ordered already, all
/// others are when the watch begins.
/// `kind` says what executes the co-controller's application: this process, or its image under an emulator.
///
/// # Errors
/// The arm does not get there.
pub fn arm(scenario: &Scenario, with_faults: bool, kind: SimulatorKind) -> Result<Arm, Failure> {
    let mut simulation = simulation(scenario.seed, Duration::ZERO, kind)?;
    if scenario.from == From::PowerUp && with_faults {
        simulation.plant().inject(&scenario.inject);
    }
    let mut arm = connected(simulation)?;
    if scenario.from != From::PowerUp {
        begin(&mut arm, scenario)?;
    }
    arm.set_telemetry(1)?;
    arm.take_events();
    Ok(arm)
}

/// The simulated arm at power-up; the clock of its device has run for `uptime`.
///
/// # Errors
/// The simulation does not start.
pub fn simulation(seed: u64, uptime: Duration, kind: SimulatorKind) -> Result<Simulation, Failure> {
    let simple = SimulatorOptions { seed: Some(seed), world: Some("simple".to_owned()), ..SimulatorOptions::default() };
    let mut options = SimulationOptions::from_address(kind, &simple)?;
    options.posture = START;
    options.uptime = uptime;
    options.plant = PlantConfig {
        started: true,
        operator: OperatorConfig { holds_until_active_for: Some(LET_GO), ..OperatorConfig::prompt() },
        ..PlantConfig::default()
    };
    let mut simulation = Simulation::start(&options)?;
    simulation.plant().record_bus();
    Ok(simulation)
}

/// Begins the conversation with it.
///
/// # Errors
/// It does not answer.
pub fn connected(simulation: Simulation) -> Result<Arm, Failure> {
    Ok(Client::connect(Device::Simulated(Box::new(simulation)), "fault catalogue")?)
}

/// From power-up, or from the way back of another scenario, to the first moment of the state of this one.
///
/// # Errors
/// The arm does not get there.
pub fn begin(arm: &mut Arm, scenario: &Scenario) -> Result<(), Failure> {
    arm.upload(&movement().to_image()?, |_, _, _| {})?;
    procedure::make_ready(arm, true, |_| {})?;
    procedure::go_to_start(arm, &movement().start, |_| {})?;
    procedure::pass(arm, Duration::from_millis(300), EndCondition::OnAnyStop)?;
    match scenario.from {
        From::PowerUp | From::Hold => {}
        From::Gravity => arm.gravity()?,
        From::Approach => arm.approach(GOAL.map(|angle| angle as f32), 0.0)?,
        From::Run => arm.run(&Name::new(&movement().name)?, scenario.mode.options())?,
        From::Lowering => arm.release()?,
    }
    let wanted = match scenario.from {
        From::PowerUp => State::Idle,
        From::Gravity => State::Gravity,
        From::Hold => State::Hold,
        From::Approach => State::Approach,
        From::Run => State::Run,
        From::Lowering => State::Lower,
    };
    arm.set_telemetry(1)?;
    let deadline = arm.now() + BEGIN;
    loop {
        if let Some(Incoming::Telemetry(cycle)) = arm.next(BEGIN)?
            && State::from_code(cycle.state) == Some(wanted)
        {
            break;
        }
        if arm.now() > deadline {
            return Err(format!("the arm does not come to {}", wanted.name()).into());
        }
    }
    Ok(())
}

/// The plant behind the arm.
///
/// # Panics
/// The device is not simulated, which [`arm`] never makes.
pub fn plant(arm: &mut Arm) -> &mut Plant {
    arm.transport().simulation().expect("a simulated device").plant()
}
