//! Procedural organs match their documentation: closed, oriented, human-sized, repeatable, different by seed.

use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    mesh::{ShadedMesh, TriangleMesh},
    organ::{Colon, ColonSettings, LiverSettings},
    preset::PresetName,
    random::Stream,
    roots::{RootPlacement, RootPlacements},
    tissue::{MeshSurface, Tissue},
    tree::{VesselKind, statistics},
};
use std::{collections::BTreeMap, sync::Arc};

const SEEDS: std::ops::Range<u64> = 0..12;

fn colon(seed: u64) -> Colon {
    ColonSettings { seed, ..Default::default() }.generate().expect("default settings are within their limits")
}

/// Index of each vertex's position: equal for vertices that coincide.
fn weld(mesh: &ShadedMesh) -> Vec<usize> {
    let mut seen = BTreeMap::new();
    mesh.positions
        .iter()
        .map(|point| {
            let next = seen.len();
            *seen.entry(point.to_array().map(|value| (value + 0.0).to_bits())).or_insert(next)
        })
        .collect()
}

/// Checks that two triangles share every edge, in opposite directions, and returns V − E + F.
fn assert_closed(mesh: &ShadedMesh, name: &str) -> isize {
    let welded = weld(mesh);
    let mut edges: BTreeMap<(usize, usize), (u32, u32)> = BTreeMap::new();
    for corners in &mesh.triangles {
        let corners = corners.map(|corner| welded[corner as usize]);
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            assert_ne!(from, to, "{name}: a triangle has two corners in one place");
            let uses = edges.entry((from.min(to), from.max(to))).or_default();
            if from < to { uses.0 += 1 } else { uses.1 += 1 }
        }
    }
    assert!(edges.values().all(|&uses| uses == (1, 1)), "{name}: an edge is open, or its triangles disagree");
    let vertices = welded.iter().max().map_or(0, |max| max + 1);
    vertices as isize - edges.len() as isize + mesh.triangles.len() as isize
}

fn assert_sound(mesh: &ShadedMesh, name: &str) {
    let count = mesh.positions.len();
    assert_eq!(
        [mesh.normals.len(), mesh.uvs.len(), mesh.colors.len()],
        [count; 3],
        "{name}: channels differ in length"
    );
    assert!(mesh.positions.iter().all(|point| point.is_finite()), "{name}: a position is not finite");
    assert!(mesh.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-4), "{name}: a normal is not a unit");
    assert!(mesh.uvs.iter().all(|uv| uv.cmpge(bevy_math::Vec2::ZERO).all() && uv.cmple(bevy_math::Vec2::ONE).all()));
    assert!(mesh.colors.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)));
    assert_eq!(assert_closed(mesh, name), 2, "{name}: not the topology of a sphere");
    assert!(mesh.signed_volume() > 0.0, "{name}: inside out");
    let mut opposed = 0;
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let face = (b - a).cross(c - a);
        assert!(face.length() > 1e-12, "{name}: a triangle without area at {a}");
        let mean: Vec3 = corners.iter().map(|&corner| mesh.normals[corner as usize]).sum();
        opposed += usize::from(mean.dot(face) <= 0.0);
    }
    assert!(opposed * 1000 <= mesh.triangles.len(), "{name}: {opposed} triangles face away from their normals");
}

#[test]
fn colons_are_closed_oriented_and_whole() {
    for seed in SEEDS {
        assert_sound(&colon(seed).mesh, &format!("colon {seed}"));
    }
    for triangles in [2_000, 12_345, 200_000] {
        let settings = ColonSettings { triangles, appendix: false, ..Default::default() };
        let mesh = settings.generate().expect("within limits").mesh;
        let share = mesh.triangles.len() as f32 / triangles as f32;
        assert!((0.9..=1.1).contains(&share), "{triangles} triangles asked for, {} made", mesh.triangles.len());
        assert_sound(&mesh, &format!("colon of {triangles} triangles"));
    }
}

