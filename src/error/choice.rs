//! Choices of the caller that messages refer to.

use std::fmt;

/// A choice of the caller that would change what a message is about. Messages name it as the library does; a program with
/// names of its own for choices puts those in their place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Files outside an asset's folder may be read.
    AllowExternal,
    /// Channels beside the picture's own.
    Aovs,
    /// What is behind everything.
    Background,
    /// A file beside the model says what its format can't.
    NewSidecar,
    /// Where Blender is.
    Blender,
    /// The caller lights the scene, or wants no light.
    Environment,
    /// Pixels of full precision.
    Float,
    /// Extensions that a file demands may be missing.
    Force,
    /// What transparent materials without a volume are.
    Glass,
    /// What a bare model stands on.
    Ground,
    /// What the numbers of lights mean.
    LightUnits,
    /// The memory that one image may take.
    MemoryLimit,
    /// Settings beside a model don't count.
    NoSidecar,
    /// The size of the points of a point cloud.
    PointRadius,
    /// Normals for meshes without.
    Smooth,
    /// `LoadOptions::subdivision`.
    Subdivide,
    /// What lights scenes without light.
    Stage,
    /// Which axis of a file points up.
    Up,
    /// From where a bare model is seen.
    ViewFrom,
    /// How large a bare model is in the picture.
    Zoom,
}

impl Choice {
    /// All of them.
    pub const ALL: [Choice; 20] = [
        Choice::AllowExternal,
        Choice::Aovs,
        Choice::Background,
        Choice::NewSidecar,
        Choice::Blender,
        Choice::Environment,
        Choice::Float,
        Choice::Force,
        Choice::Glass,
        Choice::Ground,
        Choice::LightUnits,
        Choice::MemoryLimit,
        Choice::NoSidecar,
        Choice::PointRadius,
        Choice::Smooth,
        Choice::Subdivide,
        Choice::Stage,
        Choice::Up,
        Choice::ViewFrom,
        Choice::Zoom,
    ];
}

/// What the library calls it, between backticks.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Choice::AllowExternal => "`LoadOptions::allow_external`",
            Choice::Aovs => "`Renderer::aovs`",
            Choice::Background => "`StageOptions::background`",
            Choice::NewSidecar => "`scene_file::sidecar`",
            Choice::Blender => "`BlenderOptions::program`",
            Choice::Environment => "`LoadOptions::brings_environment`",
            Choice::Float => "`OutputOptions::float`",
            Choice::Force => "`GltfOptions::force`",
            Choice::Glass => "`GltfOptions::glass`",
            Choice::Ground => "`StageOptions::ground`",
            Choice::LightUnits => "`GltfOptions::light_units`",
            Choice::MemoryLimit => "`LoadOptions::memory_limit`",
            Choice::NoSidecar => "`LoadOptions::no_sidecar`",
            Choice::PointRadius => "`LoadOptions::point_radius`",
            Choice::Smooth => "`LoadOptions::smooth_rad`",
            Choice::Subdivide => "`LoadOptions::subdivision`",
            Choice::Stage => "`StageOptions::light`",
            Choice::Up => "`LoadOptions::up`",
            Choice::ViewFrom => "`StageOptions::view`",
            Choice::Zoom => "`StageOptions::zoom`",
        })
    }
}
