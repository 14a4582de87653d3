//! What is derived from a tissue and takes long, for all who place something in it.

use bevy_math::Vec3;
use std::sync::{Arc, OnceLock};

/// What is derived from a tissue, made when it is first needed. A clone shares it.
#[derive(Clone, Debug, Default)]
pub struct Derived(Arc<Kept>);

#[derive(Debug, Default)]
struct Kept {
    web: OnceLock<Web>,
    /// The floor of the deepest hollow, and the diameter of the tissue for which it was looked for.
    hilum: OnceLock<(f32, Option<Vec3>)>,
}

impl Derived {
    /// The web over the tissue, if it is known.
    pub(crate) fn known_web(&self) -> Option<&Web> {
        self.0.web.get()
    }

    /// The web over the tissue: what `make` gives, if it is not known.
    pub(crate) fn web(&self, make: impl FnOnce() -> Web) -> &Web {
        self.0.web.get_or_init(make)
    }

    /// The floor of the tissue's deepest hollow, in a tissue of this diameter: what `find` gives, if it is not known.
    pub(crate) fn hilum(&self, diameter: f32, find: impl Fn() -> Option<Vec3>) -> Option<Vec3> {
        let &(of, floor) = self.0.hilum.get_or_init(|| (diameter, find()));
        // A stage may be part of tissues of different sizes.
        if of == diameter { floor } else { find() }
    }
}

/// Samples, joined to their nearest neighbours.
#[derive(Debug)]
pub(crate) struct Web {
    /// The samples; the first is the tissue's entrance, if it has one. Fewer than wanted if draws fail.
    pub positions: Vec<Vec3>,
    /// Normals of the tissue at the samples.
    pub normals: Vec<Vec3>,
    pub links: Links,
}

/// The links of every sample.
#[derive(Clone, Debug)]
pub(crate) struct Links {
    starts: Vec<u32>,
    links: Vec<Link>,
}

/// A link from a sample to another one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub to: u32,
    /// How far vessels must grow.
    pub length: f32,
}

impl Links {
    /// Links between pairs of samples, each pair once, with a length.
    pub fn between(samples: usize, pairs: &[(u32, u32, f32)]) -> Self {
        let mut starts = vec![0; samples + 1];
        for &(a, b, _) in pairs {
            starts[a as usize + 1] += 1;
            starts[b as usize + 1] += 1;
        }
        for sample in 1..starts.len() {
            starts[sample] += starts[sample - 1];
        }
        let mut ends = starts.clone();
        let mut links = vec![Link { to: 0, length: 0.0 }; 2 * pairs.len()];
        for &(a, b, length) in pairs {
            for (from, to) in [(a, b), (b, a)] {
                let place = &mut ends[from as usize];
                links[*place as usize] = Link { to, length };
                *place += 1;
            }
        }
        Self { starts, links }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The links of a sample. Those of infinite length are cut.
    pub fn of(&self, sample: u32) -> &[Link] {
        &self.links[self.starts[sample as usize] as usize..self.starts[sample as usize + 1] as usize]
    }

    /// Cuts the link between two samples.
    pub fn cut(&mut self, a: u32, b: u32) {
        for (from, to) in [(a, b), (b, a)] {
            let own = self.starts[from as usize] as usize..self.starts[from as usize + 1] as usize;
            self.links[own].iter_mut().filter(|link| link.to == to).for_each(|link| link.length = f32::INFINITY);
        }
    }
}
