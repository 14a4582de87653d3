//! The picture of the film of blood: one wet surface with a round front, whose colour comes from its depth.
//!
//! The mesh ends on the line where the film is as thin as it can be, between the cells, so that its front is smooth. It
//! is drawn twice: first as a filter, which lets more of the light from the tissue below pass where it is thin; then as
//! the light that blood itself scatters and reflects. Both need a camera in high dynamic range, since light that is
//! already mapped to the screen can't be filtered.

use super::{film::Film, surface::Surface};
use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::NoFrustumCulling,
    light::NotShadowCaster,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use std::collections::HashMap;

/// Least visible depth, in metres.
const EDGE: f32 = 0.000_05;
/// Light that passes blood falls to a third within these depths, in metres: red, green, blue, in fresh blood.
const PASSES: Vec3 = Vec3::new(0.000_75, 0.000_13, 0.000_1);
/// The same in clotted blood, relative to fresh blood.
const CLOTTED: Vec3 = Vec3::new(0.3, 0.5, 0.5);
/// Share of the light that deep blood scatters back: fresh and clotted.
const SCATTERS: [Vec3; 2] = [Vec3::new(0.07, 0.002, 0.0025), Vec3::new(0.03, 0.0015, 0.0015)];
/// Height of the film's base above the surface, in world units.
const LIFT: f32 = 0.0005;
/// Radius of the film's rim, in metres, and a factor by which the film is drawn deeper, so that it catches the light.
const RIM: f32 = 0.000_35;
const RELIEF: f32 = 1.6;
/// Rounds of smoothing before the film is drawn: fewer leave jags where a deep pool spills over a ledge.
const SMOOTHED: u32 = 10;
/// The number of a cell outside the mesh.
const NONE: u32 = u32::MAX;

/// The mesh of the film while it is made, and where it is drawn.
#[derive(Default)]
pub struct FilmPicture {
    /// Cells in the mesh, the wet ones first, and the number of each cell in this list.
    cells: Vec<u32>,
    numbers: Vec<u32>,
    depths: Vec<f32>,
    /// The film as a filter, and as what scatters and reflects.
    layers: Option<[Handle<Mesh>; 2]>,
}

/// A corner of the film's mesh.
#[derive(Clone, Copy)]
struct Corner {
    position: Vec3,
    normal: Vec3,
    depth: f32,
    clotted: f32,
}

impl Corner {
    fn mix(self, other: Self, share: f32) -> Self {
        Self {
            position: self.position.lerp(other.position, share),
            normal: self.normal.lerp(other.normal, share),
            depth: self.depth + share * (other.depth - self.depth),
            clotted: self.clotted + share * (other.clotted - self.clotted),
        }
    }

    /// Share of the light that passes.
    fn passing(&self) -> Vec3 {
        let reach = PASSES * Vec3::ONE.lerp(CLOTTED, self.clotted);
        Vec3::from_array((Vec3::splat(-self.depth) / reach).to_array().map(ops::exp))
    }

    /// Share of the light that is scattered back.
    fn scattering(&self) -> Vec3 {
        SCATTERS[0].lerp(SCATTERS[1], self.clotted) * (1.0 - self.passing())
    }

    /// Height above the film's base, in metres: round at the rim.
    fn height(&self) -> f32 {
        let over = RELIEF * (self.depth - EDGE).max(0.0);
        (over * (over + 2.0 * RIM)).sqrt()
    }
}

impl FilmPicture {
    /// Corners and triangles of the film at present.
    fn draw(&mut self, film: &Film, surface: &Surface) -> (Vec<Corner>, Vec<u32>) {
        let inner = self.gather(film);
        self.smooth(film, inner);
        let corner = |(&cell, &depth): (&u32, &f32)| Corner {
            position: surface.breathed(film.skin.positions[cell as usize]),
            normal: film.skin.normals[cell as usize],
            depth,
            clotted: film.clotted(cell),
        };
        let mut corners: Vec<Corner> = self.cells.iter().zip(&self.depths).map(corner).collect();
        let triangles = self.clip(film, inner, &mut corners);
        self.cells.iter().for_each(|&cell| self.numbers[cell as usize] = NONE);
        for corner in &mut corners {
            corner.position += corner.normal * (LIFT + corner.height() / film.unit);
        }
        bend_normals(&mut corners, &triangles);
        (corners, triangles)
    }

    /// Lists the wet cells, and two rings around them, over which depths are smoothed. Returns the number without the
    /// outer ring.
    fn gather(&mut self, film: &Film) -> usize {
        self.numbers.resize(film.depths.len(), NONE);
        self.cells.clear();
        self.cells.extend(film.wet.iter().copied().filter(|&cell| film.depths[cell as usize] > 1.0e-6));
        self.cells.iter().enumerate().for_each(|(number, &cell)| self.numbers[cell as usize] = number as u32);
        let mut from = 0;
        for _ in 0..2 {
            let before = self.cells.len();
            for index in from..before {
                for neighbour in film.skin.neighbours(self.cells[index]) {
                    if self.numbers[neighbour as usize] == NONE {
                        self.numbers[neighbour as usize] = self.cells.len() as u32;
                        self.cells.push(neighbour);
                    }
                }
            }
            from = before;
        }
        from
    }

