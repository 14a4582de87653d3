//! Nodes bound to tetrahedra.

use super::WORTH_SHARING;
use crate::synthesis::{
    mesh::{TetMesh, tet_mesh::edges, triangle_index::closest_on_triangle},
    parallel,
    space::bvh::{Bounds, BoxTree},
};
use bevy_math::{DVec3, Vec3};

/// A point's weights for the last three corners of a tetrahedron; the four sum to 1.
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
    /// Weights of the last three corners; the four sum to 1.
    weights: Vec3,
}

#[derive(Clone, Debug)]
pub(super) struct SolidBonds {
    mesh: TetMesh,
    tree: BoxTree,
    /// Number of each slot's tetrahedron.
    tetrahedra: Vec<u32>,
    bonds: Vec<Bond>,
}

impl SolidBonds {
    pub fn new(mesh: &TetMesh) -> Self {
        let numbers: Vec<u32> =
            (0..mesh.tetrahedra().len() as u32).filter(|&number| !mesh.is_degenerate(number as usize)).collect();
        let tree = BoxTree::new(numbers.iter().map(|&number| Bounds::around(&mesh.corners(number as usize))));
        let tetrahedra = tree.order().iter().map(|&id| numbers[id as usize]).collect();
        Self { mesh: mesh.clone(), tree, tetrahedra, bonds: Vec::new() }
    }

    pub fn len(&self) -> usize {
        self.bonds.len()
    }

    pub fn vertices(&self) -> usize {
        self.mesh.positions().len()
    }

    /// Binds the nodes from a number on.
    pub fn bind(&mut self, from: usize, nodes: &[Vec3]) {
        self.bonds.truncate(from);
        for &node in &nodes[from..] {
            let tetrahedron = self.nearest(node);
            let weights = weights(node, self.mesh.corners(tetrahedron)).as_vec3();
            self.bonds.push(Bond { corners: self.mesh.tetrahedra()[tetrahedron], weights });
        }
    }

    /// The first of the tetrahedra nearest to a point.
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

    pub fn follow(&self, vertices: &[Vec3], positions: &mut [Vec3]) {
        parallel::map_all(&self.bonds, positions, WORTH_SHARING, |_, bond| {
            let [a, b, c, d] = bond.corners.map(|corner| vertices[corner as usize]);
            a + (b - a) * bond.weights.x + (c - a) * bond.weights.y + (d - a) * bond.weights.z
        });
    }
}
