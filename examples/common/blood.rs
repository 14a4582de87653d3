//! Drops and pools: a small particle emitter on the CPU, which reads what each open end loses.
//!
//! A drop is an entity; all share one mesh and one material, so that they are drawn as instances. They leave an end as
//! fast as its blood does: arteries spurt with the pulse, veins ooze. Where they land they are added to a pool. No blood
//! is invented or dropped: when drops are scarce they are larger.
//!
//! Particles on the GPU take the same hook: for each [`OpenEnd`] entity the rate is `flow`, the speed `velocity`, and place
//! and direction are those of its `GlobalTransform`. Write these into the effect's spawner and properties once a frame.

use super::instruments::Surface;
use bevy::{light::NotShadowCaster, prelude::*};
use bevy_vessels::{
    plugin::{OpenEnd, Perfusion, VesselSystems},
    synthesis::units::Volume,
};

/// Volume of a usual drop. Smaller than one that falls from a tap, since most come out of jets.
const DROP_ML: f64 = 0.006;
/// Most drops in the air, and most pools.
const MOST_DROPS: usize = 1500;
const MOST_POOLS: usize = 1200;
/// Height of blood that lies, in metres, and the widest pool's radius: on a curved organ it runs on from there.
const LYING: f32 = 0.0012;
const WIDEST_POOL: f32 = 0.006;
/// Where drops end that miss the organ. World units.
const FLOOR: f32 = -0.75;
/// Seconds in which a drop clears the rim of its own wound.
const CLEAR: f32 = 0.02;

/// Open ends drip, drops fall, pools spread.
pub struct BloodPlugin;

impl Plugin for BloodPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Pools>().add_systems(Update, (bleed, fall).chain().after(VesselSystems::Publish));
    }
}

/// A drop on its way.
#[derive(Component)]
struct Drop {
    velocity: Vec3,
    volume: Volume,
    age: f32,
}

/// What an end has lost that is no drop yet, and how many drops there were.
#[derive(Component, Default)]
struct Dripping {
    lost: Volume,
    drops: u32,
}

/// The pools there are.
#[derive(Resource, Default)]
struct Pools(Vec<Pool>);

struct Pool {
    entity: Entity,
    center: Vec3,
    volume: Volume,
}

/// What drops and pools are made of.
#[derive(Clone)]
struct Look {
    mesh: Handle<Mesh>,
    material: Handle<StandardMaterial>,
}

/// Metres of a world unit: drops are as fast and as large beside the organ as they would be.
fn metres(organs: &Query<(&Perfusion, &GlobalTransform)>) -> f32 {
    let unit =
        |(organ, place): (&Perfusion, &GlobalTransform)| organ.scale.metres() as f32 / place.scale().max_element();
    organs.iter().next().map_or(1.0, unit)
}

/// Radius of a ball of a volume, in metres.
fn ball_radius(volume: Volume) -> f32 {
    ops::cbrt(volume.cubic_metres() as f32 * 0.238_732_4)
}

/// A number from 0 to 1 that looks random: multiples of the golden ratio.
fn scattered(index: u32, salt: u32) -> f32 {
    (index.wrapping_mul(0x9e37_79b9) ^ salt.wrapping_mul(0x85eb_ca6b)) as f32 / u32::MAX as f32
}

/// Open ends let drops go, as many as they lose.
fn bleed(
    mut commands: Commands,
    organs: Query<(&Perfusion, &GlobalTransform)>,
    mut ends: Query<(Entity, &OpenEnd, &GlobalTransform, Option<&mut Dripping>)>,
    drops: Query<(), With<Drop>>,
    surface: Option<Res<Surface>>,
    assets: (ResMut<Assets<Mesh>>, Option<ResMut<Assets<StandardMaterial>>>),
    mut look: Local<Option<Look>>,
) {
    let (mut meshes, Some(mut materials)) = assets else { return };
    let look = look.get_or_insert_with(|| Look {
        mesh: meshes.add(Sphere::new(1.0).mesh().uv(12, 8)),
        material: materials.add(StandardMaterial {
            base_color: Color::srgb(0.42, 0.012, 0.015),
            perceptual_roughness: 0.12,
            reflectance: 0.55,
            ..default()
        }),
    });
    let (unit, mut room) = (metres(&organs), MOST_DROPS.saturating_sub(drops.iter().count()));
    for (entity, end, place, dripping) in &mut ends {
        let Some(mut dripping) = dripping else {
            commands.entity(entity).insert(Dripping::default());
            continue;
        };
        let pending = end.lost.ml() - dripping.lost.ml();
        let wanted = (pending / DROP_ML) as usize;
        let count = wanted.min(room);
        let volume = Volume::from_ml(pending / wanted.max(1) as f64 * wanted as f64 / count.max(1) as f64);
        for _ in 0..count {
            dripping.drops += 1;
            dripping.lost = Volume::from_ml(dripping.lost.ml() + volume.ml());
            let radius = ball_radius(volume) / unit;
            let velocity = leave(end, place, surface.as_deref(), dripping.drops) / unit;
            let from = place.translation() + velocity * (CLEAR * 0.2 * scattered(dripping.drops, 7));
            let pose = Transform::from_translation(from).with_scale(Vec3::splat(radius));
            let drop = Drop { velocity, volume, age: 0.0 };
            commands.spawn((
                drop,
                Mesh3d(look.mesh.clone()),
                MeshMaterial3d(look.material.clone()),
                pose,
                NotShadowCaster,
            ));
        }
        room -= count;
    }
}

