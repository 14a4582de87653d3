//! Sources of an organ's tissue: shapes and images without a mesh, and meshes with their texture coordinates.

use super::errors::failure;
use super::*;
use bevy::{
    asset::{AssetEvent, RenderAssetUsages},
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};
use bevy_vessels::{
    plugin::{OrganGrowthError, OrganImage, OrganImageError},
    synthesis::{
        roots::Roots,
        tissue::{
            ImageChannel, ImageTissue, SourceData, TissueError, TissueImage, TissueMode, TissueShape, TissueSource,
        },
    },
};

/// Pixels along a side of the pictures in these tests.
const SIDE: u32 = 48;

/// An app with image assets.
fn app() -> App {
    let mut app = headless(GrowthBudget::Steps(10));
    app.init_asset::<Image>();
    app
}

fn add_image(app: &mut App, image: Image) -> OrganImage {
    OrganImage(app.world_mut().resource_mut::<Assets<Image>>().add(image))
}

fn image(size: Extent3d, dimension: TextureDimension, format: TextureFormat, data: Vec<u8>) -> Image {
    Image::new(size, dimension, data, format, RenderAssetUsages::MAIN_WORLD)
}

/// Whether a pixel or voxel belongs to the organ: a disc or a ball, with a piece of its upper right corner cut off.
fn is_organ([x, y, z]: [u32; 3], depth: u32) -> bool {
    let place = |at: u32, side: u32| (at as f32 + 0.5) / side as f32 - 0.5;
    let at = Vec3::new(place(x, SIDE), place(y, SIDE), if depth > 1 { place(z, depth) } else { 0.0 });
    at.length() < 0.45 && !(at.x > 0.2 && at.y < -0.1)
}

/// Grey values of a picture of one layer, or of a volume.
fn grey(depth: u32) -> Vec<u8> {
    let pixels = (0..depth).flat_map(|z| (0..SIDE).flat_map(move |y| (0..SIDE).map(move |x| [x, y, z])));
    pixels.map(|pixel| if is_organ(pixel, depth) { 200 } else { 30 }).collect()
}

fn picture() -> Image {
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    image(size, TextureDimension::D2, TextureFormat::R8Unorm, grey(1))
}

fn volume() -> Image {
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: SIDE };
    image(size, TextureDimension::D3, TextureFormat::R8Unorm, grey(SIDE))
}

/// Tissue read from red, the one colour of these images, on a field of side 1 around the origin.
fn settings() -> ImageTissue {
    let spacing = Vec3::splat(1.0 / SIDE as f32);
    ImageTissue { channel: ImageChannel::Red, spacing, origin: Vec3::splat(-0.5), ..ImageTissue::default() }
}

fn wish(tissue: impl Into<TissueSource>) -> Vasculature {
    quick().with_tissue(tissue)
}

/// The growth on a tissue without a plugin.
fn grown(wish: &Vasculature, data: &SourceData) -> [VesselTree; 2] {
    let prepared = wish.tissue.prepare(data).expect("a tissue");
    let generator = wish.generator.clone().fit(prepared.tissue().extent());
    let roots = Roots::from(wish.roots.clone());
    let mut growth = generator.start(prepared.tissue().clone(), &roots, wish.seed).expect("a growth");
    growth.run();
    KINDS.map(|kind| growth.trees()[kind].expect("the kind grows").vessels())
}

#[test]
fn shapes_need_no_mesh() {
    let rectangle = TissueShape::Rectangle { center: Vec3::ZERO, half_x: Vec3::X * 0.5, half_y: Vec3::Y * 0.5 };
    let ellipsoid = TissueShape::Ellipsoid { center: Vec3::ZERO, half_axes: Vec3::new(0.5, 0.4, 0.3) };
    let solids = [TissueShape::ball(0.5), TissueShape::cuboid(Vec3::ONE), ellipsoid];
    for shape in [TissueShape::disc(0.5), rectangle].into_iter().chain(solids) {
        let mut app = headless(GrowthBudget::Steps(50));
        let wish = wish(shape);
        let organ = app.world_mut().spawn(wish.clone()).id();
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_published(app.world(), organ);
        assert_eq!(trees(app.world(), organ), grown(&wish, &SourceData::default()), "{shape:?}");
        assert!(app.world().get::<GrowthState>(organ).is_some_and(|state| state.mesh().is_none()));
    }
}

