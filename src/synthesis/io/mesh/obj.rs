//! Wavefront OBJ: every segment is a closed tube with round ends, good enough for any viewer.
//!
//! A segment is the round cone of its two ends: the hull of a sphere at each. Its surface is made of rings about the
//! axis; the rings where the cone touches the spheres are shared, so normals are smooth all over. Tubes of neighbouring
//! segments overlap at their common node, which hides the joint. One vessel is thus many closed pieces, not one surface.

use crate::synthesis::io::{WriteError, lines::comment_lines, write_atomically};
use crate::synthesis::segment_index::start_radius;
use crate::synthesis::tree::{VesselKind, VesselTree};
use bevy_math::{Vec3, ops};
use std::f32::consts::{PI, TAU};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// The header of the file, and the fineness of its segments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjOptions {
    /// Lines of the header, such as the unit of lengths, the seed and the preset. A line break begins a new line.
    ///
    /// Default: none. The name and version of this crate are always written.
    pub comments: Vec<String>,
    /// Sides of a tube. More make it rounder and the file larger, in proportion.
    ///
    /// Limits: [`Self::MIN_SIDES`] to [`Self::MAX_SIDES`]; values beyond are clamped. Default: [`Self::DEFAULT_SIDES`].
    pub sides: u32,
    /// Rings of vertices on each round end. More make it rounder and the file larger.
    ///
    /// Limits: 1 to [`Self::MAX_CAP_RINGS`]; values beyond are clamped. Default: [`Self::DEFAULT_CAP_RINGS`].
    pub cap_rings: u32,
}

impl ObjOptions {
    /// Fewest sides that enclose anything.
    pub const MIN_SIDES: u32 = 3;
    /// Most sides: more would not be visible.
    pub const MAX_SIDES: u32 = 64;
    /// Sides that look round from a short distance.
    pub const DEFAULT_SIDES: u32 = 8;
    /// Most rings on an end.
    pub const MAX_CAP_RINGS: u32 = 32;
    /// Rings that look round from a short distance.
    pub const DEFAULT_CAP_RINGS: u32 = 2;
}

impl Default for ObjOptions {
    fn default() -> Self {
        Self { comments: Vec::new(), sides: Self::DEFAULT_SIDES, cap_rings: Self::DEFAULT_CAP_RINGS }
    }
}

/// Writes the segments of one or more trees to an OBJ file, whole or not at all. See [`write_obj`].
///
/// # Errors
/// Those of [`write_atomically`], and more vertices than [`write_obj`] can number.
pub fn save_obj(
    path: impl AsRef<Path>,
    trees: &[(VesselKind, &VesselTree)],
    options: &ObjOptions,
) -> Result<(), WriteError> {
    write_atomically(path, |out| write_obj(out, trees, options))
}

