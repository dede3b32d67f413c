//! The message memory: content after power-up, both controllers in one memory, the erratum.

use crate::bench::*;
use fdcan_model::{Controllers, Frame, MEMORY_WORDS, Options, RemarkKind, Unit};

#[test]
fn after_power_up_the_memory_is_random_repeatable_and_told() {
    let content = |seed| {
        let mut can = Controllers::new(Options { seed, ..Options::default() });
        let words: Vec<u32> = (0..MEMORY_WORDS).map(|word| can.read_memory(4 * word, 0)).collect();
        let remarks = can.take_remarks();
        assert!(remarks.iter().all(|remark| remark.kind == RemarkKind::Unwritten && remark.unit.is_none()));
        assert_eq!(remarks.len(), MEMORY_WORDS as usize);
        words
    };
    let words = content(1);
    assert_eq!(words, content(1));
    assert_ne!(words, content(2));
    assert!(words.iter().filter(|word| **word == 0).count() < 3);
}

#[test]
fn a_written_word_is_read_back_without_a_remark_and_has_an_end() {
    let mut bench = Bench::new(Options::default());
    bench.set(4 * (MEMORY_WORDS - 1), 0xCAFE);
    assert_eq!(bench.can.read_memory(4 * (MEMORY_WORDS - 1), bench.now), 0xCAFE);
    assert_eq!(bench.remarks(), []);
    bench.set(4 * MEMORY_WORDS, 1);
    assert_eq!(bench.can.read_memory(4 * MEMORY_WORDS, bench.now), 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "RAM"), (RemarkKind::Suspicious, "RAM")]);
}

/// Both controllers on their bus, FDCAN2 configured as the image does.
fn both(options: Options) -> Bench {
    let mut bench = Bench::with(options, &[]);
    bench.set(0x2B4, 0b10 << 30 | 1 << 27 | 0x010 << 16 | 0x7F0);
    let values = [(NBTP, 0x0009_0401), (GFC, 0x2B), (SIDFC, 0x0001_02B4), (RXF0C, 0x0040_02B8), (TXBC, 0x2000_06B8)];
    bench.configure(Unit::Two, &values);
    bench.can.write(Unit::Two, CCCR, 0, bench.now);
    bench.pass(20);
    bench
}

#[test]
fn both_controllers_use_one_memory() {
    let mut bench = both(Options::default());
    bench.pass(200);
    bench.can.received(Unit::Two, &Frame::standard(0x01A, &[7]), bench.now);
    assert_eq!(bench.can.peek(Unit::Two, RXF0S) & 0x7F, 1);
    assert_eq!(bench.can.peek_memory(0x2B8), 0x01A << 18);
    assert_eq!(bench.held()[0], 0, "the other controller has received nothing");
    // A receive FIFO laid over the filters of the other controller destroys them.
    bench.can.write(Unit::Two, CCCR, 1, bench.now);
    bench.pass(1);
    bench.configure(Unit::Two, &[(RXF0C, 0x0040_0000)]);
    bench.can.write(Unit::Two, CCCR, 0, bench.now);
    bench.pass(200);
    bench.can.received(Unit::Two, &Frame::standard(0x010, &[]), bench.now);
    assert_eq!(bench.can.peek_memory(0), 0x010 << 18);
}

#[test]
fn fdcan2_passes_the_sixteen_segments_of_its_device() {
    let mut bench = both(Options::default());
    let mut passed = Vec::new();
    for id in 0..0x800 {
        bench.pass(150);
        bench.can.received(Unit::Two, &Frame::standard(id, &[]), bench.now);
        let status = bench.can.peek(Unit::Two, RXF0S);
        if status & 0x7F > 0 {
            passed.push(id);
            bench.can.write(Unit::Two, RXF0A, status >> 8 & 0x3F, bench.now);
        }
    }
    assert_eq!(passed, (0x010..0x020).collect::<Vec<u16>>());
}

/// Number of reads of a written word, of many, that are wrong.
fn wrong_reads(bench: &mut Bench) -> usize {
    bench.set(0x2000, 0x1234_5678);
    bench.remarks();
    let wrong = (0..10_000).filter(|_| bench.can.read_memory(0x2000, bench.now) != 0x1234_5678).count();
    assert_eq!(bench.remarks().iter().filter(|remark| remark.0 == RemarkKind::Erratum).count(), wrong);
    wrong
}

#[test]
fn with_the_erratum_some_reads_are_wrong_while_both_controllers_work() {
    let erratum = Options { erratum: true, ..Options::default() };
    let wrong = wrong_reads(&mut both(erratum));
    assert!((80..250).contains(&wrong), "{wrong}");
    assert_eq!(wrong, wrong_reads(&mut both(erratum)), "repeatable");
    assert_eq!(wrong_reads(&mut both(Options::default())), 0, "not on later revisions");
    assert_eq!(wrong_reads(&mut Bench::with(erratum, &[])), 0, "not while only one works");
}
