//! Whatever befalls the bus, each command has one answer, in time.

use std::collections::VecDeque;

use control::{Command as Control, RunOptions};
use device::{Command, Controller, EventKind};
use puck::SafetyMode;

use crate::double::{Bus, HOME, floating, holding_with_ready_hand, silent_device, started};

/// Time after which the session gives a command up, us: an answer behind it is taken for that to the next one.
const GIVEN_UP_US: u64 = 200_000;

/// A source of numbers that look random.
struct Draw(u64);

impl Draw {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }
}

fn command(draw: &mut Draw, no_answer_is_owed: bool) -> Command {
    match draw.below(9) {
        // The session hands one over only then.
        0 | 1 if no_answer_is_owed => Command::Zero { home: if draw.below(3) == 0 { [9.0; 7] } else { HOME } },
        0..=2 => Control::Stop.into(),
        3 => Control::Gravity.into(),
        4 => Control::Hold.into(),
        5 => Control::ClearFault.into(),
        6 => Control::Tare.into(),
        7 => Control::Run(RunOptions::default()).into(),
        _ => Control::MoveHand { q: [0.1; 4], duration: 1.0 }.into(),
    }
}

/// Lets something befall the bus.
fn disturb(draw: &mut Draw, core: &mut device::DeviceController, bus: &mut Bus) {
    let puck = draw.below(7);
    match draw.below(15) {
        0..=2 => bus.press_idle(),
        3..=5 if bus.powered => bus.press_activate(),
        6 => bus.press_emergency_stop(),
        7 => bus.pucks[puck].awake_at = None,
        8 => bus.sensor_present = !bus.sensor_present,
        9 => bus.refuse = draw.below(400) as u32,
        10 => bus.pucks[puck].position.0 += draw.below(20_000) as i32 - 10_000,
        11 => bus.pucks[puck].lose = draw.below(80) as u32,
        12 => core.note_bus_error(true),
        13 => bus.lose_safety_writes = draw.below(4) as u32,
        _ => {
            let modes = [SafetyMode::EStop, SafetyMode::Idle, SafetyMode::Active];
            bus.wrong_safety_mode = Some(modes[draw.below(3)]);
        }
    }
}

/// The change that makes it fail: the looks at an arm that is to be zeroed wait for room without end, or a bus that is
/// started anew forgets the answer of the same slot.
#[test]
fn each_command_has_one_answer_before_it_is_given_up_whatever_befalls_the_bus() {
    for seed in 0..400 {
        let mut draw = Draw(7919 * seed);
        let start = draw.below(4 << 20) >> 20;
        let (mut core, mut bus) = match start {
            0 => started(),
            1 => floating(),
            2 => holding_with_ready_hand(),
            _ => (silent_device(), Bus::idle()),
        };
        bus.events.clear();
        let (mut owed, mut deaf_until): (VecDeque<(u64, Command)>, u64) = (VecDeque::new(), 0);
        for _ in 0..2000 {
            let now = bus.now_us;
            bus.deaf = now < deaf_until;
            if draw.below(20) == 0 && owed.len() < device::PENDING_COMMANDS {
                let command = command(&mut draw, owed.is_empty());
                bus.commands.push_back(command);
                owed.push_back((now, command));
            }
            if draw.below(60) == 0 {
                disturb(&mut draw, &mut core, &mut bus);
            }
            if draw.below(900) == 0 {
                deaf_until = now + 1000 * draw.below(600) as u64;
            }
            bus.run_slots(&mut core, 1);
            for event in bus.events.drain(..) {
                if matches!(event, EventKind::Accepted | EventKind::Refused(_)) {
                    assert!(owed.pop_front().is_some(), "seed {seed}: {event:?} answers nothing");
                }
            }
            let late = owed.front().filter(|(asked, _)| bus.now_us >= asked + GIVEN_UP_US);
            assert!(late.is_none(), "seed {seed}: {late:?} in {:?}", core.stage());
        }
    }
}
