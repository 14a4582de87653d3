//! The liver: a procedural lobed wedge, different for every seed.
//!
//! Smoothly blended ellipsoids make the right, left, caudate and quadrate lobes; smooth cuts make the hollows of the
//! kidney, the stomach and the gall bladder on the underside, the porta hepatis and the notch of the falciform
//! ligament. The surface is the zero of that field along rays from an inner point, found by sphere tracing, on an
//! icosphere whose vertices are then evened out. So it is closed and star-shaped by construction.
//!
//! UVs are the rays' longitude and latitude: good for mottling, not for baking (they meet at two poles and wrap once).

use crate::synthesis::random::{Stream, VesselRng};
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{OrganSettingsError, RootSites, Viewpoint, linear, mix, noise::Noise},
};
use bevy_math::{Quat, Vec2, Vec3, ops};
use rand::{Rng, RngExt};
use std::collections::BTreeMap;

/// Settings of a liver. The same settings give the same mesh, bit for bit.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct LiverSettings {
    /// Chooses a liver: lobes, hollows, surface and colours vary with it.
    ///
    /// Default: 0.
    pub seed: u64,
    /// Width from the right to the left lobe's end, before variation.
    ///
    /// Units: metres. Limits: 0.01 to 5. Default: [`Self::DEFAULT_WIDTH`].
    pub width: f32,
    /// How far livers of different seeds differ in shape.
    ///
    /// Limits: 0 to 1.5. Default: [`Self::DEFAULT_VARIATION`].
    pub variation: f32,
    /// Number of times that the icosahedron's triangles are divided in four: the mesh has 20·4ⁿ triangles.
    ///
    /// Limits: 2 to 8. Default: [`Self::DEFAULT_SUBDIVISIONS`].
    pub subdivisions: u32,
}

impl LiverSettings {
    /// Within the 20 to 26 cm of an adult's liver.
    pub const DEFAULT_WIDTH: f32 = 0.24;
    /// The normal variation among adults' livers.
    pub const DEFAULT_VARIATION: f32 = 1.0;
    /// 20,480 triangles, which look round; 6 would give 81,920.
    pub const DEFAULT_SUBDIVISIONS: u32 = 5;

    /// Makes the liver.
    ///
    /// # Errors
    /// A setting outside its limits, by name.
    pub fn generate(&self) -> Result<Liver, OrganSettingsError> {
        self.validate()?;
        Ok(build(self))
    }

    /// Checks every setting against its limits.
    ///
    /// # Errors
    /// The first value outside its limits.
    pub fn validate(&self) -> Result<(), OrganSettingsError> {
        let check = |name, value: f32, range: std::ops::RangeInclusive<f32>, limits| {
            if range.contains(&value) {
                Ok(())
            } else {
                Err(OrganSettingsError { organ: "liver", name, value, limits })
            }
        };
        check("width", self.width, 0.01..=5.0, "0.01 to 5 m")?;
        check("variation", self.variation, 0.0..=1.5, "0 to 1.5")?;
        check("subdivisions", self.subdivisions as f32, 2.0..=8.0, "2 to 8")
    }
}

impl Default for LiverSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            width: Self::DEFAULT_WIDTH,
            variation: Self::DEFAULT_VARIATION,
            subdivisions: Self::DEFAULT_SUBDIVISIONS,
        }
    }
}

/// A procedural liver.
///
/// Axes: x to the patient's left (right in a picture from the front), y up, z to the front.
#[derive(Clone, Debug, PartialEq)]
pub struct Liver {
    /// The closed surface.
    pub mesh: ShadedMesh,
    /// Where vessels enter: the hepatic artery and portal vein at the porta hepatis (arterial), and the hepatic veins
    /// at the back, where they leave for the inferior vena cava (venous).
    pub roots: RootSites,
    /// From the front, the whole organ in view of a camera with a vertical field of view of 45°.
    pub front: Viewpoint,
    /// From below and behind, on the porta hepatis and the hollows.
    pub underside: Viewpoint,
}

/// Width of the shapes below, in metres.
const MODEL_WIDTH: f32 = 0.24;
/// An inner point that sees the whole surface.
const MIDDLE: Vec3 = Vec3::new(-0.015, 0.008, 0.0);
/// The porta hepatis, on the underside, and the vena cava's groove at the back, as directions from [`MIDDLE`].
const PORTA: Vec3 = Vec3::new(0.1, -0.8, -0.45);
const VENA_CAVA: Vec3 = Vec3::new(0.25, 0.55, -0.8);

