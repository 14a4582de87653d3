//! Maps as files, read by others.

use crate::meshes::{baked, plain, square, vessel};
use bevy_math::Vec3;
use bevy_vessels::synthesis::{
    io::{write_ktx2, write_png},
    texture::{Bake, Canvas, MapKind},
};

const SIZE: u32 = 64;

fn bake() -> Bake {
    let canvas = Canvas::of_mesh(&square(2)).expect("a canvas");
    let tree = vessel(&[Vec3::new(0.2, 0.3, 0.0), Vec3::new(0.8, 0.7, 0.0)], 0.08);
    baked(&canvas, &[&tree], &plain(), SIZE, &MapKind::ALL)
}

#[test]
fn ktx2_is_read_back_with_all_levels() {
    let bake = bake();
    for map in &bake.maps {
        let mut bytes = Vec::new();
        write_ktx2(&mut bytes, map).expect("bytes");
        let reader = ktx2::Reader::new(&bytes[..]).expect("a file");
        let header = reader.header();
        let format = match map.kind {
            MapKind::Albedo => ktx2::Format::R8G8B8A8_SRGB,
            MapKind::Normal | MapKind::Roughness => ktx2::Format::R8G8B8A8_UNORM,
            MapKind::Height | MapKind::Depth => ktx2::Format::R16_UNORM,
            MapKind::Id => ktx2::Format::R8G8B8A8_UINT,
        };
        assert_eq!(header.format, Some(format));
        assert_eq!([header.pixel_width, header.pixel_height, header.pixel_depth], [SIZE, SIZE, 0]);
        assert_eq!((header.face_count, header.layer_count), (1, 0));
        assert_eq!(header.level_count as usize, if map.kind.has_levels() { 7 } else { 1 });
        let levels: Vec<Vec<u8>> = reader.levels().map(|level| level.data.to_vec()).collect();
        assert_eq!(levels, map.levels, "{:?}", map.kind);
        let described = reader.basic_dfd().expect("a descriptor");
        assert_eq!(described.bytes_planes[0] as usize, map.kind.format().bytes());
    }
}

#[test]
fn png_is_read_back() {
    let bake = bake();
    for map in &bake.maps {
        let mut bytes = Vec::new();
        write_png(&mut bytes, map).expect("bytes");
        let image = image::load_from_memory(&bytes).expect("a picture");
        let texels = &map.levels[0];
        if matches!(map.kind, MapKind::Height | MapKind::Depth) {
            let values: Vec<u8> = image.to_luma16().iter().flat_map(|value| value.to_le_bytes()).collect();
            assert_eq!(&values, texels, "{:?}", map.kind);
        } else {
            assert_eq!(image.to_rgba8().as_raw(), texels, "{:?}", map.kind);
        }
    }
}
