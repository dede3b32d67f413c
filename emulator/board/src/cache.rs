//! The data cache as far as bank 2 of the flash is concerned: lines keep what the memory held when they were filled.
//!
//! 16 KiB in 128 sets of four ways with lines of 32 bytes, as the chip's. Only reads of bank 2 fill it here, so its
//! lines live longer than beside all other traffic: what is stale in silicon now and then is stale here every time.

/// Bytes of a line.
pub const LINE: u32 = 32;

const SETS: usize = 128;
const WAYS: usize = 4;

/// Bank 2.
pub const BANK: std::ops::Range<u32> = 0x0810_0000..0x0820_0000;

/// Registers of cache maintenance in the processor's own space, first and last address.
pub const MAINTENANCE: std::ops::Range<u32> = 0xE000_EF50..0xE000_EF7C;

/// Maintenance of data lines by address: invalidate; clean and invalidate.
const BY_ADDRESS: [u32; 2] = [0xE000_EF5C, 0xE000_EF70];
/// The same by set and way.
const BY_SET: [u32; 2] = [0xE000_EF60, 0xE000_EF74];

#[derive(Clone, Copy, Debug)]
struct Held {
    address: u32,
    bytes: [u8; LINE as usize],
}

/// Counters of the cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheCount {
    /// Reads of bank 2.
    pub reads: u64,
    /// Of them, those that went through the cache.
    pub cacheable: u64,
    /// Of these, those that found a line.
    pub hits: u64,
    /// Of these, those whose line differed from the memory.
    pub stale: u64,
    /// Where the program was at the first stale read.
    pub first_stale: Option<u32>,
}

/// The cache.
#[derive(Debug)]
pub struct DataCache {
    sets: Vec<[Option<Held>; WAYS]>,
    /// The way that is replaced next, of each set.
    next: Vec<usize>,
    /// Counters so far.
    pub count: CacheCount,
}

impl Default for DataCache {
    fn default() -> Self {
        Self { sets: vec![[None; WAYS]; SETS], next: vec![0; SETS], count: CacheCount::default() }
    }
}

fn set_of(address: u32) -> usize {
    (address / LINE) as usize % SETS
}

impl DataCache {
    /// Forgets every line, as a reset does.
    pub fn clear(&mut self) {
        let count = self.count;
        *self = Self { count, ..Self::default() };
    }

    /// The line that holds an address, if there is one.
    #[must_use]
    pub fn line(&self, address: u32) -> Option<&[u8; LINE as usize]> {
        let wanted = address & !(LINE - 1);
        self.sets[set_of(address)].iter().flatten().find(|held| held.address == wanted).map(|held| &held.bytes)
    }

    /// Puts a line in the place of the oldest of its set.
    pub fn fill(&mut self, address: u32, bytes: [u8; LINE as usize]) {
        let set = set_of(address);
        let way = self.next[set];
        self.sets[set][way] = Some(Held { address: address & !(LINE - 1), bytes });
        self.next[set] = (way + 1) % WAYS;
    }

    /// A store goes through to the memory; a line that is there takes it as well.
    pub fn store(&mut self, address: u32, bytes: &[u8]) {
        let wanted = address & !(LINE - 1);
        let held = self.sets[set_of(address)].iter_mut().flatten().find(|held| held.address == wanted);
        let place = held.and_then(|held| held.bytes.get_mut((address - wanted) as usize..));
        for (place, byte) in place.unwrap_or(&mut []).iter_mut().zip(bytes) {
            *place = *byte;
        }
    }

    /// A write to one of the maintenance registers.
    pub fn maintain(&mut self, register: u32, value: u32) {
        if BY_ADDRESS.contains(&register) {
            let wanted = value & !(LINE - 1);
            for place in &mut self.sets[set_of(value)] {
                place.take_if(|held| held.address == wanted);
            }
        } else if BY_SET.contains(&register) {
            let (set, way) = ((value >> 5) as usize % SETS, (value >> 30) as usize);
            self.sets[set][way] = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_what_it_was_filled_with_until_it_is_invalidated() {
        let mut cache = DataCache::default();
        cache.fill(0x0810_0024, [7; 32]);
        assert_eq!(cache.line(0x0810_003F), Some(&[7; 32]));
        assert_eq!(cache.line(0x0810_0040), None);
        cache.maintain(0xE000_EF68, 0x0810_0020);
        assert!(cache.line(0x0810_0020).is_some(), "cleaning keeps the line");
        cache.maintain(0xE000_EF5C, 0x0810_0030);
        assert_eq!(cache.line(0x0810_0020), None);
    }

    #[test]
    fn a_fifth_line_of_a_set_drives_the_first_out() {
        let mut cache = DataCache::default();
        for way in 0..5 {
            cache.fill(0x0810_0000 + way * 4096, [way as u8; 32]);
        }
        assert_eq!(cache.line(0x0810_0000), None);
        assert_eq!(cache.line(0x0810_4000), Some(&[4; 32]));
    }

    #[test]
    fn maintenance_by_set_and_way_empties_one_place() {
        let mut cache = DataCache::default();
        cache.fill(0x0810_0020, [1; 32]);
        cache.fill(0x0810_1020, [2; 32]);
        cache.maintain(0xE000_EF60, 1 << 30 | 1 << 5);
        assert!(cache.line(0x0810_0020).is_some());
        assert_eq!(cache.line(0x0810_1020), None);
    }
}
