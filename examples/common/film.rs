//! Blood on the organ: a film that wells up, runs down and pools, and moves with the breathing organ.
//!
//! The film is a depth on each cell of the [`Skin`]. A thin layer sticks; blood above it runs down the slope as fast as
//! a thin film does, and its depth spreads it. At the edge it rises before it wets dry cells. None is lost: blood that
//! hangs from the underside drips off. It is drawn as one mesh over the wet cells, clear where it is thin and dark
//! where it is deep.

use super::{skin::Skin, surface::Surface};
use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::NoFrustumCulling,
    light::NotShadowCaster,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use bevy_vessels::synthesis::{mesh::SurfacePoint, units::Volume};

/// Longest step of the flow, in seconds.
const STEP: f32 = 0.008;
/// Depth that sticks to tissue, depth at the edge before it wets dry cells, and depth at which drops fall from the
/// underside, in metres.
const STICKS: f32 = 0.000_12;
const STANDS: f32 = 0.000_55;
const DRIPS: f32 = 0.0022;
/// Share of the blood around a drop that falls with it.
const GATHERED: f32 = 0.7;
/// Speed of a thin film on a slope, in metres a second per square metre of squared depth: weight over three times the
/// viscosity; and its largest speed.
const MOBILITY: f32 = 1060.0 * 9.81 / (3.0 * 0.0035);
const FASTEST: f32 = 0.09;
/// Spreading of a film by its depth, relative to its weight: surface tension, and tissue that it wets.
const SPREAD: f32 = 1.5;
/// Depths below which the film is clear and above which it is opaque, and the depth at two thirds of the way from the
/// light to the dark colour, in metres.
const CLEAR: f32 = 0.000_03;
const OPAQUE: f32 = 0.000_15;
const DARK: f32 = 0.0005;
const LIGHT_COLOR: Vec3 = Vec3::new(0.20, 0.003, 0.005);
const DARK_COLOR: Vec3 = Vec3::new(0.055, 0.0006, 0.0014);
/// Height of the film's base above the surface, in world units.
const LIFT: f32 = 0.0006;
/// Factor by which the film is drawn deeper, so that its edge catches the light.
const RELIEF: f32 = 1.6;

/// Rounds of smoothing before the film is drawn: fewer leave jags where a deep pool spills over a ledge.
const SMOOTHED: u32 = 8;

/// The number of a cell outside the mesh.
const NONE: u32 = u32::MAX;

/// The film on the organ.
#[derive(Resource)]
pub struct Film {
    skin: Skin,
    /// Metres of a world unit.
    unit: f32,
    /// Depth on each cell, in metres, and its change in a step.
    depths: Vec<f32>,
    changes: Vec<f32>,
    /// Cells that have ever been wet.
    wet: Vec<u32>,
    is_wet: Vec<bool>,
    /// Numbers of cells in the mesh, while the mesh is made.
    numbers: Vec<u32>,
    /// Neighbours of a cell, while it flows.
    around: Vec<u32>,
    mesh: Option<Handle<Mesh>>,
}

impl Film {
    /// No blood yet.
    pub fn new(surface: &Surface, unit: f32) -> Self {
        let skin = Skin::new(surface.at_rest());
        let cells = skin.positions.len();
        Self {
            skin,
            unit,
            depths: vec![0.0; cells],
            changes: vec![0.0; cells],
            wet: Vec::new(),
            is_wet: vec![false; cells],
            numbers: vec![NONE; cells],
            around: Vec::new(),
            mesh: None,
        }
    }

    /// Adds blood at a place on the surface at rest: half of it to the nearest cell, half to those around it.
    pub fn add(&mut self, place: &SurfacePoint, volume: Volume) {
        let cell = self.skin.nearest(place);
        let around: Vec<u32> = self.skin.neighbours(cell).collect();
        let cubic_metres = volume.cubic_metres() as f32;
        let share = 0.5 / around.len().max(1) as f32;
        let here = if around.is_empty() { 1.0 } else { 0.5 };
        for (cell, share) in around.iter().map(|&cell| (cell, share)).chain([(cell, here)]) {
            self.depths[cell as usize] += share * cubic_metres / self.area(cell);
            self.moisten(cell);
        }
    }

