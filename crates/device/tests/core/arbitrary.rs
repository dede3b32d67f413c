//! A6, C2: whatever comes over the bus and from people, in whatever order, the core neither panics nor sends torque
//! early.

use control::Command as Control;
use device::{Command, Controller, DeviceController, Stage};
use proptest::prelude::*;
use puck::{CanFrame, CanId, Counts, Node, PuckTorque, SafetyMode};

use crate::double::{Bus, HOME, silent_device, started};

/// Something that happens to the device.
#[derive(Clone, Debug)]
enum Happening {
    Frame(CanFrame),
    Position(usize, i32),
    Lost(usize, u32),
    Late(usize, u64),
    Person(Person),
    Idle,
    Activate,
    EmergencyStop,
    PuckResets(usize),
    DigitResets(usize),
    DigitLost(usize, u32),
    DigitDeaf(usize, u32),
    NoRoom(u32),
    Overrun,
    BusError(bool),
    Time(usize),
}

#[derive(Clone, Debug)]
enum Person {
    Zero([f32; 7]),
    InitialiseHand,
    Control(u8, [f32; 7]),
}

impl Person {
    fn command(&self) -> Command {
        match self {
            Person::Zero(home) => Command::Zero { home: *home },
            Person::InitialiseHand => Command::InitialiseHand,
            Person::Control(kind, q) => Command::Control(match kind % 9 {
                0 => Control::Gravity,
                1 => Control::Hold,
                2 => Control::Approach { q: *q, duration: q[0] },
                3 => Control::Run(control::RunOptions { speed: q[1], ..Default::default() }),
                4 => Control::Stop,
                5 => Control::ClearFault,
                6 => Control::SetSpeed { factor: q[2] },
                7 => Control::MoveHand { q: [q[0], q[1], q[2], q[3]], duration: q[4] },
                _ => Control::Tare,
            }),
        }
    }
}

fn happening() -> impl Strategy<Value = Happening> {
    let frame = (0..=0x7FF_u16, prop::collection::vec(any::<u8>(), 0..=8)).prop_map(|(id, data)| {
        CanFrame::from_slice(CanId::new(id).expect("eleven bits"), &data).expect("at most eight bytes")
    });
    // Frames of the right kind from the right nodes reach further than random ones.
    let reply = (
        prop::sample::select(vec![0x426_u16, 0x546, 0x423, 0x4E3, 0x50A, 0x50B, 0x540, 0x563, 0x566, 0x5C6]),
        any::<[u8; 4]>(),
    )
        .prop_map(|(id, data)| CanFrame::from_slice(CanId::new(id).expect("eleven bits"), &data).expect("four bytes"));
    let angles = prop::array::uniform7(prop_oneof![8 => -3.0_f32..3.0, 1 => Just(f32::NAN), 1 => Just(f32::INFINITY)]);
    prop_oneof![
        4 => frame.prop_map(Happening::Frame),
        4 => reply.prop_map(Happening::Frame),
        2 => (0..7_usize, any::<i32>()).prop_map(|(joint, counts)| Happening::Position(joint, counts)),
        2 => (0..7_usize, 0..8_u32).prop_map(|(joint, count)| Happening::Lost(joint, count)),
        1 => (0..7_usize, 0..8_000_u64).prop_map(|(joint, delay)| Happening::Late(joint, delay)),
        2 => prop_oneof![Just(HOME), angles.clone()].prop_map(|home| Happening::Person(Person::Zero(home))),
        6 => (any::<u8>(), angles).prop_map(|(kind, q)| Happening::Person(Person::Control(kind, q))),
        1 => Just(Happening::Idle),
        2 => Just(Happening::Activate),
        1 => Just(Happening::EmergencyStop),
        1 => (0..7_usize).prop_map(Happening::PuckResets),
        2 => Just(Happening::Person(Person::InitialiseHand)),
        1 => (0..4_usize).prop_map(Happening::DigitResets),
        1 => (0..4_usize, 0..8_u32).prop_map(|(digit, count)| Happening::DigitLost(digit, count)),
        1 => (0..4_usize, 0..3_u32).prop_map(|(digit, count)| Happening::DigitDeaf(digit, count)),
        1 => (0..30_u32).prop_map(Happening::NoRoom),
        1 => Just(Happening::Overrun),
        1 => any::<bool>().prop_map(Happening::BusError),
        8 => (1..2_000_usize).prop_map(Happening::Time),
    ]
}

