//! The numbered reasons for which a command fails: name, number, meaning, usual cause, and what to do.
//!
//! A number is never changed and never used again. Its hundreds are the exit code of the process; 500 to 589 are the
//! refusals of the device in their order. `docs/errors.md` is written from this table, from the refusals and from the
//! faults (`crates/lab/tests/errors.rs`).

use std::{fmt, io};

use link::Refusal;

/// Exit codes of `tactus`; scripts rely on them, they are never renumbered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// A defect of the tool itself.
    Internal = 1,
    /// The command line is wrong, or a file it names cannot be read or written.
    Usage = 2,
    /// No such device, or no permission to use it.
    NoDevice = 3,
    /// Host and device, or tool and file, are of versions that do not fit.
    Incompatible = 4,
    /// The device refused or is faulted.
    Refused = 5,
    /// Something was checked and found wrong: limits, check sums, input files, fit.
    Invalid = 6,
    /// The link was lost or the device did not answer in time.
    LinkLost = 7,
    /// Interrupted by the user, after a confirmed stop of what the command had set in motion.
    Interrupted = 130,
}

/// First number of the refusals.
const REFUSALS: u16 = 500;

macro_rules! error_codes {
    ($($name:ident = $number:literal: $meaning:literal, $cause:literal, $remedy:literal;)*) => {
        /// Why a command failed.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum ErrorCode {
            $(#[doc = $meaning] $name,)*
            /// The device refused a request.
            Refused(Refusal),
        }

        impl ErrorCode {
            /// Every code but the refusals, in the order of the numbers.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// Its number.
            #[must_use]
            pub const fn number(self) -> u16 {
                match self {
                    $(Self::$name => $number,)*
                    Self::Refused(reason) => REFUSALS + reason.code() as u16,
                }
            }

            /// The meaning: one sentence without full stop.
            #[must_use]
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$name => $meaning,)*
                    Self::Refused(reason) => reason.explanation(),
                }
            }

            /// The usual cause; empty where the meaning says it.
            #[must_use]
            pub const fn cause(self) -> &'static str {
                match self {
                    $(Self::$name => $cause,)*
                    Self::Refused(_) => "",
                }
            }

            /// The remedy; empty where nothing helps in general.
            #[must_use]
            pub const fn remedy(self) -> &'static str {
                match self {
                    $(Self::$name => $remedy,)*
                    Self::Refused(reason) => reason.remedy(),
                }
            }
        }
    };
}

