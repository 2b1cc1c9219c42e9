//! The state of a wave: paths and vertices as structures of arrays, so that loops over paths vectorise.

use super::interior::Interior;
use crate::color::Rgb;
use crate::compile::Features;
use crate::math::{OriginPrimitive, Vec3};
use bytemuck::Zeroable;

/// Declares a struct of things kept for each path together with the [`PerPath`] that copies all of them.
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

/// The solids around each path.
pub type Interiors = [Interior; LENGTH];

per_path! {
    /// State that every path carries from bounce to bounce.
    pub struct PathState {
        /// Product of all weights so far.
        pub throughput: RgbLanes,
        /// Density per solid angle of the last scattering; 0 after a specular one and at the camera; negative where the
        /// path has ended.
        pub pdf: Lanes,
        /// What the roulette takes the throughput times: undoes the 1 / eta^2 of refractions, and has the throughput
        /// of the prefix where a suffix began anew with 1.
        pub eta_squared: Lanes,
        /// Sobol point: its two parts.
        pub seed: Words,
        pub shuffled: Words,
        /// The index of its radiance: which sample of the block it is; behind a cut, further indices (see
        /// [`super::reuse`]).
        pub sample: Words,
    }
}

per_path! {
    /// How wide the surface is that a path sees: carried where textures ask for it.
    pub struct Footprints {
        /// Width at the start of the ray, metres.
        pub width: Lanes,
        /// How fast it grows, metres per metre.
        pub spread: Lanes,
    }
}

per_path! {
    /// The first scattering of each path.
    pub struct FirstBounces {
        /// The share of it that is diffuse.
        pub diffuse: RgbLanes,
        /// 1 where it led to the other side of the surface, else 0.
        pub crosses: Lanes,
    }
}

/// The first scattering of a path.
#[derive(Clone, Copy, Debug)]
pub struct FirstBounce {
    /// The share of it that is diffuse.
    pub diffuse: Rgb,
    /// Did it lead to the other side of the surface?
    pub crosses: bool,
}

impl FirstBounce {
    /// Of ideally diffuse reflection.
    pub const DIFFUSE: FirstBounce = FirstBounce { diffuse: Rgb::ONE, crosses: false };
}

impl FirstBounces {
    /// That of a path.
    #[inline]
    pub fn get(&self, i: usize) -> FirstBounce {
        FirstBounce { diffuse: get_rgb(&self.diffuse, i), crosses: self.crosses[i] > 0.0 }
    }

    /// Sets that of a path.
    #[inline]
    pub fn set(&mut self, i: usize, first: FirstBounce) {
        set_rgb(&mut self.diffuse, i, first.diffuse);
        self.crosses[i] = f32::from(u8::from(first.crosses));
    }
}

/// State of the paths between bounces, by the features of scenes that need it.
#[derive(Zeroable)]
pub struct Paths {
    pub carried: PathState,
    /// Where textures depend on how much of a surface a path covers.
    pub footprints: Footprints,
    /// For the choice among lights at the last vertex: the normal that light had to come from, or zero; where that choice
    /// depends on it.
    pub receiver_normal: Lanes3,
    /// Solids that the path is inside of; where there are some.
    pub interior: Interiors,
    /// Its bounces so far, but for walks within solids; where there are some.
    pub depth: Words,
    /// How it scattered first; where light passes are asked for.
    pub first_bounces: FirstBounces,
    /// The kind of its ray, and what that passed; where objects differ by it. See [`super::kinds`].
    pub kinds: Words,
    /// Whether it is on a way of light that is left to paths from lamps; where there are some.
    pub chains: Words,
    /// Luminance that roulette compares it with; 0 until its first guided vertex. Where paths are guided.
    pub reference: Lanes,
    /// 1 where it passed nothing but clear glass since the camera, else 0; where glass is transparent. See [`super::clear`].
    pub clear: Words,
}

/// Which parts of [`Paths`] a scene needs.
#[derive(Clone, Copy, Debug)]
pub struct PathParts {
    pub footprints: bool,
    pub receiver_normals: bool,
    pub interiors: bool,
    pub depths: bool,
    pub first_bounces: bool,
    pub kinds: bool,
    pub chains: bool,
    pub references: bool,
    pub clear: bool,
    /// One of them at least.
    any: bool,
}

impl PathParts {
    /// All of them.
    pub const ALL: PathParts = PathParts {
        footprints: true,
        receiver_normals: true,
        interiors: true,
        depths: true,
        first_bounces: true,
        kinds: true,
        chains: true,
        references: true,
        clear: true,
        any: true,
    };

