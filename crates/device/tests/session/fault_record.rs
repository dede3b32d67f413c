//! The last second before a fault: what is in it, how long it is kept, and what a restart makes of it.

use control::{CycleRecord, Fault, State};
use device::{FAULT_CYCLES, FaultMemory, TimedRecord};
use link::{FaultRecord, Reply, Request, Telemetry};
use proptest::prelude::*;

use crate::rig::{Rig, hello};

fn record(rig: &mut Rig) -> Option<FaultRecord> {
    match rig.ask(Request::FaultRecord) {
        Some(Reply::FaultRecord { record, .. }) => record,
        other => panic!("no record but {other:?}"),
    }
}

fn cycle(rig: &mut Rig, record: u16, index: u16) -> Option<Telemetry> {
    match rig.ask(Request::FaultCycle { record, index }) {
        Some(Reply::FaultCycle { cycle, .. }) => cycle,
        other => panic!("no cycle but {other:?}"),
    }
}

/// Cycles of a record that is full.
const SECOND: u16 = FAULT_CYCLES as u16;

/// Numbers of the cycles in a record.
fn cycles(rig: &mut Rig, of: FaultRecord) -> Vec<u32> {
    (0..of.cycles).map(|index| cycle(rig, of.number, index).expect("a whole cycle").cycle).collect()
}

fn run(rig: &mut Rig, numbers: std::ops::Range<u64>, fault: Fault) {
    numbers.for_each(|number| rig.cycle(number, fault));
}

#[test]
fn a_record_ends_with_the_cycle_of_the_fault_and_stays_until_the_next_one() {
    let mut rig = Rig::greeted();
    let stop = 2 * u32::from(SECOND) + 100;
    let at = |later: u32| u64::from(stop + later);
    run(&mut rig, 0..at(0), Fault::None);
    assert_eq!(record(&mut rig), None);
    run(&mut rig, at(0)..at(200), Fault::ContactForce);
    let first = FaultRecord { number: 1, fault: Fault::ContactForce.code(), latched: true, cycles: SECOND };
    assert_eq!(record(&mut rig), Some(first));
    let second_before = Vec::from_iter(stop + 1 - u32::from(SECOND)..=stop);
    assert_eq!(cycles(&mut rig, first), second_before);
    let last = cycle(&mut rig, 1, SECOND - 1).expect("the cycle of the fault");
    assert_eq!((last.fault, last.cost_ticks), (Fault::ContactForce.code(), 99));
    assert_eq!(cycle(&mut rig, 1, SECOND - 2).map(|cycle| cycle.fault), Some(0));
    assert_eq!((cycle(&mut rig, 1, SECOND), cycle(&mut rig, 2, 0)), (None, None));
    // Cleared: it can still be read, however long the arm goes on.
    run(&mut rig, at(200)..at(2000), Fault::None);
    let cleared = FaultRecord { latched: false, ..first };
    assert_eq!(record(&mut rig), Some(cleared));
    assert_eq!(cycles(&mut rig, cleared), second_before);
    // The next fault, 50 cycles after a clear: it holds these, and nothing from before.
    run(&mut rig, at(2000)..at(2001), Fault::JointSpeed);
    run(&mut rig, at(2001)..at(2051), Fault::None);
    run(&mut rig, at(2051)..at(2052), Fault::TipSpeed);
    let third = FaultRecord { number: 3, fault: Fault::TipSpeed.code(), latched: true, cycles: 51 };
    assert_eq!(record(&mut rig), Some(third));
    assert_eq!(cycles(&mut rig, third), Vec::from_iter(stop + 2001..=stop + 2051));
    assert_eq!(cycle(&mut rig, 1, 0), None, "the old record is gone, and is not mistaken for the new one");
}

#[test]
fn a_record_tells_every_posture_of_the_arm_from_stop_to_stop() {
    use control::model::{POSITION_MAX, POSITION_MIN};
    for stops in [POSITION_MIN, POSITION_MAX] {
        let mut rig = Rig::greeted();
        let q = stops.map(|angle| angle as f32);
        let record =
            CycleRecord { cycle: 1, state: State::SoftStop, fault: Fault::JointLimit, q, ..CycleRecord::EMPTY };
        rig.bench.records.push_back(TimedRecord { record, cost_ticks: 0 });
        rig.poll();
        let told = cycle(&mut rig, 1, 0).expect("a whole cycle").q;
        let off = told.iter().zip(q).map(|(told, angle)| (told - angle).abs()).fold(0.0, f32::max);
        assert!(off <= 0.08e-3 + 1e-6, "{told:?} instead of {q:?}");
    }
}