    /// In square metres; cells of triangles without area have a little.
    fn area(&self, cell: u32) -> f32 {
        (self.skin.areas[cell as usize] * self.unit * self.unit).max(1.0e-8)
    }

    fn moisten(&mut self, cell: u32) {
        if !std::mem::replace(&mut self.is_wet[cell as usize], true) {
            self.wet.push(cell);
        }
    }

    /// Lets the film flow. Calls `drip` for blood that falls off, with the point at rest and the normal.
    pub fn flow(&mut self, seconds: f32, mut drip: impl FnMut(Vec3, Vec3, Volume)) {
        let steps = (seconds / STEP).ceil();
        for _ in 0..steps as u32 {
            for index in 0..self.wet.len() {
                self.flow_from(self.wet[index], seconds / steps);
            }
            for index in 0..self.wet.len() {
                let cell = self.wet[index] as usize;
                self.depths[cell] += std::mem::take(&mut self.changes[cell]);
            }
        }
        for index in 0..self.wet.len() {
            let cell = self.wet[index];
            if self.depths[cell as usize] > DRIPS && self.skin.normals[cell as usize].y < -0.25 {
                let volume = self.gather(cell);
                drip(self.skin.positions[cell as usize], self.skin.normals[cell as usize], volume);
            }
        }
    }

    /// Takes the blood of a drop: all that hangs from a cell, and most from the cells beside it.
    fn gather(&mut self, cell: u32) -> Volume {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(self.skin.neighbours(cell));
        let mut cubic_metres = 0.0;
        for (share, from) in std::iter::once((1.0, cell)).chain(around.iter().map(|&beside| (GATHERED, beside))) {
            let falls = share * (self.depths[from as usize] - 2.0 * STICKS).max(0.0);
            self.depths[from as usize] -= falls;
            cubic_metres += falls * self.area(from);
        }
        self.around = around;
        Volume::from_cubic_metres(f64::from(cubic_metres))
    }

    /// Lets the blood on a cell run down, and spread to neighbours with less.
    fn flow_from(&mut self, cell: u32, seconds: f32) {
        let free = self.depths[cell as usize] - STICKS;
        if free <= 0.0 {
            return;
        }
        let mobility = MOBILITY * free * free;
        let downhill = self.skin.downhill(cell);
        let (volume, area) = (free * self.area(cell), self.area(cell));
        if let Some(way) = self.skin.way(cell, downhill) {
            let speed = (mobility * downhill.length()).min(FASTEST);
            let leaves = volume * (speed * seconds / (way.length * self.unit).max(1.0e-5)).min(0.45);
            for (to, share) in way.shares {
                self.pass(cell, to, leaves * share);
            }
        }
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(self.skin.neighbours(cell));
        for &to in &around {
            let length = (self.skin.distance(cell, to) * self.unit).max(1.0e-5);
            let lower = self.depths[cell as usize] - self.depths[to as usize];
            if lower > 0.0 {
                let speed = mobility * SPREAD * lower / length;
                // Never so much that it would be deeper there than here.
                let most = 0.06 * lower * area.min(self.area(to));
                self.pass(cell, to, (volume * speed * seconds / length).min(most));
            }
        }
        self.around = around;
    }

    /// Passes blood on at the end of the step: to a dry cell only if it is deep enough.
    fn pass(&mut self, from: u32, to: u32, volume: f32) {
        if self.depths[to as usize] > 0.5 * STICKS || self.depths[from as usize] > STANDS {
            self.changes[from as usize] -= volume / self.area(from);
            self.changes[to as usize] += volume / self.area(to);
            self.moisten(to);
        }
    }

