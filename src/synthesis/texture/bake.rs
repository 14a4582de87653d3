//! The whole way from a canvas and networks to maps.

use super::atlas::Atlas;
use super::bins::Bins;
use super::bytes::{MapBytes, blank};
use super::canvas::Canvas;
use super::cones::{Cones, Layer};
use super::error::{BakeError, BakeWarning};
use super::gutter;
use super::maps::{BakedMap, Level};
use super::mips::halved;
use super::paint::{BESIDE, Band, Painter};
use super::report::BakeReport;
use super::seams;
use super::settings::{BakeSettings, BaseImage, MapKind, Maps};
use super::texels::TILE;
use crate::synthesis::{
    pace::{Pace, at_once},
    parallel,
};

/// Rows of tiles between two rests: enough for all threads, or one where there are none.
const BANDS: usize = if cfg!(feature = "parallel") { 16 } else { 1 };

/// Maps of the vessels of a mesh, with a report of what was done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bake {
    /// The maps, in the order of [`MapKind::ALL`].
    pub maps: Vec<BakedMap>,
    /// What was done, and what the values mean.
    pub report: BakeReport,
}

impl Bake {
    /// Bakes networks into maps of a canvas, over a base image or the base colour.
    ///
    /// Takes time in proportion to the triangles, to the texels near vessels, and a little to all texels.
    ///
    /// # Errors
    /// Settings and looks out of their limits, and more networks or nodes than a map of ids can number.
    pub fn new(
        canvas: &Canvas,
        layers: &[Layer<'_>],
        base: Option<&BaseImage>,
        settings: &BakeSettings,
    ) -> Result<Self, BakeError> {
        at_once(Self::new_paced(canvas, layers, base, settings, &Pace::default()))
    }

    /// The same as [paced](crate::synthesis::pace) work. It ends when it is dropped.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    pub async fn new_paced(
        canvas: &Canvas,
        layers: &[Layer<'_>],
        base: Option<&BaseImage>,
        settings: &BakeSettings,
        pace: &Pace,
    ) -> Result<Self, BakeError> {
        settings.validate()?;
        let cones = Cones::of(layers, settings, &pace.part(0.0..0.05)).await?;
        let atlas = Atlas::of(canvas, &pace.part(0.05..0.15)).await;
        let bins = Bins::of(canvas, &atlas, settings.size, &pace.part(0.15..0.2)).await;
        let painter = Painter { canvas, atlas: &atlas, bins: &bins, cones: &cones, settings, base };
        let (level, overlaps) = paint(&painter, &pace.part(0.2..0.7)).await;
        let mut report = BakeReport {
            texels: level.coverage.iter().filter(|cover| **cover > BESIDE).count(),
            charts: atlas.charts,
            repeats: atlas.repeats,
            height_range: cones.highest,
            depth_range: cones.deepest,
            warnings: Vec::new(),
        };
        report.warnings.extend(atlas.warn(settings.size));
        if overlaps > 0 {
            report.warnings.push(BakeWarning::Overlaps { texels: overlaps });
        }
        if canvas.flat_uvs > 0 {
            report.warnings.push(BakeWarning::FlatUvs { triangles: canvas.flat_uvs });
        }
        report.warnings.extend(thin_vessels(&cones, &atlas, settings.size));
        let maps = levels(level, (canvas, &atlas), settings, &pace.part(0.7..1.0)).await;
        pace.rest(1.0).await;
        Ok(Self { maps, report })
    }

    /// The map of a kind, if it was asked for.
    pub fn map(&self, kind: MapKind) -> Option<&BakedMap> {
        self.maps.iter().find(|map| map.kind == kind)
    }
}

/// Warns of vessels thinner than a texel.
fn thin_vessels(cones: &Cones, atlas: &Atlas, size: u32) -> Option<BakeWarning> {
    let texels = cones.median_width * size as f32 / atlas.side;
    let suffices = (size as f32 / texels).min(1.0e9) as u32;
    let suffices = Some((suffices + 1).next_power_of_two()).filter(|&size| size <= BakeSettings::MOST_SIZE);
    (texels > 0.0 && texels < 1.0).then_some(BakeWarning::ThinVessels { texels, suffices })
}

/// The maps that are painted: the normals, too, if their spread goes into the roughness.
fn painted(maps: Maps) -> Maps {
    if maps.roughness { maps.with(MapKind::Normal) } else { maps }
}

/// Paints the first level. Returns it with the number of texels that several parts of the surface claim.
async fn paint(painter: &Painter<'_>, pace: &Pace) -> (Level, usize) {
    let (settings, size) = (painter.settings, painter.settings.size as usize);
    let mut level = Level { size, coverage: vec![0; size * size], ..Level::default() };
    for kind in MapKind::ALL.into_iter().filter(|&kind| painted(settings.maps).has(kind)) {
        level.maps[kind as usize] = Some(blank(kind, settings, painter.cones.highest).repeat(size * size));
        pace.rest(0.0).await;
    }
    let rows = size * TILE as usize;
    let band = |(row, coverage)| Band { row, coverage, maps: MapBytes::default(), overlaps: 0 };
    let mut bands: Vec<Band<'_>> = level.coverage.chunks_mut(rows).enumerate().map(band).collect();
    for (kind, map) in MapKind::ALL.into_iter().zip(&mut level.maps) {
        let Some(map) = map else { continue };
        for (band, bytes) in bands.iter_mut().zip(map.chunks_mut(rows * kind.format().bytes())) {
            band.maps.put(kind, bytes);
        }
    }
    let count = bands.len();
    for (number, some) in bands.chunks_mut(BANDS).enumerate() {
        parallel::for_each(some, |_, band| painter.band(band));
        pace.rest(((number + 1) * BANDS) as f32 / count as f32).await;
    }
    let overlaps = bands.iter().map(|band| band.overlaps).sum();
    (level, overlaps)
}

/// Makes the smaller levels. Fills the gutters of all, closes their seams, and takes the maps that were asked for.
async fn levels(
    mut level: Level,
    (canvas, atlas): (&Canvas, &Atlas),
    settings: &BakeSettings,
    pace: &Pace,
) -> Vec<BakedMap> {
    let kinds = MapKind::ALL.into_iter().filter(|&kind| settings.maps.has(kind));
    let mut maps: Vec<BakedMap> =
        kinds.map(|kind| BakedMap { kind, size: settings.size, levels: Vec::new() }).collect();
    let mut done = 0.0;
    loop {
        // Each level takes a quarter of the time of the one before.
        let pace = pace.part(done..done + 0.75 * (1.0 - done));
        done += 0.75 * (1.0 - done);
        let next = (level.size > 1).then(|| halved(&level));
        pace.rest(0.2).await;
        gutter::fill(&mut level, atlas.repeats, &pace.part(0.2..0.5)).await;
        seams::close(&mut level, canvas, atlas, &pace.part(0.5..1.0)).await;
        for map in &mut maps {
            map.levels.extend(level.maps[map.kind as usize].take());
        }
        let Some(next) = next else { return maps };
        level = next;
    }
}
