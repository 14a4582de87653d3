//! A list of ascending numbers that is made once, and then loses one number after the other.
//!
//! In a tissue that fills there are twenty vacant cells or more for each terminal. They lie in runs, so a bit for each
//! is enough, with the place in the list of every 64th. A number that takes the place of a removed one is kept in a
//! map.

use super::cell_map::CellMap;

/// A list of numbers below `u32::MAX`.
#[derive(Clone, Debug, Default)]
pub(super) struct DwindlingList {
    /// Those of the first numbers, 64 by 64, in which there are any.
    blocks: Vec<Block>,
    /// Numbers that took the place of removed ones, by their place in the list.
    moved: CellMap,
    len: u32,
}

/// Some of 64 numbers in a row.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// A bit for each that is in the list.
    bits: u64,
    /// The first of the 64, divided by 64.
    number: u32,
    /// Place of the first number in the list.
    place: u32,
}

impl DwindlingList {
    pub(super) fn len(&self) -> u32 {
        self.len
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds a number that is larger than all before, to a list that has lost none.
    pub(super) fn push(&mut self, number: u32) {
        let bit = 1 << (number % 64);
        match self.blocks.last_mut() {
            Some(last) if last.number == number / 64 => last.bits |= bit,
            _ => {
                // By a quarter at a time, since memory matters more than time.
                if self.blocks.len() == self.blocks.capacity() {
                    self.blocks.reserve_exact((self.blocks.len() / 4).max(16));
                }
                self.blocks.push(Block { bits: bit, number: number / 64, place: self.len });
            }
        }
        self.len += 1;
    }

    /// Takes out a number, if it is there, from a list that has lost none otherwise. Then the list must be counted.
    pub(super) fn strike(&mut self, number: u32) {
        if let Ok(at) = self.blocks.binary_search_by_key(&(number / 64), |block| block.number) {
            self.blocks[at].bits &= !(1 << (number % 64));
        }
    }

    /// Counts the numbers again, after some were struck.
    pub(super) fn count(&mut self) {
        self.blocks.retain(|block| block.bits != 0);
        self.len = 0;
        for block in &mut self.blocks {
            block.place = self.len;
            self.len += block.bits.count_ones();
        }
    }

    /// The number at a place.
    pub(super) fn get(&self, place: u32) -> u32 {
        self.moved.get(place).unwrap_or_else(|| self.first_at(place))
    }

    /// The number that was at a place before any was removed.
    fn first_at(&self, place: u32) -> u32 {
        let block = &self.blocks[self.blocks.partition_point(|block| block.place <= place) - 1];
        let bits = (block.place..place).fold(block.bits, |bits, _| bits & (bits - 1));
        64 * block.number + bits.trailing_zeros()
    }

    /// Removes the number at a place, which the last one takes.
    pub(super) fn swap_remove(&mut self, place: u32) {
        self.len -= 1;
        if place < self.len {
            let last = self.get(self.len);
            *self.moved.get_or_insert(place, last) = last;
        }
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<Block>() + self.moved.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn numbers_are_where_a_plain_list_has_them() {
        let mut rng = Stream::Statistics.rng(2);
        for share in [0.9, 0.3, 0.01] {
            let mut list = DwindlingList::default();
            let mut plain: Vec<u32> = (0..40_000).filter(|_| rng.random::<f64>() < share).collect();
            for &number in &plain {
                list.push(number);
            }
            let is_struck = |number: &u32| number % 7 == 3 || (640..900).contains(number);
            (0..40_000).filter(is_struck).for_each(|number| list.strike(number));
            plain.retain(|number| !is_struck(number));
            list.count();
            let at_start = list.bytes();
            // A plain list takes four bytes a number.
            assert!(plain.len() < 10_000 || at_start < 2 * plain.len(), "{at_start} bytes for {} numbers", plain.len());
            while !plain.is_empty() {
                assert_eq!((list.len() as usize, list.is_empty()), (plain.len(), false));
                let place = rng.random_range(0..plain.len());
                assert_eq!(list.get(place as u32), plain[place]);
                if rng.random::<f64>() < 0.5 {
                    list.swap_remove(place as u32);
                    plain.swap_remove(place);
                }
            }
            assert!(list.is_empty());
        }
    }
}
