//! Simulated devices: the co-controller's real application against the simulated bus and world, in virtual time.
//!
//! Three engines run the application. `InProcess` calls `device::DeviceController` and `device::Session` directly
//! (`sil:`); `Qemu` runs the firmware image under QEMU and exchanges frames with it in lock step (`sim:`);
//! `EmulatedBoard` does so with the image for the real board on an emulated STM32H743 (`board:`). With both nothing
//! moves unless the host waits: virtual time advances only inside [`Transport::receive`], so a whole session is one
//! deterministic sequence of events, whatever the load of the machine.

mod absent;
mod board;
mod board_can;
mod bus_log;
mod error;
mod fault_script;
mod in_process;
mod options;
mod processor;
mod qemu;
pub(crate) mod queues;
mod simulated_can;
mod words;

pub use board_can::BoardCan;
pub use error::SimulationError;
pub use options::{
    BOARD_EMULATOR_VARIABLE, BOARD_IMAGE_VARIABLE, BoardEngine, DEFAULT_SEED, Engine, FlashSource, GRIPPED,
    HAND_IMAGE_VARIABLE, IMAGE_VARIABLE, SimulationOptions, WorldKind, built_image,
};
pub use queues::{CYCLE_TICKS, SLOT_TICKS};
pub use simulated_can::{HostBus, SimulatedCan};

use std::time::Duration;

use sim::{Passage, Plant, PlantConfig, TICKS_PER_SECOND, Ticks, World};

use absent::Absent;
use board::EmulatedBoard;
use bus_log::BusLog;
use fault_script::FaultScript;
use in_process::InProcess;
use qemu::Qemu;

use crate::output_file;
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
    log: Option<BusLog>,
    /// Frames of the arm's bus for [`Simulation::take_traffic`]; `None`: nobody wants them.
    traffic: Option<Vec<Passage>>,
}

impl Simulation {
    /// Builds world and plant and boots the co-controller at virtual time 0.
    ///
    /// # Errors
    /// The world or the engine named in `options` cannot be started here; the message names the command that sets it
    /// up.
    pub fn start(options: &SimulationOptions) -> Result<Self, SimulationError> {
        if let Some(report) = &options.board_report {
            output_file::refuse(report, options.replace_logs, &options.inputs())
                .map_err(SimulationError::BoardReport)?;
        }
        let world = options.build_world()?;
        let mut plant = Plant::new(PlantConfig { seed: options.seed, ..options.plant.clone() }, world);
        if let Some(name) = &options.faults {
            FaultScript::read(name, matches!(options.engine, Engine::InProcess))?.order(&mut plant);
        }
        if options.bus_log.is_some() {
            plant.record_heard();
        }
        let engine: Box<dyn Execute> = match &options.engine {
            Engine::InProcess => Box::new(InProcess::new(options.flash.chip()?, options.uptime)),
            Engine::Qemu { image } => {
                let log = options.firmware_log.as_deref();
                Box::new(Qemu::spawn(qemu::ARM_MACHINE, image, log, options.flash.chip()?)?)
            }
            Engine::Hand { image } => {
                let log = options.firmware_log.as_deref();
                Box::new(Qemu::spawn(qemu::HAND_MACHINE, image, log, options.flash.chip()?)?)
            }
            Engine::Board(engine) => Box::new(EmulatedBoard::spawn(engine, options, &mut plant)?),
            Engine::Absent => Box::new(Absent),
        };
        // Last: what cannot be started replaces no log.
        let log = options.bus_log.as_deref().map(|path| BusLog::create(path, options.replace_logs, &options.inputs()));
        let log = log.transpose()?;
        Ok(Self { plant, engine, now: 0, log, traffic: None })
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
    /// No telemetry can tell whether a run knocked the flashlight over.
    pub fn flashlight_tilt(&mut self) -> Option<f64> {
        #[cfg(feature = "mujoco")]
        {
            use sim::teacher::GuidedWorld;
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

impl Simulation {
    /// Virtual time reached since power-up.
    pub fn elapsed(&self) -> Duration {
        Duration::from_nanos(self.now * 40)
    }

    /// Lets virtual time pass until something is `ready` or the time-out is over; `ready` hears the time reached.
    pub(crate) fn advance_until(
        &mut self,
        timeout: Duration,
        mut ready: impl FnMut(Ticks) -> bool,
    ) -> Result<(), TransportError> {
        self.advance_plant_until(timeout, |_, now| ready(now))
    }

    /// As [`advance_until`](Self::advance_until); `ready` may take from the plant what has come.
    pub(crate) fn advance_plant_until(
        &mut self,
        timeout: Duration,
        mut ready: impl FnMut(&mut Plant, Ticks) -> bool,
    ) -> Result<(), TransportError> {
        let limit = self.now + (timeout.as_secs_f64() * TICKS_PER_SECOND as f64) as Ticks;
        while !ready(&mut self.plant, self.now) && self.now < limit {
            self.now = self.engine.advance(&mut self.plant, limit).map_err(TransportError::other)?;
        }
        Ok(())
    }

    /// Keeps every frame of the arm's bus from now on for [`take_traffic`](Self::take_traffic).
    pub fn keep_traffic(&mut self) {
        self.plant.record_bus();
        self.traffic.get_or_insert_default();
    }

    /// Frames of the arm's bus since this was last called; the last one may still be on the wire.
    pub fn take_traffic(&mut self) -> Vec<Passage> {
        self.collect();
        self.traffic.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Hands what the arm's bus has carried to those who want it.
    fn collect(&mut self) {
        if let Some(log) = &mut self.log {
            log.arm(&self.plant.take_heard());
        }
        if let Some(traffic) = &mut self.traffic {
            traffic.extend(self.plant.take_recorded());
        }
    }

    /// True if the traffic of the buses is written to a file.
    pub(crate) fn keeps_bus_log(&self) -> bool {
        self.log.is_some()
    }

    /// Writes what the arm's bus, and the `host`'s, have carried since this was last called.
    pub(crate) fn log_buses(&mut self, host: &[Passage]) -> Result<(), TransportError> {
        if self.log.is_some() || self.traffic.is_some() {
            self.collect();
        }
        if let Some(log) = &mut self.log {
            log.host(host);
            log.write_until(self.now).map_err(TransportError::other)?;
        }
        Ok(())
    }
}

impl Transport for Simulation {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        self.plant.link_to_device(bytes);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        self.advance_plant_until(timeout, |plant, _| {
            let bytes = plant.take_from_device();
            out.extend_from_slice(&bytes);
            !bytes.is_empty()
        })?;
        self.log_buses(&[])
    }

    fn now(&self) -> Duration {
        self.elapsed()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}
