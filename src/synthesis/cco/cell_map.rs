//! A map from cells of a grid to numbers, by open addressing.
//!
//! The standard library's map is seeded at random and five times as slow. This one is only asked for single keys, never
//! for its order. It lies in parts that grow one by one, by half, so that growing takes little more memory than what is
//! there.

/// Key of a free slot, which no cell has.
const FREE: u32 = u32::MAX;
/// Parts of the map.
const PARTS: usize = 16;
/// Bits of a hash that choose the part.
const PART_BITS: u32 = PARTS.trailing_zeros();
/// Slots of a new part.
const FIRST_SLOTS: usize = 4;

/// Numbers of cells, whose keys are below `u32::MAX`.
#[derive(Clone, Debug)]
pub(super) struct CellMap {
    parts: [Part; PARTS],
}

#[derive(Clone, Debug)]
struct Part {
    /// Keys and their numbers.
    slots: Vec<[u32; 2]>,
    len: usize,
}

impl Default for CellMap {
    fn default() -> Self {
        let part = |_| Part { slots: vec![[FREE, 0]; FIRST_SLOTS], len: 0 };
        Self { parts: std::array::from_fn(part) }
    }
}

/// Fibonacci hashing: the high bits of the product depend on all bits of the key.
fn hash(key: u32) -> u32 {
    key.wrapping_mul(0x9E37_79B1)
}

impl CellMap {
    fn part(key: u32) -> usize {
        (hash(key) >> (u32::BITS - PART_BITS)) as usize
    }

    pub(super) fn get(&self, key: u32) -> Option<u32> {
        let part = &self.parts[Self::part(key)];
        let [found, value] = part.slots[part.slot(key)];
        (found == key).then_some(value)
    }

    /// The number of a key, to be changed; `value` if the key is new.
    pub(super) fn get_or_insert(&mut self, key: u32, value: u32) -> &mut u32 {
        debug_assert!(key != FREE);
        let part = &mut self.parts[Self::part(key)];
        let mut slot = part.slot(key);
        if part.slots[slot][0] != key {
            // Three quarters full.
            if 4 * (part.len + 1) > 3 * part.slots.len() {
                part.grow();
                slot = part.slot(key);
            }
            part.slots[slot] = [key, value];
            part.len += 1;
        }
        &mut part.slots[slot][1]
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.parts.iter().map(|part| part.slots.capacity() * size_of::<[u32; 2]>()).sum()
    }
}

impl Part {
    /// The slot of a key, or the free one where it belongs.
    fn slot(&self, key: u32) -> usize {
        // The bits below those of the part, as a share of all slots.
        let share = u64::from(hash(key) << PART_BITS);
        let mut slot = ((share * self.slots.len() as u64) >> u32::BITS) as usize;
        while self.slots[slot][0] != key && self.slots[slot][0] != FREE {
            slot = if slot + 1 == self.slots.len() { 0 } else { slot + 1 };
        }
        slot
    }

    fn grow(&mut self) {
        let size = self.slots.len() + self.slots.len() / 2;
        let slots = std::mem::replace(&mut self.slots, vec![[FREE, 0]; size]);
        for [key, value] in slots.into_iter().filter(|slot| slot[0] != FREE) {
            let slot = self.slot(key);
            self.slots[slot] = [key, value];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_keep_their_first_number_until_it_is_changed() {
        let mut map = CellMap::default();
        let keys = || (0..60_000u32).map(|key| key * key);
        for key in keys() {
            assert_eq!(map.get(key), None);
            assert_eq!(*map.get_or_insert(key, !key), !key);
            assert_eq!(*map.get_or_insert(key, 7), !key);
        }
        for key in keys() {
            assert_eq!(map.get(key), Some(!key));
            *map.get_or_insert(key, 7) = key;
        }
        assert!(keys().all(|key| map.get(key) == Some(key)));
        // Between a half and three quarters full.
        assert!((60_000 * 8 * 4 / 3..60_000 * 8 * 21 / 10).contains(&map.bytes()), "{} bytes", map.bytes());
    }
}
