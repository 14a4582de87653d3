//! Tangents are those that renderers compute, so that normals in maps mean there what they were meant to.

use bevy_math::{Vec2, Vec3, Vec4};
use bevy_mikktspace::{Geometry, StdOps, TangentSpace, generate_tangents};
use bevy_vessels::synthesis::{
    mesh::ShadedMesh,
    organ::{ColonSettings, EyeSettings, KidneySettings, LiverSettings},
    texture::{Bake, BakeSettings, Canvas, Layer, MapKind, VesselLook},
    tree::{NO_PARENT, VesselTree},
};

const SIZE: usize = 2048;
/// Texels by which a texel lies within its triangle: seams are closed beside the others.
const WITHIN: f32 = 3.0;

/// A mesh as the reference implementation of tangents wants it.
struct Reference<'a> {
    mesh: &'a ShadedMesh,
    tangents: Vec<Vec4>,
}

impl Reference<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry<StdOps> for Reference<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.mesh.uvs[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let vertex = self.vertex(face, corner);
        // It takes v to point up, where textures have it down, as Bevy's own meshes say.
        let [x, y, z, w] = space.unwrap_or_default().tangent_encoded();
        self.tangents[vertex] = Vec4::new(x, y, z, -w);
    }
}

/// The tangents that Bevy generates.
fn reference(mesh: &ShadedMesh) -> Vec<Vec4> {
    let mut reference = Reference { mesh, tangents: vec![Vec4::ZERO; mesh.positions.len()] };
    generate_tangents(&mut reference).expect("tangents");
    reference.tangents
}

