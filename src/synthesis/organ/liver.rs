//! The liver: a procedural lobed wedge, different for every seed.
//!
//! Smoothly blended ellipsoids make the right, left, caudate and quadrate lobes; smooth cuts make the hollows of the
//! kidney, the stomach and the gall bladder on the underside, the fissures between the lobes, and the groove of the vena
//! cava. The surface is the zero of that field along rays from an inner point, so it is closed and star-shaped by
//! construction.
//!
//! Sizes, from anatomy texts and ultrasound: 20 to 26 cm wide, 15 to 17.5 cm high in all, 10 to 12.5 cm from front to
//! back, 1.1 to 2 L (Standring, "Gray's Anatomy", 2020; Kratzer et al., "Factors affecting liver size", Journal of
//! Ultrasound in Medicine 22, 2003). Twenty triangular charts, of texels near square, take the texture.

use crate::synthesis::random::{Stream, VesselRng};
use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{
        OrganSettingsError, RootSites, Viewpoint,
        blob::{Blob, trace, turn_about_z},
        limits, linear, mix,
        noise::Noise,
        star,
    },
};
use bevy_math::Vec3;
use rand::{Rng, RngExt};

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
        let check = limits("liver");
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
    /// Where vessels enter. At the porta hepatis, on the underside: the hepatic artery, behind it the portal vein, and the
    /// bile duct to its right. At the back, where the vena cava lies in its groove: the right, middle and left hepatic
    /// veins.
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
/// Places as directions from [`MIDDLE`]: hepatic artery, portal vein and bile duct at the porta hepatis, on the underside;
/// right, middle and left hepatic veins at the upper end of the vena cava's groove, at the back.
const ARTERY: Vec3 = Vec3::new(0.16, -0.8, -0.38);
const PORTAL_VEIN: Vec3 = Vec3::new(0.08, -0.8, -0.56);
const DUCT: Vec3 = Vec3::new(-0.04, -0.8, -0.38);
const HEPATIC_VEINS: [Vec3; 3] =
    [Vec3::new(0.05, 0.62, -0.78), Vec3::new(0.23, 0.6, -0.76), Vec3::new(0.36, 0.62, -0.68)];

/// Lobes first, then cuts: centre, radii, turn about z (degrees), blend.
const SHAPES: [([f32; 3], [f32; 3], f32, f32); 13] = [
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
    ([0.036, -0.014, 0.024], [0.006, 0.016, 0.040], 62.0, -0.010), // fissure of the round ligament
    ([-0.006, 0.030, -0.064], [0.013, 0.070, 0.018], -6.0, -0.012), // groove of the vena cava
];

struct Field {
    shapes: Vec<Blob>,
    relief: Noise,
}

impl Field {
    /// How near to the surface a ray ends, in metres.
    const TOLERANCE: f32 = 2e-5;

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
        self.shapes.iter().fold(f32::INFINITY, |field, shape| shape.applied(field, point))
    }

    /// The surface along a unit direction from the middle.
    fn surface(&self, direction: Vec3) -> Vec3 {
        let point = MIDDLE + direction * trace(|point| self.at(point), MIDDLE, direction, Self::TOLERANCE);
        point + direction * (0.0012 * self.relief.rough(point / 0.03))
    }
}

fn build(settings: &LiverSettings) -> Liver {
    let mut rng = Stream::Organ.rng(settings.seed);
    let field = Field::new(settings.variation, &mut rng);
    let colours = Noise::new(rng.next_u32());
    let scale = settings.width / MODEL_WIDTH;
    let surface = |direction: Vec3| field.surface(direction);
    let mut mesh = star::mesh(1 << settings.subdivisions, MIDDLE, surface, |point| colour(point, colours));
    mesh.positions.iter_mut().for_each(|point| *point *= scale);

    let place = |direction: Vec3| surface(direction.normalize()) * scale;
    let (low, high) = mesh.bounds();
    let centre = 0.5 * (low + high);
    let away = 1.6 * (high.x - low.x);
    let look = |from: Vec3| Viewpoint { eye: centre + from.normalize() * away, target: centre, up: Vec3::Y };
    Liver {
        roots: RootSites {
            arterial: vec![place(ARTERY)],
            venous: HEPATIC_VEINS.map(place).to_vec(),
            portal: vec![place(PORTAL_VEIN)],
            ductal: vec![place(DUCT)],
        },
        front: look(Vec3::new(0.12, 0.12, 1.0)),
        underside: look(Vec3::new(0.1, -0.9, -0.8)),
        mesh,
    }
}

fn colour(point: Vec3, noise: Noise) -> [f32; 4] {
    let base = mix(linear([122, 44, 36]), linear([150, 64, 50]), 0.5 + 0.5 * noise.rough(point / 0.03));
    mix(base, linear([96, 30, 28]), 0.3 * (0.3 + noise.rough(point / 0.007)))
}
