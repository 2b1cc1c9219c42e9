//! The memory of a wave: some thousand paths side by side, one array a quantity, so that loops over paths vectorise.

use super::interior::Interior;
use super::surface::Group;
use crate::accel::Accel;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::film::AovSample;
use crate::math::{Hit, OriginPrimitive, Ray, Vec3};
use bytemuck::Zeroable;

/// Paths in flight. The arrays that a scene makes use of stay within a core's second-level cache, or nearly.
pub const WAVE: usize = 2048;

/// Length of an array: one cache line more than needed, because arrays a power of two apart would all fall into the same
/// cache set.
const LENGTH: usize = WAVE + 16;

/// One number a path.
pub type Lanes = [f32; LENGTH];
/// One integer a path.
pub type Words = [u32; LENGTH];
/// The solids around each path.
pub type Interiors = [Interior; LENGTH];
/// One vector or colour a path, by component.
pub type Lanes3 = [Lanes; 3];

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
pub fn get_rgb(v: &Lanes3, i: usize) -> Rgb {
    Rgb::new(v[0][i], v[1][i], v[2][i])
}

/// Sets element `i` to a colour.
#[inline(always)]
pub fn set_rgb(v: &mut Lanes3, i: usize, value: Rgb) {
    v[0][i] = value.r;
    v[1][i] = value.g;
    v[2][i] = value.b;
}

/// State that a path carries from bounce to bounce.
#[derive(Zeroable)]
pub struct Paths {
    /// Product of all weights so far.
    pub throughput: Lanes3,
    /// Density per solid angle of the last scattering; 0 after a specular one and at the camera.
    pub pdf: Lanes,
    /// Undoes the 1 / eta^2 of refractions for the roulette.
    pub eta_squared: Lanes,
    /// Width of what the path sees at the start of its ray, metres, and how fast that grows, metres per metre; only
    /// where textures ask for it.
    pub cone_width: Lanes,
    pub cone_spread: Lanes,
    /// For the choice among lights at the last vertex: the normal that light had to come from, or zero; only where that
    /// choice depends on it.
    pub receiver_normal: Lanes3,
    /// Solids that the path is inside of; only where there are some.
    pub interior: Interiors,
    /// Sobol point: its two parts.
    pub seed: Words,
    pub shuffled: Words,
    /// Which sample of the block it is: the index into the radiances.
    pub sample: Words,
}

/// Opaque glTF materials at vertices ([`crate::bsdf::MetalRough`]), and what a direction sees of them
/// ([`crate::bsdf::MetalRoughClosure`]) in the same places once that is computed.
#[derive(Zeroable)]
pub struct MetalRoughs {
    /// Diffuse colour; then what is seen of it.
    pub diffuse: Lanes3,
    /// Reflectance of the dielectric layer at normal incidence; then that of the whole.
    pub f0: Lanes3,
    /// Reflectance of the metal at normal incidence; then what that of the whole rises by with Schlick's weight.
    pub schlick_rise: Lanes3,
    /// What it rises by with the weight of the layer's curve.
    pub exact_rise: Lanes3,
    /// The layer's curve: its amplitude.
    pub curve: Lanes,
    /// Reflectance of the layer at grazing incidence; then the chance of reflection by microfacets.
    pub probability_specular: Lanes,
    /// Share of metal; then the chance of diffuse reflection.
    pub probability_diffuse: Lanes,
    /// Mean albedo.
    pub albedo: Lanes,
    /// GGX alpha.
    pub alpha: Lanes,
}

/// What textured vertices are made of besides corners and normals, and where textures are looked up.
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

