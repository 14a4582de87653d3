//! One app with one camera for all tests, since creating a device takes seconds with a software driver.
//!
//! The app lives on its own thread, to which tests send their work, one after the other.

use crate::headless::{
    HOW_TO_GET_PICTURES, OffscreenPlugin, OffscreenTarget, PipelinesReady, find_adapter, headless_plugins,
    write_picture,
};
use bevy::{
    camera::{RenderTarget, ScalingMode, visibility::ViewVisibility},
    core_pipeline::tonemapping::Tonemapping,
    light::CascadeShadowConfigBuilder,
    log::LogPlugin,
    prelude::*,
    render::{
        storage::ShaderBuffer,
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
};
use bevy_vessels::{
    VesselPlugin,
    plugin::{ChangeLog, EntityCommandsExt, OrganVessels, VesselAppearance, Vessels, VesselsOf},
    render::{SegmentBuffer, SegmentChunk, SegmentMaterial},
    synthesis::tree::{ByKind, VesselKind, VesselTree},
};
use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::Path,
    sync::{
        OnceLock,
        mpsc::{Sender, channel},
    },
    thread,
};

/// Pixels along each side of a picture. The camera sees as many units, so lengths equal pixels.
pub const SIZE: usize = 128;

const BACKGROUND: Color = Color::srgb(0.8, 0.8, 0.8);

