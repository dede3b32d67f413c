//! Requests and faults in any order, against the whole application of a hand alone.

use control::State;
use dmp::Scalar;
use link::{HandStage, Name, Request, RunOptions};
use puck::device::reply32;
use puck::{Action, Node, PropertyId, Status};

use crate::common::Random;
use crate::ladder::{adapt, grip};
use crate::rig::{OBJECT, Rig};

/// Steps of a storm, and storms.
const STEPS: usize = 40;
const STORMS: u64 = 12;

fn request(random: &mut Random) -> Request {
    let name = Name::new("grip").expect("a name");
    let q = [0.1, 0.1, 0.1, 0.1].map(|least| least + 0.6 * (random.unit() as f32 + 1.0));
    match random.bits() % 10 {
        0 => Request::Hold,
        1 | 2 => Request::MoveHand { q, duration: 0.0 },
        3 => Request::Run { name, options: adapt() },
        4 => Request::Run { name, options: RunOptions { speed: 2.0, ..RunOptions::default() } },
        5 => Request::SetSpeed { factor: 0.7 },
        6 => Request::Stop,
        7 => Request::Release,
        8 => Request::ClearFault,
        _ if random.bits().is_multiple_of(4) => Request::InitialiseHand,
        _ => Request::Tare,
    }
}

/// One fault, which lasts for some cycles.
fn befall(rig: &mut Rig, random: &mut Random) {
    let node = Node::HAND[random.bits() as usize % 4];
    let time = [0.005, 0.015, 0.03, 0.4][random.bits() as usize % 4];
    match random.bits() % 6 {
        0 => rig.bus_off(),
        1 => {
            rig.jam(true);
            rig.run(time);
            rig.jam(false);
        }
        2 => rig.hear(reply32(node, PropertyId::STAT, Status::Reset.value())),
        3 => {
            rig.lose = Box::new(|_, _| true);
            rig.run(time);
        }
        _ => {
            rig.lose = Box::new(move |frame, _| frame.can_id().raw() >> 5 & 0x1F == u16::from(node.number()));
            rig.run(time);
        }
    }
    rig.lose = Box::new(|_, _| false);
}

/// The torques that left since the last look: each rises by no more than a step, and none is there without a state that
/// drives.
fn look(rig: &mut Rig, last: &mut [i16; 4], told: &[String]) {
    for frame in rig.sent.drain(..) {
        let Ok(puck::Request { action: Action::PackedTorques { torques, .. }, .. }) = puck::Request::decode(&frame)
        else {
            continue;
        };
        let now = torques.map(|torque| torque.units());
        for (digit, (now, last)) in now.iter().zip(*last).enumerate() {
            // Spread last: 0.6 N m behind 17.5, fingers 1.2 N m behind 125 and a tenth; 20 000 units per N m.
            let full = if digit == 3 { 0.6 * 20_000.0 / 17.5 } else { 1.2 * 20_000.0 / 12.5 };
            assert!(f64::from(*now).abs() <= full + 1.0, "{now}: {told:?}");
            let rise = f64::from(*now).abs() - f64::from(last).abs();
            assert!(rise <= full / 15.0 + 2.0, "{digit}: from {last} to {now}: {told:?}");
        }
        *last = now;
    }
    let record = rig.now();
    if matches!(record.state, State::Idle | State::SoftStop | State::Fault) {
        assert_eq!(record.torque, [Scalar::ZERO; 4], "{told:?}");
    }
}

/// The change that makes it fail: torque begins at what it was before a fault.
#[test]
fn requests_and_faults_in_any_order_leave_a_hand_that_can_be_had_again() {
    for seed in 1..=STORMS {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let mut rig = Rig::ready(OBJECT);
        rig.upload("grip", &grip().image("grip"));
        let (mut last, mut told) = ([0; 4], Vec::new());
        rig.sent.clear();
        for _ in 0..STEPS {
            if random.bits().is_multiple_of(4) {
                told.push("fault".to_owned());
                befall(&mut rig, &mut random);
            } else {
                let request = request(&mut random);
                told.push(request.name().to_owned());
                rig.ask(request);
            }
            rig.run(0.3 * (random.unit() + 1.0));
            look(&mut rig, &mut last, &told);
        }
        rig.wait(6.0, |rig| !matches!(rig.health().hand, HandStage::Absent | HandStage::Initialising));
        rig.run(0.2);
        rig.accept(Request::Stop);
        rig.accept(Request::ClearFault);
        assert_eq!(rig.health().state, State::Idle, "{told:?}");
        rig.wait(6.0, |rig| !matches!(rig.health().hand, HandStage::Absent | HandStage::Failed));
        if rig.health().hand != HandStage::Ready {
            rig.accept(Request::InitialiseHand);
            rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
            rig.run(0.1);
        }
        rig.accept(Request::MoveHand { q: [0.1; 4], duration: 0.0 });
        rig.wait(5.0, |rig| rig.health().state == State::Hold);
        look(&mut rig, &mut last, &told);
    }
}
