//! The simulated device of one trial: an arm that was started before, the object in its cell, and what differs from the model.

use sim::world::mujoco::{Imperfections, Scene};
use sim::{ForceTorqueConfig, OperatorConfig, PlantConfig, TICKS_PER_MILLISECOND, Ticks};

use super::observed::ObservedWorld;
use super::scenario::PlantKind;
use super::seed;
use super::variation::Variation;
use crate::simulation::{Engine, SimulationOptions, WorldKind};

/// Constant error of the force sensor of the honest plant, N; a variation of the bias takes its place.
const HONEST_BIAS: f64 = 0.1;
/// Half-width of its hysteresis, N and N m.
const HONEST_HYSTERESIS: [f64; 2] = [0.05, 0.0015];

/// How long after its torque has come the operator still holds the arm: the host needs some tenths of a second to see it and to make it
/// hold itself, and an arm that nobody holds falls.
const LET_GO: Ticks = 500 * TICKS_PER_MILLISECOND;

/// Which arm.
#[derive(Debug, Clone)]
pub struct Arm {
    /// What executes the co-controller's application.
    pub engine: Engine,
    /// How well the model fits.
    pub kind: PlantKind,
    /// What differs from that plant.
    pub variation: Variation,
    /// Seed that draws the arm: the same seed, the same arm.
    pub seed: u64,
}

/// The options of a simulated device: `noise_seed` is that of all noise, `posture` where the arm stands (rad).
pub fn options(arm: &Arm, noise_seed: u64, posture: [f64; 7], scene: Scene) -> SimulationOptions {
    let variation = &arm.variation;
    let drawn = match arm.kind {
        PlantKind::Honest => Imperfections::drawn(arm.seed),
        PlantKind::Ideal => Imperfections::NONE,
    };
    let honest = f64::from(u8::from(arm.kind == PlantKind::Honest));
    let bias = if variation.bias > 0.0 { variation.bias } else { honest * HONEST_BIAS };
    let [x, y, z] = seed::direction(arm.seed).map(|part| bias * part);
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
        torque_delay_cycles: variation.delay,
        force_torque: ForceTorqueConfig {
            bias: [x, y, z, 0.0, 0.0, 0.0],
            noise_scale: variation.noise,
            force_hysteresis: honest * HONEST_HYSTERESIS[0],
            torque_hysteresis: honest * HONEST_HYSTERESIS[1],
            ..ForceTorqueConfig::default()
        },
        ..PlantConfig::default()
    };
    options.dress = Some(ObservedWorld::dress);
    options
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm(kind: PlantKind, variation: &str, seed: u64) -> SimulationOptions {
        let arm = Arm { engine: Engine::InProcess, kind, variation: variation.parse().unwrap(), seed };
        options(&arm, 9, sim::HOME, Scene::EMPTY)
    }

    #[test]
    fn an_ideal_arm_is_the_model_itself() {
        let options = arm(PlantKind::Ideal, "", 3);
        assert_eq!(options.imperfections, Imperfections::NONE);
        assert_eq!(options.plant.force_torque, ForceTorqueConfig::default());
    }

    #[test]
    fn an_honest_arm_has_the_errors_that_are_promised_and_a_seed_is_an_arm() {
        let options = arm(PlantKind::Honest, "", 3);
        let sensor = options.plant.force_torque;
        let bias = sensor.bias.iter().map(|part| part * part).sum::<f64>().sqrt();
        assert!((bias - HONEST_BIAS).abs() < 1e-12 && sensor.force_hysteresis > 0.0);
        assert!(options.imperfections.cables.is_some());
        assert_eq!(options.imperfections, arm(PlantKind::Honest, "", 3).imperfections);
        assert_ne!(options.imperfections, arm(PlantKind::Honest, "", 4).imperfections);
    }

    #[test]
    fn a_variation_changes_what_it_names() {
        let usual = arm(PlantKind::Honest, "", 1);
        let varied = arm(PlantKind::Honest, "joint-friction=1.3,noise=3,delay=1,bias=0.2", 1);
        let ratio = varied.imperfections.friction[2] / usual.imperfections.friction[2];
        assert!((ratio - 1.3).abs() < 1e-12 && varied.imperfections.links == usual.imperfections.links);
        assert_eq!((varied.plant.torque_delay_cycles, varied.plant.force_torque.noise_scale), (1, 3.0));
        let bias = varied.plant.force_torque.bias.iter().map(|part| part * part).sum::<f64>().sqrt();
        assert!((bias - 0.2).abs() < 1e-12);
    }
}
