//! The work of making the maps of an organ, in any thread.
//!
//! In: copies of the organ's mesh and of its vessels at rest, and of the picture between them. Out: [`Baked`]: Bevy
//! images with all their levels.

use crate::plugin::{organ::mesh::MeshCopy, texture::messages::VesselTextureError};
use crate::synthesis::{
    pace::Pace,
    texture::{
        Bake, BakeReport, BakeSettings, BakedMap, BaseImage, Canvas, CanvasAttributes, Layer, MapKind, TexelFormat,
        VertexColors, VesselLook,
    },
    tree::VesselTree,
};
use bevy::{
    asset::RenderAssetUsages,
    image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor},
    math::{Vec3, Vec4},
    mesh::{Mesh, VertexAttributeValues},
};
use wgpu_types::{Extent3d, TextureDimension, TextureFormat};

/// Samples along the longer side of a pixel's footprint: organs are seen from the side.
const ANISOTROPY: u16 = 8;
/// Number of items, as jobs count them, that a texel is worth.
const TEXELS_PER_ITEM: usize = 4;

/// What maps are made of.
pub(super) struct Source {
    pub mesh: MeshCopy,
    pub shading: Shading,
    pub vessels: Vec<(VesselTree, VesselLook)>,
    pub base: Option<Image>,
    pub settings: BakeSettings,
}

/// What a mesh has for its look.
#[derive(Default)]
pub(super) struct Shading {
    pub normals: Option<Vec<Vec3>>,
    pub tangents: Option<Vec<Vec4>>,
    /// Colours of its vertices, by which a renderer multiplies the texture.
    pub colors: Option<Vec<Vec3>>,
}

/// The maps of an organ.
pub(super) struct Baked {
    pub images: Vec<(MapKind, Image)>,
    pub report: BakeReport,
}

impl Shading {
    /// That of a mesh; one that is deformed has normals and tangents of its own.
    pub fn of(mesh: &Mesh, is_deformed: bool) -> Self {
        let colors = match mesh.try_attribute(Mesh::ATTRIBUTE_COLOR) {
            Ok(VertexAttributeValues::Float32x4(colors)) => {
                Some(colors.iter().map(|&[red, green, blue, _]| Vec3::new(red, green, blue)).collect())
            }
            _ => None,
        };
        if is_deformed {
            return Self { colors, ..Self::default() };
        }
        let normals = mesh.try_attribute(Mesh::ATTRIBUTE_NORMAL).ok().and_then(VertexAttributeValues::as_float3);
        let tangents = match mesh.try_attribute(Mesh::ATTRIBUTE_TANGENT) {
            Ok(VertexAttributeValues::Float32x4(tangents)) => Some(tangents),
            _ => None,
        };
        Self {
            normals: normals.map(|normals| normals.iter().copied().map(Vec3::from).collect()),
            tangents: tangents.map(|tangents| tangents.iter().copied().map(Vec4::from).collect()),
            colors,
        }
    }
}

impl Source {
    /// The work in items, as jobs count them.
    pub fn items(&self) -> usize {
        let nodes: usize = self.vessels.iter().map(|(tree, _)| tree.len()).sum();
        let texels = (self.settings.size as usize).saturating_pow(2);
        texels / TEXELS_PER_ITEM + self.mesh.triangles.len() + nodes
    }
}

/// Makes the maps.
pub(super) async fn bake(source: Source, pace: Pace) -> Result<Baked, VesselTextureError> {
    let Source { mut mesh, shading, vessels, base, settings } = source;
    let base = base.map(base_image).transpose()?;
    let uvs = mesh.uvs.take();
    let mesh = mesh.check(&pace.part(0.0..0.05)).await?;
    let uvs = uvs.ok_or(crate::synthesis::texture::BakeError::NoUvs)?;
    let Shading { normals, tangents, colors } = shading;
    let colors = colors.map(|colors| VertexColors { colors, are_drawn: true });
    let attributes = CanvasAttributes { uvs, normals, tangents, colors };
    let canvas = Canvas::new_paced(mesh, attributes, &pace.part(0.05..0.15)).await?;
    let layers: Vec<Layer<'_>> = vessels.iter().map(|(tree, look)| Layer { tree, look: look.clone() }).collect();
    let baked = Bake::new_paced(&canvas, &layers, base.as_ref(), &settings, &pace.part(0.15..0.95)).await?;
    let Bake { maps, report } = baked;
    let mut images = Vec::with_capacity(maps.len());
    for map in maps {
        images.push((map.kind, texture_image(map, report.repeats)));
        pace.rest(0.95).await;
    }
    pace.rest(1.0).await;
    Ok(Baked { images, report })
}

/// The picture between the vessels.
fn base_image(image: Image) -> Result<BaseImage, VesselTextureError> {
    let unreadable = |reason: String| VesselTextureError::BaseImage { reason };
    let format = image.texture_descriptor.format;
    let image = match format {
        TextureFormat::Rgba8UnormSrgb => image,
        _ => image
            .convert(TextureFormat::Rgba8UnormSrgb)
            .ok_or_else(|| unreadable(format!("its format is {format:?}")))?,
    };
    let (width, height) = (image.width(), image.height());
    let mut bytes = image.data.ok_or_else(|| unreadable("its data are on the graphics card only".to_owned()))?;
    // Without its smaller levels.
    bytes.truncate(4 * width as usize * height as usize);
    Ok(BaseImage::new(width, height, bytes)?)
}

fn sampler(repeats: [bool; 2]) -> ImageSampler {
    let [u, v] = repeats.map(|repeats| if repeats { ImageAddressMode::Repeat } else { ImageAddressMode::ClampToEdge });
    ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: u,
        address_mode_v: v,
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        mipmap_filter: ImageFilterMode::Linear,
        anisotropy_clamp: ANISOTROPY,
        ..ImageSamplerDescriptor::default()
    })
}

/// A baked map as a Bevy image, with all its levels. `repeats` tells in which directions its texture repeats, as
/// [`BakeReport::repeats`] does.
///
/// Maps of numbers stay in main memory: not every graphics card has their formats.
pub fn texture_image(map: BakedMap, repeats: [bool; 2]) -> Image {
    let format = match map.kind.format() {
        TexelFormat::Rgba8Srgb => TextureFormat::Rgba8UnormSrgb,
        TexelFormat::Rgba8Unorm => TextureFormat::Rgba8Unorm,
        TexelFormat::R16Unorm => TextureFormat::R16Unorm,
        TexelFormat::Rgba8Uint => TextureFormat::Rgba8Uint,
    };
    let is_drawn = matches!(map.kind, MapKind::Albedo | MapKind::Normal | MapKind::Roughness);
    let usage = if is_drawn { RenderAssetUsages::default() } else { RenderAssetUsages::MAIN_WORLD };
    let levels = map.levels.len() as u32;
    let size = Extent3d { width: map.size, height: map.size, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, usage);
    image.texture_descriptor.mip_level_count = levels;
    image.data = Some(map.levels.concat());
    image.sampler = sampler(repeats);
    image
}
