//! Drops: a small particle emitter on the CPU, which reads the loss of each open end.
//!
//! A drop is an entity; all share one mesh and one material, so that they are drawn as instances. They leave an end
//! with the velocity of its blood, stretched along their path: arteries spurt with the pulse in jets that break up, and
//! slow blood wells up from the wound. A drop that lands joins the [`Film`]. No blood is added, and only drops that
//! miss the organ are lost: if drops are scarce, they are larger.
//!
//! Particles on the GPU can use the same data: for each [`OpenEnd`] entity the rate is `flow`, the speed `velocity`,
//! and position and direction are those of its `GlobalTransform`. Write these into the effect's spawner and properties
//! once a frame.

use super::{
    film::{Film, show_film},
    surface::Surface,
};
use bevy::{light::NotShadowCaster, prelude::*};
use bevy_vessels::{
    plugin::{OpenEnd, Perfusion, VesselSystems},
    synthesis::units::Volume,
};

/// Radius of a drop as a share of the vessel's, and its limits in metres.
const DROP_SHARE: f32 = 0.8;
const SMALLEST: f32 = 0.000_2;
const LARGEST: f32 = 0.000_4;
/// Most drops in the air.
const MOST_DROPS: usize = 5000;
/// Least speed of a jet, in m/s.
const JET: f64 = 0.35;
/// Height at which drops that miss the organ end, in world units.
const FLOOR: f32 = -0.75;
/// Seconds in which a drop clears the rim of its own wound.
const CLEAR: f32 = 0.02;
/// Seconds in which a jet breaks up into drops, and the largest distance between connected drops until then, in metres.
const BREAKS_UP: f32 = 0.05;
const APART: f32 = 0.005;
/// Exposure of the eye or a camera, in seconds: fast drops are streaks.
const EXPOSURE: f32 = 0.001;

/// Open ends drip, drops fall, blood runs over the organ.
pub struct BloodPlugin;

impl Plugin for BloodPlugin {
    fn build(&self, app: &mut App) {
        let systems = (lay_film.run_if(resource_added::<Surface>), bleed, fall, run, show_film);
        app.add_systems(Update, systems.chain().after(VesselSystems::Publish));
    }
}

/// A drop on its way.
#[derive(Component)]
struct Drop {
    velocity: Vec3,
    volume: Volume,
    /// Radius of the final ball, in world units.
    radius: f32,
    /// Half of the distance to the next drop of the jet, in world units.
    drawn_out: f32,
    age: f32,
}

/// Loss of an end that is not a drop yet, and the number of its drops.
#[derive(Component, Default)]
struct Dripping {
    lost: Volume,
    drops: u32,
}

/// The mesh and material of drops.
#[derive(Clone)]
struct Look {
    mesh: Handle<Mesh>,
    material: Handle<StandardMaterial>,
}

/// Metres of a world unit, so that drops have true speed and size relative to the organ.
fn metres(organs: &Query<(&Perfusion, &Transform)>) -> f32 {
    let unit = |(organ, place): (&Perfusion, &Transform)| {
        organ.scale.unwrap_or(Perfusion::DEFAULT_SCALE).metres() as f32 / place.scale.max_element()
    };
    organs.iter().next().map_or(1.0, unit)
}

/// Volume of a ball with a radius in metres.
fn ball(radius: f32) -> Volume {
    Volume::from_cubic_metres(f64::from(radius * radius * radius * 4.188_79))
}

fn ball_radius(volume: Volume) -> f32 {
    ops::cbrt(volume.cubic_metres() as f32 * 0.238_732_4)
}

/// A number from 0 to 1 that looks random.
fn scattered(index: u32, salt: u32) -> f32 {
    let mixed = (index ^ salt.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0x9e37_79b9);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d);
    (mixed ^ (mixed >> 13)) as f32 / u32::MAX as f32
}

/// Gives a new organ a film without blood.
fn lay_film(mut commands: Commands, organs: Query<(&Perfusion, &Transform)>, surface: Res<Surface>) {
    commands.insert_resource(Film::new(&surface, metres(&organs)));
}

