//! Where the vertices of a part stand: moved by their node, or by the joints of a skin, once morphed.

use super::super::read::MeshDataError;
use super::{
    data::{Data, Elements},
    document::{Document, Mesh, Node, Primitive, Shape, Skin, find},
    scene::{affine, transforms},
};
use bevy_math::{DAffine3, DMat3, DVec3, Vec3};

/// What moves the vertices of a node's mesh.
pub(super) enum Motion {
    /// All alike.
    Rigid(DAffine3),
    /// Each with its joints: from the mesh to the scene, by section 3.7.3 of the glTF 2.0 specification.
    Skinned(Vec<DAffine3>),
}

impl Motion {
    /// Whether nothing with an area is left: at most one axis keeps a length. So nodes are hidden.
    pub(super) fn leaves_nothing(&self) -> bool {
        let Self::Rigid(transform) = self else { return false };
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = transform.matrix3;
        [x.cross(y), y.cross(z), z.cross(x)] == [DVec3::ZERO; 3]
    }
}

/// The joints of skins.
pub(super) struct Joints<'a> {
    document: &'a Document,
    /// Of all nodes, once a skin asks.
    transforms: Vec<Option<DAffine3>>,
}

impl<'a> Joints<'a> {
    pub(super) fn new(document: &'a Document) -> Self {
        Self { document, transforms: Vec::new() }
    }

    /// The motion that a skin gives. The transform of the mesh's own node has no part in it.
    pub(super) fn motion(&mut self, data: &Data, skin: u32) -> Result<Motion, MeshDataError> {
        let Skin { joints, inverse_bind_matrices } = find(&self.document.skins, skin, "a skin")?;
        data.budget.take(joints.len(), size_of::<DAffine3>() as u64)?;
        if self.transforms.is_empty() {
            self.transforms = transforms(self.document, &data.budget)?;
        }
        let inverse: Option<Elements<16>> =
            inverse_bind_matrices.map(|matrices| data.elements(matrices, Shape::Mat4)).transpose()?;
        if inverse.as_ref().is_some_and(|inverse| inverse.count() < joints.len()) {
            return Err(MeshDataError::content("a skin has fewer matrices than joints"));
        }
        let joint = |(number, &joint): (usize, &u32)| {
            find(&self.document.nodes, joint, "a joint")?;
            let placed = self.transforms[joint as usize]
                .ok_or_else(|| MeshDataError::content("a joint is its own ancestor; nodes must form a tree"))?;
            let inverse = inverse.as_ref().map_or(Ok(DAffine3::IDENTITY), |inverse| affine(&inverse.floats(number)))?;
            Ok(placed * inverse)
        };
        Ok(Motion::Skinned(joints.iter().enumerate().map(joint).collect::<Result<_, MeshDataError>>()?))
    }
}

/// A part's vertices in the scene.
pub(super) struct Pose<'a> {
    motion: &'a Motion,
    positions: Elements<'a, 3>,
    /// Targets of morphing with their weights.
    targets: Vec<(f64, Elements<'a, 3>)>,
    /// Joints and their weights, four in each set.
    influences: Vec<(Elements<'a, 4>, Elements<'a, 4>)>,
}

impl<'a> Pose<'a> {
    /// The pose in which a part is shown; `None` if it has no positions.
    pub(super) fn new(
        data: &'a Data,
        node: &Node,
        mesh: &Mesh,
        primitive: &Primitive,
        motion: &'a Motion,
    ) -> Result<Option<Self>, MeshDataError> {
        let Some(&positions) = primitive.attributes.get("POSITION") else { return Ok(None) };
        let positions = data.elements(positions, Shape::Vec3)?;
        if !positions.has_data() {
            return Err(MeshDataError::content("the positions of a part have no data"));
        }
        let mut pose = Self { motion, positions, targets: Vec::new(), influences: Vec::new() };
        pose.add_targets(data, node.weights.as_deref().or(mesh.weights.as_deref()), primitive)?;
        if matches!(motion, Motion::Skinned(_)) {
            pose.add_influences(data, primitive)?;
        }
        Ok(Some(pose))
    }

