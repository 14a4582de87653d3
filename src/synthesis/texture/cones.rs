//! The segments of all networks as they are baked: round cones with their look, found by place.

use super::error::BakeError;
use super::gauss::SEEN;
use super::look::VesselLook;
use super::settings::BakeSettings;
use crate::synthesis::{
    pace::Pace,
    segment_index::start_radius,
    space::bvh::{Bounds, BoxTree},
    tree::{NO_PARENT, VesselTree},
};
use bevy_math::{Vec3, Vec3A, ops};

/// A network and its look.
#[derive(Clone, Debug)]
pub struct Layer<'a> {
    /// The vessels, in the lengths of the mesh.
    pub tree: &'a VesselTree,
    /// How they look.
    pub look: VesselLook,
}

/// A segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub start: Vec3,
    /// From start to end.
    pub along: Vec3,
    pub start_radius: f32,
    /// Radius at the end, less that at the start.
    pub widening: f32,
    /// Place on the ramp of colours at start and end, 0 for the thinnest vessels.
    pub shade: [f32; 2],
    /// How far start and end are from the tips, as a share of the length over which vessels fade.
    pub to_tip: [f32; 2],
    /// How far they are from the root.
    pub to_root: [f32; 2],
    /// Whether it fades anywhere.
    pub fades: bool,
    /// Whether the start and the end are round ends that don't fade.
    pub is_end: [bool; 2],
    pub layer: u32,
    pub node: u32,
    /// Depth, and height above the surface, at which it is no longer seen.
    pub max_depth: f32,
    /// Distance from the surface that doesn't count as depth.
    pub chord: f32,
    /// Distance from a point of the surface up to which it can be seen, besides the blur of the texels.
    pub far: f32,
    /// A box around all points that can see it.
    bounds: Bounds,
}