type Work = Box<dyn FnOnce(&mut Stage) + Send>;
type Outcome = Result<(), Box<dyn Any + Send>>;
/// A test's name, its work, and the sender for its outcome.
type Job = (&'static str, Work, Sender<Outcome>);

/// Runs a test on the stage, which is empty before and after; skips it if nothing can be drawn.
pub fn on_stage(name: &'static str, test: impl FnOnce(&mut Stage) + Send + 'static) {
    static STAGE: OnceLock<Option<Sender<Job>>> = OnceLock::new();
    let stage = STAGE.get_or_init(|| {
        find_adapter()?;
        let (sender, work) = channel::<Job>();
        thread::spawn(move || {
            let mut stage = Stage::new();
            for (name, test, done) in work {
                stage.begin(name);
                let outcome = catch_unwind(AssertUnwindSafe(|| test(&mut stage)));
                // if sending fails, the test has ended, and nothing waits
                let _ = done.send(outcome);
            }
        });
        Some(sender)
    });
    let Some(stage) = stage else {
        let required = std::env::var("BEVY_VESSELS_REQUIRE_GPU").is_ok_and(|value| value == "1");
        assert!(!required, "BEVY_VESSELS_REQUIRE_GPU=1, but {HOW_TO_GET_PICTURES}");
        eprintln!("skipped: {HOW_TO_GET_PICTURES}");
        return;
    };
    let (done, outcome) = channel();
    stage.send((name, Box::new(test), done)).expect("the stage lives as long as the tests");
    if let Err(panic) = outcome.recv().expect("the stage answers") {
        // the stage's output belongs to the test that opened it, so the message is repeated here
        match panic.downcast::<String>() {
            Ok(message) => panic!("{message}"),
            Err(panic) => resume_unwind(panic),
        }
    }
}

/// Marks entities that a test put on the stage.
#[derive(Component)]
struct Prop;

/// The last picture taken.
#[derive(Resource, Default)]
struct Taken(Option<Image>);

pub struct Stage {
    pub app: App,
    name: &'static str,
    pictures: usize,
    camera: Entity,
}

impl Stage {
    fn new() -> Self {
        let mut app = App::new();
        app.add_plugins((
            headless_plugins(true).disable::<LogPlugin>(),
            OffscreenPlugin { size: UVec2::splat(SIZE as u32) },
            VesselPlugin::default(),
        ))
        .init_resource::<Taken>()
        .insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() });
        app.finish();
        app.cleanup();
        let target = app.world().resource::<OffscreenTarget>().0.clone();
        let projection = OrthographicProjection {
            scaling_mode: ScalingMode::Fixed { width: SIZE as f32, height: SIZE as f32 },
            ..OrthographicProjection::default_3d()
        };
        let camera = app
            .world_mut()
            .spawn((
                Camera3d::default(),
                RenderTarget::from(target),
                Projection::from(projection),
                // no sample mixes vessel and background: pixels are one or the other
                Msaa::Off,
                Tonemapping::None,
                Transform::from_xyz(0.0, 0.0, 200.0),
            ))
            .id();
        app.world_mut().spawn((
            DirectionalLight { illuminance: 8000.0, shadow_maps_enabled: true, ..default() },
            CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 500.0, ..default() }.build(),
            Transform::from_xyz(0.0, 1.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y),
        ));
        Self { app, name: "", pictures: 0, camera }
    }

    /// Clears the stage for a test.
    fn begin(&mut self, name: &'static str) {
        let world = self.app.world_mut();
        let props: Vec<Entity> = world.query_filtered::<Entity, With<Prop>>().iter(world).collect();
        for prop in props {
            world.despawn(prop);
        }
        world.get_mut::<Camera>(self.camera).expect("a camera").is_active = true;
        (self.name, self.pictures) = (name, 0);
        self.set_shadows(true);
        // dropped handles free their assets one frame later
        self.app.update();
        self.app.update();
    }

    /// An organ with one kind of vessels.
    pub fn spawn(&mut self, kind: VesselKind, tree: &VesselTree) -> Entity {
        self.spawn_born(kind, tree, &[])
    }

    /// An organ with one kind of vessels, born in the given steps.
    pub fn spawn_born(&mut self, kind: VesselKind, tree: &VesselTree, birth_steps: &[u32]) -> Entity {
        let world = self.app.world_mut();
        let (artery, vein) = (Color::srgb(0.8, 0.05, 0.05), Color::srgb(0.1, 0.1, 0.8));
        let colors = ByKind { artery, vein, ..VesselAppearance::DEFAULT_COLORS };
        let look = VesselAppearance { colors, ..default() };
        let organ = world.spawn((Prop, Transform::default(), Visibility::default(), look)).id();
        let vessels = Vessels::from_tree(kind, tree, birth_steps);
        world.spawn((ChildOf(organ), VesselsOf(organ), vessels));
        organ
    }

    /// An organ of a mesh, with all its vessels grown.
    pub fn spawn_organ(&mut self, mesh: Mesh, color: Color, components: impl Bundle) -> Entity {
        let world = self.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(color);
        let organ = world.spawn((Prop, Mesh3d(mesh), MeshMaterial3d(material), components)).id();
        world.commands().entity(organ).grow_now();
        world.flush();
        organ
    }

    /// A grey wall some way behind the vessels.
    pub fn spawn_wall(&mut self) {
        let world = self.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(120.0, 120.0));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(Color::srgb(0.5, 0.5, 0.5));
        world.spawn((Prop, Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.0, 0.0, -15.0)));
    }

    /// The vessel entity of an organ.
    pub fn vessels(&self, organ: Entity) -> Entity {
        self.app.world().get::<OrganVessels>(organ).expect("an organ with vessels").entities()[0]
    }

    /// Replaces an organ's tree.
    pub fn replace(&mut self, organ: Entity, tree: &VesselTree) {
        let vessels = self.vessels(organ);
        let mut vessels = self.app.world_mut().entity_mut(vessels);
        let kind = vessels.get::<Vessels>().expect("vessels").kind();
        vessels.insert(Vessels::from_tree(kind, tree, &[]));
    }

    /// Changes an organ's tree, whose nodes keep their parents, and marks some nodes as changed, rightly or not.
    pub fn change(&mut self, organ: Entity, tree: &VesselTree, said: impl IntoIterator<Item = usize>) {
        let vessels = self.vessels(organ);
        let mut vessels = self.app.world_mut().entity_mut(vessels);
        let mut truth = ChangeLog::default();
        vessels.get_mut::<Vessels>().expect("vessels").update_from_tree(tree, &[], &mut truth);
        vessels.get_mut::<ChangeLog>().expect("required by vessels").mark(said);
    }

    /// Turns shadows of lights on or off.
    pub fn set_shadows(&mut self, cast: bool) {
        let world = self.app.world_mut();
        for mut light in world.query::<&mut DirectionalLight>().iter_mut(world) {
            light.shadow_maps_enabled = cast;
        }
    }

    pub fn appearance(&mut self, organ: Entity, change: impl FnOnce(&mut VesselAppearance)) {
        change(&mut self.app.world_mut().get_mut::<VesselAppearance>(organ).expect("an organ"));
    }

    pub fn set_transform(&mut self, organ: Entity, transform: Transform) {
        self.app.world_mut().entity_mut(organ).insert(transform);
    }

    /// Draws with another camera, to its own image, and disables this one until the test ends.
    pub fn use_camera(&mut self, camera: impl Bundle) -> Entity {
        self.app.world_mut().get_mut::<Camera>(self.camera).expect("a camera").is_active = false;
        self.app.world_mut().spawn((Prop, camera)).id()
    }

    /// Draws with further components on the camera for a while.
    pub fn with_on_camera<B: Bundle>(&mut self, components: B, draw: impl FnOnce(&mut Self)) {
        self.app.world_mut().entity_mut(self.camera).insert(components);
        let outcome = catch_unwind(AssertUnwindSafe(|| draw(self)));
        self.app.world_mut().entity_mut(self.camera).remove::<B>();
        if let Err(panic) = outcome {
            resume_unwind(panic);
        }
    }

    pub fn chunks(&self, organ: Entity) -> Vec<Entity> {
        self.app.world().get::<SegmentBuffer>(self.vessels(organ)).expect("drawn").chunks().to_vec()
    }

    pub fn chunk_count(&mut self) -> usize {
        let world = self.app.world_mut();
        world.query_filtered::<(), With<SegmentChunk>>().iter(world).count()
    }

    pub fn visible_chunks(&mut self) -> usize {
        let world = self.app.world_mut();
        world.query_filtered::<&ViewVisibility, With<SegmentChunk>>().iter(world).filter(|seen| seen.get()).count()
    }

    /// Living buffers and materials of vessels.
    pub fn assets(&self) -> [usize; 2] {
        let world = self.app.world();
        [world.resource::<Assets<ShaderBuffer>>().len(), world.resource::<Assets<SegmentMaterial>>().len()]
    }

    /// The present picture of the camera.
    pub fn picture(&mut self) -> Picture {
        let target = self.app.world().resource::<OffscreenTarget>().0.clone();
        Picture(self.picture_of(target))
    }

    /// The present picture in an image.
    pub fn picture_of(&mut self, target: Handle<Image>) -> Image {
        // one frame queues shaders that were not needed before; their files load in the background
        self.app.update();
        for _ in 0..200 {
            if self.app.world().resource::<PipelinesReady>().0 {
                break;
            }
            self.app.update();
        }
        assert!(self.app.world().resource::<PipelinesReady>().0, "shaders don't load");
        self.app.world_mut().spawn(Screenshot::image(target)).observe(
            |captured: On<ScreenshotCaptured>, mut taken: ResMut<Taken>| taken.0 = Some(captured.image.clone()),
        );
        for _ in 0..200 {
            self.app.update();
            if let Some(image) = self.app.world_mut().resource_mut::<Taken>().0.take() {
                self.keep(&image);
                return image;
            }
        }
        panic!("no picture after 200 frames");
    }

    /// Saves a picture, if a folder is given.
    fn keep(&mut self, image: &Image) {
        self.pictures += 1;
        if let Ok(folder) = std::env::var("BEVY_VESSELS_PICTURES") {
            let path = Path::new(&folder).join(format!("{}-{}.png", self.name, self.pictures));
            write_picture(image, &path).expect("the folder for pictures can be written to");
        }
    }
}

