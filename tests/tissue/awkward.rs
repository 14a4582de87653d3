//! Meshes as files have them: repeated, reversed, holed, thin, far away.

use super::{Outcome, ball_soup};
use bevy_math::{EulerRot, Quat, Vec2, Vec3};
use bevy_vessels::synthesis::{
    colonization::{Colonization, ColonizationSettings},
    mesh::TriangleMesh,
    roots::{RootPlacement, RootPlacements},
    tissue::{Extent, MeshSurface, MeshTissue, MeshVolume, Tissue, TissueError, TissueMode},
    tree::{VesselKind, statistics::coverage},
};
use std::sync::Arc;

type Mesh = Result<TriangleMesh, Box<dyn std::error::Error>>;

/// All triangles of a mesh for which `keep` holds, then those of another.
fn with(mesh: &TriangleMesh, keep: impl Fn(usize) -> bool, more: &[[Vec3; 3]]) -> Mesh {
    let kept = (0..mesh.triangles().len()).filter(|&triangle| keep(triangle)).map(|triangle| mesh.corners(triangle));
    let corners: Vec<[Vec3; 3]> = kept.chain(more.iter().copied()).collect();
    let triangles = (0..corners.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Ok(TriangleMesh::new(corners.concat(), triangles, None)?)
}

fn moved(mesh: &TriangleMesh, place: impl Fn(Vec3) -> Vec3) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles().len()).map(|triangle| mesh.corners(triangle).map(&place)).collect()
}

fn reversed(triangles: Vec<[Vec3; 3]>) -> Vec<[Vec3; 3]> {
    triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect()
}

fn area(tissue: &dyn Tissue) -> f32 {
    match tissue.extent() {
        Extent::Area(area) => area,
        other => panic!("{other:?} is no area"),
    }
}

/// Whether all normals point away from a centre.
fn faces_away(tissue: &MeshSurface, center: Vec3, radius: f32) -> bool {
    let mut rng = super::rng(5);
    let points = (0..500).filter_map(|_| tissue.sample(&mut rng)).filter(|point| point.distance(center) < 1.5 * radius);
    points.map(|point| tissue.closest_point(point)).all(|point| point.normal.dot(point.position - center) > 0.0)
}

#[test]
fn repeated_and_double_sided_faces_count_once() -> Outcome {
    let ball = ball_soup(12, false)?;
    let twice = with(&ball, |_| true, &reversed(moved(&ball, |p| p)))?;
    let thrice = with(&twice, |_| true, &moved(&ball, |p| p))?;
    let once = area(&MeshSurface::new(ball)?);
    for copies in [twice, thrice] {
        let tissue = MeshSurface::new(copies)?;
        assert!((area(&tissue) / once - 1.0).abs() < 1e-6, "{} instead of {once}", area(&tissue));
        assert!(faces_away(&tissue, Vec3::ZERO, 1.0));
        let mut pieces = Vec::new();
        assert!(tissue.cut(0.1, &mut pieces));
        let measure: f32 = pieces.iter().map(|piece| piece.measure).sum();
        assert!((measure / once - 1.0).abs() < 1e-3, "pieces of {measure} on {once}");
    }
    Ok(())
}

#[test]
fn each_shell_faces_outwards_closed_or_open() -> Outcome {
    let ball = ball_soup(16, false)?;
    let inward = ball_soup(16, true)?;
    let aside = |p: Vec3| p * 0.5 + Vec3::X * 4.0;
    // A second shell that faces in; one with a hole; one with a sliver in place of an edge.
    let pair = MeshSurface::new(with(&ball, |_| true, &reversed(moved(&ball, aside)))?)?;
    assert!(faces_away(&pair, Vec3::ZERO, 1.0) && faces_away(&pair, Vec3::X * 4.0, 0.5));
    let holed = MeshSurface::new(with(&inward, |triangle| triangle % 29 != 3, &[])?)?;
    assert!(faces_away(&holed, Vec3::ZERO, 1.0));
    let bowl = with(&inward, |triangle| inward.corners(triangle).iter().all(|corner| corner.z < 0.3), &[])?;
    assert!(faces_away(&MeshSurface::new(bowl)?, Vec3::ZERO, 1.0));
    // A cavity stays one: its normals point into it, away from the solid.
    let hollow = with(&ball, |_| true, &reversed(moved(&ball, |p| p * 0.5)))?;
    let hollow = MeshSurface::new(hollow)?;
    assert!(hollow.closest_point(Vec3::X * 0.5).normal.x < -0.9);
    // A sheet stays as it is.
    for flip in [false, true] {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let corners = if flip { corners.map(|p| Vec3::new(p.y, p.x, 0.0)) } else { corners };
        let sheet = MeshSurface::new(TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2]], None)?)?;
        assert_eq!(sheet.closest_point(Vec3::splat(0.1)).normal.z, if flip { -1.0 } else { 1.0 });
    }
    Ok(())
}

