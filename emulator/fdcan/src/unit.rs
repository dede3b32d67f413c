//! Names of the two controllers.

/// One of the two controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// FDCAN1.
    One,
    /// FDCAN2.
    Two,
}

impl Unit {
    /// Both.
    pub const BOTH: [Self; 2] = [Self::One, Self::Two];

    /// Name in the manual.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "FDCAN1",
            Self::Two => "FDCAN2",
        }
    }
}
