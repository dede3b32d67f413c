//! `tactus sim`: a simulated arm that stays, for other terminals to connect to.

mod bus;
mod listener;
mod party;
mod pendant;
mod real_time;

use std::path::PathBuf;
use std::time::Duration;

use canlog::ARM_INTERFACE;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, Output, connection};
use bus::BusServer;
use lab::client::Interrupt;
use lab::device::Device;
use lab::error::HostError;
use lab::quoted;
use lab::simulation::Engine;
use lab::transport::{Address, Transport, TransportError};
use listener::{Listener, accept, listen};
use party::Party;
use pendant::Pendant;
use real_time::RealTime;

/// Virtual time simulated between two looks at the socket: a human does not notice, a link time-out neither.
const STRIDE: Duration = Duration::from_millis(5);

/// The same where programs at the arm's bus wait for answers of pucks.
const BUS_STRIDE: Duration = Duration::from_micros(500);

/// Bytes that go on to the device in that time: less than its serial line carries (921600 baud), so that none wait in
/// between and a stop is never behind more than this.
const STRIDE_BYTES: usize = 440;

/// Options of `sim`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where to listen: `unix:PATH` or `tcp:HOST:PORT`
    #[arg(long, value_name = "ADDRESS", default_value = "unix:tactus.sock")]
    pub listen: String,
    /// End after this much virtual time, at most 3600 s
    #[arg(long, value_name = "SECONDS", value_parser = super::teach::duration, allow_hyphen_values = true)]
    pub duration: Option<f64>,
    /// While nobody is connected, do not wait for the wall clock: run as fast as this machine can
    #[arg(long)]
    pub fast: bool,
    /// Keep the device's flash in this file, so that its primitives are there again after a restart
    #[arg(long, value_name = "FILE")]
    pub flash: Option<PathBuf>,
    /// Inject the faults of this script: a file such as those of `tests/faults`, `FILE:2` for the second of
    /// its scenarios
    #[arg(long, value_name = "FILE")]
    pub faults: Option<String>,
    /// Serve the arm's CAN bus to programs that speak socketcand, such as python-can, in real time
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "fast")]
    pub can: Option<String>,
    /// Leave the co-controller out: the bus has only pucks, safety module, sensor and hand
    #[arg(long, requires = "can", conflicts_with_all = ["listen", "flash"])]
    pub can_only: bool,
}

/// Serves a simulated arm until it is interrupted.
///
/// Bytes arrive when the wall clock brings them, so runs over a socket are not reproducible; `--device sim:` is.
///
/// # Errors
/// The simulation cannot be started, or the address cannot be listened on.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "sim";
    let output = global.output();
    // A mistake in what was given is told with its place.
    global.address(DOING)?;
    // Without co-controller there is no image to look for.
    let usual = if command.can_only { "sil:" } else { "sim:" };
    let device = global.device.as_deref().unwrap_or(usual);
    let bad_address = |error| HostError::Address(error).into_failure(DOING);
    let mut address: Address = device.parse().map_err(bad_address)?;
    if let Address::Simulated(kind, options) = &mut address {
        let added = options.add_files(*kind, command.flash.as_deref(), command.faults.as_deref());
        added.map_err(bad_address)?;
    }
    let refused = |address: &str, cause: Box<dyn std::error::Error + Send + Sync>| {
        Failure::new(ErrorCode::CannotListen, format!("sim: cannot listen on {address}"), cause)
    };
    // Before the device: one whose place is taken must not replace the log of the one that serves there.
    let no_bus = |address: &str, cause: std::io::Error| {
        let other = if address == "127.0.0.1:29536" { "127.0.0.1:29537" } else { "127.0.0.1:29536" };
        refused(address, cause.into()).help(format!("choose another with `--can`, for example `--can {other}`"))
    };
    let bus = command.can.as_ref().map(|address| BusServer::listen(address).map_err(|cause| no_bus(address, cause)));
    let mut bus = bus.transpose()?;
    let listener = (!command.can_only)
        .then(|| listen(&command.listen).map_err(|cause| refused(&command.listen, cause)))
        .transpose()?;
    let (mut device, interrupt) = connection::simulated(&address, device, DOING, |options| {
        options.replace_logs = global.force;
        if command.can_only {
            options.engine = Engine::Absent;
        }
    })?;
    if let (Some(address), Some(server)) = (&command.can, &bus) {
        let served = server.address().map_err(|cause| no_bus(address, cause))?;
        if let Some(simulation) = device.simulation() {
            simulation.keep_traffic();
        }
        output.say(format!("the arm's bus is served at {served} (socketcand, interface {ARM_INTERFACE})"));
    }
    if let Some(listener) = &listener {
        let address = quoted::text(&listener.address(&command.listen));
        output.say(format!("a simulated arm listens; in another terminal: `tactus --device {address} list`"));
    }
    output.say(format!("the pendant's buttons, typed here: {}", pendant::WORDS));
    let served = serve(command, &mut device, listener.as_ref(), bus.as_mut(), &interrupt, output);
    served.map_err(|error| HostError::Transport(error).into_failure(DOING))?;
    let seconds = device.now().as_secs_f64();
    output.result(&Simulated { simulated_s: seconds }, format!("{seconds:.1} s simulated"))
}

/// Data of `tactus --json sim`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Simulated {
    /// Virtual time that has passed, s.
    pub simulated_s: f64,
}

fn serve(
    command: &Cmd,
    device: &mut Device,
    listener: Option<&Listener>,
    mut bus: Option<&mut BusServer>,
    interrupt: &Interrupt,
    output: Output,
) -> Result<(), TransportError> {
    let mut real_time = RealTime::begin(device.now());
    let mut party = Party::default();
    let mut pendant = Pendant::listen();
    let mut bytes = Vec::new();
    while !interrupt.is_raised() {
        if command.duration.is_some_and(|limit| device.now().as_secs_f64() >= limit) {
            break;
        }
        while let Some(listener) = listener
            && party.has_room()
            && let Some(peer) = accept(listener).map_err(TransportError::Io)?
        {
            party.welcome(peer);
        }
        let said = party.hear(STRIDE_BYTES);
        if !said.is_empty() {
            device.send(&said)?;
        }
        while let Some(pressed) = pendant.pressed() {
            match (pressed, device.simulation()) {
                (Ok(action), Some(simulation)) => {
                    simulation.plant().press(action);
                    // It lies where it fell, and its pucks have forgotten where that is. In a laboratory a person
                    // carries it home before it is zeroed again.
                    if action == sim::PendantAction::ReleaseEStop {
                        simulation.plant().carry_home();
                        output.say("the simulated operator carries the arm home");
                    }
                }
                (Ok(_), None) => {}
                (Err(word), _) => output.warn(format!("the pendant has no '{word}'; it has {}", pendant::WORDS)),
            }
        }
        let target = device.now() + STRIDE;
        while device.now() < target {
            let next = if bus.is_some() { target.min(device.now() + BUS_STRIDE) } else { target };
            while device.now() < next {
                bytes.clear();
                device.receive(next.saturating_sub(device.now()), &mut bytes)?;
                party.tell(&bytes);
            }
            if let (Some(bus), Some(simulation)) = (bus.as_deref_mut(), device.simulation()) {
                bus.serve(simulation).map_err(TransportError::Io)?;
            }
            // Who is connected lives by the wall clock: at another pace a device would take each of them for silent.
            if command.fast && party.is_empty() {
                real_time = RealTime::begin(device.now());
            } else {
                std::thread::sleep(real_time.wait(device.now()));
            }
        }
    }
    Ok(())
}
