//! A hundred of each procedural organ: sound, human-sized, all different, and the same from the same seed.

use bevy_math::{Vec2, Vec3};
use bevy_vessels::synthesis::{
    mesh::{Closure, ShadedMesh, self_intersections},
    organ::{ColonSettings, Eye, EyeSettings, Kidney, KidneySettings, LiverSettings},
};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

const SEEDS: std::ops::Range<u64> = 0..100;

fn eye(seed: u64) -> Eye {
    EyeSettings { seed, triangles: 6_000, ..Default::default() }.generate().expect("within limits")
}

fn kidney(seed: u64) -> Kidney {
    KidneySettings { seed, triangles: 5_000, lobulation: (seed % 3) as f32 / 2.0, ..Default::default() }
        .generate()
        .expect("within limits")
}

fn liver(seed: u64) -> ShadedMesh {
    LiverSettings { seed, subdivisions: 4, ..Default::default() }.generate().expect("within limits").mesh
}

fn colon(seed: u64) -> ShadedMesh {
    ColonSettings { seed, ..Default::default() }.generate().expect("within limits").mesh
}

/// Triangles between vertices of which no two are at one place.
fn welded(mesh: &ShadedMesh) -> Vec<[u32; 3]> {
    let mut first = BTreeMap::new();
    let place = |point: &Vec3| point.to_array().map(|value| (value + 0.0).to_bits());
    let owners: Vec<u32> =
        (0..).zip(&mesh.positions).map(|(vertex, point)| *first.entry(place(point)).or_insert(vertex)).collect();
    mesh.triangles.iter().map(|corners| corners.map(|corner| owners[corner as usize])).collect()
}

/// Checks all that a renderer and a bake need. `euler` is 2 for a solid; a mesh with another one is open.
fn assert_sound(mesh: &ShadedMesh, euler: i64, name: &str) {
    let count = mesh.positions.len();
    assert_eq!([mesh.normals.len(), mesh.uvs.len(), mesh.colors.len()], [count; 3], "{name}");
    assert!(mesh.positions.iter().all(|point| point.is_finite()), "{name}: a position is not finite");
    assert!(mesh.normals.iter().all(|normal| normal.is_normalized()), "{name}: a normal is no unit vector");
    assert!(mesh.colors.iter().flatten().all(|channel| (0.0..=1.0).contains(channel)), "{name}: a colour");
    let triangles = welded(mesh);
    let closure = Closure::of(&mesh.positions, &triangles);
    assert_eq!((closure.euler(), closure.components, closure.degenerate_faces), (euler, 1, 0), "{name}: {closure:?}");
    assert!(closure.is_oriented() && closure.is_manifold(), "{name}: {closure:?}");
    assert_eq!(closure.is_closed(), euler == 2, "{name}: {closure:?}");
    assert_eq!(self_intersections(&mesh.positions, &triangles), [[0; 2]; 0], "{name}: it meets itself");
    if euler == 2 {
        assert!(mesh.signed_volume() > 0.0, "{name}: inside out");
    }
    assert_texture(mesh, name);
}

/// Checks that no two charts, and no two triangles of one, lie on each other, and that none is mirrored or a sliver.
fn assert_texture(mesh: &ShadedMesh, name: &str) {
    let within = |uv: &Vec2| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all();
    assert!(mesh.uvs.iter().all(within), "{name}: a place outside of the texture");
    let flat: Vec<Vec3> = mesh.uvs.iter().map(|uv| uv.extend(0.0)).collect();
    assert_eq!(self_intersections(&flat, &mesh.triangles), [[0; 2]; 0], "{name}: charts overlap");
    let sides = mesh.triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|corner| mesh.uvs[corner as usize]);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        (b - a).perp_dot(c - a) / longest
    });
    let (least, most) =
        sides.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), side| (low.min(side), high.max(side)));
    assert!(least * most > 0.0, "{name}: a chart is mirrored");
    assert!(least.abs().min(most.abs()) > 0.02, "{name}: a sliver of texels");
}

fn assert_size(mesh: &ShadedMesh, millimetres: [RangeInclusive<f32>; 3], name: &str) {
    let (low, high) = mesh.bounds();
    let size = 1e3 * (high - low);
    for (axis, range) in millimetres.into_iter().enumerate() {
        assert!(range.contains(&size[axis]), "{name} is {size} mm, not within {range:?} along axis {axis}");
    }
}

/// The number of different meshes.
fn different(meshes: impl Iterator<Item = ShadedMesh>) -> usize {
    let bits = |mesh: ShadedMesh| mesh.positions.iter().map(|point| point.to_array().map(f32::to_bits)).collect();
    meshes.map(bits).collect::<BTreeSet<Vec<[u32; 3]>>>().len()
}

