//! Textures compiled for lookup: constants and transforms are folded, 8-bit images are decoded by table at lookup. Only the mip levels
//! that a picture needs are resident; others are decoded on demand.

mod by_rows;
mod hit;
mod image;
mod joint_graphs;
mod levels;
mod nodes;
mod noise;
mod packed;
mod pyramid;
mod ray_queries;
mod store;

use crate::color::Rgb;
use crate::color::spectral::{Spectrum, Wavelengths, uplift_reflectance};
use crate::error::Error;
use crate::image::Image;
use crate::math::{Vec2, Vec3};
use crate::scene::nodes::NodeGraph;
use crate::scene::{ImageId, LightProfile, MAX_TEXTURE_NESTING, NoiseKind, Texture, TextureId};
pub use hit::{
    AttributeList, AttributeValue, CameraData, GraphResults, HitAttributes, HitData, ObjectData, PathData,
    StrandData, TexturePoint,
};
use hit::{TextureCoordinates, UvMap, triplanar};
pub use image::ImageLookup;
use image::{ImageSampling, Taps};
pub use joint_graphs::JointGraphs;
use levels::{Images, Levels};
pub use levels::{TextureNeeds, TextureReport};
pub use nodes::LANES as GRAPH_LANES;
use nodes::Program;
pub use noise::{marble, perlin, turbulence};
pub use ray_queries::{Crossing, RayOrigin, RayQueries};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;
pub use store::TexturesOnDemand;

/// All textures of a scene, by [`TextureId`].
#[derive(Clone, Debug, Default)]
pub struct CompiledTextures {
    textures: Vec<Compiled>,
    /// Added to world positions before procedural lookups, metres: `compile` may have moved the scene near the camera.
    world_offset: Vec3,
    /// Names of the attributes that node graphs read, by index.
    attributes: Arc<[String]>,
    /// Angular profiles of lights, by [`ProfileId`](crate::scene::ProfileId).
    profiles: Vec<Arc<LightProfile>>,
    /// Textures whose images are damaged.
    damaged: HashSet<TextureId>,
    /// The images that they use.
    images: Images,
}

impl CompiledTextures {
    /// Compiles textures with the images they refer to. `world_offset` is what `compile` subtracted from world
    /// positions, metres. Dangling references count as black (`Scene::validate` reports them).
    ///
    /// # Errors
    /// A damaged image without which the scene can't be rendered. Other damaged images become white and are reported.
    pub fn new(
        textures: &[Texture],
        images: &[Image],
        world_offset: Vec3,
        needs: TextureNeeds,
    ) -> Result<(CompiledTextures, TextureReport), Error> {
        CompiledTextures::new_reusing(None, textures, images, world_offset, needs)
    }

    /// [`CompiledTextures::new`] for a `subset` of a scene's textures: decodes their images at mip level 0, and no others.
    ///
    /// # Errors
    /// As for [`CompiledTextures::new`].
    pub fn of_subset(
        textures: &[Texture],
        images: &[Image],
        subset: &[TextureId],
    ) -> Result<(CompiledTextures, TextureReport), Error> {
        let used: BTreeSet<ImageId> =
            subset.iter().flat_map(|&texture| Texture::image_ids(textures, texture)).collect();
        let finest = (0..images.len()).map(|i| used.contains(&ImageId(i as u32)).then_some(0)).collect();
        CompiledTextures::new(textures, images, Vec3::ZERO, TextureNeeds { finest, limit: None })
    }

