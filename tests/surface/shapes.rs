//! Trees made by hand: simple ones with exact measures, and hard ones.

use crate::measures::{sound_surface, union_volume, volume, widened};
use bevy_math::{Quat, Vec2, Vec3};
use bevy_vessels::synthesis::{
    surface::{Surface, SurfaceError, SurfaceSettings, TipCap},
    tree::{NO_PARENT, VesselTree},
};
use std::f32::consts::{PI, TAU};

fn tree(nodes: &[(Vec3, u32, f32)]) -> VesselTree {
    VesselTree::from_arrays(
        nodes.iter().map(|node| node.0).collect(),
        nodes.iter().map(|node| node.1).collect(),
        nodes.iter().map(|node| node.2).collect(),
    )
    .expect("a tree")
}

fn tube(radius: f32, length: f32, parts: u32) -> VesselTree {
    let node = |part: u32| (Vec3::Z * length * part as f32 / parts as f32, part.wrapping_sub(1), radius);
    tree(&(0..=parts).map(node).collect::<Vec<_>>())
}

/// A node, then two children that fork in turn, with Murray's radii.
fn balanced(levels: u32) -> VesselTree {
    let mut nodes = vec![(Vec3::ZERO, NO_PARENT, 0.1), (Vec3::Z, 0, 0.1)];
    let mut tips = vec![(1u32, Vec3::Z, Vec3::X)];
    for level in 0..levels {
        let (length, radius) = (0.8f32.powi(level as i32 + 1), 0.1 * 0.5f32.powf((level + 1) as f32 / 3.0));
        tips = tips
            .into_iter()
            .flat_map(|(tip, ahead, side)| [0.6f32, -0.6].map(|angle| (tip, ahead, side, angle)))
            .map(|(tip, ahead, side, angle)| {
                let axis = ahead.cross(side).normalize();
                let ahead = (Quat::from_axis_angle(axis, angle) * ahead).normalize();
                let position = nodes[tip as usize].0 + ahead * length;
                nodes.push((position, tip, radius));
                // The next plane of forking stands across this one.
                (nodes.len() as u32 - 1, ahead, axis)
            })
            .collect();
    }
    tree(&nodes)
}

