//! The tree of a vessel entity, which follows a growth at a cost that depends on the changes alone.

use crate::plugin::{
    lineage::Lineage,
    vessels::{
        change_log::ChangeLog,
        saved::{GivenTree, SavedVessels},
    },
};
use crate::synthesis::{
    binding::{Binding, BindingError},
    growth::GrownTree,
    tree::{NO_PARENT, NodeId, VesselKind, VesselTree},
};
use bevy::{
    camera::{primitives::Aabb, visibility::Visibility},
    ecs::{
        component::Component,
        entity::{ComponentCloneCtx, SourceComponent},
        lifecycle::HookContext,
        query::Changed,
        reflect::ReflectComponent,
        system::Query,
        world::DeferredWorld,
    },
    math::Vec3,
    reflect::{Reflect, ReflectDeserialize, ReflectSerialize},
    transform::components::Transform,
};
use serde::{Deserialize, Serialize, Serializer};
use std::borrow::Cow;

/// The vessels of one kind of an organ, as drawn and written: in the local space of the organ's mesh, and lifted off
/// its surface if the settings say so.
///
/// Scenes and clones of the entity keep a given tree. A tree that grew is not kept: it grows again from mesh, settings
/// and seed.
#[derive(Component, Clone, Debug, Reflect, Deserialize)]
#[serde(from = "SavedVessels")]
#[component(on_insert = mark_inserted, clone_behavior = Custom(clone_as_saved))]
#[reflect(opaque, Component, Clone(Vessels::as_saved), Debug, PartialEq, Serialize, Deserialize)]
#[require(ChangeLog, Transform, Visibility)]
pub struct Vessels {
    kind: VesselKind,
    tree: VesselTree,
    lineage: Lineage,
    /// Number of times that the tree at rest has changed.
    edits: u64,
    birth_steps: Vec<u32>,
    /// First child of every node, [`NO_PARENT`] for none.
    first_children: Vec<u32>,
    /// Next child of the same parent, [`NO_PARENT`] for the last.
    next_siblings: Vec<u32>,
    bounds: Option<(Vec3, Vec3)>,
    /// Upper bound of all radii.
    widest_radius: f32,
    /// Positions at rest, while the organ is deformed.
    rest: Option<Vec<Vec3>>,
    /// Whether the tree is that of a growth.
    is_grown: bool,
    /// Hash of the tree that they were saved with.
    saved_hash: Option<u64>,
}

impl Vessels {
    /// No vessels yet.
    pub(crate) fn new(kind: VesselKind) -> Self {
        Self {
            kind,
            tree: VesselTree::new(),
            lineage: Lineage::default(),
            edits: 0,
            birth_steps: Vec::new(),
            first_children: Vec::new(),
            next_siblings: Vec::new(),
            bounds: None,
            widest_radius: 0.0,
            rest: None,
            is_grown: true,
            saved_hash: None,
        }
    }

    /// Vessels that did not grow here, such as a network read from a file, to be drawn like others.
    ///
    /// Put them on an entity that is [`VesselsOf`](crate::plugin::VesselsOf) an organ, which needs no mesh. If they
    /// replace others, the wounds of those are dropped, and every segment counts as changed;
    /// [`update_from_tree`](Self::update_from_tree) avoids this. Nodes beyond the end of `birth_steps` count as born in
    /// step 0.
    pub fn from_tree(kind: VesselKind, tree: &VesselTree, birth_steps: &[u32]) -> Self {
        let mut vessels = Self { lineage: Lineage::new_one(), is_grown: false, ..Self::new(kind) };
        for (node, (&position, &radius)) in tree.positions().iter().zip(tree.radii()).enumerate() {
            vessels.push(position, tree.parents()[node], radius, birth_steps.get(node).copied().unwrap_or(0));
        }
        vessels
    }

    /// Updates vessels that did not grow here: moved nodes, changed radii or birth steps, and new nodes.
    ///
    /// Exactly the segments that differ are marked in `log`, the [`ChangeLog`] of the same entity. Wounds stay if every
    /// old node keeps its parent. Otherwise, or if the tree became shorter, these count as other vessels, as with
    /// [`from_tree`](Self::from_tree). The cost is a comparison of all nodes.
    pub fn update_from_tree(&mut self, tree: &VesselTree, birth_steps: &[u32], log: &mut ChangeLog) {
        let known = self.tree.len();
        if !tree.parents().starts_with(self.tree.parents()) {
            *self = Self::from_tree(self.kind, tree, birth_steps);
            log.begin_tree(self.lineage);
            return;
        }
        let state = |node: usize| {
            let birth = birth_steps.get(node).copied().unwrap_or(0);
            (tree.positions()[node], tree.radii()[node], birth)
        };
        let mut changed = Vec::new();
        for node in 0..known {
            let (position, radius, birth) = state(node);
            let before = self.rest.as_deref().unwrap_or(self.tree.positions())[node];
            if (before, self.tree.radii()[node], self.birth_steps[node]) != (position, radius, birth) {
                self.update(node, position, radius);
                self.birth_steps[node] = birth;
                changed.push(node as u32);
            }
        }
        for node in known..tree.len() {
            let (position, radius, birth) = state(node);
            self.push(position, tree.parents()[node], radius, birth);
        }
        self.edits += u64::from(!changed.is_empty() || known < tree.len());
        self.mark(&changed, known, log);
    }