    /// [`CompiledTextures::new`], reusing the images of an `earlier` picture of the same textures and images where they suffice.
    ///
    /// # Errors
    /// As for [`CompiledTextures::new`].
    pub fn new_reusing(
        earlier: Option<CompiledTextures>,
        textures: &[Texture],
        images: &[Image],
        world_offset: Vec3,
        needs: TextureNeeds,
    ) -> Result<(CompiledTextures, TextureReport), Error> {
        let mut report = TextureReport::default();
        let earlier = earlier.map(|textures| textures.images);
        let made = levels::build_all(earlier, (textures, images), needs, &mut report)?;
        let levels = &made.levels;
        let attributes = attribute_names(textures);
        let mut compiled: Vec<Compiled> =
            textures.iter().map(|t| compile(t, images, levels, &attributes)).collect();
        fold_constants(&mut compiled);
        break_cycles(&mut compiled);
        assign_grids(&mut compiled);
        let is_damaged = |texture: &Texture| match texture {
            Texture::Image { image, .. } => matches!(levels.get(image), Some(None)),
            _ => false,
        };
        let damaged =
            (0..).map(TextureId).zip(textures).filter(|(_, t)| is_damaged(t)).map(|(id, _)| id).collect();
        let profiles = Vec::new();
        Ok((
            CompiledTextures {
                textures: compiled,
                world_offset,
                attributes,
                profiles,
                damaged,
                images: made,
            },
            report,
        ))
    }

    /// Compiles textures of undamaged images with all mip levels resident.
    #[cfg(test)]
    pub(crate) fn resident(textures: &[Texture], images: &[Image], world_offset: Vec3) -> CompiledTextures {
        let made = CompiledTextures::new(textures, images, world_offset, TextureNeeds::default());
        made.expect("no image is damaged").0
    }

    /// Size of images in memory, bytes.
    pub fn bytes(&self) -> usize {
        self.images.bytes() as usize
    }

    /// Is the image of a texture damaged, so that materials ignore the texture?
    pub fn is_damaged(&self, id: TextureId) -> bool {
        self.damaged.contains(&id)
    }

    /// Do the mip levels suffice for the needs of another picture?
    pub fn suffice_for(&self, needs: &TextureNeeds) -> bool {
        self.images.needs.limit == needs.limit && self.images.needs.cover(needs)
    }

    /// Statistics of decoding on demand so far.
    pub fn on_demand(&self) -> TexturesOnDemand {
        self.images.on_demand()
    }

    /// The textures with another offset of world positions, metres.
    pub fn with_world_offset(self, world_offset: Vec3) -> CompiledTextures {
        CompiledTextures { world_offset, ..self }
    }

    /// The textures with the angular profiles of a scene's lights.
    #[must_use]
    pub fn with_profiles(self, profiles: &[Arc<LightProfile>]) -> CompiledTextures {
        CompiledTextures { profiles: profiles.to_vec(), ..self }
    }

    /// The angular profiles of lights.
    pub fn profiles(&self) -> &[Arc<LightProfile>] {
        &self.profiles
    }

    /// Linear RGBA of a texture that is known to be constant.
    pub fn constant(&self, id: TextureId) -> Option<[f32; 4]> {
        match self.textures.get(id.index()) {
            Some(Compiled::Constant(c)) => Some(*c),
            Some(_) => None,
            None => Some([0.0, 0.0, 0.0, 1.0]),
        }
    }

    /// The textures with spectra kept for spectral rendering, or else converted to constant colours. Removes those that
    /// were [added](CompiledTextures::add_spectrum) to the scene's `textures`.
    #[must_use]
    pub fn with_spectra(mut self, textures: &[Texture], are_kept: bool) -> CompiledTextures {
        self.textures.truncate(textures.len());
        for (compiled, texture) in self.textures.iter_mut().zip(textures) {
            if let Texture::Spectrum(curve) = texture {
                let spectrum = Spectrum::Measured(curve.clone());
                *compiled = match are_kept {
                    true => Compiled::Spectrum(spectrum),
                    false => Compiled::Constant(rgba(&spectrum)),
                };
            }
        }
        self
    }

    pub fn add_spectrum(&mut self, spectrum: Spectrum) -> TextureId {
        self.textures.push(Compiled::Spectrum(spectrum));
        TextureId(self.textures.len() as u32 - 1)
    }

    /// The spectrum of a texture; `None` for other textures.
    pub fn spectrum(&self, id: TextureId) -> Option<&Spectrum> {
        match self.textures.get(id.index()) {
            Some(Compiled::Spectrum(spectrum)) => Some(spectrum),
            _ => None,
        }
    }

