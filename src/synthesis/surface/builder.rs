//! Makes the cage of a tree.
//!
//! In: a tree. Out: a [`Cage`], closed by construction: every edge is made together with both of its faces. Trunk by
//! trunk, rings are joined by belts of quads. Each row leaves holes in its belts, one for each lateral, and the lateral's
//! first belt begins at the hole's edge: the branches connection of Skjermo & Eidheim 2005. Their tiles are single faces;
//! here, a hole of w × w faces lets a lateral of 4w sides out.

use super::cage::Cage;
use super::caps::End;
use super::columns::Columns;
use super::curve::{Curve, Lean};
use super::direction::{across, unit};
use super::exit::Exit;
use super::layout::{Layout, Mouth};
use super::loops::Looped;
use super::parting::CLEAR;
use super::report::SurfaceReport;
use super::rings::{Rings, Start};
use super::rows::{Opening, Row, rows};
use super::seams::{self, OpenEnd, Seam};
use super::settings::TipCap;
use super::shape::Shape;
use super::trunks::{Base, Trunks};
use crate::synthesis::pace::{Pace, SHORT_STRETCH};
use crate::synthesis::tree::NodeId;
use bevy_math::{Vec3, ops};
use std::f32::consts::FRAC_PI_4;

/// Length over which a lateral that leaves beside its place comes back to its centre line, as a multiple of the distance.
const LEAN: f32 = 2.0;
/// The same for one that ends beside its trunk, as a multiple of its own length: it hardly comes back.
const FOR_GOOD: f32 = 8.0;
/// Length along a vessel, from a place that lacks room, within which faces are checked, in radii.
const DOUBTFUL: f32 = 4.0;
/// The same for a lateral that leaves so flat that it runs beside its trunk.
const BESIDE: f32 = 24.0;

/// What a trunk leaves to a lateral.
#[derive(Clone, Debug)]
enum Hole {
    /// The lateral's tube begins here.
    Open {
        start: Start,
        right: Vec3,
        lean: Lean,
        /// The vertices around the hole, those of the lateral's first ring in their order.
        edge: Vec<u32>,
        mouth: Mouth,
        /// Length over which its faces may meet others.
        doubtful: Option<f32>,
    },
    /// The lateral ends within the trunk's lumen.
    Absorbed,
}

/// Makes a cage trunk by trunk.
pub(super) struct Builder<'a> {
    looped: &'a Looped<'a>,
    shape: &'a Shape,
    tips: TipCap,
    seams: Vec<Seam>,
    trunks: Trunks,
    curves: Vec<Curve>,
    holes: Vec<Option<Hole>>,
    cage: Cage,
    rings: Rings,
    exits: Vec<Exit>,
    /// First vertex of each ring.
    bases: Vec<u32>,
    layout: Layout,
    report: SurfaceReport,
}

/// A cage, and what it was made from.
pub(super) struct Built {
    pub cage: Cage,
    pub trunks: Trunks,
    pub curves: Vec<Curve>,
    pub layout: Layout,
    pub report: SurfaceReport,
}

impl<'a> Builder<'a> {
    /// A builder of the cage of a tree, in coordinates from an origin.
    pub fn new(looped: &'a Looped<'a>, shape: &'a Shape, tips: TipCap, origin: Vec3) -> Self {
        let tree = &*looped.tree;
        let trunks = Trunks::of(tree);
        let curve = |trunk: usize| {
            let nodes = trunks.nodes(trunk);
            let is_lateral = matches!(trunks.base(trunk), Base::Joint { .. });
            let goes_on = [0, nodes.len() - 1].map(|end| looped.at(nodes[end]).is_some());
            Curve::of(tree, nodes, is_lateral, goes_on, origin)
        };
        let curves = (0..trunks.len()).map(curve).collect();
        let holes = vec![None; trunks.len()];
        let cage = Cage { starts: vec![0], ..Cage::default() };
        Self {
            looped,
            shape,
            tips,
            seams: vec![Seam::Ahead; looped.len()],
            trunks,
            curves,
            holes,
            cage,
            rings: Rings::default(),
            exits: Vec::new(),
            bases: Vec::new(),
            layout: Layout::default(),
            report: SurfaceReport::default(),
        }
    }

    /// The whole cage, as paced work.
    pub async fn build_paced(mut self, pace: &Pace) -> Built {
        pace.stretches(self.trunks.len(), SHORT_STRETCH, |trunks| trunks.for_each(|trunk| self.add(trunk))).await;
        self.cage.drop_unused();
        let Self { cage, trunks, curves, layout, report, .. } = self;
        Built { cage, trunks, curves, layout, report }
    }

