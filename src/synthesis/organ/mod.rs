//! Procedural organ meshes with variation: an organ of any seed, without a file.
//!
//! Every generator takes settings with a seed and returns a value: a closed, outward-oriented [`OrganMesh`] in metres with
//! normals, UVs and vertex colours, and what a scene needs beside it (where vessels enter, where to look from). The
//! anatomy is schematic: shapes and proportions that read as the organ at first sight, with dimensions in the human range.
//! It is neither measured from a person nor meant for diagnosis.
//!
//! - [`colon`]: the large intestine with haustra, taeniae coli and a lumen that is open at the rectal end.
//! - [`liver`]: a lobed wedge.

pub mod centre_line;
pub mod colon;
pub mod liver;
mod noise;

pub use colon::{Colon, ColonSettings};
pub use liver::{Liver, LiverSettings};

use crate::synthesis::mesh::{MeshError, TriangleMesh};
use bevy_math::{Vec2, Vec3};
use std::ops::Range;

/// Triangles of an organ with all that drawing them needs.
///
/// Positions are in metres, normals are unit vectors that point out of the tissue, triangles wind counter-clockwise seen
/// from outside. The surface is closed once vertices at equal positions are welded: along the seams of the UV chart a
/// position occurs twice, with the same normal and another UV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OrganMesh {
    /// Vertex positions, in metres.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, one a vertex.
    pub normals: Vec<Vec3>,
    /// Texture coordinates in [0, 1]², one a vertex. What they run along is said by each organ.
    pub uvs: Vec<Vec2>,
    /// Tissue colour, linear RGB with an alpha of 1, one a vertex.
    pub colors: Vec<[f32; 4]>,
    /// Triangles, as indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl OrganMesh {
    /// Some of the triangles with only the vertices they use, such as the outer side of a wall.
    ///
    /// Indices beyond the end of [`triangles`](Self::triangles) are left out. Vertices keep their order and normals.
    #[must_use]
    pub fn part(&self, triangles: Range<usize>) -> Self {
        let end = triangles.end.min(self.triangles.len());
        let chosen = &self.triangles[triangles.start.min(end)..end];
        let mut index = vec![u32::MAX; self.positions.len()];
        for &vertex in chosen.iter().flatten() {
            index[vertex as usize] = 0;
        }
        let mut part = Self::default();
        for (vertex, slot) in index.iter_mut().enumerate().filter(|(_, slot)| **slot == 0) {
            *slot = part.positions.len() as u32;
            part.positions.push(self.positions[vertex]);
            part.normals.push(self.normals[vertex]);
            part.uvs.push(self.uvs[vertex]);
            part.colors.push(self.colors[vertex]);
        }
        part.triangles = chosen.iter().map(|corners| corners.map(|corner| index[corner as usize])).collect();
        part
    }

    /// The triangles as every stage reads them, UVs included.
    ///
    /// # Errors
    /// Those of [`TriangleMesh::new`], which no mesh of a generator or part of it meets, unless it is an empty part.
    pub fn triangle_mesh(&self) -> Result<TriangleMesh, MeshError> {
        TriangleMesh::new(self.positions.clone(), self.triangles.clone(), Some(self.uvs.clone()))
    }

    /// Volume that the surface encloses, in cubic metres; negative when it is inside out. Meaningful for closed meshes.
    pub fn signed_volume(&self) -> f32 {
        let six_volumes: f64 = self
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|corner| self.positions[corner as usize].as_dvec3());
                a.dot(b.cross(c))
            })
            .sum();
        (six_volumes / 6.0) as f32
    }

    /// Smallest and largest coordinates, in metres; zeros for an empty mesh.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let Some(&first) = self.positions.first() else { return (Vec3::ZERO, Vec3::ZERO) };
        self.positions.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)))
    }

    /// Sets the normals from the triangles, weighted by area.
    ///
    /// `shared[v]` names the vertex whose normal `v` shares, itself where it stands alone: seams then do not show.
    fn compute_normals(&mut self, shared: &[u32]) {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
            let doubled_area = (b - a).cross(c - a);
            for corner in corners {
                sums[shared[*corner as usize] as usize] += doubled_area;
            }
        }
        self.normals = shared.iter().map(|&vertex| sums[vertex as usize].normalize_or(Vec3::Y)).collect();
    }
}

/// Where vessels enter an organ: points on its surface, for [`RootPlacement::Nearest`].
///
/// [`RootPlacement::Nearest`]: crate::synthesis::roots::RootPlacement::Nearest
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RootSites {
    /// Roots of arteries, in metres.
    pub arterial: Vec<Vec3>,
    /// Roots of veins, in metres: each beside the artery of the same index.
    pub venous: Vec<Vec3>,
}

/// A place to look from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Where the camera is, in metres.
    pub eye: Vec3,
    /// What it looks at, in metres.
    pub target: Vec3,
    /// Which way is up in the picture.
    pub up: Vec3,
}

/// A setting that an organ cannot be made with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{organ} {name} is {value}; it must be {limits}")]
pub struct OrganError {
    /// The organ whose setting it is.
    pub organ: &'static str,
    /// Name of the field.
    pub name: &'static str,
    /// The value found.
    pub value: f32,
    /// What it may be.
    pub limits: &'static str,
}

/// Linear RGB of a colour given as sRGB bytes, with an alpha of 1.
fn linear(srgb: [u8; 3]) -> [f32; 4] {
    let channel = |byte: u8| {
        let value = f32::from(byte) / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { bevy_math::ops::powf((value + 0.055) / 1.055, 2.4) }
    };
    let [red, green, blue] = srgb.map(channel);
    [red, green, blue, 1.0]
}

/// Mixes two colours: `first` at 0, `second` at 1.
fn mix(first: [f32; 4], second: [f32; 4], amount: f32) -> [f32; 4] {
    let amount = amount.clamp(0.0, 1.0);
    std::array::from_fn(|channel| first[channel] + (second[channel] - first[channel]) * amount)
}

/// Smooth step from 0 at `low` to 1 at `high`.
fn smooth_step(low: f32, high: f32, value: f32) -> f32 {
    let share = ((value - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
