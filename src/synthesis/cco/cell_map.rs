//! A map from cells of a grid to numbers, by open addressing.
//!
//! The standard library's map is seeded at random and five times as slow. This one is only asked for single keys, never
//! for its order.

const EMPTY: u64 = u64::MAX;

/// Numbers of cells.
#[derive(Clone, Debug)]
pub(super) struct CellMap {
    keys: Vec<u64>,
    values: Vec<u32>,
    len: usize,
}

impl Default for CellMap {
    fn default() -> Self {
        Self { keys: vec![EMPTY; 16], values: vec![0; 16], len: 0 }
    }
}

impl CellMap {
    pub(super) fn clear(&mut self) {
        self.keys.fill(EMPTY);
        self.len = 0;
    }

    /// The slot of a key, or the empty one where it belongs.
    fn slot(&self, key: u64) -> usize {
        let mask = self.keys.len() - 1;
        // Fibonacci hashing: the high bits of the product depend on all bits of the key.
        let mut slot = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & mask;
        while self.keys[slot] != key && self.keys[slot] != EMPTY {
            slot = (slot + 1) & mask;
        }
        slot
    }

    pub(super) fn get(&self, key: u64) -> Option<u32> {
        let slot = self.slot(key);
        (self.keys[slot] == key).then(|| self.values[slot])
    }

    /// The number of a key, which is `value` if it is new.
    pub(super) fn get_or_insert(&mut self, key: u64, value: u32) -> u32 {
        let slot = self.slot(key);
        if self.keys[slot] == key {
            return self.values[slot];
        }
        (self.keys[slot], self.values[slot]) = (key, value);
        self.len += 1;
        // Three quarters full.
        if 4 * self.len > 3 * self.keys.len() {
            self.grow();
        }
        value
    }

    fn grow(&mut self) {
        let size = 2 * self.keys.len();
        let keys = std::mem::replace(&mut self.keys, vec![EMPTY; size]);
        let values = std::mem::replace(&mut self.values, vec![0; size]);
        for (key, value) in keys.into_iter().zip(values) {
            if key != EMPTY {
                let slot = self.slot(key);
                (self.keys[slot], self.values[slot]) = (key, value);
            }
        }
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.keys.capacity() * 8 + self.values.capacity() * 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_keep_their_first_number() {
        let mut map = CellMap::default();
        for key in 0..10_000u64 {
            assert_eq!(map.get(key * key), None);
            assert_eq!(map.get_or_insert(key * key, key as u32), key as u32);
            assert_eq!(map.get_or_insert(key * key, 7), key as u32);
        }
        for key in 0..10_000u64 {
            assert_eq!(map.get(key * key), Some(key as u32));
        }
        map.clear();
        assert_eq!(map.get(4), None);
    }
}
