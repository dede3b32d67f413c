//! The joint image: built for a Cortex-M3, measured under QEMU, held against the part it is for.
//!
//! What is counted are instructions: one tick of the image's clock is five. A Cortex-M3 needs more than one clock for some of them
//! (docs/joint.md), which is why the bound is half a cycle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::elf::Sizes;
use crate::setup::{JOINT, Machine};
use crate::{build, shell};

/// The part the figures are held against: STM32F105RC, 72 MHz, two CAN controllers.
const PART: &str = "STM32F105RC";
const PART_FLASH: u32 = 256 * 1024;
const PART_RAM: u32 = 64 * 1024;

/// Stack that must be left.
const STACK_RESERVE: u32 = 16 * 1024;

/// Handler of the control slots: everything it reaches must compute in integers.
const CONTROL_HANDLER: &str = "SLOT_TIMER";

/// Handler of the session's task, where numbers become real ones.
const SESSION_HANDLER: &str = "DISPATCH_SESSION";

/// Functions of the compiler's library that compute with floating-point numbers begin so.
const FLOATING: [&str; 2] = ["__aeabi_f", "__aeabi_d"];

/// Builds the joint image; returns the path under which the host tools look for it.
pub(crate) fn image(machine: &Machine) -> Result<PathBuf> {
    shell::step("building the joint image for QEMU's mps2-an385");
    let mut cargo = machine.toolchain.cargo("build", JOINT)?;
    let features = if machine.qemu.may_sleep() { "board-mps2,wfi" } else { "board-mps2" };
    cargo.args(["--package", "firmware", "--bin", "joint", "--profile", "firmware"]).args([
        "--no-default-features",
        "--features",
        features,
    ]);
    shell::run(&mut cargo)?;
    let built = machine.toolchain.output(JOINT, "firmware").join("joint");
    let folder = shell::target_dir().join("images");
    fs::create_dir_all(&folder)?;
    let image = folder.join("joint.elf");
    fs::copy(&built, &image).with_context(|| format!("cannot copy {}", built.display()))?;
    shell::note(&format!("image: {}", image.display()));
    check(&image)?;
    Ok(image)
}

/// Prints what the image takes, and fails where it does not fit its part or where its control path computes with real numbers.
pub(crate) fn check(image: &Path) -> Result<()> {
    let sizes = Sizes::of(image)?;
    let (flash, ram) = (sizes.flash(), sizes.ram());
    println!("memory             taken     of {PART}");
    println!("flash           {flash:>8} B  {PART_FLASH:>8} B  {:>5.1} %", percent(flash, PART_FLASH));
    println!("RAM, no stack   {ram:>8} B  {PART_RAM:>8} B  {:>5.1} %", percent(ram, PART_RAM));
    println!("stack           {:>8} B  is left", PART_RAM.saturating_sub(ram));
    ensure!(flash <= PART_FLASH, "the image does not fit the flash of an {PART}");
    ensure!(ram + STACK_RESERVE <= PART_RAM, "the image leaves less than {STACK_RESERVE} B of stack on an {PART}");
    let calls = Calls::of(image)?;
    let path = calls.floating_path(CONTROL_HANDLER)?;
    ensure!(path.is_empty(), "the control path computes with floating-point numbers: {}", path.join(" -> "));
    // The session makes telemetry of real numbers: a check that finds none there would find none anywhere.
    ensure!(
        !calls.floating_path(SESSION_HANDLER)?.is_empty(),
        "the search for floating-point functions finds nothing at all"
    );
    println!("control path    {:>8} functions, none of floating point", calls.reached(CONTROL_HANDLER)?.len());
    Ok(())
}

fn percent(part: u32, whole: u32) -> f64 {
    100.0 * f64::from(part) / f64::from(whole)
}

/// Builds the image and lets it run a grip, which prints and bounds its costs; then the accuracy of its numbers.
pub(crate) fn run(machine: &Machine) -> Result<()> {
    image(machine)?;
    // The tests run the command as well, in the build that all tests share.
    build::host()?;
    shell::step("the joint image under QEMU: start-up, grip, costs");
    let mut system = shell::cargo();
    system.args(["test", "--release", "--package", "system-tests", "--test", "system", "joint"]);
    system.args(["--features", build::WORLD]);
    shell::run(system.args(["--", "--nocapture", "--test-threads", "1"]))?;
    shell::step("accuracy against f64, saturation, ladder (development profile: integers that wrap are errors)");
    shell::run(shell::cargo().args(["test", "--package", "joint", "--", "--nocapture", "--test-threads", "1"]))
}

/// Which function calls which, by the branch instructions of an image.
struct Calls {
    names: BTreeMap<u32, String>,
    callees: BTreeMap<u32, BTreeSet<u32>>,
}

impl Calls {
    fn of(image: &Path) -> Result<Self> {
        let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
        Self::parse(&file).with_context(|| format!("{} has no symbols", image.display()))
    }

