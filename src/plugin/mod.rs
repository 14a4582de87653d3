//! ECS glue: vessels grow on organ entities, frame by frame. They can be cut, bleed, and follow their organ. No
//! drawing.
//!
//! In: an entity with a [`Vasculature`], and a `Mesh3d`, an [`OrganImage`] or a plain shape as its tissue. Out: a vessel
//! entity for each kind of vessels, child of the organ, with the tree in [`Vessels`] and its changes in [`ChangeLog`];
//! progress in [`GrowthProgress`] and messages.
//!
//! Components on the organ add features beyond growth: [`Cuttable`] for surgery through [`CuttableVessels`],
//! [`Perfusion`] for blood, [`FollowsMesh`] or [`FollowsTetrahedra`] for soft bodies, [`VesselSurface`] for closed meshes,
//! [`VesselTexture`] for vessels in the organ's texture.
//! An organ without them has no cost from them.
//!
//! Each room has a plugin of its own, which may be added alone:
//!
//! | plugin | room | what its systems do, in the order of a frame |
//! |---|---|---|
//! | [`GrowthPlugin`] | `growth` | commands, settings, mesh assets → tissue → growth → [`Vessels`] |
//! | [`DeformationPlugin`] | `deformation` | deformed organs → moved [`Vessels`] |
//! | [`SurgeryPlugin`] | `surgery` | [`CuttableVessels`], [`VesselCommand`]s → [`VesselWounds`], [`OpenEnd`] entities |
//! | [`CirculationPlugin`] | `circulation` | [`VesselWounds`] → flow, bleeding, supply of the tissue |
//! | [`SurfacePlugin`] | `surface` | [`Vessels`], [`VesselWounds`] → [`VesselMesh`], files |
//! | [`TexturePlugin`] | `texture` | [`Vessels`], organ meshes → [`VesselMaps`] |
//! | [`ScenePlugin`] | `scene` | [`PresetAsset`]s, [`VasculatureOfScene`] → [`Vasculature`]; organs saved in scenes |
//! | [`VesselsPlugin`] | `vessels` | what all the others need; they add it themselves |

mod announcer;
mod circulation;
mod deformation;
mod growth;
pub(crate) mod job;
mod lineage;
mod order;
mod organ;
mod scene;
mod surface;
mod surgery;
mod texture;
mod vessels;

pub use circulation::{
    BleedingStarted, BleedingStopped, BloodLoss, CirculationError, CirculationFailed, CirculationPlugin,
    CirculationState, OrganSupply, Patient, Perfusion, SegmentSupply,
};
pub use deformation::{DeformationPlugin, FollowsMesh, FollowsTetrahedra};
pub use growth::{
    EntityCommandsExt, GrowthAction, GrowthBudget, GrowthCommand, GrowthControl, GrowthFailed, GrowthFinished,
    GrowthFrame, GrowthPhase, GrowthPlugin, GrowthProgress, GrowthStarted, GrowthState, OrganGrowthError, OrganPaint,
    RegrowsUnseen, Vasculature, diagnostics,
};
pub use job::{JobMode, JobPanic, JobSettings};
pub use order::VesselSystems;
pub use organ::{OrganImage, OrganImageError, OrganMeshError, RestMesh, triangle_mesh};
pub use scene::{
    PresetAsset, PresetLoadError, PresetLoader, SceneMeshes, ScenePlugin, VasculatureOfScene, VesselPreset,
};
pub use surface::{
    SurfaceAction, SurfaceCommand, SurfaceCommandsExt, SurfaceDetail, SurfaceFailed, SurfaceLevel, SurfaceMoment,
    SurfaceNotSaved, SurfacePlugin, SurfaceReady, SurfaceSaveError, SurfaceSaved, SurfaceShown, VesselMesh,
    VesselSurface, VesselSurfaceError,
};
pub use surgery::{
    Cuttable, CuttableVessels, OpenEnd, OpenEndEntities, OperationError, OperationKind, Stroke, StrokeId,
    SurgeryPlugin, VesselAction, VesselCommand, VesselOperation, VesselOperationFailed, VesselSite, WoundedGrowth,
};
pub use texture::{
    TextureBase, TextureFailed, TexturePlugin, TextureReady, TextureShown, VesselMaps, VesselTexture,
    VesselTextureError, texture_image,
};
pub use vessels::{
    ChangeCursor, ChangeLog, Changes, OrganVessels, SegmentColoring, VesselAppearance, VesselIndex, VesselPicker,
    VesselPlace, VesselWounds, Vessels, VesselsOf, VesselsPlugin,
};