/// How a drop leaves an end, in metres a second: out of the lumen, and up, away from the tissue beneath.
fn leave(end: &OpenEnd, place: &GlobalTransform, surface: Option<&Surface>, drop: u32) -> Vec3 {
    let up = surface.and_then(|surface| surface.nearest(place.translation())).map_or(Vec3::Y, |(_, normal)| normal);
    let spread = Vec3::from_array([1, 2, 3].map(|salt| scattered(drop, salt) - 0.5));
    let direction = (*place.forward() + 0.7 * up + 0.35 * spread).normalize_or(up);
    // in the mean over its section; the middle of a jet is twice as fast
    direction * end.velocity as f32 * (0.6 + 0.9 * scattered(drop, 5))
}

/// Drops fall, and are added to a pool where they land.
fn fall(
    mut commands: Commands,
    time: Res<Time>,
    organs: Query<(&Perfusion, &GlobalTransform)>,
    mut drops: Query<(Entity, &mut Drop, &mut Transform, &Mesh3d, &MeshMaterial3d<StandardMaterial>)>,
    surface: Option<Res<Surface>>,
    mut pools: ResMut<Pools>,
) {
    let (seconds, unit) = (time.delta_secs(), metres(&organs));
    if seconds == 0.0 {
        return;
    }
    for (entity, mut drop, mut place, mesh, material) in &mut drops {
        drop.velocity.y -= 9.81 / unit * seconds;
        drop.age += seconds;
        let (from, to) = (place.translation, place.translation + drop.velocity * seconds);
        let hit = surface.as_ref().and_then(|surface| surface.hit(from, to)).filter(|_| drop.age > CLEAR);
        let floor = (to.y < FLOOR).then(|| (Vec3::new(to.x, FLOOR, to.z), Vec3::Y));
        place.translation = to;
        let Some((at, normal)) = hit.or(floor) else { continue };
        let normal = if normal.dot(drop.velocity) > 0.0 { -normal } else { normal };
        let look = Look { mesh: mesh.0.clone(), material: material.0.clone() };
        pools.add(&mut commands, (at, normal, drop.volume), unit, &look);
        commands.entity(entity).despawn();
    }
}

impl Pools {
    /// Adds blood to the pool that it falls into, or begins one.
    fn add(&mut self, commands: &mut Commands, landed: (Vec3, Vec3, Volume), unit: f32, look: &Look) {
        let (at, normal, volume) = landed;
        let nearest = self.0.iter().enumerate().map(|(index, pool)| (pool.center.distance(at), index));
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
        let radius = |volume: Volume| (volume.cubic_metres() as f32 / (LYING * std::f32::consts::PI)).sqrt();
        let size = |volume: Volume| Vec3::new(radius(volume), LYING.min(radius(volume)), radius(volume)) / unit;
        let full = self.0.len() >= MOST_POOLS;
        let joins = |&(distance, index): &(f32, usize)| {
            let wide = radius(self.0[index].volume);
            full || (wide < WIDEST_POOL && distance * unit < wide)
        };
        match nearest.filter(joins) {
            Some((_, index)) => {
                let pool = &mut self.0[index];
                pool.volume = Volume::from_ml(pool.volume.ml() + volume.ml());
                let scale = size(pool.volume);
                commands.entity(pool.entity).entry::<Transform>().and_modify(move |mut pose| pose.scale = scale);
            }
            None => {
                let turn = Quat::from_rotation_arc(Vec3::Y, normal.normalize_or(Vec3::Y));
                let pose = Transform { translation: at, rotation: turn, scale: size(volume) };
                let drawn = (Mesh3d(look.mesh.clone()), MeshMaterial3d(look.material.clone()), pose, NotShadowCaster);
                let entity = commands.spawn(drawn).id();
                self.0.push(Pool { entity, center: at, volume });
            }
        }
    }
}
