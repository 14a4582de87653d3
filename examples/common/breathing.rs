//! An organ that breathes, and pales where it lacks blood: positions and colours of its vertices, written each frame.
//!
//! It stands for a soft body: whoever moves vertices in the mesh asset has the vessels follow, by
//! [`FollowsMesh`](bevy_vessels::plugin::FollowsMesh).

use crate::common::controls::Organ;
use bevy::{
    mesh::{Mesh, VertexAttributeValues},
    prelude::*,
};
use bevy_vessels::{
    plugin::{OrganSupply, VesselSystems},
    prelude::*,
};
use std::f32::consts::TAU;

/// How far the diaphragm pushes the top of an organ, as a share of its height, and how long a breath takes.
const DEPTH: f32 = 0.02;
const SECONDS: f32 = 4.0;
/// Colour that tissue without blood is multiplied by. Linear sRGB: less red than flesh, and greyer.
const PALE: [f32; 3] = [0.92, 1.25, 1.3];

/// Organs breathe once their vessels have grown.
pub struct BreathingPlugin;

impl Plugin for BreathingPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, (breathe, blanch).before(VesselSystems::Publish));
    }
}

/// The vertices of an organ as it was spawned.
#[derive(Component)]
struct Rest {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    /// Lowest and highest point.
    low: f32,
    high: f32,
}

impl Rest {
    fn new(mesh: &Mesh) -> Option<Self> {
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION)?.as_float3()?.to_vec();
        let colors = match mesh.attribute(Mesh::ATTRIBUTE_COLOR) {
            Some(VertexAttributeValues::Float32x4(colors)) => colors.clone(),
            _ => vec![[1.0; 4]; positions.len()],
        };
        let heights = positions.iter().map(|at| at[1]);
        let (low, high) = heights.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
        Some(Self { positions, colors, low, high })
    }

    /// A vertex when the chest is filled to a share: what is near the diaphragm goes down and to the front.
    fn filled(&self, [x, y, z]: [f32; 3], breath: f32) -> [f32; 3] {
        let height = (self.high - self.low).max(f32::MIN_POSITIVE);
        let share = ((y - self.low) / height).clamp(0.0, 1.0);
        let push = DEPTH * height * breath * share * share;
        [x, y - push, z + 0.6 * push]
    }
}

/// Moves the vertices of all organs.
fn breathe(
    mut commands: Commands,
    time: Res<Time>,
    organs: Query<(Entity, &Mesh3d, Option<&Rest>), With<Organ>>,
    growing: Query<&GrowthProgress>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut breathed: Local<f32>,
) {
    if growing.iter().any(|progress| !progress.is_finished()) || time.delta_secs() == 0.0 {
        return;
    }
    *breathed += time.delta_secs() / SECONDS;
    let breath = 0.5 - 0.5 * ops::cos(TAU * *breathed);
    for (organ, mesh, rest) in &organs {
        let Some(mut mesh) = meshes.get_mut(mesh.id()) else { continue };
        match rest {
            None => {
                if let Some(rest) = Rest::new(&mesh) {
                    commands.entity(organ).insert(rest);
                }
            }
            Some(rest) => {
                if let Some(VertexAttributeValues::Float32x3(now)) = mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) {
                    now.iter_mut().zip(&rest.positions).for_each(|(now, &at)| *now = rest.filled(at, breath));
                }
            }
        }
    }
}

/// Colours organs by what their tissue gets.
fn blanch(organs: Query<(&Mesh3d, &Rest, &OrganSupply), Changed<OrganSupply>>, mut meshes: ResMut<Assets<Mesh>>) {
    for (mesh, rest, supply) in organs.iter().filter(|(_, rest, supply)| supply.vertices.len() == rest.colors.len()) {
        let Some(mut mesh) = meshes.get_mut(mesh.id()) else { continue };
        let tint = |(&[r, g, b, a], &supply): (&[f32; 4], &f32)| {
            let pale = |color: f32, pale: f32| color * (1.0 + (pale - 1.0) * (1.0 - supply));
            [pale(r, PALE[0]), pale(g, PALE[1]), pale(b, PALE[2]), a]
        };
        let colors: Vec<[f32; 4]> = rest.colors.iter().zip(&supply.vertices).map(tint).collect();
        mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colors);
    }
}
