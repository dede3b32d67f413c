//! `WeightCorrection`: by how much the links of one arm weigh otherwise than the model says, and where.
//!
//! Link j of the model has mass `m` and centre of mass `c`. With a share `s` and a shift `e` it has
//!
//! ```text
//! m' = m (1 + s)        m' c' = m (1 + s) c + m e        I' = I (1 + s)
//! ```
//! Gravity torque is linear in mass and first moment, hence in `s` and `e`, which a calibration regresses. The inertia
//! about the centre of mass keeps its shape, so that every corrected body is one that can exist. The correction is
//! folded into the model when it is built: a control cycle computes what it computed before.

use core::fmt;

use crate::model::calibration::Payload;
use crate::model::wam7::BodyTable;
use crate::units::JOINTS;

/// Largest share by which a link may be heavier or lighter than the model's. Published generations of links differ by
/// up to 15 %; more is a held object, or an arm that leans on something.
pub const MASS_SHARE: f32 = 0.5;

/// Largest shift of a link's first moment, in metres of its model mass, along one axis.
pub const MOMENT_SHIFT: f32 = 0.05;

/// Correction of one link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkWeight {
    /// Mass beyond the model's, as a share of it.
    pub share: f32,
    /// Shift of the first moment in the link frame, as a share of the model's mass (m).
    pub shift: [f32; 3],
}

/// Corrections of the seven links, for the payload they were measured with: the last link carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightCorrection {
    payload: Payload,
    links: [LinkWeight; JOINTS],
}

/// Reason for which a number of a correction is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum WeightFault {
    /// It is not a number.
    NotANumber = 0,
    /// The mass differs by more than [`MASS_SHARE`].
    Mass = 1,
    /// The first moment is shifted by more than [`MOMENT_SHIFT`].
    Moment = 2,
}

/// Why a correction cannot be that of an arm: the first link that is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WeightError {
    /// Which link, 0 for the one that J1 turns.
    pub link: u8,
    /// Description.
    pub fault: WeightFault,
}

impl WeightError {
    /// The error as it goes over the link: link, reason.
    #[must_use]
    pub fn detail(self) -> [u32; 2] {
        [self.link.into(), self.fault as u32]
    }

    /// The error that such a detail stands for; `None` for numbers of another version.
    #[must_use]
    pub fn from_detail([link, fault]: [u32; 2]) -> Option<Self> {
        let link = u8::try_from(link).ok().filter(|link| usize::from(*link) < JOINTS)?;
        let faults = [WeightFault::NotANumber, WeightFault::Mass, WeightFault::Moment];
        let fault = faults.into_iter().find(|known| *known as u32 == fault)?;
        Some(Self { link, fault })
    }
}

impl fmt::Display for WeightError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "link {}: ", self.link + 1)?;
        match self.fault {
            WeightFault::NotANumber => f.write_str("the correction is not a number"),
            WeightFault::Mass => {
                write!(f, "its mass would be more than {:.0} % beside the model's", MASS_SHARE * 100.0)
            }
            WeightFault::Moment => {
                write!(f, "its centre of mass would be more than {:.0} mm beside the model's", MOMENT_SHIFT * 1e3)
            }
        }
    }
}

impl core::error::Error for WeightError {}

impl WeightCorrection {
    /// No correction: the arm of the model.
    #[must_use]
    pub const fn none(payload: Payload) -> Self {
        Self { payload, links: [LinkWeight { share: 0.0, shift: [0.0; 3] }; JOINTS] }
    }

    /// Checks the corrections of an arm with this payload.
    ///
    /// # Errors
    /// [`WeightError`] names the first link that no arm can have.
    pub fn new(payload: Payload, links: [LinkWeight; JOINTS]) -> Result<Self, WeightError> {
        for (link, LinkWeight { share, shift }) in (0_u8..).zip(&links) {
            let fault = if !share.is_finite() || !shift.iter().all(|shift| shift.is_finite()) {
                WeightFault::NotANumber
            } else if share.abs() > MASS_SHARE {
                WeightFault::Mass
            } else if shift.iter().any(|shift| shift.abs() > MOMENT_SHIFT) {
                WeightFault::Moment
            } else {
                continue;
            };
            return Err(WeightError { link, fault });
        }
        Ok(Self { payload, links })
    }

    /// The payload it was measured with; on an arm with another one it changes nothing.
    #[must_use]
    pub fn payload(&self) -> Payload {
        self.payload
    }

    /// The links, the one that J1 turns first.
    #[must_use]
    pub fn links(&self) -> &[LinkWeight; JOINTS] {
        &self.links
    }

    /// These bodies, the last one with its payload, as this arm has them.
    pub(crate) fn apply(&self, bodies: &mut [BodyTable; JOINTS]) {
        for (body, LinkWeight { share, shift }) in bodies.iter_mut().zip(&self.links) {
            let factor = 1.0 + f64::from(*share);
            body.mass *= factor;
            body.inertia = body.inertia.map(|entry| entry * factor);
            for (centre, shift) in body.centre.iter_mut().zip(shift) {
                *centre += f64::from(*shift) / factor;
            }
        }
    }
}
