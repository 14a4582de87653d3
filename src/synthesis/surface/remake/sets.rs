//! Disjoint sets of things with numbers.

/// Which things belong together.
pub(super) struct Sets {
    before: Vec<usize>,
}

impl Sets {
    /// So many things, each alone.
    pub fn new(count: usize) -> Self {
        Self { before: (0..count).collect() }
    }

    /// The first thing of a thing's set.
    pub fn first(&mut self, mut thing: usize) -> usize {
        while self.before[thing] != thing {
            self.before[thing] = self.before[self.before[thing]];
            thing = self.before[thing];
        }
        thing
    }

    /// Makes one set of two.
    pub fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [a, b].map(|thing| self.first(thing));
        self.before[a.max(b)] = a.min(b);
    }

    /// For each thing, the number of its set, in the order of their first things.
    pub fn numbers(mut self) -> Vec<usize> {
        let mut numbers = vec![0; self.before.len()];
        let mut count = 0;
        for thing in 0..numbers.len() {
            let first = self.first(thing);
            numbers[thing] = if first == thing { count } else { numbers[first] };
            count += usize::from(first == thing);
        }
        numbers
    }
}