/// Where paths hit surfaces, and what is computed there. Vertices are sorted: Lambertian ones first, then opaque glTF
/// materials, then other ones that light sampling can reach, then specular ones.
#[derive(Zeroable)]
pub struct Vertices {
    /// What plain vertices are made of: the corners of their primitives with the normals there, and the weights of the
    /// second and third.
    pub corners: [Lanes3; 3],
    pub normals: [Lanes3; 3],
    pub weights: [Lanes; 2],
    /// 1 if the back is black, else 0.
    pub one_sided: Lanes,
    pub p: Lanes3,
    /// What a ray from here leaves.
    pub departures: [OriginPrimitive; LENGTH],
    /// Geometric normal; towards the viewer at Lambertian and opaque glTF vertices, on the front at others.
    pub ng: Lanes3,
    /// Shading normal, on the side of the geometric one.
    pub ns: Lanes3,
    /// Distance along the normal that a secondary ray's origin must keep.
    pub offset: Lanes,
    /// Solids on the other side of the surface than the viewer's; only where there are some.
    pub beyond: Interiors,
    /// Albedo of Lambertian vertices.
    pub albedo: Lanes3,
    pub metal_rough: MetalRoughs,
    pub textured: TexturedLanes,
    /// Towards the viewer; not at textured Lambertian vertices, which don't need it.
    pub wo: Lanes3,
    /// Towards the sampled light, unit length.
    pub wi: Lanes3,
    /// Where its shadow ray ends.
    pub target: Lanes3,
    /// 1 for lights infinitely far away, else 0.
    pub is_infinite: Lanes,
    /// Radiance of the light.
    pub light: Lanes3,
    /// The chosen light, and the chance of it.
    pub light_index: Words,
    pub light_chance: Lanes,
    /// Density with which the light's point was chosen; 0 for none; negative for lights without size.
    pub light_pdf: Lanes,
    /// What the shadow ray brings if nothing is in its way.
    pub contribution: Lanes3,
    /// The ray that follows: of the shadow test, then of the scattered path.
    pub origin: Lanes3,
    pub direction: Lanes3,
    /// Density of the scattered direction; negative where the path ends.
    pub next_pdf: Lanes,
}

/// What the vectorised loops work on: one allocation, so that the compiler knows its arrays apart.
#[derive(Zeroable)]
pub struct Wave {
    pub paths: Paths,
    pub vertices: Vertices,
}

/// All memory that tracing a block of pixels takes; made once a thread.
pub struct Workspace {
    pub(super) wave: Box<Wave>,
    /// Paths in the order of their rays, before their vertices are sorted.
    pub(super) arriving: Box<Paths>,
    pub(super) rays: Vec<Ray>,
    pub(super) hits: Vec<Hit>,
    /// Shading group of each hit.
    pub(super) groups: Vec<Group>,
    /// Paths that left the scene.
    pub(super) escaped: Vec<u32>,
    pub(super) materials: Vec<u32>,
    /// BSDFs of the vertices that are neither Lambertian nor of opaque glTF materials.
    pub(super) bsdfs: Vec<Bsdf>,
    pub(super) shadow_rays: Vec<Ray>,
    /// Vertex of each shadow ray.
    pub(super) shadow_vertices: Vec<u32>,
    pub(super) occluded: Vec<bool>,
    /// Results by sample: radiance and alpha.
    pub(super) radiance: Vec<[f32; 4]>,
    /// Results by sample, if asked for.
    pub(super) aovs: Vec<Option<AovSample>>,
    /// For surfaces that are partly absent.
    pub(super) pending: Vec<u32>,
    pub(super) pending_rays: Vec<Ray>,
    pub(super) pending_hits: Vec<Hit>,
    /// Rays traced so far.
    pub ray_count: u64,
}

impl Workspace {
    /// Empty memory, about a megabyte.
    pub fn new() -> Workspace {
        Workspace {
            wave: bytemuck::zeroed_box(),
            arriving: bytemuck::zeroed_box(),
            rays: Vec::with_capacity(WAVE),
            hits: Vec::with_capacity(WAVE),
            groups: Vec::with_capacity(WAVE),
            escaped: Vec::with_capacity(WAVE),
            materials: Vec::with_capacity(WAVE),
            bsdfs: Vec::new(),
            shadow_rays: Vec::with_capacity(WAVE),
            shadow_vertices: Vec::with_capacity(WAVE),
            occluded: Vec::with_capacity(WAVE),
            radiance: Vec::with_capacity(WAVE),
            aovs: Vec::new(),
            pending: Vec::new(),
            pending_rays: Vec::new(),
            pending_hits: Vec::new(),
            ray_count: 0,
        }
    }

    /// Finds the nearest hits of `rays`.
    pub(super) fn intersect(&mut self, accel: &Accel) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        accel.closest(&self.rays, &mut self.hits);
        self.ray_count += self.rays.len() as u64;
    }
}

impl Default for Workspace {
    fn default() -> Self {
        Workspace::new()
    }
}