    /// A point in the original scene's world space, before `compile` moved it.
    #[inline(always)]
    fn scene_point(&self, point: &TexturePoint) -> TexturePoint {
        TexturePoint { world: point.world + self.world_offset, ..*point }
    }

    /// Linear RGBA of the image of a node; `footprint` is in texture coordinates.
    fn image_of_node(
        &self,
        texture: TextureId,
        sampling: &ImageSampling,
        uv: [f32; 2],
        footprint: f32,
    ) -> [f32; 4] {
        match self.textures.get(texture.index()) {
            Some(Compiled::Image { lookup, .. }) => sampling.eval(lookup, uv, footprint),
            Some(Compiled::Constant(color)) => sampling.constant(*color, uv),
            _ => [0.0; 4],
        }
    }

    /// Names of the vertex attributes that node graphs read, by index.
    pub fn attributes(&self) -> &Arc<[String]> {
        &self.attributes
    }

    /// Does the value depend on the viewing direction?
    pub fn depends_on_viewer(&self, id: TextureId) -> bool {
        self.has_part(id, |texture| match texture {
            Compiled::Facing(_) => true,
            Compiled::Nodes(program, _) => program.depends_on_viewer(),
            _ => false,
        })
    }

    /// Does the value need [`HitData`]?
    pub fn reads_hit(&self, id: TextureId) -> bool {
        self.has_part(id, |texture| matches!(texture, Compiled::Nodes(program, _) if program.reads_hit()))
    }

    /// Does the value depend on tangents of the first UV set?
    pub fn reads_tangents(&self, id: TextureId) -> bool {
        self.has_part(
            id,
            |texture| matches!(texture, Compiled::Nodes(program, _) if program.reads_tangents()),
        )
    }

    /// Does the value depend on the incident path (ray type, length, depth)?
    pub fn reads_path(&self, id: TextureId) -> bool {
        self.has_part(id, |texture| matches!(texture, Compiled::Nodes(program, _) if program.reads_path()))
    }

    /// Does it trace rays into the scene?
    pub fn traces_rays(&self, id: TextureId) -> bool {
        self.has_part(id, |texture| matches!(texture, Compiled::Nodes(program, _) if program.traces_rays()))
    }

    /// Does a predicate hold for a texture or any texture nested in it?
    fn has_part(&self, id: TextureId, holds: impl Fn(&Compiled) -> bool) -> bool {
        let mut pending = vec![id.index()];
        let mut visited = vec![false; self.textures.len()];
        while let Some(at) = pending.pop() {
            let Some(texture) = self.textures.get(at) else { continue };
            if holds(texture) {
                return true;
            }
            if !visited[at] {
                visited[at] = true;
                pending.extend(texture.parts().into_iter().map(|part| part as usize));
            }
        }
        false
    }

    /// Do lookups depend on the ray footprint?
    pub fn use_ray_footprints(&self) -> bool {
        self.textures.iter().any(|texture| match texture {
            Compiled::Image { lookup, .. } => lookup.has_pyramid(),
            Compiled::Nodes(program, _) => program.reads_width(),
            _ => false,
        })
    }
}

/// The names of the attributes that node graphs read, sorted.
fn attribute_names(textures: &[Texture]) -> Arc<[String]> {
    let graphs = textures.iter().filter_map(|texture| match texture {
        Texture::Nodes(graph) => Some(graph),
        _ => None,
    });
    let names: BTreeSet<&str> = graphs.flat_map(|graph| graph.attributes()).collect();
    names.into_iter().map(str::to_string).collect()
}

