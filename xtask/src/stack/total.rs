//! The deepest ways of an image put together: start, service, and what a panic or a fault does last.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail, ensure};

use super::depth::{Calls, Part, Search, Stop, Way};
use super::frame::Target;
use super::levels::Layout;

/// Where an image begins.
const RESET: &str = "Reset";
/// Where Rust begins.
const MAIN: &str = "main";

/// Ways on top of each other, each with what it is.
pub(super) type Ways = Vec<(String, Way)>;

/// Bytes of all of them.
pub(super) fn sum(ways: &Ways) -> u32 {
    ways.iter().map(|(_, way)| way.bytes).sum()
}

/// An image whose functions have been followed.
pub(super) struct Image<'a> {
    pub(super) calls: &'a Calls,
    pub(super) layout: &'a Layout,
    /// The function in which every panic ends, with its own frame only.
    pub(super) plain: BTreeMap<u32, u32>,
}

impl Image<'_> {
    /// From reset until interrupts are unmasked; or then, with all that had been waiting.
    pub(super) fn start(&self) -> Result<Ways> {
        let masked = self.masked(&self.plain)?;
        let ways = vec![("with interrupts masked".to_owned(), masked)];
        let mut tail = vec![("what ends with interrupts unmasked".to_owned(), self.thread(&self.plain, Thread::Tail)?)];
        tail.extend(self.interrupts(&self.plain)?);
        Ok(if sum(&tail) > sum(&ways) { tail } else { ways })
    }

    /// The idle task with everything that may interrupt it.
    pub(super) fn service(&self) -> Result<Ways> {
        let mut ways = vec![("the idle task".to_owned(), self.thread(&self.plain, Thread::Service)?)];
        ways.extend(self.interrupts(&self.plain)?);
        Ok(ways)
    }

    /// The deepest that a panic or a fault may be.
    pub(super) fn end(&self) -> Result<Ways> {
        let last = self.panic_stop()?;
        let ends = BTreeMap::from([(self.calls.end()?, last.bytes)]);
        let start = self.start()?;
        let service = self.service()?;
        let mut all = vec![vec![("a panic at start".to_owned(), self.masked(&ends)?)]];
        // A panic at every level, above all that is below it.
        let thread = ("a panic in the idle task".to_owned(), self.thread(&ends, Thread::Service)?);
        let panics: Ways = std::iter::once(thread).chain(self.interrupts(&ends)?).collect();
        for (level, panic) in panics.into_iter().enumerate() {
            let mut ways: Ways = service.iter().take(level).cloned().collect();
            ways.push(panic);
            all.push(ways);
        }
        let fault = self.fault()?;
        for mut ways in [start, service] {
            ways.push(fault.clone());
            all.push(ways);
        }
        let mut deepest = all.into_iter().max_by_key(sum).unwrap_or_default();
        deepest.push(("of which the last words of a panic".to_owned(), Way { bytes: 0, stops: last.stops }));
        Ok(deepest)
    }

    /// The deepest handler of every level.
    fn interrupts(&self, ends: &BTreeMap<u32, u32>) -> Result<Ways> {
        let mut ways = Vec::new();
        for level in self.layout.levels {
            let mut deepest = Way::default();
            for handler in level.handlers {
                let way = self.deepest(self.calls.address(handler)?, Part::Whole, ends)?;
                if way.bytes >= deepest.bytes {
                    deepest = way;
                }
            }
            deepest.bytes += self.layout.exception;
            let what = format!("priority {}, {} B for the exception", level.priority, self.layout.exception);
            ways.push((what, deepest));
        }
        Ok(ways)
    }

    /// The deepest handler that never returns.
    fn fault(&self) -> Result<(String, Way)> {
        let mut deepest = Way::default();
        for handler in self.layout.ends {
            let way = self.deepest(self.calls.address(handler)?, Part::Whole, &self.plain)?;
            if way.bytes >= deepest.bytes {
                deepest = way;
            }
        }
        deepest.bytes += self.layout.exception;
        Ok((format!("a fault, {} B for the exception", self.layout.exception), deepest))
    }

    /// The start as far as interrupts are masked.
    fn masked(&self, ends: &BTreeMap<u32, u32>) -> Result<Way> {
        self.deepest(self.calls.address(RESET)?, Part::Masked, ends)
    }

    /// The deepest way from a function, when the start has been.
    pub(super) fn deepest(&self, function: u32, part: Part, ends: &BTreeMap<u32, u32>) -> Result<Way> {
        self.deepest_after(&[], function, part, ends)
    }

    /// The same, when other functions have begun as well.
    fn deepest_after(&self, begun: &[u32], function: u32, part: Part, ends: &BTreeMap<u32, u32>) -> Result<Way> {
        let main = self.calls.frame(self.calls.address(MAIN)?).map(|main| main.calls.as_slice()).unwrap_or_default();
        let started = main.iter().filter(|call| !call.unmasked).filter_map(|call| match call.target {
            Target::Function(to) => Some(to),
            Target::Pointer => None,
        });
        let before: Vec<u32> = started.chain(begun.iter().copied()).collect();
        Search::new(self.calls, function, &before, ends.clone()).deepest(function, part)
    }

    /// Last actions of a panic.
    fn panic_stop(&self) -> Result<Way> {
        let end = self.calls.end()?;
        let frame = self.calls.frame(end).context("the end of a panic has no frame")?;
        let mut deepest = Way { bytes: frame.bytes, stops: Vec::new() };
        for call in &frame.calls {
            let Target::Function(to) = call.target else { bail!("the end of a panic calls through a pointer") };
            let mut way = self.deepest_after(&[end], to, Part::Whole, &self.plain)?;
            way.bytes += call.depth;
            way.stops.insert(0, Stop { function: self.calls.name(end), bytes: call.depth });
            if way.bytes >= deepest.bytes {
                deepest = way;
            }
        }
        Ok(deepest)
    }

    /// Code that runs with interrupts unmasked: the end of the start, or the service.
    fn thread(&self, ends: &BTreeMap<u32, u32>, thread: Thread) -> Result<Way> {
        let (reset, main) = (self.calls.address(RESET)?, self.calls.address(MAIN)?);
        let frame = |address| self.calls.frame(address).context("a function has no frame");
        let to_main = frame(reset)?.calls.iter().find(|call| call.target == Target::Function(main));
        let below = to_main.with_context(|| format!("{RESET} does not call {MAIN}"))?.depth;
        let main_frame = frame(main)?;
        ensure!(self.calls.unmasks(main), "{MAIN} never unmasks interrupts: its service cannot be told from its start");
        let own = match thread {
            Thread::Tail => 0,
            Thread::Service => main_frame.unmasked.unwrap_or(0),
        };
        let stops =
            |at| vec![Stop { function: RESET.to_owned(), bytes: below }, Stop { function: MAIN.to_owned(), bytes: at }];
        let mut deepest = Way { bytes: below + own, stops: stops(own) };
        for call in &main_frame.calls {
            let Target::Function(to) = call.target else { bail!("{MAIN} calls through a pointer") };
            let part = match thread {
                Thread::Tail if !call.unmasked && self.calls.unmasks(to) => Part::Unmasked,
                Thread::Service if call.unmasked => Part::Whole,
                _ => continue,
            };
            let way = self.deepest(to, part, ends)?;
            let bytes = below + call.depth + way.bytes;
            if bytes > deepest.bytes {
                deepest = Way { bytes, stops: stops(call.depth).into_iter().chain(way.stops).collect() };
            }
        }
        Ok(deepest)
    }
}

/// Code that runs with interrupts unmasked.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Thread {
    /// The functions of the start that have unmasked them and not returned yet.
    Tail,
    /// Everything after that.
    Service,
}