fn hard_trees() -> Vec<(&'static str, VesselTree)> {
    let star = |count: u32| {
        let ray = |ray: u32| {
            let (height, turn) = (1.0 - (2.0 * ray as f32 + 1.0) / count as f32, ray as f32 * 2.4);
            let across = (1.0 - height * height).sqrt();
            (Vec3::new(across * turn.cos(), across * turn.sin(), height), 0, 0.05)
        };
        tree(&std::iter::once((Vec3::ZERO, NO_PARENT, 0.1)).chain((0..count).map(ray)).collect::<Vec<_>>())
    };
    let comb = {
        let mut nodes = vec![(Vec3::ZERO, NO_PARENT, 0.1)];
        for tooth in 0..30u32 {
            let trunk = Vec3::X * (tooth + 1) as f32 * 0.25;
            nodes.push((trunk, if tooth == 0 { 0 } else { 2 * tooth - 1 }, 0.1));
            nodes.push((trunk + Vec3::Y * 0.8, 2 * tooth + 1, 0.02 + 0.002 * tooth as f32));
        }
        tree(&nodes)
    };
    let zigzag = |angle: f32| {
        let mut at = Vec3::ZERO;
        let nodes = (0..40u32).map(|node| {
            let side = if node % 2 == 0 { angle } else { -angle };
            at += Vec3::new(side.sin(), 0.0, side.cos()) * if node == 0 { 0.0 } else { 0.5 };
            (at, node.wrapping_sub(1), 0.1)
        });
        tree(&nodes.collect::<Vec<_>>())
    };
    let helix = {
        let node = |node: u32| {
            let turn = node as f32 * 0.3;
            (Vec3::new(turn.cos(), turn.sin(), 0.1 * turn), node.wrapping_sub(1), 0.12)
        };
        tree(&(0..100).map(node).collect::<Vec<_>>())
    };
    let same_place = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::ZERO, 0, 0.1),
        (Vec3::Z, 1, 0.1),
        (Vec3::Z, 2, 0.1),
        (Vec3::Z, 2, 0.05),
        (Vec3::Z * 2.0, 3, 0.08),
        (Vec3::Z + Vec3::X, 4, 0.05),
    ]);
    let hairpin = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::Z, 0, 0.1),
        (Vec3::new(0.0, 0.1, 0.1), 1, 0.1),
        (Vec3::new(0.5, 0.1, 0.1), 2, 0.1),
    ]);
    let far = {
        let near = balanced(3);
        let positions = near.positions().iter().map(|position| *position + 1000.0).collect();
        VesselTree::from_arrays(positions, near.parents().to_vec(), near.radii().to_vec()).expect("a tree")
    };
    let forest = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::X * 5.0, NO_PARENT, 0.2),
        (Vec3::Z, 0, 0.1),
        (Vec3::X * 9.0, NO_PARENT, 0.3),
        (Vec3::X * 5.0 + Vec3::Y, 1, 0.2),
    ]);
    let backward = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::Z, 0, 0.1),
        (Vec3::new(0.6, 0.0, 0.4), 1, 0.09),
        (Vec3::new(-0.6, 0.0, 0.3), 1, 0.06),
    ]);
    let steep = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::Z, 0, 0.1),
        (Vec3::new(0.05, 0.0, 2.0), 1, 0.08),
        (Vec3::new(-0.1, 0.0, 2.0), 1, 0.07),
    ]);
    let uneven = tree(&[
        (Vec3::ZERO, NO_PARENT, 1.0),
        (Vec3::Z * 5.0, 0, 1.0),
        (Vec3::Z * 10.0, 1, 1.0),
        (Vec3::new(5.0, 0.0, 5.0), 1, 1e-4),
    ]);
    let wide_child = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.05),
        (Vec3::Z, 0, 0.05),
        (Vec3::Z * 2.0, 1, 0.6),
        (Vec3::new(1.0, 0.0, 1.0), 1, 0.5),
    ]);
    vec![
        ("one node", tree(&[(Vec3::ONE, NO_PARENT, 0.5)])),
        ("chain", tube(0.1, 5.0, 100)),
        ("dense chain", tube(0.5, 2.0, 500)),
        ("balanced", balanced(6)),
        ("star of 3", star(3)),
        ("star of 12", star(12)),
        ("star of 60", star(60)),
        ("comb", comb),
        ("zigzag 45°", zigzag(PI / 4.0)),
        ("zigzag 80°", zigzag(1.4)),
        ("helix", helix),
        ("nodes in one place", same_place),
        ("hairpin", hairpin),
        ("far away", far),
        ("forest", forest),
        ("backward", backward),
        ("steep", steep),
        ("uneven", uneven),
        ("children wider than their parent", wide_child),
        ("tiny", widened(&tube(1e-3, 1e-18, 4), 1e-18)),
    ]
}

#[test]
fn hard_trees_have_closed_surfaces_at_all_settings() {
    for (name, tree) in hard_trees() {
        for (most_sides, least_sides, level) in
            [(16, 4, 1), (4, 4, 1), (4, 4, 0), (16, 4, 0), (64, 8, 1), (8, 8, 2), (16, 16, 3)]
        {
            for tips in [TipCap::Round, TipCap::Pointed] {
                let settings = SurfaceSettings { level, most_sides, least_sides, tips };
                sound_surface(&format!("{name}, {settings:?}"), &tree, &settings);
            }
        }
        for factor in [4.0, 8.0] {
            sound_surface(&format!("{name} × {factor}"), &widened(&tree, factor), &SurfaceSettings::default());
        }
    }
}

#[test]
fn trees_with_room_have_no_faces_that_meet() {
    let with_room =
        ["chain", "balanced", "comb", "zigzag 45°", "helix", "star of 3", "forest", "backward", "uneven", "far away"];
    for (name, tree) in hard_trees().into_iter().filter(|(name, _)| with_room.contains(name)) {
        for level in [1, 2] {
            let check =
                sound_surface(name, &tree, &SurfaceSettings { level, ..SurfaceSettings::default() }).mesh.validate();
            assert!(check.is_sound(), "{name}, level {level}: {:?}", check.vessels);
        }
    }
}

#[test]
fn volumes_are_those_of_the_round_cones() {
    let names = ["chain", "balanced", "star of 3", "comb", "zigzag 45°", "helix", "forest", "backward"];
    for (name, tree) in hard_trees().into_iter().filter(|(name, _)| names.contains(name)) {
        let union =
            union_volume(&tree, 200_000) + if name == "forest" { f64::from(4.0 / 3.0 * PI * 0.027) } else { 0.0 };
        let ratio = volume(&Surface::new(&tree, &SurfaceSettings::default()).expect(name).mesh) / union;
        assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
    }
}

