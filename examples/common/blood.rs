//! Drops: a small particle emitter on the CPU, which reads the loss of each open end.
//!
//! A drop is an entity; all share one mesh and one material, so that they are drawn as instances. They leave an end
//! with the velocity of its blood: arteries spurt with the pulse in [jets](super::jets) that break up into drops of
//! unequal size, and slow blood wells up from the wound. A drop that lands joins the [`Film`]. No blood is added, and
//! only drops that miss the organ are lost: if drops are scarce, they are larger.
//!
//! Particles on the GPU can use the same data: for each [`OpenEnd`] entity the rate is `flow`, the speed `velocity`,
//! and position and direction are those of its `GlobalTransform`. Write these into the effect's spawner and properties
//! once a frame.

use super::{
    film::Film,
    film_picture::show_film,
    jets::{parting, show_jets},
    surface::Surface,
};
use bevy::{camera::Hdr, light::NotShadowCaster, prelude::*};
use bevy_vessels::{
    plugin::{OpenEnd, Perfusion, VesselSystems},
    synthesis::units::Volume,
};

/// Radius of a jet's mean drop, relative to the jet: that of a thread of liquid which breaks up by its surface tension.
/// Its limits are in metres.
const DROP_SHARE: f32 = 1.6;
const SMALLEST: f32 = 0.000_12;
const LARGEST: f32 = 0.000_7;
/// Most drops in the air.
const MOST_DROPS: usize = 5000;
/// Least speed of a jet, in m/s.
const JET: f64 = 0.35;
/// Height at which drops that miss the organ end, in world units.
const FLOOR: f32 = -0.75;
/// Seconds in which a drop clears the rim of its own wound.
const CLEAR: f32 = 0.02;
/// Exposure of the eye or a camera, in seconds: fast drops are streaks.
const EXPOSURE: f32 = 0.000_7;

/// Open ends drip, drops fall, blood runs over the organ.
pub struct BloodPlugin;

impl Plugin for BloodPlugin {
    fn build(&self, app: &mut App) {
        let systems = (lay_film.run_if(resource_added::<Surface>), bleed, fall, run, show_film, show_jets);
        app.add_systems(Startup, mix_blood)
            .add_systems(Update, (systems.chain().after(VesselSystems::Publish), filter_light));
    }
}

/// A drop on its way.
#[derive(Component)]
pub struct Drop {
    velocity: Vec3,
    volume: Volume,
    /// Radius of the final ball, in world units.
    radius: f32,
    /// Seconds since it left.
    pub age: f32,
    /// The end that it spurted from, and its number among the drops of that end.
    pub jet: Option<(Entity, u32)>,
    /// Radius of the jet, in world units.
    pub thread: f32,
}

/// Loss of an end that is not a drop yet, and the number of its drops.
#[derive(Component, Default)]
struct Dripping {
    lost: Volume,
    drops: u32,
}

/// The mesh of drops, and the material of blood that is thick.
#[derive(Resource)]
pub struct Look {
    mesh: Handle<Mesh>,
    pub material: Handle<StandardMaterial>,
}

impl Look {
    /// What a drop is drawn with.
    fn of_drop(&self) -> impl Bundle + use<> {
        (Mesh3d(self.mesh.clone()), MeshMaterial3d(self.material.clone()), NotShadowCaster)
    }
}

fn mix_blood(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let Some(mut materials) = materials else { return };
    let blood = StandardMaterial {
        base_color: Color::linear_rgb(0.11, 0.003, 0.004),
        perceptual_roughness: 0.14,
        reflectance: 0.42,
        ..default()
    };
    let mesh = meshes.add(Sphere::new(1.0).mesh().uv(12, 8));
    commands.insert_resource(Look { mesh, material: materials.add(blood) });
}

