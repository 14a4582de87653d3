//! A fingerprint of trees, to tell whether two runs grew the same vessels.
//!
//! FNV-1a with 64 bits (Fowler, Noll & Vo): short, and the same on every platform and in every version, which the
//! standard library's hashers do not promise. It detects differences, but does not protect against forgery.

use super::VesselTree;

const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

fn feed(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
}

/// Hash of any data, given piece by piece, such as settings that were grown with or the mesh that was grown on.
pub fn hash_bytes<B: AsRef<[u8]>>(pieces: impl IntoIterator<Item = B>) -> u64 {
    pieces.into_iter().fold(OFFSET_BASIS, |hash, piece| feed(hash, piece.as_ref()))
}

/// Hash of several trees in a row, such as the arteries and the veins of an organ.
///
/// Covers the number of nodes and the exact bits of all positions, parents and radii, in little-endian order, of one
/// tree after the other. Two lists of trees that differ in any of these practically never have the same hash.
pub fn hash_trees<'a>(trees: impl IntoIterator<Item = &'a VesselTree>) -> u64 {
    trees.into_iter().fold(OFFSET_BASIS, |hash, tree| {
        let mut hash = feed(hash, &(tree.len() as u64).to_le_bytes());
        for position in tree.positions() {
            for coordinate in position.to_array() {
                hash = feed(hash, &coordinate.to_bits().to_le_bytes());
            }
        }
        for parent in tree.parents() {
            hash = feed(hash, &parent.to_le_bytes());
        }
        for radius in tree.radii() {
            hash = feed(hash, &radius.to_bits().to_le_bytes());
        }
        hash
    })
}

impl VesselTree {
    /// Hash of this tree alone: [`hash_trees`] of one.
    pub fn hash64(&self) -> u64 {
        hash_trees([self])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_the_published_vectors() {
        // Test vectors of the reference implementation.
        assert_eq!(feed(OFFSET_BASIS, b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(feed(OFFSET_BASIS, b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(feed(OFFSET_BASIS, b"foobar"), 0x8594_4171_f739_67e8);
        assert_eq!(hash_bytes(["foo", "", "bar"]), 0x8594_4171_f739_67e8);
    }
}
