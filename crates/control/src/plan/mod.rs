//! Plans of arm and hand: moves in joint space, and the run of a primitive.

pub mod approach;
pub mod bounds;
pub(crate) mod brake;
pub(crate) mod goal;
pub mod hand;
pub mod inertia;
pub(crate) mod lift;
pub mod load;
pub mod primitive;
pub mod reference;
pub(crate) mod run;

pub use approach::Approach;
pub use hand::HandMotion;
pub use reference::{HandReference, JointReference, TaskReference};
