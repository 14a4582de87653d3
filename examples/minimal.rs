//! Arteries and veins grow over a sphere, while you watch: the ten lines of the README.

use bevy::prelude::*;
use bevy_vessels::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, VesselPlugin::default())).add_systems(Startup, setup).run();
}

fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    commands.spawn((Mesh3d(meshes.add(Sphere::new(1.0))), Vasculature::new(PresetName::Paper).with_seed(7)));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(1.0, 2.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
}
