//! The remedy for a start-up that does not get on: by the stage in which it waits, and by the reason that blocks it.

use device::Stage;

/// Remedy for what blocks a start-up, from the two numbers of a status or event; `None` where nothing blocks it, or the
/// reason is of a newer device.
///
/// The first number is the reason, as `device::StartupFailure` numbers it; a test holds the two against each other.
#[must_use]
pub fn blocked_remedy([reason, detail]: [u32; 2]) -> Option<&'static str> {
    Some(match (reason, detail & 0xFF) {
        (1, _) => "check that the arm has power and that its CAN cable is plugged in",
        (2..=4, _) => {
            "check power and CAN cable of the arm up to that node, then switch the arm off and on; `tactus status` \
             tells when it goes on"
        }
        (5, _) => "put the puck there that belongs there: docs/barrett-can.md lists the roles of the nodes",
        (6, _) => "load a supported firmware into that puck: docs/barrett-can.md lists them",
        (7..=10 | 21 | 22, _) => {
            "correct that property with Barrett's tools: docs/barrett-can.md says which value it must have"
        }
        (11..=13 | 16, _) => {
            "compare CTS and IPNM of that puck with docs/barrett-can.md, and correct them with Barrett's tools"
        }
        (14 | 15 | 17 | 18 | 20 | 23, _) => {
            "emergency stop, then bring the arm to its home pose by hand and add `--at-home` to the next command that moves \
             it, such as `run`"
        }
        (19, _) => "wait a second: it goes on by itself",
        (24, 0) => "`tactus calibrate payload hand`, or `tactus calibrate payload undeclared`",
        (24, _) => "check the cable of the force sensor; on a bare arm `tactus calibrate payload nothing`",
        _ => return None,
    })
}

/// Remedy for a device that waits in this stage of its start-up; `None` where only time helps.
#[must_use]
pub const fn stage_remedy(stage: Stage) -> Option<&'static str> {
    match stage {
        Stage::WaitingForIdle => Some("release the emergency stop and press Shift+Idle on the pendant"),
        Stage::WaitingForZero => Some(
            "bring the arm to its home pose by hand and add `--at-home` to the next command that moves it, such as `run`",
        ),
        Stage::WaitingForActive => Some("press Shift+Activate on the pendant"),
        Stage::Blocked => Some("`tactus status` tells what is in its way"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use control::CalibrationError;
    use device::{StartupError, StartupFailure};
    use puck::Node;

    use super::*;

    #[test]
    fn every_reason_that_blocks_a_start_up_has_a_remedy_of_its_own() {
        let node = Node::ARM[0];
        let reasons = [
            (StartupError::NoSafetyModule, "power"),
            (StartupError::MissingPuck(node), "cable"),
            (StartupError::NoAnswer(node), "cable"),
            (StartupError::DidNotWake(node), "cable"),
            (StartupError::WrongRole { node, role: 1 }, "roles"),
            (StartupError::UnknownFirmware { node, version: 3 }, "firmware"),
            (StartupError::WrongGroups(node), "property"),
            (StartupError::WrongPlace { node, place: 2 }, "property"),
            (StartupError::WrongTorqueLimit { node, limit: 0 }, "property"),
            (StartupError::NotAWrist { poles: 8 }, "property"),
            (StartupError::Calibration(CalibrationError::CountsPerRevolution(1)), "CTS"),
            (StartupError::Calibration(CalibrationError::TorqueCounts(1)), "IPNM"),
            (StartupError::Calibration(CalibrationError::HandTorqueCounts(1)), "IPNM"),
            (StartupError::ZeroNotTaken(node), "--at-home"),
            (StartupError::SafetyNotZeroed, "--at-home"),
            (StartupError::CountsAnew(node), "--at-home"),
            (StartupError::CountsJumped, "--at-home"),
            (StartupError::AnswersLate(node), "by itself"),
            (StartupError::ZeroUnfinished, "--at-home"),
            (StartupError::SafetyVelocity { limit: 0 }, "property"),
            (StartupError::SafetyTorque { limit: 0 }, "property"),
            (StartupError::BeyondStops { joint: 4 }, "--at-home"),
            (StartupError::PayloadContradicted { hand: false }, "payload hand"),
            (StartupError::PayloadContradicted { hand: true }, "payload nothing"),
        ];
        for (reason, word) in reasons {
            let remedy = blocked_remedy(StartupFailure::from(reason).0).unwrap();
            assert!(remedy.contains(word), "{reason}: {remedy}");
        }
        assert_eq!((blocked_remedy([0, 0]), blocked_remedy([99, 1])), (None, None));
    }
}
