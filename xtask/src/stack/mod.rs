//! How deep the stack of an image goes, computed from its instructions: every function's frame, every call, every interrupt
//! that may come on top.
//!
//! Two figures. *At start*: from reset until the idle task, with interrupts masked but for the very end. *In service*: the
//! idle task, and on top of it the deepest handler of every priority. In both, what a panic or a fault does last is counted
//! apart: it comes once, on top of everything, and only has to fit.

mod depth;
mod frame;
mod levels;
mod memory;
mod pointers;
mod step;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use link::metadata::{ImageMetadata, METADATA_SECTION};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

use crate::code::Code;
use crate::elf::Elf;
use crate::shell;
use depth::{Calls, Part, Search, Stop, Way};
use levels::Layout;
use memory::Memory;

/// Share of the stack that the start-up may take.
const START_PERCENT: u32 = 60;
/// Share of the stack that the service may take.
const SERVICE_PERCENT: u32 = 40;

/// Where an image begins.
const RESET: &str = "Reset";
/// Where Rust begins.
const MAIN: &str = "main";
/// Both ends of the stack, as the linker places them.
const STACK: [&str; 2] = ["_stack_end", "_stack_start"];
/// Functions in the list of the largest frames.
const LARGEST: usize = 25;

/// A way, and what comes on top of it, each with what it is.
type Ways = Vec<(String, Way)>;

/// The stack of an image.
pub(crate) struct Depth {
    board: &'static str,
    /// Bytes there are.
    size: u32,
    guard: Option<u32>,
    start: Ways,
    service: Ways,
    /// With what a panic or a fault does last.
    end: Ways,
    /// The stack of its own that one handler has, with its size.
    other: Option<(u32, Ways)>,
    largest: Vec<Stop>,
}

impl Depth {
    /// Computes the depth of an image.
    ///
    /// # Errors
    /// If it cannot be read, or has what cannot be followed; all of it is named.
    pub(crate) fn of(image: &Path) -> Result<Self> {
        let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
        let computed = Elf::parse(&*file).map_err(anyhow::Error::from).and_then(|file| of(&file));
        computed.with_context(|| format!("the depth of the stack of {}", image.display()))
    }

    /// Bytes at start.
    pub(crate) fn at_start(&self) -> u32 {
        sum(&self.start)
    }

    /// Bytes in service.
    pub(crate) fn in_service(&self) -> u32 {
        sum(&self.service)
    }

    /// Everything that is against the rules.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let mut bound = |what: &str, bytes: u32, percent: u32| {
            let most = self.size / 100 * percent + self.size % 100 * percent / 100;
            if bytes > most {
                faults.push(format!("{what} {bytes} B of stack, more than {percent} % of {} B ({most} B)", self.size));
            }
        };
        bound("the start takes", self.at_start(), START_PERCENT);
        bound("the service takes", self.in_service(), SERVICE_PERCENT);
        bound("with the last words it takes", sum(&self.end), 100);
        if let Some((size, ways)) = &self.other
            && sum(ways) > *size
        {
            faults.push(format!("the emergency takes {} B of its own stack of {size} B", sum(ways)));
        }
        for Stop { function, bytes } in &self.largest {
            if let Some(guard) = self.guard.filter(|guard| bytes > guard) {
                faults.push(format!("{function} has a frame of {bytes} B: it may step over the guard of {guard} B"));
            }
        }
        faults
    }

    /// Fails if the image needs more stack than it may.
    ///
    /// # Errors
    /// All that is against the rules, with the ways that lead there.
    pub(crate) fn check(&self) -> Result<()> {
        let faults = self.faults();
        if faults.is_empty() {
            let Self { size, .. } = self;
            shell::note(&format!("stack: {} B at start, {} B in service, of {size} B", self.at_start(), self.in_service()));
            return Ok(());
        }
        bail!("{}\nTo see every way: cargo xtask stack --image FILE", faults.join("\n"))
    }

    /// Prints the figures and the ways.
    pub(crate) fn print(&self) {
        let guard = self.guard.map_or("no guard".to_owned(), |guard| format!("guard {guard} B"));
        println!("stack of {}: {} B, {guard}", self.board, self.size);
        let share = |ways: &Ways| 100.0 * f64::from(sum(ways)) / f64::from(self.size);
        let table = [
            ("at start", &self.start, START_PERCENT),
            ("in service", &self.service, SERVICE_PERCENT),
            ("with last words", &self.end, 100),
        ];
        for (name, ways, percent) in table {
            println!("{name:<16} {:>7} B  {:>5.1} %  (at most {percent} %)", sum(ways), share(ways));
        }
        if let Some((size, ways)) = &self.other {
            println!("{:<16} {:>7} B  of {size} B on a stack of its own", "emergency", sum(ways));
        }
        for (name, ways) in table.map(|(name, ways, _)| (name, ways)).into_iter().chain(self.other.iter().map(|(_, ways)| ("emergency", ways))) {
            println!("\n{name}:");
            for (what, way) in ways {
                println!("{:>9} B  {what}", way.bytes);
                for Stop { function, bytes } in &way.stops {
                    println!("           {bytes:>7}  {function}");
                }
            }
        }
        println!("\nlargest frames:");
        for Stop { function, bytes } in self.largest.iter().take(LARGEST) {
            println!("{bytes:>9} B  {function}");
        }
    }
}

