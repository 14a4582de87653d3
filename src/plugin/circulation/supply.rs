//! Circulate: which tissue still gets blood.
//!
//! In: the flow of an organ. Out: [`SegmentSupply`] on its vessel entities and [`OrganSupply`] on the organ, after each
//! action and, while something bleeds, at intervals. Jobs measure it.

use crate::plugin::vessels::tree::Vessels;
use crate::plugin::{
    circulation::{
        gauge::Outcome,
        organ_flow::{Condition, OrganFlow, SupplyGauge},
        patient::{Patient, patient_of},
        perfusion::{OrganSupply, Perfusion, SegmentSupply},
        state::CirculationState,
    },
    job::{Job, JobPanic, Jobs},
    organ::{mesh::vertex_positions, rest::RestMesh},
    vessels::relations::OrganVessels,
};
use crate::synthesis::pace::Pace;
use bevy::{
    asset::Assets,
    ecs::{
        change_detection::{DetectChangesMut, Res},
        entity::Entity,
        hierarchy::ChildOf,
        query::QueryData,
        system::Query,
    },
    log::warn,
    math::Vec3,
    mesh::{Mesh, Mesh3d},
};

/// All inputs of a measurement.
struct Order {
    source: Source,
    condition: Condition,
    ischaemic_below: f32,
}

/// The gauge, or for the first measurement what it is made from: a copy of the flow and the organ's vertices.
enum Source {
    Gauge(Box<SupplyGauge>),
    New { flow: Box<OrganFlow>, vertices: Vec<Vec3> },
}

impl Order {
    async fn carry_out(self, pace: Pace) -> Outcome {
        let (mut gauge, pace) = match self.source {
            Source::Gauge(gauge) => (gauge, pace),
            Source::New { flow, vertices } => {
                let gauge = SupplyGauge::new(*flow, &vertices, &pace.part(0.0..0.8)).await?;
                (Box::new(gauge), pace.part(0.8..1.0))
            }
        };
        let measured = gauge.measure(&self.condition, self.ischaemic_below, &pace).await?;
        Ok((gauge, measured))
    }
}

/// An organ whose supply is measured.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct Supplied {
    entity: Entity,
    perfusion: &'static Perfusion,
    vessels: &'static OrganVessels,
    state: &'static mut CirculationState,
    supply: &'static mut OrganSupply,
    mesh: Option<&'static Mesh3d>,
    rest: Option<&'static RestMesh>,
}

/// Starts measurements that are due, and writes those that are done.
pub(crate) fn measure_supply(
    mut organs: Query<Supplied>,
    mut vessels: Query<(&Vessels, &mut SegmentSupply)>,
    patients: Query<&Patient>,
    parents: Query<&ChildOf>,
    meshes: Option<Res<Assets<Mesh>>>,
    jobs: Jobs,
) {
    for mut organ in &mut organs {
        if !organ.state.gauge.is_ready {
            organ.clear(&mut vessels);
            continue;
        }
        if organ.state.gauge.is_to_begin(organ.perfusion.supply_interval, organ.perfusion.ischaemic_below) {
            let patient = patient_of(organ.entity, &parents, |entity| patients.contains(entity));
            let patient = patient.and_then(|patient| patients.get(patient).ok()).copied().unwrap_or_default();
            organ.begin(&patient, meshes.as_deref(), &jobs);
        }
        if let Some(outcome) = Job::poll(&mut organ.state.bypass_change_detection().gauge.job) {
            organ.accept(outcome, &mut vessels);
        }
    }
}

impl SuppliedItem<'_, '_> {
    /// Starts a measurement, if blood flows.
    fn begin(&mut self, patient: &Patient, meshes: Option<&Assets<Mesh>>, jobs: &Jobs) {
        let state = self.state.bypass_change_detection();
        let gauge = state.gauge.begin(self.perfusion.ischaemic_below);
        let Some(flow) = state.flow() else { return };
        let condition = flow.condition(&patient.blood);
        let mut work = flow.nodes();
        let source = match gauge {
            Some(gauge) => Source::Gauge(gauge),
            None => {
                let (flow, vertices) = (Box::new(flow.copy()), self.vertices(meshes));
                work += vertices.len();
                Source::New { flow, vertices }
            }
        };
        let order = Order { source, condition, ischaemic_below: self.perfusion.ischaemic_below };
        self.state.bypass_change_detection().gauge.job = Some(jobs.start(work, |pace| order.carry_out(pace)));
    }

    /// The organ's vertices, at rest if the rest shape is known; none without a readable mesh.
    fn vertices(&self, meshes: Option<&Assets<Mesh>>) -> Vec<Vec3> {
        if let Some(rest) = self.rest.and_then(RestMesh::positions) {
            return rest.to_vec();
        }
        let mesh = self.mesh.zip(meshes).and_then(|(mesh, meshes)| meshes.get(mesh.id()));
        mesh.and_then(vertex_positions)
            .map_or_else(Vec::new, |positions| positions.iter().map(|&at| at.into()).collect())
    }

    /// Clears the supply of vessels that grow.
    fn clear(&mut self, vessels: &mut Query<(&Vessels, &mut SegmentSupply)>) {
        self.supply.set_if_neq(OrganSupply::default());
        let mut vessels = vessels.iter_many_mut(self.vessels.entities());
        while let Some((_, mut supply)) = vessels.fetch_next() {
            supply.set_if_neq(SegmentSupply::default());
        }
    }

    fn accept(&mut self, outcome: Result<Outcome, JobPanic>, vessels: &mut Query<(&Vessels, &mut SegmentSupply)>) {
        let gauge = &mut self.state.bypass_change_detection().gauge;
        let mut measured = match gauge.accept(outcome) {
            Ok(measured) => measured,
            Err(error) => {
                warn!("{}: its supply is not measured: {error}", self.entity);
                return;
            }
        };
        *self.supply = OrganSupply { vertices: measured.vertices, ischaemic_share: measured.ischaemic_share };
        let mut vessels = vessels.iter_many_mut(self.vessels.entities());
        while let Some((vessels, mut supply)) = vessels.fetch_next() {
            supply.segments = std::mem::take(&mut measured.segments[vessels.kind()]);
        }
    }
}
