//! Solids thinner than a voxel: they are measured, sampled and grown through as others are.

use super::{
    Outcome, ball_soup, in_cube, rng, samples,
    volume::{Mesh, cuboid, joined, moved, volume_of, without},
};
use bevy_math::{Quat, Vec3, bounding::BoundingVolume};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::TriangleMesh,
    roots::Roots,
    tissue::{Extent, MeshVolume, Tissue, TissueError},
    tree::{VesselKind, statistics::coverage},
};
use std::sync::Arc;

fn plate(thickness: f32) -> Mesh {
    cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, thickness))
}

fn turned(mesh: &TriangleMesh) -> Mesh {
    let turn = Quat::from_euler(bevy_math::EulerRot::XYZ, 0.7, 0.3, 1.1);
    moved(mesh, |p| turn * p)
}

#[test]
fn plates_wires_and_flat_balls_have_their_volume_at_any_thickness() -> Outcome {
    let wire = |width: f32| cuboid(Vec3::ZERO, Vec3::new(width, 1.0, width));
    let disc = |thickness: f32| moved(&ball_soup(20, false)?, |p| p * Vec3::new(1.0, 1.0, thickness));
    for thickness in [3e-2, 1e-3, 1e-4, 1e-5] {
        let solids = [
            ("plate", plate(thickness)?),
            ("turned plate", turned(&plate(thickness)?)?),
            ("wire", wire(thickness)?),
            ("turned wire", turned(&wire(thickness)?)?),
            ("disc", disc(thickness)?),
        ];
        for (name, mesh) in solids {
            let expected = mesh.signed_volume() as f32;
            let solid = MeshVolume::new(&mesh, 40).map_err(|error| format!("{name} of {thickness}: {error}"))?;
            let share = volume_of(&solid) / expected;
            assert!((share - 1.0).abs() < 0.06, "{name} of {thickness}: {share} of its volume");
            let drawn = samples(&solid, 400, 3).len();
            assert!(drawn > 396, "{name} of {thickness}: {drawn} of 400 samples");
        }
    }
    Ok(())
}

/// Between two bent sheets, close together: a shell of a ball, of which a plate with a hole is a part.
#[test]
fn thin_solids_are_sampled_evenly() -> Outcome {
    // A plate: 25 squares, chi-square over 24 degrees of freedom, 99.9 % below 51.2.
    for mesh in [plate(1e-4)?, without(&plate(1e-3)?, 3)?] {
        let solid = MeshVolume::new(&mesh, 30)?;
        let points = samples(&solid, 10_000, 5);
        let mut counts = [0.0; 25];
        for point in &points {
            counts[(point.x * 5.0).min(4.0) as usize * 5 + (point.y * 5.0).min(4.0) as usize] += 1.0;
        }
        let expected = points.len() as f64 / 25.0;
        let chi: f64 = counts.iter().map(|count: &f64| (count - expected).powi(2) / expected).sum();
        assert!(chi < 51.2, "chi-square {chi}: {counts:?}");
        let mean = points.iter().map(|point| f64::from(point.z)).sum::<f64>() / points.len() as f64;
        let thickness = f64::from(Vec3::from(solid.bounds().max).z);
        assert!((mean / thickness - 0.5).abs() < 0.015, "the mean height is {mean} of {thickness}");
    }
    // A hollow ball: its upper part by the area of a cap, which goes with its height.
    let hollow =
        joined(&[ball_soup(30, false)?, moved(&ball_soup(30, false)?, |p| p * 0.9995)?.with_flipped(|_| true)])?;
    let solid = MeshVolume::new(&hollow, 24)?;
    let points = samples(&solid, 8000, 6);
    let above = points.iter().filter(|point| point.z > 0.5).count() as f64 / points.len() as f64;
    assert!((above - 0.25).abs() < 0.02, "{above} of the samples are in a quarter of the shell");
    Ok(())
}

#[test]
fn points_are_brought_into_thin_solids() -> Outcome {
    for thickness in [1e-2, 1e-4, 1e-5] {
        let mesh = turned(&plate(thickness)?)?;
        let solid = MeshVolume::new(&mesh, 40)?;
        let mut rng = rng(3);
        let center = Vec3::from(solid.bounds().center());
        for _ in 0..300 {
            let point = center + in_cube(&mut rng, 0.9);
            let closest = solid.closest_point(point).position;
            assert!(solid.contains(closest), "{closest} is not inside a plate of {thickness}");
            let surface = solid.index().closest(point).ok_or("a surface")?;
            let excess = closest.distance(point) - surface.distance_squared.sqrt();
            assert!(excess < 0.02, "{excess} beyond the surface of a plate of {thickness}");
        }
    }
    Ok(())
}

/// What a user expects of a thin slab: it simply grows, whatever its thickness.
#[test]
fn thin_slabs_grow_as_thick_ones_do() -> Outcome {
    for thickness in [1e-2, 1e-3, 1e-5] {
        let solid = Arc::new(MeshVolume::new(&plate(thickness)?, 64)?);
        let settings = ColonizationSettings::default().fit(solid.extent());
        let reach = 2.0 * settings.arterial.influence_distance;
        let mut growth = Colonization::new(Arc::clone(&solid) as Arc<dyn Tissue>, settings, &Roots::default(), 1)?;
        growth.run();
        let probes = samples(solid.as_ref(), 2000, 9);
        for kind in Colonization::KINDS {
            let tree = growth.tree(kind);
            let outside = tree.positions().iter().filter(|&&node| !solid.contains(node)).count();
            assert_eq!(outside, 0, "{} of a slab of {thickness}", kind.name());
        }
        let covered = coverage(growth.tree(VesselKind::Artery), &probes, reach).ok_or("samples")?;
        println!("slab of {thickness}: {covered} within {reach} of {} nodes", growth.tree(VesselKind::Artery).len());
        assert!(covered > 0.95, "a slab of {thickness} is covered to {covered}");
    }
    Ok(())
}

/// From a ball to a sheet, the size to which settings are fitted doesn't jump, and counts as many drains.
#[test]
fn sheets_have_a_size_that_keeps_the_number_of_drains() {
    let side = |extent: Extent| Extent::SHEET * extent.equivalent_diameter();
    let area = 2.0;
    let volumes = [1e-1, 1e-2, 8e-3, 7e-3, 1e-3, 1e-5];
    for volume in volumes {
        let (extent, thickness) = (Extent::solid(volume, area), volume);
        let spacing = side(extent);
        let drains = volume / (spacing * spacing * spacing.min(thickness));
        let of_ball = std::f32::consts::PI / 6.0 / Extent::SHEET.powi(3);
        assert!((drains / of_ball - 1.0).abs() < 1e-3, "{drains} drains in {extent:?}, {of_ball} in a ball");
        assert_eq!(matches!(extent, Extent::Sheet { .. }), thickness < spacing, "{extent:?}");
    }
}

#[test]
fn what_has_no_inside_is_refused_by_name() -> Outcome {
    let sheet = moved(&plate(1.0)?, |p| Vec3::new(p.x, p.y, 0.3 * p.x))?;
    assert_eq!(MeshVolume::new(&sheet, 50).err(), Some(TissueError::NoInside { resolution: 50 }));
    let none = plate(1e-8).and_then(|mesh| moved(&mesh, |p| p + 1.0))?;
    assert_eq!(MeshVolume::new(&none, 50).err(), Some(TissueError::NoInside { resolution: 50 }));
    Ok(())
}
