//! Builds a large value where it shall stay: it never passes through the stack of a small processor.

use core::convert::Infallible;
use core::mem::MaybeUninit;

use pinned_init::Init;

/// Makes a value and keeps it in `place`.
///
/// For a value that a small stack bears once. Not inlined: the frame in which the value is made is gone when this
/// returns.
#[inline(never)]
pub fn keep<T>(place: &'static mut MaybeUninit<T>, make: impl FnOnce() -> T) -> &'static mut T {
    place.write(make())
}

/// Fills `place` and returns what is in it now.
///
/// Not inlined: the frame that the compiler may need meanwhile is gone when this returns.
#[inline(never)]
pub fn build<T>(place: &'static mut MaybeUninit<T>, init: impl Init<T>) -> &'static mut T {
    // SAFETY: the pointer is valid for writes and aligned, since it comes from a unique reference, and nobody else sees
    // the place before this function returns.
    let done: Result<(), Infallible> = unsafe { init.__init(place.as_mut_ptr()) };
    let Ok(()) = done;
    // SAFETY: an initialiser that returned `Ok` has filled every field.
    unsafe { place.assume_init_mut() }
}