error_codes! {
    WrongAnswer = 101: "the device answered with another message than was asked for", "a defect of firmware or tool",
        "note what was done and report it";
    LineFailed = 102: "the line to the device, or the simulated device behind it, failed",
        "the simulated device ended, or the system refused an operation",
        "read the cause; `cargo xtask setup` repairs the set-up of the simulator";
    ResultNotWritten = 103: "the result cannot be written", "standard output was closed, or the disk is full",
        "check where the output goes";
    SimulatorFailed = 110: "the simulated device failed", "its set-up is damaged, or the firmware under it ended",
        "`cargo xtask setup` repairs the set-up of the simulator";
    FigureNotWritten = 111: "a figure cannot be written", "the folder does not exist, or the disk is full",
        "check the disk and the rights of the folder";
    PictureNotRendered = 112: "a picture of the scene cannot be rendered",
        "no OpenGL context, or the file cannot be written",
        "check the disk, and that MuJoCo can render without a display";
    PrimitiveNotWritten = 120: "a primitive cannot be written", "the folder does not exist, or the disk is full",
        "check the disk and the rights of the folder";
    RecordingNotWritten = 121: "a recording cannot be written", "the folder does not exist, or the disk is full",
        "check the disk and the rights of the folder";
    RecordingReadsBackWrong = 122: "a recording reads back wrong", "a defect of the tool, or a damaged disk",
        "check the disk, and record again";
    ExperimentFigure = 123: "a figure of an experiment cannot be made", "the folder cannot be written",
        "check the disk and the rights of the folder";
    ResultsNotWritten = 124: "results of an experiment cannot be written",
        "the folder does not exist, or the disk is full", "check the disk and the rights of the folder";
    Interrupted = 130: "the user interrupted; what the command had set in motion has stopped", "Ctrl-C", "";
    CommandLine = 200: "the command line is wrong", "a misspelt option, or one that is missing",
        "`tactus COMMAND --help` shows what it takes";
    AddressInvalid = 201: "the address of the device cannot be read", "a misspelt `--device`",
        "correct the address; `tactus --help` lists the devices";
    NoDeviceNamed = 202: "no device is named", "neither `--device` nor TACTUS_DEVICE is given",
        "add `--device sim:` for a simulated arm, or `--device serial:/dev/ttyACM0`, or set TACTUS_DEVICE";
    UnknownWorld = 203: "there is no simulated world of that name", "a misspelt `world=`",
        "for example `--device sim:world=mujoco`";
    NotSimulated = 204: "the command needs a simulated device", "`--device` names a real one",
        "`--device sim:`, `--device sil:` or `--device board:`";
    NobodyToAsk = 205: "nobody can be asked to press Enter at the end of the movement",
        "`--non-interactive` or no terminal, with an arm that a person moves",
        "say how long to record with `--duration SECONDS`";
    StartIsFixed = 206: "the simulated teacher knows one movement, and where it begins",
        "`--from` with a simulated teacher", "leave out `--from`";
    ResultsExist = 207: "the folder has results of this experiment already",
        "an earlier experiment in the same folder",
        "`--resume` goes on with them; `--out FOLDER` begins anew elsewhere";
    BusLogFile = 208: "the log of the buses cannot be written",
        "the folder of `bus=` does not exist, or has no rights",
        "name a file in a folder that can be written, for example `sil:bus=run.log`";
    NoLogNamed = 209: "neither a log nor an interface is named", "an argument is missing",
        "`tactus can decode bus.log`, or live: `tactus can decode --interface can0`";
    NothingToDraw = 210: "there is nothing to draw", "neither demonstration, primitive nor run is given",
        "tactus plot --demonstration demo.csv --primitive reach.toml --run run.csv --output figure.png";
    FigureFormat = 211: "the format of the figure is unknown", "the file's name ends with another extension",
        "name a file that ends in .png or .svg";
    BoardOption = 212: "the emulated board does not take an option, or not this image", "an option of `board:`",
        "the options of `--device board:` are in docs/board-stm32h743.md";
    FlashFile = 213: "the file cannot be used as the device's flash",
        "`flash=` names a file of another kind or without rights",
        "name a file of an earlier simulation, or one that does not exist yet";
    FaultScript = 214: "the file cannot be used as a script of faults",
        "`faults=` names a file that is missing, or none of `tests/faults`, or a fault in it is misspelt",
        "the faults are listed in docs/faults.md; for example `sil:faults=tests/faults/a3.toml:2`";
    NameInvalid = 220: "the name of the primitive is not valid",
        "too long, empty, other characters than letters, digits, `-`, `_` and `.`, or `-` or `.` at its begin",
        "give a name with `--name NAME`";
    LearnOption = 221: "an option of `learn` is out of its range", "a value on the command line",
        "`tactus learn --help` says what each option takes";
    NoAngles = 222: "no angles are given", "`calibrate home` without `--here` and `--set`", "`--here` or `--set`";
    AttachMayReset = 223: "attaching the debug probe can restart the board", "`logs` on a live board without leave",
        "take the torque from the arm (Shift-Idle), then `tactus logs --attach-may-reset`; better, start it before \
         the arm is switched on: once attached it only reads";
    WouldReplace = 230: "something else of that name is there already",
        "an earlier version in the device, or an earlier file",
        "choose another name; `--force` replaces it";
    OutputNotAFile = 231: "the place of the file to be written is taken by something else",
        "a folder, a device, a pipe, or a link to nothing", "name a file";
    OutputIsInput = 232: "the file to be written is one that the command reads, or writes already", "the same file is named twice",
        "name another file for the output";
    FileMissing = 233: "a file or folder does not exist", "a misspelt name", "check the name; `ls` lists what is there";
    FileNotPermitted = 234: "the system does not permit the use of a file or folder",
        "a read-only folder or file system, or another user's file", "check its rights with `ls -l`, or name another";
    DiskFull = 235: "there is no room left to write", "the disk, the quota or the limit for a file is used up",
        "make room, or name a file on another disk";
    FileFailed = 236: "the system cannot read or write a file", "the disk, or a folder where a file is expected",
        "read the cause; name another file";
    ChangeTooLate = 237: "a change comes after the end of the run", "the time of `--goal-at` or `--speed-at`",
        "give a time within the run";
    UnknownSetting = 238: "there is no such setting, or it cannot have that value", "a misspelt name or value",
        "`tactus config get` lists every setting with its value";
    NoSecretInFile = 239: "a file holds no secret of a device", "another file was named, or one with a passphrase",
        "`tactus secret new FILE` writes one";
    NoTerminal = 240: "there is no terminal to draw on", "standard output is a file or a pipe",
        "run it in a terminal, or with `--json` for a line ten times a second";
    UnknownCode = 241: "there is no error or fault of that name", "a misspelt code",
        "docs/errors.md lists them all; for example `tactus explain E504`";
    NoResults = 242: "there are no results to draw figures of",
        "another folder was meant, or nothing was tried in it yet",
        "name the folder with `--out`, or leave out `--figures-only`";
    Configuration = 250: "the configuration file cannot be used", "a misspelt setting, or a value out of its range",
        "the settings are `device`, `timeout` and `secret_file`, for example `timeout = 5`";
    NoStudyOfWeights = 270: "the experiment with a weight knows neither demonstrations nor sweeps", "`experiment lift`",
        "leave out `--demonstrations` and `--sweep`";
    UnknownObject = 271: "there is no object of that name", "a misspelt name",
        "`tactus experiment --help` lists them; a file of your own ends in `.toml`";
    DeviceNotFound = 301: "there is no such device", "cable, power, or a misspelt port",
        "check cable and name of the device; for a simulated arm use `--device sim:`";
    PermissionDenied = 302: "no permission to use the device", "the user is not in the group of serial ports",
        "let your user open serial ports: `sudo usermod -aG dialout $USER`, then log in again";
    NoCanInterface = 303: "there is no such CAN interface", "the adapter is not plugged in, or has another name",
        "plug the CAN adapter in and load its driver; `ip -details link show type can` lists what is there";
    NotACanInterface = 304: "the network interface is no CAN interface", "a misspelt name",
        "`ip -details link show type can` lists the CAN interfaces";
    CanInterfaceDown = 305: "the CAN interface is down", "it was not switched on since the system started",
        "switch it on with the two commands that are printed with its name";
    NoSocketCan = 306: "this system has no SocketCAN", "the kernel's modules are not loaded, or this is not Linux",
        "load the kernel's CAN modules: `sudo modprobe can_raw`; on other systems use the serial line";
    PortInUse = 307: "another program uses the serial port", "a run or a monitor in another terminal, or a terminal program",
        "a serial port is for one program: Ctrl-C in the other terminal ends it, and brings an arm that it moves to \
         rest; `lsof PORT` names it";
    WithoutMujoco = 310: "this tactus was built without the MuJoCo world", "`cargo build` without the feature",
        "`cargo xtask build`, or `--device sil:world=simple`";
    NoQemuImage = 311: "there is no firmware image for QEMU", "it was not built", "`cargo xtask build`";
    NoQemu = 312: "QEMU cannot be started", "it is not installed", "`cargo xtask setup`";
    NoEmulator = 313: "there is no emulator of the board", "it was not built", "`cargo xtask board --build`";
    NoBoardImage = 314: "there is no image for the emulated board", "it was not built", "`cargo xtask board --build`";
    CannotListen = 320: "the simulated arm cannot be served at this address", "another program has it, or no rights",
        "choose another address with `--listen`";
    ProbeRsMissing = 330: "probe-rs is not installed", "", "install it with `cargo install probe-rs-tools --locked`";
    ProbeFailed = 331: "the debug probe did not do it", "cable, power, or another program has the probe",
        "check the USB cable to the ST-LINK connector, the board's power, and with `probe-rs list` that the probe \
         is seen";
    DefmtPrintMissing = 332: "defmt-print is not installed", "",
        "install it with `cargo install defmt-print --locked`";
    LinkVersion = 401: "host and device speak different versions of the link", "image and tool of different sources",
        "flash the firmware that belongs to this tool, or use the tool that belongs to the firmware";
    LinkSchema = 402: "host and device lay out their messages differently", "image and tool of different sources",
        "flash the firmware that belongs to this tool, or use the tool that belongs to the firmware";
    RobotModel = 403: "host and device compute with different models of the robot",
        "image and tool of different sources", "build tool and firmware from the same model file";
    OtherExperiment = 404: "the folder has results of another configuration",
        "an earlier experiment with other options", "choose another folder with `--out`";
    CapabilityMissing = 405: "the device lacks a part that the command needs",
        "a device for an arm is asked for a hand alone, or the other way round",
        "`tactus status` tells what the device drives; name another one with `--device`";
    OtherImageRuns = 413: "the device runs another image than was written",
        "`--device` is another board than the probe's",
        "check that `--device` is the board the debug probe is connected to";
    ImageOfOtherBoard = 414: "the image is for another board than the emulated one",
        "an image for QEMU or for another board",
        "`cargo xtask board --build` makes the image for the emulated board; images for QEMU belong to `--device \
         sim:`";
    PrimitiveModel = 430: "the primitive is for another model of the robot", "it was learned by another version",
        "learn the primitive again with this version";
    PrimitiveSchema = 431: "the primitive's file has another layout", "it was written by another version",
        "learn the primitive again with this version";
    SettingsModel = 432: "the settings are for another model of the robot", "they were read by another version",
        "calibrate the arm again with this version";
    NotReady = 590: "the arm does not get ready",
        "a puck, the safety module or the pendant does not let the start-up go on",
        "`tactus status` tells what is in its way: mostly the pendant or a cable";
    NotZeroed = 591: "the arm does not know where it stands", "its encoders lost their counts",
        "bring the arm to its home pose by hand and add `--at-home`";
    ArmStopped = 592: "the arm stopped because of a fault", "one of the faults below",
        "find and remove the cause, then `tactus stop --clear-fault`";
    Diverted = 593: "the arm went to a state that was not asked for",
        "`tactus stop` of somebody else, or the pendant",
        "somebody else may have stopped it with `tactus stop`; look, then try again";
    TooLong = 594: "a motion did not end in time", "an obstacle, or a payload the model does not know",
        "look for what holds the arm";
    HandNotReady = 595: "the hand does not get ready", "a finger is blocked, or its puck silent",
        "free the fingers, then `tactus hand init`";
    NoHand = 596: "the arm has no hand that works", "no puck of the hand answers",
        "check the hand's cable; its four pucks are looked for when the arm's bus starts";
    ArmMoves = 597: "the arm moves where it has to stand", "somebody moves it, or it was not at rest yet",
        "press Shift-Idle, let the arm rest, and try again";
    ZeroUnknown = 598: "nobody knows at which home the arm was zeroed",
        "it was zeroed before the device was started, or by another device",
        "emergency stop, then bring the arm home and zero it again with `--at-home`";
    TrialFailed = 599: "a trial of an experiment could not be carried through", "the simulated device failed",
        "`--resume` goes on from here when the reason is gone";
    PlotInput = 610: "a file that is to be drawn is not what it should be", "another kind of file, or a damaged one",
        "give files that `tactus teach`, `learn` and `run --record` have written";
    RunWithoutPath = 611: "the run has no joint angles or no positions", "a recording of a hand alone, or of others",
        "give a recording of `tactus run --record`";
    RunEmpty = 612: "the run has no samples", "the run ended before it began",
        "give a recording of `tactus run --record`";
    CompareInput = 613: "a recording cannot be compared", "it cannot be read, or lacks a column",
        "tactus run PRIMITIVE --record FILE makes a recording";
    ExportInput = 614: "the recording cannot be exported", "it cannot be read, or is none",
        "give a recording of `tactus teach`, `record` or `run --record`";
    RecordingInvalid = 620: "a recording is not valid",
        "a column, unit or value is wrong; the message names line and column",
        "docs/recording-format.md describes the file";
    NoDemonstration = 621: "the recording shows no movement that can be learned", "no pose, or the arm hardly moves",
        "show the movement again";
    TurnsTooFar = 622: "the demonstration turns farther than can be learned",
        "the tool turns by half a turn between start and goal, or nearly",
        "show the movement with less turning, or learn it in two parts";
    FitFailed = 623: "no weights fit the demonstration", "numbers out of range, of the recording or of an option",
        "show the movement again, with the usual options of `tactus learn`";
    LearnedInvalid = 624: "what was learned is no valid primitive",
        "a bound of the primitive is exceeded; the message names it",
        "show the movement again, or change the option that the message names";
    FitPoor = 625: "the primitive does not reproduce the demonstration",
        "too few kernels for so long or so fast a movement", "more kernels (`--kernels 100`), or learn it in two parts";
    PrimitiveUnreadable = 630: "the file is no primitive", "the file does not exist, or is of another kind",
        "`tactus learn DEMO -o FILE` writes a primitive";
    CheckFailed = 631: "the check of the primitive failed", "the movement comes too near to a limit of the arm",
        "run it more slowly (`--speed 0.5`), or show the movement farther from the limits and learn it again";
    PrimitiveChecksum = 632: "the primitive does not match its check sum", "the file was changed or damaged",
        "the file was changed or damaged: learn the primitive again from its demonstration";
    PrimitiveInvalid = 633: "a value of the primitive is not valid",
        "the file was changed, or learned with options out of range",
        "learn the primitive again, see `tactus learn --help`";
    ExpectationStale = 634: "the expected force is for another model, duration or filter",
        "the primitive was changed after its rehearsal, or rehearsed with another version",
        "record it again with `tactus rehearse`";
    NoExpectation = 635: "the primitive has no expected forces", "it was never rehearsed",
        "record it with `tactus rehearse`, or run with `--mode open`";
    ExpectationSpeed = 636: "the expected force was recorded at a speed too different", "`--speed`",
        "run at the speed of the rehearsal, or rehearse at this one";
    GoalMissed = 637: "the arm did not reach its goal",
        "something was in the way, or the goal is out of the arm's reach", "`tactus plot --run FILE --output FILE.png` shows where it went";
    NotRemembered = 640: "nothing could be remembered from the recordings",
        "they are of another movement, or too few", "give recordings of this primitive, all at the same speed";
    RecordingOfOthers = 641: "the recordings are not of the same movement", "another file was meant",
        "give recordings of this primitive; their first lines name it";
    WeightOfOtherPayload = 642: "the device keeps a weight that was measured with another payload",
        "a weight counts with one payload only",
        "`tactus calibrate gravity --reset` forgets it; then declare what the arm carries, and weigh it again";
    WeightNotAccepted = 644: "the weight of the arm was measured and not accepted",
        "the hand holds something, something touches the arm, or its weight is right already",
        "where its weight is right already nothing is to be done, `tactus calibrate gravity --show` tells whose it is; else \
         empty the hand and free the arm, then `tactus calibrate gravity` again; the device goes on as before";
    SettingsInvalid = 645: "the file of settings cannot be used", "a misspelt key, or a value that no arm can have",
        "`tactus config dump` writes a sound one to compare with";
    SettingsOfOthers = 646: "the settings are those of another arm", "another file was meant, or the board was changed",
        "calibrate this arm; if it is the same arm with another board: `tactus config restore FILE --force`";
    SettingsDiffer = 647: "the device keeps other settings than the file has",
        "it was calibrated since, or another device was meant",
        "`tactus config restore FILE` has the device keep the file's, `tactus config dump -o FILE --force` the reverse";
    SettingsNotKept = 648: "reading the settings back gave other values", "the device's storage, or the line",
        "restore them again; if it persists the device's storage is worn out";
    FrictionNotTold = 649: "the passes do not tell the friction of the joints",
        "messages were lost, the device let the arm move at one speed only, or something moved a joint",
        "free the arm, `tactus status --line 10`, then again";
    LoadNotTold = 650: "what the wrist carries cannot be told",
        "there is no wrist sensor, messages were lost, or what is held moved in the hand",
        "hold it fast, keep it from touching anything, then again";
    ImageInvalid = 651: "the image to be uploaded is not sound", "a defect of the tool",
        "make the primitive again with `tactus learn`";
    ReadBackDiffers = 652: "reading the primitive back gave other bytes", "the device's storage, or the line",
        "upload again; if it persists the device's storage is worn out";
    PayloadContradicted = 653: "what the arm carries was measured and is not believed",
        "the wrist sensor and the joints tell different loads: one of them is wrong, something touches the arm or what it \
         carries, or something hangs on the arm before the sensor",
        "free arm and load, let nothing touch them, then `tactus calibrate payload --measure` again; if it stays the same, \
         `tactus calibrate gravity --show` tells whose weight counts, and the sensor has to be checked with a known weight";
    EmptyHandInvalid = 654: "the report of the empty hand cannot be used",
        "it is of another arm or of another calibration, or was not believed",
        "empty the hand, then `tactus calibrate payload --measure --report FILE` makes one";
    HandLoaded = 655: "a force acts on the hand that a tare would make nothing",
        "the hand holds or touches something, or the sensor is adrift by more than 1 N",
        "empty the hand and let nothing touch it, then `tactus tare` again; if the force is the sensor's error, or a load that \
         shall count as nothing, `tactus tare --loaded`";
    ImageOfBefore = 656: "the device has lost what was stored last under that name, and kept an image of before",
        "a damaged word of its flash",
        "`tactus upload FILE` brings the last one back";
    OutOfReach = 660: "the arm does not reach the object in every cell", "the grid is larger than the arm's reach",
        "leave these cells out, for example with `--grid 4x3` or a list of `--cells`";
    ResultsDamaged = 661: "the results in the folder cannot be read", "a line was changed or cut",
        "choose another folder with `--out`";
    NotTaught = 662: "no primitive was made for the experiment", "the simulated teacher's grasp did not hold",
        "make one with `tactus teach`, `learn` and `rehearse`, and give it with `--primitive`";
    ObjectInvalid = 663: "the file of the object cannot be used", "a misspelt key, or a figure out of its range",
        "write it as crates/sim/objects/cup.toml is written, under a name of its own";
    LogUnreadable = 670: "the log of the bus cannot be read", "the file does not exist",
        "`candump -L can0 > bus.log` makes such a file, and `--device sil:bus=bus.log` of a simulated arm";
    LogLines = 671: "lines of the log are not in candump's format", "another format", "make logs with `candump -L`";
    ReplayDiffers = 672: "the device's application sends other frames than are in the log",
        "another version or other parameters",
        "the log is of another version or of other parameters, or something could not be reproduced";
    ReplayImpossible = 673: "the log cannot be replayed", "it begins in the middle, or holds no device",
        "record from before power-up; of a simulated arm: `tactus --device sil:line=can,bus=bus.log ...`";
    ImageMissing = 680: "no image was built", "",
        "build it with `cargo xtask build --board stm32h743`, or name one with `--image`";
    ImageUnreadable = 681: "the file is no image of the co-controller", "another kind of file, or a damaged one",
        "build an image with `cargo xtask build --board stm32h743`";
    ImageOfNoBoard = 682: "the image is not for a board that this tool can flash",
        "an image for the emulator, or of newer sources",
        "build one with `cargo xtask build --board stm32h743`; for the emulator use `--device sim:`";
    ImageOutOfPlace = 683: "the image lies where it must not", "it is damaged, or linked for something else",
        "the image is damaged or was linked for something else: build it again; nothing was written";
    LogFileUnreadable = 684: "the file of the device's log cannot be read", "it does not exist, or has no rights",
        "check the name of the file";
    BoardImageUnreadable = 685: "the file is no image for the emulated board",
        "another kind of file, or a damaged one",
        "`cargo xtask board --build` makes the image for the emulated board";
    NoFaultRecord = 690: "the device keeps no record of a fault",
        "no fault has happened since it got power, or it is a hand alone", "";
    LineClosed = 701: "the line to the device was closed", "cable, power, or the other end ended",
        "check the cable; the device stops the arm by itself after half a second";
    NoAnswer = 702: "the device did not answer in time", "no power, or another program has the line",
        "check that the device has power, that its firmware runs, and that no other program is connected to it; \
         then try again";
    NotStopped = 703: "the arm was told to stop and still moves", "", "press the emergency stop";
    BusOff = 704: "the CAN controller of the host left the bus after too many errors",
        "bit rate, termination or wiring",
        "check bit rate, termination (120 ohm at both ends) and wiring, then switch the interface off and on";
    FramesNotSent = 705: "frames do not leave the CAN interface", "nobody on the bus acknowledges them",
        "check that the device has power and that its bit rate is the same";
    NoTactus = 706: "something else than a device is at the line", "another port, another bit rate, or a board without the firmware",
        "name the port of the board (`ls /dev/serial/by-id`) at 921600 baud, and flash the firmware with `tactus flash`";
}