    /// What kind of vessels these are.
    pub fn kind(&self) -> VesselKind {
        self.kind
    }

    /// The tree. While the organ grows, it only gets longer and thicker; a restart empties it. With
    /// [`FollowsMesh`](crate::plugin::FollowsMesh) its nodes move with the deformed organ.
    pub fn tree(&self) -> &VesselTree {
        &self.tree
    }

    /// Number of times that the tree at rest has changed. Within a lineage it only rises; deformation changes nothing.
    pub(crate) fn edits(&self) -> u64 {
        self.edits
    }

    /// Whether the nodes are elsewhere than at rest.
    pub(crate) fn is_deformed(&self) -> bool {
        self.rest.is_some()
    }

    /// Identity of the tree.
    pub(crate) fn lineage(&self) -> Lineage {
        self.lineage
    }

    /// Hash of the tree at rest, or of the one that was saved, until it has grown again.
    pub(crate) fn hash(&self) -> Option<u64> {
        if self.tree.is_empty() { self.saved_hash } else { Some(self.tree_at_rest().hash64()) }
    }

    /// The vessels with only what a file keeps.
    pub(crate) fn as_saved(&self) -> Self {
        SavedVessels::from(self).into()
    }

    /// Whether the tree is the one that they were saved with.
    pub(crate) fn is_as_saved(&self) -> bool {
        !self.tree.is_empty() && self.saved_hash == self.hash()
    }

    /// The step in which each node was born, 0 for roots.
    pub fn birth_steps(&self) -> &[u32] {
        &self.birth_steps
    }

    /// A box that holds every segment, radii included; of zero size if there is none.
    ///
    /// While vessels grow at rest it only becomes larger.
    pub fn aabb(&self) -> Aabb {
        self.bounds.map_or_else(Aabb::default, |(min, max)| Aabb::from_min_max(min, max))
    }

    /// Takes over the growth's changes: `changed` nodes and all new ones, or everything for `None`.
    ///
    /// Without a growth, the vessels are emptied. All changed segments are marked in the log. Another lineage is
    /// another tree, which is taken over as a whole.
    pub(crate) fn follow(
        &mut self,
        grown: Option<GrownTree>,
        lineage: Lineage,
        changed: Option<&[u32]>,
        log: &mut ChangeLog,
    ) {
        let changed = changed.filter(|_| self.lineage == lineage && log.is_of(lineage));
        self.is_grown = true;
        self.edits += 1;
        if changed.is_none() {
            self.clear();
            self.lineage = lineage;
            log.begin_tree(lineage);
        }
        let Some(grown) = grown else { return };
        let known = self.tree.len();
        for node in known..grown.tree.len() {
            self.append(&grown, node);
        }
        let Some(changed) = changed else { return };
        for &node in changed.iter().filter(|&&node| (node as usize) < known) {
            let position = grown.lifted_position(NodeId(node));
            self.update(node as usize, position, grown.tree.radii()[node as usize]);
        }
        self.mark(changed, known, log);
    }

    /// Marks nodes that changed, their children, and all nodes from `known` on.
    fn mark(&self, changed: &[u32], known: usize, log: &mut ChangeLog) {
        let with_children = changed.iter().flat_map(|&node| {
            let node = node as usize;
            std::iter::once(node).chain(self.children(node))
        });
        log.mark(with_children.chain(known..self.tree.len()));
    }

    fn clear(&mut self) {
        self.tree.clear();
        self.birth_steps.clear();
        self.first_children.clear();
        self.next_siblings.clear();
        self.bounds = None;
        self.widest_radius = 0.0;
        self.rest = None;
    }

