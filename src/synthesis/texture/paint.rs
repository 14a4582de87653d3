//! Paints the first level of all maps, tile by tile.

use super::atlas::Atlas;
use super::bins::Bins;
use super::bytes::MapBytes;
use super::canvas::Canvas;
use super::cones::Cones;
use super::face::Face;
use super::groups::Groups;
use super::meeting::{LANES, Spots};
use super::owners::{NOBODY, Owners, place, within};
use super::settings::{BakeSettings, BaseImage, MapKind};
use super::shade::Sight;
use super::texels::{MARGIN, TILE};
use crate::synthesis::space::bvh::Bounds;
use bevy_math::{DVec2, Vec3, Vec4};
use std::ops::Range;

/// Coverage of a texel beyond the border of a chart: its values are known, and it counts for nothing.
pub(super) const BESIDE: u8 = 1;
/// Coverage of a texel within a chart.
pub(super) const COVERED: u8 = 255;
/// Texels along the side of a block, in which vessels are looked for together.
const BLOCK: i64 = 8;
/// Columns of a group of texels.
const ACROSS: usize = LANES / 2;
/// Blocks along the side of a tile.
const BLOCKS: usize = TILE as usize / BLOCK as usize;

/// A row of tiles of all maps.
pub(super) struct Band<'a> {
    /// Number of the row of tiles.
    pub row: usize,
    /// Coverage of each texel; 0 where nothing is known.
    pub coverage: &'a mut [u8],
    /// The maps that are made.
    pub maps: MapBytes<'a>,
    /// Texels that several parts of the surface claim.
    pub overlaps: usize,
}

/// All that is needed to paint.
pub(super) struct Painter<'a> {
    pub canvas: &'a Canvas,
    pub atlas: &'a Atlas,
    pub bins: &'a Bins,
    pub cones: &'a Cones,
    pub settings: &'a BakeSettings,
    pub base: Option<&'a BaseImage>,
}

/// Memory for one tile after the other.
#[derive(Default)]
struct Scratch {
    faces: Vec<Face>,
    owners: Owners,
    /// The surface within each block, widened by what the blur of its texels reaches.
    blocks: Vec<Bounds>,
    /// Cones near a block.
    found: Vec<u32>,
    /// The texels of a block, and what is seen from them.
    groups: [Group; LANES],
    sights: [Sight; LANES],
}

/// Texels that are painted together: [`ACROSS`] columns of two rows.
struct Group {
    spots: Spots,
    /// For each texel, its triangle in the tile, its centre, and the weights of the triangle's corners.
    owners: [u32; LANES],
    at: [DVec2; LANES],
    weights: [Vec3; LANES],
    /// Largest blur of a texel.
    blur: f32,
}

impl Default for Group {
    fn default() -> Self {
        let (at, weights) = ([DVec2::ZERO; LANES], [Vec3::ZERO; LANES]);
        Self { spots: Spots::NOWHERE, owners: [NOBODY; LANES], at, weights, blur: 0.0 }
    }
}

impl Group {
    /// Sets the texels of a block's group.
    fn set(&mut self, block: &Tile, number: usize, tile: &Tile, (owners, faces, origin): (&Owners, &[Face], Vec3)) {
        *self = Self::default();
        for k in 0..LANES {
            let (right, down) = ((number % 2) * ACROSS + k % ACROSS, (number / 2) * 2 + k / ACROSS);
            let (column, row) = (block[0].start + right as i64, block[1].start + down as i64);
            if column < block[0].end && row < block[1].end {
                self.owners[k] = owners.of(place(tile, column, row));
                self.at[k] = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
            }
        }
        // Most groups lie within one triangle.
        let mut is_set = self.owners.map(|owner| owner == NOBODY);
        while let Some(first) = is_set.iter().position(|is_set| !is_set) {
            let owner = self.owners[first];
            let (face, owns) = (&faces[owner as usize], self.owners.map(|other| other == owner));
            let weights = self.at.map(|at| face.placed.weights(at));
            face.set_spots(&weights, &owns, origin, &mut self.spots);
            self.blur = self.blur.max(face.blur);
            for k in (0..LANES).filter(|&k| owns[k]) {
                (self.weights[k], is_set[k]) = (weights[k], true);
            }
        }
    }
}

