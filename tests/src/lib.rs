//! Common parts of the whole-system tests: a simulated device, a primitive that was taught, an execution, the command.
//!
//! Nothing here is skipped where something is missing. A test without firmware image, QEMU or MuJoCo fails, and the
//! message names the command that sets it up.

pub mod bus;
pub mod command;
pub mod execution;
pub mod image;
pub mod load;
pub mod python;
pub mod raw;

use std::fmt::Display;
use std::sync::OnceLock;
use std::time::Duration;

use device::Stage;
use lab::client::Client;
use lab::device::Device;
use lab::primitive_file::PrimitiveFile;
use lab::procedure;
use lab::simulation::Simulation;

/// A conversation with a simulated device.
pub type Arm = Client<Device>;

/// Name of the primitive that every test plays.
pub const PRIMITIVE: &str = "side-grasp";

/// The value, or a failed test that says what the error says.
///
/// # Panics
/// On an error.
#[track_caller]
pub fn expect<T, E: Display>(result: Result<T, E>) -> T {
    match result {
        Ok(value) => value,
        Err(error) => panic!("{error}"),
    }
}

/// Boots the simulated device at `address` (`sim:seed=1`); no time has passed yet, and every frame of its bus is kept.
///
/// # Panics
/// It cannot be started.
#[track_caller]
pub fn boot(address: &str) -> Device {
    let mut device = expect(Device::open(&expect(address.parse()), |_| {}));
    simulation(&mut device).plant().record_bus();
    device
}

/// Boots a simulated device and says hello.
///
/// # Panics
/// It cannot be started, or does not answer.
#[track_caller]
pub fn connect(address: &str) -> Arm {
    expect(Client::connect(boot(address), "system test"))
}

/// Boots a simulated device and waits until it can be commanded.
///
/// # Panics
/// It does not get there.
#[track_caller]
pub fn ready(address: &str) -> Arm {
    let mut arm = connect(address);
    expect(procedure::make_ready(&mut arm, false, |_| {}));
    arm
}

/// Boots a simulated device and waits until it is up, with torque off: nobody has commanded anything, not even the
/// hand's initialisation.
///
/// # Panics
/// It does not get there.
#[track_caller]
pub fn at_rest(address: &str) -> Arm {
    let mut arm = connect(address);
    let deadline = arm.now() + Duration::from_secs(30);
    loop {
        match Stage::from_code(expect(arm.status()).startup_stage) {
            Some(Stage::Ready) => return arm,
            Some(Stage::WaitingForZero) => expect(arm.zero(control::model::HOME.map(|angle| angle as f32))),
            stage => assert!(arm.now() < deadline, "start-up hangs in {stage:?}"),
        }
        expect(arm.next(Duration::from_millis(50)));
    }
}

/// The simulation behind a device.
///
/// # Panics
/// The device is not simulated.
pub fn simulation(device: &mut Device) -> &mut Simulation {
    device.simulation().expect("the tests open simulated devices only")
}

/// The primitive that every test plays: shown by the simulated teacher, recorded over the link, learned; all by the
/// command.
///
/// It is taught to `sil:`, because that is fast; the journey teaches the firmware itself.
///
/// # Panics
/// Teaching or learning fails.
pub fn taught() -> &'static PrimitiveFile {
    static TAUGHT: OnceLock<PrimitiveFile> = OnceLock::new();
    TAUGHT.get_or_init(|| {
        let folder = expect(tempfile::tempdir());
        command::tactus(folder.path(), &["--device", "sil:", "teach", "-o", "demo.csv"]).success();
        command::tactus(folder.path(), &["learn", "demo.csv", "--name", PRIMITIVE, "-o", "primitive.toml"]).success();
        expect(PrimitiveFile::read(&folder.path().join("primitive.toml")))
    })
}
