//! Every real organ of the shared data can be prepared as surface and as volume. Skipped without the data.

#![cfg(feature = "mesh_files")]

#[path = "common/shared.rs"]
mod shared;

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::load_mesh,
    mesh::TriangleMesh,
    random::Stream,
    tissue::{Extent, MeshSurface, MeshVolume, Tissue},
};
use std::{
    path::{Path, PathBuf},
    time::Instant,
};

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Organs that are watertight in their files.
const WATERTIGHT: [&str; 11] = [
    "bladder_vhf",
    "colon_vhf",
    "colon_vhm",
    "eyeball_mh",
    "eyeball_mh_uv",
    "heart_vhf",
    "kidney_left_vhf",
    "kidney_left_vhf_uv",
    "liver_vhf",
    "small_intestine_vhf",
    "spleen_vhf_uv",
];

/// Organs with open edges, inner walls and parts that are closed only together.
const AWKWARD: [&str; 3] =
    ["awkward/colon_vhf_original", "awkward/pancreas_vhf_v2_original", "awkward/spleen_vhf_original_uv"];

fn folder() -> Option<PathBuf> {
    shared::folder("data/organs")
}

fn read(folder: &Path, name: &str) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    Ok(load_mesh(&folder.join(name).with_extension("glb"))?)
}

/// The shortest time of several runs, in ms, and the last result.
fn least_ms<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let mut run = || {
        let start = Instant::now();
        let outcome = work();
        (start.elapsed().as_secs_f64() * 1e3, outcome)
    };
    (0..8).fold(run(), |(least, _), _| {
        let (ms, outcome) = run();
        (ms.min(least), outcome)
    })
}

/// Winding number of a mesh around a point, by the solid angles of its triangles (van Oosterom & Strackee 1983).
fn winding(mesh: &TriangleMesh, point: Vec3) -> f64 {
    let solid_angle = |triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3() - point.as_dvec3());
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let above = a.dot(b.cross(c));
        2.0 * above.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    (0..mesh.triangles().len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

fn volume_of(tissue: &dyn Tissue) -> f64 {
    match tissue.extent() {
        Extent::Volume(volume) => volume.into(),
        other => panic!("a volume has the extent {other:?}"),
    }
}

#[test]
fn watertight_organs_have_their_volume_and_samples_inside() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    let (mut drawn, mut outside) = (0, 0);
    for name in WATERTIGHT {
        let mesh = read(&folder, name)?;
        assert!(mesh.is_closed(), "{name} is open");
        let volume = MeshVolume::new(&mesh, MeshVolume::DEFAULT_RESOLUTION)?;
        let expected = mesh.signed_volume();
        let found = volume_of(&volume);
        assert!((found / expected - 1.0).abs() < 0.01, "{name}: volume {found:e}, its mesh has {expected:e}");
        let mut rng = Stream::Attraction.rng(5);
        for number in 0..2000 {
            let point = volume.sample(&mut rng).ok_or("no sample")?;
            assert!(volume.contains(point), "{name} does not contain {point}");
            if number % 20 == 0 {
                drawn += 1;
                outside += u32::from(winding(&mesh, point) < 0.5);
            }
        }
    }
    assert!(f64::from(outside) <= 0.001 * f64::from(drawn), "{outside} of {drawn} samples are outside");
    Ok(())
}

#[test]
fn points_outside_are_brought_in() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    for name in WATERTIGHT.iter().chain(&AWKWARD) {
        let mesh = read(&folder, name)?;
        let volume = MeshVolume::new(&mesh, 64)?;
        let surface = MeshSurface::new(mesh)?;
        let mut rng = Stream::Attraction.rng(6);
        for _ in 0..500 {
            let on = surface.sample(&mut rng).ok_or("no sample")?;
            let normal = surface.closest_point(on).normal;
            let point = on + normal * (2.0 * volume.voxel_size());
            let found = volume.closest_point(point).position;
            assert!(volume.contains(found), "{name}: {found} is outside");
        }
    }
    Ok(())
}

