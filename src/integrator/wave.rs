//! The state of a wave: paths and vertices as structures of arrays, so that loops over paths vectorise.

use super::interior::Interior;
use super::mis::{DirectionPdf, LightPdf};
use crate::color::Rgb;
use crate::compile::{Features, MAX_RECEIVER_CLASSES};
use crate::math::{OriginPrimitive, Vec3};
use crate::scene::{BounceLimits, RayKinds};
use bytemuck::Zeroable;

/// Declares a structure of arrays over paths, with [`PerPath`].
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
        /// Product of the weights of all sampling decisions so far.
        pub throughput: RgbLanes,
        /// How the direction of its ray was sampled.
        pub pdf: [DirectionPdf; LENGTH],
        /// Russian roulette compares the throughput times this with 1: the product of the squared relative indices of
        /// refraction (undoes the 1 / eta^2 of refractions), of the number of branches after a split, and of the
        /// throughput before a cut.
        pub roulette_scale: Lanes,
        /// Sobol point: seed of the sequence and shuffled index.
        pub seed: Words,
        pub shuffled: Words,
        /// Where its radiance is added: an index of the [`super::radiance_buffer::RadianceBuffer`].
        pub radiance_index: Words,
    }
}

per_path! {
    /// Ray cones: the width of the surface that a path covers.
    pub struct Footprints {
        /// Width at the start of the ray, metres.
        pub width: Lanes,
        /// Its growth along the ray, metres per metre.
        pub spread: Lanes,
    }
}

per_path! {
    /// The first scattering event of each path.
    pub struct FirstBounces {
        /// Diffuse fraction of the BSDF value, by channel.
        pub diffuse: RgbLanes,
        /// 1 for transmission, 0 for reflection.
        pub crosses: Lanes,
    }
}

/// The first scattering event of a path.
#[derive(Clone, Copy, Debug)]
pub struct FirstBounce {
    /// Diffuse fraction of the BSDF value, by channel.
    pub diffuse: Rgb,
    /// Was it transmission?
    pub crosses: bool,
}

impl FirstBounce {
    /// Diffuse reflection.
    pub const DIFFUSE: FirstBounce = FirstBounce { diffuse: Rgb::ONE, crosses: false };
}

impl FirstBounces {
    /// Event of path `i`.
    #[inline]
    pub fn get(&self, i: usize) -> FirstBounce {
        FirstBounce { diffuse: get_rgb(&self.diffuse, i), crosses: self.crosses[i] > 0.0 }
    }

    /// Sets the event of path `i`.
    #[inline]
    pub fn set(&mut self, i: usize, first: FirstBounce) {
        set_rgb(&mut self.diffuse, i, first.diffuse);
        self.crosses[i] = f32::from(u8::from(first.crosses));
    }
}

/// Visibility of objects and lights to a path's ray: the kind of the ray, whether it passed an object
/// that blocks light samples, and the receiver class of the vertex where it starts (light linking).
#[derive(Clone, Copy, Debug, Zeroable)]
#[repr(transparent)]
pub struct RayVisibility(u32);

impl RayVisibility {
    const SHADOWED: u32 = 1 << 16;
    const CLASS_SHIFT: u32 = 17;
    const CLASS_MASK: u32 = !0 << RayVisibility::CLASS_SHIFT;

    /// The visibility of camera rays.
    pub fn camera() -> RayVisibility {
        RayVisibility(RayKinds::CAMERA.bits())
    }

    /// The kind of the ray.
    #[inline(always)]
    pub fn kind(self) -> RayKinds {
        RayKinds::from_bits(self.0)
    }

    /// The visibility of a new ray of a kind from the same vertex.
    #[inline(always)]
    pub fn with_kind(self, kind: RayKinds) -> RayVisibility {
        RayVisibility(kind.bits() | self.0 & RayVisibility::CLASS_MASK)
    }

    /// Has the ray passed an object that blocks light samples?
    #[inline(always)]
    pub fn is_shadowed(self) -> bool {
        self.0 & RayVisibility::SHADOWED != 0
    }

    /// After passing such an object.
    #[inline(always)]
    pub fn shadowed(self) -> RayVisibility {
        RayVisibility(self.0 | RayVisibility::SHADOWED)
    }