    /// Adds a trunk whose base's trunk has been added.
    fn add(&mut self, trunk: usize) {
        let hole = self.holes[trunk].take();
        let (start, edge) = match hole {
            Some(Hole::Absorbed) => {
                self.add_absorbed(trunk);
                return;
            }
            Some(Hole::Open { start, right, lean, edge, mouth, doubtful }) => {
                self.layout.begin(Some(mouth), self.cage.corners.len());
                self.curves[trunk].set_right(start.length, right);
                self.curves[trunk].set_lean(lean);
                if let Some(reach) = doubtful {
                    self.layout.doubt(trunk, start.length, lean.to.max(start.length + reach));
                }
                (start, Some(edge))
            }
            None => {
                self.layout.begin(None, self.cage.corners.len());
                let sides = self.shape.sides_of(self.curves[trunk].radius_at(0.0));
                (Start { length: 0.0, normal: Vec3::ZERO, columns: Columns::even(sides, FRAC_PI_4), sides }, None)
            }
        };
        self.find_exits(trunk);
        let curve = &self.curves[trunk];
        let from = start.length + if edge.is_some() { 0.3 * curve.radius_at(start.length) } else { 0.0 };
        let mut rows = rows(curve, &self.exits, self.shape, from, curve.length());
        for row in &rows {
            let count = row.openings.len();
            self.report.joined += if count > 1 { count } else { 0 };
            self.report.shortened += if row.is_shortened() { count } else { 0 };
            self.report.moved += if row.is_moved() { count } else { 0 };
        }
        let spoke = self.spoke_at(trunk, &start);
        self.rings.lay(curve, &start, &mut rows, self.shape, spoke);
        for row in &rows {
            if let Some(reach) = self.doubtful(row, self.curves[trunk].radius_at(row.length)) {
                self.layout.doubt(trunk, row.length - reach, row.length + reach);
            }
        }
        for ring in self.rings.rings.iter().filter(|ring| ring.is_doubtful) {
            let reach = DOUBTFUL * ring.station.radius;
            self.layout.doubt(trunk, ring.length - reach, ring.length + reach);
        }
        self.add_rings(trunk);
        self.add_belts(&rows);
        self.add_ends(trunk, edge);
        self.open_holes(trunk, &rows);
    }

    /// Length around a row over which faces may meet others, if its openings may lack room.
    fn doubtful(&self, row: &Row, radius: f32) -> Option<f32> {
        let any = |is: fn(&Exit) -> bool| row.openings.iter().any(|opening| is(&self.exits[opening.exit as usize]));
        if any(|exit| exit.parting.is_some()) {
            return Some(row.half + BESIDE * radius);
        }
        let is_crowded = row.is_shortened() || row.is_moved() || row.openings.len() > 1;
        (is_crowded || any(|exit| exit.is_tight)).then_some(row.half + DOUBTFUL * radius)
    }

    /// The exits of a trunk's laterals. Laterals of one that ends within the trunk leave the trunk itself.
    fn find_exits(&mut self, trunk: usize) {
        let curve = &self.curves[trunk];
        self.exits.clear();
        let root = match self.trunks.base(trunk) {
            Base::Root { at } => Some(curve.length_of(at as usize)),
            Base::Joint { .. } => None,
        };
        let joint = |lateral: u32| match self.trunks.base(lateral as usize) {
            Base::Joint { at, .. } => curve.length_of(at as usize),
            Base::Root { .. } => 0.0,
        };
        // Some leave the vessel that this one leaves.
        let own = self.trunks.laterals(trunk).iter().filter(|&&lateral| self.holes[lateral as usize].is_none());
        let mut pending: Vec<(u32, f32)> = own.rev().map(|&lateral| (lateral, joint(lateral))).collect();
        while let Some((lateral, joint)) = pending.pop() {
            let branch = &self.curves[lateral as usize];
            let mut exit = Exit::new(lateral, curve, joint, branch);
            // It leaves beside the trunk's end, or in the bend of a trunk that runs through a root.
            exit.is_tight |= root == Some(joint);
            self.report.laterals += 1;
            if exit.ends_within(curve, branch) {
                self.holes[lateral as usize] = Some(Hole::Absorbed);
                pending.extend(self.trunks.laterals(lateral as usize).iter().rev().map(|&lateral| (lateral, joint)));
                continue;
            }
            if let Some(parting) = exit.parting {
                // What leaves it before it parts from the trunk leaves the trunk itself.
                let others = self.trunks.laterals(lateral as usize);
                let is_early = |other: &u32| match self.trunks.base(*other as usize) {
                    Base::Joint { at, .. } => branch.length_of(at as usize) < parting.on_lateral,
                    Base::Root { .. } => false,
                };
                pending.extend(others[..others.partition_point(is_early)].iter().rev().map(|&other| {
                    let base = self.curves[other as usize].at(0.0).center;
                    (other, curve.foot(base, parting.on_trunk))
                }));
            }
            self.exits.push(exit);
        }
    }

