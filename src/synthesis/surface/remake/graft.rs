//! Grafts: faces that take the place of others in a mesh.
//!
//! In: patches, each with the faces that it replaces. Out: the mesh with all of them. New vertices get their normals,
//! and texture coordinates from the tube that they lie on.

use super::tubes::Cone;
use crate::synthesis::mesh::bit_grid::BitGrid;
use crate::synthesis::pace::Pace;
use crate::synthesis::surface::curve::Curve;
use crate::synthesis::surface::direction::{across, unit};
use crate::synthesis::surface::mesh::SurfaceMesh;
use crate::synthesis::surface::trunks::Trunks;
use bevy_math::{Vec2, Vec3};
use std::{collections::BTreeMap, f32::consts::TAU};

/// Cosine of the angle between a tube's normal and that of the faces from which on a vertex has the latter: 20°.
const CREASED: f32 = 0.94;

/// What takes the place of some faces.
#[derive(Debug)]
pub(super) struct Graft {
    /// Numbers of the faces that go.
    pub faces: Vec<u32>,
    /// New vertices, in the mesh's coordinates.
    pub positions: Vec<Vec3>,
    /// New triangles: the mesh's own vertices, then the new ones from the mesh's number of unique vertices on.
    pub triangles: Vec<[u32; 3]>,
    /// The tubes, in the coordinates of the curves.
    pub cones: Vec<Cone>,
}

impl Graft {
    /// Unit normals of the new vertices: means of those of their faces, weighted by area.
    fn normals(&self, old: &[Vec3]) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        let position = |vertex: u32| match (vertex as usize).checked_sub(old.len()) {
            None => old[vertex as usize],
            Some(new) => self.positions[new],
        };
        for &corners in &self.triangles {
            let [a, b, c] = corners.map(position);
            let normal = (b - a).cross(c - a);
            for new in corners.into_iter().filter_map(|corner| (corner as usize).checked_sub(old.len())) {
                sums[new] += normal;
            }
        }
        sums.into_iter().map(|sum| unit(sum).unwrap_or(Vec3::X)).collect()
    }
}

/// A point on a tube.
#[derive(Clone, Copy)]
struct Spot {
    trunk: u32,
    /// Length along the trunk, angle around it, and radius.
    length: f32,
    angle: f32,
    radius: f32,
    /// Unit direction out of the tube.
    out: Vec3,
}

/// Where curves lie, and the nodes along them.
#[derive(Clone, Copy)]
pub(super) struct Lines<'a> {
    pub curves: &'a [Curve],
    pub trunks: &'a Trunks,
    pub origin: Vec3,
}

impl Lines<'_> {
    /// The place of a point on the nearest tube, of one trunk or of any.
    fn spot(&self, cones: &[Cone], point: Vec3, trunk: Option<u32>) -> Option<Spot> {
        let point = point - self.origin;
        let mut nearest: Option<(f32, f32, &Cone)> = None;
        for cone in cones.iter().filter(|cone| trunk.is_none_or(|trunk| cone.trunk == trunk)) {
            let (distance, share) = cone.distance(point);
            if nearest.is_none_or(|(least, ..)| distance < least) {
                nearest = Some((distance, share, cone));
            }
        }
        let (_, share, cone) = nearest?;
        let length = cone.lengths[0] + share * (cone.lengths[1] - cone.lengths[0]);
        let station = self.curves[cone.trunk as usize].at(length);
        let away = point - cone.centers[0].lerp(cone.centers[1], share);
        let out = unit(away).unwrap_or_else(|| across(away, station.ahead));
        let angle = station.angle_of(out);
        Some(Spot { trunk: cone.trunk, length, angle, radius: station.radius, out })
    }

    fn node(&self, spot: &Spot) -> u32 {
        self.trunks.nodes(spot.trunk as usize)[self.curves[spot.trunk as usize].place_at(spot.length)]
    }
}

/// What grafts bring into a mesh. They and their lines are no longer needed then.
pub(super) fn parts_of(grafts: Vec<Graft>, mesh: &SurfaceMesh, lines: Lines<'_>) -> Parts {
    let mut draft = Draft { old: mesh, new: Parts::default(), known: BTreeMap::new() };
    for graft in grafts {
        draft.add(&graft, lines);
        draft.new.replaced.extend(graft.faces);
    }
    draft.new
}

