//! `FaultMemory`: the last second before a fault, kept until the next fault, and over a restart.
//!
//! Two halves of a second each. One runs: each control cycle replaces the oldest of it. The first fault ends that, and
//! the half is kept until the next fault; when the fault is cleared, the other half begins to run. The session fills it
//! from the records that it takes for telemetry anyway, so the control cycle spends nothing on it.
//!
//! All of it is plain words, each content of which is a valid value: a board may place it in memory that nobody clears.
//! [`FaultMemory::resume`] then finds what is whole. A cycle carries its running number and a check sum, so that one
//! whose writing was cut by a reset is left out, and the place of the newest follows from the cycles alone. What says
//! which half runs and where the record lies is kept twice, each with its own check sum: a bit that falls over, or a
//! reset between the two, costs nothing. If both are damaged the record is lost, and no cycle is taken for a new one.

use core::sync::atomic::{Ordering, compiler_fence};

use link::{FaultRecord, ShortTelemetry, Telemetry};

/// Cycles of a record: one second.
pub const FAULT_CYCLES: usize = control::RATE_HZ as usize;

/// Words of a cycle: running number (two), the cycle in its short form, the check sum.
const CYCLE_WORDS: usize = 2 + size_of::<ShortTelemetry>() / 4 + 1;
/// Magic number, content, check sum.
const HEAD_WORDS: usize = 10;
/// "TaF3" and the schema of the link: a program with another telemetry does not read the cycles of this one, nor does
/// one that rounds them in other steps.
const MAGIC: u32 = u32::from_le_bytes(*b"TaF3") ^ link::SCHEMA_HASH;

type Cycle = [u32; CYCLE_WORDS];

/// The half that is kept, and the one that runs.
#[derive(Clone, Copy, Debug, Default)]
struct Head {
    /// Half that runs, 0 or 1; the other one is kept.
    running: u32,
    /// Records so far; 0: none is kept.
    records: u32,
    /// Fault of the kept record, 0 for a restart.
    fault: u32,
    /// 1 until the fault is cleared.
    latched: u32,
    /// Running numbers of the kept cycles: the first, and the one behind the last.
    from: u64,
    until: u64,
}

impl Head {
    /// With the magic number in front and a check sum at the end.
    fn to_words(self) -> [u32; HEAD_WORDS] {
        let Head { running, records, fault, latched, from, until } = self;
        let ([from, from_high], [until, until_high]) = (split(from), split(until));
        let content = [MAGIC, running, records, fault, latched, from, from_high, until, until_high];
        let [a, b, c, d, e, f, g, h, i] = content;
        [a, b, c, d, e, f, g, h, i, sum(&content)]
    }

    /// `None` if these are not words that [`Head::to_words`] made.
    fn from_words(words: &[u32; HEAD_WORDS]) -> Option<Head> {
        let [_, running, records, fault, latched, from, from_high, until, until_high, _] = *words;
        let head =
            Head { running, records, fault, latched, from: join(from, from_high), until: join(until, until_high) };
        (head.to_words() == *words && running <= 1).then_some(head)
    }
}

/// The last second before a fault; 74 kB.
#[derive(Debug)]
pub struct FaultMemory {
    /// [`Head`], twice, or anything before [`FaultMemory::resume`]. The first is written first.
    heads: [[u32; HEAD_WORDS]; 2],
    /// Running number of the next cycle. Found anew by [`FaultMemory::resume`].
    next: u64,
    /// Cycles in the running half.
    filled: u64,
    halves: [[Cycle; FAULT_CYCLES]; 2],
}

impl FaultMemory {
    /// All zeros, as a static begins that is never cleared. Not to be used before [`FaultMemory::resume`].
    pub const BLANK: FaultMemory =
        FaultMemory { heads: [[0; HEAD_WORDS]; 2], next: 0, filled: 0, halves: [[[0; CYCLE_WORDS]; FAULT_CYCLES]; 2] };

    /// Begins a run of the device with whatever the memory holds. A record of a fault is kept; one that a person has
    /// cleared, or none, makes room for the last second before the restart. Foreign and torn content is forgotten.
    pub fn resume(&mut self) {
        let Some(head) = self.whole_head() else { return self.forget() };
        let newest = self.half(head.running).iter().enumerate().filter_map(whole).max();
        self.next = newest.map_or(0, |number| number.wrapping_add(1)).max(head.until);
        self.filled = self.next.saturating_sub(head.until).min(FAULT_CYCLES as u64);
        self.write(head);
        if head.latched == 0 && self.filled > 0 {
            self.keep(head, 0);
        }
        self.clear();
    }

