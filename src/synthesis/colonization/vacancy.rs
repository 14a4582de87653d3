//! Tracks the parts of the tissue that can still take a drain, so that candidates are drawn only there.
//!
//! As tissue fills, nearly every candidate is refused, because it lies within the birth distance of a node or of a
//! drain. The tissue is cut into small [pieces](TissuePiece), and a piece that lies wholly within the reach of one of
//! these *blockers* can take no drain. Only the samples of a step that would fall on the other pieces are drawn: their
//! number is random, by the pieces' share of the tissue. Accepted candidates are distributed as if all samples had been
//! drawn.
//!
//! Blockers' reaches shrink with λ. Every piece stores the λ below which its nodes, and one of its drains, stop
//! blocking it. Pieces are checked whenever λ has shrunk a little, and count as blocked only if they stay so until the
//! next check.

use crate::synthesis::random::VesselRng;
use crate::synthesis::random::alias_table::AliasTable;
use crate::synthesis::random::many;
use crate::synthesis::space::point_grid::PointGrid;
use crate::synthesis::tissue::{Extent, Tissue, TissuePiece};
use bevy_math::Vec3;

/// Reach of a piece as a share of the smaller radius of the blockers, when pieces are cut.
const FINENESS: f32 = 0.4;
/// Share of the λ of the last cut at which pieces are cut again.
const COARSE: f32 = 0.6;
/// Factor by which λ shrinks between two checks of the pieces.
const PATIENCE: f32 = 0.85;
/// Pieces of more than this share of the radius don't pay.
const USELESS: f32 = 0.45;
/// Share of the listed pieces that must be free; otherwise they are listed again.
const ENOUGH: f64 = 0.5;
/// Fewest samples in a whole growth for every piece: more pieces than that cost more than they save.
const SAMPLES_PER_PIECE: u64 = 50;
/// No drain.
const NONE: u32 = u32::MAX;

/// The pieces of a tissue, and their blockers.
#[derive(Debug, Default)]
pub(crate) struct Vacancy {
    /// Radii of nodes and drains as blockers, at λ = 1.
    radii: [f32; 2],
    /// The λ of the last cut, and that of the next check of the pieces. Zero before the first time.
    cut_at: f32,
    until: f32,
    pieces: Vec<TissuePiece>,
    /// Index over the pieces' centres.
    index: PointGrid,
    /// The reach for which pieces were cut.
    reach: f32,
    blocked: Vec<Blocked>,
    /// Number of known nodes.
    covered: usize,
    /// Samples of the whole growth.
    samples: u64,
    /// Pieces that candidates are drawn from: all that were free when the list was made.
    listed: Vec<u32>,
    /// Draws the listed ones, unless they are `even` in measure.
    shares: AliasTable,
    even: bool,
    /// Measures of the whole tissue, of the listed pieces, and of the free ones among them.
    whole: f64,
    listed_measure: f64,
    free_measure: f64,
}

/// The λ below which no node blocks a piece, and that of one drain.
#[derive(Clone, Copy, Debug)]
struct Blocked {
    by_nodes: f32,
    by_drain: f32,
    drain: u32,
}

impl Blocked {
    const FREE: Self = Self { by_nodes: f32::INFINITY, by_drain: f32::INFINITY, drain: NONE };

    fn until(&self, scale: f32) -> bool {
        self.by_nodes <= scale || self.by_drain <= scale
    }
}

impl Vacancy {
    /// Sets the radii of nodes and drains as blockers, at λ = 1, and the samples of the whole growth.
    pub fn reset(&mut self, radii: [f32; 2], samples: u64) {
        (self.radii, self.samples) = (radii, samples);
        (self.cut_at, self.until) = (0.0, 0.0);
        self.pieces.clear();
    }

    /// Prepares for the candidates of a step, given λ and all blockers: nodes, with whether one supplies a side of a surface,
    /// and drains. Does nothing for tissues that cannot be cut.
    pub fn prepare(
        &mut self,
        tissue: &dyn Tissue,
        scale: f32,
        (nodes, supplies): (&[Vec3], impl Fn(u32, Vec3) -> bool),
        drains: impl Iterator<Item = (u32, Vec3)>,
    ) {
        if scale > self.cut_at || scale < self.cut_at * COARSE {
            self.cut(tissue, scale);
            self.covered = 0;
            drains.for_each(|(drain, position)| self.add_drain(drain, position));
        } else if scale < self.until {
            self.until = scale * PATIENCE;
            self.listed_measure = f64::INFINITY;
        }
        if self.pieces.is_empty() {
            return;
        }
        for (node, &position) in nodes.iter().enumerate().skip(self.covered) {
            self.add_node(position, |side| supplies(node as u32, side));
        }
        self.covered = nodes.len();
        if self.free_measure < ENOUGH * self.listed_measure {
            self.list();
        }
    }

    /// Returns this if the tissue has pieces to choose from.
    pub fn chosen(&self) -> Option<&Self> {
        (!self.pieces.is_empty()).then_some(self)
    }