#[test]
fn awkward_organs_are_usable() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    // The colon is only a wall; pancreas and spleen are solid as the union of their parts.
    for (name, least, most) in [(AWKWARD[0], 3e-4, 6e-4), (AWKWARD[1], 8.2e-5, 8.6e-5), (AWKWARD[2], 1.89e-4, 1.93e-4)]
    {
        let mesh = read(&folder, name)?;
        let surface = MeshSurface::new(mesh.clone())?;
        let volume = MeshVolume::new(&mesh, MeshVolume::DEFAULT_RESOLUTION)?;
        let found = volume_of(&volume);
        assert!(found > least && found < most, "{name}: volume {found:e}");
        let mut rng = Stream::Attraction.rng(7);
        for _ in 0..500 {
            let point = volume.sample(&mut rng).ok_or("no sample")?;
            assert!(volume.contains(point));
            let point = surface.sample(&mut rng).ok_or("no sample")?;
            assert!(surface.contains(point) && surface.closest_point(point).normal.is_normalized());
        }
    }
    Ok(())
}

#[test]
fn the_colon_is_prepared_in_time() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    let mesh = read(&folder, "colon_vhf")?;
    // The limits are for an optimised build on an idle machine.
    let slack = if cfg!(debug_assertions) { 10.0 } else { 2.0 };
    let (surface_ms, surface) = least_ms(|| MeshSurface::new(mesh.clone()));
    surface?;
    assert!(surface_ms < 50.0 * slack, "the surface took {surface_ms} ms");
    let (volume_ms, volume) = least_ms(|| MeshVolume::new(&mesh, 128));
    volume?;
    assert!(volume_ms < 500.0 * slack, "the volume took {volume_ms} ms");
    Ok(())
}

#[test]
fn damaged_organs_are_errors() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    let bytes = std::fs::read(folder.join("spleen_vhf_uv.glb"))?;
    let path = std::env::temp_dir().join(format!("bevy_vessels_damaged_{}.glb", std::process::id()));
    for end in [0, 3, 12, 19, 20, 400, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..end])?;
        let message = load_mesh(&path).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(message.contains("bevy_vessels_damaged"), "{end} bytes gave {message:?}");
    }
    std::fs::remove_file(&path)?;
    Ok(())
}

#[test]
#[ignore = "prints timings"]
fn timings() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    for name in WATERTIGHT.iter().chain(&AWKWARD) {
        let mesh = read(&folder, name)?;
        let (surface_ms, surface) = least_ms(|| MeshSurface::new(mesh.clone()));
        let (volume_ms, volume) = least_ms(|| MeshVolume::new(&mesh, 128));
        let surface = surface?;
        let text = match &volume {
            Ok(volume) => format!("{:?}", volume.extent()),
            Err(error) => error.to_string(),
        };
        println!(
            "{name:34} {:6} triangles, surface {surface_ms:5.1} ms, volume {volume_ms:6.1} ms: {:?} {text}, signed {:.4e}",
            mesh.triangles().len(),
            surface.extent(),
            mesh.signed_volume()
        );
        let mut rng = Stream::Attraction.rng(1);
        let time = |label: &str, count: u32, work: &mut dyn FnMut()| {
            let start = Instant::now();
            (0..count).for_each(|_| work());
            println!("    {label}: {:.0} ns", start.elapsed().as_secs_f64() * 1e9 / f64::from(count));
        };
        time("surface sample", 100_000, &mut || {
            std::hint::black_box(surface.sample(&mut rng));
        });
        let points: Vec<Vec3> = (0..10_000).filter_map(|_| surface.sample(&mut rng)).collect();
        let near: Vec<Vec3> = points.iter().map(|p| *p + Vec3::new(0.3, -0.5, 0.6) * 1e-3).collect();
        let mut at = 0;
        time("surface closest, 1 mm off", 10_000, &mut || {
            at = (at + 1) % near.len();
            std::hint::black_box(surface.closest_point(near[at]));
        });
        let Ok(volume) = volume else { continue };
        time("volume sample", 100_000, &mut || {
            std::hint::black_box(volume.sample(&mut rng));
        });
        time("volume contains, near the surface", 10_000, &mut || {
            at = (at + 1) % near.len();
            std::hint::black_box(volume.contains(near[at]));
        });
        time("volume closest, near the surface", 10_000, &mut || {
            at = (at + 1) % near.len();
            std::hint::black_box(volume.closest_point(near[at]));
        });
    }
    Ok(())
}