    /// What the features of a scene ask for; `receiver_normals` where lights are chosen by them, `first_bounces` for light
    /// passes, `chains` where paths start at lamps, too, `references` where they are guided, `clear` where glass is transparent.
    pub fn of(
        features: &Features,
        receiver_normals: bool,
        first_bounces: bool,
        chains: bool,
        references: bool,
        clear: bool,
    ) -> PathParts {
        let Features { footprints, media: interiors, subsurface: depths, ray_kinds: kinds, .. } = *features;
        let of_scene = footprints || receiver_normals || interiors || kinds;
        let any = of_scene || first_bounces || chains || references || clear;
        PathParts {
            footprints,
            receiver_normals,
            interiors,
            depths,
            first_bounces,
            kinds,
            chains,
            references,
            clear,
            any,
        }
    }
}

impl Paths {
    /// Makes each of the first `count` paths several, one after the other.
    pub fn repeat(&mut self, count: usize, times: usize, parts: PathParts) {
        let Paths {
            carried,
            footprints,
            receiver_normal,
            interior,
            depth,
            first_bounces,
            kinds,
            chains,
            reference,
            clear,
        } = self;
        carried.repeat(count, times);
        if parts.footprints {
            footprints.repeat(count, times);
        }
        if parts.receiver_normals {
            receiver_normal.repeat(count, times);
        }
        if parts.interiors {
            interior.repeat(count, times);
        }
        if parts.depths {
            depth.repeat(count, times);
        }
        if parts.first_bounces {
            first_bounces.repeat(count, times);
        }
        if parts.kinds {
            kinds.repeat(count, times);
        }
        if parts.chains {
            chains.repeat(count, times);
        }
        if parts.references {
            reference.repeat(count, times);
        }
        if parts.clear {
            clear.repeat(count, times);
        }
    }

    /// Copies path `i` to place `k` of others.
    #[inline(always)]
    pub fn copy_to(&self, i: usize, other: &mut Paths, k: usize, parts: PathParts) {
        let Paths {
            carried,
            footprints,
            receiver_normal,
            interior,
            depth,
            first_bounces,
            kinds,
            chains,
            reference,
            clear,
        } = self;
        carried.copy_to(i, &mut other.carried, k);
        if !parts.any {
            return;
        }
        if parts.footprints {
            footprints.copy_to(i, &mut other.footprints, k);
        }
        if parts.receiver_normals {
            receiver_normal.copy_to(i, &mut other.receiver_normal, k);
        }
        if parts.interiors {
            interior.copy_to(i, &mut other.interior, k);
        }
        if parts.depths {
            depth.copy_to(i, &mut other.depth, k);
        }
        if parts.first_bounces {
            first_bounces.copy_to(i, &mut other.first_bounces, k);
        }
        if parts.kinds {
            kinds.copy_to(i, &mut other.kinds, k);
        }
        if parts.chains {
            chains.copy_to(i, &mut other.chains, k);
        }
        if parts.references {
            reference.copy_to(i, &mut other.reference, k);
        }
        if parts.clear {
            clear.copy_to(i, &mut other.clear, k);
        }
    }
}

/// Corners of the triangles and quads that are hit, from which a vectorised loop makes surfaces.
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
    /// Share of metal.
    pub metallic: Lanes,
    /// Amplitude of the layer's Fresnel curve; where that is exact.
    pub curve: Lanes,
    /// GGX alpha.
    pub alpha: Lanes,
}
}

per_path! {
/// What opaque glTF materials are for a viewer ([`crate::bsdf::MetalRoughClosure`]).
pub struct MetalRoughClosures {
    /// Diffuse colour under the layer.
    pub diffuse: RgbLanes,
    /// Reflectance of the facets at normal incidence.
    pub f0: RgbLanes,
    /// What it rises by to grazing incidence with Schlick's weight.
    pub schlick_rise: RgbLanes,
    /// What it rises by with the weight of the layer's curve.
    pub exact_rise: RgbLanes,
    /// Mean albedo.
    pub albedo: Lanes,
    /// Probability of sampling the facets.
    pub probability_specular: Lanes,
    /// Probability of sampling the diffuse lobe.
    pub probability_diffuse: Lanes,
}
}

/// What textured vertices are made of besides corners, and where textures are looked up.
#[derive(Zeroable)]
pub struct TexturedLanes {
    /// Texture coordinates of the corners.
    pub corner_uv: [[Lanes; 2]; 3],
    /// Tangents of the corners, and which way bitangents go; 0 where there are none.
    pub tangents: [Lanes3; 3],
    pub handedness: Lanes,
    /// Texture coordinates, and how much they change over a metre.
    pub uv: [Lanes; 2],
    pub uv_per_metre: Lanes,
    /// Directions of the normal map's x and y; zero where there are none.
    pub tangent: Lanes3,
    pub bitangent: Lanes3,
    /// What the normal map says; zero where nothing.
    pub mapped: Lanes3,
    /// Which ray.
    pub ray: Words,
}

