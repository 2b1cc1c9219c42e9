//! Openings through which the environment lights a room.

use crate::math::DVec3;

/// A rectangle, such as a window, through which light of the environment is looked for. It is no surface, hides nothing and lets
/// no more light in than there is: it only makes rooms less noisy. It serves what lies in front of it, on the side of
/// `edge_u` x `edge_v`.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// For reports.
    pub name: String,
    /// One corner.
    pub corner: DVec3,
    /// To the next corner.
    pub edge_u: DVec3,
    /// To the corner before, at right angles to the other edge.
    pub edge_v: DVec3,
}