    /// Vertices of all rings.
    fn add_rings(&mut self, trunk: usize) {
        self.bases.clear();
        let (curve, nodes) = (&self.curves[trunk], self.trunks.nodes(trunk));
        for ring in &self.rings.rings {
            let node = nodes[curve.place_at(ring.length)];
            self.bases.push(self.cage.vertices.positions.len() as u32);
            let radius = ring.station.radius;
            let wide = ring.radius * self.shape.swell(ring.sides);
            for side in 0..ring.sides {
                let (sine, cosine) = ops::sin_cos(self.rings.angles[(ring.first_angle + side) as usize]);
                self.cage.vertices.push(ring.point([cosine, sine], wide), radius, node);
            }
        }
    }

    /// Faces between rings, without those of openings.
    fn add_belts(&mut self, rows: &[Row]) {
        let mut row = 0;
        for belt in 0..self.rings.rings.len() - 1 {
            while row < rows.len() && belt >= (self.rings.of_rows[row] + rows[row].width) as usize {
                row += 1;
            }
            let line = (belt as u32).checked_sub(self.rings.of_rows.get(row).copied().unwrap_or(u32::MAX));
            let openings = if line.is_some() { &rows[row].openings[..] } else { &[] };
            let width = rows.get(row).map_or(0, |row| row.width);
            let is_open = |column: u32, sides: u32| {
                openings.iter().any(|opening| {
                    let lowest = (width - opening.width) / 2;
                    let is_in_line = line.is_some_and(|line| (lowest..lowest + opening.width).contains(&line));
                    is_in_line && (column + sides - opening.column) % sides < opening.width
                })
            };
            self.layout.push_ring(self.rings.rings[belt].length, self.cage.corners.len());
            self.cage.belt(&self.rings.rings[belt..belt + 2], &self.bases[belt..belt + 2], is_open);
        }
    }

    /// The first belt of a lateral from its hole's edge, or a root's end; and the tip's end.
    fn add_ends(&mut self, trunk: usize, edge: Option<Vec<u32>>) {
        let nodes = self.trunks.nodes(trunk);
        let (base_node, node) = (nodes[0], nodes[nodes.len() - 1]);
        let first = self.rings.rings[0];
        let last = self.rings.rings.len() - 1;
        self.layout.push_ring(self.rings.rings[last].length, self.cage.corners.len());
        match edge {
            Some(edge) => self.cage.sleeve(&edge, &first, self.bases[0]),
            None => {
                let before = self.rings.rings[last.min(1)].station.center;
                let base = OpenEnd { ring: first, before, base: self.bases[0], end: End::Base, node: base_node };
                self.end_tube(base, TipCap::Round);
            }
        }
        let (ring, tip) = (self.rings.rings[last], self.cage.corners.len());
        let before = self.rings.rings[last.saturating_sub(1)].station.center;
        self.end_tube(OpenEnd { ring, before, base: self.bases[last], end: End::Tip, node }, self.tips);
        self.layout.end([tip, self.cage.corners.len()]);
    }

    /// Closes the end of a tube, or joins it with the tube that goes on.
    fn end_tube(&mut self, end: OpenEnd, cap: TipCap) {
        let Some(number) = self.looped.at(end.node) else { return end.cap(&mut self.cage, cap) };
        match std::mem::replace(&mut self.seams[number], Seam::Done) {
            Seam::Ahead => self.seams[number] = Seam::Open(end),
            Seam::Open(other) if seams::join(&mut self.cage, &other, &end) => {}
            Seam::Open(other) => {
                other.cap(&mut self.cage, cap);
                end.cap(&mut self.cage, cap);
                self.report.unclosed.push(NodeId(end.node));
            }
            Seam::Done => end.cap(&mut self.cage, cap),
        }
    }

