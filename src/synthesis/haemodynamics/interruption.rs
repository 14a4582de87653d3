//! The effect of a cut or a clamp on a segment.

use super::FlowError;

/// The hole at the end of a severed vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Outlet {
    /// Radius of the hole before any clotting.
    ///
    /// Units: tissue lengths. Limits: finite, > 0. Usually the vessel's radius.
    pub radius: f32,
}

/// A gap in a segment, laid over the tree by cuts and clamps.
///
/// The vessel is intact from the parent to the share `first`, and from the share `last` to the node; the part in
/// between carries nothing. A clamp has `first == last` and both ends closed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "plugin", derive(bevy::reflect::Reflect))]
pub struct Interruption {
    /// Share of the segment, counted from the parent, up to which the vessel is intact. Limits: 0 to `last`.
    pub first: f32,
    /// Share from which it is intact again. Limits: `first` to 1.
    pub last: f32,
    /// The hole at `first`; `None` if that end is clamped, sealed or tied.
    pub proximal: Option<Outlet>,
    /// The hole at `last`; `None` if that end is closed.
    pub distal: Option<Outlet>,
}

impl Interruption {
    /// A clamp at a share of the segment: closed on both sides.
    pub fn clamp(along: f32) -> Self {
        Self { first: along, last: along, proximal: None, distal: None }
    }

    /// A cut at a share of the segment, open on both sides with holes of a radius in tissue lengths.
    pub fn cut(along: f32, radius: f32) -> Self {
        let outlet = Some(Outlet { radius });
        Self { first: along, last: along, proximal: outlet, distal: outlet }
    }

    pub(super) fn validate(&self, node: u32) -> Result<(), FlowError> {
        let Self { first, last, .. } = *self;
        FlowError::check_share("the first share of an interruption", f64::from(first))?;
        FlowError::check_share("the last share of an interruption", f64::from(last))?;
        if first > last {
            return Err(FlowError::InterruptionBackwards { node, first, last });
        }
        for outlet in [self.proximal, self.distal].into_iter().flatten() {
            FlowError::check_positive("the radius of an outlet in tissue lengths", f64::from(outlet.radius))?;
        }
        Ok(())
    }
}
