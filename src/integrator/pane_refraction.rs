//! Refraction by panes, bodies between two parallel planes: sideways shifts of rays, refracted connections and their pdfs.

use super::interior::Interior;
use super::mis::LightPdf;
use crate::color::Rgb;
use crate::math::{Frame, Hit, Ray, Vec3};

/// Maximum number of panes that a ray passes.
pub(super) const MAX_PANES: usize = 6;

/// Maximum number of Newton steps for a refracted connection. Three are enough for panes thinner than a tenth of the distance.
const STEPS: usize = 12;

/// Convergence threshold: sideways error at the target relative to the length of the connection, some rounding errors.
const MAX_MISS: f32 = 4e-6;

/// A pane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pane {
    /// Unit normal of the faces.
    pub normal: Vec3,
    /// Metres.
    pub thickness: f32,
    /// Index of refraction.
    pub ior: f32,
}

impl Pane {
    /// Sideways shift of a ray of direction `w`: lateral travel of the refracted ray between the faces minus that of the unrefracted.
    fn offset(&self, w: Vec3) -> Vec3 {
        let along = w.dot(self.normal);
        (w - self.normal * along) * (self.thickness * self.shift(along.abs()))
    }

    /// 1 / (n cos theta') - 1 / cos theta.
    fn shift(&self, cosine: f32) -> f32 {
        self.inside(cosine) - 1.0 / cosine
    }

    /// 1 / (n cos theta').
    fn inside(&self, cosine: f32) -> f32 {
        1.0 / (self.ior * self.ior - 1.0 + cosine * cosine).sqrt()
    }

    /// Derivative of the offset with respect to the direction `w` along `v`, which is perpendicular to `w`.
    fn derivative(&self, w: Vec3, v: Vec3) -> Vec3 {
        let (along, rise) = (w.dot(self.normal), v.dot(self.normal));
        let cosine = along.abs();
        let slope = 1.0 / (cosine * cosine) - cosine * self.inside(cosine).powi(3);
        let by_cosine = slope * rise * along.signum();
        ((v - self.normal * rise) * self.shift(cosine) + (w - self.normal * along) * by_cosine)
            * self.thickness
    }
}

/// The panes that a ray passed, in order.
#[derive(Clone, Copy, Debug)]
pub(super) struct PaneList {
    list: [Pane; MAX_PANES],
    count: usize,
}

impl PaneList {
    /// No panes.
    pub const NONE: PaneList =
        PaneList { list: [Pane { normal: Vec3::Z, thickness: 0.0, ior: 1.0 }; MAX_PANES], count: 0 };

    fn iter(&self) -> impl Iterator<Item = &Pane> {
        self.list[..self.count].iter()
    }

    /// Is the number of panes below [`MAX_PANES`]?
    pub fn has_room(&self) -> bool {
        self.count < MAX_PANES
    }

    /// Are there no panes?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Adds a pane; [`PaneList::has_room`] must hold.
    pub fn push(&mut self, pane: Pane) {
        self.list[self.count] = pane;
        self.count += 1;
    }

    /// Length of the unrefracted ray of direction `w` between two points, after subtracting the sideways shifts.
    pub fn length(&self, w: Vec3, origin: Vec3, target: Vec3) -> f32 {
        (target - origin - self.offset(w)).dot(w)
    }

    /// Sideways shift of a ray of direction `w` by all panes.
    fn offset(&self, w: Vec3) -> Vec3 {
        self.iter().fold(Vec3::ZERO, |sum, pane| sum + pane.offset(w))
    }

    /// Jacobian of the end point of a ray of length `s` with respect to its direction `w`, a symmetric matrix in a frame around `w`: xx,
    /// xy, yy.
    fn jacobian(&self, w: Vec3, s: f32, frame: &Frame) -> [f32; 3] {
        self.iter().fold([s, 0.0, s], |sum, pane| {
            let (x, y) = (pane.derivative(w, frame.s), pane.derivative(w, frame.t));
            [sum[0] + x.dot(frame.s), sum[1] + x.dot(frame.t), sum[2] + y.dot(frame.t)]
        })
    }

    /// Area perpendicular to `w` at `target` per solid angle at `origin`, for rays through the panes, m^2/sr.
    fn spread(&self, w: Vec3, origin: Vec3, target: Vec3) -> f32 {
        let s = self.length(w, origin, target);
        let [xx, xy, yy] = self.jacobian(w, s, &Frame::from_normal(w));
        (xx * yy - xy * xy).abs()
    }