/// Cameras keep the light of the scene until the film has filtered it.
fn filter_light(mut commands: Commands, cameras: Query<Entity, (With<Camera3d>, Without<Hdr>)>) {
    cameras.iter().for_each(|camera| {
        commands.entity(camera).insert(Hdr);
    });
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
    look: Option<Res<Look>>,
) {
    let ((Some(surface), Some(mut film)), Some(look)) = (blood, look) else { return };
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
        let thread = (end.flow.cubic_metres_per_second() / (std::f64::consts::PI * end.velocity)).sqrt() as f32;
        let mean = ball((DROP_SHARE * thread).clamp(SMALLEST, LARGEST));
        let wanted = (pending.ml() / mean.ml()) as usize;
        let count = wanted.min(room);
        room -= count;
        let mean = Volume::from_ml(mean.ml() * wanted as f64 / count.max(1) as f64);
        let normal = surface.at_rest().triangle_normal(near.triangle);
        // They leave one after the other, throughout the frame.
        let interval = time.delta_secs() / count as f32;
        for number in 0..count {
            dripping.drops += 1;
            let volume = Volume::from_ml(mean.ml() * unequal(dripping.drops));
            dripping.lost = Volume::from_ml(dripping.lost.ml() + volume.ml());
            let velocity = leave(end, place, normal, dripping.drops) / unit;
            let age = interval * ((count - 1 - number) as f32 + 0.5 + 0.7 * (scattered(dripping.drops, 7) - 0.5));
            let jet = Some((entity, dripping.drops));
            let drop = Drop { velocity, volume, radius: ball_radius(volume) / unit, age, jet, thread: thread / unit };
            let pose = drop.pose(place.translation() + velocity * age);
            commands.spawn((drop, look.of_drop(), pose));
        }
    }
}

/// The volume of a drop relative to the mean of all: many are small.
fn unequal(drop: u32) -> f64 {
    let share = f64::from(scattered(drop, 11));
    0.05 + 0.95 * 3.0 * share * share
}

/// Velocity of a drop at an end, in metres a second: out of the lumen, and up, away from the tissue below. A jet
/// wavers, and its drops scatter a little.
fn leave(end: &OpenEnd, place: &GlobalTransform, up: Vec3, drop: u32) -> Vec3 {
    let stray = Vec3::from_array([1, 2, 3].map(|salt| scattered(drop, salt) - 0.5));
    let waver =
        Vec3::from_array([0.043, 0.061, 0.029].map(|pace| ops::sin(pace * drop as f32 + end.place.node.0 as f32)));
    let direction = (*place.forward() + 0.75 * up + 0.012 * stray + 0.05 * waver).normalize_or(up);
    direction * end.velocity as f32 * (0.985 + 0.03 * scattered(drop, 5))
}

impl Drop {
    /// Drawn out along its path by the exposure, and thinned to keep its volume. It swells where its jet parts.
    fn pose(&self, at: Vec3) -> Transform {
        let half = self.radius + 0.5 * EXPOSURE * self.velocity.length();
        let width = self.radius * (self.radius / half).sqrt();
        let swollen = if self.jet.is_some() { parting(self.age) } else { 1.0 };
        let along = Dir3::new(self.velocity).unwrap_or(Dir3::NEG_Y);
        Transform::from_translation(at)
            .looking_to(along, along.any_orthonormal_vector())
            .with_scale(Vec3::new(width, width, half) * swollen.max(0.05))
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
    look: Option<Res<Look>>,
) {
    let (Some(surface), Some(mut film)) = blood else { return };
    let unit = metres(&organs);
    film.flow(time.delta_secs(), |at, normal, volume| {
        let radius = ball_radius(volume) / unit;
        let drop = Drop { velocity: Vec3::ZERO, volume, radius, age: 0.0, jet: None, thread: 0.0 };
        let pose = drop.pose(surface.breathed(at) + normal * drop.radius);
        let mut spawned = commands.spawn((drop, pose));
        look.as_ref().map(|look| spawned.insert(look.of_drop()));
    });
}
