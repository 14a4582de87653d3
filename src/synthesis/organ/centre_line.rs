//! The centre line of a tubular organ: a spline that avoids itself, with frames that do not twist.
//!
//! In: control points with values that vary along the tube. Out: a [`CentreLine`] sampled at equal arc length, whose
//! tube does not intersect itself: bends are wide enough for the tube and neighbouring limbs stay apart. Frames are
//! rotation-minimising, by double reflection (Wang, Jüttler, Zheng & Liu 2008), turned toward a given side of the tube.

use bevy_math::{Vec3, ops};

/// A control point of a tube's centre line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Position, in metres.
    pub position: Vec3,
    /// Radius of the tube, in metres.
    pub radius: f32,
    /// Another value that varies smoothly along the tube: for the colon, the depth of its haustra.
    pub weight: f32,
}

/// A cross-section of the tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Centre, in metres.
    pub centre: Vec3,
    /// Unit tangent, toward the end of the line.
    pub tangent: Vec3,
    /// Unit vector across the tube, at which the angle is 0.
    pub side: Vec3,
    /// Tangent × side.
    pub up: Vec3,
    /// Radius of the tube, in metres.
    pub radius: f32,
    /// The control points' weight, interpolated.
    pub weight: f32,
}

impl Frame {
    /// The unit vector across the tube at an angle (in radians) from [`side`](Self::side).
    pub fn direction(&self, angle: f32) -> Vec3 {
        self.side * ops::cos(angle) + self.up * ops::sin(angle)
    }
}

/// A tube's centre line, sampled at equal arc length.
#[derive(Clone, Debug, PartialEq)]
pub struct CentreLine {
    frames: Vec<Frame>,
    spacing: f32,
}

impl CentreLine {
    /// Samples per spline control point, before resampling by arc length.
    const SAMPLES_PER_CONTROL: usize = 8;
    /// Most rounds of separating limbs and rounding bends; shapes with enough room take fewer.
    const RELAXATIONS: usize = 80;
    /// Share of the radius of curvature that the tube may fill, so that its inner side keeps some length at a bend.
    const BEND_FILL: f32 = 0.8;

    /// Builds a uniform cubic B-spline from `controls` and makes room for the tube.
    ///
    /// `clearance` multiplies the radius to give the room that the wall's bulges need; `spacing` is the arc length between
    /// samples, in metres; `toward` is the point that the frames' sides face, as far as a gentle twist allows. Limbs
    /// are pushed apart and bends rounded first; if that is not enough, the radius is lowered. Fewer than two control
    /// points give a line without length.
    pub fn new(controls: &[Control], clearance: f32, spacing: f32, toward: Vec3) -> Self {
        let mut line = spline(controls, Self::SAMPLES_PER_CONTROL);
        relax(&mut line, clearance, Self::RELAXATIONS);
        let mut line = resample(&line, spacing);
        make_room(&mut line, clearance, spacing, Self::BEND_FILL);
        let mut frames = frames_without_twist(&line);
        turn_toward(&mut frames, toward, spacing);
        Self { frames, spacing }
    }

    /// The samples, from the line's start to its end.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Arc length of each sample, in metres.
    pub fn arcs(&self) -> impl Iterator<Item = f32> {
        let spacing = self.spacing;
        (0..self.frames.len()).map(move |index| index as f32 * spacing)
    }

    /// Arc length of the line, in metres.
    pub fn length(&self) -> f32 {
        self.frames.len().saturating_sub(1) as f32 * self.spacing
    }