#[test]
fn livers_are_closed_oriented_and_human_sized() {
    for seed in SEEDS {
        let liver = LiverSettings { seed, ..Default::default() }.generate().expect("within limits");
        assert_sound(&liver.mesh, &format!("liver {seed}"));
        let (low, high) = liver.mesh.bounds();
        let size = high - low;
        assert!((0.19..=0.30).contains(&size.x), "liver {seed} is {} m wide", size.x);
        assert!((0.08..=0.22).contains(&size.y) && (0.06..=0.18).contains(&size.z), "liver {seed} is {size}");
        let litres = liver.mesh.signed_volume() * 1000.0;
        assert!((0.7..=2.3).contains(&litres), "liver {seed} has {litres} L");
    }
}

#[test]
fn colons_are_human_sized() {
    for seed in SEEDS {
        let colon = colon(seed);
        let (low, high) = colon.mesh.bounds();
        let size = high - low;
        assert!((0.25..=0.40).contains(&size.x), "colon {seed} is {} m across", size.x);
        assert!((0.3..=0.55).contains(&size.y) && size.z < 0.25, "colon {seed} is {size}");
        let length: f32 = colon.centre_line.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        assert!((1.0..=1.9).contains(&length), "colon {seed} is {length} m long");
        assert!((50..=170).contains(&colon.haustra), "colon {seed} has {} haustra", colon.haustra);
        let body = &colon.radii[colon.radii.len() / 10..];
        let calibre = 2.0 * body.iter().sum::<f32>() / body.len() as f32;
        assert!((0.035..=0.07).contains(&calibre), "colon {seed} has a mean calibre of {calibre} m");
        assert!(body.iter().all(|&radius| radius > 0.012), "colon {seed} is strangled");
    }
}

#[test]
fn a_seed_is_one_colon_to_the_bit_and_another_seed_another() {
    let [first, again, other] = [3, 3, 4].map(colon);
    assert_eq!(first, again);
    let moved = first.mesh.positions.iter().zip(&other.mesh.positions).filter(|(a, b)| a.distance(**b) > 0.002).count();
    assert!(moved * 2 > first.mesh.positions.len(), "only {moved} vertices differ by 2 mm");
    let liver = |seed| LiverSettings { seed, ..Default::default() }.generate().expect("within limits");
    assert_eq!(liver(3), liver(3));
    assert_ne!(liver(3).mesh.positions, liver(4).mesh.positions);
}

/// For a point of the wall, the index of the nearest limb, by the tube's surface, and the point's distance from the
/// centre line there.
fn nearest(colon: &Colon, point: Vec3) -> (usize, f32) {
    let distances = colon.centre_line.iter().map(|at| at.distance(point));
    let gaps = distances.zip(&colon.radii).map(|(distance, radius)| (distance - radius, distance)).enumerate();
    let (index, (_, distance)) = gaps.min_by(|a, b| a.1.0.total_cmp(&b.1.0)).expect("the line has points");
    (index, distance)
}

/// The largest radius within 3 cm of a point of the centre line: rings lean in bends, and the pouch widens quickly.
fn radius_about(colon: &Colon, index: usize) -> f32 {
    let window = index.saturating_sub(10)..(index + 11).min(colon.radii.len());
    colon.radii[window].iter().copied().fold(0.0, f32::max)
}

#[test]
fn the_wall_does_not_cut_itself() {
    for seed in SEEDS {
        let colon = colon(seed);
        let spacing = colon.centre_line[0].distance(colon.centre_line[1]);
        for i in 2..colon.centre_line.len() - 2 {
            let before = colon.centre_line[i] - colon.centre_line[i - 2];
            let after = colon.centre_line[i + 2] - colon.centre_line[i];
            let curvature = before.angle_between(after) / (2.0 * spacing);
            let fill = curvature * colon.radii[i];
            assert!(fill < 0.95, "colon {seed}: at point {i} the tube fills {fill} of its bend");
        }
        // Neighbouring rings are close along the line; a vertex of another limb must be farther than the wall.
        let row = colon.mesh.positions.len() / 400;
        let part = colon.mesh.part(colon.outer.clone());
        for point in part.positions.iter().step_by(row.max(7)) {
            let (index, distance) = nearest(&colon, *point);
            assert!(
                distance < 1.25 * radius_about(&colon, index),
                "colon {seed}: a vertex far from the line, {distance}"
            );
            for (other, centre) in colon.centre_line.iter().enumerate() {
                let along = other.abs_diff(index) as f32 * spacing;
                let apart = centre.distance(*point);
                if along > 5.0 * colon.radii[other].max(colon.radii[index]) {
                    assert!(apart > 0.98 * colon.radii[other], "colon {seed}: limbs {index} and {other} overlap");
                }
            }
        }
    }
}

