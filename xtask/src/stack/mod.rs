//! Stack depth of an image, computed from its instructions: every function's frame, every call, every
//! interrupt that may come on top.
//!
//! Two figures. *At start*: from reset until the idle task, with interrupts masked but for the very end. *In service*:
//! the idle task, and on top of it the deepest handler of every priority. In both, what a panic or a fault does last is
//! counted apart: it comes once, on top of everything, and only has to fit.

mod condition;
mod depth;
mod frame;
mod levels;
mod memory;
mod pointers;
mod priorities;
mod step;
#[cfg(test)]
mod tests;
mod total;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use link::metadata::{ImageMetadata, METADATA_SECTION};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

use crate::code::Code;
use crate::elf::Elf;
use crate::shell;
use depth::{Calls, Part, Stop, Way};
use levels::Layout;
use memory::Memory;
use pointers::KINDS;
use total::{Image, Ways, sum};

/// Share of the stack that the start-up may take.
pub(crate) const START_PERCENT: u32 = 60;
/// Share of the stack that the service may take.
const SERVICE_PERCENT: u32 = 40;

/// Both ends of the stack, as the linker places them.
const STACK: [&str; 2] = ["_stack_end", "_stack_start"];
/// Functions in the list of the largest frames.
const LARGEST: usize = 25;

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
    /// Number of functions of each kind that a pointer may lead to; last those of none.
    behind_pointers: Vec<usize>,
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
            let most = share(self.size, percent);
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

    /// The figures in a few words.
    pub(crate) fn summary(&self) -> String {
        format!("{} B at start, {} B in service, computed", self.at_start(), self.in_service())
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
        for (name, ways) in table
            .map(|(name, ways, _)| (name, ways))
            .into_iter()
            .chain(self.other.iter().map(|(_, ways)| ("emergency", ways)))
        {
            println!("\n{name}:");
            for (what, way) in ways {
                println!("{:>9} B  {what}", way.bytes);
                for Stop { function, bytes } in &way.stops {
                    println!("           {bytes:>7}  {function}");
                }
            }
        }
        println!("\nfunctions behind pointers:");
        for (kind, count) in KINDS.iter().zip(&self.behind_pointers) {
            let nested = kind.nested.map_or(String::new(), |nested| format!(", {nested} inside one another"));
            println!("{count:>9}    {}{nested}: {}", kind.name, kind.why);
        }
        println!(
            "{:>9}    others: any call through a pointer that is not listed",
            self.behind_pointers.last().unwrap_or(&0)
        );
        println!("\nlargest frames:");
        for Stop { function, bytes } in self.largest.iter().take(LARGEST) {
            println!("{bytes:>9} B  {function}");
        }
    }
}

/// A share of some bytes.
pub(crate) const fn share(bytes: u32, percent: u32) -> u32 {
    (bytes as u64 * percent as u64 / 100) as u32
}

/// Fails if an image needs more stack than it may; says in a line what it needs.
///
/// # Errors
/// All that is against the rules.
pub(crate) fn check(image: &Path) -> Result<()> {
    let depth = Depth::of(image)?;
    let faults = depth.faults();
    ensure!(
        faults.is_empty(),
        "{}\nTo see every way: cargo xtask stack --image {}",
        faults.join("\n"),
        image.display()
    );
    shell::note(&format!("stack: {}, of {} B", depth.summary(), depth.size));
    Ok(())
}

/// Computes and prints the depth of every image, and fails if one is too deep or a row of the list of pointers means
/// nothing in any of them.
///
/// # Errors
/// Of the images as [`check`].
pub(crate) fn table(images: &[PathBuf]) -> Result<()> {
    let mut idle = vec![true; KINDS.len()];
    let mut results = Vec::new();
    for image in images {
        let depth = Depth::of(image)?;
        for (idle, count) in idle.iter_mut().zip(&depth.behind_pointers) {
            *idle &= *count == 0;
        }
        depth.print();
        println!();
        results.push(check(image));
    }
    let idle: Vec<&str> = KINDS.iter().zip(idle).filter(|(_, idle)| *idle).map(|(kind, _)| kind.name).collect();
    ensure!(idle.is_empty(), "no image has functions behind pointers of these kinds: {}", idle.join("; "));
    results.into_iter().collect()
}

/// Computes and prints the depth of an image, and fails if it is too deep.
///
/// # Errors
/// As [`check`].
pub(crate) fn run(image: &Path) -> Result<()> {
    Depth::of(image)?.print();
    check(image)
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
    let code = Code::of(file)?;
    let stored = priorities::stored(&code, &memory);
    let calls = Calls::of(code, &memory)?;
    calls.check_nesting()?;
    layout.check(&calls, memory.vectors(), &stored)?;
    let [end, begin] = [symbol(STACK[0])?, symbol(STACK[1])?];
    let size = begin.checked_sub(end).context("the stack ends above its beginning")?;
    let mut image = Image { calls: &calls, layout, plain: BTreeMap::new() };
    image.plain = BTreeMap::from([(calls.end()?, calls.until_masked(calls.end()?)?)]);
    let other = match &layout.other {
        Some(other) => {
            let mut deepest = Way::default();
            for name in other.handlers {
                let handler = calls.address(name)?;
                let takes = calls.frame(handler).and_then(|frame| frame.other_stack);
                ensure!(takes == Some(symbol(other.top)?), "{name} does not take the stack {}", other.top);
                let way = image.deepest(handler, Part::Whole, &image.plain)?;
                if way.bytes >= deepest.bytes {
                    deepest = way;
                }
            }
            Some((other.bytes, vec![("a handler with a stack of its own".to_owned(), deepest)]))
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
        behind_pointers: calls.behind_pointers(),
    })
}
