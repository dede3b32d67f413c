//! The whole application against the simulated hand: start-up, grip, and every rung of the ladder.

use control::{Fault, State};
use device::Slot;
use dmp::Scalar;
use hand::number::real;
use link::{EventKind, HandStage, Name, Refusal, Reply, Request, RunOptions, SecretReport, SecretState};
use puck::device::reply32;
use puck::{Action, Group, MotorMode, Node, Property, PropertyId, PropertyTable, Status};
use sim::FingerObstacle;

use crate::common::Movement;
use crate::rig::{CYCLE_TICKS, OBJECT, Rig, SLOT_TICKS};

pub(crate) fn grip() -> Movement {
    let mut movement =
        Movement { start: [0.0; 4], goal: [0.0, 1.6, 1.6, 1.6], ..Movement::closing(30, 3.0, 0.0) }.feeling();
    // The hand is stiff behind its gauges: 0.2 N m of error are to move the plan by a radian.
    movement.k1 = vec![[1000.0; 3]; 2];
    movement.k2 = vec![[1.0; 3]; 2];
    movement.limit = 0.8;
    movement
}

pub(crate) fn run(options: RunOptions) -> Request {
    Request::Run { name: Name::new("grip").expect("a name"), options }
}

pub(crate) fn adapt() -> RunOptions {
    RunOptions { feedback: true, force_control: true, ..RunOptions::default() }
}

pub(crate) fn gripping(options: RunOptions) -> Rig {
    let mut rig = Rig::ready(OBJECT);
    rig.upload("grip", &grip().image("grip"));
    rig.accept(run(options));
    rig
}

/// The latest torques on the bus, units of the pucks.
pub(crate) fn torques(rig: &Rig) -> Vec<[i16; 4]> {
    let requests = rig.plant.recorded().iter().filter_map(|passage| puck::Request::decode(&passage.frame).ok());
    requests
        .filter_map(|request| match request.action {
            Action::PackedTorques { torques, .. } => Some(torques.map(|torque| torque.units())),
            _ => None,
        })
        .collect()
}

#[test]
fn hand_is_found_and_moves_only_after_a_persons_word() {
    let mut rig = Rig::new(OBJECT);
    rig.plant.record_bus();
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.run(1.0);
    assert!(torques(&rig).iter().all(|units| *units == [0; 4]), "torque without a command");
    rig.plant.take_recorded();
    assert_eq!(rig.refusal(Request::MoveHand { q: [0.1; 4], duration: 0.0 }), Refusal::HandNotReady);
    rig.accept(Request::InitialiseHand);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    rig.run(0.5);
    assert!(rig.now().q.iter().all(|q| q.to_f64().abs() < 0.03), "it counts from its open stops: {:?}", rig.now().q);
    assert_eq!((rig.health().state, torques(&rig).len()), (State::Idle, 0));
    assert_eq!(rig.plant.trace().invalid, 0);
    assert_eq!(rig.plant.lost_requests(), 0, "requests came too fast for the pucks");
}

#[test]
fn g3_a_hand_device_that_restarts_takes_off_the_torque_before_it_asks_anything() {
    // The pucks still apply what the old life commanded, perhaps in MODE TORQUE.
    let mut rig = Rig::new(OBJECT);
    let zero = puck::packed_torques(Group::HAND, PropertyId::TORQUE, [puck::PuckTorque::ZERO; 4]);
    let idle = puck::set(Group::HAND, PropertyId::MODE, MotorMode::Idle.value());
    rig.run(0.01);
    assert_eq!(rig.sent[..2], [zero, idle]);
}

#[test]
fn g5_a_second_host_does_not_inherit_the_motion_of_a_silent_hand_host() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    rig.change_hosts();
    rig.run(0.05);
    assert_eq!(rig.health().state, State::SoftStop);
}

#[test]
fn g11_an_initialisation_whose_host_dies_ends_after_half_a_second() {
    let mut rig = Rig::new(OBJECT);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.accept(Request::InitialiseHand);
    rig.alive = false;
    rig.run(0.45);
    assert_eq!(rig.health().hand, HandStage::Initialising);
    rig.run(0.1);
    assert_eq!(rig.health().hand, HandStage::NotInitialised);
}

#[test]
fn a_move_arrives_and_is_held() {
    let mut rig = Rig::ready(FingerObstacle::NOTHING);
    rig.accept(Request::MoveHand { q: [0.5, 1.0, 0.8, 0.6], duration: 1.0 });
    rig.wait(5.0, |rig| rig.health().state == State::Hold);
    rig.run(0.5);
    for (q, goal) in rig.now().q.iter().zip([0.5, 1.0, 0.8, 0.6]) {
        assert!((q.to_f64() - goal).abs() < 0.05, "{q:?} instead of {goal}");
    }
}