#[test]
fn the_wall_keeps_its_thickness_and_the_lumen_is_open() {
    for seed in SEEDS {
        let settings = ColonSettings { seed, ..Default::default() };
        let colon = colon(seed);
        let [outer, inner] = [&colon.outer, &colon.inner].map(|range| colon.mesh.part(range.clone()));
        assert!(outer.positions.len() + inner.positions.len() < colon.mesh.positions.len(), "the rim is neither");
        let last = colon.centre_line.len() - 1;
        // The inner side's vertices leave room around the centre line from the cut end to the caecum.
        for point in inner.positions.iter().step_by(3) {
            let (index, distance) = nearest(&colon, *point);
            let blind_end = index * 6 < last;
            assert!(blind_end || distance > 0.3 * colon.radii[index], "colon {seed}: closed at point {index}");
            let room = radius_about(&colon, index) * 1.25 - 0.5 * settings.wall_thickness;
            assert!(distance < room, "colon {seed}: the lumen reaches beyond the wall at point {index}");
        }
        assert!(nearest(&colon, colon.lumen.eye).1 < 0.01, "the endoscope is in the lumen");
        let wall = colon.mesh.positions.iter().map(|point| point.distance(colon.lumen.eye));
        let gap = wall.fold(f32::INFINITY, f32::min);
        assert!(gap > 0.008, "colon {seed}: the endoscope begins {gap} m from the wall");
        let end = colon.centre_line[last];
        assert!((colon.rim.eye - end).dot(end - colon.rim.target) > 0.0, "the rim is seen from outside");
    }
}

#[test]
fn roots_lie_on_their_side_of_the_wall() {
    let colon = colon(5);
    for (sites, range) in [(&colon.roots, &colon.outer), (&colon.inner_roots, &colon.inner)] {
        let part = colon.mesh.part(range.clone());
        assert_eq!(sites.arterial.len(), sites.venous.len());
        for (artery, vein) in sites.arterial.iter().zip(&sites.venous) {
            let gap = part.positions.iter().map(|point| point.distance(*artery)).fold(f32::INFINITY, f32::min);
            assert!(gap < 0.006, "a root is {gap} m from the wall");
            assert!((0.001..=0.02).contains(&artery.distance(*vein)), "artery and vein belong together");
        }
    }
}

