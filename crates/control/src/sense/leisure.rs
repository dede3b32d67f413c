//! `Leisure`: what can wait takes turns with the renewal of the mass matrix, so that no cycle has to do all of it.

/// Work for which a control period leaves time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leisure {
    /// Nothing: the mass matrix is gathered.
    None,
    /// Rates of the other joints instead of one that is at its limit.
    Limits,
    /// The part of the speed limits that is left to a goal on its way.
    Goal,
}