/// Writes the segments of one or more trees as OBJ, one group (`g arterial`) per tree, in tissue lengths.
///
/// A segment begins with its parent's radius, but with no more than [`MAX_FLARE`](crate::synthesis::segment_index::MAX_FLARE) times its own. Triangles are oriented
/// outwards and every vertex has its normal. A segment within the sphere of one of its ends is
/// drawn as that sphere.
///
/// # Errors
/// Those of `out`; [`ErrorKind::InvalidInput`], before anything is written, if more than 2³² vertices would be needed:
/// use fewer sides.
pub fn write_obj(mut out: impl Write, trees: &[(VesselKind, &VesselTree)], options: &ObjOptions) -> io::Result<()> {
    let template = Template::new(options);
    let segments: usize = trees.iter().map(|(_, tree)| tree.segments().count()).sum();
    if (segments as u64).saturating_mul(template.vertices() as u64) > u64::from(u32::MAX) {
        let message = format!(
            "{segments} segments of {} vertices are more than an OBJ file can hold; use fewer sides",
            template.vertices()
        );
        return Err(io::Error::new(ErrorKind::InvalidInput, message));
    }
    writeln!(out, "# {} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))?;
    for line in comment_lines(&options.comments) {
        writeln!(out, "# {line}")?;
    }
    let mut written = 0;
    for &(system, tree) in trees {
        writeln!(out, "g {}", system.name())?;
        for (node, parent) in tree.segments() {
            let radius = tree.radii()[node];
            let start = (tree.positions()[parent], start_radius(tree, node));
            template.write_vertices(&mut out, start, (tree.positions()[node], radius))?;
            template.write_triangles(&mut out, written)?;
            written += template.vertices();
        }
    }
    Ok(())
}

/// The round cone that is copied for every segment.
struct Template {
    /// Cosine and sine of each side's angle about the axis.
    sides: Vec<(f32, f32)>,
    cap_rings: usize,
}

impl Template {
    fn new(options: &ObjOptions) -> Self {
        let sides = options.sides.clamp(ObjOptions::MIN_SIDES, ObjOptions::MAX_SIDES);
        let turn = |side| {
            let (sin, cos) = ops::sin_cos(TAU * side as f32 / sides as f32);
            (cos, sin)
        };
        let cap_rings = options.cap_rings.clamp(1, ObjOptions::MAX_CAP_RINGS) as usize;
        Self { sides: (0..sides).map(turn).collect(), cap_rings }
    }

    /// A pole at each end and the rings of both.
    fn vertices(&self) -> usize {
        2 + 2 * self.cap_rings * self.sides.len()
    }

    /// Vertices from the pole of the far end, ring by ring, to the pole of the near end, each with its normal.
    fn write_vertices(&self, out: &mut impl Write, start: (Vec3, f32), end: (Vec3, f32)) -> io::Result<()> {
        let (start, end) = without_hidden_end(start, end);
        let span = end.0 - start.0;
        let axis = span.try_normalize().unwrap_or(Vec3::Z);
        let (u, v) = axis.any_orthonormal_pair();
        let mut vertex = |(center, radius): (Vec3, f32), normal: Vec3| {
            let point = center + normal * radius;
            writeln!(out, "v {} {} {}", point.x, point.y, point.z)?;
            writeln!(out, "vn {:.4} {:.4} {:.4}", normal.x, normal.y, normal.z)
        };
        vertex(end, axis)?;
        for ring in 1..=2 * self.cap_rings {
            let ball = if ring <= self.cap_rings { end } else { start };
            let (sin, cos) = ops::sin_cos(self.colatitude(ring, span.length(), start.1 - end.1));
            for &(x, y) in &self.sides {
                vertex(ball, axis * cos + (u * x + v * y) * sin)?;
            }
        }
        vertex(start, -axis)
    }

    /// Angle between the axis and the normals on a ring, counted from 1 at the far pole.
    ///
    /// The cone touches both spheres where its normal has the part `(r_start − r_end) / length` along the axis. Up to there
    /// the rings lie on the far sphere, from there on the near one. Spheres alone have their rings spread evenly.
    fn colatitude(&self, ring: usize, length: f32, taper: f32) -> f32 {
        let rings = self.cap_rings as f32;
        let ring = ring as f32;
        if length <= 0.0 {
            return PI * ring / (2.0 * rings + 1.0);
        }
        let touch = ops::acos((taper / length).clamp(-1.0, 1.0));
        if ring <= rings { touch * ring / rings } else { touch + (PI - touch) * (ring - rings - 1.0) / rings }
    }

    /// Triangles of one copy, whose vertices come after `before` others. OBJ counts from 1.
    fn write_triangles(&self, out: &mut impl Write, before: usize) -> io::Result<()> {
        let (sides, rings) = (self.sides.len(), 2 * self.cap_rings);
        let at = |ring: usize, side: usize| before + 2 + ring * sides + side % sides;
        let (far, near) = (before + 1, before + self.vertices());
        let mut face = |[a, b, c]: [usize; 3]| writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}");
        for side in 0..sides {
            face([far, at(0, side), at(0, side + 1)])?;
            for ring in 1..rings {
                face([at(ring - 1, side), at(ring, side), at(ring, side + 1)])?;
                face([at(ring - 1, side), at(ring, side + 1), at(ring - 1, side + 1)])?;
            }
            face([at(rings - 1, side), near, at(rings - 1, side + 1)])?;
        }
        Ok(())
    }
}

/// If one end's sphere lies within the other's, both ends become the larger sphere.
fn without_hidden_end(start: (Vec3, f32), end: (Vec3, f32)) -> ((Vec3, f32), (Vec3, f32)) {
    let distance = start.0.distance(end.0);
    match (start.1 >= distance + end.1, end.1 >= distance + start.1) {
        (true, _) => (start, start),
        (_, true) => (end, end),
        _ => (start, end),
    }
}