    /// Depths to be drawn: means over neighbours, which hide the cells. Those of the outer ring are 0.
    fn smooth(&mut self, film: &Film, inner: usize) {
        self.depths.clear();
        self.depths.extend(self.cells.iter().map(|&cell| film.depths[cell as usize]));
        let mut before = Vec::new();
        for _ in 0..SMOOTHED {
            before.clone_from(&self.depths);
            for (depth, &cell) in self.depths[..inner].iter_mut().zip(&self.cells) {
                let around = film.skin.neighbours(cell).map(|other| before[self.numbers[other as usize] as usize]);
                let (sum, count) = around.fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0_f32));
                *depth = 0.4 * *depth + 0.6 * sum / count.max(1.0);
            }
        }
    }

    /// The part of each triangle that is deeper than the [`EDGE`], with new corners on that line.
    fn clip(&self, film: &Film, inner: usize, corners: &mut Vec<Corner>) -> Vec<u32> {
        let mut triangles = Vec::new();
        let mut on_edges: HashMap<[u32; 2], u32> = HashMap::new();
        for (number, &cell) in self.cells[..inner].iter().enumerate() {
            for triangle in film.skin.triangles_around(cell) {
                let own = film.skin.triangles[triangle as usize].map(|corner| self.numbers[corner as usize]);
                // Each triangle once, by the first of its corners.
                if own.iter().any(|&corner| corner < number as u32) {
                    continue;
                }
                let mut part = [0; 4];
                let mut length = 0;
                for side in 0..3 {
                    let [a, b] = [own[side], own[(side + 1) % 3]];
                    let [deep_a, deep_b] = [a, b].map(|corner| corners[corner as usize].depth > EDGE);
                    if deep_a {
                        part[length] = a;
                        length += 1;
                    }
                    if deep_a != deep_b {
                        part[length] = *on_edges.entry([a.min(b), a.max(b)]).or_insert_with_key(|&ends| {
                            let [a, b] = ends.map(|end| corners[end as usize]);
                            corners.push(a.mix(b, (EDGE - a.depth) / (b.depth - a.depth)));
                            corners.len() as u32 - 1
                        });
                        length += 1;
                    }
                }
                for last in 2..length {
                    triangles.extend([part[0], part[last - 1], part[last]]);
                }
            }
        }
        triangles
    }
}

/// Gives the corners the normals of the film's own surface.
fn bend_normals(corners: &mut [Corner], triangles: &[u32]) {
    let mut sums = vec![Vec3::ZERO; corners.len()];
    for triangle in triangles.chunks_exact(3) {
        let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|corner| corners[corner as usize].position);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|&corner| sums[corner as usize] += normal);
    }
    for (corner, sum) in corners.iter_mut().zip(sums) {
        corner.normal = sum.normalize_or(corner.normal);
    }
}

/// A layer of the film: its corners with a colour for each.
fn layer(corners: &[Corner], triangles: &[u32], color: impl Fn(&Corner) -> Vec3) -> Mesh {
    let colors: Vec<[f32; 4]> = corners.iter().map(|corner| color(corner).extend(1.0).to_array()).collect();
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners.iter().map(|c| c.position).collect::<Vec<_>>())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, corners.iter().map(|c| c.normal).collect::<Vec<_>>())
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
        .with_inserted_indices(Indices::U32(triangles.to_vec()))
}

/// Materials of the two layers. The filter is drawn first.
fn materials() -> [StandardMaterial; 2] {
    let filter = StandardMaterial { unlit: true, alpha_mode: AlphaMode::Multiply, depth_bias: -0.001, ..default() };
    let sheen = StandardMaterial {
        alpha_mode: AlphaMode::Add,
        perceptual_roughness: 0.12,
        reflectance: 0.42,
        depth_bias: 0.001,
        ..default()
    };
    [filter, sheen]
}

/// Draws the film.
pub fn show_film(
    mut commands: Commands,
    blood: (Option<Res<Film>>, Option<Res<Surface>>),
    mut meshes: ResMut<Assets<Mesh>>,
    looks: Option<ResMut<Assets<StandardMaterial>>>,
    mut picture: Local<FilmPicture>,
) {
    let ((Some(film), Some(surface)), Some(mut looks)) = (blood, looks) else { return };
    let (corners, triangles) = picture.draw(&film, &surface);
    // A mesh without triangles can't be drawn.
    if triangles.is_empty() {
        return;
    }
    let [filter, sheen] = [Corner::passing, Corner::scattering].map(|color| layer(&corners, &triangles, color));
    match &picture.layers {
        Some(handles) => {
            for (handle, mesh) in handles.iter().zip([filter, sheen]) {
                if let Some(mut drawn) = meshes.get_mut(handle.id()) {
                    *drawn = mesh;
                }
            }
        }
        None => {
            let handles = [filter, sheen].map(|mesh| meshes.add(mesh));
            for (handle, look) in handles.iter().zip(materials()) {
                let look = MeshMaterial3d(looks.add(look));
                commands.spawn((Mesh3d(handle.clone()), look, NotShadowCaster, NoFrustumCulling));
            }
            picture.layers = Some(handles);
        }
    }
}
