//! The drawing of cut vessels.
//!
//! In: [`Wounds`] and their tree, with the [`FlatEnds`] that follow from both. Out: [`SegmentInstance`]s for the
//! remaining pieces of severed segments, and for whole ones beside them that are drawn differently than they grew.

use crate::synthesis::{
    instances::{END_DOME, FlatEnds, START_DOME, SegmentColors, SegmentInstance, segment_instance},
    tree::{NodeId, VesselTree},
    wound::{PieceEnd, Wounds},
};
use bevy_math::Vec3;

/// Largest share of a piece that the round ends of its cuts may take.
const MOST_DOME: f32 = 0.9;

/// Appends to `out` instances of the remaining pieces of severed segments, and of those beside them that are drawn
/// differently: in the order of their nodes, then from parent to node. Hide their own slots while
/// [`FlatEnds::is_redrawn`].
///
/// `birth_steps` and `colors` as for [`write_segments`](super::write_segments); `flat` must be up to date with the
/// wounds and the tree.
pub fn write_stumps(
    wounds: &Wounds,
    flat: &FlatEnds,
    tree: &VesselTree,
    birth_steps: &[u32],
    colors: &SegmentColors,
    out: &mut Vec<SegmentInstance>,
) {
    for node in flat.redrawn_within(wounds, 0..tree.len()) {
        write_stumps_of(wounds, flat, node, tree, birth_steps, colors, out);
    }
}

/// Appends the remaining pieces of one segment; nothing if it is drawn as it grew, wholly removed, or not in the tree.
///
/// A piece is drawn with the taper of the whole segment. An end with a lumen is [open](SegmentInstance::is_open), and
/// flat. A sealed end is round; its round end stays within the piece, and is blunter if the piece is too short. Whole
/// segments whose round ends would reach past it are open, too, if the next segment covers them. So gaps are as wide as
/// in the ledger.
pub fn write_stumps_of(
    wounds: &Wounds,
    flat: &FlatEnds,
    node: NodeId,
    tree: &VesselTree,
    birth_steps: &[u32],
    colors: &SegmentColors,
    out: &mut Vec<SegmentInstance>,
) {
    if node.index() >= tree.len() || tree.parent(node).is_none() || !flat.is_redrawn(wounds, node) {
        return;
    }
    let birth = birth_steps.get(node.index()).copied().unwrap_or(0);
    let whole = segment_instance(tree, node.index(), birth, colors);
    let cover = cover(flat, tree, node);
    if !wounds.is_severed(node) {
        out.push(draw(&whole, [0.0, 1.0], shapes([PieceEnd::Node; 2], flat.sides(node)), cover));
    }
    for piece in wounds.pieces(node) {
        out.push(draw(&whole, [piece.from, piece.to], shapes(piece.ends, flat.sides(node)), cover));
    }
}

/// Length by which a segment is drawn into its parent, to cover the rim of a flat parent where the vessel bends. 0 if
/// the parent has its round end.
fn cover(flat: &FlatEnds, tree: &VesselTree, node: NodeId) -> f32 {
    let parent = tree.parent(node).filter(|&parent| flat.sides(parent)[1]);
    let Some(parent) = parent else { return 0.0 };
    let direction = |node: NodeId| tree.segment_vector(node.index()).normalize_or_zero();
    let (before, along) = (direction(parent), direction(node));
    let sine = if before.dot(along) > 0.0 { before.cross(along).length() } else { 1.0 };
    sine * tree.radii()[parent.index()]
}

/// The shape of a drawn end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum EndShape {
    /// The round end of a whole segment, which reaches beyond it.
    Round,
    /// A round end that stays within the piece.
    Sealed,
    /// Flat, with a view into the lumen.
    Flat,
}

/// The shapes of a piece's ends. An end at a node is flat if the segment is flat there.
fn shapes(ends: [PieceEnd; 2], flat: [bool; 2]) -> [EndShape; 2] {
    let shape = |end: PieceEnd, is_flat: bool| match end {
        PieceEnd::Node if !is_flat => EndShape::Round,
        PieceEnd::Node | PieceEnd::Open => EndShape::Flat,
        PieceEnd::Sealed => EndShape::Sealed,
    };
    [shape(ends[0], flat[0]), shape(ends[1], flat[1])]
}

fn draw(whole: &SegmentInstance, [from, to]: [f32; 2], ends: [EndShape; 2], cover: f32) -> SegmentInstance {
    let (start, end) = (Vec3::from(whole.start), Vec3::from(whole.end));
    let length = start.distance(end);
    let radius = |share: f32| whole.start_radius + (whole.end_radius - whole.start_radius) * share;
    let room = MOST_DOME * length * (to - from);
    let domes = [
        if ends[0] == EndShape::Sealed { START_DOME * radius(from) } else { 0.0 },
        if ends[1] == EndShape::Sealed { END_DOME * radius(to) } else { 0.0 },
    ];
    // Share of their size for which the round ends have room.
    let fit = (room / (domes[0] + domes[1]).max(f32::MIN_POSITIVE)).min(1.0);
    let [mut back, ahead] = domes.map(|dome| fit * dome / length);
    if ends[0] == EndShape::Round {
        back = -cover / length;
    }
    let size = |end: EndShape, share: f32| match end {
        EndShape::Round => radius(share),
        EndShape::Sealed => fit * radius(share),
        EndShape::Flat => -radius(share),
    };
    SegmentInstance {
        start: start.lerp(end, from + back).to_array(),
        start_radius: size(ends[0], from),
        end: start.lerp(end, to - ahead).to_array(),
        end_radius: size(ends[1], to),
        ..*whole
    }
}
