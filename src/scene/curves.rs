//! Curves with a thickness: hair, fur, grass, threads.

use super::{MaterialId, ObjectTraits};
use crate::math::{DAffine3, DVec3};

/// How a strand runs between its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveBasis {
    /// Straight from point to point.
    Linear,
    /// Cubic Bezier curves end to end: every third point lies on the strand.
    Bezier,
    /// A uniform cubic B-spline that begins near its first and ends near its last point.
    BSpline,
    /// A cubic curve through all points.
    #[default]
    CatmullRom,
}

impl CurveBasis {
    /// All of them.
    pub const ALL: [CurveBasis; 4] =
        [CurveBasis::Linear, CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            CurveBasis::Linear => "linear",
            CurveBasis::Bezier => "bezier",
            CurveBasis::BSpline => "bspline",
            CurveBasis::CatmullRom => "catmull-rom",
        }
    }

    /// The basis of a name.
    pub fn of_name(name: &str) -> Option<CurveBasis> {
        CurveBasis::ALL.into_iter().find(|basis| basis.name() == name)
    }

    /// May a strand have so many points?
    pub fn takes(self, points: usize) -> bool {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => points >= 2,
            CurveBasis::Bezier => points >= 4 && points % 3 == 1,
            CurveBasis::BSpline => points >= 4,
        }
    }

    /// What [`CurveBasis::takes`] asks for, in words.
    pub fn asks_for(self) -> &'static str {
        match self {
            CurveBasis::Linear | CurveBasis::CatmullRom => "2 or more",
            CurveBasis::Bezier => "4, 7, 10, ...",
            CurveBasis::BSpline => "4 or more",
        }
    }
}

/// Strands of one material, placed in the world.
#[derive(Clone, Debug)]
pub struct Curves {
    /// For reports.
    pub name: String,
    /// How strands run between their points.
    pub basis: CurveBasis,
    /// How many points each strand has, one strand after the other.
    pub strands: Vec<u32>,
    /// The points of all strands, in object space.
    pub points: Vec<[f32; 3]>,
    /// The radius at each point, from 0 up; between points it runs as the strand does.
    pub radii: Vec<f32>,
    /// Linear colours by point, which the material's colour is multiplied with if it uses the colours of vertices; empty
    /// where there are none.
    pub colors: Vec<[f32; 3]>,
    /// Placement; radii grow with the cube root of its determinant.
    pub world_from_object: DAffine3,
    /// Their material.
    pub material: MaterialId,
    /// What they are to rays and pictures.
    pub traits: ObjectTraits,
}

impl Curves {
    /// The factor that the placement scales radii by.
    pub fn radius_scale(&self) -> f64 {
        self.world_from_object.matrix3.determinant().abs().cbrt()
    }

    /// Hands each point to `each`, in world space, with its radius there.
    pub fn visit(&self, each: &mut dyn FnMut(DVec3, f64)) {
        let scale = self.radius_scale();
        for (point, radius) in self.points.iter().zip(&self.radii) {
            let point = DVec3::from(point.map(f64::from));
            each(self.world_from_object.transform_point3(point), f64::from(*radius) * scale);
        }
    }
}