    /// Number of vertices.
    pub(super) fn count(&self) -> usize {
        self.positions.count()
    }

    fn add_targets(
        &mut self,
        data: &'a Data,
        weights: Option<&[f32]>,
        primitive: &Primitive,
    ) -> Result<(), MeshDataError> {
        let (targets, weights) = (primitive.targets.as_deref().unwrap_or_default(), weights.unwrap_or_default());
        if !(weights.is_empty() || weights.len() == targets.len()) {
            return Err(MeshDataError::content("a mesh does not have one weight for each of its morph targets"));
        }
        data.budget.take(targets.len(), size_of::<f32>() as u64)?;
        for (target, &weight) in targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            let Some(&moves) = target.get("POSITION") else { continue };
            let moves = data.elements(moves, Shape::Vec3)?;
            self.check_count(moves.count())?;
            data.budget.take(1, size_of::<(f64, Elements<3>)>() as u64)?;
            self.targets.push((weight.into(), moves));
        }
        Ok(())
    }

    fn add_influences(&mut self, data: &'a Data, primitive: &Primitive) -> Result<(), MeshDataError> {
        let attribute = |name: &str, set: usize| primitive.attributes.get(&format!("{name}_{set}")).copied();
        for set in 0.. {
            let (joints, weights) = match (attribute("JOINTS", set), attribute("WEIGHTS", set)) {
                (Some(joints), Some(weights)) => (joints, weights),
                (None, None) if set > 0 => return Ok(()),
                _ => return Err(MeshDataError::content("a skinned part lacks joints or weights")),
            };
            let (joints, weights) = (data.elements(joints, Shape::Vec4)?, data.elements(weights, Shape::Vec4)?);
            joints.check_unsigned("the joints of a part")?;
            self.check_count(joints.count())?;
            self.check_count(weights.count())?;
            self.influences.push((joints, weights));
        }
        Ok(())
    }

    fn check_count(&self, count: usize) -> Result<(), MeshDataError> {
        if count == self.count() {
            return Ok(());
        }
        Err(MeshDataError::content("a part does not have as many joints, weights or morph positions as positions"))
    }

    /// How much work a vertex is, in elements that are read.
    pub(super) fn work(&self) -> usize {
        1 + self.targets.len() + 2 * self.influences.len()
    }

    /// The place of a vertex, and whether its surroundings are mirrored.
    pub(super) fn vertex(&self, number: usize) -> Result<(Vec3, bool), MeshDataError> {
        let read = |elements: &Elements<3>| Vec3::from_array(elements.floats(number)).as_dvec3();
        let morphed = self.targets.iter().map(|(weight, moves)| *weight * read(moves));
        let point = morphed.fold(read(&self.positions), |point, moved| point + moved);
        let transform = match self.motion {
            Motion::Rigid(transform) => *transform,
            Motion::Skinned(joints) => self.blended(joints, number)?,
        };
        Ok((transform.transform_point3(point).as_vec3(), transform.matrix3.determinant() < 0.0))
    }

    /// The mean of the joints' transforms, by their weights.
    fn blended(&self, joints: &[DAffine3], number: usize) -> Result<DAffine3, MeshDataError> {
        let (mut sum, mut blended) = (0.0, DAffine3::ZERO);
        for (places, weights) in &self.influences {
            for (place, weight) in places.integers(number).into_iter().zip(weights.floats(number)) {
                if weight == 0.0 {
                    continue;
                }
                let joint = find(joints, place, "a joint")?;
                let weight = f64::from(weight);
                sum += weight;
                blended.matrix3 += joint.matrix3 * weight;
                blended.translation += joint.translation * weight;
            }
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return Err(MeshDataError::content("the weights of a vertex do not add up to more than 0; skin it again"));
        }
        blended.matrix3 *= 1.0 / sum;
        blended.translation /= sum;
        Ok(blended)
    }
}