fn compile(
    texture: &Texture,
    images: &[Image],
    levels: &BTreeMap<ImageId, Option<Levels>>,
    attributes: &[String],
) -> Compiled {
    match texture {
        Texture::Solid([r, g, b]) => Compiled::Constant([*r, *g, *b, 1.0]),
        Texture::Image { image, wrap_u, wrap_v, interpolation, mapping } => match images.get(image.index()) {
            None => Compiled::Constant([0.0, 0.0, 0.0, 1.0]),
            Some(pixels) => match levels.get(image) {
                // An image of one pixel.
                None => Compiled::Constant(pixels.rgba(0, 0)),
                // Damaged: white leaves only the materials' factors.
                Some(None) => Compiled::Constant([1.0; 4]),
                Some(Some(levels)) => {
                    let lookup = ImageLookup::new(levels, *wrap_u, *wrap_v, *interpolation);
                    Compiled::Image { lookup, coordinates: TextureCoordinates::new(mapping), grid: 0 }
                }
            },
        },
        Texture::Checker { even, odd, cell_size, mapping } => Compiled::Checker {
            even: even.0,
            odd: odd.0,
            inverse_size: 1.0 / cell_size,
            coordinates: TextureCoordinates::new(mapping),
        },
        Texture::Mix { a, b, factor } => Compiled::Mix([a.0, b.0, factor.0]),
        Texture::Nodes(graph) => {
            let program = Program::new(graph, attributes);
            // Vectors may have negative components, which `constant` clips.
            match program.constant().filter(|_| !graph.is_vector()) {
                Some([r, g, b]) => Compiled::Constant([r, g, b, 1.0]),
                None => Compiled::Nodes(Arc::new(program), graph.clone()),
            }
        }
        Texture::Normal => Compiled::Normal,
        Texture::Facing(colors) => match colors.first() {
            None => Compiled::Constant([0.0, 0.0, 0.0, 1.0]),
            Some(&[r, g, b]) if colors.iter().all(|c| c == &colors[0]) => Compiled::Constant([r, g, b, 1.0]),
            Some(_) => Compiled::Facing(colors.clone()),
        },
        Texture::Spectrum(curve) => Compiled::Constant(rgba(&Spectrum::Measured(curve.clone()))),
        Texture::Noise { kind, frequency, octaves, low, high, seed } => {
            if low == high {
                return Compiled::Constant([low[0], low[1], low[2], 1.0]);
            }
            let octaves = (*octaves).clamp(1, 16);
            Compiled::Noise {
                kind: *kind,
                frequency: *frequency,
                octaves,
                low: *low,
                high: *high,
                seed: *seed,
            }
        }
    }
}

/// Linear RGBA of a spectrum, clipped to the gamut.
fn rgba(spectrum: &Spectrum) -> [f32; 4] {
    let [r, g, b] = spectrum.rgb().to_array().map(|c| c.max(0.0));
    [r, g, b, 1.0]
}

/// Gives images with equal texel grids and UV maps the same grid number.
fn assign_grids(textures: &mut [Compiled]) {
    let mut grids = HashMap::new();
    for (i, texture) in textures.iter_mut().enumerate() {
        if let Compiled::Image { lookup, coordinates: TextureCoordinates::Uv(map), grid } = texture {
            *grid = *grids.entry((map.bits(), lookup.grid())).or_insert(i as u32);
        }
    }
}

#[inline(always)]
fn checker_is_odd(coordinates: &TextureCoordinates, inverse_size: f32, point: &TexturePoint) -> bool {
    // Above 2^24 f32 represents only even numbers; the sum in f64 stays exact.
    let cell = |x: f32| f64::from((x * inverse_size).floor());
    let sum = match coordinates {
        TextureCoordinates::Uv(map) => {
            let uv = map.apply(point);
            cell(uv.x) + cell(uv.y)
        }
        TextureCoordinates::World | TextureCoordinates::Triplanar(_) => {
            cell(point.world.x) + cell(point.world.y) + cell(point.world.z)
        }
    };
    let half = sum * 0.5;
    half != half.floor()
}

/// The colour for a cosine, interpolated linearly in a table.
#[inline]
fn color_by_cosine(colors: &[[f32; 3]], cosine: f32) -> [f32; 4] {
    let last = colors.len() - 1;
    let at = cosine.clamp(0.0, 1.0) * last as f32;
    let first = (at as usize).min(last - 1);
    let (a, b, t) = (colors[first], colors[first + 1], at - first as f32);
    let [r, g, b] = std::array::from_fn(|i| a[i] + t * (b[i] - a[i]));
    [r, g, b, 1.0]
}

