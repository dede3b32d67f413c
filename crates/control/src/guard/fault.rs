//! Faults: reasons for which the arm took torque authority away by itself.
//!
//! A fault is a latched state, not an error value: it is shown until a person clears it. The codes are part of the wire
//! format, they are appended to and never renumbered.

use core::fmt;

/// Why the arm stopped by itself. `None` is code 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Fault {
    /// No fault.
    #[default]
    None = 0,
    /// Six cycles in a row without all position replies.
    RepliesLost = 1,
    /// Replies stayed away for 200 ms after the soft stop began.
    RepliesLostForLong = 2,
    /// A joint position left its soft limits.
    JointLimit = 3,
    /// A joint velocity exceeded its limit.
    JointSpeed = 4,
    /// The elbow, the point 0.35 m beyond it, or the hand moved faster than allowed.
    TipSpeed = 5,
    /// A torque, reference or state was not finite.
    NotFinite = 6,
    /// Position counts jumped farther than the arm can move, six cycles in a row.
    ImplausiblePosition = 7,
    /// The plan went farther from the arm than the tracking bound.
    TrackingError = 8,
    /// The measured wrench exceeded the stop threshold.
    ContactForce = 9,
    /// The safety module went to IDLE or E-STOP while torque was on.
    SafetyDropped = 10,
    /// The wrench sensor fell silent while the arm moved by itself.
    WrenchLost = 11,
    /// The device found a fault of the bus or a puck (bus-off, puck reset) and asked for zero torque.
    BusFault = 12,
    /// The control cycle missed its deadline too often.
    Overrun = 13,
    /// The counts of a motor do not change although it turns.
    EncoderStuck = 14,
    /// Something pushed the arm, or hung on it, and the wrench sensor did not tell: it was silent, there is none, or it
    /// was elbow or forearm. Or the sensor told of a push that the joints do not know of.
    UnseenContact = 15,
    /// A motor is too hot to go on.
    MotorHot = 16,
    /// A device answers that the start-up had not found: what hangs on the arm is not what the model carries.
    OtherPayload = 17,
    /// A joint swung back and forth for longer than a blow rings.
    Shaking = 18,
}

/// The reaction to a fault that the caller of the control cycle reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReactionOutside {
    /// All torque is taken off.
    TorqueOff,
    /// A soft stop.
    Soft,
    /// A soft stop; nothing if the arm is being lowered, which is the way to where that ends.
    SoftUnlessLowering,
}

impl Fault {
    /// Every fault, in the order of the codes.
    pub const ALL: [Fault; 19] = [
        Fault::None,
        Fault::RepliesLost,
        Fault::RepliesLostForLong,
        Fault::JointLimit,
        Fault::JointSpeed,
        Fault::TipSpeed,
        Fault::NotFinite,
        Fault::ImplausiblePosition,
        Fault::TrackingError,
        Fault::ContactForce,
        Fault::SafetyDropped,
        Fault::WrenchLost,
        Fault::BusFault,
        Fault::Overrun,
        Fault::EncoderStuck,
        Fault::UnseenContact,
        Fault::MotorHot,
        Fault::OtherPayload,
        Fault::Shaking,
    ];

    /// The stable number of this fault.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The fault with this number, if there is one.
    pub fn from_code(code: u8) -> Option<Fault> {
        Fault::ALL.into_iter().find(|fault| fault.code() == code)
    }

    /// The reaction to this fault where the device found it, outside the control cycle.
    pub(crate) const fn reaction_outside(self) -> ReactionOutside {
        match self {
            Fault::MotorHot | Fault::OtherPayload => ReactionOutside::SoftUnlessLowering,
            Fault::Overrun => ReactionOutside::Soft,
            _ => ReactionOutside::TorqueOff,
        }
    }

    /// Returns cause and remedy in one sentence for a person.
    pub const fn explanation(self) -> &'static str {
        match self {
            Fault::None => "no fault",
            Fault::RepliesLost => {
                "six cycles without all joint positions; check the CAN wiring and the pucks, then clear"
            }
            Fault::RepliesLostForLong => {
                "joint positions stayed away for 200 ms, torque was taken off; the arm may have sunk, support it before clearing"
            }
            Fault::JointLimit => "a joint left its soft limits; move it back by hand in gravity mode after clearing",
            Fault::JointSpeed => "a joint moved faster than its limit; check the primitive's duration and the payload",
            Fault::TipSpeed => {
                "elbow, forearm or hand moved faster than allowed; run the primitive more slowly or choose a longer approach"
            }
            Fault::NotFinite => "a number in the control cycle was not finite; this is a defect, keep the record",
            Fault::ImplausiblePosition => {
                "position counts jumped farther than the arm can move; check the encoder cable, then zero the arm again"
            }
            Fault::TrackingError => "the arm stayed far behind the plan; look for an obstacle or a wrong payload",
            Fault::ContactForce => "the contact force passed the stop threshold; look for an obstacle",
            Fault::SafetyDropped => "the safety module took torque away; see the pendant, activate again, then clear",
            Fault::WrenchLost => "the force sensor fell silent during a motion; check its cable",
            Fault::BusFault => "the CAN bus or a puck failed; torque was taken off, see the device log",
            Fault::Overrun => {
                "the control cycle missed its deadline too often, or the session did not come back; this is a defect, keep the record"
            }
            Fault::EncoderStuck => {
                "the counts of a motor stood still while it turned; check the encoder cable, then zero the arm again"
            }
            Fault::UnseenContact => {
                "joints and force sensor disagree on what pushes the arm or hangs on it; look for an obstacle, check what it carries, tare"
            }
            Fault::OtherPayload => {
                "the sensor or the hand answers now and did not at the start-up; support and release the arm, the bus is then started anew"
            }
            Fault::Shaking => {
                "a joint swung back and forth; check what the arm carries and the tension of its cables, calibrate, then clear"
            }
            Fault::MotorHot => {
                "a motor is hotter than 80 degrees C; release the arm and let it cool below 75, then clear"
            }
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.explanation())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_device_finds_takes_the_torque_off_but_for_three_faults_that_stop_softly() {
        let with = |reaction| Fault::ALL.into_iter().filter(move |fault| fault.reaction_outside() == reaction);
        assert!(with(ReactionOutside::Soft).eq([Fault::Overrun]));
        assert!(with(ReactionOutside::SoftUnlessLowering).eq([Fault::MotorHot, Fault::OtherPayload]));
    }
}
