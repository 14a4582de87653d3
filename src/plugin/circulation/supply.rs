//! Circulate: which tissue still gets blood.
//!
//! In: the flow of an organ. Out: [`SegmentSupply`] on its vessel entities and [`OrganSupply`] on the organ, after each
//! action and, while something bleeds, now and then. It is measured in jobs.

use crate::plugin::vessels::tree::Vessels;
use crate::plugin::{
    circulation::{
        flow::CirculationState,
        messages::CirculationError,
        organ_flow::{Condition, Measured, OrganFlow, SupplyGauge},
        patient::{Patient, patient_of},
        perfusion::{OrganSupply, Perfusion, SegmentSupply},
    },
    job::{Job, JobPanic, Jobs},
    organ::{mesh::vertex_positions, rest::RestMesh},
    vessels::relations::OrganVessels,
};
use crate::synthesis::{haemodynamics::FlowError, pace::Pace};
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

/// A gauge, with what it has measured.
type Outcome = Result<(Box<SupplyGauge>, Measured), FlowError>;

/// When the supply of an organ is measured, and with what.
#[derive(Debug, Default)]
pub(crate) struct Gauge {
    /// `None` before the first measurement, and while the job has it.
    gauge: Option<Box<SupplyGauge>>,
    job: Option<Job<Outcome>>,
    /// Whether the organ's vessels have grown, so that there is something to measure.
    is_ready: bool,
    /// Whether something was done to the vessels since it was measured.
    is_due: bool,
    /// Seconds since it was measured.
    age: f64,
    /// Whether blood was lost since.
    bled: bool,
}

impl Gauge {
    /// Measures as soon as can be.
    pub(crate) fn ready() -> Self {
        Self { is_ready: true, is_due: true, ..Self::default() }
    }

    /// Measures after an action.
    pub(crate) fn demand(&mut self) {
        self.is_due = true;
    }

    /// Takes note of time that passed.
    pub(crate) fn pass(&mut self, seconds: f64, bled: bool) {
        self.age += seconds;
        self.bled |= bled;
    }

    fn is_to_begin(&self, interval: f32) -> bool {
        let is_old = self.bled && self.age >= f64::from(interval);
        self.is_ready && self.job.is_none() && (self.is_due || is_old)
    }

    /// Hands out what is measured with, and begins to count anew.
    fn begin(&mut self) -> Option<Box<SupplyGauge>> {
        let gauge = self.gauge.take();
        *self = Self { is_ready: true, ..Self::default() };
        gauge
    }

    /// What has been measured, and keeps what it was measured with.
    fn accept(&mut self, outcome: Result<Outcome, JobPanic>) -> Result<Measured, CirculationError> {
        let (gauge, measured) = outcome??;
        self.gauge = Some(gauge);
        Ok(measured)
    }
}

/// All that a measurement takes.
struct Order {
    source: Source,
    condition: Condition,
    ischaemic_below: f32,
}

/// What is measured with: the first time, it is to be made from a copy of the flow and the organ's vertices.
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

/// Begins measurements that are due, and writes those that have ended.
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
        if organ.state.gauge.is_to_begin(organ.perfusion.supply_interval) {
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
    /// Begins a measurement, if blood flows.
    fn begin(&mut self, patient: &Patient, meshes: Option<&Assets<Mesh>>, jobs: &Jobs) {
        let state = self.state.bypass_change_detection();
        let gauge = state.gauge.begin();
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

    /// The organ's vertices, at rest where it is known how that is; none without a mesh that can be read.
    fn vertices(&self, meshes: Option<&Assets<Mesh>>) -> Vec<Vec3> {
        if let Some(rest) = self.rest.and_then(RestMesh::positions) {
            return rest.to_vec();
        }
        let mesh = self.mesh.zip(meshes).and_then(|(mesh, meshes)| meshes.get(mesh.id()));
        mesh.and_then(vertex_positions)
            .map_or_else(Vec::new, |positions| positions.iter().map(|&at| at.into()).collect())
    }

    /// Nothing is known of vessels that grow.
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
