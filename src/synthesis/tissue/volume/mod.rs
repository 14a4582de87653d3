//! The inside of an organ's mesh as a tissue.
//!
//! The inside is where the winding number is not zero. That tolerates duplicated vertices, small holes, overlapping and
//! nested shells, and triangles that face the wrong way.

mod entry;
mod solid;
mod thin;

use crate::synthesis::{
    mesh::{TriangleIndex, TriangleMesh, doubled_normal},
    pace::{Pace, SHORT_STRETCH, at_once},
    random::{Stream, VesselRng},
    tissue::{Derived, Extent, Tissue, TissuePoint, error::TissueError},
};
use bevy_math::{DVec3, Vec3, bounding::Aabb3d};
use entry::{Entries, last_inside};
use rand::RngExt;
use solid::{EVEN_STEPS, Solid};
use std::ops::Range;
use thin::Thin;

/// The space that a mesh encloses.
#[derive(Clone, Debug)]
pub struct MeshVolume {
    solid: Solid,
    extent: Extent,
    /// Draws points where voxels hold too few.
    thin: Option<Thin>,
    entries: Entries,
    derived: Derived,
}

impl MeshVolume {
    /// Default number of voxels along the longest side of the mesh's box.
    pub const DEFAULT_RESOLUTION: u32 = 128;

    /// Points in the touched voxels that measure the volume.
    const PROBES: usize = 1 << 16;
    /// Most draws for a sample from voxels.
    const TRIES: u32 = 128;
    /// Share of the voxels that are inside or touched which the inside must fill for points to be drawn from voxels.
    const LEAST_SHARE: f64 = 1.0 / 8.0;
    /// Points inside that are kept.
    const ANCHORS: usize = 256;
    /// Factor by which rounding may make a step longer than it should be.
    const LONGER: f32 = 1.0 + 1e-5;

    /// Voxelises a mesh with `resolution` voxels along the longest side of its box.
    ///
    /// More voxels take more memory and make drawing samples a little faster; the boundary is that of the mesh at any
    /// resolution, and parts thinner than a voxel are filled, too. Holes in the mesh are closed best when they are
    /// smaller than the organ is thick.
    ///
    /// # Errors
    /// [`TissueError::Voxels`] for a resolution that cannot be used with this mesh, [`TissueError::NoInside`] for a
    /// mesh that encloses nothing.
    pub fn new(mesh: &TriangleMesh, resolution: u32) -> Result<Self, TissueError> {
        at_once(Self::new_paced(mesh, resolution, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(mesh: &TriangleMesh, resolution: u32, pace: &Pace) -> Result<Self, TissueError> {
        let solid = Solid::new_paced(mesh, resolution, &pace.part(0.0..0.89)).await?;
        let voxels = (solid.whole.len() + solid.touched_voxels()) as f64 * solid.grid.cell().powi(3);
        let mut volume = f64::from(measure(&solid, &pace.part(0.89..0.94)).await);
        let thin = if volume < Self::LEAST_SHARE * voxels {
            let thin = Thin::new_paced(&solid, &pace.part(0.94..0.99)).await;
            volume = thin.volume();
            Some(thin)
        } else {
            None
        };
        let area = area(&solid, &pace.part(0.99..1.0)).await;
        let extent = Extent::solid(volume as f32, area as f32);
        let mut tissue = Self { solid, extent, thin, entries: Entries::default(), derived: Derived::default() };
        if !(volume as f32 > 0.0) {
            return Err(TissueError::NoInside { resolution });
        }
        let mut rng = Stream::Tissue.rng(0);
        tissue.entries = Entries::new((0..Self::ANCHORS).filter_map(|_| tissue.sample(&mut rng)).collect());
        Ok(tissue)
    }

    /// Length of a voxel's side, in tissue lengths.
    pub fn voxel_size(&self) -> f32 {
        self.solid.grid.cell() as f32
    }

    /// The index over the mesh's triangles, welded and without repeats.
    pub fn index(&self) -> &TriangleIndex {
        &self.solid.index
    }
}

/// Volume: whole voxels, plus touched ones by the share of their points that are inside.
async fn measure(solid: &Solid, pace: &Pace) -> f32 {
    const PROBES: usize = MeshVolume::PROBES;
    let is_inside = |probe: &usize| {
        let slot = probe * solid.touched_voxels() / PROBES;
        let corner = solid.grid.corner(solid.touched_voxel(slot));
        solid.is_inside(slot, solid.grid.global(corner + (EVEN_STEPS * (*probe as f64)).fract()))
    };
    let mut inside = 0;
    let count = |probes: Range<usize>| inside += probes.filter(is_inside).count();
    pace.stretches(PROBES, SHORT_STRETCH, count).await;
    let share = inside as f64 / PROBES as f64;
    let cell = solid.grid.cell();
    ((solid.whole.len() as f64 + share * solid.touched_voxels() as f64) * cell * cell * cell) as f32
}

/// Area of the mesh, each of its triangles once.
async fn area(solid: &Solid, pace: &Pace) -> f64 {
    let faces = solid.index.triangles();
    pace.sum(faces.len(), |face| 0.5 * doubled_normal(solid.corners[faces[face] as usize]).length()).await
}

impl Tissue for MeshVolume {
    fn bounds(&self) -> Aabb3d {
        self.solid.bounds
    }

    fn derived(&self) -> Option<&Derived> {
        Some(&self.derived)
    }

    fn extent(&self) -> Extent {
        self.extent
    }

    fn contains(&self, point: Vec3) -> bool {
        self.solid.contains(point)
    }

    fn closest_point(&self, point: Vec3) -> TissuePoint {
        let nearest = || self.entries.nearest(&self.solid, point).unwrap_or(point);
        TissuePoint::new(if self.contains(point) { point } else { nearest() }, Vec3::ZERO)
    }

    /// Straight on; from outside, to the nearest point inside; no further than to the surface if that lies beyond a gap.
    fn walk(
        &self,
        from: &TissuePoint,
        direction: Vec3,
        length: f32,
        _tolerance: f32,
        arrive: &mut dyn FnMut(TissuePoint),
    ) {
        let end = from.position + direction * length;
        let found = self.closest_point(end);
        if found.position.distance(from.position) <= length * Self::LONGER {
            arrive(found);
        } else if self.contains(from.position) {
            arrive(TissuePoint::new(last_inside(&self.solid, from.position, end), Vec3::ZERO));
        }
    }

    fn depth(&self, point: Vec3) -> Option<f32> {
        let distance = self.solid.index.closest(point)?.distance_squared.sqrt();
        Some(if self.contains(point) { distance } else { -distance })
    }

    fn depth_is_searched(&self) -> bool {
        true
    }

    fn sample(&self, rng: &mut VesselRng) -> Option<Vec3> {
        if let Some(thin) = &self.thin {
            return thin.sample(&self.solid, rng);
        }
        let whole = &self.solid.whole;
        let voxels = whole.len() + self.solid.touched_voxels();
        for _ in 0..Self::TRIES {
            let pick = rng.random_range(0..voxels as u32) as usize;
            let voxel = match pick.checked_sub(whole.len()) {
                None => whole[pick] as usize,
                Some(slot) => self.solid.touched_voxel(slot),
            };
            let within = DVec3::new(rng.random(), rng.random(), rng.random());
            let point = self.solid.grid.global(self.solid.grid.corner(voxel) + within);
            if self.solid.closed && pick < whole.len() || self.contains(point) {
                return Some(point);
            }
        }
        None
    }
}
