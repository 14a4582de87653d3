//! The course of the colon through the abdomen, varied by the seed.

use super::ColonSettings;
use crate::synthesis::{
    organ::centre_line::{CentreLine, Control},
    random::VesselRng,
};
use bevy_math::{Vec3, ops};
use rand::RngExt;

/// Width of [`COURSE`] with its wall, in metres: the reference of [`ColonSettings::width`].
const COURSE_WIDTH: f32 = 0.34;
/// Mean calibre of [`COURSE`], in metres.
const COURSE_CALIBRE: f32 = 0.052;
/// Arc length between the samples of the centre line, in metres.
const SPACING: f32 = 0.003;
/// The root of the mesentery at the back wall of the abdomen, from which the vessels come.
pub(super) const MESENTERY_ROOT: Vec3 = Vec3::new(0.0, 0.02, -0.09);

/// From the blind end of the caecum to the rectum: position (x to the patient's left, y up, z to the front), radius (in
/// metres) and depth of the haustra (a share).
///
/// Proportions after the descriptions of Gray's Anatomy: the caecum is the widest part, the calibre falls toward the sigmoid,
/// the splenic flexure is higher, further back and sharper than the hepatic one, the transverse colon hangs to the
/// front, haustra get shallower toward the rectum, which has only a few transverse folds.
const COURSE: [([f32; 3], f32, f32); 25] = [
    ([-0.116, -0.140, 0.015], 0.034, 0.9),
    ([-0.124, -0.095, 0.000], 0.034, 1.0),
    ([-0.132, -0.040, -0.014], 0.031, 1.0),
    ([-0.138, 0.020, -0.022], 0.029, 1.0),
    ([-0.140, 0.080, -0.022], 0.028, 1.0),
    ([-0.122, 0.135, -0.004], 0.027, 1.0), // hepatic flexure
    ([-0.080, 0.105, 0.030], 0.027, 1.0),
    ([-0.042, 0.050, 0.050], 0.027, 1.0),
    ([0.002, 0.020, 0.058], 0.0265, 1.0), // the transverse colon's lowest point
    ([0.045, 0.050, 0.052], 0.026, 1.0),
    ([0.078, 0.115, 0.036], 0.026, 1.0),
    ([0.105, 0.180, 0.006], 0.025, 1.0),
    ([0.146, 0.205, -0.026], 0.024, 0.95), // splenic flexure
    ([0.160, 0.140, -0.040], 0.023, 0.9),
    ([0.152, 0.070, -0.036], 0.022, 0.85),
    ([0.148, 0.010, -0.030], 0.021, 0.8),
    ([0.145, -0.045, -0.026], 0.021, 0.75),
    ([0.132, -0.105, -0.010], 0.021, 0.7),
    ([0.098, -0.150, 0.020], 0.022, 0.7), // sigmoid loop
    ([0.060, -0.115, 0.045], 0.022, 0.65),
    ([0.025, -0.070, 0.030], 0.021, 0.6),
    ([-0.010, -0.080, -0.005], 0.019, 0.5),
    ([-0.012, -0.130, -0.030], 0.023, 0.3), // rectum
    ([0.004, -0.175, -0.030], 0.029, 0.25),
    ([0.014, -0.215, 0.004], 0.023, 0.2),
];
/// Indices of [`COURSE`] by section, for variation of whole sections.
const TRANSVERSE: std::ops::Range<usize> = 6..12;
const SIGMOID: std::ops::Range<usize> = 18..22;

/// The appendix, from its tip to where it leaves the caecum, relative to the caecum's blind end.
const APPENDIX: [[f32; 3]; 4] =
    [[0.064, -0.030, -0.016], [0.046, -0.047, -0.010], [0.024, -0.050, 0.000], [0.006, -0.028, 0.008]];
/// Outer radius of the appendix, in metres.
pub(super) const APPENDIX_RADIUS: f32 = 0.0042;

/// The centre line of a colon, with its weight below 0 in the appendix and the haustra's depth from the caecum on.
pub(super) fn course(settings: &ColonSettings, clearance: f32, rng: &mut VesselRng) -> CentreLine {
    let scale = settings.width / COURSE_WIDTH;
    let calibre = settings.calibre / COURSE_CALIBRE;
    let variation = settings.variation;
    let mut draw = |limit: f32| variation * rng.random_range(-limit..=limit);

    let mut points: Vec<Vec3> = COURSE.iter().map(|(position, ..)| Vec3::from_array(*position)).collect();
    vary_sections(&mut points, &mut draw);
    for point in &mut points {
        *point += Vec3::new(draw(0.007), draw(0.007), draw(0.006));
    }
    let calibres = [1.0 + draw(0.1), 1.0 + draw(0.12), 1.0 + draw(0.12), 1.0 + draw(0.1)];
    let mut controls: Vec<Control> = points
        .iter()
        .zip(&COURSE)
        .enumerate()
        .map(|(index, (&position, (_, radius, weight)))| Control {
            position: position * scale,
            radius: radius * calibre * calibres[(index * 4 / COURSE.len()).min(3)],
            weight: *weight,
        })
        .collect();
    if settings.appendix {
        let curl = 1.0 + draw(0.3);
        let blind_end = controls[0].position;
        let stretch = scale * Vec3::new(curl, 1.0, 1.0);
        controls.splice(
            0..0,
            APPENDIX.map(|offset| Control {
                position: blind_end + Vec3::from_array(offset) * stretch,
                radius: APPENDIX_RADIUS * scale,
                weight: -1.0,
            }),
        );
    }
    CentreLine::new(&controls, clearance, SPACING * scale, MESENTERY_ROOT * scale)
}

/// Varies whole sections: the sag of the transverse colon, the height of the flexures, the loop of the sigmoid.
fn vary_sections(points: &mut [Vec3], draw: &mut impl FnMut(f32) -> f32) {
    let sag = draw(0.045);
    let front = draw(0.012);
    let middle = (TRANSVERSE.start + TRANSVERSE.end - 1) as f32 / 2.0;
    for index in TRANSVERSE {
        let from_middle = (index as f32 - middle) / TRANSVERSE.len() as f32;
        let share = ops::cos(from_middle * std::f32::consts::PI);
        points[index] += Vec3::new(0.0, -sag, front) * share;
    }
    let flexure = [draw(0.015), draw(0.018)];
    for point in &mut points[3..7] {
        point.y += flexure[0];
    }
    for point in &mut points[10..15] {
        point.y += flexure[1];
    }
    let loop_shift = Vec3::new(draw(0.02), draw(0.025), draw(0.012));
    for index in SIGMOID {
        points[index] += loop_shift;
    }
}
