//! Faces, as references to vertices and texture coordinates.

/// Stands for no texture coordinate.
pub(super) const NO_UV: u32 = u32::MAX;

/// A corner of a face. The order is that of the file's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Corner {
    pub(super) vertex: u32,
    /// [`NO_UV`] if it has none.
    pub(super) uv: u32,
}

/// The faces of a file.
#[derive(Default)]
pub(super) struct Faces {
    /// The corners of all faces, one face after the other.
    pub(super) corners: Vec<Corner>,
    /// Number of normals, which are only counted.
    pub(super) normals: usize,
    /// Line and end of each face.
    faces: Vec<(u32, u32)>,
    /// Greatest index of a vertex, texture coordinate and normal that a face refers to, from 1, with its line.
    greatest: [(u32, u32); 3],
}

impl Faces {
    /// Adds the face with these corners, when there are so many vertices and texture coordinates. A face of fewer than
    /// three has no surface, and is left out once its indices are checked.
    pub(super) fn add<'a>(
        &mut self,
        line: usize,
        corners: impl Iterator<Item = &'a [u8]>,
        vertices: usize,
        uvs: usize,
    ) -> Result<(), &'static str> {
        let line = u32::try_from(line).map_err(|_| "it has more lines than can be numbered")?;
        let counts = [vertices, uvs, self.normals];
        for corner in corners {
            let mut indices = [None; 3];
            let mut parts = corner.split(|&byte| byte == b'/');
            for ((index, count), part) in indices.iter_mut().zip(counts).zip(&mut parts) {
                *index = if part.is_empty() { None } else { Some(resolve(part, count)?) };
            }
            let ([Some(vertex), uv, _], None) = (indices, parts.next()) else {
                return Err("a corner of a face is not of the form vertex/texture/normal");
            };
            for (greatest, index) in self.greatest.iter_mut().zip(indices) {
                *greatest = (*greatest).max((index.map_or(0, |index| index + 1), line));
            }
            self.corners.push(Corner { vertex, uv: uv.unwrap_or(NO_UV) });
        }
        let start = self.faces.last().map_or(0, |&(_, end)| end as usize);
        if self.corners.len() - start < 3 {
            // Some programs write edges as faces of two corners.
            self.corners.truncate(start);
            return Ok(());
        }
        let end = u32::try_from(self.corners.len()).map_err(|_| "it has more corners than can be numbered")?;
        self.faces.push((line, end));
        Ok(())
    }

    /// Checks that all that faces refer to is there. Files may hold faces before their vertices.
    pub(super) fn check(&self, vertices: usize, uvs: usize) -> Result<(), (u32, &'static str)> {
        let counts = [
            (vertices, "a face refers to a vertex that is not there"),
            (uvs, "a face refers to a texture coordinate that is not there"),
            (self.normals, "a face refers to a normal that is not there"),
        ];
        match self.greatest.iter().zip(counts).find(|((greatest, _), (count, _))| *greatest as usize > *count) {
            Some((&(_, line), (_, cause))) => Err((line, cause)),
            None => Ok(()),
        }
    }

    /// The line and the corners of each face.
    pub(super) fn iter(&self) -> impl Iterator<Item = (u32, &[Corner])> {
        let mut start = 0;
        self.faces.iter().map(move |&(line, end)| {
            let corners = &self.corners[start..end as usize];
            start = end as usize;
            (line, corners)
        })
    }
}

/// An index from 0, of one from 1 or one that counts back from the last of `count`.
fn resolve(word: &[u8], count: usize) -> Result<u32, &'static str> {
    let written: i64 = std::str::from_utf8(word)
        .ok()
        .and_then(|word| word.parse().ok())
        .ok_or("an index of a face is no whole number of a possible size")?;
    let index = match written {
        0 => return Err("an index of a face is 0; they count from 1"),
        1.. => written - 1,
        _ => i64::try_from(count).ok().and_then(|count| count.checked_add(written)).unwrap_or(-1),
    };
    // The last value stands for none, and the greatest index counts from 1.
    let index = u32::try_from(index).ok().filter(|&index| index < NO_UV - 1);
    index.ok_or("an index of a face refers to nothing that is there")
}