    /// Takes a control cycle: writes it down, unless a fault is latched since an earlier one.
    pub fn take(&mut self, cycle: &Telemetry) {
        match self.whole_head() {
            // Together again before the other one is damaged as well.
            Some(head) if self.is_damaged() => self.write(head),
            Some(_) => {}
            None => self.forget(),
        }
        if self.head().latched == 1 {
            if cycle.fault != 0 {
                return;
            }
            self.clear();
        }
        let head = self.head();
        let words = encode(self.next, cycle);
        let place = place(self.next);
        if let Some(entry) = self.halves.get_mut(head.running as usize).and_then(|half| half.get_mut(place)) {
            *entry = words;
        }
        self.next = self.next.wrapping_add(1);
        self.filled = (self.filled + 1).min(FAULT_CYCLES as u64);
        if cycle.fault != 0 {
            self.keep(head, cycle.fault);
        }
    }

    /// The record of the last fault, if there is one.
    pub fn record(&self) -> Option<FaultRecord> {
        let Head { records, fault, latched, from, until, .. } = self.head();
        (records > 0).then(|| FaultRecord {
            number: records as u16,
            fault: fault as u8,
            latched: latched == 1,
            cycles: until.wrapping_sub(from) as u16,
        })
    }

    /// A cycle of the record with this number, oldest first. `None` behind the last, for another record, and for a
    /// cycle that a reset has damaged.
    pub fn cycle(&self, number: u16, index: u16) -> Option<Telemetry> {
        let record = self.record().filter(|record| record.number == number && index < record.cycles)?;
        let head = self.head();
        let wanted = head.from.wrapping_add(index.into());
        let kept = self.half(if record.latched { head.running } else { 1 - head.running });
        let entry = kept.get(place(wanted))?;
        (whole((place(wanted), entry)) == Some(wanted)).then(|| decode(entry))
    }

    /// Every word that a restart may leave as it likes: to be spoiled in tests.
    pub fn words(&mut self) -> impl Iterator<Item = &mut u32> {
        self.heads.iter_mut().flatten().chain(self.halves.iter_mut().flatten().flatten())
    }

    fn head(&self) -> Head {
        self.whole_head().unwrap_or_default()
    }

    /// The newer one of those that are whole.
    fn whole_head(&self) -> Option<Head> {
        self.heads.iter().find_map(Head::from_words)
    }

    /// True if one of the two is damaged.
    fn is_damaged(&self) -> bool {
        let [first, second] = &self.heads;
        first != second
    }

    /// Nothing is known of the cycles: they may be whole ones of an earlier life, and none may be taken for a new one.
    fn forget(&mut self) {
        (self.next, self.filled) = (0, 0);
        for half in &mut self.halves {
            half.fill([0; CYCLE_WORDS]);
        }
        self.write(Head::default());
    }

    fn half(&self, which: u32) -> &[Cycle] {
        self.halves.get(which as usize).map_or(&[], |half| half.as_slice())
    }

    /// The running half is the record from now on; nothing runs until [`FaultMemory::clear`].
    fn keep(&mut self, head: Head, fault: u8) {
        let records = match head.records as u16 {
            u16::MAX => 1,
            records => u32::from(records) + 1,
        };
        let from = self.next.wrapping_sub(self.filled);
        self.write(Head { records, fault: fault.into(), latched: 1, from, until: self.next, ..head });
    }

    /// If there is a record, the other half runs. It begins empty: the cycles that are in it have earlier numbers.
    fn clear(&mut self) {
        let head = self.head();
        if head.latched == 1 {
            self.filled = 0;
            self.write(Head { latched: 0, running: 1 - head.running, ..head });
        }
    }

    fn write(&mut self, head: Head) {
        let words = head.to_words();
        for place in &mut self.heads {
            *place = words;
            // One after the other, so that a reset finds one of them whole.
            compiler_fence(Ordering::SeqCst);
        }
    }
}

const fn place(number: u64) -> usize {
    (number % FAULT_CYCLES as u64) as usize
}

const fn join(low: u32, high: u32) -> u64 {
    low as u64 | (high as u64) << 32
}

const fn split(number: u64) -> [u32; 2] {
    [number as u32, (number >> 32) as u32]
}

/// The running number of a cycle that is whole and stands where it belongs.
fn whole((index, cycle): (usize, &Cycle)) -> Option<u64> {
    let [low, high, ..] = *cycle;
    let number = join(low, high);
    let (check, content) = cycle.split_last()?;
    (place(number) == index && sum(content) == *check).then_some(number)
}

/// FNV-1a by words: a word that differs always changes it.
fn sum(words: &[u32]) -> u32 {
    words.iter().fold(0x811C_9DC5, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193))
}

fn encode(number: u64, cycle: &Telemetry) -> Cycle {
    let mut words = [0; CYCLE_WORDS];
    let content = split(number).into_iter().chain(cycle.shortened());
    for (word, value) in words.iter_mut().zip(content) {
        *word = value;
    }
    if let Some((check, content)) = words.split_last_mut() {
        *check = sum(content);
    }
    words
}

fn decode(words: &Cycle) -> Telemetry {
    let [_, _, short @ .., _] = words;
    Telemetry::from_short(short)
}