#[test]
fn a_shape_that_cannot_be_is_named_and_repaired() {
    let mut app = headless(GrowthBudget::Steps(50));
    let organ = app.world_mut().spawn(wish(TissueShape::ball(-2.5))).id();
    let told = failure(&mut app, organ).error.to_string();
    assert!(told.contains("-2.5") && told.contains("above 0"), "{told}");
    app.world_mut().entity_mut(organ).insert(wish(TissueShape::ball(0.5)));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn pictures_and_volumes_grow_without_a_mesh() {
    for (image, depth) in [(picture(), 1), (volume(), SIDE)] {
        let mut app = app();
        let image = add_image(&mut app, image);
        let organ = app.world_mut().spawn((wish(settings()), image)).id();
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        assert_published(app.world(), organ);
        let size = UVec3::new(SIDE, SIDE, depth);
        let values = grey(depth).into_iter().map(|value| f32::from(value) / 255.0).collect();
        let data = SourceData { image: Some(TissueImage { size, values }.into()), ..SourceData::default() };
        assert_eq!(trees(app.world(), organ), grown(&wish(settings()), &data), "{depth} layers");
        let state = app.world().get::<GrowthState>(organ).expect("an organ has a state");
        let growth = state.growth().expect("a growth");
        for node in KINDS.into_iter().flat_map(|kind| growth.tree(kind).expect("a tree").positions()) {
            let cell =
                ((*node + 0.5) * SIDE as f32).floor().clamp(Vec3::ZERO, Vec3::splat(SIDE as f32 - 1.0)).as_uvec3();
            // The first row of a picture is its top; a volume begins at its lowest corner.
            let row = if depth == 1 { SIDE - 1 - cell.y } else { cell.y };
            let near = |offset: i32, at: u32| at.saturating_add_signed(offset).min(SIDE - 1);
            let around = [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
            let is_tissue = |[x, y, z]: [i32; 3]| is_organ([near(x, cell.x), near(y, row), near(z, cell.z)], depth);
            assert!(around.into_iter().any(is_tissue), "{node} is not on the organ");
        }
    }
}

#[test]
fn an_image_that_comes_late_is_waited_for_and_one_that_changes_is_read_again() {
    let mut app = app();
    let handle = app.world().resource::<Assets<Image>>().reserve_handle();
    let organ = app.world_mut().spawn((wish(settings()), OrganImage(handle.clone()))).id();
    for _ in 0..5 {
        app.update();
        assert_eq!(progress(app.world(), organ).phase, GrowthPhase::WaitingForImage);
    }
    assert!(app.world_mut().resource_mut::<Assets<Image>>().insert(handle.id(), picture()).is_ok());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let before = trees(app.world(), organ);
    (0..3).for_each(|_| app.update());
    let mut inverted = picture();
    inverted.data.iter_mut().flatten().for_each(|value| *value = 255 - *value);
    *app.world_mut().resource_mut::<Assets<Image>>().get_mut(handle.id()).expect("the image is there") = inverted;
    run_until(&mut app, "a restart", |world| progress(world, organ).phase != GrowthPhase::Finished);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_ne!(before, trees(app.world(), organ));
    // Another image, that of before.
    let image = add_image(&mut app, picture());
    app.world_mut().entity_mut(organ).insert(image);
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(before, trees(app.world(), organ));
}

/// An image, its settings, and the expected error: the value, and the remedy.
fn bad_images() -> Vec<(&'static str, Image, ImageTissue, &'static str, &'static str)> {
    let size = |width, height, depth_or_array_layers| Extent3d { width, height, depth_or_array_layers };
    let flat = |format, data| image(size(8, 8, 1), TextureDimension::D2, format, data);
    let compressed = flat(TextureFormat::Bc1RgbaUnorm, vec![0; 32]);
    let mut on_gpu = picture();
    on_gpu.data = None;
    let mut cut_off = picture();
    cut_off.data.as_mut().expect("data").truncate(100);
    let mut empty = picture();
    (empty.texture_descriptor.size, empty.data) = (size(0, 8, 1), Some(vec![]));
    let mut flattened = volume();
    flattened.texture_descriptor.size.depth_or_array_layers = 0;
    let good = settings();
    let bad = |change: fn(&mut ImageTissue)| {
        let mut settings = settings();
        change(&mut settings);
        settings
    };
    vec![
        ("compressed", compressed, good.clone(), "Bc1RgbaUnorm", "uncompressed"),
        ("on the graphics card", on_gpu, good.clone(), "graphics card only", "MAIN_WORLD"),
        ("cut off", cut_off, good.clone(), "100 bytes", "2304"),
        ("without pixels", empty, good.clone(), "0 × 8 × 1", "at least one"),
        ("a volume without layers", flattened, good.clone(), "48 × 48 × 0", "at least one"),
        ("black", flat(TextureFormat::R8Unorm, vec![0; 64]), good, "no cell", "lower its threshold"),
        ("flat in space", picture(), bad(|settings| settings.spacing.y = 0.0), "is 0", "above 0"),
        (
            "with a threshold that is no number",
            picture(),
            bad(|settings| settings.threshold = f32::NAN),
            "NaN",
            "finite",
        ),
        ("nowhere", picture(), bad(|settings| settings.origin.x = f32::INFINITY), "inf", "finite"),
    ]
}

#[test]
fn bad_images_are_named_and_a_good_one_repairs_the_organ() {
    for (what, image, settings, value, remedy) in bad_images() {
        let mut app = app();
        let image = add_image(&mut app, image);
        let organ = app.world_mut().spawn((wish(settings), image)).id();
        let error = failure(&mut app, organ).error;
        let told = error.to_string();
        assert!(matches!(error, OrganGrowthError::Image(_) | OrganGrowthError::Tissue(_)), "{what}: {told}");
        assert!(told.contains(value) && told.contains(remedy), "{what}: {told}");
        let good = add_image(&mut app, picture());
        app.world_mut().entity_mut(organ).insert((good, wish(self::settings())));
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
    }
}

#[test]
fn an_image_file_that_is_missing_is_named() {
    let mut app = app();
    // Any loader will do for a missing file.
    app.register_asset_loader(bevy::image::ImageLoader::new(bevy::image::CompressedImageFormats::NONE));
    let handle: Handle<Image> = app.world().resource::<AssetServer>().load("no-such-organ.png");
    let organ = app.world_mut().spawn((wish(settings()), OrganImage(handle))).id();
    let error = failure(&mut app, organ).error;
    assert!(matches!(error, OrganGrowthError::Image(OrganImageError::NotLoaded { .. })), "{error}");
    assert!(error.to_string().contains("no-such-organ.png") && error.to_string().contains("path"), "{error}");
    let good = add_image(&mut app, picture());
    app.world_mut().entity_mut(organ).insert(good);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn an_organ_without_its_image_says_so() {
    let mut app = app();
    let organ = app.world_mut().spawn(wish(settings())).id();
    let error = failure(&mut app, organ).error;
    assert_eq!(error, OrganGrowthError::Tissue(TissueError::NoImage));
    assert!(error.to_string().contains("give the organ an image"), "{error}");
    let image = add_image(&mut app, picture());
    app.world_mut().entity_mut(organ).insert(image);
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn an_app_without_images_says_so() {
    let mut app = headless(GrowthBudget::default());
    assert!(
        app.world().contains_resource::<Messages<AssetEvent<Image>>>()
            && !app.world().contains_resource::<Assets<Image>>()
    );
    let organ = app.world_mut().spawn((wish(settings()), OrganImage::default())).id();
    let error = failure(&mut app, organ).error;
    assert!(error.to_string().contains("ImagePlugin"), "{error}");
}

#[test]
fn a_mesh_that_encloses_nothing_has_no_volume() {
    let mut app = headless(GrowthBudget::default());
    let mesh = add_mesh(&mut app, Plane3d::new(Vec3::Y, Vec2::splat(0.5)));
    let organ = app.world_mut().spawn((Mesh3d(mesh), wish(TissueMode::Volume))).id();
    let error = failure(&mut app, organ).error;
    assert!(matches!(error, OrganGrowthError::Tissue(_)), "{error}");
    assert!(error.to_string().contains("grow on the surface instead"), "{error}");
    app.world_mut().entity_mut(organ).insert(wish(TissueMode::Surface));
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
}

#[test]
fn a_mesh_keeps_its_texture_coordinates() {
    for mode in [TissueMode::Surface, TissueMode::Volume] {
        let mut app = headless(GrowthBudget::Steps(50));
        let organ = spawn(&mut app, wish(mode));
        run_to_phase(&mut app, organ, GrowthPhase::Finished);
        let state = app.world().get::<GrowthState>(organ).expect("an organ has a state");
        let kept = state.mesh().and_then(|mesh| mesh.uvs()).expect("a sphere has texture coordinates");
        let mesh = sphere();
        let given = match mesh.attribute(Mesh::ATTRIBUTE_UV_0) {
            Some(bevy::mesh::VertexAttributeValues::Float32x2(uvs)) => uvs.iter().copied().map(Vec2::from),
            other => panic!("{other:?}"),
        };
        assert!(kept.iter().copied().eq(given), "vertex by vertex");
    }
}

#[test]
fn an_organ_may_change_its_source() {
    let mut app = app();
    let organ = spawn(&mut app, quick());
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    let on_mesh = trees(app.world(), organ);
    let image = add_image(&mut app, picture());
    app.world_mut().entity_mut(organ).insert((image, wish(settings())));
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_ne!(trees(app.world(), organ), on_mesh);
    app.world_mut().entity_mut(organ).insert(wish(TissueShape::ball(0.5)));
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    app.world_mut().entity_mut(organ).remove::<OrganImage>();
    app.update();
    assert_eq!(progress(app.world(), organ).phase, GrowthPhase::Finished, "a shape needs no image");
    app.world_mut().entity_mut(organ).insert(quick());
    app.update();
    run_to_phase(&mut app, organ, GrowthPhase::Finished);
    assert_eq!(trees(app.world(), organ), on_mesh);
}
