//! Paints the first level of all maps, tile by tile.

use super::atlas::Atlas;
use super::bins::Bins;
use super::canvas::Canvas;
use super::cones::Cones;
use super::face::Face;
use super::gauss::SEEN;
use super::settings::{BakeSettings, BaseImage, MapKind};
use super::shade::{Near, Sight};
use super::srgb::Srgb;
use super::texels::{MARGIN, TILE, TILE_TEXELS};
use super::window::Windows;
use crate::synthesis::space::bvh::Bounds;
use bevy_math::{DVec2, Vec2, Vec3};
use std::ops::Range;

/// Coverage of a texel beyond the border of a chart: its values are known, and it counts for nothing.
pub(super) const BESIDE: u8 = 1;
/// Coverage of a texel within a chart.
pub(super) const COVERED: u8 = 255;
/// Owner of a texel that no triangle has.
const NOBODY: u32 = u32::MAX;
/// Least weight of a corner at a point well within a triangle.
const WITHIN: f32 = 0.01;
/// 16 bits for a depth where there is no vessel.
const NO_DEPTH: u16 = u16::MAX;

/// A row of tiles of all maps.
pub(super) struct Band<'a> {
    /// Number of the row of tiles.
    pub row: usize,
    /// Coverage of each texel; 0 where nothing is known.
    pub coverage: &'a mut [u8],
    /// Bytes of each kind of map that is made.
    pub maps: [Option<&'a mut [u8]>; MapKind::ALL.len()],
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
    /// For each texel, the place of its triangle among those of the tile.
    owners: Vec<u32>,
    /// For each texel without an owner, the squared distance from the nearest triangle.
    distances: Vec<f64>,
    faces: Vec<Face>,
    found: Vec<u32>,
    near: Vec<Near>,
    in_row: Vec<Near>,
    sight: Sight,
}

/// The colour, height, normal … of a texel before any vessel.
pub(super) fn blank(kind: MapKind, settings: &BakeSettings, range: [f32; 2]) -> Vec<u8> {
    let srgb = Srgb::tables();
    match kind {
        MapKind::Albedo => {
            let [red, green, blue] = settings.base_color.map(|channel| srgb.encode(channel));
            vec![red, green, blue, 255]
        }
        MapKind::Normal => vec![128, 128, 255, 255],
        MapKind::Height => height(0.0, range).to_le_bytes().to_vec(),
        MapKind::Roughness => vec![255, unit_byte(settings.base_roughness), 0, 255],
        MapKind::Id => vec![0; 4],
        MapKind::Depth => NO_DEPTH.to_le_bytes().to_vec(),
    }
}

fn unit_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A height as 16 bits.
fn height(value: f32, [low, high]: [f32; 2]) -> u16 {
    if high > low { ((value - low) / (high - low) * 65535.0 + 0.5) as u16 } else { 0 }
}

