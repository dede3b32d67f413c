//! The simulated device of one trial: an arm that was started before, the object in its cell, and what differs from
//! the model.

use sim::world::mujoco::{Imperfections, Scene};
use sim::{ForceTorqueConfig, OperatorConfig, PlantConfig, TICKS_PER_MILLISECOND, Ticks};

use super::observed::ObservedWorld;
use super::scenario::PlantKind;
use super::seed;
use super::variation::Variation;
use lab::simulation::{CYCLE_TICKS, Engine, SimulationOptions, WorldKind};

/// Error of the force sensor of the perturbed plant, N; a variation of the bias takes its place.
const PERTURBED_BIAS: f64 = 0.1;
/// Time in which that error comes up, from the start of the run on. A constant one would be tared away when the run
/// starts, and would show nothing: what a run suffers from is what comes after, when the sensor warms or creeps.
pub const BIAS_OVER: Ticks = 2_000 * TICKS_PER_MILLISECOND;
/// Half-width of its hysteresis, N and N m.
const PERTURBED_HYSTERESIS: [f64; 2] = [0.05, 0.0015];

/// Time for which the operator holds the arm after its torque has come: the host, which uploads first, needs half a
/// second to see it and to make it hold itself, and an arm that nobody holds falls.
const LET_GO: Ticks = 900 * TICKS_PER_MILLISECOND;

/// Choice of the arm.
#[derive(Debug, Clone)]
pub struct Arm {
    /// The engine that executes the co-controller's application.
    pub engine: Engine,
    /// The difference between plant and model.
    pub kind: PlantKind,
    /// Factors that differ from that plant.
    pub variation: Variation,
    /// Seed that draws the arm: the same seed, the same arm.
    pub seed: u64,
}

/// The options of a simulated device: `noise_seed` is that of all noise, `posture` where the arm stands (rad).
pub fn options(arm: &Arm, noise_seed: u64, posture: [f64; 7], scene: Scene) -> SimulationOptions {
    let variation = &arm.variation;
    let drawn = match arm.kind {
        PlantKind::Perturbed => Imperfections::drawn(arm.seed),
        PlantKind::Ideal => Imperfections::NONE,
    };
    let perturbed = f64::from(u8::from(arm.kind == PlantKind::Perturbed));
    let mut options = SimulationOptions::new(arm.engine.clone(), noise_seed, WorldKind::Mujoco);
    options.posture = posture;
    options.scene = scene;
    options.imperfections = Imperfections {
        links: drawn.links.map(|factor| factor * variation.link_mass),
        friction: drawn.friction.map(|factor| factor * variation.joint_friction),
        ..drawn
    };
    options.plant = PlantConfig {
        started: true,
        operator: OperatorConfig { holds_until_active_for: Some(LET_GO), ..OperatorConfig::prompt() },
        torque_delay: Ticks::from(variation.delay) * CYCLE_TICKS,
        force_torque: ForceTorqueConfig {
            noise_scale: variation.noise,
            force_hysteresis: perturbed * PERTURBED_HYSTERESIS[0],
            torque_hysteresis: perturbed * PERTURBED_HYSTERESIS[1],
            ..ForceTorqueConfig::default()
        },
        ..PlantConfig::default()
    };
    options.wrap_world = Some(ObservedWorld::wrap_world);
    options
}

/// The error that the force sensor comes to in a run, N and N m, sensor axes.
pub fn bias(arm: &Arm) -> [f64; 6] {
    let usual = if arm.kind == PlantKind::Perturbed { PERTURBED_BIAS } else { 0.0 };
    let size = arm.variation.bias.unwrap_or(usual);
    let [x, y, z] = seed::direction(arm.seed).map(|part| size * part);
    [x, y, z, 0.0, 0.0, 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn varied(kind: PlantKind, variation: &str, seed: u64) -> Arm {
        Arm { engine: Engine::InProcess, kind, variation: variation.parse().unwrap(), seed }
    }

    fn arm(kind: PlantKind, variation: &str, seed: u64) -> SimulationOptions {
        options(&varied(kind, variation, seed), 9, sim::HOME, Scene::EMPTY)
    }

    fn bias_of(kind: PlantKind, variation: &str) -> f64 {
        bias(&varied(kind, variation, 3)).iter().map(|part| part * part).sum::<f64>().sqrt()
    }

    #[test]
    fn an_ideal_arm_is_the_model_itself() {
        let options = arm(PlantKind::Ideal, "", 3);
        assert_eq!(options.imperfections, Imperfections::NONE);
        assert_eq!(options.plant.force_torque, ForceTorqueConfig::default());
        assert_eq!(bias_of(PlantKind::Ideal, ""), 0.0);
    }

    #[test]
    fn a_perturbed_arm_has_the_errors_that_are_promised_and_a_seed_is_an_arm() {
        let options = arm(PlantKind::Perturbed, "", 3);
        let sensor = options.plant.force_torque;
        assert!((bias_of(PlantKind::Perturbed, "") - PERTURBED_BIAS).abs() < 1e-12 && sensor.force_hysteresis > 0.0);
        assert!(options.imperfections.cables.is_some());
        assert_eq!(options.imperfections, arm(PlantKind::Perturbed, "", 3).imperfections);
        assert_ne!(options.imperfections, arm(PlantKind::Perturbed, "", 4).imperfections);
    }

    #[test]
    fn a_variation_changes_what_it_names() {
        let usual = arm(PlantKind::Perturbed, "", 1);
        let varied = arm(PlantKind::Perturbed, "joint-friction=1.3,noise=3,delay=1,bias=0.2", 1);
        let ratio = varied.imperfections.friction[2] / usual.imperfections.friction[2];
        assert!((ratio - 1.3).abs() < 1e-12 && varied.imperfections.links == usual.imperfections.links);
        assert_eq!((varied.plant.torque_delay, varied.plant.force_torque.noise_scale), (CYCLE_TICKS, 3.0));
        assert!((bias_of(PlantKind::Perturbed, "bias=0.2") - 0.2).abs() < 1e-12);
        assert_eq!(bias_of(PlantKind::Perturbed, "bias=0"), 0.0, "none is less than the usual one");
    }
}