#[test]
fn a_run_closes_on_the_object_and_keeps_the_expected_force() {
    let end = |options: RunOptions| {
        let mut rig = gripping(options);
        rig.wait(6.0, |rig| rig.health().state == State::Hold);
        rig.run(1.0);
        assert!(rig.heard.iter().any(|reply| matches!(reply, Reply::Event(event) if event.kind == EventKind::Arrived)));
        rig.now().gauges.map(real)
    };
    // What the movement expects at its end.
    let expected = [-0.25, -0.275, -0.225];
    let (tracked, adapted) = (end(RunOptions::default()), end(adapt()));
    let error = |gauges: [f32; 3]| {
        gauges.iter().zip(expected).map(|(gauge, expected): (&f32, f32)| (gauge - expected).abs()).fold(0.0, f32::max)
    };
    println!("expected {expected:?}, position alone {tracked:?}, with feedback and force control {adapted:?}");
    assert!(tracked.iter().chain(&adapted).all(|gauge| *gauge < -0.02), "the fingers press on the object");
    assert!(error(adapted) < 0.5 * error(tracked), "{} and {}", error(adapted), error(tracked));
}

#[test]
fn a_stop_ends_the_torque_and_the_worms_hold() {
    let mut rig = gripping(adapt());
    rig.run(1.5);
    rig.accept(Request::Stop);
    rig.plant.record_bus();
    rig.run(0.1);
    assert_eq!(rig.health().state, State::SoftStop);
    let after = rig.now().q;
    rig.run(1.0);
    assert!(rig.now().q.iter().zip(after).all(|(now, then)| (now.to_f64() - then.to_f64()).abs() < 0.01));
    assert!(torques(&rig).iter().all(|units| *units == [0; 4]), "zeros, then silence");
    let idle =
        rig.plant.recorded().iter().filter_map(|passage| puck::Request::decode(&passage.frame).ok()).any(|request| {
            request.action == Action::Set { property: PropertyId::MODE, value: MotorMode::Idle.value() }
        });
    assert!(idle, "the drives are told to let go");
    rig.accept(Request::ClearFault);
    rig.accept(Request::MoveHand { q: [0.0; 4], duration: 1.0 });
}

#[test]
fn lost_replies_are_bridged_for_five_cycles_and_end_the_torque_in_the_sixth() {
    let bridged = u64::from(hand::LOST_CYCLES);
    for (cycles, survives) in [(1, true), (bridged, true), (bridged + 2, false)] {
        let mut rig = gripping(adapt());
        rig.run(1.0);
        let from = rig.health().cycle as u32;
        let before = rig.now().torque;
        let left = std::cell::Cell::new(0);
        let begin = std::cell::OnceCell::new();
        rig.lose = Box::new(move |frame, at| {
            let first = *begin.get_or_init(|| at);
            let _ = &left;
            // Whole cycles of replies of one finger.
            let lost = (at - first) / CYCLE_TICKS < cycles;
            lost && frame.can_id().raw() >> 5 & 0x1F == u16::from(Node::FINGERS[1].number())
        });
        rig.run(0.2);
        let states: Vec<State> =
            rig.records.iter().filter(|record| record.cycle > from).map(|record| record.state).collect();
        assert!(states.contains(&State::Coast), "{cycles} cycles: {states:?}");
        let steps = rig.records.windows(2).filter(|pair| pair[0].cycle >= from && pair[1].torque != [Scalar::ZERO; 4]);
        for pair in steps {
            for digit in 1..4 {
                let step = (pair[1].torque[digit] - pair[0].torque[digit]).to_f64().abs();
                assert!(step <= 1.2 / 15.0 + 1e-6, "a torque step of {step} N m after {before:?}");
            }
        }
        let health = rig.health();
        if survives {
            assert_eq!((health.state, health.fault), (State::Run, Fault::None), "{cycles} cycles");
        } else {
            assert_eq!((health.state, health.fault), (State::SoftStop, Fault::RepliesLost), "{cycles} cycles");
            let coasting = states.iter().filter(|state| **state == State::Coast).count();
            assert_eq!(coasting as u64, bridged, "torque ends in the cycle after");
            assert_eq!(rig.refusal(run(adapt())), Refusal::Faulted);
        }
    }
}