/// The four organs, of so few triangles that these are some texels wide.
fn organs() -> [(&'static str, ShadedMesh); 4] {
    let colon = ColonSettings { triangles: 30_000, ..Default::default() }.generate().expect("a colon");
    let eye = EyeSettings { triangles: 24_000, ..Default::default() }.generate().expect("an eye");
    let kidney = KidneySettings { triangles: 20_000, ..Default::default() }.generate().expect("a kidney");
    let liver = LiverSettings { subdivisions: 5, ..Default::default() }.generate().expect("a liver");
    [("colon", colon.mesh), ("eye", eye.globe), ("kidney", kidney.mesh), ("liver", liver.mesh)]
}

/// Straight vessels that touch a mesh all over, one for each of some triangles, along its first side.
fn vessels(mesh: &ShadedMesh) -> VesselTree {
    let (mut positions, mut parents, mut radii) = (Vec::new(), Vec::new(), Vec::new());
    for corners in mesh.triangles.iter().step_by(41) {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let (middle, along) = ((a + b + c) / 3.0, 0.5 * (b - a));
        parents.extend([NO_PARENT, positions.len() as u32]);
        positions.extend([middle - along, middle + along]);
        radii.extend([0.3 * (c - 0.5 * (a + b)).length(); 2]);
    }
    VesselTree::from_arrays(positions, parents, radii).expect("a tree")
}

#[test]
fn tangents_are_those_of_the_reference() {
    for (name, mesh) in organs() {
        let canvas = Canvas::of_shaded(&mesh).expect("a canvas");
        let mut is_used = vec![false; mesh.positions.len()];
        mesh.triangles.iter().flatten().for_each(|&corner| is_used[corner as usize] = true);
        let tangents = canvas.tangents().iter().zip(reference(&mesh)).enumerate();
        for (vertex, (own, other)) in tangents.filter(|(vertex, _)| is_used[*vertex]) {
            let angle = own.truncate().angle_between(other.truncate()).to_degrees();
            assert!(own.w == other.w && angle < 0.1, "{name}, vertex {vertex}: {own} for {other}, {angle}° apart");
        }
    }
}

#[test]
fn normals_shaded_with_the_references_tangents_are_those_of_the_relief() {
    for (name, mesh) in organs() {
        let (canvas, tree) = (Canvas::of_shaded(&mesh).expect("a canvas"), vessels(&mesh));
        let look = VesselLook { bump: 0.5, fade: 0.0, ..VesselLook::default() };
        let settings = BakeSettings {
            size: SIZE as u32,
            maps: [MapKind::Normal, MapKind::Height].into_iter().collect(),
            ..BakeSettings::default()
        };
        let bake = Bake::new(&canvas, &[Layer { tree: &tree, look }], None, &settings).expect("a bake");
        let mut off = angles(&mesh, &bake, &reference(&mesh));
        off.sort_unstable_by(f32::total_cmp);
        let raised = off.len();
        let (middle, most) = (off[raised / 2], off[raised * 95 / 100]);
        // Bytes are off by up to 0.4°. Where two vessels meet, heights have a ridge, and no slope.
        assert!(raised > 100_000 && middle < 0.4 && most < 2.0, "{name}: {middle}°, {most}° of {raised} texels");
    }
}

/// For all raised texels well within a triangle, the angle between the normal that a renderer sees there, and that of
/// the surface raised by the map of heights.
fn angles(mesh: &ShadedMesh, bake: &Bake, tangents: &[Vec4]) -> Vec<f32> {
    let [normals, heights] = [MapKind::Normal, MapKind::Height].map(|kind| &bake.map(kind).expect("a map").levels[0]);
    let [low, high] = bake.report.height_range;
    let height = |x: usize, y: usize| {
        let texel = 2 * (y * SIZE + x);
        low + (high - low) * f32::from(u16::from_le_bytes([heights[texel], heights[texel + 1]])) / 65535.0
    };
    let mut angles = Vec::new();
    for corners in &mesh.triangles {
        let vertices = corners.map(|corner| corner as usize);
        let [a, b, c] = vertices.map(|vertex| mesh.uvs[vertex] * SIZE as f32);
        let doubled = (b - a).perp_dot(c - a);
        let weights = |at: Vec2| {
            let (second, third) = ((at - a).perp_dot(c - a) / doubled, (b - a).perp_dot(at - a) / doubled);
            [1.0 - second - third, second, third]
        };
        let point = |at: Vec2| vertices.into_iter().zip(weights(at)).map(|(v, weight)| mesh.positions[v] * weight);
        let [right, down] = [Vec2::X, Vec2::Y].map(|way| point(a + way).sum::<Vec3>() - mesh.positions[vertices[0]]);
        let (from, to) = (a.min(b).min(c).as_uvec2(), a.max(b).max(c).as_uvec2());
        for (x, y) in (from.y..=to.y).flat_map(|y| (from.x..=to.x).map(move |x| (x, y))) {
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let is_within = |way: Vec2| weights(at + WITHIN * way).into_iter().all(|weight| weight >= 0.0);
            if ![Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y].into_iter().all(is_within) {
                continue;
            }
            let (x, y) = (x as usize, y as usize);
            let slope = 0.5 * Vec2::new(height(x + 1, y) - height(x - 1, y), height(x, y + 1) - height(x, y - 1));
            if slope == Vec2::ZERO {
                continue;
            }
            let (mut normal, mut tangent) = (Vec3::ZERO, Vec4::ZERO);
            for (vertex, weight) in vertices.into_iter().zip(weights(at)) {
                normal += mesh.normals[vertex] * weight;
                tangent += tangents[vertex] * weight;
            }
            // The vector across the normal whose products with both ways are the changes of height.
            let (face, up) = (right.cross(down), normal.normalize());
            let rise = (down.cross(face) * slope.x + face.cross(right) * slope.y) / face.length_squared();
            let meant = up - (rise - face * (rise.dot(up) / face.dot(up)));
            let bytes = &normals[4 * (y * SIZE + x)..][..3];
            let seen = Vec3::new(bytes[0].into(), bytes[1].into(), bytes[2].into()) / 127.5 - 1.0;
            // As Bevy's shader does, without normalising what is interpolated.
            let along = tangent.truncate();
            let shaded = along * seen.x + tangent.w * normal.cross(along) * seen.y + normal * seen.z;
            angles.push(shaded.angle_between(meant).to_degrees());
        }
    }
    angles
}