/// Pixels, from the top left.
pub struct Picture(Image);

impl Picture {
    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let data = self.0.data.as_ref().expect("a picture on the CPU");
        let first = 4 * (y * SIZE + x);
        [data[first], data[first + 1], data[first + 2]]
    }

    pub fn is_background(&self, x: usize, y: usize) -> bool {
        let [r, g, b] = BACKGROUND.to_srgba().to_u8_array_no_alpha();
        let at = self.at(x, y);
        at.iter().zip([r, g, b]).all(|(a, b)| a.abs_diff(b) <= 2)
    }

    pub fn is_vessel(&self, x: usize, y: usize) -> bool {
        !self.is_background(x, y)
    }

    pub fn is_red(&self, x: usize, y: usize) -> bool {
        let [r, g, b] = self.at(x, y).map(u32::from);
        r > 3 * g / 2 && r > 3 * b / 2
    }

    pub fn is_blue(&self, x: usize, y: usize) -> bool {
        let [r, g, b] = self.at(x, y).map(u32::from);
        b > 3 * g / 2 && b > 3 * r / 2
    }

    /// Sum of the channels, 0 to 765, of encoded values.
    pub fn brightness(&self, x: usize, y: usize) -> f32 {
        self.at(x, y).map(f32::from).iter().sum()
    }

    /// Number of pixels that differ between two pictures by more than a channel's last bit.
    pub fn differing(&self, other: &Self) -> usize {
        let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
        let differ =
            |&(x, y): &(usize, usize)| self.at(x, y).iter().zip(other.at(x, y)).any(|(a, b)| a.abs_diff(b) > 1);
        pixels.filter(differ).count()
    }

    /// Mean [`brightness`](Self::brightness) of all pixels.
    pub fn mean_brightness(&self) -> f32 {
        let rows = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)));
        rows.map(|(x, y)| self.brightness(x, y)).sum::<f32>() / (SIZE * SIZE) as f32
    }

    /// Vessel pixels in a column.
    pub fn height_at(&self, x: usize) -> usize {
        (0..SIZE).filter(|&y| self.is_vessel(x, y)).count()
    }

    /// Vessel pixels in a row.
    pub fn width_at(&self, y: usize) -> usize {
        (0..SIZE).filter(|&x| self.is_vessel(x, y)).count()
    }

    pub fn vessel_pixels(&self) -> usize {
        (0..SIZE).map(|y| self.width_at(y)).sum()
    }
}
