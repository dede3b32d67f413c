//! Raw quantities of the bus, each with its unit in its type, and the two floating-point types they convert from.

use core::fmt;

/// Largest magnitude Barrett's library packs into the 14 bits of a torque: +-8191, never -8192.
pub const PACKED_TORQUE_LIMIT: i16 = 8191;

/// Width of a position on the bus in bits: +-2^21 counts, +-512 motor revolutions at 4096 counts per revolution.
pub const POSITION_BITS: u32 = 22;

/// A position in encoder counts (of the motor, or of the secondary encoder), as far as it has been unwrapped.
///
/// ```
/// use puck::Counts;
///
/// let sent = Counts(2_100_000).wrapped();
/// assert_eq!(sent.unwrapped_near(Counts(2_099_000)), Counts(2_100_000));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Counts(pub i32);

impl Counts {
    /// The low 22 bits of this position, sign extended: the value a puck sends.
    #[must_use]
    pub const fn wrapped(self) -> Counts {
        let unused = 32 - POSITION_BITS;
        Counts((self.0 << unused) >> unused)
    }

    /// The position nearest to `previous` whose 22 low bits equal those of `self`.
    ///
    /// Exact as long as the motor turned by less than 512 revolutions (at 4096 counts) since `previous`.
    #[must_use]
    pub const fn unwrapped_near(self, previous: Counts) -> Counts {
        let moved = Counts(self.0.wrapping_sub(previous.0)).wrapped();
        Counts(previous.0.wrapping_add(moved.0))
    }
}

/// A motor torque in current units of the puck ("IPNM units"), 14 bits: -8192..=8191.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PuckTorque(i16);

impl PuckTorque {
    /// No torque.
    pub const ZERO: PuckTorque = PuckTorque(0);

    /// A torque from its integer value; `None` if it does not fit into 14 bits.
    #[must_use]
    pub const fn new(units: i16) -> Option<PuckTorque> {
        if units >= -PACKED_TORQUE_LIMIT - 1 && units <= PACKED_TORQUE_LIMIT { Some(PuckTorque(units)) } else { None }
    }

    /// Barrett's rounding: saturate to +-8191, then toward minus infinity (-0.1 becomes -1).
    ///
    /// # Errors
    /// [`NotFinite`] for NaN and infinities, which the library would pass through as undefined behaviour.
    pub fn from_units<R: Real>(units: R) -> Result<PuckTorque, NotFinite> {
        if !units.is_finite() {
            return Err(NotFinite);
        }
        let limit = R::from_i32(PACKED_TORQUE_LIMIT as i32);
        let saturated = if units > limit {
            limit
        } else if units < -limit {
            -limit
        } else {
            units
        };
        Ok(PuckTorque(saturated.floor().to_i32() as i16))
    }

    /// The integer value, current units of the puck.
    #[must_use]
    pub const fn units(self) -> i16 {
        self.0
    }

    /// The low 14 bits, read as two's complement.
    pub(crate) const fn from_bits(bits: u64) -> PuckTorque {
        PuckTorque(((bits as u16) << 2) as i16 >> 2)
    }

    /// Two's complement in 14 bits.
    pub(crate) const fn bits(self) -> u64 {
        (self.0 as u16 & 0x3FFF) as u64
    }
}

/// A value that must become an integer of the bus is NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotFinite;

impl fmt::Display for NotFinite {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("value is NaN or infinite")
    }
}

impl core::error::Error for NotFinite {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// The floating-point types of the conversions: `f32` on the board, `f64` on the host. Sealed.
pub trait Real:
    sealed::Sealed
    + Copy
    + PartialOrd
    + core::ops::Add<Output = Self>
    + core::ops::Sub<Output = Self>
    + core::ops::Mul<Output = Self>
    + core::ops::Div<Output = Self>
    + core::ops::Neg<Output = Self>
{
    /// The nearest representable value.
    fn from_f64(value: f64) -> Self;
    /// The nearest representable value.
    fn from_i32(value: i32) -> Self;
    /// Toward zero, saturating; NaN becomes 0 (test `is_finite` first where that matters).
    fn to_i32(self) -> i32;
    /// Toward minus infinity.
    fn floor(self) -> Self;
    /// Neither NaN nor infinite.
    fn is_finite(self) -> bool;
}

impl Real for f32 {
    fn from_f64(value: f64) -> f32 {
        value as f32
    }
    fn from_i32(value: i32) -> f32 {
        value as f32
    }
    fn to_i32(self) -> i32 {
        self as i32
    }
    fn floor(self) -> f32 {
        libm::floorf(self)
    }
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
}

impl Real for f64 {
    fn from_f64(value: f64) -> f64 {
        value
    }
    fn from_i32(value: i32) -> f64 {
        value as f64
    }
    fn to_i32(self) -> i32 {
        self as i32
    }
    fn floor(self) -> f64 {
        libm::floor(self)
    }
    fn is_finite(self) -> bool {
        f64::is_finite(self)
    }
}