/// Emits drops at open ends, by their loss; slow blood wells up beside them.
fn bleed(
    mut commands: Commands,
    time: Res<Time>,
    organs: Query<(&Perfusion, &Transform)>,
    mut ends: Query<(Entity, &OpenEnd, &GlobalTransform, Option<&mut Dripping>)>,
    drops: Query<(), With<Drop>>,
    blood: (Option<Res<Surface>>, Option<ResMut<Film>>),
    assets: (ResMut<Assets<Mesh>>, Option<ResMut<Assets<StandardMaterial>>>),
    mut look: Local<Option<Look>>,
) {
    let ((Some(surface), Some(mut film)), (mut meshes, Some(mut materials))) = (blood, assets) else { return };
    let look = look.get_or_insert_with(|| Look {
        mesh: meshes.add(Sphere::new(1.0).mesh().uv(10, 7)),
        material: materials.add(StandardMaterial {
            base_color: Color::linear_rgb(0.15, 0.002, 0.004),
            perceptual_roughness: 0.3,
            reflectance: 0.15,
            ..default()
        }),
    });
    let (unit, mut room) = (metres(&organs), MOST_DROPS.saturating_sub(drops.iter().count()));
    for (entity, end, place, dripping) in &mut ends {
        let Some(mut dripping) = dripping else {
            commands.entity(entity).insert(Dripping::default());
            continue;
        };
        let pending = Volume::from_ml(end.lost.ml() - dripping.lost.ml());
        let Some(near) = surface.nearest_at_rest(place.translation()) else { continue };
        if end.velocity < JET {
            film.add(&near, pending);
            dripping.lost = end.lost;
            continue;
        }
        let width = DROP_SHARE * end.radius * place.scale().max_element() * unit;
        let drop = ball(width.clamp(SMALLEST, LARGEST));
        let wanted = (pending.ml() / drop.ml()) as usize;
        let count = wanted.min(room);
        room -= count;
        let volume = Volume::from_ml(drop.ml() * wanted as f64 / count.max(1) as f64);
        let normal = surface.at_rest().triangle_normal(near.triangle);
        for number in 0..count {
            dripping.drops += 1;
            dripping.lost = Volume::from_ml(dripping.lost.ml() + volume.ml());
            let velocity = leave(end, place, normal, dripping.drops) / unit;
            // They leave one after the other, throughout the frame.
            let interval = time.delta_secs() / count as f32;
            let age = interval * (number as f32 + scattered(dripping.drops, 7));
            let drawn_out = 0.5 * (velocity.length() * interval).min(APART / unit);
            let drop = Drop { velocity, volume, radius: ball_radius(volume) / unit, drawn_out, age };
            let pose = drop.pose(place.translation() + velocity * age);
            let look = (Mesh3d(look.mesh.clone()), MeshMaterial3d(look.material.clone()));
            commands.spawn((drop, look, pose, NotShadowCaster));
        }
    }
}

/// Velocity of a drop at an end, in metres a second: out of the lumen, and up, away from the tissue below. A jet
/// wavers, and its drops scatter a little.
fn leave(end: &OpenEnd, place: &GlobalTransform, up: Vec3, drop: u32) -> Vec3 {
    let stray = Vec3::from_array([1, 2, 3].map(|salt| scattered(drop, salt) - 0.5));
    let waver =
        Vec3::from_array([0.043, 0.061, 0.029].map(|pace| ops::sin(pace * drop as f32 + end.place.node.0 as f32)));
    let direction = (*place.forward() + 0.75 * up + 0.05 * stray + 0.06 * waver).normalize_or(up);
    direction * end.velocity as f32 * (0.95 + 0.1 * scattered(drop, 5))
}

impl Drop {
    /// Stretched along its path, by its speed and while the jet is connected, and thinned to keep its volume.
    fn pose(&self, at: Vec3) -> Transform {
        let jet = self.drawn_out * ops::exp(-self.age * self.age / (BREAKS_UP * BREAKS_UP));
        let half = self.radius + jet.max(0.5 * EXPOSURE * self.velocity.length());
        let width = self.radius * (self.radius / half).sqrt();
        let along = Dir3::new(self.velocity).unwrap_or(Dir3::NEG_Y);
        Transform::from_translation(at)
            .looking_to(along, along.any_orthonormal_vector())
            .with_scale(Vec3::new(width, width, half))
    }
}

/// Lets drops fall, and join the film where they land.
fn fall(
    mut commands: Commands,
    time: Res<Time>,
    organs: Query<(&Perfusion, &Transform)>,
    mut drops: Query<(Entity, &mut Drop, &mut Transform), Without<Perfusion>>,
    blood: (Option<Res<Surface>>, Option<ResMut<Film>>),
) {
    let (Some(surface), Some(mut film)) = blood else { return };
    let (seconds, unit) = (time.delta_secs(), metres(&organs));
    if seconds == 0.0 {
        return;
    }
    for (entity, mut drop, mut place) in &mut drops {
        drop.velocity.y -= 9.81 / unit * seconds;
        drop.age += seconds;
        let (from, to) = (place.translation, place.translation + drop.velocity * seconds);
        let touched = if drop.age > CLEAR { surface.touch(from, to) } else { None };
        if let Some((at, _)) = touched {
            film.add(&at, drop.volume);
            commands.entity(entity).despawn();
        } else if to.y < FLOOR {
            commands.entity(entity).despawn();
        } else {
            *place = drop.pose(to);
        }
    }
}

/// Lets the film flow, and drip where it hangs.
fn run(
    mut commands: Commands,
    time: Res<Time>,
    blood: (Option<Res<Surface>>, Option<ResMut<Film>>),
    organs: Query<(&Perfusion, &Transform)>,
    looks: Query<(&Mesh3d, &MeshMaterial3d<StandardMaterial>), With<Drop>>,
) {
    let (Some(surface), Some(mut film)) = blood else { return };
    let unit = metres(&organs);
    let look = looks.iter().next().map(|(mesh, material)| (mesh.clone(), material.clone()));
    film.flow(time.delta_secs(), |at, normal, volume| {
        let drop = Drop { velocity: Vec3::ZERO, volume, radius: ball_radius(volume) / unit, drawn_out: 0.0, age: 0.0 };
        let pose = drop.pose(surface.breathed(at) + normal * drop.radius);
        let mut spawned = commands.spawn((drop, pose, NotShadowCaster));
        look.clone().map(|look| spawned.insert(look));
    });
}
