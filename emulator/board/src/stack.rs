//! Depth of stack that was used, from the paint that nothing has overwritten: the image's own paint at start-up, ours
//! in service.

use std::ops::Range;

use rigless::emulator::Host;
use rigless::soc::Width;

use crate::core::SERVICE_PAINT;

/// Word with which the image fills its stack before main.
const START_PAINT: u32 = 0xCCCC_CCCC;

/// Bytes used at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StackUse {
    /// From the start to the first frame on the bus.
    pub at_start: Option<u32>,
    /// Since then.
    pub in_service: Option<u32>,
    /// Since the start.
    pub ever: u32,
}

/// The lowest address of the stack that holds neither paint, or its end.
fn deepest(host: &mut dyn Host, stack: &Range<u32>, paints: &[u32]) -> u32 {
    (stack.start..stack.end)
        .step_by(4)
        .find(|address| {
            let word = host.read(u64::from(*address), Width::W32).unwrap_or(0) as u32;
            !paints.contains(&word)
        })
        .unwrap_or(stack.end)
}

/// Bytes used since the image painted its stack.
pub fn used_since_start(host: &mut dyn Host, stack: &Range<u32>) -> u32 {
    stack.end - deepest(host, stack, &[START_PAINT])
}

/// Bytes used since the service paint was put on.
pub fn used_in_service(host: &mut dyn Host, stack: &Range<u32>) -> u32 {
    stack.end - deepest(host, stack, &[START_PAINT, SERVICE_PAINT])
}