/// Procedural noise, clamped to 0..1.
#[inline]
fn noise_value(kind: NoiseKind, p: Vec3, octaves: u32, seed: u32) -> f32 {
    let value = match kind {
        NoiseKind::Perlin => 0.5 + 0.5 * perlin(p, seed),
        NoiseKind::Turbulence => turbulence(p, octaves, seed),
        NoiseKind::Marble => marble(p, octaves, seed),
    };
    value.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests;

/// A compiled texture; nested textures are given by index.
#[derive(Clone, Debug)]
enum Compiled {
    Constant([f32; 4]),
    /// Images with the same `grid` have the same texel indices at the same coordinates.
    Image {
        lookup: ImageLookup,
        coordinates: TextureCoordinates,
        grid: u32,
    },
    Checker {
        even: u32,
        odd: u32,
        inverse_size: f32,
        coordinates: TextureCoordinates,
    },
    /// Two textures and the factor that mixes them.
    Mix([u32; 3]),
    Nodes(Arc<Program>, Arc<NodeGraph>),
    Normal,
    /// Colours by viewing cosine, evenly spaced from 0 to 1; at least two.
    Facing(Arc<[[f32; 3]]>),
    Spectrum(Spectrum),
    Noise {
        kind: NoiseKind,
        frequency: f32,
        octaves: u32,
        low: [f32; 3],
        high: [f32; 3],
        seed: u32,
    },
}

impl Compiled {
    /// Indices of the textures nested directly in it.
    fn parts(&self) -> Vec<u32> {
        match self {
            Compiled::Checker { even, odd, .. } => vec![*even, *odd],
            Compiled::Mix(parts) => parts.to_vec(),
            Compiled::Nodes(program, _) => program.textures().map(|part| part.0).collect(),
            _ => Vec::new(),
        }
    }
}

// Constant folding of nested textures, and removal of cycles.

/// Folds checkers of two equal constants and mixes of constants.
fn fold_constants(textures: &mut [Compiled]) {
    for _ in 0..MAX_TEXTURE_NESTING {
        for i in 0..textures.len() {
            let value = |at: u32| match textures.get(at as usize) {
                Some(Compiled::Constant(c)) => Some(*c),
                Some(_) => None,
                None => Some([0.0, 0.0, 0.0, 1.0]),
            };
            let folded = match textures[i] {
                Compiled::Checker { even, odd, .. } => value(even).filter(|even| value(odd) == Some(*even)),
                Compiled::Mix(parts) => {
                    let [a, b, factor] = parts.map(value);
                    a.zip(b).zip(factor).map(|((a, b), factor)| mix_by_channel(a, b, factor))
                }
                _ => None,
            };
            if let Some(constant) = folded {
                textures[i] = Compiled::Constant(constant);
            }
        }
    }
}

/// Makes mixes and node graphs black that contain themselves or are nested too deeply: their lookups recurse without a limit.
fn break_cycles(textures: &mut [Compiled]) {
    if !textures.iter().any(is_recursive) {
        return;
    }
    let mut depths = vec![1; textures.len()];
    for _ in 0..=MAX_TEXTURE_NESTING {
        for i in 0..textures.len() {
            let depth = |part: u32| depths.get(part as usize).map_or(1, |depth: &u32| depth + 1);
            depths[i] = textures[i].parts().into_iter().map(depth).max().unwrap_or(1);
        }
    }
    for (texture, depth) in textures.iter_mut().zip(depths) {
        if is_recursive(texture) && depth > MAX_TEXTURE_NESTING {
            *texture = Compiled::Constant([0.0, 0.0, 0.0, 1.0]);
        }
    }
}

/// Do lookups recurse into all nested textures?
fn is_recursive(texture: &Compiled) -> bool {
    matches!(texture, Compiled::Mix(_) | Compiled::Nodes(..))
}

/// `a + factor (b - a)` by channel; the factor of alpha is the mean of the others.
fn mix_by_channel(a: [f32; 4], b: [f32; 4], [red, green, blue, _]: [f32; 4]) -> [f32; 4] {
    let factors = [red, green, blue, (red + green + blue) / 3.0];
    std::array::from_fn(|i| a[i] + factors[i] * (b[i] - a[i]))
}

// Lookup of all textures of a material at one point.

/// Reads textures at a point. Caches the last value, since materials read several channels of one texture, and the last
/// texel indices, since textures of a material mostly have the same size and coordinates.
#[derive(Debug)]
pub struct PointReader<'a> {
    textures: &'a CompiledTextures,
    point: TexturePoint,
    hit: Option<&'a HitData<'a>>,
    /// Known results of node graphs at the point.
    results: Option<GraphResults<'a>>,
    last: Cell<(u32, [f32; 4])>,
    /// Texels of the last lookup, by parity of the mip level: a lookup uses at most two successive levels.
    taps: [Cell<(u64, Taps)>; 2],
}