    /// The direction of a vertex that a trunk's last ring should face, if it ends in another tube or in its own beginning.
    fn spoke_at(&self, trunk: usize, start: &Start) -> Option<Vec3> {
        let nodes = self.trunks.nodes(trunk);
        let number = self.looped.at(*nodes.last()?)?;
        match &self.seams[number] {
            Seam::Open(other) => Some(other.spoke(&self.cage)),
            Seam::Ahead if self.looped.at(nodes[0]) == Some(number) => {
                let station = self.curves[trunk].at(start.length);
                let (sine, cosine) = ops::sin_cos(start.columns.at(0.0));
                Some(station.right * cosine + station.up() * sine)
            }
            Seam::Ahead | Seam::Done => None,
        }
    }

    /// Notes a lateral that ends within its trunk. If it was to go on in another tube, that one is closed.
    fn add_absorbed(&mut self, trunk: usize) {
        let corner = self.cage.corners.len();
        self.layout.begin(None, corner);
        let Some(&tip) = self.trunks.nodes(trunk).last() else { return };
        self.report.absorbed.push(NodeId(tip));
        let Some(number) = self.looped.at(tip) else { return };
        match std::mem::replace(&mut self.seams[number], Seam::Done) {
            Seam::Ahead => {}
            Seam::Open(other) => {
                self.layout.push_ring(0.0, corner);
                other.cap(&mut self.cage, self.tips);
                self.layout.end([corner, self.cage.corners.len()]);
            }
            Seam::Done => return,
        }
        self.report.unclosed.push(NodeId(tip));
    }

    /// Tells the laterals where their holes are.
    fn open_holes(&mut self, trunk: usize, rows: &[Row]) {
        for (number, row) in rows.iter().enumerate() {
            let first = self.rings.of_rows[number];
            for opening in &row.openings {
                let exit = self.exits[opening.exit as usize];
                let edge = self.edge_of(first + (row.width - opening.width) / 2, opening, row.sides);
                let hole = self.hole(trunk, [first, first + row.width], row, &exit, opening, edge);
                self.holes[exit.lateral as usize] = Some(hole);
            }
        }
    }

    /// The vertices around an opening, anticlockwise from its first corner.
    fn edge_of(&self, ring: u32, opening: &Opening, sides: u32) -> Vec<u32> {
        let width = opening.width;
        let vertex = |across: u32, along: u32| self.bases[(ring + along) as usize] + (opening.column + across) % sides;
        let lower = (0..width).map(|step| vertex(step, 0));
        let right = (0..width).map(|step| vertex(width, step));
        let upper = (0..width).map(|step| vertex(width - step, width));
        let left = (0..width).map(|step| vertex(0, width - step));
        lower.chain(right).chain(upper).chain(left).collect()
    }

    fn hole(&self, trunk: usize, rings: [u32; 2], row: &Row, exit: &Exit, opening: &Opening, edge: Vec<u32>) -> Hole {
        let ring = &self.rings.rings[((rings[0] + rings[1]) / 2) as usize];
        let station = self.curves[trunk].at(row.length);
        let branch = &self.curves[exit.lateral as usize];
        let middle =
            edge.iter().map(|&vertex| self.cage.vertices.positions[vertex as usize]).sum::<Vec3>() / edge.len() as f32;
        let out = across(middle - station.center, station.ahead);
        let wide = ring.station.radius * self.shape.apothem(row.sides);
        let point = station.center + out * ring.station.radius;
        let lift = exit.lift(branch, &station, wide);
        let aside = point - exit.point;
        let mut shift = aside - out * aside.dot(out);
        let mut reach = (LEAN * shift.length()).max(2.0 * exit.radius);
        if let Some(parting) = exit.parting {
            // Half in its trunk it would have no room for its first ring.
            let height = (branch.at(lift).center - station.center).dot(out);
            shift += out * (wide + CLEAR * exit.radius - height).max(0.0);
            if !parting.is_clear {
                // It ends before it could come back to its centre line.
                reach = reach.max(FOR_GOOD * (branch.length() - lift));
            }
        }
        let lean = Lean { shift, from: lift, to: lift + reach };
        let begin = branch.at(lift);
        let normal = unit(begin.ahead + out).unwrap_or(begin.ahead);
        let sides = 4 * opening.width;
        let start = Start { length: lift, normal, columns: Columns::even(sides, -3.0 * FRAC_PI_4), sides };
        let mouth = Mouth { trunk: trunk as u32, rings };
        Hole::Open {
            start,
            right: station.ahead.cross(out),
            lean,
            edge,
            mouth,
            doubtful: self.doubtful(row, station.radius),
        }
    }
}