/// An ellipsoid that is added to the liver or cut from it.
struct Blob {
    centre: Vec3,
    radii: Vec3,
    turn: Quat,
    /// Distance over which it blends with the rest, in metres; below 0 it is cut out.
    blend: f32,
}

impl Blob {
    /// Approximate distance to the ellipsoid's surface, in metres; negative inside.
    fn distance(&self, point: Vec3) -> f32 {
        let local = self.turn * (point - self.centre);
        let scaled = (local / self.radii).length();
        let gradient = (local / (self.radii * self.radii)).length();
        scaled * (scaled - 1.0) / gradient.max(1e-6)
    }
}

/// Lobes first, then cuts: centre, radii, turn about z (degrees), blend.
const SHAPES: [([f32; 3], [f32; 3], f32, f32); 11] = [
    ([-0.052, 0.008, -0.006], [0.068, 0.072, 0.058], 0.0, 0.0), // right lobe
    ([-0.070, -0.036, 0.006], [0.046, 0.058, 0.042], 0.0, 0.03), // its lower part
    ([0.014, 0.030, 0.008], [0.074, 0.046, 0.044], 6.0, 0.03),  // middle
    ([0.074, 0.044, 0.012], [0.058, 0.030, 0.032], 4.0, 0.03),  // left lobe
    ([-0.004, -0.010, 0.026], [0.032, 0.034, 0.024], 0.0, 0.02), // quadrate lobe
    ([0.012, 0.010, -0.032], [0.022, 0.028, 0.018], 0.0, 0.012), // caudate lobe
    ([0.088, -0.036, -0.030], [0.070, 0.060, 0.054], 16.0, -0.02), // stomach
    ([-0.060, -0.078, -0.066], [0.050, 0.062, 0.046], 0.0, -0.022), // kidney
    ([-0.004, -0.060, -0.022], [0.024, 0.040, 0.018], 0.0, -0.014), // porta hepatis
    ([-0.032, -0.088, 0.046], [0.016, 0.040, 0.020], -12.0, -0.012), // gall bladder
    ([0.030, -0.004, 0.070], [0.010, 0.050, 0.022], 6.0, -0.016), // falciform notch
];

struct Field {
    shapes: Vec<Blob>,
    relief: Noise,
}

impl Field {
    /// Most steps along a ray, and the distance to the surface at which it ends, in metres.
    const TRACE_STEPS: usize = 48;
    const TRACE_TOLERANCE: f32 = 2e-5;

    fn new(variation: f32, rng: &mut VesselRng) -> Self {
        let shapes = SHAPES
            .iter()
            .map(|(centre, radii, degrees, blend)| {
                let mut draw = |limit: f32| variation * rng.random_range(-limit..=limit);
                let shift = Vec3::new(draw(0.006), draw(0.006), draw(0.005));
                let stretch = Vec3::new(1.0 + draw(0.1), 1.0 + draw(0.1), 1.0 + draw(0.08));
                Blob {
                    centre: Vec3::from_array(*centre) + shift,
                    radii: Vec3::from_array(*radii) * stretch,
                    turn: turn_about_z(degrees + draw(8.0)),
                    blend: *blend,
                }
            })
            .collect();
        Self { shapes, relief: Noise::new(rng.next_u32()) }
    }

    /// Approximate distance to the liver's surface in metres, negative inside.
    fn at(&self, point: Vec3) -> f32 {
        let mut field = f32::INFINITY;
        for shape in &self.shapes {
            let distance = shape.distance(point);
            field = if shape.blend < 0.0 {
                -smooth_min(-field, distance, -shape.blend)
            } else {
                smooth_min(field, distance, shape.blend)
            };
        }
        field
    }

    /// The surface along a unit direction from the middle, found by sphere tracing from inside.
    fn surface(&self, direction: Vec3) -> Vec3 {
        let mut reach = 0.01;
        for _ in 0..Self::TRACE_STEPS {
            let field = self.at(MIDDLE + direction * reach);
            if field > -Self::TRACE_TOLERANCE {
                break;
            }
            reach -= 0.8 * field;
        }
        let point = MIDDLE + direction * reach;
        point + direction * (0.0012 * self.relief.rough(point / 0.03))
    }
}

fn turn_about_z(degrees: f32) -> Quat {
    let half = -0.5 * degrees.to_radians();
    Quat::from_xyzw(0.0, 0.0, ops::sin(half), ops::cos(half))
}

/// Smooth minimum of two numbers, blended if they are within `blend` of each other.
fn smooth_min(a: f32, b: f32, blend: f32) -> f32 {
    let near = (blend - (a - b).abs()).max(0.0) / blend.max(f32::MIN_POSITIVE);
    a.min(b) - 0.25 * near * near * blend
}