    /// The cross-section at an arc length from the start, in metres. Beyond either end the line goes straight on.
    pub fn at(&self, arc: f32) -> Frame {
        let clamped = arc.clamp(0.0, self.length());
        let place = clamped / self.spacing;
        let index = (place as usize).min(self.frames.len().saturating_sub(2));
        let Some([a, b]) = self.frames.get(index..index + 2).and_then(|pair| <[Frame; 2]>::try_from(pair).ok()) else {
            return self.frames.first().copied().unwrap_or(Frame::ORIGIN);
        };
        let share = place - index as f32;
        let tangent = a.tangent.lerp(b.tangent, share).normalize_or(a.tangent);
        let side = a.side.lerp(b.side, share).reject_from_normalized(tangent).normalize_or(a.side);
        Frame {
            centre: hermite(&a, &b, self.spacing, share) + tangent * (arc - clamped),
            tangent,
            side,
            up: tangent.cross(side),
            radius: a.radius + (b.radius - a.radius) * share,
            weight: a.weight + (b.weight - a.weight) * share,
        }
    }
}

impl Frame {
    const ORIGIN: Self =
        Self { centre: Vec3::ZERO, tangent: Vec3::Z, side: Vec3::X, up: Vec3::Y, radius: 0.0, weight: 0.0 };
}

/// The cubic through two samples along their tangents.
fn hermite(a: &Frame, b: &Frame, spacing: f32, t: f32) -> Vec3 {
    let (squared, cubed) = (t * t, t * t * t);
    a.centre * (2.0 * cubed - 3.0 * squared + 1.0)
        + a.tangent * (spacing * (cubed - 2.0 * squared + t))
        + b.centre * (3.0 * squared - 2.0 * cubed)
        + b.tangent * (spacing * (cubed - squared))
}

/// Points of the uniform cubic B-spline that starts at the first control point and ends at the last.
fn spline(controls: &[Control], per_control: usize) -> Vec<Control> {
    let (Some(first), Some(last)) = (controls.first(), controls.last()) else { return Vec::new() };
    let reflected = |end: &Control, next: Option<&Control>| {
        let next = next.unwrap_or(end);
        Control { position: 2.0 * end.position - next.position, ..*end }
    };
    let mut padded = vec![reflected(first, controls.get(1))];
    padded.extend_from_slice(controls);
    padded.push(reflected(last, controls.len().checked_sub(2).and_then(|index| controls.get(index))));
    let mut line = Vec::new();
    for quad in padded.windows(4) {
        for step in 0..per_control {
            line.push(spline_point(quad, step as f32 / per_control as f32));
        }
    }
    line.push(*last);
    line
}

fn spline_point(quad: &[Control], t: f32) -> Control {
    let (squared, cubed) = (t * t, t * t * t);
    let weights = [
        (1.0 - 3.0 * t + 3.0 * squared - cubed) / 6.0,
        (4.0 - 6.0 * squared + 3.0 * cubed) / 6.0,
        (1.0 + 3.0 * t + 3.0 * squared - 3.0 * cubed) / 6.0,
        cubed / 6.0,
    ];
    let mut point = Control { position: Vec3::ZERO, radius: 0.0, weight: 0.0 };
    for (control, weight) in quad.iter().zip(weights) {
        point.position += control.position * weight;
        point.radius += control.radius * weight;
        point.weight += control.weight * weight;
    }
    point
}

/// Pushes touching limbs of the tube apart and smooths bends that are too sharp, until there are none.
fn relax(line: &mut [Control], clearance: f32, rounds: usize) {
    let mut arcs = Vec::new();
    let mut moves = vec![Vec3::ZERO; line.len()];
    for _ in 0..rounds {
        arcs.clear();
        arcs.extend(arc_lengths(line));
        moves.fill(Vec3::ZERO);
        let touched = part_limbs(line, &arcs, clearance, &mut moves);
        let bent = round_bends(line, clearance, &mut moves);
        if !touched && !bent {
            return;
        }
        spread_moves(&mut moves);
        for (point, shift) in line.iter_mut().zip(&moves) {
            point.position += *shift;
        }
    }
}

