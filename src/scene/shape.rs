//! Shapes that are no meshes: spheres, disks and the like.

use super::{MaterialId, ObjectTraits};
use crate::math::{DQuat, DVec3};

/// A shape that is no mesh, in world space.
#[derive(Clone, Debug)]
pub struct Shape {
    /// For reports.
    pub name: String,
    /// Which shape it is.
    pub kind: ShapeKind,
    /// Its middle.
    pub center: DVec3,
    /// Radius, above 0.
    pub radius: f64,
    /// Turns the shape with its texture coordinates and object-space textures; the identity for most spheres.
    pub rotation: DQuat,
    /// Its material.
    pub material: MaterialId,
    /// What it is to rays and pictures.
    pub traits: ObjectTraits,
}

/// Makes [`ShapeKind`] and [`ShapeTag`] of a table: each kind with the numbers that it needs beside a radius, what one
/// and many of it are called, whether it encloses anything, and half the size of the box around one of radius 1 by its
/// rotation.
macro_rules! kinds {
    ($(
        $(#[$about:meta])*
        $kind:ident $({ $($(#[$about_number:meta])* $number:ident),* $(,)? })?
        $one:literal $many:literal closed: $closed:literal half_extent: $half_extent:expr;
    )*) => {
        /// Kinds of shapes that are no meshes. What is said of x, y and z holds before the shape is turned.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum ShapeKind {
            $($(#[$about])* $kind $({ $($(#[$about_number])* $number: f64),* })?,)*
        }

        /// Which of the kinds of shapes, without its numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum ShapeTag {
            $($(#[$about])* $kind,)*
        }

        impl ShapeKind {
            /// Which kind it is.
            pub fn tag(&self) -> ShapeTag {
                match self {
                    $(ShapeKind::$kind { .. } => ShapeTag::$kind,)*
                }
            }

            /// Its numbers beside the radius.
            pub fn numbers(&self) -> Vec<f64> {
                match *self {
                    $(ShapeKind::$kind $({ $($number),* })? => vec![$($($number),*)?],)*
                }
            }

            /// Half the size of the box around one of radius 1.
            #[allow(unused_variables)]
            fn half_extent(&self, rotation: DQuat) -> DVec3 {
                match *self {
                    $(ShapeKind::$kind $({ $($number),* })? => ($half_extent)(rotation),)*
                }
            }
        }

        impl ShapeTag {
            /// All of them; each is in the place that its number says.
            pub const ALL: &[ShapeTag] = &[$(ShapeTag::$kind),*];

            /// What one is called.
            pub fn name(self) -> &'static str {
                match self {
                    $(ShapeTag::$kind => $one,)*
                }
            }

            /// What many are called.
            pub fn plural(self) -> &'static str {
                match self {
                    $(ShapeTag::$kind => $many,)*
                }
            }

            /// Does it enclose anything?
            pub fn is_closed(self) -> bool {
                match self {
                    $(ShapeTag::$kind => $closed,)*
                }
            }
        }
    };
}

kinds! {
    /// A sphere. Textures go around the y axis.
    Sphere "sphere" "spheres" closed: true half_extent: |_| DVec3::ONE;
    /// A flat disk whose front faces z. Textures have x to the right and y up, and touch its edge.
    Disk "disk" "disks" closed: false half_extent: around_flat_disk;
    /// A disk that turns its front to the origin of each ray: a lamp with a soft falloff. It has no textures.
    FacingDisk "facing disk" "facing disks" closed: false half_extent: |_| DVec3::ONE;
    /// A sphere that each ray meets once, from outside its near side and from inside its far one: a lamp that rays pass.
    Shell "shell" "shells" closed: false half_extent: |_| DVec3::ONE;
}

/// How far a flat disk of radius 1 reaches along each axis.
fn around_flat_disk(rotation: DQuat) -> DVec3 {
    let normal = rotation * DVec3::Z;
    (DVec3::ONE - normal * normal).max(DVec3::ZERO).map(f64::sqrt)
}

impl Shape {
    /// Half the size of the box around it.
    pub fn half_extent(&self) -> DVec3 {
        self.kind.half_extent(self.rotation) * self.radius
    }
}
