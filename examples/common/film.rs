//! Blood on the organ: a film that wells up, runs down and pools, and moves with the breathing organ.
//!
//! The film is a depth on each cell of the [`Skin`]. A thin layer sticks; blood above it runs down the slope as fast as
//! a thin film does, and its depth spreads it. At the edge it rises before it wets dry cells. None is lost: blood that
//! hangs from the underside drips off. Blood that rests clots.

use super::{skin::Skin, surface::Surface};
use bevy::prelude::*;
use bevy_vessels::synthesis::{mesh::SurfacePoint, units::Volume};

/// Longest step of the flow, in seconds.
const STEP: f32 = 0.008;
/// Depth that sticks to tissue, depth at the edge before it wets dry cells, and depth at which drops fall from the
/// underside, in metres.
const STICKS: f32 = 0.000_12;
const STANDS: f32 = 0.000_55;
const DRIPS: f32 = 0.0022;
/// Share of the blood around a drop that falls with it.
const GATHERED: f32 = 0.7;
/// Speed of a thin film on a slope, in metres a second per square metre of squared depth: weight over three times the
/// viscosity; and its largest speed.
const MOBILITY: f32 = 1060.0 * 9.81 / (3.0 * 0.0035);
const FASTEST: f32 = 0.09;
/// Spreading of a film by its depth, relative to its weight: surface tension, and tissue that it wets.
const SPREAD: f32 = 1.5;
/// Seconds in which two thirds of resting blood clot, and the share of a cell's blood that must pass in a step for the
/// cell not to rest.
const CLOTS: f32 = 90.0;
const RESTS: f32 = 0.002;

/// The film on the organ.
#[derive(Resource)]
pub struct Film {
    /// The cells.
    pub skin: Skin,
    /// Metres of a world unit.
    pub unit: f32,
    /// Depth on each cell, in metres.
    pub depths: Vec<f32>,
    /// Cells that have ever been wet.
    pub wet: Vec<u32>,
    is_wet: Vec<bool>,
    /// Change of each depth in a step.
    changes: Vec<f32>,
    /// Time since the film began, and when blood last ran through each cell, in seconds.
    now: f32,
    ran: Vec<f32>,
    /// Neighbours of a cell, while it flows.
    around: Vec<u32>,
}

impl Film {
    /// No blood yet.
    pub fn new(surface: &Surface, unit: f32) -> Self {
        let skin = Skin::new(surface.at_rest());
        let cells = skin.positions.len();
        Self {
            skin,
            unit,
            depths: vec![0.0; cells],
            wet: Vec::new(),
            is_wet: vec![false; cells],
            changes: vec![0.0; cells],
            now: 0.0,
            ran: vec![0.0; cells],
            around: Vec::new(),
        }
    }

    /// The clotted share of the blood on a cell.
    pub fn clotted(&self, cell: u32) -> f32 {
        1.0 - ops::exp((self.ran[cell as usize] - self.now) / CLOTS)
    }

    /// Adds blood at a place on the surface at rest: half of it to the nearest cell, half to those around it.
    pub fn add(&mut self, place: &SurfacePoint, volume: Volume) {
        let cell = self.skin.nearest(place);
        let around: Vec<u32> = self.skin.neighbours(cell).collect();
        let cubic_metres = volume.cubic_metres() as f32;
        let share = 0.5 / around.len().max(1) as f32;
        let here = if around.is_empty() { 1.0 } else { 0.5 };
        for (cell, share) in around.iter().map(|&cell| (cell, share)).chain([(cell, here)]) {
            self.depths[cell as usize] += share * cubic_metres / self.area(cell);
            self.ran[cell as usize] = self.now;
            self.moisten(cell);
        }
    }

    /// In square metres; cells of triangles without area have a little.
    fn area(&self, cell: u32) -> f32 {
        (self.skin.areas[cell as usize] * self.unit * self.unit).max(1.0e-8)
    }

    fn moisten(&mut self, cell: u32) {
        if !std::mem::replace(&mut self.is_wet[cell as usize], true) {
            self.wet.push(cell);
        }
    }

    /// Lets the film flow. Calls `drip` for blood that falls off, with the point at rest and the normal.
    pub fn flow(&mut self, seconds: f32, mut drip: impl FnMut(Vec3, Vec3, Volume)) {
        self.now += seconds;
        let steps = (seconds / STEP).ceil();
        for _ in 0..steps as u32 {
            for index in 0..self.wet.len() {
                self.flow_from(self.wet[index], seconds / steps);
            }
            for index in 0..self.wet.len() {
                let cell = self.wet[index] as usize;
                self.depths[cell] += std::mem::take(&mut self.changes[cell]);
            }
        }
        for index in 0..self.wet.len() {
            let cell = self.wet[index];
            if self.depths[cell as usize] > DRIPS && self.skin.normals[cell as usize].y < -0.25 {
                let volume = self.gather(cell);
                drip(self.skin.positions[cell as usize], self.skin.normals[cell as usize], volume);
            }
        }
    }

    /// Takes the blood of a drop: all that hangs from a cell, and most from the cells beside it.
    fn gather(&mut self, cell: u32) -> Volume {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(self.skin.neighbours(cell));
        let mut cubic_metres = 0.0;
        for (share, from) in std::iter::once((1.0, cell)).chain(around.iter().map(|&beside| (GATHERED, beside))) {
            let falls = share * (self.depths[from as usize] - 2.0 * STICKS).max(0.0);
            self.depths[from as usize] -= falls;
            cubic_metres += falls * self.area(from);
        }
        self.around = around;
        Volume::from_cubic_metres(f64::from(cubic_metres))
    }

    /// Lets the blood on a cell run down, and spread to neighbours with less.
    fn flow_from(&mut self, cell: u32, seconds: f32) {
        let free = self.depths[cell as usize] - STICKS;
        if free <= 0.0 {
            return;
        }
        let mobility = MOBILITY * free * free;
        let downhill = self.skin.downhill(cell);
        let (volume, area) = (free * self.area(cell), self.area(cell));
        if let Some(way) = self.skin.way(cell, downhill) {
            let speed = (mobility * downhill.length()).min(FASTEST);
            let leaves = volume * (speed * seconds / (way.length * self.unit).max(1.0e-5)).min(0.45);
            for (to, share) in way.shares {
                self.pass(cell, to, leaves * share);
            }
        }
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(self.skin.neighbours(cell));
        for &to in &around {
            let length = (self.skin.distance(cell, to) * self.unit).max(1.0e-5);
            let lower = self.depths[cell as usize] - self.depths[to as usize];
            if lower > 0.0 {
                let speed = mobility * SPREAD * lower / length;
                // Never so much that it would be deeper there than here.
                let most = 0.06 * lower * area.min(self.area(to));
                self.pass(cell, to, (volume * speed * seconds / length).min(most));
            }
        }
        self.around = around;
    }

    /// Passes blood on at the end of the step: to a dry cell only if it is deep enough.
    fn pass(&mut self, from: u32, to: u32, volume: f32) {
        if self.depths[to as usize] > 0.5 * STICKS || self.depths[from as usize] > STANDS {
            self.changes[from as usize] -= volume / self.area(from);
            self.changes[to as usize] += volume / self.area(to);
            self.moisten(to);
            if volume > RESTS * self.depths[to as usize] * self.area(to) {
                self.ran[to as usize] = self.now;
            }
        }
    }
}
