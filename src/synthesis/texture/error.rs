//! Why nothing can be baked, and what is not as good as it could be.

use super::limits::{LEAST_SIZE, MOST_LAYERS, MOST_SIZE, MOST_UV};
use crate::synthesis::mesh::MeshError;

/// Why there are no textures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// A setting out of its limits.
    #[error("{name} is {value}; it must be {limits}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// The value found.
        value: f32,
        /// Its limits.
        limits: &'static str,
    },
    /// A size that is no power of two, or out of its limits.
    #[error("a texture cannot be {size} texels wide; set a power of two from {least} to {most}",
        least = LEAST_SIZE, most = MOST_SIZE)]
    Size {
        /// The size given.
        size: u32,
    },
    /// No map is asked for.
    #[error("no map is asked for; set one of them in maps")]
    NoMaps,
    /// More networks than the map of vessels can number.
    #[error("{layers} networks are too many for one texture; give at most {most}", most = MOST_LAYERS)]
    TooManyLayers {
        /// Their number.
        layers: usize,
    },
    /// More nodes than the map of vessels can number.
    #[error("network {layer} has {nodes} nodes, more than the 24 bits of an id can number; leave out the map of ids")]
    TooManyNodes {
        /// The network.
        layer: usize,
        /// Number of its nodes.
        nodes: usize,
    },
    /// A picture for the base whose bytes are not as many as its size says.
    #[error("the base image of {width} × {height} texels has {bytes} bytes; it must have 4 for each texel")]
    BaseImage {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// Its bytes.
        bytes: usize,
    },
    /// A mesh that cannot be used at all.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Normals or tangents that are not one per vertex.
    #[error("the mesh has {count} {what} for {vertices} vertices; give one per vertex, or none")]
    AttributeCount {
        /// What they are.
        what: &'static str,
        /// Their number.
        count: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A normal or tangent that is not finite, or a colour that is not finite or below 0.
    #[error("vertex {vertex} has a {what} that is not finite, or below 0; repair the mesh, or leave out all of them")]
    BadAttribute {
        /// What it is.
        what: &'static str,
        /// The first such vertex.
        vertex: usize,
    },
    /// A mesh without texture coordinates.
    #[error("the mesh has no texture coordinates; unwrap it, or export it with a UV map")]
    NoUvs,
    /// A texture coordinate that is not finite, or far outside.
    #[error("vertex {vertex} has texture coordinates ({u}, {v}); they must be finite and within ±{most}: unwrap the mesh anew",
        most = MOST_UV)]
    BadUv {
        /// The first such vertex.
        vertex: usize,
        /// Its coordinate to the right.
        u: f32,
        /// Its coordinate downwards.
        v: f32,
    },
    /// Texture coordinates that give most of the surface no texels.
    #[error("{percent:.0} % of the surface have texture coordinates without an area; unwrap the mesh anew")]
    UselessUvs {
        /// Share of the surface, in percent.
        percent: f32,
    },
    /// Texture coordinates in which a picture repeats over the surface.
    #[error(
        "triangle {triangle} spans {span:.0} textures; vessels need a place of their own in the texture: unwrap the mesh anew"
    )]
    TiledUvs {
        /// The first such triangle.
        triangle: usize,
        /// How many times the texture is wide.
        span: f32,
    },
    /// The mesh could not be unwrapped.
    #[error("the mesh cannot be unwrapped: {cause}")]
    Unwrap {
        /// What the unwrapping says.
        cause: String,
    },
}

/// What is not as good as it could be in a bake.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakeWarning {
    /// Parts of the chart that are too thin to hold vessels.
    #[error(
        "{charts} charts are thinner than 8 texels, the thinnest {thinnest:.1}; {}",
        suffices.map_or("no size suffices: unwrap the mesh anew".to_owned(), |size| format!("size {size} suffices"))
    )]
    ThinCharts {
        /// Their number.
        charts: usize,
        /// Thickness of the thinnest, in texels.
        thinnest: f32,
        /// The least size at which none is too thin, if one is possible.
        suffices: Option<u32>,
    },
    /// Charts that lie on each other.
    #[error(
        "{texels} texels belong to several parts of the surface, which look the same; unwrap the mesh anew if they must not"
    )]
    Overlaps {
        /// Number of texels that several charts claim.
        texels: usize,
    },
    /// Triangles without texels.
    #[error("{triangles} triangles have texture coordinates without an area; they show the colour of their neighbours")]
    FlatUvs {
        /// Their number.
        triangles: usize,
    },
    /// Vessels too thin for the texels.
    #[error(
        "half of the vessels are thinner than a texel, the median {texels:.2} texels wide; {}",
        suffices.map_or("no size suffices for them".to_owned(), |size| format!("size {size} suffices"))
    )]
    ThinVessels {
        /// Median width of a segment, in texels.
        texels: f32,
        /// The least size at which it is one, if one is possible.
        suffices: Option<u32>,
    },
}
