//! An organ of tetrahedra.

use bevy_math::Vec3;
use bevy_vessels::synthesis::mesh::TetMesh;

/// A cube around the origin, of `cells`³ cells with six tetrahedra in each: Kuhn's, along the edges of a cell from one
/// corner to the opposite, in every order of the axes.
pub fn solid_box(cells: u32, side: f32) -> TetMesh {
    let points = cells + 1;
    let number = |[x, y, z]: [u32; 3]| x + points * (y + points * z);
    let grid = |n: u32| (0..n * n * n).map(move |cell| [cell % n, cell / n % n, cell / n / n]);
    let coordinate = |i: u32| side * (i as f32 / cells as f32 - 0.5);
    let positions = grid(points).map(|at| Vec3::from_array(at.map(coordinate))).collect();
    let tetrahedron = |mut at: [u32; 3], order: [usize; 3]| {
        let mut corners = [number(at); 4];
        for (corner, axis) in corners[1..].iter_mut().zip(order) {
            at[axis] += 1;
            *corner = number(at);
        }
        corners
    };
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let tetrahedra = grid(cells).flat_map(|cell| orders.map(|order| tetrahedron(cell, order))).collect();
    TetMesh::new(positions, tetrahedra).expect("tetrahedra")
}