#[test]
fn a_silent_puck_is_a_latched_fault() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    rig.lose = Box::new(|frame, _| frame.can_id().raw() >> 5 & 0x1F == u16::from(Node::SPREAD.number()));
    rig.run(0.5);
    assert_eq!(rig.health().hand, HandStage::Failed);
    assert_eq!(rig.now().torque, [Scalar::ZERO; 4]);
    assert_eq!(rig.health().fault, Fault::RepliesLost, "the soft stop came first and stays");
    rig.lose = Box::new(|_, _| false);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    assert_eq!(rig.refusal(run(adapt())), Refusal::Faulted, "nothing goes up by itself");
    rig.accept(Request::ClearFault);
    rig.accept(Request::InitialiseHand);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    rig.accept(Request::MoveHand { q: [0.0, 0.2, 0.2, 0.2], duration: 1.0 });
    rig.wait(3.0, |rig| rig.health().state == State::Hold);
}

/// A10: pucks keep the torque that they were sent last, and the two frames that end it were lost with all others. One
/// puck stays away, so the start-up never gets to the end. The change that makes it fail: a start-up that has rested
/// begins with its questions.
#[test]
fn a10_a_hand_that_is_not_whole_is_told_to_stop_again_and_again() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    rig.lose = Box::new(|frame, _| frame.can_id().raw() >> 5 & 0x1F == u16::from(Node::SPREAD.number()));
    rig.run(0.5);
    assert_eq!(rig.health().hand, HandStage::Failed);
    let [zero, idle] = puck::hand_stop_frames();
    for second in 0..6 {
        rig.sent.clear();
        rig.run(1.2);
        assert!(rig.sent.windows(2).any(|pair| pair == [zero, idle]), "within 1.2 s, {second}: {:?}", rig.sent);
    }
    // Where nobody is heard, more often.
    rig.lose = Box::new(|_, _| true);
    rig.run(2.0);
    rig.sent.clear();
    rig.run(0.4);
    assert!(rig.sent.windows(2).any(|pair| pair == [zero, idle]));
}

#[test]
fn a_hand_that_fails_under_torque_is_a_fault_and_can_be_had_again() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    // All four fall silent at once, as when the hand loses power; the ladder first ends the torque.
    rig.lose = Box::new(|frame, _| frame.can_id().raw() >> 5 & 0x1F > 10);
    rig.run(0.5);
    assert_eq!((rig.health().hand, rig.now().torque), (HandStage::Failed, [Scalar::ZERO; 4]));
    assert_eq!(rig.refusal(Request::InitialiseHand), Refusal::NoHand);
    rig.lose = Box::new(|_, _| false);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.accept(Request::ClearFault);
    rig.accept(Request::InitialiseHand);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
}

#[test]
fn a_puck_that_reports_its_reset_is_a_fault_that_ends_with_clearing_and_initialisation() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    let lost = Node::FINGERS[0];
    let reset = reply32(lost, PropertyId::STAT, Status::Reset.value());
    rig.hear(reset);
    rig.run(0.01);
    assert_eq!(rig.health().state, State::Run, "an answer that nobody asked for means nothing");
    // Back within the cycles that are bridged, the puck answers what the device asks a silent one.
    rig.lose = Box::new(move |frame, _| frame.can_id().raw() >> 5 & 0x1F == u16::from(lost.number()));
    let from = rig.records.len();
    for _ in 0..5 * 3 {
        rig.hear(reset);
        rig.step();
    }
    let states: Vec<State> = rig.records[from..].iter().map(|record| record.state).collect();
    assert!(states.starts_with(&[State::Coast]) && !states.contains(&State::SoftStop), "{states:?}");
    let health = rig.health();
    assert_eq!((health.state, health.fault, health.hand), (State::Fault, Fault::BusFault, HandStage::Failed));
    assert_eq!(rig.now().torque, [Scalar::ZERO; 4]);
    assert_eq!(rig.refusal(run(adapt())), Refusal::Faulted);

    rig.lose = Box::new(|_, _| false);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.plant.record_bus();
    rig.run(1.0);
    assert_eq!(rig.health().state, State::Fault, "it is latched");
    assert!(torques(&rig).iter().all(|units| *units == [0; 4]), "torque in a fault");
    // "Stop the present motion first" was the help, and no stop helped.
    assert_eq!(rig.refusal(Request::InitialiseHand), Refusal::Faulted, "first the fault is cleared");
    rig.accept(Request::ClearFault);
    assert_eq!((rig.health().state, rig.health().fault), (State::Idle, Fault::None));
    assert_eq!(rig.refusal(run(adapt())), Refusal::HandNotReady);
    rig.accept(Request::InitialiseHand);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    rig.accept(run(adapt()));
    rig.wait(6.0, |rig| rig.health().state == State::Hold);
}