    /// The tree at rest, however its organ is deformed.
    pub(crate) fn tree_at_rest(&self) -> Cow<'_, VesselTree> {
        let Some(rest) = &self.rest else { return Cow::Borrowed(&self.tree) };
        let mut tree = self.tree.clone();
        tree.positions_mut().copy_from_slice(rest);
        Cow::Owned(tree)
    }

    /// Moves the nodes with the organ's vertices. Nodes that are not bound yet are bound first.
    pub(crate) fn deform(&mut self, binding: &mut Binding, vertices: &[Vec3]) -> Result<(), BindingError> {
        let rest = self.rest.get_or_insert_with(|| self.tree.positions().to_vec());
        if binding.len() != self.tree.len() {
            self.tree.positions_mut().copy_from_slice(rest);
            binding.extend(&self.tree);
        }
        binding.follow_into(vertices, self.tree.positions_mut())?;
        self.bounds = None;
        (0..self.tree.len()).for_each(|node| self.enclose(node));
        Ok(())
    }

    /// Brings the nodes back to rest, and returns whether they were elsewhere.
    pub(crate) fn come_to_rest(&mut self) -> bool {
        let Some(rest) = self.rest.take() else { return false };
        self.tree.positions_mut().copy_from_slice(&rest);
        self.bounds = None;
        (0..self.tree.len()).for_each(|node| self.enclose(node));
        true
    }

    fn append(&mut self, grown: &GrownTree, node: usize) {
        let GrownTree { tree, birth_steps, .. } = grown;
        let position = grown.lifted_position(NodeId(node as u32));
        self.push(position, tree.parents()[node], tree.radii()[node], birth_steps.get(node).copied().unwrap_or(0));
    }

    fn push(&mut self, position: Vec3, parent: u32, radius: f32, birth_step: u32) {
        let node = self.tree.len();
        let sibling = match parent {
            NO_PARENT => {
                self.tree.push_root(position, radius);
                NO_PARENT
            }
            parent => {
                self.tree.push_child(NodeId(parent), position, radius);
                std::mem::replace(&mut self.first_children[parent as usize], node as u32)
            }
        };
        self.first_children.push(NO_PARENT);
        self.next_siblings.push(sibling);
        self.birth_steps.push(birth_step);
        if let Some(rest) = &mut self.rest {
            rest.push(position);
        }
        self.enclose(node);
    }

    fn update(&mut self, node: usize, position: Vec3, radius: f32) {
        self.tree.positions_mut()[node] = position;
        if let Some(rest) = &mut self.rest {
            rest[node] = position;
        }
        self.tree.radii_mut()[node] = radius;
        self.enclose(node);
    }

    /// Upper bound of the radii of all segments.
    pub(crate) fn widest_radius(&self) -> f32 {
        self.widest_radius
    }

    /// Whether some segment may share a point with a box. A segment counts with the radius of its own node throughout.
    pub(crate) fn may_meet(&self, min: Vec3, max: Vec3) -> bool {
        let room = self.widest_radius;
        self.bounds.is_some_and(|(low, high)| (low - room).cmple(max).all() && (high + room).cmpge(min).all())
    }

    fn enclose(&mut self, node: usize) {
        let (position, radius) = (self.tree.positions()[node], self.tree.radii()[node]);
        let (min, max) = self.bounds.unwrap_or((position, position));
        self.bounds = Some((min.min(position - radius), max.max(position + radius)));
        self.widest_radius = self.widest_radius.max(radius);
    }

    pub(crate) fn children(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        let link = |child: u32| (child != NO_PARENT).then_some(child as usize);
        std::iter::successors(link(self.first_children[node]), move |&child| link(self.next_siblings[child]))
    }
}

/// Equality ignores the lineage.
impl PartialEq for Vessels {
    fn eq(&self, other: &Self) -> bool {
        (self.kind, &self.tree, &self.birth_steps) == (other.kind, &other.tree, &other.birth_steps)
    }
}

impl From<&Vessels> for SavedVessels {
    fn from(vessels: &Vessels) -> Self {
        let tree = || vessels.tree_at_rest().into_owned();
        let given = (!vessels.is_grown).then(|| GivenTree { tree: tree(), birth_steps: vessels.birth_steps.clone() });
        Self { kind: vessels.kind, hash: vessels.hash(), given }
    }
}

impl From<SavedVessels> for Vessels {
    fn from(saved: SavedVessels) -> Self {
        let vessels = match &saved.given {
            Some(GivenTree { tree, birth_steps }) => Self::from_tree(saved.kind, tree, birth_steps),
            None => Self::new(saved.kind),
        };
        Self { saved_hash: saved.hash, ..vessels }
    }
}

impl Serialize for Vessels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SavedVessels::from(self).serialize(serializer)
    }
}

/// Clones vessels with only what a file keeps, since each clone has a growth of its own.
fn clone_as_saved(source: &SourceComponent, context: &mut ComponentCloneCtx) {
    if let Some(vessels) = source.read::<Vessels>() {
        context.write_target_component(vessels.as_saved());
    }
}

/// Inserted vessels replace those that were there.
fn mark_inserted(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let lineage = world.get::<Vessels>(entity).map(Vessels::lineage);
    let log = world.get_mut::<ChangeLog>(entity);
    if let (Some(lineage), Some(mut log)) = (lineage, log) {
        log.begin_tree(lineage);
    }
}

/// Publish: vessels that were overwritten in place count as replaced, too.
pub(crate) fn mark_replaced(mut vessels: Query<(&Vessels, &mut ChangeLog), Changed<Vessels>>) {
    for (vessels, mut log) in &mut vessels {
        if !log.is_of(vessels.lineage()) {
            log.begin_tree(vessels.lineage());
        }
    }
}
