//! Examples at the end of each command's help.

/// The whole tool.
pub(super) const ALL: &str = "\
Devices:
  sil:   the application in this process, on a simulated arm   sim:   the firmware image under QEMU
  board: the emulated board   hand: a hand under QEMU   serial:/dev/ttyACM0  can:can0  tcp:HOST:PORT  unix:tactus.sock
Options of simulated devices, behind the colon, with commas; world=mujoco|simple is the physics, held=KG a weight held:
  seed=N    everything random     arm=N       masses and friction     line=serial|can  the line to the host
  bus=FILE  log of both buses     flash=FILE  keeps its primitives    faults=FILE[:N]  injected faults
Examples:
  tactus --device sil: teach -o grasp.csv
  tactus learn grasp.csv -o grasp.toml
  tactus --device sil:seed=7 run grasp.toml --record run.csv";

/// `sim`
pub(super) const SIM: &str = "\
Examples:
  tactus --device sil: sim
  tactus --device sil:world=simple sim --listen unix:arm.sock --flash arm.flash
  tactus sim --can 127.0.0.1:29536 --can-only";
/// `teach`
pub(super) const TEACH: &str = "\
Examples:
  tactus --device sil: teach --output grasp.csv
  tactus --device serial:/dev/ttyACM0 teach --at-home --duration 20 --output grasp.csv";
/// `learn`
pub(super) const LEARN: &str = "\
Examples:
  tactus learn grasp.csv --output grasp.toml
  tactus learn grasp.csv --kernels 100 --dwell 3.5 --hand-goal 0,2.3,2.3,2.3 --output grasp.toml";
/// `rehearse`
pub(super) const REHEARSE: &str = "\
Examples:
  tactus --device sil: rehearse grasp.toml
  tactus --device sil: rehearse grasp.toml --trials 5 --record-dir rehearsals --output rehearsed.toml";
/// `statistics`
pub(super) const STATISTICS: &str = "\
Examples:
  tactus statistics grasp.toml run-1.csv run-2.csv run-3.csv
  tactus statistics grasp.toml --forget";
/// `check`
pub(super) const CHECK: &str = "\
Examples:
  tactus check grasp.toml
  tactus check grasp.toml --speed 0.5 --goal 0.6,0.1,0.2";
/// `run`
pub(super) const RUN: &str = "\
Examples:
  tactus --device sil: run grasp.toml --record run.csv
  tactus --device sil: run grasp.toml --keep
  tactus --device sil: run grasp.toml --mode adapt --speed 0.5 --goal 0.6,0.1,0.2
  tactus --device serial:/dev/ttyACM0 run grasp";
/// `upload`
pub(super) const UPLOAD: &str = "\
Example:
  tactus --device unix:tactus.sock upload grasp.toml";
/// `export`
pub(super) const EXPORT: &str = "\
Example:
  tactus export run.csv --output run.mcap";
/// `list`
pub(super) const LIST: &str = "\
Example:
  tactus --device unix:tactus.sock list";
/// `get`
pub(super) const GET: &str = "\
Example:
  tactus --device unix:tactus.sock get grasp --output grasp-of-the-device.toml";
/// `rename`
pub(super) const RENAME: &str = "\
Example:
  tactus --device unix:tactus.sock rename grasp grasp-old";
/// `delete`
pub(super) const DELETE: &str = "\
Example:
  tactus --device unix:tactus.sock delete grasp-old";
/// `status`
pub(super) const STATUS: &str = "\
Examples:
  tactus --device unix:tactus.sock --json status
  tactus --device sil:world=simple status --line 10";
/// `calibrate`
pub(super) const CALIBRATE: &str = "\
Examples:
  tactus --device unix:tactus.sock calibrate show
  tactus --device sil:arm=9 calibrate gravity
  tactus --device sil:world=simple,arm=9 calibrate friction
  tactus --device unix:tactus.sock calibrate payload hand
  tactus --device sil:world=simple,arm=9,held=0.3 calibrate payload --measure";
