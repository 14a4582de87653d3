//! The recipe of the white of the eye: trees of three sizes, each in a band of its own.
//!
//! Source: Rauch & Harders (2021), section 4: no lateral branches and no growth of the tissue, each tree in a vertical
//! region, trees grown apart from each other at different sizes, baked, blurred by size, and combined; larger vessels lie
//! deeper. Bands lead from the fornices and corners to the limbus. What is grown where follows anatomy: episcleral
//! vessels go radially from the straight muscles, those of the conjunctiva wind from the fornices; both thin out before
//! the limbus. Calibres: arterioles of the conjunctiva from 6 to 12 µm, its larger vessels to 100 µm.

use super::layer::RecipeLayer;
use crate::synthesis::{
    colonization::{ColonizationSettings, SystemSettings},
    organ::{Eye, smooth_step},
    preset::Preset,
    random::Stream,
    roots::{RootPlacement, RootPlacements},
    texture::VesselLook,
    tissue::{TissueGrowth, TissueSource},
};
use bevy_math::{Vec3, ops};
use rand::{Rng, RngExt};
use std::f32::consts::{PI, TAU};

/// Colour of the sclera between the vessels, linear sRGB, for bakes: (238, 232, 224) in sRGB. A renderer that multiplies
/// the texture with the eye's vertex colours takes white.
pub const SCLERA_COLOR: [f32; 3] = [0.855, 0.807, 0.745];

/// A size of trees. Lengths are in metres for an eye of [`EYE`].
struct Size {
    name: &'static str,
    /// Distance between drains; all other distances are multiples of it.
    spacing: f32,
    step: f32,
    direction_weight: f32,
    terminal_radius: f32,
    /// Half the width of a tree's band around the optical axis, in radians.
    half_width: f32,
    /// Distance from the limbus below which nothing grows, and that from which on everything does.
    limbus: [f32; 2],
    /// Trees of one size differ in their lengths by up to this share.
    differs: f32,
    look: VesselLook,
}

/// Axial length of the eye for which lengths are given.
const EYE: f32 = 0.024;
/// Distance from the limbus beyond which nothing grows: behind the fornices.
const FORNIX: [f32; 2] = [0.0086, 0.0098];
/// Steps of a growth: it ends sooner, once its band is full.
const STEPS: u32 = 180;
/// Samples of a step over all of the surface, most of which lie outside of a band.
const SAMPLES: u32 = 500;

/// The layers for an eye, the deepest first: their order in a bake.
///
/// They grow on the conjunctiva's part of the eyeball, [`Eye::globe`] with the triangles [`Eye::conjunctiva`], and are
/// painted on all of it. The same eye and seed give the same layers. All vessels are grown as arteries; which look like
/// veins is a matter of their look.
pub fn conjunctiva(eye: &Eye, seed: u64) -> Vec<RecipeLayer> {
    let mut rng = Stream::Roots.rng(seed);
    let surface = eye.globe.part(eye.conjunctiva.clone());
    let scale = eye.axial_length / EYE;
    let [episcleral, large, fine] = sizes();
    // A root of the conjunctiva has a large tree, a fine one, or both.
    let roots = &eye.roots;
    let groups = [
        (episcleral, eye.ciliary_roots.arterial.clone()),
        (large, roots.venous.iter().copied().step_by(2).collect()),
        (fine, roots.arterial.iter().zip(&roots.venous).flat_map(|(a, v)| beside(*a, *v)).collect()),
    ];
    let mut layers = Vec::new();
    for (size, roots) in groups {
        for (number, root) in roots.into_iter().enumerate() {
            let lengths = scale * (1.0 + rng.random_range(-size.differs..=size.differs));
            let width = size.half_width * rng.random_range(0.75..=1.25);
            let band = Band { axis: eye.limbus, around: around(root), half_width: width, limbus: size.limbus, scale };
            layers.push(RecipeLayer {
                name: format!("{} {}", size.name, number + 1),
                preset: size.preset(lengths, root),
                density: surface.positions.iter().map(|&point| band.density(point)).collect(),
                seed: rng.next_u64(),
                look: size.look.clone(),
            });
        }
    }
    layers
}

