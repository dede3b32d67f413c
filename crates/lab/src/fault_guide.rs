//! Each fault for the person in front of the arm: its usual cause, what to look at, and how to go on.

use control::Fault;

/// Advice on a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultGuide {
    /// Reaction of the arm, with the state it goes to.
    pub reaction: &'static str,
    /// The usual cause.
    pub cause: &'static str,
    /// The places to look at before going on.
    pub check: &'static str,
    /// The way back to an arm that takes commands.
    pub clear: &'static str,
}

/// For a fault whose cause only has to be removed.
const CLEAR: &str = "`tactus stop --clear-fault`";
/// For a fault after which the joint angles are not to be trusted.
const ZERO: &str =
    "bring the arm home, zero it again (`tactus run PRIMITIVE --at-home`), then `tactus stop --clear-fault`";
/// For a fault after which the device starts the bus anew. Under a fault it would have the brakes set again.
const CLEAR_AND_ACTIVATE: &str = "`tactus stop --clear-fault`, then activate at the pendant";
/// For what was done at the pendant.
const ACTIVATE: &str = "activate at the pendant, then `tactus stop --clear-fault`";

impl FaultGuide {
    /// The advice on a fault. A fault without advice does not compile.
    #[must_use]
    pub const fn of(fault: Fault) -> FaultGuide {
        let (cause, check) = match fault {
            Fault::None => ("none", "nothing"),
            Fault::RepliesLost => (
                "a loose connector or a missing terminator of the CAN bus, or other traffic on it",
                "plugs and the two 120 ohm terminators; the column of lost replies in the record",
            ),
            Fault::RepliesLostForLong => (
                "a cable of the bus is off, or a puck has no power",
                "support the arm; then the cable along the arm and the light of each puck",
            ),
            Fault::JointLimit => (
                "the arm was led, pushed or commanded to the end of a joint's range",
                "the joint whose angle is largest in the record; nothing may be caught there",
            ),
            Fault::JointSpeed => (
                "the movement is too fast, the arm was pushed hard, or the payload is not the declared one",
                "the speeds in the record, what hangs on the arm, and the duration of the primitive",
            ),
            Fault::TipSpeed => (
                "the movement is too fast for elbow, forearm or hand, or the arm was pushed hard",
                "the speeds in the record; run with a smaller `--speed`",
            ),
            Fault::NotFinite => (
                "a defect of the program, or damaged memory",
                "write the record to a file and send it with the primitive to the maintainers",
            ),
            Fault::ImplausiblePosition => (
                "an encoder cable with a bad contact, or a puck that has restarted",
                "which joint jumps in the record; its cable",
            ),
            Fault::TrackingError => (
                "something holds the arm, or the payload is not the declared one",
                "obstacles on the way, cables that pull, the mass in the hand",
            ),
            Fault::ContactForce => (
                "the hand or what it holds has struck something",
                "the wrench in the record says from where; look for an obstacle; if there was none, bring the arm home and \
                 zero it again (`--at-home`): that tares its sensor",
            ),
            Fault::SafetyDropped => (
                "the emergency stop or the idle button was pressed, or the safety module found a limit exceeded",
                "the pendant: its display and the lights of velocity, torque, voltage and heartbeat",
            ),
            Fault::WrenchLost => (
                "the cable of the force sensor, or its power",
                "the plug at the wrist; `tactus status` says if the sensor answers again",
            ),
            Fault::BusFault => (
                "a short circuit or a wrong bit rate, a puck that has restarted, or a safety module without power",
                "wiring and terminators, the supply, and the log of the device (`tactus logs`)",
            ),
            Fault::Overrun => (
                "a defect of the program, or a board whose clock is wrong",
                "the column of the computing time in the record; send it to the maintainers",
            ),
            Fault::EncoderStuck => (
                "the encoder of a motor, its cable or its magnet",
                "the joint that stands still in the record although it was moved",
            ),
            Fault::UnseenContact => (
                "elbow or forearm met something or somebody, or the arm was pushed while the force sensor was silent, or the sensor tells of a push that no joint knows of, or the arm carries a hand whose sensor never answered",
                "obstacles; the plug and the mounting of the sensor at the wrist; `tactus tare`, and `tactus calibrate payload`",
            ),
            Fault::MotorHot => (
                "long work against gravity or against an obstacle, or a warm room",
                "the temperatures in `tactus --json monitor`; let the arm rest until all are below 75 degrees C",
            ),
            Fault::Shaking => (
                "a loop that is not stable on this arm: a payload that is not the declared one, loose cables, or less friction than the model's",
                "which joint swings in the record, and how fast; `tactus calibrate payload`, the tension of the cables, `tactus calibrate friction`",
            ),
            Fault::OtherPayload => (
                "the sensor or the hand was plugged in, or got power, after the start-up",
                "what hangs on the arm, and that all of it has power",
            ),
        };
        FaultGuide { reaction: reaction(fault), cause, check, clear: way_on(fault) }
    }
}

/// Reaction of the arm, with the state it goes to.
const fn reaction(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "nothing",
        Fault::RepliesLost
        | Fault::JointLimit
        | Fault::JointSpeed
        | Fault::TipSpeed
        | Fault::ImplausiblePosition
        | Fault::TrackingError
        | Fault::ContactForce
        | Fault::WrenchLost
        | Fault::Overrun
        | Fault::Shaking
        | Fault::UnseenContact => "SoftStop: it brakes and gives way",
        Fault::NotFinite => "SoftStop; Fault, without torque, if it goes on",
        Fault::EncoderStuck => "SoftStop, and the safety module is asked for IDLE: its brakes",
        Fault::MotorHot | Fault::OtherPayload => "SoftStop, unless it is being lowered",
        Fault::RepliesLostForLong => "Fault: no torque",
        Fault::SafetyDropped => "Idle: no torque",
        Fault::BusFault => "Fault: no torque; then a new start-up of the bus",
    }
}

/// The way back to an arm that takes commands.
const fn way_on(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "nothing to clear",
        Fault::RepliesLost
        | Fault::RepliesLostForLong
        | Fault::JointSpeed
        | Fault::TipSpeed
        | Fault::NotFinite
        | Fault::TrackingError
        | Fault::ContactForce
        | Fault::WrenchLost
        | Fault::Overrun
        | Fault::Shaking
        | Fault::UnseenContact
        | Fault::MotorHot => CLEAR,
        Fault::JointLimit => "`tactus stop --clear-fault`, then lead the joint back by hand with `tactus teach`",
        Fault::ImplausiblePosition | Fault::EncoderStuck => ZERO,
        Fault::SafetyDropped => ACTIVATE,
        Fault::BusFault => CLEAR_AND_ACTIVATE,
        Fault::OtherPayload => "support the arm, release it: the bus is started anew and the fault ends with it",
    }
}
