//! The eye: a procedural eyeball with cornea and iris, different for every seed.
//!
//! The eyeball is closed: the sclera with the stump of the optic nerve at its nasal side, and at the front a dark dish
//! behind the iris. The cornea is a clear shell with its own, smaller radius of curvature, for a transparent material;
//! the iris is a disc with the pupil in it. Each is a mesh of its own, with its own texture: draw all three at one place.
//!
//! Two groups of vessels reach the white of the eye: fine ones of the conjunctiva from the fornices and the corners, and
//! anterior ciliary ones from the insertions of the four straight muscles. Those of the retina come with the optic nerve.
//! Muscles insert 5.5 mm (medial), 6.5 mm (inferior), 6.9 mm (lateral) and 7.7 mm (superior) behind the limbus (Apt, "An
//! anatomical reevaluation of rectus muscle insertions", Transactions of the American Ophthalmological Society 78, 1980).
//!
//! ```
//! use bevy_vessels::synthesis::organ::{EyeSettings, IrisColor};
//!
//! let eye = EyeSettings { seed: 7, iris: Some(IrisColor::Green), triangles: 20_000, ..Default::default() }.generate()?;
//! let conjunctiva = eye.globe.part(eye.conjunctiva.clone());
//! assert!(conjunctiva.triangles.len() < eye.globe.triangles.len());
//! # Ok::<(), bevy_vessels::synthesis::organ::OrganSettingsError>(())
//! ```

mod cornea;
mod globe;
mod iris;
mod settings;
mod shape;

pub use settings::{EyeSettings, IrisColor};

use crate::synthesis::{
    mesh::ShadedMesh,
    organ::{Laterality, OrganSettingsError, RootSites, Viewpoint, noise::Noise},
    random::{Stream, VesselRng},
};
use bevy_math::Vec3;
use rand::{Rng, RngExt};
use shape::Shape;
use std::{f32::consts::PI, ops::Range};

/// A procedural eye.
///
/// Axes: x to the patient's left (right in a picture from the front), y up, z to the front, along the optical axis. The
/// origin is the middle of the eyeball.
#[derive(Clone, Debug, PartialEq)]
pub struct Eye {
    /// The eyeball, closed: sclera, nerve and the dish behind the iris.
    pub globe: ShadedMesh,
    /// The triangles of the eyeball that the conjunctiva covers, from the limbus to beyond the equator.
    pub conjunctiva: Range<usize>,
    /// The cornea, a closed shell, for a transparent material.
    pub cornea: ShadedMesh,
    /// The iris with the pupil: open, facing front.
    pub iris: ShadedMesh,
    /// Colour of the iris.
    pub iris_color: IrisColor,
    /// Side of the body.
    pub side: Laterality,
    /// From the apex of the cornea to the back of the eyeball, in metres, without the optic nerve.
    pub axial_length: f32,
    /// Middle of the limbus, in metres, and its radius. Its plane is square to the optical axis.
    pub limbus: (Vec3, f32),
    /// Where vessels of the conjunctiva come from fornices and corners: at 8 to 12 places.
    pub roots: RootSites,
    /// Where the seven anterior ciliary arteries come through the sclera: two at each straight muscle, one at the lateral.
    pub ciliary_roots: RootSites,
    /// Where the central vessels of the retina enter, in the middle of the optic nerve.
    pub retinal_roots: RootSites,
    /// From the front, the whole eyeball in view of a camera with a vertical field of view of 45°.
    pub front: Viewpoint,
    /// From the front, the temple and above.
    pub three_quarter: Viewpoint,
    /// From the temple.
    pub lateral: Viewpoint,
}

impl EyeSettings {
    /// Makes the eye.
    ///
    /// # Errors
    /// A setting outside its limits, by name.
    pub fn generate(&self) -> Result<Eye, OrganSettingsError> {
        self.validate()?;
        Ok(build(self))
    }
}

/// Shares of the triangles for the cornea and the iris.
const CORNEA: f32 = 0.12;
const IRIS: f32 = 0.25;
/// Distances of muscles behind the limbus, as shares of the axial length: medial, superior, lateral, inferior.
const MUSCLES: [f32; 4] = [5.5 / 24.0, 7.7 / 24.0, 6.9 / 24.0, 6.5 / 24.0];
/// Distance of fornices and corners behind the limbus, as shares of the axial length.
const FORNIX: f32 = 9.0 / 24.0;
/// Angle around the optical axis between an artery and its vein, in radians.
const BESIDE: f32 = 0.045;