/// A tile: its columns and rows.
type Tile = [Range<i64>; 2];

impl Painter<'_> {
    /// Paints a row of tiles.
    pub fn band(&self, band: &mut Band<'_>) {
        let mut scratch = Scratch::default();
        for column in 0..self.bins.across() {
            self.tile(column, band, &mut scratch);
        }
    }

    fn tile(&self, column: usize, band: &mut Band<'_>, scratch: &mut Scratch) {
        let entries = self.bins.of_tile(column, band.row);
        if entries.is_empty() {
            return;
        }
        let size = self.settings.size;
        let range = |tile: usize| i64::from(tile as u32 * TILE)..i64::from(((tile as u32 + 1) * TILE).min(size));
        let tile = [range(column), range(band.row)];
        let placements = || entries.iter().map(|&entry| &self.atlas.placements[entry as usize]);
        scratch.faces.clear();
        scratch.faces.extend(placements().map(|placement| Face::of(self.canvas, self.atlas, placement, size)));
        band.overlaps += scratch.owners.own(&tile, &scratch.faces);
        scratch.owners.own_margin(&tile, &scratch.faces, placements().map(|placement| placement.is_border));
        self.cover(&tile, band, scratch);
        self.find(&tile, scratch);
        for number in 0..BLOCKS * BLOCKS {
            self.block(number, &tile, band, scratch);
        }
    }

    /// Notes which texels are covered, and lays the base under them where it isn't the same everywhere.
    fn cover(&self, tile @ [columns, rows]: &Tile, band: &mut Band<'_>, scratch: &Scratch) {
        let size = self.settings.size as usize;
        let varies = self.base.is_some() || self.canvas.tints_base();
        for (line, row) in rows.clone().enumerate() {
            let first = line * size;
            for column in columns.clone() {
                let (texel, number) = (first + column as usize, place(tile, column, row));
                let owner = scratch.owners.of(number);
                if owner == NOBODY {
                    continue;
                }
                band.coverage[texel] = if scratch.owners.is_beside(number) { BESIDE } else { COVERED };
                if varies && band.maps.has(MapKind::Albedo) {
                    let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                    let face = &scratch.faces[owner as usize];
                    let (base, _) = self.base(at, face.triangle, face.placed.weights(at));
                    band.maps.set_albedo(texel, base);
                }
            }
        }
    }

    /// Finds the surface of each block.
    fn find(&self, tile: &Tile, scratch: &mut Scratch) {
        let Scratch { faces, blocks, .. } = scratch;
        blocks.clear();
        blocks.resize(BLOCKS * BLOCKS, Bounds::EMPTY);
        for face in faces {
            let region = within(tile, &face.placed.region(MARGIN));
            let [columns, rows] = [0, 1].map(|axis| {
                let start = tile[axis].start;
                (region[axis].start - start) / BLOCK..(region[axis].end - start + BLOCK - 1) / BLOCK
            });
            for row in rows {
                for column in columns.clone() {
                    let part = within(&block_of(tile, [column, row]), &region);
                    let block = &mut blocks[row as usize * BLOCKS + column as usize];
                    *block = block.with(face.region(&part));
                }
            }
        }
    }

    /// Paints the vessels that are near a block.
    fn block(&self, number: usize, tile: &Tile, band: &mut Band<'_>, scratch: &mut Scratch) {
        let Scratch { faces, owners, blocks, found, groups, sights, .. } = scratch;
        self.cones.near(&blocks[number], found);
        if found.is_empty() {
            return;
        }
        let origin = faces[0].corners[0];
        let block = block_of(tile, [number % BLOCKS, number / BLOCKS].map(|part| part as i64));
        let mut outline = Groups::EMPTY;
        for (number, group) in groups.iter_mut().enumerate() {
            group.set(&block, number, tile, (owners, faces, origin));
            outline.set(number, &group.spots, &group.owners.map(|owner| owner != NOBODY), group.blur);
        }
        sights.iter_mut().for_each(Sight::clear);
        for &number in found.iter() {
            let cone = &self.cones.cones[number as usize];
            let (start, look) = (cone.start - origin, &self.cones.looks[cone.layer as usize].look);
            for (group, reach) in outline.reaches(cone, start, look).into_iter().enumerate() {
                if reach > 0.0 {
                    sights[group].add((cone, number), look, (start, reach), &groups[group].spots, band.maps.made);
                }
            }
        }
        for (group, sight) in groups.iter().zip(sights.iter()) {
            for k in (0..LANES).filter(|&k| group.owners[k] != NOBODY) {
                let triangle = faces[group.owners[k] as usize].triangle;
                self.write((group.at[k], group.weights[k]), triangle, band, (sight, k));
            }
        }
    }

    /// Writes what is seen at a texel.
    fn write(&self, (at, weights): (DVec2, Vec3), triangle: usize, band: &mut Band<'_>, (sight, k): (&Sight, usize)) {
        let texel = (at.y as usize - band.row * TILE as usize) * self.settings.size as usize + at.x as usize;
        let maps = &mut band.maps;
        if sight.is_seen(k) {
            let (base, filter) = self.base(at, triangle, weights);
            let (color, roughness) = sight.over(k, self.cones, (base, self.settings.base_roughness), filter);
            maps.set_albedo(texel, color);
            maps.set_roughness(texel, roughness);
        }
        if let Some((height, slope)) = sight.relief(k) {
            if maps.has(MapKind::Normal) {
                maps.set_normal(texel, self.tangent_normal(triangle, weights, slope));
            }
            maps.set_height(texel, height, self.cones.highest);
        }
        if let Some((cone, depth)) = sight.covering(k) {
            let cone = &self.cones.cones[cone as usize];
            maps.set_id(texel, cone.node | (cone.layer + 1) << 24);
            maps.set_depth(texel, depth / self.cones.deepest);
        }
    }

    /// The base at a texel, and what vessels' colours are divided by there.
    fn base(&self, at: DVec2, triangle: usize, weights: Vec3) -> (Vec3, Vec3) {
        let base = match self.base {
            Some(image) => image.at(at.as_vec2() / self.settings.size as f32),
            None => Vec3::from_array(self.settings.base_color),
        };
        match self.canvas.color_at(triangle, weights) {
            Some((color, true)) => (base, color),
            Some((color, false)) => (base * color, Vec3::ONE),
            None => (base, Vec3::ONE),
        }
    }

    /// The normal of a surface with a slope, in the tangents that a renderer interpolates.
    fn tangent_normal(&self, triangle: usize, weights: Vec3, slope: Vec3) -> Vec3 {
        let vertices = self.canvas.mesh.triangles()[triangle].map(|vertex| vertex as usize);
        let (mut normal, mut tangent) = (Vec3::ZERO, Vec4::ZERO);
        for (vertex, weight) in vertices.into_iter().zip(weights.to_array()) {
            normal += self.canvas.normals[vertex] * weight;
            tangent += self.canvas.tangents[vertex] * weight;
        }
        let (sign, tangent) = (tangent.w, tangent.truncate());
        let bitangent = normal.cross(tangent) * sign;
        let up = normal.normalize_or(Vec3::Z);
        let raised = up - (slope - up * slope.dot(up));
        // The inverse of x·tangent + y·bitangent + z·normal, up to its length.
        let rows = [bitangent.cross(normal), normal.cross(tangent), tangent.cross(bitangent)];
        let turned = if rows[0].dot(tangent) < 0.0 { -1.0 } else { 1.0 };
        let seen = Vec3::from_array(rows.map(|row| row.dot(raised))) * turned;
        seen.try_normalize().unwrap_or(Vec3::Z)
    }
}

/// The texels of a block of a tile.
fn block_of(tile: &Tile, block: [i64; 2]) -> Tile {
    [0, 1].map(|axis| {
        let start = tile[axis].start + block[axis] * BLOCK;
        start..(start + BLOCK).min(tile[axis].end)
    })
}