#[test]
fn a_hundred_eyes_are_sound_and_human() {
    for seed in SEEDS {
        let (eye, name) = (eye(seed), format!("eye {seed}"));
        assert_sound(&eye.globe, 2, &format!("{name}, globe"));
        assert_sound(&eye.cornea, 2, &format!("{name}, cornea"));
        assert_sound(&eye.iris, 0, &format!("{name}, iris"));
        // Bekerman, Gottlieb & Vaiman (2014): 24.2 mm wide, 23.7 mm high, with a deviation of a millimetre.
        assert_size(&eye.globe, [22.8..=25.6, 22.3..=25.1, 21.0..=25.0], &name);
        let axial = 1e3 * eye.axial_length;
        assert!((22.0..=24.8).contains(&axial), "{name}: {axial} mm long");
        let front = eye.cornea.bounds().1.z;
        let (middle, radius) = eye.limbus;
        assert!((10.7..=12.6).contains(&(2e3 * radius)), "{name}: a cornea of {} mm", 2e3 * radius);
        let bulge = 1e3 * (front - middle.z);
        assert!((2.0..=3.3).contains(&bulge), "{name}: the cornea rises {bulge} mm");
        let open = 1e3 * eye.iris.positions.iter().map(|at| at.truncate().length()).fold(f32::INFINITY, f32::min);
        assert!((open - 2.0).abs() < 0.01, "{name}: a pupil of {open} mm");
        // The iris lies between cornea and globe.
        let iris = eye.iris.bounds();
        assert!(iris.1.z < middle.z && iris.0.z > middle.z - 0.003, "{name}: {iris:?}");
    }
    assert_eq!(different(SEEDS.map(|seed| eye(seed).globe)), 100);
    assert_eq!(eye(41), eye(41));
}

#[test]
fn a_hundred_kidneys_are_sound_and_human() {
    for seed in SEEDS {
        let (kidney, name) = (kidney(seed), format!("kidney {seed}"));
        assert_sound(&kidney.mesh, 2, &name);
        assert_size(&kidney.mesh, [50.0..=70.0, 100.0..=130.0, 30.0..=40.0], &name);
        let millilitres = 1e6 * kidney.mesh.signed_volume();
        assert!((80.0..=200.0).contains(&millilitres), "{name} has {millilitres} mL");
    }
    assert_eq!(different(SEEDS.map(|seed| kidney(seed).mesh)), 100);
    assert_eq!(kidney(41), kidney(41));
}

#[test]
fn a_hundred_livers_are_sound_and_human() {
    for seed in SEEDS {
        let (liver, name) = (liver(seed), format!("liver {seed}"));
        assert_sound(&liver, 2, &name);
        assert_size(&liver, [200.0..=280.0, 120.0..=200.0, 90.0..=150.0], &name);
        let litres = 1e3 * liver.signed_volume();
        assert!((1.0..=2.3).contains(&litres), "{name} has {litres} L");
    }
    assert_eq!(different(SEEDS.map(liver)), 100);
    assert_eq!(liver(41), liver(41));
}

#[test]
fn a_hundred_colons_are_sound_and_human() {
    for seed in SEEDS {
        let (colon, name) = (colon(seed), format!("colon {seed}"));
        assert_sound(&colon, 2, &name);
        assert_size(&colon, [250.0..=400.0, 280.0..=550.0, 80.0..=250.0], &name);
    }
    assert_eq!(different(SEEDS.map(colon)), 100);
    assert_eq!(colon(41), colon(41));
}

/// Chords cut the corners of folds: those of both sides of the thin wall have to cut them alike.
#[test]
fn the_walls_of_coarse_colons_do_not_meet() {
    for (triangles, seed) in [12_000, 30_000].into_iter().flat_map(|size| SEEDS.map(move |seed| (size, seed))) {
        let colon = ColonSettings { seed, triangles, ..Default::default() }.generate().expect("within limits");
        let (mesh, name) = (&colon.mesh, format!("colon {seed} of {triangles} triangles"));
        let all = welded(mesh);
        let closure = Closure::of(&mesh.positions, &all);
        assert!(closure.is_closed() && closure.is_oriented() && closure.is_manifold(), "{name}: {closure:?}");
        assert_eq!(closure.euler(), 2, "{name}");
        assert_eq!(self_intersections(&mesh.positions, &all), [[0; 2]; 0], "{name}: it meets itself");
        let share = mesh.triangles.len() as f32 / triangles as f32;
        assert!((0.9..1.1).contains(&share), "{name}: {}", mesh.triangles.len());
    }
}

/// As users get them: the finer mesh follows sharper creases.
#[test]
fn organs_of_the_default_size_are_sound() {
    for seed in 0..3 {
        let eye = EyeSettings { seed, ..Default::default() }.generate().expect("within limits");
        for (mesh, euler) in [(&eye.globe, 2), (&eye.cornea, 2), (&eye.iris, 0)] {
            assert_sound(mesh, euler, &format!("eye {seed}"));
        }
        let all = [&eye.globe, &eye.cornea, &eye.iris].map(|mesh| mesh.triangles.len()).iter().sum::<usize>();
        assert!((54_000..=66_000).contains(&all), "eye {seed} has {all} triangles");
        let kidney = KidneySettings { seed, lobulation: 1.0, ..Default::default() }.generate().expect("within limits");
        assert_sound(&kidney.mesh, 2, &format!("kidney {seed}"));
        assert!((36_000..=44_000).contains(&kidney.mesh.triangles.len()));
        let liver = LiverSettings { seed, ..Default::default() }.generate().expect("within limits");
        assert_sound(&liver.mesh, 2, &format!("liver {seed}"));
    }
}