/// Adds half of the overlap of each pair of limbs to their moves.
fn part_limbs(line: &[Control], arcs: &[f32], clearance: f32, moves: &mut [Vec3]) -> bool {
    let mut touched = false;
    for i in 0..line.len() {
        for j in i + 1..line.len() {
            let room = clearance * (line[i].radius + line[j].radius);
            // Cross-sections closer along the tube are neighbours in a bend, which `round_bends` handles.
            if arcs[j] - arcs[i] < 1.7 * room {
                continue;
            }
            let apart = line[j].position - line[i].position;
            let overlap = room - apart.length();
            if overlap > 0.0 {
                let push = apart.normalize_or(Vec3::Z) * (0.15 * overlap);
                moves[i] -= push;
                moves[j] += push;
                touched = true;
            }
        }
    }
    touched
}

/// Adds a step of smoothing to the moves where the tube is too thick for its bend.
fn round_bends(line: &[Control], clearance: f32, moves: &mut [Vec3]) -> bool {
    let mut bent = false;
    for i in 2..line.len().saturating_sub(2) {
        let before = line[i].position - line[i - 2].position;
        let after = line[i + 2].position - line[i].position;
        let turn = before.angle_between(after);
        let curvature = turn / (0.5 * (before.length() + after.length())).max(f32::MIN_POSITIVE);
        if curvature * line[i].radius * clearance > 0.9 * CentreLine::BEND_FILL {
            for k in i - 1..=i + 1 {
                let middle = 0.5 * (line[k - 1].position + line[k + 1].position);
                moves[k] += 0.3 * (middle - line[k].position);
            }
            bent = true;
        }
    }
    bent
}

/// Blurs the moves along the line, so that a limb moves as a whole and gets no kink.
fn spread_moves(moves: &mut [Vec3]) {
    for _ in 0..6 {
        let mut before = moves.first().copied().unwrap_or_default();
        for i in 1..moves.len().saturating_sub(1) {
            let here = moves[i];
            moves[i] = 0.25 * before + 0.5 * here + 0.25 * moves[i + 1];
            before = here;
        }
    }
}

fn arc_lengths(line: &[Control]) -> impl Iterator<Item = f32> + '_ {
    let mut arc = 0.0;
    line.iter().enumerate().map(move |(index, point)| {
        if index > 0 {
            arc += point.position.distance(line[index - 1].position);
        }
        arc
    })
}

/// Points at equal arc length. A last interval shorter than the spacing is dropped.
fn resample(line: &[Control], spacing: f32) -> Vec<Control> {
    let arcs: Vec<f32> = arc_lengths(line).collect();
    let length = arcs.last().copied().unwrap_or(0.0);
    let count = (length / spacing) as usize + 1;
    let mut from = 0;
    (0..count)
        .filter_map(|index| {
            let arc = index as f32 * spacing;
            while from + 2 < arcs.len() && arcs[from + 1] < arc {
                from += 1;
            }
            let (a, b) = (line.get(from)?, line.get(from + 1)?);
            let share = (arc - arcs[from]) / (arcs[from + 1] - arcs[from]).max(f32::MIN_POSITIVE);
            Some(Control {
                position: a.position.lerp(b.position, share),
                radius: a.radius + (b.radius - a.radius) * share,
                weight: a.weight + (b.weight - a.weight) * share,
            })
        })
        .collect()
}

