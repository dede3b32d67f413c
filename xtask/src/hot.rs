//! Holds the code that a control slot calls against the memory that is never waited for.
//!
//! The linker script names what goes there by mangled names, which change with a module or with what the compiler
//! inlines. So the image itself is asked: everything the control slot can call lies in ITCM, or is listed here with its
//! reason.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};

use crate::code::Code;
use crate::elf::Elf;
use crate::thumb::Flow;

/// The control slot, which must lie in ITCM itself.
const ROOT: &str = "device::controller::DeviceController::control";

/// The law of a run, which has most to compute.
const LAW: &str = "run_primitive";

/// ITCM of the STM32H743.
const ITCM: std::ops::Range<u32> = 0..0x1_0000;

/// Called by a control slot, yet not in ITCM: part of the name, and why.
const ELSEWHERE: &[(&str, &str)] = &[
    ("control::cycle::transitions", "once, when a state changes"),
    ("control::guard::supervisor", "once, when a state changes"),
    ("control::cycle::commands", "once, when a person commands"),
    ("control::command::Command", "once, when a person commands"),
    ("control::plan::run::", "once, when a run begins; while its goal changes"),
    ("control::plan::goal", "while the goal of a run changes"),
    ("control::cycle::laws::crowd", "while the goal of a run changes"),
    ("control::cycle::laws::speed_load", "while the goal of a run changes"),
    ("control::plan::approach", "once, when an approach begins"),
    ("control::model::arm::ArmModel", "when a payload is found"),
    (
        "dmp::coupling::Coupling<T,_,_>::limited",
        "a coupling beyond its limit: not in a run of a primitive that was accepted",
    ),
    ("dmp::rollout::part_of_the_way", "the arm runs without a goal filter of this crate"),
    ("dmp::point_rows::PointRows<T,_>::follow", "the arm runs without a goal filter of this crate"),
    ("dmp::orientation_rows::turned", "the arm runs without a goal filter of this crate"),
    ("tare_drift", "at rest, by a person's command"),
    ("control::cycle::hand::HandDrive<R>::move_to", "once, when a person moves the hand"),
    ("control::model::hand::within_range", "once, when a person moves the hand"),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::hold_to",
        "the arm stands: no plan and no feedback is computed",
    ),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::lead",
        "led by hand: no plan and no feedback is computed",
    ),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::float",
        "led by hand: no plan and no feedback is computed",
    ),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::stop",
        "a soft stop: no plan and no feedback is computed",
    ),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::push_back",
        "a joint is beyond its bound: a few dozen instructions",
    ),
    (
        "control::cycle::laws::<impl control::cycle::Cycle<R,_>>::press_no_further",
        "a joint is beyond its bound: a few dozen instructions",
    ),
    (
        "control::sense::wrench::WrenchEstimator<R>::follow",
        "the memory is full; a few dozen instructions without a loop over time",
    ),
    (
        "control::cycle::law::Leaning<R>",
        "as a compliant run begins under a load: seven joints, a few instructions each",
    ),
    ("control::cycle::law::Running<R>::is_seeking", "once a run is over: a few instructions"),
    ("control::cycle::law::Posture<R>::effort", "the arm stands: no plan and no feedback is computed"),
    (
        "control::law::operational::OperationalController<R>::release",
        "the memory is full; something has drawn a spring: seven joints, a few dozen instructions each",
    ),
    ("control::law::soft_limits", "the plan is near a soft limit: seven joints, a dozen instructions each"),
    (
        "control::model::redundancy",
        "the plan is at a soft limit: a few hundred instructions, in cycles that do not renew the mass matrix",
    ),
    ("control::law::joint::JointController<R>::keep", "a reply is missing: a few dozen instructions"),
    ("control::sense::swing", "the memory is full; seven joints, a few dozen instructions each"),
    ("control::sense::observer", "the memory is full; a few loops that the cache keeps from one cycle to the next"),
    (
        "control::model::mass_matrix",
        "the memory is full; every eighth cycle, which has nothing else to do for the observer",
    ),
    ("control::guard::disagreement::Disagreement<R>::is_pushed", "the force sensor is silent"),
    ("control::guard::disagreement::Disagreement<R>::encoder_stands_still", "a motor stands still"),
    ("control::guard::disagreement::Disagreement<R>::is_contradicted", "a push: a few dozen instructions"),
    ("control::guard::monitor::unexplained", "a push: a few dozen instructions"),
    ("control::guard::disagreement::torques_of", "a motor stands still, or a push"),
    ("control::cycle::hand::HandDrive<R>::stop_driving", "the hand is not driven: a few dozen instructions at first"),
    ("control::cycle::hand::HandDrive<R>::grasp", "the memory is full; three fingers, a dozen or two instructions"),
    ("control::plan::inertia", "the memory is full; three axes, a dozen instructions each"),
    ("control::plan::lift::Lift<R>::raise", "in a grip: a few dozen instructions"),
    ("control::law::settling", "the memory is full; one joint in a cycle, a few dozen instructions"),
    ("control::law::hand::bound_closing", "the memory is full; three fingers, a few dozen instructions"),
    ("control::cycle::Cycle<R,_>::catch", "no torque: no plan and no law is computed"),
    ("control::sense::joints::Motor::doubt", "a reply that does not fit the ones before"),
    ("control::cycle::Cycle<R,_>::actuate_without_torque", "no torque: no plan and no law is computed"),
    ("control::cycle::Cycle<R,_>::reset", "after a fault of the bus"),
    ("control::cycle::Cycle<R,_>::not_sent", "the bus has refused a frame"),
    ("device::controller::orders", "once, when a person commands"),
    ("device::controller::anew", "after a fault of the bus"),
    ("device::controller::DeviceController::brakes_first", "torque has ended"),
    ("device::controller::DeviceController::tell_to_brake", "torque has ended"),
    ("device::startup", "a person zeroes the arm again"),
    ("device::hand", "the hand is initialised or has failed"),
    ("firmware::board::panic_stop", "the end"),
    ("firmware::board::stm32h743::parts::", "the end; a frame's way into the controller"),
    ("firmware::application::slot::SlotIo", "an event or a record for the session"),
    ("core::", "the end: a panic"),
    ("rust_begin_unwind", "the end: a panic"),
    ("__aeabi_mem", "a few instructions in front of memcpy and memset, which are in ITCM"),
    ("__aeabi_uldivmod", "time of an event"),
    ("compiler_builtins::int", "time of an event"),
];