    /// The present mesh of the film; `None` if nothing is visible, since a mesh without triangles can't be drawn.
    fn draw(&mut self, surface: &Surface) -> Option<Mesh> {
        // Two rings around the wet cells, over which the film fades.
        let mut cells: Vec<u32> =
            self.wet.iter().copied().filter(|&cell| self.depths[cell as usize] > 1.0e-6).collect();
        if cells.is_empty() {
            return None;
        }
        cells.iter().enumerate().for_each(|(number, &cell)| self.numbers[cell as usize] = number as u32);
        let mut inner = self.surround(&mut cells, 0);
        inner = self.surround(&mut cells, inner);
        let mut indices = Vec::new();
        for (number, &cell) in cells[..inner].iter().enumerate() {
            for triangle in self.skin.triangles_around(cell) {
                let corners = self.skin.triangles[triangle as usize].map(|corner| self.numbers[corner as usize]);
                // Each triangle once, by the first of its corners.
                if corners.iter().all(|&corner| corner >= number as u32) {
                    indices.extend(corners);
                }
            }
        }
        let depths = self.smooth_depths(&cells, inner);
        cells.iter().for_each(|&cell| self.numbers[cell as usize] = NONE);
        let top = |(&cell, depth): (&u32, &f32)| {
            let normal = self.skin.normals[cell as usize];
            surface.breathed(self.skin.positions[cell as usize]) + normal * (LIFT + RELIEF * depth / self.unit)
        };
        let positions: Vec<Vec3> = cells.iter().zip(&depths).map(top).collect();
        let normals = self.normals(&cells, &positions, &indices);
        let colors: Vec<[f32; 4]> = depths.iter().copied().map(color).collect();
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
            .with_inserted_indices(Indices::U32(indices));
        Some(mesh)
    }

    /// Adds the missing neighbours of all cells from a number on, and returns the previous number of cells.
    fn surround(&mut self, cells: &mut Vec<u32>, from: usize) -> usize {
        let before = cells.len();
        for index in from..before {
            for neighbour in self.skin.neighbours(cells[index]) {
                if self.numbers[neighbour as usize] == NONE {
                    self.numbers[neighbour as usize] = cells.len() as u32;
                    cells.push(neighbour);
                }
            }
        }
        before
    }

    /// Depths to be drawn: means over neighbours, which hide the cells. Those on the rim are 0.
    fn smooth_depths(&self, cells: &[u32], inner: usize) -> Vec<f32> {
        let mut depths: Vec<f32> = cells.iter().map(|&cell| self.depths[cell as usize]).collect();
        for _ in 0..SMOOTHED {
            let before = depths.clone();
            for (depth, &cell) in depths[..inner].iter_mut().zip(cells) {
                let around = self.skin.neighbours(cell).map(|other| before[self.numbers[other as usize] as usize]);
                let (sum, count) = around.fold((0.0, 0.0), |(sum, count), depth| (sum + depth, count + 1.0_f32));
                *depth = 0.4 * *depth + 0.6 * sum / count.max(1.0);
            }
        }
        depths
    }

    /// Normals of the film's own surface.
    fn normals(&self, cells: &[u32], positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; cells.len()];
        for corners in indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]].map(|corner| positions[corner as usize]);
            let normal = (b - a).cross(c - a);
            corners.iter().for_each(|&corner| sums[corner as usize] += normal);
        }
        let own = |(&cell, sum): (&u32, &Vec3)| sum.normalize_or(self.skin.normals[cell as usize]);
        cells.iter().zip(&sums).map(own).collect()
    }
}

/// Linear colour of blood of a depth, with its opacity.
fn color(depth: f32) -> [f32; 4] {
    let share = ((depth - CLEAR) / (OPAQUE - CLEAR)).clamp(0.0, 1.0);
    let hidden = share * share * (3.0 - 2.0 * share);
    LIGHT_COLOR.lerp(DARK_COLOR, 1.0 - ops::exp(-depth / DARK)).extend(0.97 * hidden).to_array()
}

/// Draws the film.
pub fn show_film(
    mut commands: Commands,
    film: Option<ResMut<Film>>,
    surface: Option<Res<Surface>>,
    mut meshes: ResMut<Assets<Mesh>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let (Some(mut film), Some(surface), Some(mut materials)) = (film, surface, materials) else { return };
    let Some(mesh) = film.draw(&surface) else { return };
    match &film.mesh {
        Some(handle) => {
            if let Some(mut drawn) = meshes.get_mut(handle.id()) {
                *drawn = mesh;
            }
        }
        None => {
            let handle = meshes.add(mesh);
            let blood = StandardMaterial {
                alpha_mode: AlphaMode::Blend,
                perceptual_roughness: 0.16,
                reflectance: 0.45,
                ..default()
            };
            commands.spawn((
                Mesh3d(handle.clone()),
                MeshMaterial3d(materials.add(blood)),
                NotShadowCaster,
                NoFrustumCulling,
            ));
            film.mesh = Some(handle);
        }
    }
}
