//! A stroke of a painting tool: from press to release, one change of an organ's paint or roots.

use super::{brush::Brush, state::PanelTool};
use crate::synthesis::{
    mesh::TriangleMesh,
    roots::{RootPlacement, RootPlacements},
    tissue::{Guide, TissuePaint},
    tree::VesselKind,
};
use bevy::math::Vec3;

/// Distance between touches of the brush, and between points of a guide, as shares of the brush's radius.
const TOUCHES: f32 = 0.25;
const POINTS: f32 = 0.8;
/// Length of a guide for which one step of growth is planned, as a share of the organ's size. Steps of presets are longer,
/// so that vessels arrive.
const STEP: f32 = 0.015;

/// What is painted on: the organ's mesh, in its own space.
#[derive(Clone, Copy)]
pub(super) struct Canvas<'a> {
    pub(super) mesh: &'a TriangleMesh,
    /// The middle of its box, where mirrors are.
    pub(super) middle: Vec3,
    /// The diagonal of its box.
    pub(super) size: f32,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(mesh: &'a TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        let [low, high] = [bounds.min, bounds.max].map(Vec3::from);
        Self { mesh, middle: 0.5 * (low + high), size: low.distance(high) }
    }
}

/// A stroke that goes on.
#[derive(Clone, Debug)]
pub(super) struct PaintStroke {
    /// The last touch of the brush.
    last: Option<Vec3>,
    /// What the stroke moves: points of guides, or roots, one for each mirror image.
    held: Held,
}

#[derive(Clone, Debug, PartialEq)]
enum Held {
    Nothing,
    /// Guides that are drawn, by their numbers.
    Guides(Vec<usize>),
    /// Points of guides.
    Points(Vec<(usize, usize)>),
    /// Roots.
    Roots(Vec<usize>),
}

impl PaintStroke {
    /// Begins a stroke.
    pub(super) fn begin() -> Self {
        Self { last: None, held: Held::Nothing }
    }

    /// Goes on to a point of the surface. Returns whether anything was painted.
    pub(super) fn touch(
        &mut self,
        tool: PanelTool,
        brush: &Brush,
        canvas: Canvas,
        point: Vec3,
        (paint, roots): (&mut TissuePaint, &mut RootPlacements),
    ) -> bool {
        let reach = brush.radius * canvas.size;
        let spacing = reach * if tool == PanelTool::Guide { POINTS } else { TOUCHES };
        let moves = matches!(self.held, Held::Points(_) | Held::Roots(_));
        if !moves && self.last.is_some_and(|last| last.distance(point) < spacing) {
            return false;
        }
        let is_first = self.last.replace(point).is_none();
        let images = brush.images(point, canvas.middle);
        match tool {
            PanelTool::Density => brush.dab_density(&mut paint.density, canvas.mesh, &images, reach),
            PanelTool::NoGo => brush.dab_no_go(&mut paint.no_go, canvas.mesh, &images, reach),
            PanelTool::Guide => self.guide(&mut paint.guides, brush, &images, (is_first, canvas.size)),
            PanelTool::Root(kind) => self.root(roots, kind, brush, &images, (is_first, reach)),
            _ => return false,
        }
        true
    }

    /// Draws a guide, or moves or erases points of guides that were touched first.
    fn guide(&mut self, guides: &mut Vec<Guide>, brush: &Brush, images: &[Vec3], (is_first, size): (bool, f32)) {
        let reach = brush.radius * size;
        if brush.erases {
            for &image in images {
                guides.iter_mut().for_each(|guide| guide.points.retain(|&at| at.distance(image) > reach));
            }
            guides.retain(|guide| guide.points.len() > 1);
            return;
        }
        if is_first {
            let touched: Vec<_> =
                images.iter().filter_map(|&image| nearest_point(guides, image, 0.5 * reach)).collect();
            self.held = if touched.is_empty() {
                let first = guides.len();
                guides.extend(images.iter().map(|&image| Guide { points: vec![image], ..Guide::default() }));
                Held::Guides((first..guides.len()).collect())
            } else {
                Held::Points(touched)
            };
            return;
        }
        match &self.held {
            Held::Guides(own) => {
                for (&guide, &image) in own.iter().zip(images) {
                    let Some(guide) = guides.get_mut(guide) else { continue };
                    guide.points.push(image);
                    let length: f32 = guide.points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
                    guide.steps = ((length / (STEP * size)) as u32).max(Guide::DEFAULT_STEPS);
                }
            }
            Held::Points(own) => {
                for (&(guide, point), &image) in own.iter().zip(images) {
                    if let Some(at) = guides.get_mut(guide).and_then(|guide| guide.points.get_mut(point)) {
                        *at = image;
                    }
                }
            }
            Held::Nothing | Held::Roots(_) => {}
        }
    }

    /// Ends the stroke. A guide of a single point is none.
    pub(super) fn end(self, paint: &mut TissuePaint) {
        if let Held::Guides(_) = self.held {
            paint.guides.retain(|guide| guide.points.len() > 1);
        }
    }