    /// The direction at `origin` of the ray to `target` through all panes; `None` if Newton's method doesn't converge.
    pub fn connect(&self, origin: Vec3, target: Vec3) -> Option<Vec3> {
        let between = target - origin;
        let mut w = between.try_normalize()?;
        for _ in 0..STEPS {
            let rest = between - self.offset(w);
            let s = rest.dot(w);
            let frame = Frame::from_normal(w);
            let (a, b) = (rest.dot(frame.s), rest.dot(frame.t));
            if a.abs().max(b.abs()) <= MAX_MISS * between.length() {
                return (s > 0.0).then_some(w);
            }
            let [xx, xy, yy] = self.jacobian(w, s, &frame);
            let determinant = xx * yy - xy * xy;
            let step = frame.s * (yy * a - xy * b) + frame.t * (xx * b - xy * a);
            w = (w + step / determinant).try_normalize()?;
        }
        None
    }

    /// Ratio of the solid-angle pdf of light sampling with panes to that without. `normal` is the light's at `target`, zero for point
    /// lights and media.
    pub fn density_ratio(&self, w: Vec3, origin: Vec3, target: Vec3, normal: Vec3) -> f32 {
        let between = target - origin;
        let distance_squared = between.length_squared();
        let cosines = match normal == Vec3::ZERO {
            true => 1.0,
            false => (normal.dot(between) / (distance_squared.sqrt() * normal.dot(w))).abs(),
        };
        let ratio = cosines * self.spread(w, origin, target) / distance_squared;
        if ratio.is_finite() { ratio } else { 0.0 }
    }
}

/// The panes that an arriving ray passed, and the continued ray behind the last one until it is traced.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayCrossings {
    pub panes: PaneList,
    /// Sum of the sideways shifts.
    pub offset: Vec3,
    pub next: Option<Ray>,
}

impl RayCrossings {
    /// No panes.
    pub const NONE: RayCrossings = RayCrossings { panes: PaneList::NONE, offset: Vec3::ZERO, next: None };
}

/// Takes the continued ray of arriving path `i` behind the pane that it just passed.
pub(super) fn behind_pane(i: usize, crossings: &mut [RayCrossings]) -> Option<Ray> {
    crossings.get_mut(i).and_then(|passed| passed.next.take())
}

/// The panes that a shadow ray passed, and its light sample before refraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShadowCrossings {
    pub panes: PaneList,
    /// Hit of each pane.
    pub hits: [Hit; MAX_PANES],
    /// Transmittance of all panes.
    pub transmittance: Rgb,
    /// The solids around the origin of the shadow ray.
    pub interior: Interior,
    /// Direction of the light sample before refraction.
    pub wi: Vec3,
    /// Pdf of the light sample before refraction.
    pub pdf: LightPdf,
}

impl ShadowCrossings {
    /// Adds a pane; [`PaneList::has_room`] must hold.
    pub fn push(&mut self, pane: Pane, hit: Hit) {
        self.hits[self.panes.count] = hit;
        self.panes.push(pane);
    }

    /// Hits of the panes.
    pub fn hits(&self) -> &[Hit] {
        &self.hits[..self.panes.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panes(list: &[Pane]) -> PaneList {
        let mut panes = PaneList::NONE;
        panes.list[..list.len()].copy_from_slice(list);
        panes.count = list.len();
        panes
    }

    const PANE: Pane = Pane { normal: Vec3::Y, thickness: 0.1, ior: 1.5 };

    #[test]
    fn connections_obey_snells_law() {
        for target in [Vec3::new(0.3, 2.0, -0.1), Vec3::new(5.0, 1.0, 2.0), Vec3::new(0.0, 0.2, 0.0)] {
            let w = panes(&[PANE]).connect(Vec3::ZERO, target).expect("there is one");
            // The horizontal distance: (h - d) tan theta + d tan theta'.
            let sine = (1.0 - w.y * w.y).max(0.0).sqrt();
            let within = (PANE.ior * PANE.ior - sine * sine).sqrt();
            let distance = (target.y - PANE.thickness) * sine / w.y + PANE.thickness * sine / within;
            let expected = (target.x * target.x + target.z * target.z).sqrt();
            let miss = (distance - expected).abs() * w.y;
            assert!(miss < 1e-5 * target.length(), "{distance} {expected}");
        }
    }

    #[test]
    fn spread_is_the_jacobian_determinant() {
        let tilted = Pane { normal: Vec3::new(0.6, 0.8, 0.0), thickness: 0.2, ior: 1.3 };
        let all = panes(&[PANE, tilted]);
        let (w, s) = (Vec3::new(0.3, 0.9, 0.2).normalize(), 1.5);
        let end = |w: Vec3| w * s + all.offset(w);
        let frame = Frame::from_normal(w);
        let step = 1e-3;
        let along =
            |v: Vec3| (end((w + v * step).normalize()) - end((w - v * step).normalize())) / (2.0 * step);
        let (x, y) = (along(frame.s), along(frame.t));
        let area = x.dot(frame.s) * y.dot(frame.t) - x.dot(frame.t) * y.dot(frame.s);
        let spread = all.spread(w, Vec3::ZERO, end(w));
        assert!((spread / area - 1.0).abs() < 1e-3, "{spread} {area}");
    }
}