    /// The class of receivers of light, by light linking, of the last vertex.
    #[inline(always)]
    pub fn receiver_class(self) -> u32 {
        self.0 >> RayVisibility::CLASS_SHIFT
    }

    /// At a vertex of a class of receivers.
    #[inline(always)]
    pub fn with_receiver_class(self, class: u32) -> RayVisibility {
        RayVisibility(self.0 & !RayVisibility::CLASS_MASK | class << RayVisibility::CLASS_SHIFT)
    }
}

/// Number of scattering events of a path, by kind; 255 is 255 or more.
#[derive(Clone, Copy, Debug, Default, Zeroable)]
#[repr(C)]
pub struct BounceCounts {
    diffuse: u8,
    glossy: u8,
    transmission: u8,
    volume: u8,
}

impl BounceCounts {
    /// Has some kind reached its limit?
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

    /// Counts an event whose scattered ray is of a kind.
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

/// Conditions for the optional state of paths.
pub struct StateConditions<'a> {
    pub features: &'a Features,
    /// The selection among lights depends on the receiver's normal.
    pub selects_by_normal: bool,
    /// Bounces are limited by kind.
    pub bounce_limits: bool,
    /// The number of surfaces that paths pass by their alpha is limited.
    pub transparent_limit: bool,
    /// The glossy filter is on.
    pub filter_glossy: bool,
    /// Some caustics are left out.
    pub skips_caustics: bool,
    /// Light passes are among the outputs.
    pub light_passes: bool,
    /// Caustics are traced from the lights.
    pub caustics: bool,
    /// Pixels share paths.
    pub sharing: bool,
    /// Paths are guided.
    pub guiding: bool,
    /// Glass is transparent in the alpha channel.
    pub transparent_glass: bool,
    /// AOVs of the first hit are among the outputs.
    pub first_hits: bool,
    /// Guides of denoising are among the outputs.
    pub denoising_guides: bool,
}