fn sum(ways: &Ways) -> u32 {
    ways.iter().map(|(_, way)| way.bytes).sum()
}

/// Computes and prints the depth of an image, and fails if it is too deep.
pub(crate) fn run(image: &Path) -> Result<()> {
    let depth = Depth::of(image)?;
    depth.print();
    depth.check()
}

fn of(file: &Elf<'_>) -> Result<Depth> {
    let description = file.section_by_name(METADATA_SECTION).map(|section| section.data()).transpose()?;
    let description = description.context("the image does not say for which board it is")?;
    let layout = Layout::of(ImageMetadata::decode(description).map_err(|error| anyhow::anyhow!("{error}"))?.board)?;
    let symbol = |name: &str| -> Result<u32> {
        let found = file.symbols().find(|symbol| symbol.name() == Ok(name));
        Ok(found.with_context(|| format!("the image has no symbol '{name}'"))?.address() as u32)
    };
    let memory = Memory::of(file)?;
    let calls = Calls::of(Code::of(file)?, &memory)?;
    layout.check(&calls, memory.vectors())?;
    let [end, begin] = [symbol(STACK[0])?, symbol(STACK[1])?];
    let size = begin.checked_sub(end).context("the stack ends above its beginning")?;
    let mut image = Image { calls: &calls, layout, plain: BTreeMap::new() };
    image.plain = BTreeMap::from([(calls.end()?, calls.frame(calls.end()?).map_or(0, |frame| frame.bytes))]);
    let other = match &layout.other {
        Some(other) => {
            let handler = calls.address(other.handler)?;
            let takes = calls.frame(handler).and_then(|frame| frame.other_stack);
            ensure!(takes == Some(symbol(other.top)?), "{} does not take the stack {}", other.handler, other.top);
            let way = Search::new(&calls, image.plain.clone()).deepest(handler, Part::Whole)?;
            Some((other.bytes, vec![("the handler".to_owned(), way)]))
        }
        None => None,
    };
    Ok(Depth {
        board: layout.board,
        size,
        guard: layout.guard,
        start: image.start()?,
        service: image.service()?,
        end: image.end()?,
        other,
        largest: calls.largest(),
    })
}

/// An image whose functions have been followed.
struct Image<'a> {
    calls: &'a Calls,
    layout: &'a Layout,
    /// The function in which every panic ends, with its own frame only.
    plain: BTreeMap<u32, u32>,
}