#[test]
fn an_observer_reads_the_record_too() {
    let mut rig = Rig::greeted();
    run(&mut rig, 0..10, Fault::None);
    run(&mut rig, 10..11, Fault::Overrun);
    rig.number = 88;
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
    let seen = record(&mut rig).expect("a record");
    for index in 0..seen.cycles {
        // As fast as others may ask beside an owner.
        rig.wait(10);
        assert_eq!(cycle(&mut rig, seen.number, index).map(|cycle| cycle.cycle), Some(index.into()));
    }
}

/// A cycle that can be told from another one.
fn full(number: u32) -> Telemetry {
    Telemetry {
        cycle: number,
        state: State::Run.code(),
        flags: 0x0031_8001,
        q: [-2.6, 2.0, -2.8, 3.1, -4.0, 1.5, 3.0],
        cost_ticks: 123_456,
        ..Telemetry::default()
    }
}

/// Number of the cycle with the fault: there are more before it than a record holds.
const FAULTY: u32 = SECOND as u32 + 100;

/// A device that has run for so many cycles since a fault that a person has cleared.
fn cleared(after: u32) -> Box<FaultMemory> {
    let mut memory = Box::new(FaultMemory::BLANK);
    memory.resume();
    (0..FAULTY).for_each(|number| memory.take(&full(number)));
    memory.take(&Telemetry { fault: 9, ..full(FAULTY) });
    (0..after).for_each(|number| memory.take(&full(1000 + number)));
    memory
}