impl<'a> PointReader<'a> {
    #[inline(always)]
    pub fn new(textures: &'a CompiledTextures, point: TexturePoint) -> PointReader<'a> {
        let nothing = (u64::MAX, Taps::default());
        let taps = [Cell::new(nothing), Cell::new(nothing)];
        PointReader { textures, point, hit: None, results: None, last: Cell::new((u32::MAX, [0.0; 4])), taps }
    }

    /// The reader with the hit data that node graphs read.
    #[inline(always)]
    pub fn with_hit(self, hit: Option<&'a HitData<'a>>) -> PointReader<'a> {
        PointReader { hit, ..self }
    }

    /// The reader with known results of node graphs.
    #[inline(always)]
    pub fn with_results(self, results: Option<GraphResults<'a>>) -> PointReader<'a> {
        PointReader { results, ..self }
    }

    /// Linear RGBA of a texture.
    #[inline]
    pub fn eval(&self, id: TextureId) -> [f32; 4] {
        let (last, value) = self.last.get();
        if last == id.0 {
            return value;
        }
        let value = self.look_up(id);
        self.last.set((id.0, value));
        value
    }

    /// A texture times a factor at a path's wavelengths: a spectral texture exactly, a colour by uplifting to a reflectance spectrum.
    pub fn by_wavelength(&self, id: TextureId, factor: Rgb, waves: &Wavelengths) -> Rgb {
        let mut at = id;
        for _ in 0..MAX_TEXTURE_NESTING {
            match self.textures.textures.get(at.index()) {
                Some(Compiled::Checker { even, odd, inverse_size, coordinates }) => {
                    let is_odd = checker_is_odd(coordinates, *inverse_size, &self.scene_point());
                    at = TextureId(if is_odd { *odd } else { *even });
                }
                Some(Compiled::Spectrum(spectrum)) => {
                    return spectrum.at(waves) * uplift_reflectance(factor, waves);
                }
                _ => break,
            }
        }
        let [r, g, b, _] = self.eval(id);
        uplift_reflectance(factor * Rgb::new(r, g, b), waves)
    }

    fn look_up(&self, id: TextureId) -> [f32; 4] {
        let mut at = id.index();
        for _ in 0..MAX_TEXTURE_NESTING {
            match self.textures.textures.get(at) {
                Some(Compiled::Checker { even, odd, inverse_size, coordinates }) => {
                    let is_odd = checker_is_odd(coordinates, *inverse_size, &self.scene_point());
                    at = if is_odd { *odd } else { *even } as usize;
                }
                Some(Compiled::Constant(c)) => return *c,
                Some(Compiled::Image { lookup, coordinates: TextureCoordinates::Uv(map), grid }) => {
                    return self.image(lookup, map, *grid);
                }
                Some(Compiled::Image { lookup, coordinates, .. }) => {
                    return projected(lookup, coordinates, &self.scene_point());
                }
                Some(Compiled::Spectrum(spectrum)) => return rgba(spectrum),
                Some(Compiled::Normal) => {
                    let [r, g, b] = (0.5 + 0.5 * self.point.normal).to_array();
                    return [r, g, b, 1.0];
                }
                Some(Compiled::Mix(parts)) => return self.mix(*parts),
                Some(Compiled::Nodes(program, _)) => return self.nodes(at, program),
                Some(Compiled::Facing(colors)) => return color_by_cosine(colors, self.point.cosine),
                Some(Compiled::Noise { kind, frequency, octaves, low, high, seed }) => {
                    let value = noise_value(*kind, self.scene_point().world * *frequency, *octaves, *seed);
                    let [r, g, b] = std::array::from_fn(|i| low[i] + value * (high[i] - low[i]));
                    return [r, g, b, 1.0];
                }
                None => break,
            }
        }
        [0.0, 0.0, 0.0, 1.0]
    }

    /// The vector result of a node graph, world space; `None` for other textures.
    pub fn vector(&self, id: TextureId) -> Option<Vec3> {
        let Some(Compiled::Nodes(program, _)) = self.textures.textures.get(id.index()) else { return None };
        Some(Vec3::from_array(program.as_vector(self.result(id.index(), program))))
    }

    /// Is the hit on a back face? False without hit data.
    pub fn is_back(&self) -> bool {
        self.results.map_or_else(|| self.hit.is_some_and(|hit| hit.is_back), |results| results.is_back)
    }

    #[inline(never)]
    fn nodes(&self, index: usize, program: &Program) -> [f32; 4] {
        let [r, g, b] = self.result(index, program).map(nodes::reflectance);
        [r, g, b, 1.0]
    }

    /// The result of the node graph with an index at the point.
    fn result(&self, index: usize, program: &Program) -> [f32; 3] {
        if let Some(known) = self.results.and_then(|results| results.get(index)) {
            return known;
        }
        program.at(
            self.scene_point(),
            self.hit,
            &|texture| self.look_up(texture),
            &|texture, sampling, uv, footprint| self.textures.image_of_node(texture, sampling, uv, footprint),
        )
    }

    #[inline(never)]
    fn mix(&self, parts: [u32; 3]) -> [f32; 4] {
        let [a, b, factor] = parts.map(|part| self.look_up(TextureId(part)));
        mix_by_channel(a, b, factor)
    }

    /// The point in the original scene's world space, before `compile` moved it.
    #[inline(always)]
    fn scene_point(&self) -> TexturePoint {
        self.textures.scene_point(&self.point)
    }

    #[inline(always)]
    fn image(&self, lookup: &ImageLookup, map: &UvMap, grid: u32) -> [f32; 4] {
        lookup.eval_by(map.footprint(&self.point), |image, level| {
            let key = u64::from(grid) << 32 | level as u64;
            let (cached_key, taps) = self.taps[level % 2].get();
            if cached_key == key {
                return taps;
            }
            let taps = lookup.taps(image, map.apply(&self.point));
            self.taps[level % 2].set((key, taps));
            taps
        })
    }
}

impl CompiledTextures {
    /// Linear RGBA of a texture at a point without footprint, both UV sets being `uv`.
    #[inline]
    pub fn eval(&self, id: TextureId, uv: Vec2, world: Vec3) -> [f32; 4] {
        self.eval_at(id, &TexturePoint { uv: [uv, uv], world, ..TexturePoint::default() })
    }

    /// Linear RGBA of a texture at a point.
    #[inline]
    pub fn eval_at(&self, id: TextureId, point: &TexturePoint) -> [f32; 4] {
        PointReader::new(self, *point).eval(id)
    }
}

/// Linear RGBA of an image with UV, world or triplanar coordinates.
fn projected(lookup: &ImageLookup, coordinates: &TextureCoordinates, point: &TexturePoint) -> [f32; 4] {
    match coordinates {
        TextureCoordinates::Uv(map) => lookup.eval(map.apply(point), map.footprint(point)),
        TextureCoordinates::World => lookup.eval(Vec2::new(point.world.x, point.world.z), point.width),
        TextureCoordinates::Triplanar(inverse_size) => {
            let mut sum = [0.0; 4];
            for (uv, weight) in triplanar(point, *inverse_size) {
                if weight > 0.0 {
                    let value = lookup.eval(uv, point.width * inverse_size);
                    sum = std::array::from_fn(|i| sum[i] + weight * value[i]);
                }
            }
            sum
        }
    }
}