#[test]
fn a10_bus_off_ends_the_torque_of_a_hand_alone_and_latches() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    rig.bus_off();
    rig.plant.record_bus();
    rig.run(0.02);
    assert_eq!((rig.health().state, rig.health().fault), (State::Fault, Fault::BusFault));
    assert!(torques(&rig).iter().all(|units| *units == [0; 4]) && !torques(&rig).is_empty(), "zeros, then silence");
    let told = rig.heard.iter().any(|reply| {
        matches!(reply, Reply::Event(event) if event.kind == EventKind::State && event.detail == u32::from(Fault::BusFault.code()))
    });
    assert!(told, "the host hears of it");
    rig.accept(Request::ClearFault);
    rig.accept(Request::MoveHand { q: [0.0; 4], duration: 1.0 });
}

#[test]
fn a_silent_gauge_fades_the_feedback_and_position_goes_on() {
    let mut rig = gripping(adapt());
    rig.run(1.2);
    let gauge = PropertyId::new(25).expect("a property");
    rig.lose = Box::new(
        move |frame, _| matches!(puck::Reply::decode(frame), Ok(puck::Reply::Property { property, .. }) if property == gauge),
    );
    let from = rig.records.len();
    rig.run(0.5);
    let flags: Vec<u32> = rig.records[from..].iter().map(|record| record.flags).collect();
    let faded = flags.iter().position(|flags| flags & control::flags::FEEDBACK_FADED != 0).expect("it fades");
    assert!((5..=8).contains(&faded), "after {faded} cycles");
    assert_eq!(rig.health().state, State::Run, "position control goes on");
    let jumps = rig.records[from..].windows(2).map(|pair| (pair[1].q_d[1] - pair[0].q_d[1]).to_f64().abs());
    assert!(jumps.fold(0.0, f64::max) < 0.02, "the plan does not jump");
}

#[test]
fn a_silent_host_stops_a_run_but_not_a_grip() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    rig.alive = false;
    rig.run(0.7);
    assert_eq!(rig.health().state, State::SoftStop);
    let mut rig = gripping(adapt());
    rig.wait(6.0, |rig| rig.health().state == State::Hold);
    rig.alive = false;
    rig.run(2.0);
    assert_eq!(rig.health().state, State::Hold, "what is gripped is not dropped");
}

#[test]
fn a_stop_is_honoured_from_anybody_and_nothing_else_is() {
    let mut rig = gripping(adapt());
    rig.run(1.0);
    assert!(matches!(rig.ask_as_stranger(Request::Hold), Reply::Refused { reason: Refusal::NoSession, .. }));
    assert_eq!(rig.health().state, State::Run);
    assert!(matches!(rig.ask_as_stranger(Request::Stop), Reply::Accepted { .. }));
    assert_eq!(rig.health().state, State::SoftStop);
    // The host that has the hand still has it.
    rig.accept(Request::Ping);
}

#[test]
fn requests_for_an_arm_are_refused_with_that_reason() {
    let mut rig = Rig::ready(OBJECT);
    for request in [
        Request::Zero { home: [0.0; 7] },
        Request::Gravity,
        Request::Approach { q: [0.0; 7], duration: 1.0 },
        Request::SetGoal(link::Goal::default()),
        Request::Read { name: Name::new("grip").expect("a name"), offset: 0 },
        Request::Calibration,
        Request::Calibrate { home: [0.0; 7] },
        Request::ForgetCalibration,
        Request::Weight,
        Request::KeepWeight { hand: false, links: [[0.0; 4]; 7] },
        Request::ForgetWeight,
        Request::Rename { name: Name::new("grip").expect("a name"), to: Name::new("grasp").expect("a name") },
    ] {
        assert_eq!(rig.refusal(request), Refusal::NoArm);
    }
    rig.upload("grip", &grip().image("grip"));
    let options = RunOptions { goal: link::Goal { position: Some([0.4, 0.0, 0.2]), orientation: None }, ..adapt() };
    assert_eq!(rig.refusal(run(options)), Refusal::NoArm);
}

#[test]
fn a_hand_alone_keeps_no_secret_says_so_and_asks_for_none() {
    let mut rig = Rig::ready(OBJECT);
    let secret = link::Secret::new([7; 16]);
    assert_eq!(rig.refusal(Request::KeepSecret { secret }), Refusal::SecretNotOffered);
    assert_eq!(rig.refusal(Request::ForgetSecret), Refusal::SecretNotOffered);
    assert_eq!(rig.refusal(Request::Challenge), Refusal::NoSecret);
    let Reply::Secret { secret, .. } = rig.ask(Request::Secret) else { panic!("no report") };
    assert_eq!(secret, SecretReport { state: SecretState::NotOffered, proven: false, wrong_proofs: 0 });
    rig.accept(Request::Hold);
}