#[test]
fn a_tube_is_as_wide_as_its_vessel_and_ends_in_half_balls() {
    for (sides, level) in [(4, 1), (4, 2), (8, 1), (16, 1), (16, 2), (64, 1)] {
        let settings = SurfaceSettings { level, most_sides: sides, least_sides: sides, tips: TipCap::Round };
        let mesh = sound_surface("tube", &tube(1.0, 12.0, 6), &settings).mesh;
        let name = format!("{sides} sides, level {level}");
        let wide = mesh.positions.iter().filter(|position| (3.0..9.0).contains(&position.z));
        let radii: Vec<f32> = wide.map(|position| position.truncate().length()).collect();
        // A polygon with the area of the circle has corners outside of it.
        let chord = TAU / (sides << level) as f32;
        let corner = (chord / chord.sin()).sqrt();
        assert!(radii.iter().all(|radius| (radius / corner - 1.0).abs() < 0.03), "{name}: {radii:?}");
        let exact = f64::from(PI) * (12.0 + 4.0 / 3.0);
        assert!((volume(&mesh) / exact - 1.0).abs() < 0.02, "{name}: {}", volume(&mesh) / exact);
        let top = mesh.positions.iter().map(|position| position.z).fold(0.0, f32::max);
        assert!((top - 13.0).abs() < 0.1, "{name}: tip at {top}");
    }
}

#[test]
fn textures_have_one_size_and_tangents_follow_them() {
    let mesh = sound_surface("tube", &tube(0.5, 12.0, 6), &SurfaceSettings::default()).mesh;
    for &face in mesh
        .faces
        .iter()
        .filter(|face| face.iter().all(|&corner| (2.0..10.0).contains(&mesh.positions[corner as usize].z)))
    {
        let [a, b, _, d] = face.map(|corner| (mesh.positions[corner as usize], mesh.uvs[corner as usize]));
        for (from, to) in [(a, b), (a, d)] {
            let (length, shown) = (from.0.distance(to.0), from.1.distance(to.1));
            assert!((shown / length - 1.0).abs() < 0.1, "{shown} for {length}");
        }
    }
    for (vertex, tangent) in mesh.tangents().iter().enumerate() {
        let (position, normal) = (mesh.positions[vertex], mesh.normals[vertex]);
        assert!(tangent.truncate().dot(normal).abs() < 1e-3);
        if (2.0..10.0).contains(&position.z) {
            // Around the vessel, anticlockwise seen from its tip.
            assert!(tangent.truncate().dot(Vec3::Z.cross(normal)) > 0.99, "{tangent}");
            assert!(normal.dot(position.with_z(0.0).normalize()) > 0.99);
        }
    }
}

#[test]
fn copies_share_all_but_their_texture_coordinates() {
    let mesh = sound_surface("balanced", &balanced(4), &SurfaceSettings::default()).mesh;
    assert!(!mesh.copies.is_empty());
    for (copy, &original) in (mesh.unique()..).zip(&mesh.copies) {
        let original = original as usize;
        assert!(original < mesh.unique());
        assert_eq!(mesh.positions[copy], mesh.positions[original]);
        assert_eq!(mesh.normals[copy], mesh.normals[original]);
        assert_eq!((mesh.nodes[copy], mesh.radii[copy]), (mesh.nodes[original], mesh.radii[original]));
        assert_ne!(mesh.uvs[copy], mesh.uvs[original]);
    }
    assert!(mesh.uvs.iter().all(|uv: &Vec2| uv.is_finite()));
}

#[test]
fn an_empty_tree_has_an_empty_surface() {
    let surface = Surface::new(&VesselTree::new(), &SurfaceSettings::default()).expect("a surface");
    assert!(surface.mesh.positions.is_empty() && surface.mesh.faces.is_empty());
}

#[test]
fn a_vessel_within_another_is_reported() {
    let tree = tree(&[
        (Vec3::ZERO, NO_PARENT, 1.0),
        (Vec3::Z * 4.0, 0, 1.0),
        (Vec3::Z * 8.0, 1, 1.0),
        (Vec3::new(0.5, 0.0, 4.5), 1, 0.1),
    ]);
    let surface = sound_surface("stub", &tree, &SurfaceSettings::default());
    assert_eq!(surface.report.absorbed.iter().map(|node| node.0).collect::<Vec<_>>(), [3]);
    assert!(surface.mesh.nodes.iter().all(|&node| node != 3));
}

