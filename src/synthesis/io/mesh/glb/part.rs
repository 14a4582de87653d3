//! The mesh under construction: triangles of parts, as they stand in the scene.

use super::super::read::{BAD_POSITION, MeshDataError};
use super::{
    data::{Data, Elements},
    document::{Primitive, Shape},
    pose::Pose,
};
use crate::synthesis::mesh::{TriangleMesh, is_usable};
use bevy_math::{Vec2, Vec3};

/// Bytes that a part takes besides its vertices and triangles.
const PART: u64 = 64;

/// The parts so far.
pub(super) struct Parts {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// As long as every part has texture coordinates.
    uvs: Option<Vec<Vec2>>,
}

impl Parts {
    pub(super) fn new() -> Self {
        Self { positions: Vec::new(), triangles: Vec::new(), uvs: Some(Vec::new()) }
    }

    /// Adds the triangles of a part, and the vertices that they use, in the order of the file.
    pub(super) fn add(&mut self, data: &Data, primitive: &Primitive, pose: &Pose) -> Result<(), MeshDataError> {
        let vertices = pose.count();
        let indices: Option<Elements<1>> =
            primitive.indices.map(|indices| data.elements(indices, Shape::Scalar)).transpose()?;
        if let Some(indices) = &indices {
            indices.check_unsigned("the indices of a part")?;
        }
        let count = indices.as_ref().map_or(vertices, Elements::count);
        data.budget.take(1, PART)?;
        data.budget.take(vertices, size_of::<u32>() as u64)?;
        data.budget.take(count, size_of::<u32>() as u64)?;
        let corners = corners(indices.as_ref(), count, vertices)?;
        data.budget.take(triangle_count(primitive.mode, count), size_of::<[u32; 3]>() as u64)?;
        let triangles = triangles(primitive.mode, &corners);
        let mut places = vec![UNUSED; vertices];
        triangles.iter().flatten().for_each(|&corner| places[corner as usize] = 0);
        let used = places.iter().filter(|&&place| place != UNUSED).count();
        data.budget.take(used, (pose.work() * size_of::<Vec3>() + size_of::<Vec2>()) as u64)?;
        let mut is_mirrored = Vec::with_capacity(used);
        let first = self.positions.len();
        for (number, place) in places.iter_mut().enumerate().filter(|(_, place)| **place != UNUSED) {
            let (position, mirrored) = pose.vertex(number)?;
            if !is_usable(position) {
                return Err(MeshDataError::content(BAD_POSITION));
            }
            *place = is_mirrored.len() as u32;
            is_mirrored.push(mirrored);
            self.positions.push(position);
        }
        self.add_uvs(data, primitive, &places)?;
        let first = u32::try_from(first).map_err(|_| MeshDataError::content("it has too many vertices"))?;
        self.triangles.extend(triangles.into_iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| places[corner as usize]);
            let mirrored = [a, b, c].into_iter().filter(|&place| is_mirrored[place as usize]).count();
            let corners = if mirrored >= 2 { [a, c, b] } else { [a, b, c] };
            corners.map(|place| place.saturating_add(first))
        }));
        Ok(())
    }

    fn add_uvs(&mut self, data: &Data, primitive: &Primitive, places: &[u32]) -> Result<(), MeshDataError> {
        let Some(uvs) = &mut self.uvs else { return Ok(()) };
        let Some(&own) = primitive.attributes.get("TEXCOORD_0") else {
            self.uvs = None;
            return Ok(());
        };
        let own: Elements<2> = data.elements(own, Shape::Vec2)?;
        if own.count() != places.len() {
            return Err(MeshDataError::content("a part does not have as many texture coordinates as positions"));
        }
        let used = places.iter().enumerate().filter(|(_, place)| **place != UNUSED);
        uvs.extend(used.map(|(number, _)| Vec2::from_array(own.floats(number))));
        Ok(())
    }

    pub(super) fn into_mesh(self) -> Result<TriangleMesh, MeshDataError> {
        Ok(TriangleMesh::new(self.positions, self.triangles, self.uvs)?)
    }
}

/// The place of a vertex without a triangle.
const UNUSED: u32 = u32::MAX;

/// The vertices of a part, in the order in which they are joined.
fn corners(indices: Option<&Elements<1>>, count: usize, vertices: usize) -> Result<Vec<u32>, MeshDataError> {
    let Some(indices) = indices else { return Ok((0..vertices as u32).collect()) };
    let corners: Vec<u32> = (0..count).map(|number| indices.integers(number)[0]).collect();
    if corners.iter().any(|&corner| corner as usize >= vertices) {
        return Err(MeshDataError::content("it is damaged: the indices of a part reach beyond its vertices"));
    }
    Ok(corners)
}

/// Most triangles between so many corners.
fn triangle_count(mode: u64, corners: usize) -> usize {
    if mode == Primitive::TRIANGLES { corners / 3 } else { corners.saturating_sub(2) }
}

/// The triangles of a list of vertices; none in modes for points and lines.
pub(super) fn triangles(mode: u64, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Primitive::TRIANGLES => corners.as_chunks().0.to_vec(),
        // Every other triangle of a strip is reversed.
        Primitive::TRIANGLE_STRIP => corners
            .array_windows()
            .enumerate()
            .map(|(number, &[a, b, c])| if number % 2 == 1 { [b, a, c] } else { [a, b, c] })
            .collect(),
        Primitive::TRIANGLE_FAN => corners
            .split_first()
            .map(|(&hub, rim)| rim.windows(2).map(|pair| [hub, pair[0], pair[1]]).collect())
            .unwrap_or_default(),
        _ => Vec::new(),
    }
}