    fn cut(&mut self, tissue: &dyn Tissue, scale: f32) {
        (self.cut_at, self.until) = (scale, scale);
        self.pieces.clear();
        let smaller = self.radii[0].min(self.radii[1]) * scale;
        let Extent::Area(area) = tissue.extent() else { return };
        // A square whose half diagonal is `reach` has an area of twice its square.
        let coarsest = (0.5 * area / (self.samples / SAMPLES_PER_PIECE).max(1) as f32).sqrt();
        self.reach = coarsest.max(FINENESS * smaller);
        if !(self.reach < USELESS * smaller && tissue.cut(self.reach, &mut self.pieces)) {
            self.pieces.clear();
            return;
        }
        self.index.reset(&tissue.bounds(), 2.0 * self.reach);
        self.pieces.iter().for_each(|piece| _ = self.index.push(piece.center));
        self.blocked.clear();
        self.blocked.resize(self.pieces.len(), Blocked::FREE);
        self.whole = self.pieces.iter().map(|piece| f64::from(piece.measure)).sum();
        self.listed_measure = f64::INFINITY;
        self.free_measure = 0.0;
    }

    /// Lists the pieces that no node blocks.
    fn list(&mut self) {
        let Self { pieces, blocked, until, listed, .. } = self;
        listed.clear();
        listed.extend((0..pieces.len() as u32).filter(|&piece| blocked[piece as usize].by_nodes > *until));
        let measure = |&piece: &u32| f64::from(pieces[piece as usize].measure);
        self.listed_measure = listed.iter().map(measure).sum();
        self.free_measure = self.listed_measure;
        self.even = listed.windows(2).all(|pair| pieces[pair[0] as usize].measure == pieces[pair[1] as usize].measure);
        if !self.even {
            self.shares.rebuild(listed.len(), |slot| measure(&listed[slot]));
        }
    }

    fn add_node(&mut self, position: Vec3, supplies: impl Fn(Vec3) -> bool) {
        let Self { pieces, index, blocked, until, radii, free_measure, .. } = self;
        let inverse = radii[0].recip();
        index.for_each_within(position, radii[0] * *until, |piece, distance| {
            let (piece, blocked) = (&pieces[piece as usize], &mut blocked[piece as usize]);
            let threshold = (distance.sqrt() + piece.reach) * inverse;
            if threshold <= *until && threshold < blocked.by_nodes && supplies(piece.side) {
                if blocked.by_nodes > *until {
                    *free_measure -= f64::from(piece.measure);
                }
                blocked.by_nodes = threshold;
            }
        });
    }

    /// Adds a drain that has been born.
    pub fn add_drain(&mut self, drain: u32, position: Vec3) {
        let Self { pieces, index, blocked, until, radii, .. } = self;
        if pieces.is_empty() {
            return;
        }
        let inverse = radii[1].recip();
        index.for_each_within(position, radii[1] * *until, |piece, distance| {
            let threshold = (distance.sqrt() + pieces[piece as usize].reach) * inverse;
            let blocked = &mut blocked[piece as usize];
            if threshold <= *until && threshold < blocked.by_drain {
                (blocked.by_drain, blocked.drain) = (threshold, drain);
            }
        });
    }

    /// Removes a drain that is gone.
    pub fn remove_drain(&mut self, drain: u32, position: Vec3) {
        let Self { pieces, index, blocked, until, radii, .. } = self;
        if pieces.is_empty() {
            return;
        }
        index.for_each_within(position, radii[1] * *until, |piece, _| {
            let blocked = &mut blocked[piece as usize];
            if blocked.drain == drain {
                (blocked.by_drain, blocked.drain) = (f32::INFINITY, NONE);
            }
        });
    }