/// Fails if a control slot calls something outside ITCM that is not listed.
pub(crate) fn check(image: &Path) -> Result<()> {
    let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let elf = Elf::parse(&*file).with_context(|| format!("{} is not a 32-bit ELF file", image.display()))?;
    let stray = stray(&Code::of(&elf)?)?;
    ensure!(
        stray.is_empty(),
        "a control slot calls code that is not in ITCM: {}\nName it in firmware/memory/stm32h743.x, or list it with its \
         reason in xtask/src/hot.rs",
        stray.into_iter().collect::<Vec<_>>().join(", ")
    );
    Ok(())
}

/// Functions that a control slot calls outside ITCM without a listed reason.
fn stray(code: &Code) -> Result<BTreeSet<String>> {
    let named = |name: &str| {
        let found = code.functions().find(|(_, function)| function.names().any(|known| known.ends_with(name)));
        found.map(|(address, _)| address).with_context(|| format!("the image has no function {name}"))
    };
    for name in [ROOT, LAW] {
        let address = named(name)?;
        ensure!(ITCM.contains(&address), "{name} lies at {address:#010x}, not in ITCM");
    }
    let mut stray = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut open = vec![named(ROOT)?];
    while let Some(address) = open.pop() {
        let Some(function) = code.at(address).filter(|_| seen.insert(address)) else { continue };
        if let Some(to) = code.beyond(function) {
            open.push(to);
            continue;
        }
        let name = function.name();
        if !ITCM.contains(&address) {
            if !ELSEWHERE.iter().any(|(listed, _)| name.contains(listed)) {
                stray.insert(name);
            }
            continue;
        }
        open.extend(function.instructions.iter().filter_map(|instruction| match instruction.flow {
            Flow::Call(to) | Flow::Jump(to) | Flow::Branch(to) => Some(to),
            Flow::Next | Flow::Elsewhere | Flow::Abort | Flow::Unreachable => None,
        }));
    }
    Ok(stray)
}