impl Cone {
    /// Whether it can be seen from within a box, widened by the blur of the texels there.
    pub fn is_near(&self, region: &Bounds) -> bool {
        // A long segment passes by many boxes that its own box meets.
        let (along, from) = (Vec3A::from(self.along), 0.5 * (region.min + region.max) - Vec3A::from(self.start));
        let share = (from.dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let far = self.far + 0.5 * (region.max - region.min).length();
        from.distance_squared(along * share) <= far * far
    }

    /// How much the ends leave of the vessel at a share of the axis, and how that changes along it.
    #[inline(always)]
    pub fn fade(&self, share: f32) -> (f32, f32) {
        let smooth = |[start, end]: [f32; 2]| {
            let at = start + (end - start) * share;
            let is_whole = at >= 1.0;
            let at = if is_whole { 1.0 } else { at };
            (at * at * (3.0 - 2.0 * at), 6.0 * at * (1.0 - at) * (end - start))
        };
        let ((tip, tip_along), (root, root_along)) = (smooth(self.to_tip), smooth(self.to_root));
        (tip * root, tip_along * root + tip * root_along)
    }
}

/// The look of a network, with what follows from its radii.
#[derive(Clone, Debug)]
pub(super) struct Look {
    pub look: VesselLook,
    /// The greatest depth that one of its vessels can be seen at.
    pub deepest: f32,
}

/// All segments, those of the first network first, and in the order of their nodes.
#[derive(Debug)]
pub(super) struct Cones {
    pub cones: Vec<Cone>,
    pub looks: Vec<Look>,
    boxes: BoxTree,
    /// The greatest height, up or down, that a vessel can reach.
    pub highest: [f32; 2],
    /// The greatest depth that a vessel can be seen at.
    pub deepest: f32,
    /// Median width of a segment.
    pub median_width: f32,
}

impl Cones {
    /// The segments of networks.
    ///
    /// # Errors
    /// Looks out of their limits, and more networks or nodes than can be numbered, if there is a map of ids.
    pub async fn of(layers: &[Layer<'_>], settings: &BakeSettings, pace: &Pace) -> Result<Self, BakeError> {
        if layers.len() > BakeSettings::MOST_LAYERS {
            return Err(BakeError::TooManyLayers { layers: layers.len() });
        }
        let (mut cones, mut looks) = (Vec::new(), Vec::new());
        for (number, layer) in layers.iter().enumerate() {
            layer.look.validate()?;
            if settings.maps.id && layer.tree.len() > 1 << 24 {
                return Err(BakeError::TooManyNodes { layer: number, nodes: layer.tree.len() });
            }
            let shares = number as f32 / layers.len() as f32..(number + 1) as f32 / layers.len() as f32;
            let before = cones.len();
            add(&mut cones, number as u32, layer, &pace.part(0.0..0.6).part(shares)).await;
            let deepest = cones[before..].iter().map(|cone: &Cone| cone.max_depth).fold(0.0, f32::max);
            looks.push(Look { look: layer.look.clone(), deepest });
        }
        let boxes = BoxTree::new_paced(cones.len(), |cone| cones[cone].bounds, &pace.part(0.6..1.0)).await;
        let bumps = |sign: f32| {
            let bump = |cone: &Cone| {
                let radius = cone.start_radius.max(cone.start_radius + cone.widening);
                (looks[cone.layer as usize].look.bump * sign).max(0.0) * radius
            };
            cones.iter().map(bump).fold(0.0, f32::max)
        };
        let mut widths: Vec<f32> = cones.iter().map(|cone| 2.0 * cone.start_radius + cone.widening).collect();
        let middle = widths.len() / 2;
        let median = |widths: &mut [f32]| *widths.select_nth_unstable_by(middle, f32::total_cmp).1;
        let median_width = if widths.is_empty() { 0.0 } else { median(&mut widths) };
        let (highest, deepest) =
            ([-bumps(-1.0), bumps(1.0)], looks.iter().map(|look| look.deepest).fold(0.0, f32::max));
        Ok(Self { cones, looks, boxes, highest, deepest, median_width })
    }

    /// The numbers of the cones that may be seen from within a box, in rising order, after clearing `found`.
    pub fn near(&self, region: &Bounds, found: &mut Vec<u32>) {
        found.clear();
        let order = self.boxes.order();
        self.boxes.overlapping(region, |slot| {
            found.push(order[slot]);
            true
        });
        // A leaf holds several boxes.
        found.retain(|&cone| self.cones[cone as usize].is_near(region));
        found.sort_unstable();
    }
}

/// Appends the segments of a tree.
async fn add(cones: &mut Vec<Cone>, number: u32, Layer { tree, look }: &Layer<'_>, pace: &Pace) {
    let (to_tip, to_root) = distances(tree, look.fade);
    let counts = tree.child_counts();
    let thinnest = tree.radii().iter().copied().filter(|radius| *radius > 0.0).fold(f32::INFINITY, f32::min);
    let octaves = ops::ln(tree.widest_radius() / thinnest);
    let shade = |radius: f32| if octaves > 0.0 { (ops::ln(radius / thinnest) / octaves).clamp(0.0, 1.0) } else { 0.0 };
    let segment = |node: usize| {
        let (parent, radius) = (tree.parents()[node], tree.radii()[node]);
        if parent == NO_PARENT || !(radius > 0.0) {
            return;
        }
        let parent = parent as usize;
        let start_radius = start_radius(tree, node);
        let widest = start_radius.max(radius);
        let along = tree.segment_vector(node);
        let max_depth = if look.max_depth > 0.0 { look.max_depth } else { VesselLook::AUTOMATIC_DEPTH * widest };
        let chord = VesselLook::CHORD_DEPTH * along.length();
        let blur = look.with_mound(look.blur_at(widest, max_depth + look.depth * widest), widest);
        let reach = widest + SEEN * blur;
        let depth = max_depth + chord;
        let far = (reach * reach + depth * depth).sqrt();
        let start = tree.positions()[parent];
        let Bounds { min, max } = Bounds::around(&[start, start + along]);
        cones.push(Cone {
            start,
            along,
            start_radius,
            widening: radius - start_radius,
            shade: [start_radius, radius].map(shade),
            to_tip: to_tip[node],
            to_root: [to_root[parent], to_root[node]],
            fades: to_tip[node].into_iter().chain([to_root[parent], to_root[node]]).any(|share| share < 1.0),
            is_end: [look.fade == 0.0 && tree.parents()[parent] == NO_PARENT, look.fade == 0.0 && counts[node] == 0],
            layer: number,
            node: node as u32,
            max_depth,
            chord,
            far,
            bounds: Bounds { min: min - far, max: max + far },
        });
    };
    pace.each(tree.len(), segment).await;
}

/// How far the start and the end of each node's segment are from the farthest tip beyond it, and each node from its
/// root; each step as a share of the length over which a vessel of its radius fades.
fn distances(tree: &VesselTree, fade: f32) -> (Vec<[f32; 2]>, Vec<f32>) {
    if fade == 0.0 {
        return (vec![[1.0; 2]; tree.len()], vec![1.0; tree.len()]);
    }
    let step = |node: usize| match tree.radii()[node] * fade {
        length if length > 0.0 => (tree.segment_vector(node).length() / length).min(1.0e6),
        _ => 0.0,
    };
    let mut from_root = vec![0.0; tree.len()];
    tree.fold_to_tips(&mut from_root, |node, parent, own| *own = parent + step(node));
    let mut to_tip: Vec<[f32; 2]> = (0..tree.len()).map(|node| [step(node), 0.0]).collect();
    let add = |parent: &mut [f32; 2], child: &[f32; 2]| {
        let (length, farthest) = (parent[0] - parent[1], parent[1].max(child[0]));
        *parent = [farthest + length, farthest];
    };
    tree.fold_to_roots(&mut to_tip, add);
    (to_tip, from_root)
}