/// The walls of a box, unconnected and facing in, each cut otherwise.
#[test]
fn walls_that_do_not_meet_corner_to_corner_face_outwards_together() -> Outcome {
    let mut walls = Vec::new();
    for (number, [normal, u]) in [
        [Vec3::X, Vec3::Y],
        [Vec3::NEG_X, Vec3::Z],
        [Vec3::Y, Vec3::Z],
        [Vec3::NEG_Y, Vec3::X],
        [Vec3::Z, Vec3::X],
        [Vec3::NEG_Z, Vec3::Y],
    ]
    .into_iter()
    .enumerate()
    {
        let (v, parts) = (normal.cross(u), number + 1);
        let at = |i: usize, j: f32| normal + u * (2.0 * i as f32 / parts as f32 - 1.0) + v * j;
        walls.extend(
            (0..parts).flat_map(|i| {
                [[at(i, -1.0), at(i, 1.0), at(i + 1, -1.0)], [at(i + 1, -1.0), at(i, 1.0), at(i + 1, 1.0)]]
            }),
        );
    }
    let triangles = (0..walls.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let tissue = MeshSurface::new(TriangleMesh::new(walls.concat(), triangles, None)?)?;
    assert!(faces_away(&tissue, Vec3::ZERO, 2.0));
    // A way goes from wall to wall, though the corners of their triangles don't meet.
    let from = tissue.closest_point(Vec3::new(0.9, 0.13, 1.0));
    let mut places = Vec::new();
    tissue.walk(&from, Vec3::X, 0.4, 0.01, &mut |place| places.push(place.position));
    let end = *places.last().expect("a way");
    assert!((end.x - 1.0).abs() < 1e-5 && end.z < 0.75, "{places:?}");
    Ok(())
}

#[test]
fn triangles_without_area_stretch_nothing() -> Outcome {
    let ball = ball_soup(12, false)?;
    let far = Vec3::new(300.0, -70.0, 5.0);
    let stray = [[far; 3], [Vec3::ZERO, far, far * 2.0]];
    let tissue = MeshSurface::new(with(&ball, |_| true, &stray)?)?;
    assert!(Vec3::from(tissue.bounds().max).max_element() <= 1.001);
    let volume = MeshVolume::new(&with(&ball, |_| true, &stray)?, 40)?;
    assert!(volume.voxel_size() < 0.06, "voxels of {}", volume.voxel_size());
    Ok(())
}

/// Sides of a tube of strips.
const SIDES: u32 = 128;

/// A closed tube of length 1, askew, whose sides are strips so many times as long as they are wide.
fn strips(ratio: f32) -> Mesh {
    let radius = SIDES as f32 / ratio / std::f32::consts::TAU;
    let turn = Quat::from_euler(EulerRot::XYZ, 0.7, 0.3, 1.1);
    let rim = |k: u32| Vec3::from((Vec2::from_angle(std::f32::consts::TAU * k as f32 / SIDES as f32) * radius, 0.0));
    let around = (0..SIDES).flat_map(|k| [rim(k), rim(k) + Vec3::Z]);
    let positions = around.chain([Vec3::ZERO, Vec3::Z]).map(|position| turn * position).collect();
    let side = |k: u32| {
        let [a, b] = [2 * k, 2 * ((k + 1) % SIDES)];
        [[a, b, a + 1], [a + 1, b, b + 1], [2 * SIDES, b, a], [2 * SIDES + 1, a + 1, b + 1]]
    };
    Ok(TriangleMesh::new(positions, (0..SIDES).flat_map(side).collect(), None)?)
}

#[test]
fn long_thin_triangles_are_surfaces_and_solids_as_others() -> Outcome {
    for ratio in [1e2, 1e3, 2e4, 1e6] {
        let mesh = strips(ratio)?;
        let radius = SIDES as f32 / ratio / std::f32::consts::TAU;
        let chord = 2.0 * radius * (std::f32::consts::PI / SIDES as f32).sin();
        let end = 0.5 * SIDES as f32 * radius * radius * (std::f32::consts::TAU / SIDES as f32).sin();
        let surface = MeshSurface::new(mesh.clone())?;
        let expected = SIDES as f32 * chord + 2.0 * end;
        // Coordinates are rounded to a sixteenth of the width of the finest strips.
        let error = area(&surface) / expected - 1.0;
        assert!(error.abs() < 0.01, "1:{ratio}: the area is {error} off");
        for reach in [0.3, 0.01, 1e-4] {
            let mut pieces = Vec::new();
            let most = 8.0 * (area(&surface) / (reach * reach) + 4.0 * SIDES as f32);
            assert!(surface.cut(reach, &mut pieces) || pieces.is_empty());
            assert!(pieces.len() as f32 <= most, "1:{ratio}: {} pieces of {reach}", pieces.len());
        }
        assert_eq!(super::samples(&surface, 200, 4).len(), 200);
        let solid = MeshVolume::new(&mesh, 64)?;
        let error = super::volume::volume_of(&solid) / end - 1.0;
        assert!(error.abs() < 0.1, "1:{ratio}: the volume is {error} off");
        assert!(super::samples(&solid, 200, 4).len() > 196);
    }
    Ok(())
}

#[test]
fn vessels_cover_long_thin_triangles() -> Outcome {
    for ratio in [1e2, 2e4] {
        let tissue: Arc<dyn Tissue> = Arc::new(MeshSurface::new(strips(ratio)?)?);
        let settings = ColonizationSettings::default().fit(tissue.extent());
        let reach = 3.0 * settings.arterial.step_length;
        let roots = RootPlacements { artery: RootPlacement::Within(0.5), ..RootPlacements::default() };
        let mut growth = Colonization::new(Arc::clone(&tissue), settings, &roots.into(), 1)?;
        growth.run();
        let probes = super::samples(tissue.as_ref(), 500, 8);
        let covered = coverage(growth.tree(VesselKind::Artery), &probes, reach).ok_or("samples")?;
        assert!(covered > 0.95, "1:{ratio}: {covered} covered");
    }
    Ok(())
}

/// Two thousand copies of a triangle are one: they hold as many roots, pieces and vessels.
#[test]
fn copies_of_a_triangle_are_one() -> Outcome {
    let grown = |copies: usize| -> Result<[usize; 3], Box<dyn std::error::Error>> {
        let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; copies], None)?;
        let tissue = Arc::new(MeshSurface::new(mesh)?);
        assert_eq!(area(tissue.as_ref()), 0.5);
        let mut pieces = Vec::new();
        assert!(tissue.cut(0.1, &mut pieces));
        let settings = ColonizationSettings { steps: 20, ..ColonizationSettings::default() };
        let roots = RootPlacements { artery: RootPlacement::Within(0.5), ..RootPlacements::default() };
        let mut growth = Colonization::new(tissue, settings, &roots.into(), 1)?;
        growth.run();
        let tree = growth.tree(VesselKind::Artery);
        Ok([pieces.len(), tree.roots().count(), tree.len()])
    };
    assert_eq!(grown(1)?, grown(2000)?);
    Ok(())
}