/// What comes into a mesh.
#[derive(Default)]
pub(super) struct Parts {
    /// Numbers of the faces that go.
    replaced: Vec<u32>,
    /// Data of new vertices.
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    radii: Vec<f32>,
    nodes: Vec<u32>,
    uvs: Vec<Option<Vec2>>,
    /// New triangles, of references.
    triangles: Vec<[Corner; 3]>,
    /// Copies of vertices: of whom, and with which coordinates.
    copies: Vec<(Corner, Vec2)>,
}

/// A mesh and what comes into it.
struct Draft<'a> {
    old: &'a SurfaceMesh,
    new: Parts,
    known: BTreeMap<(Corner, [u32; 2]), u32>,
}

/// A vertex of a draft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Corner {
    Old(u32),
    New(u32),
    Copy(u32),
}

impl Draft<'_> {
    fn add(&mut self, graft: &Graft, lines: Lines<'_>) {
        let (unique, first) = (self.old.unique() as u32, self.new.positions.len() as u32);
        let nearest = |position: Vec3| lines.spot(&graft.cones, position, None);
        let spots: Vec<Option<Spot>> = graft.positions.iter().map(|&position| nearest(position)).collect();
        let normals = graft.normals(&self.old.positions[..unique as usize]);
        for ((&position, spot), normal) in graft.positions.iter().zip(&spots).zip(normals) {
            let out = spot.map_or(Vec3::X, |spot| spot.out);
            // In a crease, the surface is that of no tube.
            let out = if out.dot(normal) < CREASED { normal } else { out };
            self.new.positions.push(position);
            self.new.normals.push(out);
            self.new.radii.push(spot.map_or(0.0, |spot| spot.radius));
            self.new.nodes.push(spot.map_or(0, |spot| lines.node(&spot)));
            self.new.uvs.push(None);
        }
        for &triangle in &graft.triangles {
            let corners = triangle.map(|vertex| match vertex.checked_sub(unique) {
                None => Corner::Old(vertex),
                Some(new) => Corner::New(first + new),
            });
            let own = triangle.map(|vertex| match vertex.checked_sub(unique) {
                None => nearest(self.old.positions[vertex as usize]),
                Some(new) => spots[new as usize],
            });
            // The texture of the tube on which its first corner lies.
            let Some(leading) = own.into_iter().flatten().next() else { continue };
            let mut charted = corners;
            for (corner, own) in charted.iter_mut().zip(own) {
                let same = own.filter(|spot| spot.trunk == leading.trunk);
                let position = self.position(*corner);
                let Some(spot) = same.or_else(|| lines.spot(&graft.cones, position, Some(leading.trunk))) else {
                    continue;
                };
                // The angle nearest to that of the first corner, so that no triangle runs all the way round.
                let angle = spot.angle + TAU * ((leading.angle - spot.angle) / TAU).round();
                let uv = Vec2::new(angle * spot.radius, spot.length);
                *corner = self.charted(*corner, uv);
            }
            self.new.triangles.push(charted);
        }
    }

    fn position(&self, corner: Corner) -> Vec3 {
        match corner {
            Corner::Old(vertex) => self.old.positions[vertex as usize],
            Corner::New(vertex) => self.new.positions[vertex as usize],
            Corner::Copy(copy) => self.position(self.new.copies[copy as usize].0),
        }
    }

    /// A vertex with these texture coordinates.
    fn charted(&mut self, corner: Corner, uv: Vec2) -> Corner {
        if let Corner::New(vertex) = corner {
            let own = self.new.uvs[vertex as usize].get_or_insert(uv);
            if *own == uv {
                return corner;
            }
        }
        let key = (corner, [uv.x.to_bits(), uv.y.to_bits()]);
        let copies = &mut self.new.copies;
        let copy = *self.known.entry(key).or_insert_with(|| {
            copies.push((corner, uv));
            copies.len() as u32 - 1
        });
        Corner::Copy(copy)
    }
}

