//! Jets: the connected blood before a cut artery, which narrows between its drops until it breaks up.
//!
//! A jet is one tube through the drops that left an end last, in the order in which they left. It bulges at the drops
//! and thins between them, as the surface tension of a liquid thread makes it, until only drops are left.

use super::blood::{Drop, Look};
use bevy::{
    asset::RenderAssetUsages,
    camera::visibility::NoFrustumCulling,
    light::NotShadowCaster,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
};
use std::f32::consts::TAU;

/// Seconds in which a jet breaks up.
pub const BREAKS_UP: f32 = 0.035;
/// Sides of the tube, and rings from a drop to the next.
const SIDES: u32 = 10;
const RINGS: u32 = 8;

/// A place on a jet.
#[derive(Clone, Copy)]
struct Knot {
    position: Vec3,
    age: f32,
    /// Of the undisturbed jet, in world units.
    radius: f32,
}

/// Depth of the waves on a jet of an age: 0 at the end of the vessel, 1 where the jet parts.
pub fn parting(age: f32) -> f32 {
    let share = (age / BREAKS_UP).clamp(0.0, 1.0);
    share * share
}

/// Draws all jets as one mesh.
pub fn show_jets(
    mut commands: Commands,
    drops: Query<(&Drop, &Transform)>,
    look: Option<Res<Look>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut drawn: Local<Option<(Entity, Handle<Mesh>)>>,
) {
    let Some(look) = look else { return };
    let mut young: Vec<_> = drops.iter().filter(|(drop, _)| drop.jet.is_some() && drop.age < BREAKS_UP).collect();
    young.sort_by_key(|(drop, _)| drop.jet);
    let mut tube = Tube::default();
    for pair in young.windows(2) {
        let [Some((end, number)), Some(next)] = [pair[0].0.jet, pair[1].0.jet] else { continue };
        if next == (end, number + 1) {
            let knot = |(drop, place): (&Drop, &Transform)| Knot {
                position: place.translation,
                age: drop.age,
                radius: drop.thread,
            };
            tube.connect(knot(pair[0]), knot(pair[1]));
        }
    }
    match &*drawn {
        None if tube.indices.is_empty() => {}
        None => {
            let mesh = meshes.add(tube.mesh());
            let shown =
                (Mesh3d(mesh.clone()), MeshMaterial3d(look.material.clone()), NotShadowCaster, NoFrustumCulling);
            *drawn = Some((commands.spawn(shown).id(), mesh));
        }
        Some((entity, mesh)) => {
            let shows = !tube.indices.is_empty();
            commands.entity(*entity).insert(if shows { Visibility::Inherited } else { Visibility::Hidden });
            // A mesh without triangles can't be drawn.
            if let (true, Some(mut mesh)) = (shows, meshes.get_mut(mesh.id())) {
                *mesh = tube.mesh();
            }
        }
    }
}

#[derive(Default)]
struct Tube {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
}

impl Tube {
    /// The stretch between two drops.
    fn connect(&mut self, a: Knot, b: Knot) {
        let Ok(along) = Dir3::new(b.position - a.position) else { return };
        let (across, up) = along.any_orthonormal_pair();
        let first = self.positions.len() as u32;
        for ring in 0..=RINGS {
            let share = ring as f32 / RINGS as f32;
            let wave = ops::cos(TAU * share);
            let depth = parting(a.age + share * (b.age - a.age));
            // A bulge takes in what the neck loses, over a longer stretch.
            let swelling = if wave > 0.0 { 0.45 * wave } else { wave };
            let radius = (a.radius + share * (b.radius - a.radius)) * (1.0 + depth * swelling).max(0.0);
            let center = a.position.lerp(b.position, share);
            for side in 0..SIDES {
                let (sin, cos) = ops::sin_cos(TAU * side as f32 / SIDES as f32);
                let normal = across * cos + up * sin;
                self.positions.push(center + radius * normal);
                self.normals.push(normal);
            }
        }
        for ring in 0..RINGS {
            for side in 0..SIDES {
                let next = (side + 1) % SIDES;
                let corner = |ring, side| first + ring * SIDES + side;
                let [a, b] = [corner(ring, side), corner(ring, next)];
                let [c, d] = [corner(ring + 1, side), corner(ring + 1, next)];
                self.indices.extend([a, b, c, b, d, c]);
            }
        }
    }

    fn mesh(self) -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, self.positions)
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals)
            .with_inserted_indices(Indices::U32(self.indices))
    }
}