#[test]
fn settings_out_of_their_limits_are_refused() {
    let wrong = |change: fn(&mut SurfaceSettings)| {
        let mut settings = SurfaceSettings::default();
        change(&mut settings);
        Surface::new(&tube(1.0, 2.0, 1), &settings).expect_err("wrong settings")
    };
    assert_eq!(wrong(|settings| settings.level = 5), SurfaceError::Level { level: 5 });
    assert_eq!(wrong(|settings| settings.most_sides = 12), SurfaceError::Sides { sides: 12 });
    assert_eq!(wrong(|settings| settings.least_sides = 0), SurfaceError::Sides { sides: 0 });
    assert_eq!(wrong(|settings| settings.least_sides = 32), SurfaceError::LeastAboveMost { least: 32, most: 16 });
    let message = wrong(|settings| settings.most_sides = 128).to_string();
    assert!(message.contains("128") && message.contains("set 4, 8, 16, 32 or 64"), "{message}");
}

/// A twig that leaves a trunk at a flat angle stays within it for long: it opens where it parts from it.
#[test]
fn flat_laterals_open_where_they_part_from_their_trunk() {
    for degrees in [1.0f32, 2.0, 4.0, 7.0, 10.0, 15.0, 20.0, 30.0] {
        for length in [1.0, 6.0] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let tree = tree(&[
                (Vec3::ZERO, NO_PARENT, 0.1),
                (Vec3::Z, 0, 0.1),
                (Vec3::Z * 8.0, 1, 0.1),
                (Vec3::Z + Vec3::new(sine, 0.0, cosine) * length, 1, 0.04),
            ]);
            for level in 1..=2 {
                let name = format!("{degrees}°, length {length}, level {level}");
                let settings = SurfaceSettings { level, ..SurfaceSettings::default() };
                let surface = sound_surface(&name, &tree, &settings);
                let check = surface.mesh.validate();
                assert!(check.is_sound(), "{name}: {:?}", surface.report);
                let ratio = volume(&surface.mesh) / union_volume(&tree, 200_000);
                assert!((ratio - 1.0).abs() < 0.05, "{name}: {ratio}");
                // It is there unless its axis ends within the trunk.
                let is_within = length * sine < 0.1;
                assert_eq!(surface.report.absorbed.len(), usize::from(is_within), "{name}");
            }
        }
    }
}

/// Twigs that branch off while their own vessel is still within the trunk leave the trunk.
#[test]
fn laterals_of_a_flat_lateral_leave_the_trunk_before_it_does() {
    let aside = |length: f32| Vec3::new(0.07 * length, 0.0, 1.0 + length);
    let tree = tree(&[
        (Vec3::ZERO, NO_PARENT, 0.1),
        (Vec3::Z, 0, 0.1),
        (Vec3::Z * 8.0, 1, 0.1),
        (aside(0.6), 1, 0.04),
        (aside(5.0), 3, 0.04),
        (aside(0.6) + Vec3::Y, 3, 0.03),
    ]);
    let surface = sound_surface("early lateral", &tree, &SurfaceSettings::default());
    assert!(surface.mesh.validate().is_sound(), "{:?}", surface.report);
    let tip = surface.mesh.positions.iter().map(|position| position.y).fold(0.0, f32::max);
    assert!((tip - 1.03).abs() < 0.02, "{tip}");
    let base = surface.mesh.positions.iter().filter(|position| position.y > 0.3);
    assert!(base.clone().count() > 20 && base.clone().all(|position| (position.z - 1.6).abs() < 0.05), "its own place");
}

#[test]
fn a_vessel_may_turn_back_sharply() {
    for (wide, thin) in [(0.1, 0.1), (0.1, 0.07), (0.02, 0.02)] {
        for degrees in (10..=170).step_by(10) {
            let (sine, cosine) = (degrees as f32).to_radians().sin_cos();
            let tree = tree(&[
                (Vec3::ZERO, NO_PARENT, wide),
                (Vec3::X, 0, wide),
                (Vec3::X + Vec3::new(cosine, sine, 0.0), 1, thin),
            ]);
            for sides in [4, 16] {
                let name = format!("{degrees}°, radii {wide} and {thin}, {sides} sides");
                let settings = SurfaceSettings { most_sides: sides, least_sides: sides, ..SurfaceSettings::default() };
                let check = sound_surface(&name, &tree, &settings).mesh.validate();
                assert!(check.is_sound(), "{name}: {:?}", check.vessels);
            }
        }
    }
}