    fn parse(file: &[u8]) -> Option<Self> {
        let word = |at: usize| Some(u32::from_le_bytes(*file.get(at..)?.first_chunk()?));
        let half = |at: usize| Some(u16::from_le_bytes(*file.get(at..)?.first_chunk()?));
        let (table, entry, count) = (word(32)? as usize, half(46)? as usize, half(48)? as usize);
        let section = |index: usize| table + entry * index;
        let mut functions = BTreeMap::new();
        let mut names = BTreeMap::new();
        for index in 0..count {
            /// Section type: symbols.
            const SYMBOLS: u32 = 2;
            let at = section(index);
            if word(at + 4)? != SYMBOLS {
                continue;
            }
            let (start, bytes, link) = (word(at + 16)? as usize, word(at + 20)? as usize, word(at + 24)? as usize);
            let strings = word(section(link) + 16)? as usize;
            for symbol in (start..start + bytes).step_by(16) {
                /// Symbol type: function.
                const FUNCTION: u8 = 2;
                if file.get(symbol + 12)? & 15 != FUNCTION {
                    continue;
                }
                let (address, size) = (word(symbol + 4)? & !1, word(symbol + 8)?);
                let name = file.get(strings + word(symbol)? as usize..)?;
                let end = name.iter().position(|byte| *byte == 0)?;
                names.insert(address, String::from_utf8_lossy(name.get(..end)?).into_owned());
                functions.insert(address, size);
            }
        }
        // Where each loaded section lies in the file.
        let places: Vec<(u32, u32, u32)> = (0..count)
            .filter_map(|index| {
                let at = section(index);
                Some((word(at + 12)?, word(at + 16)?, word(at + 20)?))
            })
            .filter(|(address, _, bytes)| *bytes > 0 && *address < PART_FLASH)
            .collect();
        let in_file = |address: u32| {
            let (start, offset, _) =
                places.iter().find(|(start, _, bytes)| (*start..*start + *bytes).contains(&address))?;
            Some((offset + (address - start)) as usize)
        };
        let mut callees: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for (address, size) in &functions {
            let Some(begin) = in_file(*address) else { continue };
            let targets = callees.entry(*address).or_default();
            let mut at = 0;
            while at + 4 <= *size as usize {
                let (first, second) = (half(begin + at)?, half(begin + at + 2)?);
                if let Some(offset) = branch(first, second) {
                    targets.insert(address.wrapping_add(at as u32 + 4).wrapping_add_signed(offset));
                }
                // Every instruction that begins with 0b11101, 0b11110 or 0b11111 has two halves.
                at += if first >> 11 >= 0b11101 { 4 } else { 2 };
            }
            // A branch within a function is none to another.
            targets.retain(|target| functions.contains_key(target) && target != address);
        }
        (!names.is_empty()).then_some(Self { names, callees })
    }

    fn address(&self, name: &str) -> Result<u32> {
        match self.names.iter().find(|(_, other)| *other == name) {
            Some((address, _)) => Ok(*address),
            None => bail!("the image has no function '{name}'"),
        }
    }

    /// Everything that `name` reaches, itself included, with the caller it was found from.
    fn reached(&self, name: &str) -> Result<BTreeMap<u32, u32>> {
        let start = self.address(name)?;
        let mut found = BTreeMap::from([(start, start)]);
        let mut open = vec![start];
        while let Some(caller) = open.pop() {
            for target in self.callees.get(&caller).into_iter().flatten() {
                if found.insert(*target, caller).is_none() {
                    open.push(*target);
                }
            }
        }
        Ok(found)
    }

    /// The calls from `name` to a function of floating point; empty if there are none.
    fn floating_path(&self, name: &str) -> Result<Vec<String>> {
        let start = self.address(name)?;
        let reached = self.reached(name)?;
        let named = |address: u32| self.names.get(&address).cloned().unwrap_or_default();
        let Some(mut at) = reached.keys().copied().find(|address| is_floating(&named(*address))) else {
            return Ok(Vec::new());
        };
        let mut path = vec![named(at)];
        while at != start && path.len() < 32 {
            at = reached.get(&at).copied().unwrap_or(start);
            path.insert(0, named(at));
        }
        Ok(path)
    }
}

fn is_floating(name: &str) -> bool {
    FLOATING.iter().any(|prefix| name.starts_with(prefix)) || name.contains("compiler_builtins5float")
}

/// Offset of a branch with or without link (BL, B.W; encodings T1 and T4 of the architecture's manual), from four bytes behind it.
fn branch(first: u16, second: u16) -> Option<i32> {
    let is_branch = first & 0xF800 == 0xF000 && matches!(second & 0xD000, 0xD000 | 0x9000);
    if !is_branch {
        return None;
    }
    let sign = i32::from(first >> 10 & 1);
    let upper = |bit: u16| 1 ^ (i32::from(second >> bit & 1) ^ sign);
    let offset = (sign << 24 | upper(13) << 23 | upper(11) << 22 | i32::from(first & 0x3FF) << 12)
        | i32::from(second & 0x7FF) << 1;
    Some((offset << 7) >> 7)
}

#[cfg(test)]
mod tests {
    use super::branch;

    #[test]
    fn branches_are_read_as_the_assembler_writes_them() {
        assert_eq!(branch(0xF000, 0xF801), Some(2), "bl .+6");
        assert_eq!(branch(0xF7FF, 0xFFFE), Some(-4), "bl .");
        assert_eq!(branch(0xF000, 0xB801), Some(2), "b.w .+6");
        assert_eq!(branch(0xF7FF, 0xBFFE), Some(-4), "b.w .");
        assert_eq!(branch(0xF8D0, 0x1000), None, "ldr.w");
        assert_eq!(branch(0xF040, 0x0001), None, "orr.w");
    }
}
