//! The hand image: built for a Cortex-M3, measured under QEMU, held against the part it is for.
//!
//! Instructions are counted: one tick of the image's clock is five. A Cortex-M3 needs more than one clock for
//! some of them (docs/hand.md), which is why the bound is half a cycle.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::board::Board;
use crate::code::{Code, Function};
use crate::elf::{Elf, Sizes};
use crate::setup::{HAND, Machine};
use crate::thumb::Flow;
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

/// Builds the hand image; returns the path under which the host tools look for it.
pub(crate) fn image(machine: &Machine) -> Result<PathBuf> {
    shell::step("building the hand image for QEMU's mps2-an385");
    let mut cargo = machine.toolchain.cargo("build", HAND)?;
    let features = if machine.qemu.may_sleep() { "board-mps2,wfi" } else { "board-mps2" };
    cargo.args(["--package", "firmware", "--bin", "hand", "--profile", "firmware"]).args([
        "--no-default-features",
        "--features",
        features,
    ]);
    shell::run(&mut cargo)?;
    let built = machine.toolchain.output(HAND, "firmware").join("hand");
    let folder = shell::target_dir().join("images");
    fs::create_dir_all(&folder)?;
    let image = folder.join(build::HAND);
    build::place(&built, &image)?;
    shell::note(&format!("image: {}", image.display()));
    check(&image)?;
    Ok(image)
}

/// Prints what the image takes, and fails where it does not fit its part, contains what no image may, or computes with
/// real numbers on its control path.
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
    build::nothing_forbidden(image, Board::Mps2)?;
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
    shell::step("the hand image under QEMU: start-up, grip, costs");
    let printed = ["--", "--nocapture", "--test-threads", "1"];
    shell::run(build::with_the_world("test").args(["--test", "system", "hand::"]).args(printed))?;
    shell::step("accuracy against f64, saturation, ladder (development profile: integers that wrap are errors)");
    shell::run(shell::cargo().args(["test", "--test", "fixed"]).args(printed))
}

/// Which function calls which, by the branch instructions of an image.
struct Calls {
    code: Code,
    callees: BTreeMap<u32, BTreeSet<u32>>,
}

impl Calls {
    fn of(image: &Path) -> Result<Self> {
        let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
        let code = Code::of(&Elf::parse(&*file)?)?;
        let callees = code.functions().map(|(address, function)| {
            let targets = function.instructions.iter().filter_map(|instruction| match instruction.flow {
                Flow::Call(to) | Flow::Jump(to) | Flow::Branch(to) => Some(to),
                Flow::Next | Flow::Elsewhere | Flow::Abort | Flow::Unreachable => None,
            });
            // A branch within a function is none to another.
            (address, targets.filter(|target| code.at(*target).is_some() && *target != address).collect())
        });
        let callees = callees.collect();
        Ok(Self { code, callees })
    }

    fn address(&self, name: &str) -> Result<u32> {
        self.code.address(name).with_context(|| format!("the image has no function '{name}'"))
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
        let named = |address: u32| self.code.at(address).map(Function::name).unwrap_or_default();
        let is_floating =
            |address: &u32| self.code.at(*address).is_some_and(|f| f.names().any(|name| is_floating(&name)));
        let Some(mut at) = reached.keys().copied().find(is_floating) else {
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
    FLOATING.iter().any(|prefix| name.starts_with(prefix)) || name.contains("compiler_builtins::float")
}
