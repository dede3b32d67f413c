//! A pause of the keeper: others have work to do.

use core::future::poll_fn;
use core::task::Poll;

/// Lets the caller do something else.
pub(super) async fn pause() {
    let mut paused = false;
    poll_fn(|_| {
        if paused {
            return Poll::Ready(());
        }
        paused = true;
        Poll::Pending
    })
    .await;
}
