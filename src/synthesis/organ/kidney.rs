//! The kidney: a procedural bean with a sinus behind its hilum, different for every seed.
//!
//! Smoothly blended ellipsoids make the poles and the middle; smooth cuts make the concave border and, behind the hilum,
//! the sinus, into which artery and vein run and from which the ureter comes. Grooves between the lobes, as before birth,
//! are a setting. The surface is the zero of that field along rays from an inner point, so it is closed and star-shaped
//! by construction, then brought to the size that the settings and the seed give.
//!
//! Sizes: 10 to 13 cm long, 5 to 7 cm wide, 3 to 4 cm thick, in healthy adults (Standring, "Gray's Anatomy", 2020; medians
//! of 11.2 cm on the left and 10.9 cm on the right in Emamian et al., "Kidney dimensions at sonography", American Journal
//! of Roentgenology 160, 1993). Twenty triangular charts, of texels near square, take the texture.
//!
//! ```
//! use bevy_vessels::synthesis::organ::{KidneySettings, Laterality};
//!
//! let kidney = KidneySettings { side: Laterality::Right, lobulation: 1.0, ..Default::default() }.generate()?;
//! // Its hilum faces the middle of the body, which is on the patient's left of it.
//! assert!(kidney.hilum.x > 0.0);
//! # Ok::<(), bevy_vessels::synthesis::organ::OrganSettingsError>(())
//! ```

use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{
        Laterality, OrganSettingsError, RootSites, Viewpoint,
        blob::{Blob, trace, turn_about_z},
        limits, linear, mix,
        noise::Noise,
        smooth_step, star,
    },
    random::{Stream, VesselRng},
};
use bevy_math::Vec3;
use rand::{Rng, RngExt};

/// Settings of a kidney. The same settings give the same mesh, bit for bit.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct KidneySettings {
    /// Chooses a kidney: size, proportions, lobes, surface and colours vary with it.
    ///
    /// Default: 0.
    pub seed: u64,
    /// The side of the body. The hilum faces the other side.
    ///
    /// Default: left.
    pub side: Laterality,
    /// Length from pole to pole, before variation. Width and thickness are in proportion to it.
    ///
    /// Units: metres. Limits: 0.005 to 2. Default: [`Self::DEFAULT_LENGTH`].
    pub length: f32,
    /// Depth of the grooves between the lobes: 0 is the smooth capsule of most adults, 1 that of a newborn.
    ///
    /// Limits: 0 to 1. Default: [`Self::DEFAULT_LOBULATION`].
    pub lobulation: f32,
    /// How far kidneys of different seeds differ in size and shape: at 0 only lobes, surface and colours do.
    ///
    /// Limits: 0 to 1.5. Default: [`Self::DEFAULT_VARIATION`].
    pub variation: f32,
    /// Target number of triangles; the mesh is within a tenth of it.
    ///
    /// Limits: 2,000 to 4,000,000. Default: [`Self::DEFAULT_TRIANGLES`].
    pub triangles: u32,
}

impl KidneySettings {
    /// The median of left kidneys.
    pub const DEFAULT_LENGTH: f32 = 0.112;
    /// A trace of grooves, as on most adults' kidneys.
    pub const DEFAULT_LOBULATION: f32 = 0.1;
    /// The normal variation among adults' kidneys.
    pub const DEFAULT_VARIATION: f32 = 1.0;
    /// Enough for a smooth outline in a picture of the whole organ.
    pub const DEFAULT_TRIANGLES: u32 = 40_000;

    /// Makes the kidney.
    ///
    /// # Errors
    /// A setting outside its limits, by name.
    pub fn generate(&self) -> Result<Kidney, OrganSettingsError> {
        self.validate()?;
        Ok(build(self))
    }

    /// Checks every setting against its limits.
    ///
    /// # Errors
    /// The first value outside its limits.
    pub fn validate(&self) -> Result<(), OrganSettingsError> {
        let check = limits("kidney");
        check("length", self.length, 0.005..=2.0, "0.005 to 2 m")?;
        check("lobulation", self.lobulation, 0.0..=1.0, "0 to 1")?;
        check("variation", self.variation, 0.0..=1.5, "0 to 1.5")?;
        check("triangles", self.triangles as f32, 2_000.0..=4_000_000.0, "2,000 to 4,000,000")
    }
}

impl Default for KidneySettings {
    fn default() -> Self {
        Self {
            seed: 0,
            side: Laterality::Left,
            length: Self::DEFAULT_LENGTH,
            lobulation: Self::DEFAULT_LOBULATION,
            variation: Self::DEFAULT_VARIATION,
            triangles: Self::DEFAULT_TRIANGLES,
        }
    }
}