    /// Places roots, or moves or erases those that were touched first.
    fn root(
        &mut self,
        roots: &mut RootPlacements,
        kind: VesselKind,
        brush: &Brush,
        images: &[Vec3],
        (is_first, reach): (bool, f32),
    ) {
        let placement = &mut roots[kind];
        let mut points = match std::mem::take(placement) {
            RootPlacement::Nearest(points) | RootPlacement::Exact(points) => points,
            // The first placed root takes the place of those that were found.
            other if brush.erases => {
                *placement = other;
                return;
            }
            _ => Vec::new(),
        };
        if brush.erases {
            points.retain(|at| !images.iter().any(|image| at.distance(*image) <= reach));
        } else if is_first {
            let near = |image: &Vec3| points.iter().position(|at| at.distance(*image) <= 0.5 * reach);
            let touched: Vec<usize> = images.iter().filter_map(near).collect();
            if touched.is_empty() {
                self.held = Held::Roots((points.len()..points.len() + images.len()).collect());
                points.extend(images);
            } else {
                self.held = Held::Roots(touched);
            }
        } else if let Held::Roots(own) = &self.held {
            for (&root, &image) in own.iter().zip(images) {
                if let Some(at) = points.get_mut(root) {
                    *at = image;
                }
            }
        }
        if !points.is_empty() {
            *placement = RootPlacement::Nearest(points);
        }
    }
}

/// The point of a guide nearest to a place, within a reach: numbers of the guide and of the point.
fn nearest_point(guides: &[Guide], place: Vec3, reach: f32) -> Option<(usize, usize)> {
    let all = guides.iter().enumerate().flat_map(|(guide, line)| {
        line.points.iter().enumerate().map(move |(point, at)| ((guide, point), at.distance(place)))
    });
    all.filter(|(_, distance)| *distance <= reach).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(found, _)| found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of side 10 around the origin.
    fn square() -> TriangleMesh {
        let corners = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
        let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        TriangleMesh::new(positions, vec![[0, 1, 2], [0, 2, 3]], None).expect("a square")
    }

    /// The paint and roots after strokes through points of the square's middle line.
    fn after(tool: PanelTool, strokes: &[(Brush, &[f32])]) -> (TissuePaint, RootPlacements) {
        let mesh = square();
        let canvas = Canvas::new(&mesh);
        let (mut paint, mut roots) = (TissuePaint::default(), RootPlacements::default());
        for (brush, places) in strokes {
            let mut stroke = PaintStroke::begin();
            for &x in *places {
                stroke.touch(tool, brush, canvas, Vec3::new(x, 1.0, 0.0), (&mut paint, &mut roots));
            }
            stroke.end(&mut paint);
        }
        (paint, roots)
    }

    fn brush() -> Brush {
        Brush { radius: 0.1 / 200.0_f32.sqrt() * 10.0, ..Brush::default() }
    }

    #[test]
    fn guides_are_drawn_moved_and_erased_with_their_mirror_images() {
        let mirrored = Brush { mirror: [false, true, false], ..brush() };
        let drawn: &[f32] = &[-3.0, -2.9, -2.0, -1.0, 0.0];
        let (paint, _) = after(PanelTool::Guide, &[(mirrored, drawn)]);
        assert_eq!(paint.guides.len(), 2);
        assert_eq!(paint.guides[0].points.len(), 4, "the second touch was too near");
        assert_eq!(paint.guides[1].points[3], Vec3::new(0.0, -1.0, 0.0));
        let (paint, _) = after(PanelTool::Guide, &[(mirrored, drawn), (mirrored, &[-0.1, 0.4, 0.5])]);
        assert_eq!(paint.guides.len(), 2, "a point was moved, no guide begun");
        assert_eq!(paint.guides[1].points[3], Vec3::new(0.5, -1.0, 0.0));
        let eraser = Brush { erases: true, ..brush() };
        let (paint, _) = after(PanelTool::Guide, &[(mirrored, drawn), (eraser, &[-3.0, -2.0, -1.0])]);
        assert_eq!(paint.guides.len(), 1, "a single point is no guide; the image stays");
        let (paint, _) = after(PanelTool::Guide, &[(brush(), &[2.0])]);
        assert!(paint.guides.is_empty(), "a click is no guide");
    }

    #[test]
    fn roots_are_placed_moved_and_erased() {
        let tool = PanelTool::Root(VesselKind::Artery);
        let (_, roots) = after(tool, &[(brush(), &[1.0]), (brush(), &[-3.0]), (brush(), &[1.2, 2.0])]);
        let at = |x| Vec3::new(x, 1.0, 0.0);
        assert_eq!(roots.artery, RootPlacement::Nearest(vec![at(2.0), at(-3.0)]));
        assert_eq!(roots.vein, RootPlacement::Beside, "other kinds stay");
        let eraser = Brush { erases: true, ..brush() };
        let (_, roots) = after(tool, &[(brush(), &[1.0]), (eraser, &[1.0])]);
        assert_eq!(roots.artery, RootPlacement::None);
        let (_, roots) = after(tool, &[(eraser, &[1.0])]);
        assert_eq!(roots.artery, RootPlacements::default().artery, "nothing was placed");
    }

    #[test]
    fn a_brush_touches_again_only_after_a_way() {
        let mesh = square();
        let (mut paint, mut roots) = Default::default();
        let mut stroke = PaintStroke::begin();
        let mut touch = |x| {
            let point = Vec3::new(x, -5.0, 0.0);
            stroke.touch(PanelTool::Density, &brush(), Canvas::new(&mesh), point, (&mut paint, &mut roots))
        };
        assert!(touch(-5.0) && !touch(-4.9) && touch(-4.0));
    }
}
