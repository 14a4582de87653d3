//! Sets of numbers that become fewer by union.

/// Sets of the numbers below a count. Each is known by its least number.
pub(crate) struct DisjointSets {
    /// A lower number of the same set, or the number itself.
    lower: Vec<u32>,
}

impl DisjointSets {
    /// Sets of one number each.
    pub fn new(count: usize) -> Self {
        Self { lower: (0..count as u32).collect() }
    }

    /// Makes one set of two.
    pub fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.lower[a.max(b) as usize] = a.min(b);
    }

    /// The least number of a set.
    pub fn first(&mut self, number: u32) -> u32 {
        let mut at = number;
        while self.lower[at as usize] != at {
            // Path halving.
            let next = self.lower[self.lower[at as usize] as usize];
            self.lower[at as usize] = next;
            at = next;
        }
        at
    }

    /// The least number of every set.
    pub fn firsts(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.lower.len()).filter(|&number| self.lower[number] as usize == number)
    }

    /// For each number the place of its set, in the order of the sets' least numbers; and how many sets there are.
    pub fn places(mut self) -> (Vec<usize>, usize) {
        let (mut places, mut count) = (vec![0; self.lower.len()], 0);
        for number in 0..places.len() {
            let first = self.first(number as u32) as usize;
            places[number] = if first == number { count } else { places[first] };
            count += usize::from(first == number);
        }
        (places, count)
    }
}
