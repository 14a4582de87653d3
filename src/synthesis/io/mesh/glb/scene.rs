//! Where the nodes of a scene stand.

use super::super::read::MeshDataError;
use super::{
    budget::Budget,
    document::{Document, Node, find},
};
use bevy_math::{DAffine3, DMat4, DQuat, DVec3, Mat4, Quat, Vec3};

/// A mesh, where a node places it.
pub(super) struct Placed<'a> {
    pub(super) node: &'a Node,
    pub(super) mesh: u32,
    pub(super) transform: DAffine3,
}

/// The meshes of the scene that is shown: the default one, or the first, or all nodes where there is no scene.
///
/// Hidden nodes are left out, with their children.
pub(super) fn placed_meshes<'a>(document: &'a Document, budget: &Budget) -> Result<Vec<Placed<'a>>, MeshDataError> {
    let scene = match document.scene {
        Some(scene) => Some(find(&document.scenes, scene, "a scene")?),
        None => document.scenes.first(),
    };
    let tops = scene.map_or_else(|| top_nodes(document), |scene| scene.nodes.clone());
    let mut meshes = Vec::new();
    walk(document, tops, |index, transform| {
        let node = &document.nodes[index as usize];
        let visibility = node.extensions.as_ref().and_then(|extensions| extensions.visibility.as_ref());
        if visibility.is_some_and(|visibility| !visibility.visible) {
            return Ok(false);
        }
        if let Some(mesh) = node.mesh {
            budget.take(1, size_of::<Placed>() as u64)?;
            meshes.push(Placed { node, mesh, transform });
        }
        Ok(true)
    })?;
    Ok(meshes)
}

/// The transform of every node, also of those in other scenes: joints may be anywhere. `None` for nodes in a circle.
pub(super) fn transforms(document: &Document, budget: &Budget) -> Result<Vec<Option<DAffine3>>, MeshDataError> {
    budget.take(document.nodes.len(), size_of::<Option<DAffine3>>() as u64)?;
    let mut transforms = vec![None; document.nodes.len()];
    walk(document, top_nodes(document), |index, transform| {
        transforms[index as usize] = Some(transform);
        Ok(true)
    })?;
    Ok(transforms)
}

/// Visits nodes and their children with their transforms, in the order of the file. Children of a node for which
/// `visit` returns false are left out.
fn walk(
    document: &Document,
    tops: Vec<u32>,
    mut visit: impl FnMut(u32, DAffine3) -> Result<bool, MeshDataError>,
) -> Result<(), MeshDataError> {
    // From a stack: reversed, so that nodes come in the order of the file. Siblings share their parent's transform.
    let mut parents = vec![DAffine3::IDENTITY];
    let mut pending: Vec<(u32, u32)> = tops.into_iter().rev().map(|node| (node, 0)).collect();
    let mut seen = vec![false; document.nodes.len()];
    while let Some((index, parent)) = pending.pop() {
        let node = find(&document.nodes, index, "a node")?;
        if std::mem::replace(&mut seen[index as usize], true) {
            return Err(MeshDataError::content("a node is reached twice; nodes must form a tree"));
        }
        // The stack is deepest here: no later node has a parent above this one.
        parents.truncate(parent as usize + 1);
        let transform = parents[parent as usize] * local_transform(node)?;
        if !transform.is_finite() {
            return Err(MeshDataError::content("the transform of a node is not finite; repair it"));
        }
        if visit(index, transform)? {
            let children = node.children.iter().flatten();
            pending.extend(children.rev().map(|&child| (child, parent + 1)));
            parents.push(transform);
        }
    }
    Ok(())
}

/// The nodes that are no child.
fn top_nodes(document: &Document) -> Vec<u32> {
    let mut is_child = vec![false; document.nodes.len()];
    for &index in document.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(is_child) = is_child.get_mut(index as usize) {
            *is_child = true;
        }
    }
    (0..).zip(is_child).filter(|(_, is_child)| !is_child).map(|(index, _)| index).collect()
}

fn local_transform(node: &Node) -> Result<DAffine3, MeshDataError> {
    if let Some(matrix) = &node.matrix {
        return affine(matrix);
    }
    let [translation, scale] = [(&node.translation, Vec3::ZERO), (&node.scale, Vec3::ONE)]
        .map(|(given, default)| given.as_deref().map_or(default, |&given| Vec3::from_array(given)).as_dvec3());
    placed(translation, node.rotation.as_deref().copied(), scale)
}

/// A transform of its parts, as nodes and instances have it.
pub(super) fn placed(translation: DVec3, rotation: Option<[f32; 4]>, scale: DVec3) -> Result<DAffine3, MeshDataError> {
    let rotation = rotation.map_or(DQuat::IDENTITY, |rotation| Quat::from_array(rotation).as_dquat());
    let length = rotation.length();
    if !(length.is_finite() && length > 0.0) {
        return Err(MeshDataError::content("a rotation is zero or not finite; repair it"));
    }
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
}

/// A matrix in columns as a transform.
pub(super) fn affine(columns: &[f32; 16]) -> Result<DAffine3, MeshDataError> {
    let matrix = Mat4::from_cols_array(columns).as_dmat4();
    let last = matrix.row(3);
    // Written as rows, a matrix has its translation there.
    const TOLERANCE: f64 = 1e-5;
    if !(last - DMat4::IDENTITY.row(3)).abs().cmple(bevy_math::DVec4::splat(TOLERANCE)).all() {
        return Err(MeshDataError::content("the last row of a matrix is not 0 0 0 1; repair it"));
    }
    Ok(DAffine3::from_mat4(matrix))
}