/// Lowers the radius where a bend or a neighbouring limb leaves less room, and tapers toward such places.
fn make_room(line: &mut [Control], clearance: f32, spacing: f32, bend_fill: f32) {
    let tangents = tangents(line);
    let mut room: Vec<f32> = line.iter().map(|point| point.radius).collect();
    for i in 1..line.len().saturating_sub(1) {
        let curvature = (tangents[i + 1] - tangents[i - 1]).length() / (2.0 * spacing);
        room[i] = room[i].min(bend_fill / (curvature * clearance).max(f32::MIN_POSITIVE));
    }
    for i in 0..line.len() {
        for j in i + 1..line.len() {
            let needed = clearance * (line[i].radius + line[j].radius);
            if (j - i) as f32 * spacing < 1.7 * needed {
                continue;
            }
            let apart = line[i].position.distance(line[j].position);
            if apart < needed {
                let share = 0.98 * apart / needed;
                room[i] = room[i].min(line[i].radius * share);
                room[j] = room[j].min(line[j].radius * share);
            }
        }
    }
    // A minimum over a window, then a mean over the same window, never exceeds the value in its middle.
    let reach = ((0.02 / spacing) as usize).max(1);
    let window = |i: usize| i.saturating_sub(reach)..(i + reach + 1).min(line.len());
    let lowest: Vec<f32> =
        (0..line.len()).map(|i| room[window(i)].iter().copied().fold(f32::INFINITY, f32::min)).collect();
    let smooth: Vec<f32> =
        (0..line.len()).map(|i| lowest[window(i)].iter().sum::<f32>() / window(i).len() as f32).collect();
    for (point, radius) in line.iter_mut().zip(smooth) {
        point.radius = radius;
    }
}

fn tangents(line: &[Control]) -> Vec<Vec3> {
    let last = line.len().saturating_sub(1);
    (0..line.len())
        .map(|i| (line[(i + 1).min(last)].position - line[i.saturating_sub(1)].position).normalize_or(Vec3::Z))
        .collect()
}

/// Frames whose sides turn as little as the line allows.
fn frames_without_twist(line: &[Control]) -> Vec<Frame> {
    let tangents = tangents(line);
    let mut side = tangents.first().map_or(Vec3::X, |tangent| tangent.any_orthonormal_vector());
    let mut frames: Vec<Frame> = Vec::with_capacity(line.len());
    for (index, (point, &tangent)) in line.iter().zip(&tangents).enumerate() {
        if let Some(previous) = frames.last() {
            let along = (point.position - previous.centre).normalize_or(tangent);
            let reflected_side = side - 2.0 * along.dot(side) * along;
            let reflected_tangent = tangents[index - 1] - 2.0 * along.dot(tangents[index - 1]) * along;
            let across = (tangent - reflected_tangent).normalize_or_zero();
            side = reflected_side - 2.0 * across.dot(reflected_side) * across;
            side = side.reject_from_normalized(tangent).normalize_or(tangent.any_orthonormal_vector());
        }
        frames.push(Frame {
            centre: point.position,
            tangent,
            side,
            up: tangent.cross(side),
            radius: point.radius,
            weight: point.weight,
        });
    }
    frames
}

/// Turns the frames about their tangents so that their sides face `toward`, with a twist blurred along the line.
fn turn_toward(frames: &mut [Frame], toward: Vec3, spacing: f32) {
    use std::f32::consts::{PI, TAU};
    let mut angles: Vec<f32> = Vec::with_capacity(frames.len());
    for frame in frames.iter() {
        let to = toward - frame.centre;
        let mut angle = ops::atan2(to.dot(frame.up), to.dot(frame.side));
        if let Some(previous) = angles.last() {
            angle = previous + (angle - previous + PI).rem_euclid(TAU) - PI;
        }
        angles.push(angle);
    }
    let reach = ((0.04 / spacing) as usize).max(1);
    for _ in 0..3 {
        blur(&mut angles, reach);
    }
    for (frame, angle) in frames.iter_mut().zip(angles) {
        frame.side = frame.direction(angle);
        frame.up = frame.tangent.cross(frame.side);
    }
}

/// Mean over a window that shrinks at the ends.
fn blur(values: &mut [f32], reach: usize) {
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(values.iter().scan(0.0, |sum, &value| {
            *sum += f64::from(value);
            Some(*sum)
        }))
        .collect();
    let count = values.len();
    for (i, value) in values.iter_mut().enumerate() {
        let reach = reach.min(i).min(count - 1 - i);
        *value = ((sums[i + reach + 1] - sums[i - reach]) / (2 * reach + 1) as f64) as f32;
    }
}