impl Parts {
    /// Puts the new faces in the place of those that go, without vertices that no face has. In place, since a mesh may
    /// take most of the memory there is.
    pub async fn put_into(self, mesh: &mut SurfaceMesh, pace: &Pace) {
        let replaced = |face: usize| Some(self.replaced[face] as usize);
        let goes = BitGrid::new(mesh.faces.len(), self.replaced.len(), replaced, &pace.part(0.0..0.1)).await;
        let stays = self.vertices_that_stay(mesh, &goes, &pace.part(0.1..0.5)).await;
        let (old_unique, new) = (mesh.unique(), self.positions.len());
        // New vertices stand between those with places of their own and their copies.
        let renamed = |vertex: u32| {
            let copies_shift = if (vertex as usize) < old_unique { 0 } else { new };
            (stays.rank(vertex as usize) + copies_shift) as u32
        };
        let mut copy = old_unique..;
        mesh.copies.retain(|_| copy.next().is_some_and(|copy| stays.contains(copy)));
        mesh.copies.iter_mut().for_each(|original| *original = renamed(*original));
        mesh.copies.reserve_exact(self.copies.len());
        let unique = stays.rank(old_unique);
        let place = Place { at: unique, copies: self.copies.len() };
        let uvs = self.uvs.into_iter().map(Option::unwrap_or_default).collect();
        exchange(&mut mesh.positions, &stays, place, self.positions);
        pace.rest(0.6).await;
        exchange(&mut mesh.normals, &stays, place, self.normals);
        pace.rest(0.65).await;
        exchange(&mut mesh.radii, &stays, place, self.radii);
        pace.rest(0.7).await;
        exchange(&mut mesh.nodes, &stays, place, self.nodes);
        pace.rest(0.75).await;
        exchange(&mut mesh.uvs, &stays, place, uvs);
        pace.rest(0.8).await;
        let first_copy = mesh.positions.len() as u32;
        let number = |corner: Corner| match corner {
            Corner::Old(vertex) => renamed(vertex),
            Corner::New(vertex) => unique as u32 + vertex,
            Corner::Copy(copy) => first_copy + copy,
        };
        for &(corner, uv) in &self.copies {
            let original = number(corner) as usize;
            mesh.positions.push(mesh.positions[original]);
            mesh.normals.push(mesh.normals[original]);
            mesh.radii.push(mesh.radii[original]);
            mesh.nodes.push(mesh.nodes[original]);
            mesh.uvs.push(uv);
            mesh.copies.push(original as u32);
        }
        let mut face = 0..;
        mesh.faces.retain(|_| face.next().is_some_and(|face| !goes.contains(face)));
        pace.part(0.85..1.0).each(mesh.faces.len(), |face| mesh.faces[face] = mesh.faces[face].map(renamed)).await;
        mesh.faces.reserve_exact(self.triangles.len());
        mesh.faces.extend(self.triangles.iter().map(|&[a, b, c]| [number(a), number(b), number(c), number(c)]));
    }

    /// Which vertices faces will have: those of the faces that stay, with their originals, and those of new ones.
    async fn vertices_that_stay(&self, mesh: &SurfaceMesh, goes: &BitGrid, pace: &Pace) -> BitGrid {
        let old = |corner: &Corner| match corner {
            Corner::Old(vertex) => Some(*vertex as usize),
            Corner::New(_) | Corner::Copy(_) => None,
        };
        let corners = self.triangles.iter().flatten().chain(self.copies.iter().map(|copy| &copy.0));
        let kept: Vec<usize> = corners.filter_map(old).collect();
        let of_faces = 8 * mesh.faces.len();
        let stays = |candidate: usize| match candidate.checked_sub(of_faces) {
            Some(kept_number) => Some(kept[kept_number]),
            None if goes.contains(candidate / 8) => None,
            None => {
                let vertex = mesh.faces[candidate / 8][candidate % 4];
                Some(if candidate % 8 < 4 { vertex } else { mesh.original(vertex) } as usize)
            }
        };
        BitGrid::new(mesh.positions.len(), of_faces + kept.len(), stays, pace).await
    }
}

/// Where new values come in.
#[derive(Clone, Copy)]
struct Place {
    at: usize,
    /// How many more will be pushed.
    copies: usize,
}

/// Keeps the values that stay, and puts new ones in their place, with room for copies.
fn exchange<T>(values: &mut Vec<T>, stays: &BitGrid, place: Place, new: Vec<T>) {
    let mut vertex = 0..;
    values.retain(|_| vertex.next().is_some_and(|vertex| stays.contains(vertex)));
    values.reserve_exact(new.len() + place.copies);
    values.splice(place.at..place.at, new);
}