/// Declares the state of paths: each optional array once, with its type and the condition under which it is in use. Makes
/// [`Paths`] (memory, copy, repeat) and [`OptionalState`] (which of it is in use).
macro_rules! path_state {
    ($($(#[$doc:meta])* $field:ident: $type:ty, if |$conditions:ident| $condition:expr;)*) => {
        /// The state of the paths of a wave between bounces.
        #[derive(Zeroable)]
        pub struct Paths {
            pub state: PathState,
            $($(#[$doc])* pub $field: $type,)*
        }

        /// Which optional state of [`Paths`] is in use.
        #[derive(Clone, Copy, Debug)]
        pub struct OptionalState {
            $(pub $field: bool,)*
            /// Any of it.
            any: bool,
        }

        impl OptionalState {
            /// All of it.
            pub const ALL: OptionalState = OptionalState { $($field: true,)* any: true };

            /// The state that a scene, its outputs and techniques need.
            pub fn of(conditions: &StateConditions<'_>) -> OptionalState {
                $(let $field = { let $conditions = conditions; $condition };)*
                OptionalState { $($field,)* any: false $(|| $field)* }
            }
        }

        impl Paths {
            /// Replaces each of the first `count` paths by several copies, one after the other.
            pub fn repeat(&mut self, count: usize, times: usize, optional: OptionalState) {
                self.state.repeat(count, times);
                $(if optional.$field {
                    self.$field.repeat(count, times);
                })*
            }

            /// Copies path `i` to path `k` of others.
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
    /// Width that the path covers, for texture filtering.
    footprints: Footprints, if |c| c.features.footprints;
    /// Shading normal of the last vertex for the selection among lights; zero where lights on both sides count.
    receiver_normal: Lanes3, if |c| c.selects_by_normal;
    /// Solids that the path is within.
    interior: [Interior; LENGTH], if |c| c.features.media;
    /// Geometric normal of the last vertex, where random walks start.
    entry_normal: Lanes3, if |c| c.features.subsurface;
    /// Number of bounces so far, except for random walks within solids.
    depth: Words, if |c| c.features.subsurface;
    /// The first scattering event.
    first_bounces: FirstBounces, if |c| c.light_passes;
    /// Kind of the ray and receiver class of its start.
    visibility: [RayVisibility; LENGTH], if |c| c.features.ray_kinds || c.bounce_limits || c.skips_caustics;
    /// Number of bounces so far, by kind.
    bounce_counts: [BounceCounts; LENGTH], if |c| c.bounce_limits;
    /// Number of surfaces passed so far because of their alpha.
    transparent_count: Words, if |c| c.transparent_limit;
    /// Smallest density of a sampled direction so far, 1/sr, for the glossy filter.
    least_pdf: Lanes, if |c| c.filter_glossy;
    /// Factor of the throughput for the component that was selected at the last hit on a mix; 1 at others.
    component_weight: RgbLanes, if |c| c.features.mixes && (c.sharing || c.first_hits);
    /// Whether caustics traced from the lights contain the path so far: see [`super::caustics`].
    chains: Words, if |c| c.caustics;
    /// The share of the light found by such a path that caustics traced from the lights contain: that of its receivers' diffuse lobes.
    chain_share: RgbLanes, if |c| c.caustics;
    /// Expected luminance that adjoint-driven Russian roulette compares with; 0 until the first guided vertex.
    reference: Lanes, if |c| c.guiding;
    /// 1 where the path has passed nothing but clear glass since the camera, else 0.
    clear: Words, if |c| c.transparent_glass;
    /// 1 where the path has hit only smooth mirrors since the camera, else 0; unset before its first vertex.
    mirrored: Words, if |c| c.denoising_guides && c.features.mirrors;
}

/// Corners of the triangles and quads at vertices, from which a vectorised loop makes surfaces.
#[derive(Zeroable)]
pub struct CornerLanes {
    /// Positions.
    pub positions: [Lanes3; 3],
    /// Shading normals; where the scene has some.
    pub normals: [Lanes3; 3],
    /// Weights of the second and third corner at the hit.
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
    /// Amplitude of the layer's Fresnel curve; where that is exact.
    pub curve: Lanes,
    /// GGX alpha.
    pub alpha: Lanes,
}
}

per_path! {
/// Closures of opaque glTF materials for a viewer ([`crate::bsdf::MetalRoughClosure`]).
pub struct MetalRoughClosures {
    /// Diffuse colour under the layer.
    pub diffuse: RgbLanes,
    /// Reflectance of the facets at normal incidence.
    pub f0: RgbLanes,
    /// Its increase to grazing incidence, with Schlick's weight.
    pub schlick_rise: RgbLanes,
    /// Its increase with the weight of the layer's Fresnel curve.
    pub exact_rise: RgbLanes,
    /// Mean albedo.
    pub albedo: Lanes,
    /// Probability of sampling the facets.
    pub probability_specular: Lanes,
    /// Probability of sampling the diffuse lobe.
    pub probability_diffuse: Lanes,
}
}

/// Input of textured vertices besides corners, and texture coordinates.
#[derive(Zeroable)]
pub struct TexturedLanes {
    /// Texture coordinates of the corners.
    pub corner_uv: [[Lanes; 2]; 3],
    /// Tangents of the corners, and which way bitangents go; 0 where there are none.
    pub tangents: [Lanes3; 3],
    pub handedness: Lanes,
    /// Texture coordinates, and their change per metre.
    pub uv: [Lanes; 2],
    pub uv_per_metre: Lanes,
    /// Directions of x and y of the normal map; zero where there are none.
    pub tangent: Lanes3,
    pub bitangent: Lanes3,
    /// Normal of the normal map; zero without one.
    pub mapped: Lanes3,
    /// Index of the ray.
    pub ray: Words,
}

/// Light samples, one for each vertex that light sampling reaches.
#[derive(Zeroable)]
pub struct LightLanes {
    /// Towards the light, unit length.
    pub wi: Lanes3,
    /// Point on the light; not for lights at infinity.
    pub target: Lanes3,
    /// 1 for lights at infinity, else 0.
    pub is_infinite: Lanes,
    /// Radiance of the light.
    pub radiance: RgbLanes,
    /// Density of the sample, with the probability of selecting the light.
    pub pdf: [LightPdf; LENGTH],
    /// The selected light and its selection probability; in scenes with several lights.
    pub index: Words,
    pub pdf_discrete: Lanes,
    /// MIS-weighted contribution if the shadow ray is not occluded.
    pub contribution: RgbLanes,
    /// The shadow ray.
    pub origin: Lanes3,
    pub direction: Lanes3,
}

/// Path guiding at Lambertian vertices.
#[derive(Zeroable)]
pub struct GuidedLanes {
    /// Halves of the keys of their cells.
    pub key_low: Words,
    pub key_high: Words,
    /// Indices of their cells.
    pub cell: Words,
    /// Guided density over that of the cosine lobe, of scattered directions and of light samples.
    pub density: Lanes,
    pub light_density: Lanes,
    /// Bins of scattered directions; for training.
    pub bin: Words,
    /// Luminance of the throughput with the albedo, before scattering.
    pub throughput_luminance: Lanes,
}

/// The smooth surface that triangles with vertex normals approximate.
#[derive(Zeroable)]
pub struct LiftLanes {
    /// Unit normal; zero where shadow rays start at the triangle.
    pub normal: Lanes3,
    /// From the triangle to where shadow rays start on the side of that normal, and on the other one, metres.
    pub above: Lanes3,
    pub below: Lanes3,
    /// The geometric normal while lights are sampled: [`Vertices::ng`] is that of the curved surface then.
    pub ng: Lanes3,
}

/// The vertices of paths, sorted by [`ShadingGroup`](super::shading_groups::ShadingGroup).
#[derive(Zeroable)]
pub struct Vertices {
    /// Corners, at vertices on triangles and quads.
    pub corners: CornerLanes,
    pub p: Lanes3,
    /// The primitives that rays from here exclude.
    pub origin_primitives: [OriginPrimitive; LENGTH],
    /// Geometric normal; on the viewer's side at vertices of opaque groups, on the front side at others.
    pub ng: Lanes3,
    /// Shading normal, on the side of the geometric one.
    pub ns: Lanes3,
    /// Shadowing by normal maps: [`super::shading_geometry::RELIEF`] and the like.
    pub relief: Lanes,
    /// The normal that normal maps perturb, on the same side; where `relief` isn't 0.
    pub smooth: Lanes3,
    /// Offset of ray origins along the normal, metres.
    pub offset: Lanes,
    /// Where shadow rays start, in pictures that lift them.
    pub lifted: LiftLanes,
    /// Shading normal before it is bent for the viewer; at vertices of opaque glTF materials, in scenes with mapped normals.
    pub unbent: Lanes3,
    /// 1 where the shading normal was bent for the viewer, else 0; at vertices of opaque glTF materials.
    pub is_bent: Lanes,
    /// Towards the viewer.
    pub wo: Lanes3,
    /// Solids on the far side of the surface, seen from the viewer; in scenes with some.
    pub beyond: [Interior; LENGTH],
    /// Albedo of Lambertian vertices.
    pub albedo: RgbLanes,
    pub metal_rough: MetalRoughMaterials,
    pub metal_rough_closures: MetalRoughClosures,
    pub textured: TexturedLanes,
    pub light: LightLanes,
    /// Path guiding, at Lambertian vertices.
    pub guided: GuidedLanes,
    /// Mean cosine of the scattering angle, in media.
    pub anisotropy: Lanes,
    /// The scattered ray.
    pub next_origin: Lanes3,
    pub next_direction: Lanes3,
}

/// Arrays for use within one stage; undefined between stages.
pub type Scratch = [Lanes; 9];

/// The data of vectorised loops: one allocation, so that the compiler knows that arrays don't alias.
#[derive(Zeroable)]
pub struct Wave {
    pub paths: Paths,
    pub vertices: Vertices,
    pub scratch: Scratch,
}

/// Number of paths in a wave. The arrays in use nearly fit into a core's second-level cache.
pub const WAVE: usize = 2048;

/// Length of an array: one cache line more than needed, because arrays a power of two apart would fall into the same
/// cache set.
pub const LENGTH: usize = WAVE + 16;

/// A number for each path.
pub type Lanes = [f32; LENGTH];
/// An integer for each path.
pub type Words = [u32; LENGTH];
/// A vector for each path, by component.
pub type Lanes3 = [Lanes; 3];
/// A colour for each path, by channel.
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

/// Arrays with an element for each path.
pub trait PerPath {
    /// Copies element `i` to element `k` of `other`.
    fn copy_to(&self, i: usize, other: &mut Self, k: usize);

    /// Replaces each of the first `count` elements by several copies, one after the other.
    fn repeat(&mut self, count: usize, times: usize);
}

/// Replaces each of the first `count` elements by several copies, one after the other.
pub fn repeat<T: Copy>(elements: &mut [T], count: usize, times: usize) {
    // From the end, so that elements are read before they are overwritten.
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