fn sizes() -> [Size; 3] {
    let look = VesselLook { bump: 0.05, ..VesselLook::default() };
    [
        Size {
            name: "episcleral vessel",
            spacing: 0.0012,
            step: 0.0003,
            direction_weight: 0.8,
            terminal_radius: 0.000_026,
            half_width: 0.36,
            limbus: [0.0014, 0.003],
            differs: 0.2,
            look: VesselLook {
                thin_color: [0.34, 0.07, 0.10],
                wide_color: [0.22, 0.05, 0.10],
                deep_color: [0.22, 0.10, 0.20],
                strength: 0.65,
                depth: 3.0,
                blur: 0.5,
                fade: 30.0,
                ..look.clone()
            },
        },
        Size {
            name: "large conjunctival vessel",
            spacing: 0.0008,
            step: 0.0002,
            direction_weight: 0.45,
            terminal_radius: 0.000_014,
            half_width: 0.45,
            limbus: [0.0010, 0.003],
            differs: 0.3,
            look: VesselLook {
                thin_color: [0.52, 0.05, 0.03],
                wide_color: [0.36, 0.02, 0.025],
                deep_color: [0.30, 0.06, 0.10],
                strength: 0.8,
                depth: 1.2,
                blur: 0.3,
                fade: 40.0,
                ..look.clone()
            },
        },
        Size {
            name: "fine conjunctival vessel",
            spacing: 0.000_42,
            step: 0.000_14,
            direction_weight: 0.3,
            terminal_radius: 0.000_008,
            half_width: 0.3,
            limbus: [0.0007, 0.0035],
            differs: 0.35,
            look: VesselLook {
                thin_color: [0.60, 0.06, 0.035],
                wide_color: [0.48, 0.03, 0.02],
                strength: 0.8,
                depth: 0.6,
                blur: 0.2,
                fade: 60.0,
                ..look
            },
        },
    ]
}

impl Size {
    fn preset(&self, lengths: f32, root: Vec3) -> Preset {
        let spacing = lengths * self.spacing;
        let arterial = SystemSettings {
            direction_weight: self.direction_weight,
            drain_birth_distance: spacing,
            node_birth_distance: 1.1 * spacing,
            influence_distance: 3.2 * spacing,
            kill_distance: 0.8 * spacing,
            terminal_radius: lengths * self.terminal_radius,
            step_length: lengths * self.step,
            bifurcation_exponent: 2.95,
            tissue_growth: TissueGrowth::None,
            lateral_sprouts: false,
            root_children: 2,
            ..SystemSettings::default()
        };
        let settings = ColonizationSettings {
            steps: STEPS,
            samples: SAMPLES,
            arterial,
            // A texture has no side on which vessels could lie.
            stand_off: false,
            ..ColonizationSettings::default()
        };
        Preset {
            source: "Rauch & Harders 2021, section 4: the conjunctiva, one of its trees.".to_owned(),
            fit: false,
            tissue: TissueSource::default(),
            roots: RootPlacements {
                artery: RootPlacement::Nearest(vec![root]),
                vein: RootPlacement::None,
                ..RootPlacements::default()
            },
            generator: settings.into(),
            ..Preset::default()
        }
    }
}

/// The region of a tree: from behind the fornix to the limbus, so wide around the optical axis.
struct Band {
    /// Middle and radius of the limbus.
    axis: (Vec3, f32),
    around: f32,
    half_width: f32,
    limbus: [f32; 2],
    scale: f32,
}

impl Band {
    fn density(&self, point: Vec3) -> f32 {
        let apart = (around(point) - self.around).rem_euclid(TAU);
        let apart = apart.min(TAU - apart);
        let across = 1.0 - smooth_step(0.7 * self.half_width, self.half_width, apart);
        let [none, all] = self.limbus.map(|length| length * self.scale);
        let [near, far] = FORNIX.map(|length| length * self.scale);
        let beyond = beyond_limbus(self.axis, point);
        across * smooth_step(none, all, beyond) * (1.0 - smooth_step(near, far, beyond))
    }
}

/// Distance of a point of the sclera from the limbus, along a ball through both about the eyeball's middle.
fn beyond_limbus((middle, radius): (Vec3, f32), point: Vec3) -> f32 {
    let ball = (middle.z * middle.z + radius * radius).sqrt();
    let angle = |away: f32, along: f32| ops::atan2(away, along);
    ball * (angle(point.truncate().length(), point.z) - angle(radius, middle.z))
}

fn around(point: Vec3) -> f32 {
    ops::atan2(point.y, point.x) + PI
}

/// Two places beside those of an artery and its vein.
fn beside(artery: Vec3, vein: Vec3) -> [Vec3; 2] {
    [artery.lerp(vein, -2.0), artery.lerp(vein, 3.0)]
}
