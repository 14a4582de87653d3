//! A surface for views from afar: a prism along each branch.
//!
//! In: a tree. Out: a [`Surface`] with few faces. It is not closed where branches join: their prisms begin on the axis of
//! the vessel that they leave, which hides their open ends.

use super::build::Surface;
use super::coarse::corner;
use super::direction::unit;
use super::mesh::SurfaceMesh;
use crate::synthesis::pace::{Pace, SHORT_STRETCH, at_once};
use crate::synthesis::segment_index::start_radius;
use crate::synthesis::tree::{NO_PARENT, VesselTree};
use bevy_math::{Vec2, Vec3, ops};
use std::f32::consts::TAU;

/// Sides of a wide branch, and of the others.
const SIDES: [u32; 2] = [8, 4];
/// Share of the widest radius from which on a branch is wide.
const WIDE: f32 = 0.25;
/// Cosine of the turn, and share of the radius, from which on a node gets a ring.
const STRAIGHT: f32 = 0.97;
const ALIKE: f32 = 0.2;

impl Surface {
    /// The sketch of a tree.
    pub fn sketch(tree: &VesselTree) -> Self {
        at_once(Self::sketch_paced(tree, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    pub async fn sketch_paced(tree: &VesselTree, pace: &Pace) -> Self {
        let mut is_tip = vec![true; tree.len()];
        tree.segments().for_each(|(_, parent)| is_tip[parent] = false);
        let widest = tree.widest_radius();
        let mut sketch = Sketch { tree, is_tip, widest, mesh: SurfaceMesh::default() };
        let branches = tree.branches();
        let add = |stretch: std::ops::Range<usize>| stretch.for_each(|branch| sketch.add(branches.nodes(branch)));
        pace.stretches(branches.len(), SHORT_STRETCH, add).await;
        Self { mesh: sketch.mesh, ..Self::default() }
    }
}

struct Sketch<'a> {
    tree: &'a VesselTree,
    is_tip: Vec<bool>,
    widest: f32,
    mesh: SurfaceMesh,
}

/// A place on a branch where its prism may have a ring.
#[derive(Clone, Copy)]
struct Station {
    node: u32,
    at: Vec3,
    radius: f32,
    /// Unit direction of the branch.
    ahead: Vec3,
    /// Across it.
    right: Vec3,
    /// Length of the branch up to here.
    length: f32,
}

impl Sketch<'_> {
    /// Adds the prism of a branch, from its nodes.
    fn add(&mut self, nodes: &[u32]) {
        let [first, second, ..] = *nodes else { return };
        let radii = nodes[1..].iter().map(|&node| self.tree.radii()[node as usize]);
        let is_wide = radii.fold(0.0, f32::max) >= WIDE * self.widest;
        let sides = SIDES[usize::from(!is_wide)];
        let mut before: Option<(Station, u32)> = None;
        let mut station = Station {
            node: first,
            at: self.tree.positions()[first as usize],
            radius: start_radius(self.tree, second as usize),
            ahead: Vec3::Z,
            right: Vec3::ZERO,
            length: 0.0,
        };
        for (place, &node) in nodes.iter().enumerate() {
            let next = nodes.get(place + 1).copied();
            self.move_to(&mut station, node, next);
            let is_end = place == 0 || next.is_none();
            if let Some((last, _)) = before
                && !is_end
                && last.ahead.dot(station.ahead) > STRAIGHT
                && (last.radius - station.radius).abs() < ALIKE * last.radius
            {
                continue;
            }
            let base = self.ring(&station, sides);
            match before {
                Some((_, below)) => self.belt(below, base, sides),
                None if self.tree.parents()[first as usize] == NO_PARENT => self.cap(&station, base, sides, -1.0),
                None => {}
            }
            before = Some((station, base));
        }
        if let Some((last, base)) = before.filter(|(last, _)| self.is_tip[last.node as usize]) {
            self.cap(&last, base, sides, 1.0);
        }
    }

    /// Moves a station on to a node of its branch.
    fn move_to(&self, station: &mut Station, node: u32, next: Option<u32>) {
        let at = self.tree.positions()[node as usize];
        let back = unit(at - station.at).unwrap_or(Vec3::ZERO);
        let forth = next.and_then(|next| unit(self.tree.positions()[next as usize] - at)).unwrap_or(Vec3::ZERO);
        let ahead = unit(back + forth).unwrap_or(station.ahead);
        let right = station.right - ahead * ahead.dot(station.right);
        if node != station.node {
            station.radius = self.tree.radii()[node as usize];
            station.length += station.at.distance(at);
        }
        *station = Station {
            node,
            at,
            ahead,
            right: unit(right).unwrap_or_else(|| ahead.any_orthonormal_vector()),
            ..*station
        };
    }

    /// Vertices around a station. Returns the first.
    fn ring(&mut self, station: &Station, sides: u32) -> u32 {
        let (base, up) = (self.mesh.positions.len() as u32, station.ahead.cross(station.right));
        for side in 0..sides {
            let share = side as f32 / sides as f32;
            let (sin, cos) = ops::sin_cos(share * TAU);
            let out = station.right * cos + up * sin;
            let around = (share - 0.5) * TAU * station.radius;
            let uv = Vec2::new(around, station.length);
            self.vertex(station, station.at + out * (station.radius * corner(sides)), out, uv);
        }
        base
    }

    /// Joins two rings.
    fn belt(&mut self, below: u32, above: u32, sides: u32) {
        for side in 0..sides {
            let next = (side + 1) % sides;
            self.mesh.faces.push([below + side, below + next, above + next, above + side]);
        }
    }

    /// Closes a ring by a pyramid.
    fn cap(&mut self, station: &Station, base: u32, sides: u32, sign: f32) {
        let (apex, out) = (self.mesh.positions.len() as u32, station.ahead * sign);
        let uv = Vec2::new(0.0, station.length + sign * station.radius);
        self.vertex(station, station.at + out * station.radius, out, uv);
        for side in 0..sides {
            let next = (side + 1) % sides;
            let [a, b] = if sign > 0.0 { [side, next] } else { [next, side] };
            self.mesh.faces.push([base + a, base + b, apex, apex]);
        }
    }

    fn vertex(&mut self, station: &Station, position: Vec3, normal: Vec3, uv: Vec2) {
        self.mesh.positions.push(position);
        self.mesh.normals.push(normal);
        self.mesh.uvs.push(uv);
        self.mesh.radii.push(station.radius);
        self.mesh.nodes.push(station.node);
    }
}
