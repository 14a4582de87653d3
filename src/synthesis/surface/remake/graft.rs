//! Grafts: faces that take the place of others in a mesh.
//!
//! In: patches, each with the faces that it replaces. Out: the mesh with all of them. New vertices get their normals,
//! tangents and texture coordinates from the tube that they lie on.

use super::tubes::Cone;
use crate::synthesis::surface::curve::Curve;
use crate::synthesis::surface::direction::{across, unit};
use crate::synthesis::surface::mesh::SurfaceMesh;
use crate::synthesis::surface::trunks::Trunks;
use bevy_math::{Vec2, Vec3, Vec4};
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
    /// Unit directions out of the tube and along it.
    out: Vec3,
    ahead: Vec3,
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
        Some(Spot { trunk: cone.trunk, length, angle, radius: station.radius, out, ahead: station.ahead })
    }

    fn node(&self, spot: &Spot) -> u32 {
        self.trunks.nodes(spot.trunk as usize)[self.curves[spot.trunk as usize].place_at(spot.length)]
    }
}

/// Puts grafts in the place of faces.
pub(super) fn insert(mesh: &mut SurfaceMesh, grafts: &[Graft], lines: Lines<'_>) {
    let mut draft = Draft::of(mesh, grafts);
    for graft in grafts {
        draft.add(graft, lines);
    }
    *mesh = draft.finished();
}

/// A mesh while its faces are replaced.
struct Draft<'a> {
    old: &'a SurfaceMesh,
    /// Faces that stay, with the old mesh's numbers of vertices.
    faces: Vec<[u32; 4]>,
    /// Data of new vertices.
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<Vec4>,
    radii: Vec<f32>,
    nodes: Vec<u32>,
    uvs: Vec<Option<Vec2>>,
    /// New triangles, of references.
    triangles: Vec<[Corner; 3]>,
    /// Copies of vertices: of whom, and with which coordinates.
    copies: Vec<(Corner, Vec2, Vec4)>,
    known: BTreeMap<(Corner, [u32; 2]), u32>,
}

/// A vertex of a draft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Corner {
    Old(u32),
    New(u32),
    Copy(u32),
}

impl<'a> Draft<'a> {
    fn of(old: &'a SurfaceMesh, grafts: &[Graft]) -> Self {
        let mut goes = vec![false; old.faces.len()];
        grafts.iter().flat_map(|graft| &graft.faces).for_each(|&face| goes[face as usize] = true);
        let faces = old.faces.iter().zip(&goes).filter(|(_, goes)| !**goes).map(|(face, _)| *face).collect();
        Self {
            old,
            faces,
            positions: Vec::new(),
            normals: Vec::new(),
            tangents: Vec::new(),
            radii: Vec::new(),
            nodes: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
            copies: Vec::new(),
            known: BTreeMap::new(),
        }
    }

