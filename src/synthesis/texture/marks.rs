//! A set of numbers that is emptied often.

/// A set of numbers that is emptied often.
pub(super) struct Marks {
    is_marked: Vec<bool>,
    /// Those that are in it, in the order in which they came.
    pub marked: Vec<u32>,
}

impl Marks {
    /// None of so many.
    pub fn of(count: usize) -> Self {
        Self { is_marked: vec![false; count], marked: Vec::new() }
    }

    /// Adds one, once.
    pub fn add(&mut self, number: u32) {
        if !std::mem::replace(&mut self.is_marked[number as usize], true) {
            self.marked.push(number);
        }
    }

    /// Empties it.
    pub fn clear(&mut self) {
        for number in self.marked.drain(..) {
            self.is_marked[number as usize] = false;
        }
    }
}