/// The appendix is too thin for vessels of the caecum to find their way along it.
#[test]
fn vessels_supply_the_appendix() {
    for seed in 0..3 {
        let colon = ColonSettings { seed, triangles: 40_000, ..Default::default() }.generate().expect("a colon");
        let outer = colon.mesh.part(colon.outer.clone());
        let mesh = TriangleMesh::new(outer.positions, outer.triangles, None).expect("a mesh");
        let tissue = Arc::new(MeshSurface::new(mesh).expect("a surface"));
        let preset = PresetName::Colon.load();
        let placed = RootPlacements {
            artery: RootPlacement::Nearest(colon.roots.arterial.clone()),
            vein: RootPlacement::Nearest(colon.roots.venous.clone()),
            ..RootPlacements::default()
        };
        let generator = preset.generator_for(tissue.extent());
        let mut growth = generator.start(Arc::clone(&tissue) as _, &placed.into(), seed).expect("a growth");
        growth.run();
        // Up to where it widens to the caecum.
        let end = colon.radii.iter().position(|&radius| radius > 0.006).expect("a caecum");
        let is_near = |point: &Vec3| colon.centre_line[..end].iter().any(|at| at.distance(*point) < 0.006);
        let mut rng = Stream::Statistics.rng(1);
        let samples: Vec<Vec3> =
            (0..200_000).filter_map(|_| tissue.sample(&mut rng)).filter(|point| is_near(point)).collect();
        assert!(samples.len() > 500, "{} samples", samples.len());
        for (kind, least) in [(VesselKind::Artery, 0.9), (VesselKind::Vein, 0.8)] {
            let grown = growth.trees()[kind].expect("a tree");
            let share = statistics::coverage(grown.tree, &samples, 2.0 * grown.reach).expect("samples");
            assert!(share > least, "colon {seed}: {} vessels supply {share} of the appendix", kind.name());
        }
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let cases = [
        ("width", ColonSettings { width: f32::NAN, ..Default::default() }),
        ("calibre", ColonSettings { calibre: 0.2, ..Default::default() }),
        ("wall_thickness", ColonSettings { wall_thickness: 0.0, ..Default::default() }),
        ("haustrum_length", ColonSettings { haustrum_length: -1.0, ..Default::default() }),
        ("haustra_depth", ColonSettings { haustra_depth: f32::INFINITY, ..Default::default() }),
        ("taenia_width", ColonSettings { taenia_width: 0.1, ..Default::default() }),
        ("variation", ColonSettings { variation: 2.0, ..Default::default() }),
        ("triangles", ColonSettings { triangles: 10, ..Default::default() }),
    ];
    for (name, settings) in cases {
        let error = settings.generate().expect_err(name);
        assert_eq!((error.organ, error.name), ("colon", name));
        assert!(error.to_string().contains(name));
    }
    let error = LiverSettings { subdivisions: 20, ..Default::default() }.generate().expect_err("subdivisions");
    assert_eq!(error.name, "subdivisions");
}

#[test]
fn settings_at_their_limits_make_sound_colons() {
    let base = ColonSettings { triangles: 20_000, ..Default::default() };
    let cases = [
        ColonSettings { calibre: 0.25 * base.width, ..base.clone() },
        ColonSettings {
            calibre: 0.04 * base.width,
            haustrum_length: 0.01,
            wall_thickness: 0.001,
            taenia_width: 0.0,
            ..base.clone()
        },
        ColonSettings { variation: 1.5, seed: 77, ..base.clone() },
        ColonSettings { variation: 0.0, haustra_depth: 0.0, ..base.clone() },
        ColonSettings { haustra_depth: 1.2, wall_thickness: 0.15 * base.calibre, ..base.clone() },
        ColonSettings {
            width: 5.0,
            calibre: 0.8,
            wall_thickness: 0.04,
            haustrum_length: 0.4,
            taenia_width: 0.15,
            ..base.clone()
        },
    ];
    for settings in cases {
        let mesh = settings.generate().expect("within limits").mesh;
        assert_sound(&mesh, &format!("{settings:?}"));
    }
}

/// Texels are about as long as wide, and no triangle of the texture is turned over or lies on another's strip.
#[test]
fn the_texture_of_a_colon_is_not_stretched() {
    for seed in SEEDS {
        let mesh = colon(seed).mesh;
        let (mut stretches, mut covered) = (Vec::new(), 0.0);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|corner| mesh.uvs[corner as usize]);
            let [p, q, r] = corners.map(|corner| mesh.positions[corner as usize]);
            let (s, t) = (b - a, c - a);
            let area = s.perp_dot(t);
            covered += 0.5 * area;
            // Along u and along v.
            let (across, along) = ((q - p) * t.y - (r - p) * s.y, (r - p) * s.x - (q - p) * t.x);
            stretches.push(across.length() / along.length());
        }
        stretches.sort_by(f32::total_cmp);
        let median = stretches[stretches.len() / 2];
        assert!((0.5..2.0).contains(&median), "colon {seed}: texels are {median} times as wide as long");
        assert!(covered.abs() > 0.85 && covered.abs() < 1.0, "colon {seed}: strips cover {covered} of the texture");
    }
}
