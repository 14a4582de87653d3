//! Nodes bound to tetrahedra.

use crate::synthesis::{
    mesh::{TetMesh, tet_mesh::edges, triangle_index::closest_on_triangle},
    pace::{Pace, SHORT_STRETCH},
    parallel,
    space::bvh::{Bounds, BoxTree},
};
use bevy_math::{DVec3, Vec3};
use std::ops::Range;

/// Fewest nodes worth handing to another thread.
const WORTH_SHARING: usize = 2048;

/// A point's weights for the last three corners of a tetrahedron; all four sum to 1.
fn weights(point: Vec3, corners: [Vec3; 4]) -> DVec3 {
    edges(corners).inverse() * (point.as_dvec3() - corners[0].as_dvec3())
}

/// Squared distance of a point from a tetrahedron, 0 inside.
fn distance_squared(point: Vec3, corners: [Vec3; 4]) -> f64 {
    let weights = weights(point, corners);
    if weights.min_element() >= 0.0 && weights.element_sum() <= 1.0 {
        return 0.0;
    }
    let [a, b, c, d] = corners;
    let to_face = |face| (closest_on_triangle(point, face).1 - point.as_dvec3()).length_squared();
    [[a, b, c], [a, b, d], [a, c, d], [b, c, d]].map(to_face).into_iter().fold(f64::INFINITY, f64::min)
}

/// A node's place relative to a tetrahedron.
#[derive(Clone, Copy, Debug)]
struct Bond {
    corners: [u32; 4],
    /// Weights of the last three corners; all four sum to 1.
    weights: Vec3,
}

#[derive(Clone, Debug)]
pub(super) struct SolidBonds {
    elements: Elements,
    bonds: Vec<Bond>,
}

/// The tetrahedra at rest, with an index over them.
#[derive(Clone, Debug)]
struct Elements {
    mesh: TetMesh,
    tree: BoxTree,
    /// Number of each slot's tetrahedron.
    tetrahedra: Vec<u32>,
}

impl SolidBonds {
    pub async fn new(mesh: &TetMesh, pace: &Pace) -> Self {
        let mut numbers: Vec<u32> = Vec::with_capacity(mesh.tetrahedra().len());
        let take = |number: usize| {
            if !mesh.is_degenerate(number) {
                numbers.push(number as u32);
            }
        };
        pace.part(0.0..0.1).each(mesh.tetrahedra().len(), take).await;
        let bounds = |id: usize| Bounds::around(&mesh.corners(numbers[id] as usize));
        let tree = BoxTree::new_paced(numbers.len(), bounds, &pace.part(0.1..1.0)).await;
        let tetrahedra = tree.order().iter().map(|&id| numbers[id as usize]).collect();
        Self { elements: Elements { mesh: mesh.clone(), tree, tetrahedra }, bonds: Vec::new() }
    }

    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    pub fn vertices(&self) -> usize {
        self.elements.mesh.positions().len()
    }

    /// Binds the nodes from a number on.
    pub async fn bind(&mut self, from: usize, nodes: &[Vec3], pace: &Pace) {
        self.bonds.truncate(from);
        let Self { elements, bonds } = self;
        let nodes = &nodes[from..];
        let bind = |stretch: Range<usize>| {
            for &node in &nodes[stretch] {
                let tetrahedron = elements.nearest(node);
                let weights = weights(node, elements.mesh.corners(tetrahedron)).as_vec3();
                bonds.push(Bond { corners: elements.mesh.tetrahedra()[tetrahedron], weights });
            }
        };
        pace.stretches(nodes.len(), SHORT_STRETCH, bind).await;
    }

    pub fn follow(&self, vertices: &[Vec3], positions: &mut [Vec3]) {
        parallel::map_all(&self.bonds, positions, WORTH_SHARING, |_, bond| {
            let [a, b, c, d] = bond.corners.map(|corner| vertices[corner as usize]);
            a + (b - a) * bond.weights.x + (c - a) * bond.weights.y + (d - a) * bond.weights.z
        });
    }
}

impl Elements {
    /// The tetrahedron nearest to a point; of equally near ones, the first.
    fn nearest(&self, point: Vec3) -> usize {
        let mut found = (f64::INFINITY, u32::MAX);
        self.tree.nearest(point, f32::INFINITY, |slot, best| {
            let tetrahedron = self.tetrahedra[slot];
            let offer = (distance_squared(point, self.mesh.corners(tetrahedron as usize)), tetrahedron);
            if offer >= found {
                return best;
            }
            found = offer;
            offer.0 as f32
        });
        found.1 as usize
    }
}