    fn add(&mut self, graft: &Graft, lines: Lines<'_>) {
        let (unique, first) = (self.old.unique() as u32, self.positions.len() as u32);
        let nearest = |position: Vec3| lines.spot(&graft.cones, position, None);
        let spots: Vec<Option<Spot>> = graft.positions.iter().map(|&position| nearest(position)).collect();
        let normals = graft.normals(&self.old.positions[..unique as usize]);
        for ((&position, spot), normal) in graft.positions.iter().zip(&spots).zip(normals) {
            let (out, ahead) = spot.map_or((Vec3::X, Vec3::Z), |spot| (spot.out, spot.ahead));
            // In a crease, the surface is that of no tube.
            let out = if out.dot(normal) < CREASED { normal } else { out };
            self.positions.push(position);
            self.normals.push(out);
            self.tangents.push(across(ahead.cross(out), out).extend(1.0));
            self.radii.push(spot.map_or(0.0, |spot| spot.radius));
            self.nodes.push(spot.map_or(0, |spot| lines.node(&spot)));
            self.uvs.push(None);
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
                *corner = self.charted(*corner, uv, &spot);
            }
            self.triangles.push(charted);
        }
    }

    fn position(&self, corner: Corner) -> Vec3 {
        match corner {
            Corner::Old(vertex) => self.old.positions[vertex as usize],
            Corner::New(vertex) => self.positions[vertex as usize],
            Corner::Copy(copy) => self.position(self.copies[copy as usize].0),
        }
    }

    /// A vertex with these texture coordinates.
    fn charted(&mut self, corner: Corner, uv: Vec2, spot: &Spot) -> Corner {
        if let Corner::New(vertex) = corner {
            let own = self.uvs[vertex as usize].get_or_insert(uv);
            if *own == uv {
                return corner;
            }
        }
        let key = (corner, [uv.x.to_bits(), uv.y.to_bits()]);
        let copies = &mut self.copies;
        let normal = match corner {
            Corner::Old(vertex) => self.old.normals[vertex as usize],
            Corner::New(vertex) => self.normals[vertex as usize],
            Corner::Copy(_) => spot.out,
        };
        let copy = *self.known.entry(key).or_insert_with(|| {
            let tangent = across(spot.ahead.cross(spot.out), normal);
            copies.push((corner, uv, tangent.extend(1.0)));
            copies.len() as u32 - 1
        });
        Corner::Copy(copy)
    }

    /// The mesh, without vertices that no face has.
    fn finished(self) -> SurfaceMesh {
        let (old, unique) = (self.old, self.old.unique());
        let mut is_used = vec![false; old.positions.len()];
        for &vertex in self.faces.iter().flatten() {
            is_used[vertex as usize] = true;
            is_used[old.original(vertex) as usize] = true;
        }
        for corner in self.triangles.iter().flatten().chain(self.copies.iter().map(|copy| &copy.0)) {
            if let Corner::Old(vertex) = corner {
                is_used[*vertex as usize] = true;
            }
        }
        let mut mesh = SurfaceMesh::default();
        let mut numbers = vec![u32::MAX; old.positions.len()];
        let keep = |vertex: usize, mesh: &mut SurfaceMesh, numbers: &mut [u32]| {
            numbers[vertex] = mesh.positions.len() as u32;
            mesh.positions.push(old.positions[vertex]);
            mesh.normals.push(old.normals[vertex]);
            mesh.tangents.push(old.tangents[vertex]);
            mesh.uvs.push(old.uvs[vertex]);
            mesh.radii.push(old.radii[vertex]);
            mesh.nodes.push(old.nodes[vertex]);
        };
        (0..unique).filter(|&vertex| is_used[vertex]).for_each(|vertex| keep(vertex, &mut mesh, &mut numbers));
        let first_new = mesh.positions.len() as u32;
        mesh.positions.extend(&self.positions);
        mesh.normals.extend(&self.normals);
        mesh.tangents.extend(&self.tangents);
        mesh.radii.extend(&self.radii);
        mesh.nodes.extend(&self.nodes);
        mesh.uvs.extend(self.uvs.iter().map(|uv| uv.unwrap_or_default()));
        for vertex in (unique..old.positions.len()).filter(|&vertex| is_used[vertex]) {
            keep(vertex, &mut mesh, &mut numbers);
            mesh.copies.push(numbers[old.copies[vertex - unique] as usize]);
        }
        let first_copy = mesh.positions.len() as u32;
        let number = |corner: Corner| match corner {
            Corner::Old(vertex) => numbers[vertex as usize],
            Corner::New(vertex) => first_new + vertex,
            Corner::Copy(copy) => first_copy + copy,
        };
        for &(corner, uv, tangent) in &self.copies {
            let original = number(corner) as usize;
            mesh.positions.push(mesh.positions[original]);
            mesh.normals.push(mesh.normals[original]);
            mesh.radii.push(mesh.radii[original]);
            mesh.nodes.push(mesh.nodes[original]);
            mesh.tangents.push(tangent);
            mesh.uvs.push(uv);
            mesh.copies.push(original as u32);
        }
        mesh.faces = self.faces.iter().map(|face| face.map(|vertex| numbers[vertex as usize])).collect();
        mesh.faces.extend(self.triangles.iter().map(|&[a, b, c]| [number(a), number(b), number(c), number(c)]));
        mesh
    }
}