/// A normal as bytes.
pub(super) fn normal_bytes(normal: Vec3) -> [u8; 4] {
    let [x, y, z] = (normal * 127.5 + 128.0).to_array().map(|value| value as u8);
    [x, y, z, 255]
}

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
        scratch.faces.clear();
        scratch.faces.extend(
            entries
                .iter()
                .map(|&entry| Face::of(self.canvas, self.atlas, &self.atlas.placements[entry as usize], size)),
        );
        scratch.owners.clear();
        scratch.owners.resize(TILE_TEXELS, NOBODY);
        band.overlaps += own(&tile, scratch);
        self.own_margin(entries, &tile, scratch);
        self.cover(&tile, band, scratch);
        self.paint(&tile, band, scratch);
    }

    /// Gives texels beside the borders of charts to the nearest triangle.
    fn own_margin(&self, entries: &[u32], tile: &[Range<i64>; 2], scratch: &mut Scratch) {
        scratch.distances.clear();
        for (number, &entry) in entries.iter().enumerate() {
            if !self.atlas.placements[entry as usize].is_border {
                continue;
            }
            if scratch.distances.is_empty() {
                let outside = |owner: &u32| if *owner == NOBODY { MARGIN * MARGIN } else { -1.0 };
                scratch.distances.extend(scratch.owners.iter().map(outside));
            }
            let placed = scratch.faces[number].placed;
            for (texel, at) in texels(tile, &placed.region(MARGIN)) {
                let best = &mut scratch.distances[texel];
                if *best >= 0.0 {
                    let squared = placed.distance_squared(at);
                    if squared < *best {
                        (*best, scratch.owners[texel]) = (squared, number as u32);
                    }
                }
            }
        }
    }

    /// Notes which texels are covered, and lays the base image under them.
    fn cover(&self, [columns, rows]: &[Range<i64>; 2], band: &mut Band<'_>, scratch: &Scratch) {
        let size = self.settings.size as usize;
        for (line, row) in rows.clone().enumerate() {
            let first = line * size + columns.start as usize;
            for column in 0..(columns.end - columns.start) as usize {
                let texel = line * TILE as usize + column;
                if scratch.owners[texel] == NOBODY {
                    continue;
                }
                let is_beside = scratch.distances.get(texel).is_some_and(|distance| *distance >= 0.0);
                band.coverage[first + column] = if is_beside { BESIDE } else { COVERED };
                if let (Some(image), Some(albedo)) = (self.base, &mut band.maps[MapKind::Albedo as usize]) {
                    let at = Vec2::new((columns.start as usize + column) as f32 + 0.5, row as f32 + 0.5) / size as f32;
                    let bytes = image.at(at).map(|channel| Srgb::tables().encode(channel));
                    albedo[4 * (first + column)..][..3].copy_from_slice(&bytes);
                }
            }
        }
    }

    /// Paints the vessels that are near.
    fn paint(&self, tile: &[Range<i64>; 2], band: &mut Band<'_>, scratch: &mut Scratch) {
        let region = scratch.faces.iter().map(|face| face.region(tile)).fold(Bounds::EMPTY, Bounds::with);
        self.cones.near(&region, &mut scratch.found);
        if scratch.found.is_empty() {
            return;
        }
        let Scratch { owners, faces, found, near, in_row, sight, .. } = scratch;
        for (number, face) in faces.iter().enumerate() {
            let (region, blur) = (face.region(tile), face.blur());
            let is_near = |cone: &&u32| self.cones.cones[**cone as usize].is_near(&region);
            near.clear();
            let mut windows = None;
            for &cone in found.iter().filter(is_near) {
                let windows = windows.get_or_insert_with(|| Windows::of(face));
                let (shape, start) = (&self.cones.cones[cone as usize], face.corners[0]);
                let look = &self.cones.looks[shape.layer as usize].look;
                if let Some((window, reach)) = windows.of_cone(shape, look, tile) {
                    near.push(Near::new(cone, shape.start - start, reach + SEEN * blur, window));
                }
            }
            if near.is_empty() {
                continue;
            }
            let [columns, rows] = within(tile, &face.placed.region(MARGIN));
            for row in rows {
                in_row.clear();
                in_row.extend(near.iter().filter(|segment| segment.is_in_row(row as i32)).cloned());
                if in_row.is_empty() {
                    continue;
                }
                for column in columns.clone() {
                    if owners[place(tile, column, row)] == number as u32 {
                        let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                        let weights = face.placed.weights(at);
                        sight.look(self.cones, in_row, column as i32, || face.spot(weights));
                        self.write((at, weights), face, band, sight);
                    }
                }
            }
        }
    }

    fn write(&self, (at, weights): (DVec2, Vec3), face: &Face, band: &mut Band<'_>, sight: &mut Sight) {
        let size = self.settings.size as usize;
        let texel = (at.y as usize - band.row * TILE as usize) * size + at.x as usize;
        let [albedo, normal, heights, roughness, ids, depths] = &mut band.maps;
        if !sight.seen.is_empty() && (albedo.is_some() || roughness.is_some()) {
            let base = match (self.base, &albedo) {
                (Some(image), Some(_)) => image.at(at.as_vec2() / size as f32),
                _ => self.settings.base_color,
            };
            let (color, rough) = sight.over(base, self.settings.base_roughness);
            if let Some(albedo) = albedo {
                albedo[4 * texel..][..3].copy_from_slice(&color.map(|channel| Srgb::tables().encode(channel)));
            }
            if let Some(roughness) = roughness {
                roughness[4 * texel + 1] = unit_byte(rough);
            }
        }
        if sight.height != 0.0 {
            if let Some(normal) = normal {
                let seen = self.tangent_normal(face.triangle, weights, sight.slope);
                normal[4 * texel..][..4].copy_from_slice(&normal_bytes(seen));
            }
            if let Some(heights) = heights {
                let value = height(sight.height, self.cones.highest);
                heights[2 * texel..][..2].copy_from_slice(&value.to_le_bytes());
            }
        }
        if let Some((cone, depth)) = sight.covering {
            let cone = &self.cones.cones[cone as usize];
            if let Some(ids) = ids {
                let id = cone.node | (cone.layer + 1) << 24;
                ids[4 * texel..][..4].copy_from_slice(&id.to_le_bytes());
            }
            if let Some(depths) = depths {
                // One less than the value that stands for no vessel.
                let value = (depth / self.cones.deepest).clamp(0.0, 1.0) * f32::from(NO_DEPTH - 1) + 0.5;
                depths[2 * texel..][..2].copy_from_slice(&(value as u16).to_le_bytes());
            }
        }
    }

    /// The normal of a surface with a slope, in the tangents that a renderer interpolates.
    fn tangent_normal(&self, triangle: usize, weights: Vec3, slope: Vec3) -> Vec3 {
        let vertices = self.canvas.mesh.triangles()[triangle].map(|vertex| vertex as usize);
        let weights = weights.to_array();
        let mut normal = Vec3::ZERO;
        let mut tangent = bevy_math::Vec4::ZERO;
        for (vertex, weight) in vertices.into_iter().zip(weights) {
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

/// Gives the texels within triangles to the first of them. Returns how many another one claims as well.
fn own(tile: &[Range<i64>; 2], scratch: &mut Scratch) -> usize {
    let Scratch { owners, faces, .. } = scratch;
    let mut overlaps = 0;
    for (number, face) in faces.iter().enumerate() {
        let [_, rows] = face.placed.region(0.0);
        for row in rows.start.max(tile[1].start)..rows.end.min(tile[1].end) {
            let span = face.placed.span(row);
            let line = (row - tile[1].start) as usize * TILE as usize;
            for column in span.start.max(tile[0].start)..span.end.min(tile[0].end) {
                let owner = &mut owners[line + (column - tile[0].start) as usize];
                if *owner == NOBODY {
                    *owner = number as u32;
                } else {
                    let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                    overlaps += usize::from(face.placed.weights(at).min_element() > WITHIN);
                }
            }
        }
    }
    overlaps
}

/// The texels of a tile within a region, with their centres in the texture.
fn texels(tile: &[Range<i64>; 2], region: &[Range<i64>; 2]) -> impl Iterator<Item = (usize, DVec2)> + use<> {
    let ([columns, rows], tile) = (within(tile, region), tile.clone());
    rows.flat_map(move |row| {
        let tile = tile.clone();
        columns
            .clone()
            .map(move |column| (place(&tile, column, row), DVec2::new(column as f64 + 0.5, row as f64 + 0.5)))
    })
}

/// The columns and rows of a tile within a region.
fn within(tile: &[Range<i64>; 2], region: &[Range<i64>; 2]) -> [Range<i64>; 2] {
    [0, 1].map(|axis| region[axis].start.max(tile[axis].start)..region[axis].end.min(tile[axis].end))
}

/// The place of a texel in its tile.
fn place(tile: &[Range<i64>; 2], column: i64, row: i64) -> usize {
    (row - tile[1].start) as usize * TILE as usize + (column - tile[0].start) as usize
}

impl BaseImage {
    /// Linear colour at a point of the texture, between the four nearest texels.
    fn at(&self, uv: Vec2) -> [f32; 3] {
        let srgb = Srgb::tables();
        let place = |share: f32, count: u32| {
            let at = (share * count as f32 - 0.5).clamp(0.0, (count - 1) as f32);
            let first = at as usize;
            (first, (first + 1).min(count as usize - 1), at - first as f32)
        };
        let (left, right, x) = place(uv.x, self.width);
        let (upper, lower, y) = place(uv.y, self.height);
        std::array::from_fn(|channel| {
            let at =
                |column: usize, row: usize| srgb.decode(self.rgba[4 * (row * self.width as usize + column) + channel]);
            let along = |row: usize| at(left, row) + (at(right, row) - at(left, row)) * x;
            along(upper) + (along(lower) - along(upper)) * y
        })
    }
}
