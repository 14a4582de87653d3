//! Pictures of vessels as lines with round ends, seen along the z axis from above, for papers and web pages.

mod eps;
mod svg;

pub use eps::{save_eps, write_eps};
pub use svg::{save_svg, write_svg};

use crate::synthesis::tree::{VesselKind, VesselTree};

/// Longer side of a picture, in points.
const SIDE: f64 = 512.0;
/// Margin around the vessels, in points.
const MARGIN: f64 = 8.0;

/// A segment in the picture, in points from its lower left corner.
struct Line {
    kind: VesselKind,
    ends: [[f64; 2]; 2],
    width: f64,
    height: f64,
}

/// All segments, the lowest first, and the picture's size in points.
struct Picture {
    lines: Vec<Line>,
    size: [f64; 2],
}

impl Picture {
    fn of(trees: &[(VesselKind, &VesselTree)]) -> Self {
        let mut lines = Vec::new();
        let (mut min, mut max) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &(kind, tree) in trees {
            for (node, parent) in tree.segments() {
                let places = [parent, node].map(|node| tree.positions()[node].as_dvec3());
                let radius = f64::from(tree.radii()[node]);
                let ends = places.map(|place| [place.x, place.y]);
                for axis in 0..2 {
                    min[axis] = ends.iter().fold(min[axis], |least, end| least.min(end[axis] - radius));
                    max[axis] = ends.iter().fold(max[axis], |most, end| most.max(end[axis] + radius));
                }
                lines.push(Line { kind, ends, width: 2.0 * radius, height: 0.5 * (places[0].z + places[1].z) });
            }
        }
        if lines.is_empty() {
            return Self { lines, size: [SIDE; 2] };
        }
        let sides = [max[0] - min[0], max[1] - min[1]];
        let scale = (SIDE - 2.0 * MARGIN) / sides[0].max(sides[1]).max(f64::MIN_POSITIVE);
        for line in &mut lines {
            line.ends = line.ends.map(|end| [0, 1].map(|axis| (end[axis] - min[axis]) * scale + MARGIN));
            line.width *= scale;
        }
        // Equal heights keep the order of the tree.
        lines.sort_by(|a, b| a.height.total_cmp(&b.height));
        Self { lines, size: sides.map(|side| side * scale + 2.0 * MARGIN) }
    }
}

/// Colour of a kind of vessels, in steps of 1/255.
fn color(kind: VesselKind) -> [u8; 3] {
    match kind {
        VesselKind::Artery => [190, 32, 38],
        VesselKind::Vein => [40, 70, 150],
        VesselKind::PortalVein => [120, 60, 140],
        VesselKind::Duct => [70, 130, 50],
    }
}
