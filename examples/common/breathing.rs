//! An organ that breathes, and pales where it lacks blood. Positions and colours of its vertices are written each
//! frame.
//!
//! It stands for a soft body: vessels follow the moved vertices of the mesh asset, by
//! [`FollowsMesh`](bevy_vessels::plugin::FollowsMesh).

use crate::{common::controls::Organ, surface::Surface};
use bevy::{
    mesh::{Mesh, VertexAttributeValues},
    prelude::*,
};
use bevy_vessels::{
    plugin::{OrganSupply, VesselSystems},
    prelude::*,
};
use std::f32::consts::TAU;

/// Duration of a breath.
const SECONDS: f32 = 4.0;
/// Factor for the colour of tissue without blood. Linear sRGB: less red than flesh, and greyer.
const PALE: [f32; 3] = [0.92, 1.25, 1.3];

/// Lets organs breathe once their vessels have grown.
pub struct BreathingPlugin;

impl Plugin for BreathingPlugin {
    fn build(&self, app: &mut App) {
        let systems = (breathe.run_if(resource_exists::<Surface>), blanch);
        app.add_systems(Update, systems.before(VesselSystems::Publish));
    }
}

/// The vertices of an organ as it was spawned.
#[derive(Component)]
struct Rest {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
}

impl Rest {
    fn new(mesh: &Mesh) -> Option<Self> {
        let positions = mesh.attribute(Mesh::ATTRIBUTE_POSITION)?.as_float3()?.to_vec();
        let colors = match mesh.attribute(Mesh::ATTRIBUTE_COLOR) {
            Some(VertexAttributeValues::Float32x4(colors)) => colors.clone(),
            _ => vec![[1.0; 4]; positions.len()],
        };
        Some(Self { positions, colors })
    }
}

/// Moves the vertices of all organs.
fn breathe(
    mut commands: Commands,
    time: Res<Time>,
    organs: Query<(Entity, &Mesh3d, &Transform, Option<&Rest>), With<Organ>>,
    growing: Query<&GrowthProgress>,
    mut surface: ResMut<Surface>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut breathed: Local<f32>,
) {
    if growing.iter().any(|progress| !progress.is_finished()) || time.delta_secs() == 0.0 {
        return;
    }
    *breathed += time.delta_secs() / SECONDS;
    surface.breath = 0.5 - 0.5 * ops::cos(TAU * *breathed);
    for (organ, mesh, place, rest) in &organs {
        let Some(mut mesh) = meshes.get_mut(mesh.id()) else { continue };
        match rest {
            None => {
                if let Some(rest) = Rest::new(&mesh) {
                    commands.entity(organ).insert(rest);
                }
            }
            Some(rest) => {
                let (to_world, to_local) = (place.compute_affine(), place.compute_affine().inverse());
                let moved = |at: Vec3| to_local.transform_point3(surface.breathed(to_world.transform_point3(at)));
                if let Some(VertexAttributeValues::Float32x3(now)) = mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) {
                    now.iter_mut().zip(&rest.positions).for_each(|(now, &at)| *now = moved(at.into()).to_array());
                }
            }
        }
    }
}

/// Colours organs by the supply of their tissue.
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
