//! Grafts: faces that take the place of others in a mesh.
//!
//! In: patches, each with the faces that it replaces. Out: the mesh with all of them. New vertices get their normals,
//! and texture coordinates from the tube that they lie on.

use super::tubes::Cone;
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

/// Puts grafts in the place of faces.
pub(super) fn insert(mesh: &mut SurfaceMesh, grafts: &[Graft], lines: Lines<'_>) {
    let mut draft = Draft { old: mesh, new: Parts::default(), known: BTreeMap::new() };
    for graft in grafts {
        draft.add(graft, lines);
    }
    let parts = draft.new;
    let mut goes = vec![false; mesh.faces.len()];
    grafts.iter().flat_map(|graft| &graft.faces).for_each(|&face| goes[face as usize] = true);
    parts.put_into(mesh, &goes);
}

/// What comes into a mesh.
#[derive(Default)]
struct Parts {
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
    fn put_into(self, mesh: &mut SurfaceMesh, goes: &[bool]) {
        let stays = self.vertices_that_stay(mesh, goes);
        let (old_unique, new) = (mesh.unique(), self.positions.len() as u32);
        let mut count = 0;
        let numbers: Vec<u32> = (0..stays.len())
            .map(|vertex| {
                // New vertices stand between those with places of their own and their copies.
                let number = count + if vertex < old_unique { 0 } else { new };
                count += u32::from(stays[vertex]);
                number
            })
            .collect();
        let unique = numbers.get(old_unique).map_or(count, |&first_copy| first_copy - new) as usize;
        keep(&mut mesh.copies, &stays[old_unique..]);
        mesh.copies.iter_mut().for_each(|original| *original = numbers[*original as usize]);
        let uvs = self.uvs.into_iter().map(Option::unwrap_or_default).collect();
        exchange(&mut mesh.positions, &stays, unique, self.positions);
        exchange(&mut mesh.normals, &stays, unique, self.normals);
        exchange(&mut mesh.radii, &stays, unique, self.radii);
        exchange(&mut mesh.nodes, &stays, unique, self.nodes);
        exchange(&mut mesh.uvs, &stays, unique, uvs);
        let first_copy = mesh.positions.len() as u32;
        let number = |corner: Corner| match corner {
            Corner::Old(vertex) => numbers[vertex as usize],
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
        let mut face = 0;
        mesh.faces.retain_mut(|corners| {
            face += 1;
            *corners = corners.map(|vertex| numbers[vertex as usize]);
            !goes[face - 1]
        });
        mesh.faces.reserve_exact(self.triangles.len());
        mesh.faces.extend(self.triangles.iter().map(|&[a, b, c]| [number(a), number(b), number(c), number(c)]));
    }

    /// Which vertices faces will have: those of the faces that stay, with their originals, and those of new ones.
    fn vertices_that_stay(&self, mesh: &SurfaceMesh, goes: &[bool]) -> Vec<bool> {
        let mut stays = vec![false; mesh.positions.len()];
        for (face, _) in mesh.faces.iter().zip(goes).filter(|(_, goes)| !**goes) {
            for &vertex in face {
                stays[vertex as usize] = true;
                stays[mesh.original(vertex) as usize] = true;
            }
        }
        for corner in self.triangles.iter().flatten().chain(self.copies.iter().map(|copy| &copy.0)) {
            if let Corner::Old(vertex) = corner {
                stays[*vertex as usize] = true;
            }
        }
        stays
    }
}

/// Keeps the values that stay, in their order.
fn keep<T>(values: &mut Vec<T>, stays: &[bool]) {
    let mut stays = stays.iter();
    values.retain(|_| stays.next().is_some_and(|stays| *stays));
}

/// Keeps the values that stay, and puts new ones at a place.
fn exchange<T>(values: &mut Vec<T>, stays: &[bool], at: usize, new: Vec<T>) {
    keep(values, stays);
    values.reserve_exact(new.len());
    values.splice(at..at, new);
}
