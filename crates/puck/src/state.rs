//! Values of STAT, MODE and ROLE.

/// STAT: what a puck is running.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Status {
    /// 0: the boot loader ("monitor"); only properties 0..=7 answer.
    Reset,
    /// 1: error.
    Error,
    /// 2: the main firmware.
    Ready,
}

impl Status {
    /// From the value of STAT; `None` for a value that no document names.
    #[must_use]
    pub const fn from_value(value: i32) -> Option<Status> {
        match value {
            0 => Some(Status::Reset),
            1 => Some(Status::Error),
            2 => Some(Status::Ready),
            _ => None,
        }
    }

    /// The value of STAT. Setting `Ready` wakes a puck, setting `Reset` reboots it into the monitor.
    #[must_use]
    pub const fn value(self) -> i32 {
        self as i32
    }
}

/// MODE of a motor puck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum MotorMode {
    /// 0: windings shorted, the motor brakes; torques are ignored.
    Idle,
    /// 1: open-loop duty cycle.
    Duty,
    /// 2: torque commands are applied. Set by the safety module, never by us.
    Torque,
    /// 3: the puck's own position controller (PID).
    Position,
    /// 4: velocity commands.
    Velocity,
    /// 5: trapezoidal move to E.
    Trapezoidal,
}

impl MotorMode {
    /// From the value of MODE; `None` for a value that no document names.
    #[must_use]
    pub const fn from_value(value: i32) -> Option<MotorMode> {
        match value {
            0 => Some(MotorMode::Idle),
            1 => Some(MotorMode::Duty),
            2 => Some(MotorMode::Torque),
            3 => Some(MotorMode::Position),
            4 => Some(MotorMode::Velocity),
            5 => Some(MotorMode::Trapezoidal),
            _ => None,
        }
    }

    /// The value of MODE.
    #[must_use]
    pub const fn value(self) -> i32 {
        self as i32
    }
}

/// ROLE: the low five bits say what a puck is, the high bits what it is fitted with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Role(pub u16);

impl Role {
    /// Kind of an arm motor puck.
    pub const MOTOR: u16 = 0;
    /// Kind of a safety module.
    pub const SAFETY: u16 = 2;
    /// Kind of a hand puck.
    pub const HAND: u16 = 5;
    /// Kind of a force/torque sensor.
    pub const FORCE_TORQUE: u16 = 6;
    /// Option of a motor puck with a magnetic encoder on its serial input: from VERS 118 on MECH is an absolute angle.
    pub const ABSOLUTE_ANGLE: u16 = 0x0100;

    /// From the value of ROLE: the low 16 bits.
    #[must_use]
    pub const fn from_value(value: i32) -> Role {
        Role(value as u16)
    }

    /// The low five bits: 0 motor, 1 gimbals, 2 safety, 3 wraptor, 4 trigger, 5 hand, 6 force/torque.
    #[must_use]
    pub const fn kind(self) -> u16 {
        self.0 & 0x1F
    }

    /// 0x0100, 0x0200, 0x0400: an absolute magnetic encoder, on the serial, Hall or encoder input.
    #[must_use]
    pub const fn has_magnetic_encoder(self) -> bool {
        self.0 & 0x0700 != 0
    }

    /// [`Role::ABSOLUTE_ANGLE`].
    #[must_use]
    pub const fn has_absolute_angle(self) -> bool {
        self.0 & Self::ABSOLUTE_ANGLE != 0
    }

    /// 0x0800: strain gauge.
    #[must_use]
    pub const fn has_strain_gauge(self) -> bool {
        self.0 & 0x0800 != 0
    }

    /// 0x1000: tactile array (by the library; one driver reads this bit as the inertial unit).
    #[must_use]
    pub const fn has_tactile_array(self) -> bool {
        self.0 & 0x1000 != 0
    }

    /// 0x4000: optical (joint) encoder: position replies carry a secondary position.
    #[must_use]
    pub const fn has_joint_encoder(self) -> bool {
        self.0 & 0x4000 != 0
    }
}