/// A procedural kidney.
///
/// Axes: x to the patient's left (right in a picture from the front), y along the organ to its upper pole, z to the
/// front. The origin is the middle of its bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Kidney {
    /// The closed surface.
    pub mesh: ShadedMesh,
    /// Where vessels enter: the renal artery and, before and below it, the renal vein, at the floor of the sinus.
    pub roots: RootSites,
    /// The middle of the hilum, the mouth of the sinus, in metres.
    pub hilum: Vec3,
    /// Where the ureter leaves through the hilum, behind and below the vessels, in metres.
    pub ureter: Vec3,
    /// From the front, the whole organ in view of a camera with a vertical field of view of 45°.
    pub front: Viewpoint,
    /// From the middle of the body, into the hilum.
    pub medial: Viewpoint,
    /// From the outer side and behind.
    pub back: Viewpoint,
}

/// Proportions to the length, by which a kidney of 112 mm is 59 mm wide and 35 mm thick.
const WIDTH: f32 = 0.53;
const THICKNESS: f32 = 0.315;
/// Share by which length and proportions vary.
const VARIES: [f32; 3] = [0.055, 0.05, 0.05];

/// An inner point of the model: a right kidney of about 112 mm, in metres, whose x points to the middle of the body.
/// It sees the whole surface.
const MIDDLE: Vec3 = Vec3::new(-0.018, 0.0, 0.0);
/// The mouth of the sinus, and the ureter in it.
const HILUM: Vec3 = Vec3::new(0.024, 0.0, 0.001);
const URETER: Vec3 = Vec3::new(0.026, -0.010, -0.003);
/// Artery and vein at the floor of the sinus, as directions from [`MIDDLE`].
const ARTERY: Vec3 = Vec3::new(1.0, 0.05, -0.02);
const VEIN: Vec3 = Vec3::new(1.0, -0.05, 0.06);

/// Poles and middle, then cuts: centre, radii, turn about z (degrees), blend. The last is the sinus: seen from
/// [`MIDDLE`], it widens all the way to its mouth.
const SHAPES: [([f32; 3], [f32; 3], f32, f32); 5] = [
    ([-0.002, 0.000, 0.000], [0.0285, 0.040, 0.0190], 0.0, 0.0), // middle
    ([0.004, 0.027, 0.000], [0.0260, 0.029, 0.0180], 14.0, 0.016), // upper pole
    ([0.002, -0.028, 0.000], [0.0255, 0.028, 0.0175], -12.0, 0.016), // lower pole
    ([0.044, 0.000, 0.003], [0.0190, 0.021, 0.0400], 0.0, -0.014), // concave border
    ([0.082, 0.000, 0.001], [0.0750, 0.0215, 0.0105], 0.0, -0.0045), // sinus
];

/// Everything that gives a kidney its shape, in the model's frame.
struct Model {
    shapes: Vec<Blob>,
    /// Middles of the lobes.
    lobes: Vec<Vec3>,
    /// Depth of the grooves between them, in metres.
    groove: f32,
    relief: Noise,
    colours: Noise,
}

impl Model {
    /// How near to the surface a ray ends, in metres.
    const TOLERANCE: f32 = 1e-5;
    /// Depth of a newborn's grooves, scaled to the model, and half their width, in metres.
    const DEEPEST_GROOVE: f32 = 0.0024;
    const GROOVE_WIDTH: f32 = 0.0055;
    /// Where grooves end on the way into the sinus, in metres along x.
    const GROOVE_END: [f32; 2] = [0.002, 0.018];
    /// How far the fat of the sinus reaches beyond its wall, in metres.
    const FAT_EDGE: [f32; 2] = [0.0004, 0.0036];

    fn new(settings: &KidneySettings, rng: &mut VesselRng) -> Self {
        let shapes = SHAPES
            .iter()
            .map(|(centre, radii, degrees, blend)| {
                let mut draw = |limit: f32| settings.variation * rng.random_range(-limit..=limit);
                let shift = Vec3::new(draw(0.0015), draw(0.003), draw(0.0006));
                let stretch = Vec3::new(1.0 + draw(0.05), 1.0 + draw(0.06), 1.0 + draw(0.05));
                Blob {
                    centre: Vec3::from_array(*centre) + shift,
                    radii: Vec3::from_array(*radii) * stretch,
                    turn: turn_about_z(degrees + draw(5.0)),
                    blend: *blend,
                }
            })
            .collect();
        Self {
            shapes,
            lobes: lobes(rng),
            groove: settings.lobulation * Self::DEEPEST_GROOVE,
            relief: Noise::new(rng.next_u32()),
            colours: Noise::new(rng.next_u32()),
        }
    }

    /// Approximate distance to the surface without relief, in metres; negative inside.
    fn at(&self, point: Vec3) -> f32 {
        self.shapes.iter().fold(f32::INFINITY, |field, shape| shape.applied(field, point))
    }

