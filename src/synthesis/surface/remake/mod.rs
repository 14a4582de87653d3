//! Joints whose faces meet are made again, from the outline of their tubes.
//!
//! In: a mesh and the stretches in which its cage may have lacked room. Out: the mesh, with patches in place of the faces
//! that met. Where faces meet since the tubes themselves run through each other, they stay: no surface could be better.
//!
//! A patch fills a ball around the faces that met. It is taken only if it hangs together as they did and none of its
//! faces meet: so the mesh stays closed, one ball for each tree.

mod ball;
mod contour;
mod graft;
mod knots;
mod mend;
mod patch;
mod plan;
mod site;
mod smooth;
mod tubes;

use super::mesh::SurfaceMesh;
use crate::synthesis::pace::Pace;
use crate::synthesis::tree::NodeId;
use graft::{Graft, Lines};
use knots::Knot;
use mend::{MOST_FACES, Outcome};
use site::Site;
use std::collections::BTreeMap;

pub(super) use plan::Plan;

/// The most knots that become one.
const MOST_PARTS: usize = 4;

/// What was made again, by one node of each joint.
#[derive(Clone, Debug, Default)]
pub(super) struct Remade {
    /// Joints that are patches now.
    pub remade: Vec<NodeId>,
    /// Joints that could not be.
    pub left: Vec<NodeId>,
}

/// Makes joints again whose faces meet. The plan is dropped as soon as it can be: a large one takes much memory.
pub(super) async fn remake(mesh: &mut SurfaceMesh, plan: Plan, pace: &Pace) -> Remade {
    let site = Site::of(mesh, &plan);
    let knots = site.knots(&pace.part(0.0..0.5)).await;
    let (grafts, left) = mend_all(&site, knots, &pace.part(0.5..0.9)).await;
    let node = |knot: &Knot| knot.faces.first().map(|&face| site.node_at(site.place_of(face)));
    let mut done = Remade {
        remade: grafts.iter().filter_map(|(knot, _)| node(knot)).collect(),
        left: left.iter().filter_map(node).collect(),
    };
    if !grafts.is_empty() {
        let grafts = grafts.into_iter().map(|(_, graft)| graft).collect();
        let lines = Lines { curves: &plan.curves, trunks: &plan.trunks, origin: plan.origin };
        let parts = graft::parts_of(grafts, mesh, lines);
        drop(plan);
        parts.put_into(mesh, &pace.part(0.9..1.0)).await;
    }
    done.remade.sort_unstable();
    done.left.sort_unstable();
    done
}

/// Mends all knots; those that need the same faces become one. Returns what is mended and what isn't.
async fn mend_all(site: &Site<'_>, knots: Vec<Knot>, pace: &Pace) -> (Vec<(Knot, Graft)>, Vec<Knot>) {
    let mut mended: Vec<Option<(Knot, Graft)>> = Vec::new();
    let mut owners: BTreeMap<u32, usize> = BTreeMap::new();
    let mut left = Vec::new();
    let count = knots.len() as f32;
    for (number, first) in knots.into_iter().enumerate() {
        // Mended knots that become a part of this one.
        let (mut knot, mut parts) = (first.clone(), Vec::new());
        loop {
            let is_taken = |face: u32| owners.get(&face).is_some_and(|owner| !parts.contains(owner));
            let is_thicket = knot.faces.len() > MOST_FACES || parts.len() > MOST_PARTS;
            match if is_thicket { Outcome::Left } else { site.mend(&knot, is_taken) } {
                Outcome::Mended(graft) => {
                    for &part in &parts {
                        mended[part] = None;
                    }
                    owners.retain(|_, owner| !parts.contains(owner));
                    owners.extend(graft.faces.iter().map(|&face| (face, mended.len())));
                    mended.push(Some((knot, graft)));
                    break;
                }
                Outcome::Meets(face) => {
                    if let Some((other, _)) = &mended[owners[&face]] {
                        knot.absorb(other);
                    }
                    parts.push(owners[&face]);
                }
                Outcome::Left => {
                    left.push(first);
                    break;
                }
            }
        }
        pace.rest((number + 1) as f32 / count).await;
    }
    // What another knot's patch has taken in is no more.
    left.retain(|knot| knot.faces.iter().any(|face| !owners.contains_key(face)));
    (mended.into_iter().flatten().collect(), left)
}