    /// Draws as many candidates as fall on listed pieces of `count` samples, except those on pieces that are blocked by
    /// now. There must be pieces.
    pub fn draw(&self, tissue: &dyn Tissue, rng: &mut VesselRng, count: u32, candidates: &mut Vec<Vec3>) {
        let share = self.listed_measure / self.whole;
        let falling = if share < 1.0 { many::count_below(rng, count, share) } else { count };
        let slots = self.listed.len() as u32;
        many::each(rng, falling, |[slot, keep, x, y, z]| {
            let slot = many::below(slot, slots);
            let slot = if self.even { slot } else { self.shares.pick(slot, many::unit(keep)) };
            let piece = self.listed[slot as usize] as usize;
            if !self.blocked[piece].until(self.until) {
                let numbers = [x, y, z].map(many::unit);
                candidates.extend(tissue.point_of(self.reach, self.pieces[piece].id, numbers));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::mesh::TriangleMesh;
    use crate::synthesis::random::Stream;
    use crate::synthesis::tissue::{DensityField, DensityTissue, Disc, MeshSurface, Rectangle};
    use bevy_math::Vec2;
    use std::sync::Arc;

    /// A pyramid without a base, of large triangles and a small one.
    fn pyramid() -> MeshSurface {
        let positions =
            [(0.5, 0.5, 0.4), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (1.1, 0.0, 0.0)];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [2, 5, 3]];
        MeshSurface::new(TriangleMesh::new(positions.map(Vec3::from).to_vec(), triangles, None).unwrap()).unwrap()
    }

    fn tissues() -> [Arc<dyn Tissue>; 4] {
        let disc: Arc<dyn Tissue> = Arc::new(Disc::new(Vec3::ONE, Vec3::new(1.0, 2.0, -0.5), 0.5).unwrap());
        let slope = DensityField::function(|point| point.x - 0.5);
        [
            Arc::clone(&disc),
            Arc::new(Rectangle::flat(Vec2::new(1.0, 0.7)).unwrap()),
            Arc::new(pyramid()),
            Arc::new(DensityTissue::new(disc, slope).unwrap()),
        ]
    }

    #[test]
    fn pieces_make_up_the_tissue_and_hold_their_points() {
        for (case, tissue) in tissues().into_iter().enumerate() {
            let Extent::Area(area) = tissue.extent() else { unreachable!() };
            for reach in [0.03, 0.2, 9.0] {
                let mut pieces = Vec::new();
                assert!(tissue.cut(reach, &mut pieces));
                let sum: f32 = pieces.iter().map(|piece| piece.measure).sum();
                assert!((sum / area - 1.0).abs() < 1e-3, "case {case}: {sum} of {area}");
                let mut rng = Stream::Statistics.rng(1);
                for piece in &pieces {
                    assert!(piece.reach <= 1.02 * reach, "case {case}: a piece reaches {} of {reach}", piece.reach);
                    many::each(&mut rng, 8, |words: [u32; 3]| {
                        let Some(point) = tissue.point_of(reach, piece.id, words.map(many::unit)) else { return };
                        assert!(tissue.contains(point), "case {case}: {point} is not in the tissue");
                        assert!(point.distance(piece.center) <= piece.reach * 1.001 + 1e-6, "case {case}, {piece:?}");
                    });
                }
            }
        }
    }

    /// Compares draws from the pieces with plain draws: equally many in every part of the tissue, whatever blocks the
    /// rest.
    #[test]
    fn what_is_drawn_is_distributed_as_without_pieces() {
        const SAMPLES: u32 = 400_000;
        for (case, tissue) in tissues().into_iter().enumerate() {
            let mut rng = Stream::Attraction.rng(case as u64);
            let mut blockers = Vec::new();
            tissue.draw(&mut rng, 40, &mut blockers);
            let (nodes, drains) = blockers.split_at(blockers.len() / 2);
            let refused = |point: &Vec3| {
                nodes.iter().any(|node| node.distance(*point) <= 0.16)
                    || drains.iter().any(|d| d.distance(*point) <= 0.12)
            };
            let mut vacancy = Vacancy::default();
            vacancy.reset([0.16, 0.12], u64::from(SAMPLES));
            let numbered = || drains.iter().enumerate().map(|(slot, &position)| (slot as u32, position));
            vacancy.prepare(tissue.as_ref(), 1.0, (nodes, |_, _| true), numbered());
            // Drains that are removed and added again, and a λ that shrinks and grows, must leave no trace.
            vacancy.remove_drain(3, drains[3]);
            vacancy.add_drain(3, drains[3]);
            for scale in [0.9, 0.5, 1.0] {
                vacancy.prepare(tissue.as_ref(), scale, (nodes, |_, _| true), numbered());
            }
            assert!(vacancy.listed_measure < 0.9 * vacancy.whole, "case {case}: too little is blocked to tell");

            let (mut pieced, mut plain) = (Vec::new(), Vec::new());
            assert!(vacancy.chosen().is_some());
            vacancy.draw(tissue.as_ref(), &mut rng, SAMPLES, &mut pieced);
            tissue.draw(&mut rng, SAMPLES, &mut plain);
            let all = plain.len();
            [&mut pieced, &mut plain].into_iter().for_each(|points| points.retain(|point| !refused(point)));
            let bin = |point: &Vec3| {
                let cell = ((*point - Vec3::from(tissue.bounds().min)) * 5.0).as_uvec3();
                (cell.x + 8 * cell.y + 64 * cell.z) as usize % 512
            };
            let mut counts = [[0i32; 512]; 2];
            pieced.iter().for_each(|point| counts[0][bin(point)] += 1);
            plain.iter().for_each(|point| counts[1][bin(point)] += 1);
            assert!(pieced.len() > 1000 && plain.len() < all, "case {case}: {} of {all}", pieced.len());
            for (bin, (a, b)) in counts[0].into_iter().zip(counts[1]).enumerate() {
                // Five standard deviations of the difference of two counts.
                let allowed = 5.0 * ((a + b) as f32).sqrt() + 1.0;
                assert!(((a - b) as f32).abs() <= allowed, "case {case}, bin {bin}: {a} against {b}");
            }
        }
    }
}