    /// The surface along a unit direction from the middle.
    fn surface(&self, direction: Vec3) -> Vec3 {
        let point = MIDDLE + direction * trace(|point| self.at(point), MIDDLE, direction, Self::TOLERANCE);
        let relief = 0.0005 * self.relief.rough(point / 0.02) - self.groove * self.grooved(point);
        point + direction * relief
    }

    /// How far a point lies in a groove: 0 on a lobe, 1 between two.
    fn grooved(&self, point: Vec3) -> f32 {
        let (mut nearest, mut second) = (f32::INFINITY, f32::INFINITY);
        for lobe in &self.lobes {
            let distance = lobe.distance(point);
            second = second.min(nearest.max(distance));
            nearest = nearest.min(distance);
        }
        let [start, end] = Self::GROOVE_END;
        let across = 1.0 - smooth_step(0.0, Self::GROOVE_WIDTH, second - nearest);
        across * (1.0 - smooth_step(start, end, point.x))
    }

    fn colour(&self, point: Vec3) -> [f32; 4] {
        let mottle = self.colours.rough(point / 0.016);
        let capsule = mix(linear([134, 58, 48]), linear([158, 76, 62]), 0.5 + 0.5 * mottle);
        let fine = mix(capsule, linear([104, 38, 36]), 0.28 * (0.3 + self.colours.rough(point / 0.004)));
        let depth = self.groove / Self::DEEPEST_GROOVE;
        let grooved = mix(fine, linear([112, 44, 42]), 0.7 * depth * self.grooved(point));
        let [near, far] = Self::FAT_EDGE;
        let sinus = self.shapes.last().map_or(f32::INFINITY, |sinus| sinus.distance(point));
        let fat = mix(linear([222, 186, 118]), linear([206, 160, 104]), 0.5 + 0.5 * mottle);
        mix(fat, grooved, smooth_step(near, far, sinus))
    }
}

/// Middles of 10 to 14 lobes: a row in front, one behind, and the two poles.
fn lobes(rng: &mut VesselRng) -> Vec<Vec3> {
    let mut lobes = vec![Vec3::new(0.002, 0.052, 0.0), Vec3::new(0.002, -0.052, 0.0)];
    for z in [0.016, -0.016] {
        let row = rng.random_range(4..=6usize);
        let height = |place: usize| 0.042 * ((2 * place + 1) as f32 / row as f32 - 1.0);
        lobes.extend((0..row).map(|place| Vec3::new(-0.008, height(place), z)));
    }
    for lobe in &mut lobes {
        let mut jitter = || rng.random_range(-0.003..=0.003);
        *lobe += Vec3::new(jitter(), jitter(), jitter());
    }
    lobes
}

fn build(settings: &KidneySettings) -> Kidney {
    let mut rng = Stream::Organ.rng(settings.seed);
    let vary = VARIES.map(|limit| 1.0 + settings.variation * rng.random_range(-limit..=limit));
    let length = settings.length * vary[0];
    let size = length * Vec3::new(WIDTH * vary[1], 1.0, THICKNESS * vary[2]);
    let model = Model::new(settings, &mut rng);
    // The model is mirrored, not the mesh, so that neither triangles nor the texture are.
    let mirror = Vec3::new(settings.side.medial(), 1.0, 1.0);
    let surface = |direction: Vec3| mirror * model.surface(mirror * direction);
    let parts = star::parts_for(settings.triangles);
    let mut mesh = star::mesh(parts, mirror * MIDDLE, surface, |point| model.colour(mirror * point));

    let (low, high) = mesh.bounds();
    let stretch = size / (high - low);
    let fitted = |point: Vec3| (point - 0.5 * (low + high)) * stretch;
    mesh.positions.iter_mut().for_each(|point| *point = fitted(*point));
    // Normals of a stretched surface are shrunk where it is stretched.
    mesh.normals.iter_mut().for_each(|normal| *normal = (*normal / stretch).normalize_or(Vec3::Y));

    let on_surface = |direction: Vec3| fitted(surface(mirror * direction.normalize()));
    let hilum = fitted(mirror * HILUM);
    let look = |from: Vec3| Viewpoint { eye: from.normalize() * (1.5 * length), target: Vec3::ZERO, up: Vec3::Y };
    let medial = settings.side.medial();
    Kidney {
        roots: RootSites { arterial: vec![on_surface(ARTERY)], venous: vec![on_surface(VEIN)], ..RootSites::default() },
        hilum,
        ureter: fitted(mirror * URETER),
        front: look(Vec3::new(0.25 * medial, 0.1, 1.0)),
        medial: look(Vec3::new(medial, 0.1, 0.35)),
        back: look(Vec3::new(-0.6 * medial, 0.1, -1.0)),
        mesh,
    }
}