#[test]
fn a_restart_keeps_a_fault_that_nobody_cleared_and_otherwise_the_last_second() {
    // Latched when the device restarted.
    let mut memory = cleared(0);
    memory.resume();
    let kept = FaultRecord { number: 1, fault: 9, latched: false, cycles: SECOND };
    assert_eq!(memory.record(), Some(kept));
    assert_eq!(memory.cycle(1, SECOND - 1).map(|cycle| cycle.cycle), Some(FAULTY));
    // Restarted again before anything ran: still there. The next fault replaces it.
    memory.resume();
    assert_eq!(memory.record(), Some(kept));
    memory.take(&Telemetry { fault: 4, ..full(7) });
    assert_eq!(memory.record(), Some(FaultRecord { number: 2, fault: 4, latched: true, cycles: 1 }));
    // Cleared, and 20 cycles later the device restarted: these are what there is to look at.
    for after in [20, SECOND.into(), 777] {
        let mut memory = cleared(after);
        memory.resume();
        let cycles = after.min(SECOND.into()) as u16;
        assert_eq!(memory.record(), Some(FaultRecord { number: 2, fault: 0, latched: false, cycles }));
        assert_eq!(memory.cycle(2, cycles - 1).map(|cycle| cycle.cycle), Some(999 + after));
        assert_eq!(memory.cycle(2, 0).map(|cycle| cycle.cycle), Some(1000 + after - u32::from(cycles)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn foreign_memory_is_refused_and_used_from_then_on(seed in any::<u32>()) {
        let mut next = seed;
        let mut memory = Box::new(FaultMemory::BLANK);
        for word in memory.words() {
            next = next.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *word = next;
        }
        memory.resume();
        prop_assert_eq!(memory.record(), None);
        memory.take(&full(5));
        memory.take(&Telemetry { fault: 3, ..full(6) });
        prop_assert_eq!(memory.record().map(|record| (record.number, record.cycles)), Some((1, 2)));
        prop_assert_eq!(memory.cycle(1, 0).map(|cycle| cycle.cycle), Some(5));
    }

    #[test]
    fn a_word_that_was_damaged_costs_its_cycle_or_the_record_and_is_never_told(
        place in 0.0..1.0_f64, mask in 1..=u32::MAX, after in 0..700_u32,
    ) {
        let mut memory = cleared(after);
        let place = (place * memory.words().count() as f64) as usize;
        *memory.words().nth(place).expect("one of the words") ^= mask;
        memory.resume();
        let mut lost = 0;
        if let Some(record) = memory.record() {
            prop_assert!(usize::from(record.cycles) <= FAULT_CYCLES);
            for index in 0..record.cycles {
                let Some(cycle) = memory.cycle(record.number, index) else { lost += 1; continue };
                let whole = full(cycle.cycle);
                prop_assert!(cycle.cycle < FAULTY || cycle.cycle >= 1000 || cycle.fault == 9, "{:?}", cycle);
                prop_assert!((cycle.flags, cycle.cost_ticks) == (whole.flags, whole.cost_ticks));
                prop_assert!((cycle.q[4] - whole.q[4]).abs() < 1e-3);
            }
        }
        prop_assert!(lost <= 1, "{}", lost);
        // And the device goes on as if nothing had been.
        memory.take(&full(5000));
        memory.take(&Telemetry { fault: 3, ..full(5001) });
        let record = memory.record().expect("a record");
        prop_assert_eq!((record.fault, record.latched, record.cycles), (3, true, 2));
        prop_assert_eq!(memory.cycle(record.number, 1).map(|cycle| cycle.cycle), Some(5001));
    }
}

#[test]
fn a_session_takes_every_record_even_while_the_line_is_full() {
    let mut rig = Rig::greeted();
    rig.bench.room = 0;
    for number in 0..16 {
        let record = CycleRecord { cycle: number, ..CycleRecord::EMPTY };
        rig.bench.records.push_back(TimedRecord { record, cost_ticks: 1 });
    }
    rig.cycle(16, Fault::Overrun);
    rig.bench.room = 4096;
    let seen = record(&mut rig).expect("a record");
    assert_eq!(cycles(&mut rig, seen), Vec::from_iter(0..=16));
}

/// Everything a host can learn of the record: itself, and each of its cycles.
fn told(memory: &FaultMemory) -> Option<(FaultRecord, Vec<Option<u32>>)> {
    let record = memory.record()?;
    let cycle = |index| memory.cycle(record.number, index).map(|cycle| cycle.cycle);
    Some((record, (0..record.cycles).map(cycle).collect()))
}

/// Words that say which half runs and where the record lies; the cycles of the halves come behind them.
fn head_words() -> usize {
    cleared(0).words().count() - 2 * FAULT_CYCLES * (cleared(0).words().count() / (2 * FAULT_CYCLES))
}

/// The change that makes it fail: the head is kept once. A single bit of it took the record away, and of a fault that
/// was still latched made another one, with a later cycle in place of the fault's.
#[test]
fn no_single_bit_of_the_head_costs_the_record_or_changes_it() {
    for after in [0, 20, 777] {
        for restart in [false, true] {
            let mut sound = cleared(after);
            if restart {
                sound.resume();
            }
            let expected = told(&sound).expect("a record");
            for word in 0..head_words() {
                for bit in 0..32 {
                    let mut memory = cleared(after);
                    *memory.words().nth(word).expect("of the head") ^= 1 << bit;
                    if restart {
                        memory.resume();
                    }
                    assert_eq!(told(&memory).as_ref(), Some(&expected), "{after} {restart} {word}.{bit}");
                    // A fault that is latched goes on, and the next one has the next number.
                    if after == 0 && !restart {
                        memory.take(&Telemetry { fault: 9, ..full(FAULTY + 1) });
                        assert_eq!(told(&memory).as_ref(), Some(&expected), "{word}.{bit}: of the fault's next cycle");
                    }
                    memory.take(&full(5000));
                    memory.take(&Telemetry { fault: 3, ..full(5001) });
                    let next = memory.record().expect("a record");
                    assert_eq!((next.number, next.fault), (expected.0.number + 1, 3), "{after} {restart} {word}.{bit}");
                    let last = memory.cycle(next.number, next.cycles - 1);
                    assert_eq!(last.map(|cycle| cycle.cycle), Some(5001), "{after} {restart} {word}.{bit}");
                }
            }
        }
    }
}

/// Each bit flips while the memory goes on; the damage of one does not wait for that of the next.
#[test]
fn bits_of_the_head_that_flip_one_after_the_other_cost_nothing() {
    let mut memory = cleared(20);
    let expected = told(&memory);
    for turn in 0..32 * head_words() {
        let word = turn / 32;
        *memory.words().nth(word).expect("of the head") ^= 1 << (turn % 32);
        memory.take(&full(2000 + turn as u32));
        assert_eq!(told(&memory), expected, "{turn}");
    }
}

/// The change that makes it fail: the head is kept once.
#[test]
fn a_reset_while_the_head_is_written_costs_nothing() {
    let before: Vec<u32> = cleared(20).words().map(|word| *word).take(head_words()).collect();
    for written in 0..=head_words() {
        let mut memory = cleared(20);
        memory.take(&Telemetry { fault: 3, ..full(5000) });
        for (word, before) in memory.words().zip(&before).skip(written) {
            *word = *before;
        }
        memory.resume();
        let (record, cycles) = told(&memory).expect("a record");
        // The head of before: then it is the second before the restart, which ends with the same cycle.
        assert!(record.number == 2 && matches!(record.fault, 0 | 3) && record.cycles == 21, "{written}: {record:?}");
        assert_eq!((cycles.first(), cycles.last()), (Some(&Some(1000)), Some(&Some(5000))), "{written}");
    }
}

/// The change that makes it fail: what a head that is lost leaves behind is taken for cycles of the new record.
#[test]
fn a_head_that_is_lost_beyond_repair_leaves_no_record_and_no_cycles() {
    for after in [0, 20, 777] {
        let mut memory = cleared(after);
        memory.words().take(head_words()).for_each(|word| *word ^= 0x10);
        assert_eq!(memory.record(), None);
        memory.take(&full(5000));
        memory.take(&Telemetry { fault: 3, ..full(5001) });
        let record = FaultRecord { number: 1, fault: 3, latched: true, cycles: 2 };
        assert_eq!(told(&memory), Some((record, vec![Some(5000), Some(5001)])), "{after}");
    }
}