fn build(settings: &LiverSettings) -> Liver {
    let mut rng = Stream::Organ.rng(settings.seed);
    let field = Field::new(settings.variation, &mut rng);
    let colours = Noise::new(rng.next_u32());
    let scale = settings.width / MODEL_WIDTH;
    let surface = |direction: Vec3| field.surface(direction);

    let (mut directions, triangles) = icosphere(settings.subdivisions);
    even_out(&mut directions, &triangles, &surface);
    let positions: Vec<Vec3> = directions.iter().map(|&direction| surface(direction)).collect();
    let (colors, uvs) =
        directions.iter().zip(&positions).map(|(&ray, &point)| (colour(point, colours), chart(ray))).unzip();
    let mut mesh = ShadedMesh {
        positions: positions.iter().map(|point| point * scale).collect(),
        normals: Vec::new(),
        uvs,
        colors,
        triangles,
    };
    let own: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    mesh.compute_normals(&own);

    let porta = surface(PORTA.normalize()) * scale;
    let cava = surface(VENA_CAVA.normalize()) * scale;
    let (low, high) = mesh.bounds();
    let centre = 0.5 * (low + high);
    let away = 1.6 * (high.x - low.x);
    let look = |from: Vec3| Viewpoint { eye: centre + from.normalize() * away, target: centre, up: Vec3::Y };
    Liver {
        roots: RootSites { arterial: vec![porta], venous: vec![cava] },
        front: look(Vec3::new(0.12, 0.12, 1.0)),
        underside: look(Vec3::new(0.1, -0.9, -0.8)),
        mesh,
    }
}

fn colour(point: Vec3, noise: Noise) -> [f32; 4] {
    let base = mix(linear([122, 44, 36]), linear([150, 64, 50]), 0.5 + 0.5 * noise.rough(point / 0.03));
    mix(base, linear([96, 30, 28]), 0.3 * (0.3 + noise.rough(point / 0.007)))
}

fn chart(direction: Vec3) -> Vec2 {
    use std::f32::consts::{PI, TAU};
    let longitude = ops::atan2(direction.x, direction.z) / TAU + 0.5;
    Vec2::new(longitude, ops::acos(direction.y.clamp(-1.0, 1.0)) / PI)
}

/// Moves the rays so that the triangles on the surface become more equal, by a few rounds of Laplacian smoothing.
fn even_out(directions: &mut [Vec3], triangles: &[[u32; 3]], surface: &impl Fn(Vec3) -> Vec3) {
    const ROUNDS: usize = 4;
    let mut sums = vec![(Vec3::ZERO, 0.0f32); directions.len()];
    for _ in 0..ROUNDS {
        let points: Vec<Vec3> = directions.iter().map(|&direction| surface(direction)).collect();
        sums.fill((Vec3::ZERO, 0.0));
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let area = (b - a).cross(c - a).length();
            for corner in corners {
                let sum = &mut sums[*corner as usize];
                sum.0 += (a + b + c) / 3.0 * area;
                sum.1 += area;
            }
        }
        for ((direction, point), (sum, weight)) in directions.iter_mut().zip(&points).zip(&sums) {
            let target = point.lerp(*sum / weight.max(f32::MIN_POSITIVE), 0.7);
            *direction = (target - MIDDLE).normalize_or(*direction);
        }
    }
}

/// Unit vectors and triangles of a subdivided icosahedron, wound counter-clockwise from outside.
fn icosphere(subdivisions: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0f32.sqrt());
    let mut points: Vec<Vec3> = [[0.0, 1.0, golden], [0.0, -1.0, golden], [0.0, 1.0, -golden], [0.0, -1.0, -golden]]
        .iter()
        .flat_map(|&[a, b, c]| [Vec3::new(a, b, c), Vec3::new(b, c, a), Vec3::new(c, a, b)])
        .map(Vec3::normalize)
        .collect();
    let mut triangles = icosahedron_faces(&points);
    for _ in 0..subdivisions {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (points, triangles)
}

/// The 20 triples of neighbours among an icosahedron's vertices, turned outward.
fn icosahedron_faces(points: &[Vec3]) -> Vec<[u32; 3]> {
    let near = |a: usize, b: usize| points[a].distance_squared(points[b]) < 1.2;
    let mut faces = Vec::with_capacity(20);
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = points[a].dot(points[b].cross(points[c])) > 0.0;
                    let [a, b, c] = [a, b, c].map(|index| index as u32);
                    faces.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    faces
}
