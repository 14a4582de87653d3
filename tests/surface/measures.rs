//! What the tests measure on a surface, and demand of each.

use bevy_math::{DVec3, Vec3};
use bevy_vessels::synthesis::{
    segment_index::{SegmentIndex, overlaps, start_radius},
    surface::{ClosingVessel, Surface, SurfaceMesh, SurfaceSettings},
    tree::{NO_PARENT, NodeId, VesselTree},
};
use std::{fs, path::Path};

/// The surface of a tree, which must be closed, oriented and finite, a ball for each root, without a face of no area.
pub fn sound_surface(name: &str, tree: &VesselTree, settings: &SurfaceSettings) -> Surface {
    let surface = Surface::new(tree, settings).expect(name);
    let mesh = &surface.mesh;
    let closure = mesh.closure();
    assert!(closure.is_closed() && closure.is_oriented() && closure.is_manifold(), "{name}: {closure:?}");
    let roots = tree.roots().count();
    assert_eq!((closure.euler(), closure.components), (2 * roots as i64, roots), "{name}: {closure:?}");
    assert_eq!(closure.vertices, mesh.unique(), "{name}: vertices without a face");
    assert_eq!(closure.degenerate_faces, 0, "{name}: faces without area");
    let unit = |vector: Vec3| (vector.length() - 1.0).abs() < 1e-3;
    assert!(mesh.positions.iter().all(|position| position.is_finite()), "{name}: positions");
    assert!(mesh.normals.iter().all(|normal| unit(*normal)), "{name}: normals");
    assert!(
        mesh.tangents().iter().all(|tangent| unit(tangent.truncate()) && tangent.w.abs() == 1.0),
        "{name}: tangents"
    );
    assert!(mesh.uvs.iter().all(|uv| uv.is_finite()), "{name}: texture coordinates");
    assert!(mesh.nodes.iter().all(|&node| (node as usize) < tree.len()), "{name}: nodes");
    surface
}

/// Volume enclosed by a mesh.
pub fn volume(mesh: &SurfaceMesh) -> f64 {
    let origin = mesh.positions.first().copied().unwrap_or_default();
    let signed = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|corner| (mesh.positions[corner as usize] - origin).as_dvec3());
        a.dot(b.cross(c)) / 6.0
    };
    mesh.closed_triangles().map(signed).sum()
}

/// Whether a point is in the round cone of a node's segment: in one of the balls between its ends.
fn is_inside(tree: &VesselTree, node: usize, point: Vec3) -> bool {
    let parent = tree.parents()[node];
    if parent == NO_PARENT {
        return false;
    }
    let [a, b] = [parent as usize, node].map(|node| tree.positions()[node].as_dvec3());
    let [from, to] = [start_radius(tree, node), tree.radii()[node]].map(f64::from);
    let (along, widening, point) = (b - a, to - from, point.as_dvec3() - a);
    let square = along.length_squared();
    let slant = square - widening * widening;
    let share = if slant > 0.0 {
        let foot = along.dot(point) / square;
        let aside: DVec3 = point - along * foot;
        foot + widening * aside.length() / (square.sqrt() * slant.sqrt())
    } else {
        f64::from(u8::from(widening > 0.0))
    };
    let share = share.clamp(0.0, 1.0);
    (point - along * share).length() <= from + share * widening
}

/// Volume of the union of a tree's round cones, by random points in each cone's box: each counts for the cones that hold
/// it in equal parts.
pub fn union_volume(tree: &VesselTree, points: usize) -> f64 {
    let index = SegmentIndex::new(tree);
    let boxes: Vec<(usize, Vec3, Vec3)> = tree
        .segments()
        .map(|(node, parent)| {
            let (start, end) = (tree.positions()[parent], tree.positions()[node]);
            let (from, to) = (start_radius(tree, node), tree.radii()[node]);
            (node, (start - from).min(end - to), (start + from).max(end + to))
        })
        .collect();
    let size = |low: Vec3, high: Vec3| (high - low).as_dvec3().element_product();
    let total: f64 = boxes.iter().map(|&(_, low, high)| size(low, high)).sum();
    let mut random = 88_172_645_463_325_252u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut union = 0.0;
    for (node, low, high) in boxes {
        let count = (points as f64 * size(low, high) / total).max(8.0).ceil();
        let mut sum = 0.0;
        for _ in 0..count as usize {
            let point = low + (high - low) * Vec3::new(next(), next(), next());
            if is_inside(tree, node, point) {
                let mut holders = 0u32;
                index.candidates(point, point, |other| holders += u32::from(is_inside(tree, other.index(), point)));
                sum += 1.0 / f64::from(holders.max(1));
            }
        }
        union += size(low, high) * sum / count;
    }
    union
}

/// The same tree with all radii times a factor.
pub fn widened(tree: &VesselTree, factor: f32) -> VesselTree {
    let radii = tree.radii().iter().map(|radius| radius * factor).collect();
    VesselTree::from_arrays(tree.positions().to_vec(), tree.parents().to_vec(), radii).expect("a tree")
}

/// The vessels that close a network's loops, from pairs of ids in a file beside its SWC, whose ids count from 1.
pub fn loops_of(path: &Path, tree: &VesselTree) -> Vec<ClosingVessel> {
    let text = fs::read_to_string(path).expect("pairs of ids");
    let pair = |line: &str| {
        let ids = line.split(',').map(|id| NodeId(id.trim().parse::<u32>().expect("an id") - 1));
        let [a, b] = ids.collect::<Vec<_>>()[..] else { panic!("no pair: {line}") };
        ClosingVessel::between(tree, a, b)
    };
    text.lines().skip(1).map(pair).collect()
}

/// How many triangles of a surface meet others, and how many of these are not near segments that run through each other.
pub fn meeting(tree: &VesselTree, mesh: &SurfaceMesh) -> [usize; 2] {
    let check = mesh.validate();
    if check.intersections.is_empty() {
        return [0; 2];
    }
    let mut is_near = vec![false; tree.len()];
    for NodeId(node) in overlaps(tree, &SegmentIndex::new(tree)).into_iter().flatten() {
        is_near[node as usize] = true;
    }
    // Their ends reach over the next two segments.
    for _ in 0..2 {
        let before = is_near.clone();
        for (node, parent) in tree.segments() {
            is_near[node] |= before[parent];
            is_near[parent] |= before[node];
        }
    }
    let mut triangles: Vec<u32> = check.intersections.into_iter().flatten().collect();
    triangles.sort_unstable();
    triangles.dedup();
    let corners: Vec<[u32; 3]> = mesh.closed_triangles().collect();
    let node = |triangle: &u32| mesh.nodes[corners[*triangle as usize][0] as usize];
    [triangles.len(), triangles.iter().filter(|triangle| !is_near[node(triangle) as usize]).count()]
}