impl Image<'_> {
    /// From reset until interrupts are unmasked; or then, with all that had been waiting.
    fn start(&self) -> Result<Ways> {
        let masked = self.masked(&self.plain)?;
        let ways = vec![("with interrupts masked".to_owned(), masked)];
        let mut tail = vec![("what ends with interrupts unmasked".to_owned(), self.thread(&self.plain, Thread::Tail)?)];
        tail.extend(self.interrupts(&self.plain)?);
        Ok(if sum(&tail) > sum(&ways) { tail } else { ways })
    }

    fn service(&self) -> Result<Ways> {
        let mut ways = vec![("the idle task".to_owned(), self.thread(&self.plain, Thread::Service)?)];
        ways.extend(self.interrupts(&self.plain)?);
        Ok(ways)
    }

    /// The deepest that a panic or a fault may be.
    fn end(&self) -> Result<Ways> {
        let last = self.last_words()?;
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
        let mut search = Search::new(self.calls, ends.clone());
        let mut ways = Vec::new();
        for level in self.layout.levels {
            let mut deepest = Way::default();
            for handler in level.handlers {
                let way = search.deepest(self.calls.address(handler)?, Part::Whole)?;
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
        let mut search = Search::new(self.calls, self.plain.clone());
        let mut deepest = Way::default();
        for handler in self.layout.ends {
            let way = search.deepest(self.calls.address(handler)?, Part::Whole)?;
            if way.bytes >= deepest.bytes {
                deepest = way;
            }
        }
        deepest.bytes += self.layout.exception;
        Ok((format!("a fault, {} B for the exception", self.layout.exception), deepest))
    }

    /// The start as far as interrupts are masked.
    fn masked(&self, ends: &BTreeMap<u32, u32>) -> Result<Way> {
        Search::new(self.calls, ends.clone()).deepest(self.calls.address(RESET)?, Part::Masked)
    }

    /// What a panic does last.
    fn last_words(&self) -> Result<Way> {
        let end = self.calls.end()?;
        let frame = self.calls.frame(end).context("the end of a panic has no frame")?;
        let mut search = Search::new(self.calls, self.plain.clone());
        let mut deepest = Way { bytes: frame.bytes, stops: Vec::new() };
        for call in &frame.calls {
            let frame::Target::Function(to) = call.target else { bail!("the end of a panic calls through a pointer") };
            let mut way = search.deepest(to, Part::Whole)?;
            way.bytes += call.depth;
            way.stops.insert(0, Stop { function: self.calls.name(end), bytes: call.depth });
            if way.bytes >= deepest.bytes {
                deepest = way;
            }
        }
        Ok(deepest)
    }

    /// What runs with interrupts unmasked: the end of the start, or the service.
    fn thread(&self, ends: &BTreeMap<u32, u32>, thread: Thread) -> Result<Way> {
        let (reset, main) = (self.calls.address(RESET)?, self.calls.address(MAIN)?);
        let frame = |address| self.calls.frame(address).context("a function has no frame");
        let to_main = frame(reset)?.calls.iter().find(|call| call.target == frame::Target::Function(main));
        let below = to_main.with_context(|| format!("{RESET} does not call {MAIN}"))?.depth;
        let main_frame = frame(main)?;
        ensure!(self.calls.unmasks(main), "{MAIN} never unmasks interrupts: its service cannot be told from its start");
        let own = match thread {
            Thread::Tail => 0,
            Thread::Service => main_frame.unmasked.unwrap_or(0),
        };
        let stops = |at| vec![Stop { function: RESET.to_owned(), bytes: below }, Stop { function: MAIN.to_owned(), bytes: at }];
        let mut deepest = Way { bytes: below + own, stops: stops(own) };
        let mut search = Search::new(self.calls, ends.clone());
        for call in &main_frame.calls {
            let frame::Target::Function(to) = call.target else { bail!("{MAIN} calls through a pointer") };
            let part = match thread {
                Thread::Tail if !call.unmasked && self.calls.unmasks(to) => Part::Unmasked,
                Thread::Service if call.unmasked => Part::Whole,
                _ => continue,
            };
            let way = search.deepest(to, part)?;
            let bytes = below + call.depth + way.bytes;
            if bytes > deepest.bytes {
                deepest = Way { bytes, stops: stops(call.depth).into_iter().chain(way.stops).collect() };
            }
        }
        Ok(deepest)
    }
}

/// What runs with interrupts unmasked.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Thread {
    /// The functions of the start that have unmasked them and not returned yet.
    Tail,
    /// Everything after that.
    Service,
}
