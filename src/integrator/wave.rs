//! The state of a wave: paths and vertices as structures of arrays, so that loops over paths vectorise.

use super::interior::Interior;
use super::mis::{DirectionPdf, LightPdf};
use crate::color::Rgb;
use crate::compile::{Features, MAX_RECEIVER_CLASSES};
use crate::math::{OriginPrimitive, Vec3};
use crate::sampling::sampler::SobolPoint;
use crate::scene::{BounceLimits, RayKinds};
use bytemuck::Zeroable;
use std::ops::Mul;

/// Declares a structure of arrays over paths, and implements [`PerPath`].
macro_rules! per_path {
    ($(#[$of_struct:meta])* $visible:vis struct $name:ident {
        $($(#[$of_field:meta])* $field_visible:vis $field:ident: $type:ty,)*
    }) => {
        $(#[$of_struct])*
        #[derive(bytemuck::Zeroable)]
        $visible struct $name {
            $($(#[$of_field])* $field_visible $field: $type,)*
        }

        impl $crate::integrator::wave::PerPath for $name {
            #[inline(always)]
            fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
                $($crate::integrator::wave::PerPath::copy_to(&self.$field, i, &mut other.$field, k);)*
            }

            fn repeat(&mut self, count: usize, times: usize) {
                $($crate::integrator::wave::PerPath::repeat(&mut self.$field, count, times);)*
            }
        }
    };
}

per_path! {
    /// State of every path.
    pub struct PathState {
        /// Path throughput.
        pub throughput: RgbLanes,
        /// Pdf of the ray's direction.
        pub pdf: [DirectionPdf; LENGTH],
        /// Factor on throughput for Russian roulette: the squared relative indices of refraction (undoes the 1 / eta^2 of
        /// refractions), times the number of branches after a split, times the throughput before a cut (path reuse).
        pub roulette_scale: Lanes,
        /// Sobol point: seed of the sequence.
        pub seed: Words,
        /// Sobol point: bit-reversed index.
        pub index_rev: Words,
        /// Entry of the [`super::radiance_buffer::RadianceBuffer`] to which radiance is added.
        pub radiance_index: Words,
    }
}

impl PathState {
    /// The Sobol point of path `i`.
    #[inline(always)]
    pub fn sobol_point(&self, i: usize) -> SobolPoint {
        SobolPoint::from_parts(self.seed[i], self.index_rev[i])
    }

    /// Sets the Sobol point of path `i`.
    #[inline(always)]
    pub fn set_sobol_point(&mut self, i: usize, point: SobolPoint) {
        (self.seed[i], self.index_rev[i]) = point.to_parts();
    }
}

per_path! {
    /// Ray cones: the footprint of a path.
    pub struct Footprints {
        /// Width at the origin of the ray, metres.
        pub width: Lanes,
        /// Growth of the width along the ray, metres per metre.
        pub spread: Lanes,
    }
}

per_path! {
    /// The first bounce of each path.
    pub struct FirstBounces {
        /// Diffuse fraction of the BSDF value, by channel.
        pub diffuse: RgbLanes,
        /// 1 for transmission, 0 for reflection.
        pub is_transmission: Lanes,
    }
}

/// The first bounce of a path.
#[derive(Clone, Copy, Debug)]
pub struct FirstBounce {
    /// Diffuse fraction of the BSDF value, by channel.
    pub diffuse: Rgb,
    /// Is it transmission?
    pub is_transmission: bool,
}

impl FirstBounce {
    /// Diffuse reflection.
    pub const DIFFUSE: FirstBounce = FirstBounce { diffuse: Rgb::ONE, is_transmission: false };
}

impl FirstBounces {
    /// The first bounce of path `i`.
    #[inline]
    pub fn get(&self, i: usize) -> FirstBounce {
        FirstBounce { diffuse: get_rgb(&self.diffuse, i), is_transmission: self.is_transmission[i] > 0.0 }
    }

    /// Sets the first bounce of path `i`.
    #[inline]
    pub fn set(&mut self, i: usize, first: FirstBounce) {
        set_rgb(&mut self.diffuse, i, first.diffuse);
        self.is_transmission[i] = f32::from(u8::from(first.is_transmission));
    }
}

/// Visibility state of a path's ray: ray kind, whether the ray passed an object that occludes light samples, and the receiver class
/// (light linking) of the vertex at its origin.
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(transparent)]
pub struct RayVisibility(u32);

impl RayVisibility {
    const SHADOWED: u32 = 1 << 16;
    const CLASS_SHIFT: u32 = 17;
    const CLASS_MASK: u32 = !0 << RayVisibility::CLASS_SHIFT;

    pub fn camera() -> RayVisibility {
        RayVisibility(RayKinds::CAMERA.bits())
    }

    #[inline(always)]
    pub fn kind(self) -> RayKinds {
        RayKinds::from_bits(self.0)
    }

    /// A new ray of a kind from the same vertex.
    #[inline(always)]
    pub fn with_kind(self, kind: RayKinds) -> RayVisibility {
        RayVisibility(kind.bits() | self.0 & RayVisibility::CLASS_MASK)
    }

    /// Has the ray passed an object that occludes light samples?
    #[inline(always)]
    pub fn is_shadowed(self) -> bool {
        self.0 & RayVisibility::SHADOWED != 0
    }

    /// After passing an object that occludes light samples.
    #[inline(always)]
    pub fn shadowed(self) -> RayVisibility {
        RayVisibility(self.0 | RayVisibility::SHADOWED)
    }

    /// The receiver class of the last vertex.
    #[inline(always)]
    pub fn receiver_class(self) -> u32 {
        self.0 >> RayVisibility::CLASS_SHIFT
    }

    /// With another receiver class.
    #[inline(always)]
    pub fn with_receiver_class(self, class: u32) -> RayVisibility {
        RayVisibility(self.0 & !RayVisibility::CLASS_MASK | class << RayVisibility::CLASS_SHIFT)
    }
}

/// Number of bounces of a path by kind, saturating at 255.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
#[repr(C)]
pub struct BounceCounts {
    diffuse: u8,
    glossy: u8,
    transmission: u8,
    volume: u8,
}

impl BounceCounts {
    /// Has any kind reached its limit?
    pub fn reach(self, limits: &BounceLimits) -> bool {
        u32::from(self.diffuse) >= limits.diffuse
            || u32::from(self.glossy) >= limits.glossy
            || u32::from(self.transmission) >= limits.transmission
            || u32::from(self.volume) >= limits.volume
    }

    /// The counts, each up to 3, in eight bits.
    pub fn bits(self) -> u32 {
        let counts = [self.diffuse, self.glossy, self.transmission, self.volume];
        counts.into_iter().fold(0, |bits, count| bits << 2 | u32::from(count.min(3)))
    }

    /// Counts a bounce by the kind of the scattered ray.
    pub fn count(&mut self, kind: RayKinds) {
        let count = match kind {
            RayKinds::DIFFUSE => &mut self.diffuse,
            RayKinds::GLOSSY => &mut self.glossy,
            RayKinds::TRANSMISSION => &mut self.transmission,
            _ => &mut self.volume,
        };
        *count = count.saturating_add(1);
    }
}

const _: () = assert!(MAX_RECEIVER_CLASSES <= 1 << (u32::BITS - RayVisibility::CLASS_SHIFT));

/// Conditions under which optional path state is in use.
pub struct StateConditions<'a> {
    pub features: &'a Features,
    /// Light selection depends on the receiver's normal (light tree).
    pub selects_by_normal: bool,
    /// Bounces are limited by kind.
    pub bounce_limits: bool,
    /// The number of transparent surfaces that paths pass is limited.
    pub transparent_limit: bool,
    pub filter_glossy: bool,
    /// Reflective or refractive caustics are disabled.
    pub skips_caustics: bool,
    /// Light passes are requested.
    pub light_passes: bool,
    /// Caustics are rendered by light tracing.
    pub caustics: bool,
    /// Path reuse is on.
    pub path_reuse: bool,
    /// Path guiding is on.
    pub guiding: bool,
    /// Clear glass is transparent in the alpha channel.
    pub transparent_glass: bool,
    /// AOVs of first hits are requested.
    pub first_hits: bool,
    /// Denoising guides are requested.
    pub denoising_guides: bool,
}

/// Declares the optional state of paths, each array with its type and the condition under which it is in use. Generates [`Paths`]
/// (memory, copy, repeat) and [`OptionalState`] (the state in use).
macro_rules! path_state {
    ($($(#[$doc:meta])* $field:ident: $type:ty, if |$conditions:ident| $condition:expr;)*) => {
        /// The state of the paths of a wave between bounces.
        #[derive(Zeroable)]
        pub struct Paths {
            pub state: PathState,
            $($(#[$doc])* pub $field: $type,)*
        }

        /// Whether each optional state of [`Paths`] is in use.
        #[derive(Clone, Copy, Debug)]
        pub struct OptionalState {
            $(pub $field: bool,)*
            /// Is any in use?
            any: bool,
        }

        impl OptionalState {
            /// All state is in use.
            pub const ALL: OptionalState = OptionalState { $($field: true,)* any: true };

            /// The state that a scene, its outputs and techniques need.
            pub fn of(conditions: &StateConditions<'_>) -> OptionalState {
                $(let $field = { let $conditions = conditions; $condition };)*
                OptionalState { $($field,)* any: false $(|| $field)* }
            }
        }

        impl Paths {
            /// Replaces each of the first `count` paths by `times` adjacent copies.
            pub fn repeat(&mut self, count: usize, times: usize, optional: OptionalState) {
                self.state.repeat(count, times);
                $(if optional.$field {
                    self.$field.repeat(count, times);
                })*
            }

            /// Copies path `i` to path `k` of `other`.
            #[inline(always)]
            pub fn copy_to(&self, i: usize, other: &mut Paths, k: usize, optional: OptionalState) {
                self.state.copy_to(i, &mut other.state, k);
                if !optional.any {
                    return;
                }
                $(if optional.$field {
                    self.$field.copy_to(i, &mut other.$field, k);
                })*
            }
        }
    };
}

path_state! {
    /// Ray cones, for texture filtering.
    footprints: Footprints, if |c| c.features.footprints;
    /// Shading normal of the last vertex, for light selection; zero if lights on both sides contribute.
    receiver_normal: Lanes3, if |c| c.selects_by_normal;
    /// Solids around the path.
    interior: [Interior; LENGTH], if |c| c.features.media;
    /// Geometric normal of the last vertex, where random walks start.
    entry_normal: Lanes3, if |c| c.features.subsurface;
    /// Number of bounces so far, without those of random walks.
    depth: Words, if |c| c.features.subsurface;
    first_bounces: FirstBounces, if |c| c.light_passes;
    /// Kind of the ray and receiver class at its origin.
    visibility: [RayVisibility; LENGTH], if |c| c.features.ray_kinds || c.bounce_limits || c.skips_caustics;
    /// Number of bounces so far, by kind.
    bounce_counts: [BounceCounts; LENGTH], if |c| c.bounce_limits;
    /// Number of transparent surfaces passed so far.
    transparent_count: Words, if |c| c.transparent_limit;
    /// Smallest pdf of a sampled direction so far, 1/sr, for the glossy filter.
    min_pdf: Lanes, if |c| c.filter_glossy;
    /// Weight over selection probability of the component selected at the last hit of a mix; 1 at other materials.
    component_weight: RgbLanes, if |c| c.features.mixes && (c.path_reuse || c.first_hits);
    /// Whether light tracing samples the path so far: see [`super::caustics`].
    caustic_chains: Words, if |c| c.caustics;
    /// Fraction of such a path's contribution that light tracing samples: product over its diffuse receivers.
    caustic_chain_fraction: RgbLanes, if |c| c.caustics;
    /// Reference of adjoint-driven Russian roulette, luminance; 0 before the first guided vertex.
    roulette_reference: Lanes, if |c| c.guiding;
    /// 1 if the path has only passed clear glass so far, else 0.
    only_clear_glass: Words, if |c| c.transparent_glass;
    /// 1 if the path has only hit smooth mirrors so far, else 0; unset before the first vertex.
    only_mirrors: Words, if |c| c.denoising_guides && c.features.mirrors;
}

/// Corners of the hit triangles and quads, input of a vectorised loop.
#[derive(Zeroable)]
pub struct CornerLanes {
    pub positions: [Lanes3; 3],
    /// Vertex normals, in scenes with some.
    pub normals: [Lanes3; 3],
    /// Barycentric coordinates of the second and third corner at the hit.
    pub weights: [Lanes; 2],
}

per_path! {
/// Opaque glTF materials ([`crate::bsdf::MetalRough`]).
pub struct MetalRoughMaterials {
    /// Diffuse colour.
    pub diffuse: RgbLanes,
    /// Reflectance of the dielectric layer at normal incidence.
    pub layer_f0: RgbLanes,
    /// Reflectance of the layer at grazing incidence.
    pub layer_f90: Lanes,
    /// Reflectance of the metal at normal incidence.
    pub metal_f0: RgbLanes,
    /// Metallic fraction.
    pub metallic: Lanes,
    /// Amplitude of the layer's Fresnel curve, with exact Fresnel only.
    pub curve: Lanes,
    /// 0 without energy compensation, 1 with, 2 if the layer also shields the base.
    pub compensates: Lanes,
    /// GGX alpha.
    pub alpha: Lanes,
}
}

per_path! {
/// Closures of opaque glTF materials for a viewer ([`crate::bsdf::MetalRoughClosure`]).
pub struct MetalRoughClosures {
    /// Diffuse colour under the layer.
    pub diffuse: RgbLanes,
    /// Fresnel reflectance at normal incidence.
    pub f0: RgbLanes,
    /// Increase of the reflectance towards grazing incidence, times Schlick's weight.
    pub schlick_rise: RgbLanes,
    /// Increase of the reflectance, times the weight of the layer's exact Fresnel curve.
    pub exact_rise: RgbLanes,
    /// Mean albedo.
    pub albedo: Lanes,
    /// Probability of sampling the specular lobe.
    pub probability_specular: Lanes,
    /// Probability of sampling the diffuse lobe.
    pub probability_diffuse: Lanes,
}
}

/// Further input of textured vertices, and their texture coordinates and tangent frames.
#[derive(Zeroable)]
pub struct TexturedLanes {
    /// Texture coordinates of the corners.
    pub corner_uv: [[Lanes; 2]; 3],
    /// Tangents of the corners; zero without.
    pub tangents: [Lanes3; 3],
    /// Sign of the bitangents; 0 without tangents.
    pub handedness: Lanes,
    /// Texture coordinates at the hit.
    pub uv: [Lanes; 2],
    /// Change of the texture coordinates per metre.
    pub uv_per_metre: Lanes,
    /// Directions of x and y of the normal map; zero without a tangent frame.
    pub tangent: Lanes3,
    pub bitangent: Lanes3,
    /// Tangent-space normal of the normal map; zero without a map.
    pub mapped: Lanes3,
    /// Index of the arriving ray.
    pub ray: Words,
}

/// Light samples, one per lit vertex.
#[derive(Zeroable)]
pub struct LightLanes {
    /// Direction to the light, unit length.
    pub wi: Lanes3,
    /// Point on the light; unused for lights at infinity.
    pub target: Lanes3,
    /// 1 for lights at infinity, else 0.
    pub is_infinite: Lanes,
    /// Emitted radiance towards the vertex.
    pub radiance: RgbLanes,
    /// Pdf of the sample, including the light's selection probability.
    pub pdf: [LightPdf; LENGTH],
    /// Selected light, in scenes with several lights.
    pub index: Words,
    /// Selection probability of the light.
    pub pdf_discrete: Lanes,
    /// MIS-weighted contribution if the shadow ray is not occluded.
    pub contribution: RgbLanes,
    /// Shadow ray.
    pub origin: Lanes3,
    pub direction: Lanes3,
}

/// Path guiding at Lambertian and opaque glTF vertices.
#[derive(Zeroable)]
pub struct GuidedLanes {
    /// Low half of the cell's key.
    pub key_low: Words,
    /// High half of the cell's key.
    pub key_high: Words,
    /// Index of the cell.
    pub cell: Words,
    /// Guided over unguided pdf of the scattered direction.
    pub pdf_factor: Lanes,
    /// Guided over unguided BSDF-sampling pdf of the light sample's direction.
    pub light_pdf_factor: Lanes,
    /// Bin of the scattered direction, for training.
    pub bin: Words,
    /// Luminance of throughput times albedo, before scattering.
    pub throughput_luminance: Lanes,
}

/// The smooth surface approximated by triangles with vertex normals.
#[derive(Zeroable)]
pub struct LiftLanes {
    /// Unit normal of the smooth surface; zero if shadow rays start at the triangle.
    pub normal: Lanes3,
    /// Offset of shadow rays on the side of `normal`, metres.
    pub above: Lanes3,
    /// Offset of shadow rays on the other side, metres.
    pub below: Lanes3,
    /// Geometric normal, saved during light sampling, when [`Vertices::ng`] is that of the smooth surface.
    pub ng: Lanes3,
}

/// The vertices of paths, sorted by [`ShadingGroup`](super::shading_groups::ShadingGroup).
#[derive(Zeroable)]
pub struct Vertices {
    /// Corners, at vertices on triangles and quads.
    pub corners: CornerLanes,
    pub p: Lanes3,
    /// Primitives that rays from the vertex exclude.
    pub origin_primitives: [OriginPrimitive; LENGTH],
    /// Geometric normal; on the viewer's side at vertices of opaque groups, on the front side at others.
    pub ng: Lanes3,
    /// Shading normal, on the side of `ng`.
    pub ns: Lanes3,
    /// Bump terminator: [`super::shading_geometry::BUMP_SHADOWING`] or another of these constants.
    pub bump_mode: Lanes,
    /// Normal without normal and bump maps, on the side of `ns`; valid if `bump_mode` isn't 0.
    pub smooth_normal: Lanes3,
    /// Offset of ray origins along the normal, metres.
    pub offset: Lanes,
    /// Offsets of shadow rays to the smooth surface, if in use.
    pub lifted: LiftLanes,
    /// Normal of the diffuse base at opaque glTF vertices: where the normal is mapped, the shading normal before bending, else `ns`.
    pub base_normal: Lanes3,
    /// 1 if the shading normal was bent, else 0; at opaque glTF vertices.
    pub is_bent: Lanes,
    /// Direction to the viewer.
    pub wo: Lanes3,
    /// Solids around transmitted rays; at vertices with general BSDFs.
    pub far_interior: [Interior; LENGTH],
    /// Albedo of Lambertian vertices.
    pub albedo: RgbLanes,
    pub metal_rough: MetalRoughMaterials,
    pub metal_rough_closures: MetalRoughClosures,
    pub textured: TexturedLanes,
    pub light: LightLanes,
    pub guided: GuidedLanes,
    /// Mean cosine of the scattering angle, at vertices in media.
    pub anisotropy: Lanes,
    /// Scattered ray.
    pub next_origin: Lanes3,
    pub next_direction: Lanes3,
}

/// Arrays for use within one stage; undefined between stages.
pub type Scratch = [Lanes; 9];

/// The data of vectorised loops, in one allocation so that the compiler can prove that arrays don't alias.
#[derive(Zeroable)]
pub struct Wave {
    pub paths: Paths,
    pub vertices: Vertices,
    pub scratch: Scratch,
}

/// Number of paths in a wave. The arrays in use nearly fit into a core's L2 cache.
pub const WAVE: usize = 2048;

/// Length of an array: one cache line more than needed, since arrays a power of two apart would map to the same cache sets.
pub const LENGTH: usize = WAVE + 16;

/// A number per path.
pub type Lanes = [f32; LENGTH];
/// An integer per path.
pub type Words = [u32; LENGTH];
/// A vector per path, by component.
pub type Lanes3 = [Lanes; 3];
/// A colour per path, by channel.
pub type RgbLanes = [Lanes; 3];

/// Element `i` as a vector.
#[inline(always)]
pub fn get(v: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

/// Sets element `i`.
#[inline(always)]
pub fn set(v: &mut Lanes3, i: usize, value: Vec3) {
    v[0][i] = value.x;
    v[1][i] = value.y;
    v[2][i] = value.z;
}

/// Element `i` as a colour.
#[inline(always)]
pub fn get_rgb(v: &RgbLanes, i: usize) -> Rgb {
    Rgb::new(v[0][i], v[1][i], v[2][i])
}

/// Sets element `i`.
#[inline(always)]
pub fn set_rgb(v: &mut RgbLanes, i: usize, value: Rgb) {
    [v[0][i], v[1][i], v[2][i]] = value.to_array();
}

/// Multiplies element `i` by a colour or a number.
#[inline(always)]
pub fn scale_rgb<T>(v: &mut RgbLanes, i: usize, factor: T)
where
    Rgb: Mul<T, Output = Rgb>,
{
    set_rgb(v, i, get_rgb(v, i) * factor);
}

/// Arrays with an element per path.
pub trait PerPath {
    /// Copies element `i` to element `k` of `other`.
    fn copy_to(&self, i: usize, other: &mut Self, k: usize);

    /// Replaces each of the first `count` elements by `times` adjacent copies.
    fn repeat(&mut self, count: usize, times: usize);
}

/// Replaces each of the first `count` elements by `times` adjacent copies.
pub fn repeat<T: Copy>(elements: &mut [T], count: usize, times: usize) {
    // Backwards, so that elements are read before they are overwritten.
    for i in (0..count).rev() {
        let element = elements[i];
        elements[i * times..(i + 1) * times].fill(element);
    }
}

impl<T: Copy> PerPath for [T; LENGTH] {
    #[inline(always)]
    fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
        other[k] = self[i];
    }

    fn repeat(&mut self, count: usize, times: usize) {
        repeat(self, count, times);
    }
}

impl PerPath for Lanes3 {
    #[inline(always)]
    fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
        for c in 0..3 {
            other[c][k] = self[c][i];
        }
    }

    fn repeat(&mut self, count: usize, times: usize) {
        for component in self {
            component.repeat(count, times);
        }
    }
}