#[test]
fn an_unsuitable_run_is_refused() {
    let mut rig = Rig::ready(OBJECT);
    assert_eq!(rig.refusal(run(adapt())), Refusal::NoSuchPrimitive);
    let plain = Movement { expected: Vec::new(), ..grip() };
    rig.upload("grip", &plain.image("grip"));
    assert_eq!(rig.refusal(run(adapt())), Refusal::NoExpectation);
    let far = Movement { start: [0.0, 1.0, 1.0, 1.0], ..grip() };
    rig.upload("grip", &far.image("grip"));
    assert_eq!(rig.refusal(run(adapt())), Refusal::HandFarFromStart);
    rig.upload("grip", &grip().image("grip"));
    for speed in [f32::NAN, 0.0, -1.0, 50.0] {
        assert_eq!(rig.refusal(run(RunOptions { speed, ..adapt() })), Refusal::BadValue);
    }
    rig.accept(run(RunOptions { speed: 2.0, ..adapt() }));
}

#[test]
fn an_upload_is_listed_and_replaced_only_when_it_is_sound() {
    let mut rig = Rig::new(OBJECT);
    let (first, mut damaged) = (grip().image("grip"), Movement::closing(40, 2.0, 0.2).image("grip"));
    rig.upload("grip", &first);
    let crc = link::image::stored_crc(&damaged);
    damaged[400] ^= 1;
    let name = Name::new("grip").expect("a name");
    rig.accept(Request::UploadBegin { name, length: damaged.len() as u32, crc });
    for (index, part) in damaged.chunks(192).enumerate() {
        let data = link::message::ChunkData::from_slice(part).expect("it fits");
        rig.accept(Request::UploadChunk { offset: 192 * index as u32, data });
    }
    assert_eq!(rig.refusal(Request::UploadCommit), Refusal::UploadCrc);
    let Reply::Listing { listing: Some(listing), .. } = rig.ask(Request::List { index: 0 }) else {
        panic!("nothing is listed");
    };
    assert_eq!((listing.crc, listing.kernels, listing.expectation), (link::image::stored_crc(&first), 30, true));
}

#[test]
fn replies_are_in_before_the_control_slot_and_the_bus_has_room() {
    let mut rig = gripping(adapt());
    rig.plant.record_bus();
    rig.run(2.0);
    let gauge =
        PropertyTable::motor(200).ok().and_then(|table| table.id(Property::Sg)).expect("a property of the hand");
    // At a higher rate the slow slot passes before the control slot; its question and the answer take 160 us.
    let (time, between) = if Slot::Request.next() == Slot::Control { (SLOT_TICKS, 0) } else { (2 * SLOT_TICKS, 160) };
    let (mut begin, mut longest, mut busy, mut cycles) = (0, 0, 0, 0);
    for passage in rig.plant.recorded() {
        let to_hand = puck::Request::decode(&passage.frame);
        if to_hand.is_ok_and(|request| request.action == Action::Get { property: PropertyId::POSITION }) {
            begin = passage.start;
            cycles += 1;
        }
        let answers = match puck::Reply::decode(&passage.frame) {
            Ok(puck::Reply::Position { .. }) => true,
            Ok(puck::Reply::Property { property, .. }) => property == gauge,
            _ => false,
        };
        if cycles > 0 && answers {
            longest = longest.max(passage.end - begin);
        }
        busy += passage.end - passage.start;
    }
    let microseconds = |ticks: u64| ticks as f64 / sim::TICKS_PER_MICROSECOND as f64;
    let load = busy as f64 / (cycles * CYCLE_TICKS) as f64;
    println!("all replies in after {:.0} us, bus load {:.1} %", microseconds(longest), 100.0 * load);
    assert!(longest < time, "{} us", microseconds(longest));
    // By the bit counts, worst stuffing: two requests, three positions of 6 bytes and one of 3, four gauges, and 75 us.
    let worst = 2 * 65 + 3 * 115 + 85 + 4 * 95 + 75 + between;
    assert!(worst * sim::TICKS_PER_MICROSECOND < time, "{worst} us");
    assert!(busy < cycles * 1500 * sim::TICKS_PER_MICROSECOND, "45 % of a cycle of 300 Hz");
}
