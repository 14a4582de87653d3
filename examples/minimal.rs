//! Arteries and veins grow over a sphere, while you watch: the first program of the README.

use bevy::prelude::*;
use bevy_vessels::prelude::*;

fn main() -> AppExit {
    // Bevy panics where no window can be opened.
    if cfg!(target_os = "linux") && ["DISPLAY", "WAYLAND_DISPLAY"].iter().all(|name| std::env::var_os(name).is_none()) {
        eprintln!("no display: run it on a desktop, or with xvfb-run (apt install xvfb mesa-vulkan-drivers)");
        return AppExit::error();
    }
    App::new().add_plugins((DefaultPlugins, VesselPlugin::default())).add_systems(Startup, setup).run()
}

fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<StandardMaterial>>) {
    let organ = (Mesh3d(meshes.add(Sphere::new(1.0))), MeshMaterial3d(materials.add(Color::srgb(0.85, 0.6, 0.55))));
    commands.spawn((organ, Vasculature::new(PresetName::Paper).with_seed(7)));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(1.0, 2.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y)));
}
