//! Links from the terminals of arteries to those of veins, through which blood flows from one tree to the other.

use crate::synthesis::{
    space::point_grid::PointGrid,
    tree::{BedLink, NodeId, VesselTree},
};
use bevy_math::{Vec3, bounding::Aabb3d};

/// Links each terminal of one tree to the nearest of the other, so that no terminal is left without; each pair once, in
/// the order of the arterial nodes, then of the venous ones.
pub(super) fn links(arteries: &VesselTree, veins: &VesselTree) -> Vec<BedLink> {
    if arteries.is_empty() || veins.is_empty() {
        return Vec::new();
    }
    let [arterial, venous] = [arteries, veins].map(Ends::new);
    let there = arterial.ends.iter().filter_map(|&(node, at)| Some((node, venous.nearest(at)?)));
    let back = venous.ends.iter().filter_map(|&(node, at)| Some((arterial.nearest(at)?, node)));
    let mut pairs: Vec<(u32, u32)> = there.chain(back).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let link = |(arterial, venous)| BedLink { arterial: NodeId(arterial), venous: NodeId(venous) };
    pairs.into_iter().map(link).collect()
}

/// The terminals of a tree, with an index over them.
struct Ends {
    ends: Vec<(u32, Vec3)>,
    grid: PointGrid,
    reach: f32,
}

impl Ends {
    fn new(tree: &VesselTree) -> Self {
        let tips = tree.tips().into_iter().filter(|&tip| tree.parent(NodeId(tip)).is_some());
        let ends: Vec<(u32, Vec3)> = tips.map(|tip| (tip, tree.positions()[tip as usize])).collect();
        let (min, max) = ends.iter().fold((Vec3::MAX, Vec3::MIN), |(min, max), end| (min.min(end.1), max.max(end.1)));
        let size = (max - min).max(Vec3::ZERO);
        // About one terminal in each cell of a solid; more, in a flat tree, cost only time.
        let reach = (size.max_element() / bevy_math::ops::cbrt(ends.len().max(1) as f32)).max(f32::MIN_POSITIVE);
        let mut grid = PointGrid::new(&Aabb3d { min: min.into(), max: max.into() }, reach);
        for &(_, at) in &ends {
            grid.push(at);
        }
        Self { ends, grid, reach }
    }

    /// The node of the terminal nearest to a point; `None` without any.
    fn nearest(&self, point: Vec3) -> Option<u32> {
        let radii =
            std::iter::successors(Some(self.reach), |reach| Some(2.0 * reach).filter(|reach| reach.is_finite()));
        radii.take_while(|_| !self.ends.is_empty()).find_map(|reach| {
            let (end, _) = self.grid.nearest_within(point, reach, |_| true)?;
            Some(self.ends[end as usize].0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthesis::random::Stream;
    use rand::RngExt;

    #[test]
    fn every_terminal_is_linked_to_the_nearest_of_the_other_tree() {
        let mut rng = Stream::Statistics.rng(4);
        let mut tree = |ends: usize| {
            let mut tree = VesselTree::new();
            let root = tree.push_root(Vec3::ZERO, 0.1);
            for _ in 0..ends {
                tree.push_child(root, Vec3::new(rng.random(), rng.random(), rng.random()), 0.1);
            }
            tree
        };
        let (arteries, veins) = (tree(300), tree(200));
        let links = links(&arteries, &veins);
        let nearest = |from: Vec3, to: &VesselTree| {
            let distance = |&tip: &u32| to.positions()[tip as usize].distance(from);
            to.tips().into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("a tip")
        };
        for tip in arteries.tips() {
            let vein = NodeId(nearest(arteries.positions()[tip as usize], &veins));
            assert!(links.contains(&BedLink { arterial: NodeId(tip), venous: vein }));
        }
        for tip in veins.tips() {
            let artery = NodeId(nearest(veins.positions()[tip as usize], &arteries));
            assert!(links.contains(&BedLink { arterial: artery, venous: NodeId(tip) }));
        }
        assert!(links.len() <= 500 && links.is_sorted_by_key(|link| (link.arterial.0, link.venous.0)));
        assert!(super::links(&arteries, &VesselTree::new()).is_empty());
    }
}
