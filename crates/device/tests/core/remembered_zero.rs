//! Where the arm was zeroed: remembered for as long as that zero counts, and no longer.

use device::{Command, Controller, DeviceController, Stage};
use puck::SafetyMode;

use crate::double::{Bus, HOME, started};

/// A posture at which nobody zeroes in the end.
const ELSEWHERE: [f32; 7] = [0.5, -1.9, 0.1, 2.8, 0.1, 0.1, 0.1];

/// The zero as the device tells it after something has befallen an arm that was zeroed at [`HOME`] and stands.
fn zero_behind(befall: impl FnOnce(&mut DeviceController, &mut Bus)) -> (bool, Option<[f32; 7]>) {
    let (mut core, mut bus) = started();
    bus.run(&mut core, 0.2);
    assert_eq!(core.health().zeroed_at, Some(HOME));
    befall(&mut core, &mut bus);
    bus.run(&mut core, 5.0);
    let health = core.health();
    let stage = if health.zeroed { Stage::WaitingForActive } else { Stage::WaitingForZero };
    assert_eq!(core.stage(), stage, "{:?}", bus.events);
    (health.zeroed, health.zeroed_at)
}

/// The changes that make it fail: a start-up that begins anew forgets where the arm was zeroed. `tactus calibrate home`
/// was refused then, and its words were that the arm had been zeroed by somebody else.
#[test]
fn a_zero_that_outlives_a_loss_of_the_bus_keeps_its_posture() {
    let remembered = (true, Some(HOME));
    assert_eq!(zero_behind(|core, _| core.note_bus_error(true)), remembered, "off the bus");
    let mut told = None;
    let outage = |core: &mut DeviceController, bus: &mut Bus| {
        bus.deaf = true;
        bus.run(core, 3.0);
        told = Some(core.health().zeroed_at);
        bus.deaf = false;
    };
    assert_eq!(zero_behind(outage), remembered, "nothing heard for some seconds");
    assert_eq!(told, Some(None), "whether the zero still counts is not known meanwhile");
    let unheard = |core: &mut DeviceController, bus: &mut Bus| {
        bus.deaf = true;
        bus.commands.push_back(Command::Zero { home: ELSEWHERE });
        bus.run_until(core, Stage::Blocked);
        bus.deaf = false;
    };
    assert_eq!(zero_behind(unheard), remembered, "a zeroing that nobody hears");
    let misheard = |core: &mut DeviceController, bus: &mut Bus| {
        bus.commands.push_back(Command::Zero { home: ELSEWHERE });
        bus.run_slots(core, 2);
        bus.wrong_safety_mode = Some(SafetyMode::EStop);
    };
    assert_eq!(zero_behind(misheard), remembered, "an emergency stop that was none");
}

/// The change that makes it fail: what is remembered outlives its zero.
#[test]
fn g2_a_zero_that_is_lost_takes_its_posture_with_it() {
    let lost = (false, None);
    let restart = |core: &mut DeviceController, bus: &mut Bus| {
        bus.pucks[3].awake_at = None;
        core.note_bus_error(true);
    };
    assert_eq!(zero_behind(restart), lost, "a puck that restarted");
    let forget = |core: &mut DeviceController, bus: &mut Bus| {
        bus.safety_zero = false;
        core.note_bus_error(true);
    };
    assert_eq!(zero_behind(forget), lost, "a safety module that restarted");
    let stop = |core: &mut DeviceController, bus: &mut Bus| {
        bus.press_emergency_stop();
        bus.run(core, 0.3);
        bus.press_idle();
    };
    assert_eq!(zero_behind(stop), lost, "an emergency stop");
    // The module restarts while a second zeroing is refused, which asks it.
    let refused = |core: &mut DeviceController, bus: &mut Bus| {
        bus.commands.push_back(Command::Zero { home: ELSEWHERE });
        bus.run_slots(core, 8);
        bus.safety_zero = false;
        bus.press_activate();
    };
    assert_eq!(zero_behind(refused), lost, "a safety module that restarted behind a refused zeroing");
    // Somebody else zeroes an arm that this device had lost: the first posture is not told again.
    let (mut core, mut bus) = started();
    bus.safety_zero = false;
    core.note_bus_error(true);
    bus.run(&mut core, 0.1);
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.safety_zero = true;
    bus.wrong_safety_mode = Some(SafetyMode::EStop);
    bus.run(&mut core, 5.0);
    assert_eq!((core.health().zeroed, core.health().zeroed_at), (true, None), "{:?}", core.stage());
}
