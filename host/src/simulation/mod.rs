//! Simulated devices: the co-controller's real application against the simulated bus and world, in virtual time.
//!
//! Two engines run the application. `InProcess` calls `device::Core` and `device::Session` directly (`sil:`); `Qemu` runs the
//! firmware image under QEMU and exchanges frames with it in lock step (`sim:`). Either way nothing moves unless the host
//! waits: virtual time advances only inside [`Transport::receive`], so a whole session is one deterministic sequence of events, whatever
//! the load of the machine.

mod error;
mod in_process;
mod options;
mod qemu;
mod seat;

pub use error::SimulationError;
pub use options::{DEFAULT_SEED, Engine, IMAGE_VARIABLE, SimulationOptions, WorldKind};

use std::time::Duration;

use sim::{Plant, PlantConfig, TICKS_PER_SECOND, Ticks, World};

use in_process::InProcess;
use qemu::Qemu;

use crate::transport::{Transport, TransportError};

/// Something that executes the co-controller's application and lets virtual time pass.
trait Execute: Send {
    /// Does the next thing that is due, at the latest at `limit`; returns the virtual time reached.
    fn advance(&mut self, plant: &mut Plant, limit: Ticks) -> Result<Ticks, SimulationError>;
}

/// A simulated device: plant, engine and the time reached.
pub struct Simulation {
    plant: Plant,
    engine: Box<dyn Execute>,
    now: Ticks,
}

impl Simulation {
    /// Builds world and plant and boots the co-controller at virtual time 0.
    ///
    /// # Errors
    /// The world or the engine named in `options` cannot be started here; the message names the command that sets it up.
    pub fn start(options: &SimulationOptions) -> Result<Self, SimulationError> {
        let world = options.build_world()?;
        let plant = Plant::new(PlantConfig { seed: options.seed, ..options.plant.clone() }, world);
        let engine: Box<dyn Execute> = match &options.engine {
            Engine::InProcess => Box::new(InProcess::new()),
            Engine::Qemu { image } => Box::new(Qemu::spawn(image, options.firmware_log.as_deref())?),
        };
        Ok(Self { plant, engine, now: 0 })
    }

    /// The simulated bus and everything on it.
    pub fn plant(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// The physical world.
    pub fn world(&mut self) -> &mut dyn World {
        self.plant.world()
    }

    /// Angle between the axis of the flashlight on the table and the vertical, rad; `None` where the world has none.
    ///
    /// What a run came to in the world itself, which no telemetry can tell: whether the flashlight was knocked over.
    pub fn flashlight_tilt(&mut self) -> Option<f64> {
        #[cfg(feature = "mujoco")]
        {
            use sim::person::GuidedWorld;
            use sim::world::mujoco::MujocoWorld;
            let world: &dyn std::any::Any = self.plant.world();
            let mujoco = world
                .downcast_ref::<MujocoWorld>()
                .or_else(|| world.downcast_ref::<GuidedWorld<MujocoWorld>>().map(GuidedWorld::world));
            mujoco.and_then(MujocoWorld::object_tilt)
        }
        #[cfg(not(feature = "mujoco"))]
        None
    }

    /// Virtual time reached.
    pub fn ticks(&self) -> Ticks {
        self.now
    }
}

impl Transport for Simulation {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.plant.link_to_device(bytes);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        let limit = self.now + (timeout.as_secs_f64() * TICKS_PER_SECOND as f64) as Ticks;
        loop {
            let bytes = self.plant.take_from_device();
            if !bytes.is_empty() {
                out.extend_from_slice(&bytes);
                return Ok(());
            }
            if self.now >= limit {
                return Ok(());
            }
            self.now = self.engine.advance(&mut self.plant, limit).map_err(TransportError::other)?;
        }
    }

    fn now(&self) -> Duration {
        Duration::from_nanos(self.now * 40)
    }

    fn is_virtual(&self) -> bool {
        true
    }
}