/// Light samples, one a vertex that light sampling can reach.
#[derive(Zeroable)]
pub struct LightLanes {
    /// Towards the light, unit length.
    pub wi: Lanes3,
    /// Where the shadow ray ends; not for lights infinitely far away.
    pub target: Lanes3,
    /// 1 for lights infinitely far away, else 0.
    pub is_infinite: Lanes,
    /// Radiance of the light.
    pub radiance: RgbLanes,
    /// Density with which the point was chosen, the choice of the light included; 0 for none; negative for lights
    /// without size.
    pub pdf: Lanes,
    /// The chosen light, and the probability of its choice; where there is a choice.
    pub index: Words,
    pub pdf_discrete: Lanes,
    /// What the shadow ray brings if nothing is in its way.
    pub contribution: RgbLanes,
    /// The shadow ray.
    pub origin: Lanes3,
    pub direction: Lanes3,
}

/// What guiding knows of Lambertian vertices.
#[derive(Zeroable)]
pub struct GuidedLanes {
    /// Halves of the keys of their cells.
    pub key_low: Words,
    pub key_high: Words,
    /// Numbers of their cells.
    pub cell: Words,
    /// Density, over that of the cosine lobe, of the directions in which paths go on, and of those of light samples.
    pub density: Lanes,
    pub light_density: Lanes,
    /// Bins of the directions in which paths go on; where they train a guide.
    pub bin: Words,
    /// Luminance of the throughput with the albedo, before directions are chosen.
    pub carried: Lanes,
}

/// Where paths hit surfaces, and what is computed there. Vertices are sorted by [`ShadingGroup`].
#[derive(Zeroable)]
pub struct Vertices {
    /// At vertices on flat primitives.
    pub corners: CornerLanes,
    pub p: Lanes3,
    /// What a ray from here leaves.
    pub origin_primitives: [OriginPrimitive; LENGTH],
    /// Geometric normal; towards the viewer at vertices of opaque classes, on the front at others.
    pub ng: Lanes3,
    /// Shading normal, on the side of the geometric one.
    pub ns: Lanes3,
    /// Distance along the normal that a secondary ray's origin must keep.
    pub offset: Lanes,
    /// 1 where the shading normal was bent for the viewer, else 0; at vertices of opaque glTF materials.
    pub is_bent: Lanes,
    /// Towards the viewer.
    pub wo: Lanes3,
    /// Solids on the other side of the surface than the viewer's; only where there are some.
    pub beyond: Interiors,
    /// Albedo of Lambertian vertices.
    pub albedo: RgbLanes,
    pub metal_rough: MetalRoughMaterials,
    pub metal_rough_closures: MetalRoughClosures,
    pub textured: TexturedLanes,
    pub light: LightLanes,
    /// At Lambertian ones, where paths are guided.
    pub guided: GuidedLanes,
    /// Mean cosine of the scattering angle, at points of media.
    pub anisotropy: Lanes,
    /// The scattered ray.
    pub next_origin: Lanes3,
    pub next_direction: Lanes3,
}

/// Arrays for use within one stage, which names them; their contents mean nothing to the next.
pub type Scratch = [Lanes; 9];

/// What the vectorised loops work on: one allocation, so that the compiler knows its arrays apart.
#[derive(Zeroable)]
pub struct Wave {
    pub paths: Paths,
    pub vertices: Vertices,
    pub scratch: Scratch,
}

/// Paths in flight. The arrays that a scene makes use of stay within a core's second-level cache, or nearly.
pub const WAVE: usize = 2048;

/// Length of an array: one cache line more than needed, because arrays a power of two apart would all fall into the same
/// cache set.
pub const LENGTH: usize = WAVE + 16;

/// One number a path.
pub type Lanes = [f32; LENGTH];
/// One integer a path.
pub type Words = [u32; LENGTH];
/// One vector a path, by component.
pub type Lanes3 = [Lanes; 3];
/// One colour a path, by channel.
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

/// Something kept for each path.
pub trait PerPath {
    /// Copies element `i` to element `k` of `other`.
    fn copy_to(&self, i: usize, other: &mut Self, k: usize);

    /// Makes each of the first `count` elements several, one after the other.
    fn repeat(&mut self, count: usize, times: usize);
}

/// Makes each of the first `count` elements several, one after the other.
pub fn repeat<T: Copy>(elements: &mut [T], count: usize, times: usize) {
    // From the end, so that each is read before something else is in its place.
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