fn happen(core: &mut DeviceController, bus: &mut Bus, happening: &Happening) {
    match happening {
        Happening::Frame(frame) => bus.inject(*frame),
        Happening::Position(joint, counts) => bus.pucks[*joint].position = Counts(*counts),
        Happening::Lost(joint, count) => bus.pucks[*joint].lose = *count,
        Happening::Late(joint, delay_us) => bus.pucks[*joint].delay_us = *delay_us,
        Happening::Person(person) => bus.commands.push_back(person.command()),
        Happening::Idle => bus.press_idle(),
        Happening::Activate => {
            // The pendant raises IDLE to ACTIVE, never E-STOP.
            if bus.safety_mode == SafetyMode::Idle {
                bus.press_activate();
            }
        }
        Happening::EmergencyStop => bus.press_emergency_stop(),
        Happening::PuckResets(joint) => bus.pucks[*joint].awake_at = None,
        Happening::DigitResets(digit) => bus.digits[*digit].lose_power(),
        Happening::DigitLost(digit, count) => bus.digits[*digit].lose = *count,
        Happening::DigitDeaf(digit, count) => {
            (bus.digits[*digit].lose_commands, bus.digits[*digit].lose_modes) = (*count, *count);
        }
        Happening::NoRoom(frames) => bus.refuse = *frames,
        Happening::Overrun => core.note_overrun(),
        Happening::BusError(bus_off) => core.note_bus_error(*bus_off),
        Happening::Time(slots) => bus.run_slots(core, *slots),
    }
}

/// Number of random cases: that of the environment variable, which `cargo xtask fuzz` sets, or `usual`.
fn cases(variable: &str, usual: u32) -> u32 {
    std::env::var(variable).ok().and_then(|number| number.parse().ok()).unwrap_or(usual)
}

/// Frames that a device has to judge: any identifier, and those of its own conversation, with any length.
fn judged_frames(count: u32) -> impl Iterator<Item = CanFrame> {
    const OWN: [u16; 14] =
        [0x426, 0x446, 0x4E6, 0x423, 0x4E3, 0x50A, 0x50B, 0x506, 0x540, 0x546, 0x563, 0x566, 0x5C6, 0x404];
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    let mut draw = move || {
        (state ^= state << 13, state ^= state >> 7, state ^= state << 17);
        state
    };
    (0..count).map(move |_| {
        let id = if draw() & 1 == 0 { (draw() & 0x7FF) as u16 } else { OWN[draw() as usize % OWN.len()] };
        let mut bytes = draw().to_le_bytes();
        if draw() & 3 != 0 {
            // The value of a property or a command as they stand in a frame.
            bytes[0] = (draw() as u8 & 0x3F) | 0x80;
            bytes[1..6].copy_from_slice(&[0, draw() as u8 & 3, 0, 0, 0]);
        }
        let length = if draw() & 3 == 0 { draw() as usize % 9 } else { [3, 4, 6, 6][draw() as usize % 4] };
        CanFrame::from_slice(CanId::new(id).expect("eleven bits"), &bytes[..length]).expect("at most eight bytes")
    })
}

/// A6: four random frames in every slot, to a device that is started and zeroed and that nobody has told to move: no
/// panic, and no torque, whatever the frames say about the safety module.
#[test]
fn a6_no_frame_on_the_bus_makes_a_device_send_torque_that_nobody_asked_for() {
    let (mut core, mut bus) = started();
    for (number, frame) in judged_frames(cases("TACTUS_FUZZ_FRAMES", 100_000)).enumerate() {
        bus.inject(frame);
        if number % 4 == 3 {
            bus.run_slots(&mut core, 1);
        }
        if bus.log.len() > 10_000 {
            assert!(bus.torques_since(0).all(|torque| torque == PuckTorque::ZERO), "frame {number}");
            bus.log.clear();
            bus.events.clear();
            bus.records.clear();
            bus.answers.clear();
        }
    }
    assert!(bus.torques_since(0).all(|torque| torque == PuckTorque::ZERO));
    let counters = core.health().counters;
    assert!(counters.foreign_frames > 0 && counters.malformed_frames > 0, "{counters:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases("TACTUS_FUZZ_STORIES", 300)))]

    /// The double panics on any request that no master may send (setting TORQUE, pulling the emergency stop, zeroing
    /// under torque, malformed frames, disturbing a hand that is initialised, driving one that never was), so this is a
    /// test of both directions.
    #[test]
    fn c2_torque_needs_a_whole_start_up_and_a_command(
        hand in any::<bool>(),
        story in prop::collection::vec(happening(), 1..60),
    ) {
        let bus = Bus::idle();
        let (mut core, mut bus) = (silent_device(), if hand { bus.with_hand() } else { bus });
        let mut may_move = false;
        for happening in &story {
            let before = bus.log.len();
            happen(&mut core, &mut bus, happening);
            bus.run_slots(&mut core, 1);
            may_move |= core.health().zeroed && core.stage() >= Stage::WaitingForActive;
            let torque = bus.torques_since(before).any(|torque| torque != PuckTorque::ZERO);
            prop_assert!(!torque || may_move, "torque in {:?} after {happening:?}", core.stage());
        }
        // Whatever happened, an emergency stop ends it, and the device finds its way back.
        bus.refuse = 0;
        bus.commands.clear();
        bus.press_emergency_stop();
        bus.run(&mut core, 3.0);
        let settled = bus.log.len();
        bus.press_idle();
        bus.run_until(&mut core, Stage::WaitingForZero);
        prop_assert!(bus.torques_since(settled).all(|torque| torque == PuckTorque::ZERO));
        prop_assert!(bus.pucks.iter().zip(Node::ARM).all(|(puck, _)| puck.awake_at.is_some()));
    }
}
