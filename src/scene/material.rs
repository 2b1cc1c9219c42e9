//! Materials as the user described them; `compile` turns each into the cheapest equivalent BSDF.

use super::light::SpotFade;
use super::medium::Medium;
use super::model::{Model, PbrMaterial};
use super::object_traits::RayKinds;
use super::slot::{
    ColorSlot, FloatSlot, NormalMap, Parameter, ParameterMut, Parameters, parameters_of_fields,
};
use super::{ProfileId, TextureId};
use crate::math::{DQuat, DVec3};

/// Emitted radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emission {
    /// Radiance: factor and optional texture.
    pub radiance: ColorSlot,
    /// Emits from the back as well; else the back is dark, where [`Material::double_sided`] says that there is one.
    pub two_sided: bool,
}

/// What happens where alpha is below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Present where alpha is at least the cutoff, absent elsewhere.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Present with probability alpha.
    Blend,
}

/// Special properties of an emitting surface: ray visibility, whether it blocks rays (lamps of Blender don't), and a beam shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Visible to rays of these kinds; others pass and get no light from it.
    pub visible_to: RayKinds,
    /// Rays end at it; else they add its emission and pass.
    pub is_obstacle: bool,
    /// Angular distribution of its emission.
    pub beam: Beam,
}

impl Default for Lamp {
    /// A surface like others.
    fn default() -> Lamp {
        Lamp { visible_to: RayKinds::ALL, is_obstacle: true, beam: Beam::Even }
    }
}

/// How the radiance of a [`Lamp`] depends on the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Beam {
    /// It doesn't.
    #[default]
    Even,
    /// Slats in front of the lamp hide part of it, as in a soft box: with the tangent of the angle to the surface's normal
    /// the radiance falls in a line to 0 at this half angle (radians, from 1e-4 to below pi / 2); its peak rises so that the
    /// power stays.
    Grid {
        /// Half the angle of the beam.
        half_angle_rad: f64,
    },
    /// A cone about an axis, as that of [`LightKind::Spot`](super::LightKind::Spot).
    Cone {
        /// The axis, of unit length, in the world.
        direction: DVec3,
        /// Half angle of the full radiance, radians.
        inner_angle_rad: f64,
        /// Half angle where it ends, radians.
        outer_angle_rad: f64,
        /// How it fades in between.
        fade: SpotFade,
    },
    /// A measured profile, of which the radiance is the peak's.
    Profile {
        /// The profile; its largest value is 1.
        profile: ProfileId,
        /// Turns it into world space: it shines along -z, and its horizontal angles turn from x to y.
        rotation: DQuat,
        /// Half angles, radians, between which a cone about the way it shines fades by a smooth step, if there is one.
        cone: Option<[f64; 2]>,
    },
}

/// Displacement of a mesh along its normals by a height map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// An image by texture coordinates, and the channel that holds the heights.
    pub texture: (TextureId, u8),
    /// How far a height of 1 lies above one of 0, in the units of the mesh.
    pub scale: f32,
    /// The height that stays where the mesh is.
    pub midlevel: f32,
    /// Longest edge of triangles, in the units of the mesh; 0 is 1/256 of the diagonal of the mesh's box.
    pub edge: f32,
}

/// A material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For reports and overrides.
    pub name: String,
    /// How it scatters.
    pub model: Model,
    /// What it emits.
    pub emission: Option<Emission>,
    /// False: seen from behind the surface isn't there (glTF 2.0, section 3.9.5: back faces are culled). What counts is the
    /// direction in which paths from the eye arrive, those that ask whether a light is hidden included. Transmissive
    /// materials scatter on both sides whatever this says.
    pub double_sided: bool,
    /// What alpha does.
    pub alpha_mode: AlphaMode,
    /// Opacity, used unless the mode is opaque.
    pub alpha: FloatSlot,
    /// Normal map.
    pub normal_map: Option<NormalMap>,
    /// A graph of nodes that gives the shading normal in world space, on the viewer's side, in place of a normal map.
    pub normal: Option<TextureId>,
    /// Vertex colours multiply the base colour.
    pub use_vertex_colors: bool,
    /// What fills its solids, beside what the model says of their inside; only where the model lets light in.
    pub medium: Option<Medium>,
    /// Moves the surface. Loading a file applies it; a scene that is built in code is rendered without.
    pub displacement: Option<Displacement>,
    /// Which of several solids counts where they overlap: the one of the highest priority, and among equals the one that light
    /// entered last.
    pub priority: i32,
    /// What is special about a surface that shines; only where it is absent nowhere.
    pub lamp: Option<Lamp>,
    /// A number that graphs of nodes know it by.
    pub index: u32,
    /// The group of lights that what it emits belongs to, which pictures may hold apart; empty for the default one.
    pub light_group: String,
}

impl Material {
    /// A double-sided material without emission.
    pub fn new(name: impl Into<String>, model: Model) -> Material {
        Material {
            name: name.into(),
            model,
            emission: None,
            double_sided: true,
            alpha_mode: AlphaMode::Opaque,
            alpha: FloatSlot::constant(1.0),
            normal_map: None,
            normal: None,
            use_vertex_colors: false,
            medium: None,
            displacement: None,
            priority: 0,
            lamp: None,
            index: 0,
            light_group: String::new(),
        }
    }

    /// Ideal diffuse reflection of a constant albedo.
    pub fn lambert(name: impl Into<String>, albedo: [f32; 3]) -> Material {
        Material::new(name, Model::Lambert { albedo: ColorSlot::constant(albedo) })
    }

    /// A glTF material.
    pub fn gltf(name: impl Into<String>, parameters: PbrMaterial) -> Material {
        Material::new(name, Model::Pbr(Box::new(parameters)))
    }

    /// A black emitter of constant radiance. Its back, where that is dark, is there all the same.
    pub fn emitter(name: impl Into<String>, radiance: [f32; 3], two_sided: bool) -> Material {
        let emission = Some(Emission { radiance: ColorSlot::constant(radiance), two_sided });
        Material { emission, ..Material::new(name, Model::Black) }
    }
}

impl Parameters for AlphaMode {}
impl Parameters for Lamp {}

parameters_of_fields! {
    Material {
        name, model, emission, double_sided, alpha_mode, alpha, normal_map, normal, use_vertex_colors, medium, displacement,
        priority, lamp, index, light_group,
    }
    Displacement { texture, scale, midlevel, edge }
    Emission { radiance, two_sided }
}

impl Material {
    /// Visits every parameter of the material.
    pub fn parameters(&self, visitor: &mut dyn FnMut(&'static str, Parameter<'_>)) {
        self.visit("", visitor);
    }

    /// The same, to change them.
    pub fn parameters_mut(&mut self, visitor: &mut dyn FnMut(&'static str, ParameterMut<'_>)) {
        self.visit_mut("", visitor);
    }

    /// Every texture that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + use<> {
        let mut found = Vec::new();
        self.parameters(&mut |_, parameter| found.extend(parameter.texture()));
        found.into_iter()
    }
}