#[test]
fn far_from_the_origin_is_right_or_refused() -> Outcome {
    let ball = ball_soup(16, false)?;
    let at = |distance: f32| -> Mesh {
        let triangles = moved(&ball, |p| p + Vec3::splat(distance));
        with(&ball, |_| false, &triangles)
    };
    for distance in [10.0, 1000.0] {
        let tissue: Arc<dyn Tissue> = Arc::new(MeshSurface::new(at(distance)?)?);
        let mut rng = super::rng(7);
        for _ in 0..500 {
            let point = tissue.sample(&mut rng).expect("a point");
            assert!(tissue.contains(point), "{point} is not on the ball at {distance}");
            let closest = tissue.closest_point(point + Vec3::X * 0.01);
            assert!(tissue.contains(closest.position));
            tissue.walk(&closest, Vec3::Y, 0.1, 1e-3, &mut |place| assert!(tissue.contains(place.position)));
        }
    }
    for distance in [1e5, 1e6] {
        for error in [MeshSurface::new(at(distance)?).map(drop), MeshVolume::new(&at(distance)?, 30).map(drop)] {
            let Err(TissueError::TooFar { distance: named, .. }) = error else { panic!("at {distance}: {error:?}") };
            assert!((named / distance - 1.0).abs() < 0.01, "{named} named at {distance}");
        }
    }
    Ok(())
}

/// A mesh that faces into a lumen is a reversed one, unless it is said to be a lining.
#[test]
fn a_lining_faces_as_it_is() -> Outcome {
    let lumen = ball_soup(16, true)?;
    assert!(faces_away(&MeshSurface::new(lumen.clone())?, Vec3::ZERO, 1.0));
    assert!(!faces_away(&MeshSurface::lining(lumen.clone())?, Vec3::ZERO, 1.0));
    for (mode, is_out) in [(TissueMode::Surface, true), (TissueMode::Lining, false)] {
        let prepared = MeshTissue::from(mode).prepare(lumen.clone())?;
        let point = prepared.tissue().closest_point(Vec3::X);
        assert_eq!(point.normal.dot(Vec3::X) > 0.0, is_out, "{mode:?}");
    }
    Ok(())
}