/// `tare`
pub(super) const TARE: &str = "\
Examples:
  tactus --device unix:tactus.sock tare
  tactus --device unix:tactus.sock tare --loaded";
/// `hand`
pub(super) const HAND: &str = "\
Examples:
  tactus --device unix:tactus.sock hand init
  tactus --device unix:tactus.sock hand to 0,1.2,1.2,1.2";
/// `faults`
pub(super) const FAULTS: &str = "\
Examples:
  tactus --device unix:tactus.sock faults
  tactus --device unix:tactus.sock faults --record fault.csv";
/// `stop`
pub(super) const STOP: &str = "\
Example:
  tactus --device unix:tactus.sock stop";
/// `record`
pub(super) const RECORD: &str = "\
Example:
  tactus --device unix:tactus.sock record --duration 30 --output what-it-does.csv";
/// `flash`
pub(super) const FLASH: &str = "\
Examples:
  tactus flash --dry-run
  tactus flash";
/// `logs`
pub(super) const LOGS: &str = "\
Examples:
  tactus logs --dry-run
  tactus logs --attach-may-reset";
/// `experiment`
pub(super) const EXPERIMENT: &str = "\
Examples:
  tactus --device sil: experiment flashlight --grid 4x3 --modes a,c
  tactus experiment flashlight --figures-only";
/// `plot`
pub(super) const PLOT: &str = "\
Examples:
  tactus plot --run run.csv --output run.png
  tactus plot -d grasp.csv -p grasp.toml -r run.csv -o run.svg --picture arm.png";
/// `report`
pub(super) const REPORT: &str = "\
Example:
  tactus report run-1.csv run-2.csv --primitive grasp.toml --output report.html";
/// `monitor`
pub(super) const MONITOR: &str = "\
Example:
  tactus --device unix:tactus.sock monitor --primitive grasp.toml";
/// `explain`
pub(super) const EXPLAIN: &str = "\
Example:
  tactus explain E230";
/// `completions`
pub(super) const COMPLETIONS: &str = "\
Example:
  tactus completions bash";
/// `manual`
pub(super) const MANUAL: &str = "\
Example:
  tactus manual ~/.local/share/man/man1";
/// `config`
pub(super) const CONFIG: &str = "\
The file is ~/.config/tactus/config.toml, for example:
  device = \"serial:/dev/ttyACM0\"
  timeout = 5
  secret_file = \"/home/anna/lab.secret\"
An option counts before the environment, and the environment before the file.
The settings of the device are the home of the arm and the weight of its links (`tactus calibrate`).
Examples:
  tactus config
  tactus config dump -o arm.toml
  tactus config diff arm.toml
  tactus config restore arm.toml
  tactus config set home.joint_4_rad=3.1";
/// `secret`
pub(super) const SECRET: &str = "\
Without one, as delivered, whoever has the line of a device may command it. Looking and stopping never need one.
The file is named with `--secret-file FILE`, TACTUS_SECRET_FILE, or `secret_file` in ~/.config/tactus/config.toml.
Examples:
  tactus secret new lab.secret
  tactus --device serial:/dev/ttyACM0 secret set lab.secret
  tactus --device serial:/dev/ttyACM0 --secret-file lab.secret run grasp
  tactus --device serial:/dev/ttyACM0 --secret-file lab.secret secret clear";
/// `compare`
pub(super) const COMPARE: &str = "\
Example:
  tactus compare run-1.csv run-2.csv";
/// `can`
pub(super) const CAN: &str = "\
Examples:
  tactus can decode bus.log --summary
  tactus can replay bus.log";
/// `doctor`
pub(super) const DOCTOR: &str = "\
Nothing is changed, and no port is opened but that of the device that is named.
Examples:
  tactus doctor
  tactus doctor --device sil: --report doctor.json";