impl ErrorCode {
    /// The reason for which the system refuses a file, where it says one that a person can do something about.
    #[must_use]
    pub fn of_file(cause: &io::Error) -> Option<Self> {
        Some(match cause.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Self::FileMissing,
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => Self::FileNotPermitted,
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => Self::DiskFull,
            io::ErrorKind::IsADirectory => Self::FileFailed,
            _ => return None,
        })
    }

    /// Exit code of a command that fails with it: the hundreds of the number.
    #[must_use]
    pub const fn exit(self) -> Exit {
        match (self, self.number() / 100) {
            (Self::Interrupted, _) => Exit::Interrupted,
            (_, 1) => Exit::Internal,
            (_, 2) => Exit::Usage,
            (_, 3) => Exit::NoDevice,
            (_, 4) => Exit::Incompatible,
            (_, 5) => Exit::Refused,
            (_, 6) => Exit::Invalid,
            _ => Exit::LinkLost,
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "E{}", self.number())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_used_once_and_belongs_to_an_exit_code() {
        let refusals = Refusal::ALL.map(ErrorCode::Refused);
        let mut numbers: Vec<u16> = ErrorCode::ALL.iter().chain(&refusals).map(|code| code.number()).collect();
        assert!(numbers.iter().all(|number| (101..800).contains(number)), "{numbers:?}");
        numbers.sort_unstable();
        let twice = numbers.windows(2).find(|pair| pair[0] == pair[1]);
        assert_eq!(twice, None);
    }

    #[test]
    fn the_table_is_in_the_order_of_the_numbers_and_leaves_the_refusals_their_place() {
        assert!(ErrorCode::ALL.is_sorted_by_key(|code| code.number()));
        assert!(!ErrorCode::ALL.iter().any(|code| (REFUSALS..REFUSALS + 90).contains(&code.number())));
        assert!(Refusal::ALL.len() <= 90);
    }
}
