//! Builds what is too large for a stack in a box.

use pinned_init::{InPlaceWrite, Init};

/// Runs an initialiser in a box.
pub fn boxed<T>(init: impl Init<T>) -> Box<T> {
    let Ok(value) = Box::new_uninit().write_init(init);
    value
}