fn build(settings: &EyeSettings) -> Eye {
    let mut rng = Stream::Organ.rng(settings.seed);
    let shape = Shape::new(settings, &mut rng);
    let drawn = IrisColor::ALL[rng.random_range(0..IrisColor::ALL.len())];
    let iris_color = settings.iris.unwrap_or(drawn);
    let [colours, weave] = [rng.next_u32(), rng.next_u32()].map(Noise::new);
    let all = settings.triangles as f32;

    // Edges by the areas of a ball, and of a shell of two discs.
    let edge_for = |area: f32, triangles: f32| (area / (0.433 * triangles)).sqrt();
    let ball = PI * shape.axial_length * shape.axial_length;
    let disc = PI * shape.limbus_radius * shape.limbus_radius;
    let (globe, conjunctiva) = globe::globe(&shape, edge_for(ball, (1.0 - CORNEA - IRIS) * all), colours);
    let away = 1.45 * shape.axial_length;
    let look = |from: Vec3| Viewpoint { eye: from.normalize() * away, target: Vec3::ZERO, up: Vec3::Y };
    let temporal = -settings.side.medial();
    Eye {
        conjunctiva,
        cornea: cornea::cornea(&shape, edge_for(2.6 * disc, CORNEA * all)),
        iris: iris::iris(&shape, iris_color, (IRIS * all) as usize, weave),
        iris_color,
        side: settings.side,
        axial_length: shape.axial_length,
        limbus: (Vec3::new(0.0, 0.0, shape.limbus_z), shape.limbus_radius),
        roots: fornix_sites(&shape, &mut rng),
        ciliary_roots: ciliary_sites(&shape, &mut rng),
        retinal_roots: retinal_sites(&shape),
        front: look(Vec3::Z),
        three_quarter: look(Vec3::new(0.7 * temporal, 0.3, 1.0)),
        lateral: look(Vec3::new(temporal, 0.1, 0.12)),
        globe,
    }
}

/// An artery and a vein at places of the sclera: a distance from the limbus, and an angle around the optical axis.
fn sites(shape: &Shape, places: impl Iterator<Item = (f32, f32)>) -> RootSites {
    let mut sites = RootSites::default();
    for (distance, around) in places {
        sites.arterial.push(shape.beyond_limbus(distance, around));
        sites.venous.push(shape.beyond_limbus(distance, around + BESIDE));
    }
    sites
}

/// Angle around the optical axis, in radians, of degrees from the nose over the top.
fn from_nose(shape: &Shape, degrees: f32) -> f32 {
    let around = degrees.to_radians();
    if shape.side.medial() > 0.0 { around } else { PI - around }
}

/// Two or three places at each fornix and each corner.
fn fornix_sites(shape: &Shape, rng: &mut VesselRng) -> RootSites {
    let mut places = Vec::new();
    for (quarter, width) in [(0.0, 60.0), (90.0, 100.0), (180.0, 60.0), (270.0, 100.0)] {
        let count = rng.random_range(2..=3usize);
        for place in 0..count {
            let spread = width * ((place as f32 + 0.5) / count as f32 - 0.5);
            let degrees = quarter + spread + rng.random_range(-6.0..=6.0);
            let distance = FORNIX * rng.random_range(0.94..=1.06) * shape.axial_length;
            places.push((distance, from_nose(shape, degrees)));
        }
    }
    sites(shape, places.into_iter())
}

/// The seven arteries at the insertions of the straight muscles.
fn ciliary_sites(shape: &Shape, rng: &mut VesselRng) -> RootSites {
    let mut places = Vec::new();
    for (muscle, share) in MUSCLES.into_iter().enumerate() {
        let apart: &[f32] = if muscle == 2 { &[0.0] } else { &[-11.0, 11.0] };
        for shift in apart {
            let degrees = 90.0 * muscle as f32 + shift + rng.random_range(-4.0..=4.0);
            places.push((share * shape.axial_length, from_nose(shape, degrees)));
        }
    }
    sites(shape, places.into_iter())
}

/// The central artery on the nasal side of the vein, in the middle of the nerve.
fn retinal_sites(shape: &Shape) -> RootSites {
    let aside = Vec3::X * (0.02 * shape.side.medial());
    RootSites {
        arterial: vec![shape.sclera_towards((shape.nerve + aside).normalize())],
        venous: vec![shape.sclera_towards((shape.nerve - aside).normalize())],
        ..RootSites::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cornea_bulges_from_the_limbus_over_the_iris() {
        for seed in 0..8 {
            let settings = EyeSettings { seed, variation: 1.5, ..Default::default() };
            let shape = Shape::new(&settings, &mut Stream::Organ.rng(seed));
            let [[apex, front], [radius, rim]] = [0.0, 1.0].map(|share| shape.cornea(share));
            assert!(apex == 0.0 && (radius - shape.limbus_radius).abs() < 1e-7 && (rim - shape.limbus_z).abs() < 1e-7);
            let back = shape.sclera(PI, 0.0).z;
            assert!((front - back - shape.axial_length).abs() < 1e-6, "seed {seed}: {front} to {back}");
            assert!(shape.pupil_z < front - shape.corneal_thickness[0]);
            // The sphere's own curvature.
            let [near, z] = shape.cornea(0.1);
            let curvature = near * near / (2.0 * (front - z));
            assert!((curvature / shape.corneal_radius - 1.0).abs() < 0.02, "seed {seed}: radius {curvature}");
            for around in [0.0f32, 1.0, 2.0, 4.0] {
                let limbus = shape.beyond_limbus(0.0, around);
                let off_axis = limbus.truncate().length();
                assert!((off_axis - shape.limbus_radius).abs() < 1e-6 && (limbus.z - shape.limbus_z).abs() < 1e-6);
            }
        }
    }
}
