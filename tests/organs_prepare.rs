//! Every real organ of the shared data prepares as surface and as volume. Skipped where the data is absent.

#![cfg(feature = "mesh_files")]

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::read_glb,
    mesh::TriangleMesh,
    rng::Stream,
    tissue::{Extent, MeshSurface, MeshVolume, Tissue},
};
use std::{
    path::{Path, PathBuf},
    time::Instant,
};

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Organs that are watertight as they come.
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

/// Organs with open edges, inner walls and parts that close only together.
const AWKWARD: [&str; 3] =
    ["awkward/colon_vhf_original", "awkward/pancreas_vhf_v2_original", "awkward/spleen_vhf_original_uv"];

fn folder() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/organs"));
    if !folder.is_dir() {
        println!("skipped: no organs at {}", folder.display());
        return None;
    }
    Some(folder.to_path_buf())
}

fn read(folder: &Path, name: &str) -> Result<TriangleMesh, Box<dyn std::error::Error>> {
    Ok(read_glb(&folder.join(name).with_extension("glb"))?)
}

#[test]
#[ignore = "prints timings"]
fn timings() -> Outcome {
    let Some(folder) = folder() else { return Ok(()) };
    for name in WATERTIGHT.iter().chain(&AWKWARD) {
        let mesh = read(&folder, name)?;
        let start = Instant::now();
        let surface = MeshSurface::new(mesh.clone())?;
        let surface_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let volume = MeshVolume::new(&mesh, 128);
        let volume_ms = start.elapsed().as_secs_f64() * 1e3;
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
