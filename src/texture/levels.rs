//! Mip levels of texture images: the choice of those resident in memory, and demand loading of the others.

use super::by_rows::{BuiltLevels, LevelsByRows};
use super::packed::{PackedLevel, SIDE};
use super::pyramid::{
    Texels, Threads, WithTexels, halved, halved_by_one_thread, mip_levels, sizes, with_common_texels,
};
use super::store::{Store, TexturesOnDemand, lock};
use crate::error::{Error, Warning};
use crate::image::{Damage, Encoding, Image, Pixels};
use crate::scene::{ImageId, Interpolation, Texture};
use rayon::prelude::*;
use std::collections::{BTreeMap, BinaryHeap, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

/// A mip level; level 0 is the image itself.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Size, format and texels; these are [encoded](crate::image::Pixels::Encoded) unless the level is resident.
    pub image: Image,
    /// Source of the texels if the level is not resident.
    pub paged: Option<Arc<PagedLevel>>,
}

impl Level {
    /// A level that stays in memory.
    pub fn resident(image: Image) -> Level {
        Level { image, paged: None }
    }

    /// Size of its uncompressed texels in memory, bytes.
    pub fn bytes(&self) -> usize {
        if self.paged.is_some() { 0 } else { self.image.bytes() }
    }

    /// Runs a task on the texels.
    #[inline(always)]
    pub fn with_texels<T: WithTexels>(&self, task: T) -> T::Output {
        with_common_texels(&self.image, task, |task| task.run(OtherTexels(self)))
    }
}

/// Texels of rare formats and of levels that are not resident.
struct OtherTexels<'a>(&'a Level);

impl Texels for OtherTexels<'_> {
    #[inline]
    fn texel(&self, at: usize) -> [f32; 4] {
        let Level { image, paged } = self.0;
        if let Some(paged) = paged {
            return paged.texel(at);
        }
        let width = image.width as usize;
        image.rgba((at % width) as u32, (at / width) as u32)
    }
}

// Levels that are not resident are compressed losslessly, in memory or in a temporary file ([`Store`]). A level that was not expected to be
// needed is compressed at the first lookup, which decodes the whole image, since JPEG and PNG have no random access (EXR and HDR are read
// by rows), and also compresses all missing coarser levels. No image is decoded twice for the same level.
//
// Nothing here waits for jobs of the thread pool: a waiting thread may start another tile and deadlock on a lock that it holds itself.

/// A level whose texels are read from its compressed form.
#[derive(Debug)]
pub(super) struct PagedLevel {
    /// Unique among the levels of all images and stores.
    id: u64,
    level: usize,
    width: u32,
    image: Arc<PagedImage>,
}

impl PagedLevel {
    /// Mip level `level` of an image, `width` texels wide.
    pub fn new(image: &Arc<PagedImage>, level: usize, width: u32) -> PagedLevel {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        PagedLevel { id: NEXT.fetch_add(1, Ordering::Relaxed), level, width, image: image.clone() }
    }

    /// Linear RGBA of the texel at a row-major index in the level.
    #[inline(never)]
    pub fn texel(&self, at: usize) -> [f32; 4] {
        let width = self.width as usize;
        let (x, y) = ((at % width) as u32, (at / width) as u32);
        self.image.packed(self.level).texel(x, y, self.id, &self.image.store)
    }
}

/// An image with levels that are not resident.
#[derive(Debug)]
pub(super) struct PagedImage {
    /// The encoded image.
    image: Image,
    /// Compressed levels, by mip level.
    packed: Vec<OnceLock<PackedLevel>>,
    /// Held while the image is decoded.
    decoding: Mutex<()>,
    /// The finest resident level; all coarser ones are resident, too.
    resident_from: usize,
    /// A coarse copy, used if the image can no longer be decoded.
    fallback: Image,
    store: Arc<Store>,
}

impl PagedImage {
    /// An image with `levels` mip levels; those from `resident_from` on are resident.
    pub fn new(
        image: Image,
        levels: usize,
        resident_from: usize,
        fallback: Image,
        store: &Arc<Store>,
    ) -> PagedImage {
        let packed = (0..levels).map(|_| OnceLock::new()).collect();
        PagedImage {
            image,
            packed,
            decoding: Mutex::default(),
            resident_from,
            fallback,
            store: store.clone(),
        }
    }

    /// Stores a compressed level.
    pub fn keep(&self, level: usize, packed: PackedLevel) {
        // A level that is already set has the same texels.
        let _ = self.packed[level].set(packed);
    }

    /// Size of its compressed levels in memory, bytes.
    fn bytes(&self) -> usize {
        self.packed.iter().filter_map(OnceLock::get).map(PackedLevel::bytes).sum()
    }

    /// A compressed level; decodes the image if it is missing. Threads that need an image which is being decoded wait.
    #[inline]
    fn packed(&self, level: usize) -> &PackedLevel {
        match self.packed[level].get() {
            Some(packed) => packed,
            None => self.decode(level),
        }
    }

    /// Decodes the image, and compresses the requested level and all missing coarser ones.
    #[cold]
    fn decode(&self, requested: usize) -> &PackedLevel {
        let guard = lock(&self.decoding);
        if self.packed[requested].get().is_none() {
            self.store.decode(self.image.decoding_bytes(), || self.decode_from(requested));
        }
        drop(guard);
        self.packed[requested].get_or_init(|| PackedLevel::new(&self.fallback(requested), &self.store))
    }

    fn decode_from(&self, requested: usize) {
        let mut warnings = Vec::new();
        if let Some((source, _)) = self.image.rows() {
            let missing = (requested..self.resident_from.max(requested + 1))
                .filter(|&level| self.packed[level].get().is_none());
            let mut levels =
                LevelsByRows::new(&self.image, &missing.collect(), None, Threads::This, &self.store);
            let decoded = source.decode_rows(false, &mut warnings, &mut |rows| levels.add(rows));
            self.store.add_warnings(warnings);
            return match decoded {
                Ok(()) => {
                    levels.finish().packed.into_iter().for_each(|(level, packed)| self.keep(level, packed))
                }
                Err(damage) => self.store.warn_of_damage(&self.image, damage),
            };
        }
        let decoded = self.image.decoded(&mut warnings);
        self.store.add_warnings(warnings);
        let mut image = match decoded {
            Ok(image) => Image { encoding: self.image.encoding, ..image },
            Err(damage) => return self.store.warn_of_damage(&self.image, damage),
        };
        for _ in 0..requested {
            image = halved_by_one_thread(&image);
        }
        self.keep(requested, PackedLevel::new(&image, &self.store));
        for level in requested + 1..self.resident_from {
            image = halved_by_one_thread(&image);
            if self.packed[level].get().is_none() {
                self.keep(level, PackedLevel::new(&image, &self.store));
            }
        }
    }

    /// A level upsampled from the coarse copy.
    fn fallback(&self, level: usize) -> Image {
        let [width, height] = sizes(self.image.width, self.image.height).nth(level).unwrap_or([1, 1]);
        resized(&self.fallback, width, height, self.image.encoding)
    }
}

/// An image resampled by nearest neighbour.
pub(super) fn resized(image: &Image, width: u32, height: u32, encoding: Encoding) -> Image {
    let n = image.channels as usize;
    let source_index = |i: u32, to: u32, from: u32| (u64::from(i) * u64::from(from) / u64::from(to)) as usize;
    let texels = (0..height).flat_map(|y| {
        (0..width).map(move |x| {
            (source_index(y, height, image.height) * image.width as usize
                + source_index(x, width, image.width))
                * n
        })
    });
    let pixels = match &*image.pixels {
        Pixels::U8(data) => Pixels::U8(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::U16(data) => Pixels::U16(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::F32(data) => Pixels::F32(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::Encoded(_) => Pixels::U8(vec![0; width as usize * height as usize * n]),
    };
    Image { width, height, encoding, pixels: Arc::new(pixels), ..image.clone() }
}

// Choice of resident levels, and decoding before rendering.
//
// Levels that no lookup is expected to need are omitted. If the others exceed the memory limit, the largest are compressed. Images are
// decoded in batches to limit the memory of the decoders.

/// The mip levels that rendering a picture needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TextureNeeds {
    /// By image: the finest mip level that lookups are expected to need, 0 being the image itself; `None` if no lookup is expected.
    /// Images beyond the list need level 0. Lookups of finer levels than expected find the same texels, but decode on demand.
    pub finest: Vec<Option<u32>>,
    /// Memory limit of images, bytes. Images that the scene itself holds decoded don't count.
    pub limit: Option<u64>,
}

impl TextureNeeds {
    /// The finest level needed of an image; `None` if none is.
    fn finest(&self, image: usize) -> Option<u32> {
        self.finest.get(image).copied().unwrap_or(Some(0))
    }

    /// Do levels built for these needs suffice for `other` needs?
    pub fn cover(&self, other: &TextureNeeds) -> bool {
        let finest = |needs: &TextureNeeds, image| needs.finest(image).unwrap_or(u32::MAX);
        let images = self.finest.len().max(other.finest.len());
        (0..images).all(|image| finest(self, image) <= finest(other, image))
    }

    /// Maximum size of images that are decoded at the same time, bytes.
    fn decoding(&self) -> u64 {
        self.limit.map_or(1 << 30, |limit| (limit / 32).max(256 << 20))
    }
}

/// Statistics of the images of textures.
#[derive(Clone, Debug, Default)]
pub struct TextureReport {
    /// Number of images decoded before rendering.
    pub decoded: u64,
    /// Number of images not decoded, since nothing in the picture needs them.
    pub unneeded: u64,
    /// Number of images whose finest levels were omitted.
    pub reduced: u64,
    /// Number of images with needed levels that are compressed.
    pub paged: u64,
    /// Size of levels in memory, including images that the scene itself holds decoded, bytes.
    pub bytes: u64,
    /// Size of levels in the temporary file, bytes.
    pub file_bytes: u64,
    /// Uncompressed size of all levels of all images, bytes.
    pub all_bytes: u64,
    /// Warnings about image contents and damaged images.
    pub warnings: Vec<Warning>,
}

impl TextureReport {
    /// Messages about images and levels that were omitted, with the memory used.
    pub fn left_out(&self) -> Vec<String> {
        const MIB: f64 = 1_048_576.0;
        let mut list = Vec::new();
        if self.unneeded > 0 {
            list.push(format!("{} texture images: not decoded, as no object uses them", self.unneeded));
        }
        if self.reduced > 0 {
            let (all, kept) = (self.all_bytes as f64 / MIB, self.bytes as f64 / MIB);
            list.push(format!(
            "mip levels of {} texture images finer than the picture resolves: {kept:.1} of {all:.1} MiB are kept",
                self.reduced
                ));
        }
        list
    }
}

/// The mip levels of an image that textures use.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    /// Level 0, the image itself.
    pub finest: Level,
    /// The coarser levels; empty unless a texture uses trilinear interpolation.
    pub coarser: Arc<[Level]>,
}

impl Levels {
    #[cfg(test)]
    pub fn resident(image: Image, has_pyramid: bool) -> Levels {
        let count = if has_pyramid { usize::MAX } else { 1 };
        let mut levels = mip_levels(Some(image)).take(count).map(Level::resident);
        Levels { finest: levels.next().expect("the image itself"), coarser: levels.collect() }
    }

    fn all(&self) -> impl Iterator<Item = &Level> {
        std::iter::once(&self.finest).chain(&*self.coarser)
    }

    /// Size in memory, bytes.
    fn bytes(&self) -> u64 {
        // All compressed levels share one [`PagedImage`].
        let paged = self.all().find_map(|level| level.paged.as_ref());
        let packed = paged.map_or(0, |paged| paged.image.bytes());
        (packed + self.all().map(Level::bytes).sum::<usize>()) as u64
    }
}

/// The images that textures use.
#[derive(Clone, Debug, Default)]
pub(super) struct Images {
    /// By image; `None` for damaged images.
    pub levels: BTreeMap<ImageId, Option<Levels>>,
    /// Storage of levels that are not resident.
    store: Option<Arc<Store>>,
    /// The needs that the levels were built for.
    pub needs: TextureNeeds,
}

impl Images {
    /// Statistics of decoding on demand so far.
    pub fn on_demand(&self) -> TexturesOnDemand {
        self.store.as_ref().map_or_else(TexturesOnDemand::default, |store| store.on_demand())
    }

    /// Size of all levels in memory, bytes.
    pub fn bytes(&self) -> u64 {
        self.levels.values().flatten().map(Levels::bytes).sum()
    }

    /// The levels of an image, if they suffice for the needs.
    fn sufficient(&self, id: ImageId, needs: &TextureNeeds) -> Option<&Option<Levels>> {
        let finest = |needs: &TextureNeeds| needs.finest(id.index()).unwrap_or(u32::MAX);
        self.levels
            .get(&id)
            .filter(|_| self.needs.limit == needs.limit && finest(&self.needs) <= finest(needs))
    }
}

/// Builds the levels of all images that textures use, reusing those of an `earlier` picture of the same textures and images.
pub(super) fn build_all(
    earlier: Option<Images>,
    (textures, images): (&[Texture], &[Image]),
    mut needs: TextureNeeds,
    report: &mut TextureReport,
) -> Result<Images, Error> {
    let earlier = earlier.unwrap_or_default();
    let mut plans = plans(textures, images, &needs);
    let resident = fit_into_limit(&mut plans, needs.limit);
    count_images(&plans, report);
    let left = needs.limit.map_or(u64::MAX, |limit| limit.saturating_sub(resident));
    let new_store = || Arc::new(Store::new(left, needs.decoding()));
    let store = earlier.store.clone().unwrap_or_else(new_store);
    let mut levels = BTreeMap::new();
    plans.retain(|plan| match earlier.sufficient(plan.id, &needs) {
        Some(known) => {
            levels.insert(plan.id, known.clone());
            false
        }
        None => true,
    });
    let kept: Vec<ImageId> = levels.keys().copied().collect();
    for batch in batches(plans, needs.decoding()) {
        let built: Vec<_> = batch.into_par_iter().map(|group| build(group, &store)).collect();
        let (built, warnings): (Vec<_>, Vec<_>) = built.into_iter().unzip();
        report.warnings.extend(warnings.into_iter().flatten());
        for (id, built) in built.into_iter().flatten() {
            let built = match built {
                Ok(built) => Some(built),
                Err(Some(Damage::Fatal(error))) => return Err(error),
                Err(Some(Damage::LeftOut(warning))) => {
                    report.warnings.push(warning);
                    None
                }
                Err(None) => None,
            };
            levels.insert(id, built);
        }
    }
    // Reused levels were built for the earlier needs.
    for id in kept {
        if let Some(finest) = needs.finest.get_mut(id.index()) {
            *finest = earlier.needs.finest(id.index());
        }
    }
    let made = Images { levels, store: Some(store), needs };
    (report.bytes, report.file_bytes) = (made.bytes(), made.on_demand().file_bytes);
    Ok(made)
}

/// Counts decoded, unneeded, reduced and paged images, and the bytes of all levels.
fn count_images(plans: &[LevelPlan], report: &mut TextureReport) {
    let count = |is_one: &dyn Fn(&LevelPlan) -> bool| plans.iter().filter(|plan| is_one(plan)).count() as u64;
    report.decoded = count(&|plan| plan.is_decoded());
    report.unneeded = count(&|plan| plan.image.is_encoded() && !plan.is_decoded());
    report.reduced = count(&|plan| plan.is_decoded() && plan.needed_from > 0);
    report.paged = count(&|plan| plan.resident_from > plan.needed_from);
    report.all_bytes = plans.iter().flat_map(|p| (0..p.sizes.len()).map(|level| p.bytes_of(level))).sum();
}

/// Which levels of an image are built, and where they are stored.
struct LevelPlan<'a> {
    id: ImageId,
    image: &'a Image,
    /// Width and height of each level that textures use.
    sizes: Vec<[u32; 2]>,
    /// The finest level that is needed, and the finest one that is resident; the number of levels if there is none.
    needed_from: usize,
    resident_from: usize,
}

impl LevelPlan<'_> {
    /// Is the image decoded before rendering?
    fn is_decoded(&self) -> bool {
        self.image.is_encoded() && self.needed_from < self.sizes.len()
    }

    fn bytes_of(&self, level: usize) -> u64 {
        let [width, height] = self.sizes[level].map(u64::from);
        let Image { width: w, height: h, .. } = *self.image;
        self.image.bytes() as u64 / (u64::from(w) * u64::from(h)).max(1) * width * height
    }

    fn resident_bytes(&self) -> u64 {
        (self.resident_from..self.sizes.len()).map(|level| self.bytes_of(level)).sum()
    }

    /// May its finest resident level be compressed, too?
    fn may_shrink(&self) -> bool {
        let last = self.sizes.len();
        self.image.is_encoded()
            && self.resident_from < last
            && (last == 1 || self.sizes[self.resident_from].iter().any(|&size| size > SIDE))
    }
}

fn plans<'a>(textures: &[Texture], images: &'a [Image], needs: &TextureNeeds) -> Vec<LevelPlan<'a>> {
    // By image: does a texture need its coarser mip levels?
    let mut uses: BTreeMap<ImageId, bool> = BTreeMap::new();
    for texture in textures {
        if let Texture::Image { image, interpolation, .. } = texture {
            *uses.entry(*image).or_default() |= *interpolation == Interpolation::Trilinear;
        }
    }
    let plan = |(id, has_pyramid): (ImageId, bool)| {
        let image = images.get(id.index()).filter(|i| (i.width, i.height) != (1, 1) || i.is_encoded())?;
        let count = if has_pyramid { usize::MAX } else { 1 };
        let sizes: Vec<[u32; 2]> = sizes(image.width, image.height).take(count).collect();
        let finest = needs.finest(id.index()).filter(|_| image.is_encoded());
        let needed_from = match (image.is_encoded(), finest) {
            (false, _) => 0,
            (true, None) => sizes.len(),
            (true, Some(finest)) => (finest as usize).min(sizes.len() - 1),
        };
        Some(LevelPlan { id, image, sizes, needed_from, resident_from: needed_from })
    };
    uses.into_iter().filter_map(plan).collect()
}

/// If all levels exceed the limit, plans to compress the largest ones until the others take at most half of it. Returns the size of the
/// resident levels, bytes.
fn fit_into_limit(plans: &mut [LevelPlan], limit: Option<u64>) -> u64 {
    let mut resident: u64 =
        plans.iter().filter(|plan| plan.image.is_encoded()).map(LevelPlan::resident_bytes).sum();
    let Some(limit) = limit.filter(|&limit| resident > limit) else { return resident };
    let largest = |plans: &[LevelPlan], i: usize| {
        plans[i].may_shrink().then(|| (plans[i].bytes_of(plans[i].resident_from), i))
    };
    let mut levels: BinaryHeap<(u64, usize)> = (0..plans.len()).filter_map(|i| largest(plans, i)).collect();
    while resident > limit / 2
        && let Some((bytes, i)) = levels.pop()
    {
        plans[i].resident_from += 1;
        resident -= bytes;
        levels.extend(largest(plans, i));
    }
    resident
}

/// Batches of images that are decoded at the same time: groups with the same pixels, as many as fit into `max_bytes`.
fn batches(plans: Vec<LevelPlan>, max_bytes: u64) -> Vec<Vec<Vec<LevelPlan>>> {
    let mut numbers: HashMap<*const (), usize> = HashMap::new();
    let mut groups: Vec<Vec<LevelPlan>> = Vec::new();
    for plan in plans {
        let pixels = Arc::as_ptr(&plan.image.pixels).cast();
        let group = *numbers.entry(pixels).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[group].push(plan);
    }
    let (mut batches, mut bytes) = (vec![Vec::new()], 0);
    for group in groups {
        // An image whose level 0 is resident takes no additional memory while it is decoded.
        let is_temporary = |plan: &LevelPlan| plan.is_decoded() && plan.resident_from > 0;
        let own = if group.iter().any(is_temporary) { group[0].image.decoding_bytes() as u64 } else { 0 };
        if bytes + own > max_bytes && bytes > 0 {
            batches.push(Vec::new());
            bytes = 0;
        }
        bytes += own;
        batches.last_mut().expect("there is a first one").push(group);
    }
    batches
}

/// The levels of an image, or the damage that prevents them, given only for the first of several images with the same pixels.
type Built = (ImageId, Result<Levels, Option<Damage>>);

/// Builds the levels of images with the same pixels, and returns warnings about these.
fn build(group: Vec<LevelPlan>, store: &Arc<Store>) -> (Vec<Built>, Vec<Warning>) {
    let mut warnings = Vec::new();
    if group.iter().any(LevelPlan::is_decoded) && group[0].image.rows().is_some() {
        return (build_by_rows(group, store, &mut warnings), warnings);
    }
    let is_needed = group.iter().any(|plan| !plan.image.is_encoded() || plan.is_decoded());
    let mut decoded = match is_needed.then(|| group[0].image.decoded(&mut warnings)).transpose() {
        Ok(decoded) => decoded,
        Err(damage) => {
            // Reported for the first image only.
            let mut damage = Some(damage);
            return (group.into_iter().map(|plan| (plan.id, Err(damage.take()))).collect(), warnings);
        }
    };
    let count = group.len();
    let mut made = Vec::with_capacity(count);
    for (i, plan) in group.into_iter().enumerate() {
        // Moved for the last image, so that the pixels are freed once its next level is built.
        let full = if i + 1 == count { decoded.take() } else { decoded.clone() };
        let encoding = plan.image.encoding;
        let full = full.map(|full| Image { encoding, name: plan.image.name.clone(), ..full });
        made.push((plan.id, Ok(build_one(&plan, full, store))));
    }
    (made, warnings)
}

fn build_one(plan: &LevelPlan, full: Option<Image>, store: &Arc<Store>) -> Levels {
    let count = plan.sizes.len();
    let mut made: Vec<Option<Image>> = Vec::with_capacity(count);
    let mut kept: Vec<(usize, PackedLevel)> = Vec::new();
    let paged = plan.image.is_encoded() && plan.resident_from > 0;
    let fallback = match &full {
        Some(full) if paged => resized(full, full.width.min(SIDE), full.height.min(SIDE), full.encoding),
        _ => plan.image.clone(),
    };
    if let Some(full) = full {
        let mut next = Some(full);
        for level in 0..count {
            let Some(image) = next.take() else { break };
            let is_resident = level >= plan.resident_from;
            if level >= plan.needed_from && !is_resident {
                kept.push((level, PackedLevel::new_by_all_threads(&image, store)));
            }
            next = (level + 1 < count).then(|| halved(&image));
            made.push(is_resident.then_some(image));
        }
    }
    assembled(plan, made, kept, fallback, store)
}

/// Builds the levels of images with the same pixels row by row while these are decoded.
fn build_by_rows(group: Vec<LevelPlan>, store: &Arc<Store>, warnings: &mut Vec<Warning>) -> Vec<Built> {
    let begin = |plan: &LevelPlan| {
        let packed = (plan.needed_from..plan.resident_from).collect();
        let resident = Some(plan.resident_from).filter(|&level| level < plan.sizes.len());
        plan.is_decoded().then(|| LevelsByRows::new(plan.image, &packed, resident, Threads::All, store))
    };
    let mut made: Vec<Option<LevelsByRows>> = group.iter().map(begin).collect();
    let take = &mut |rows: &[f32]| made.iter_mut().flatten().for_each(|levels| levels.add(rows));
    let decoded = group[0].image.rows().map(|(source, _)| source.decode_rows(true, warnings, take));
    if let Some(Err(damage)) = decoded {
        // Reported for the first image only.
        let mut damage = Some(damage);
        return group.into_iter().map(|plan| (plan.id, Err(damage.take()))).collect();
    }
    let finish = |(plan, made): (LevelPlan, Option<LevelsByRows>)| {
        let Some(levels) = made else { return (plan.id, Ok(build_one(&plan, None, store))) };
        let BuiltLevels { packed, resident, fallback } = levels.finish();
        let mut levels = vec![None; plan.resident_from];
        levels.extend(mip_levels(resident).take(plan.sizes.len() - plan.resident_from).map(Some));
        (plan.id, Ok(assembled(&plan, levels, packed, fallback, store)))
    };
    group.into_iter().zip(made).map(finish).collect()
}

/// The levels of an image, from its resident and its compressed ones.
fn assembled(
    plan: &LevelPlan,
    mut made: Vec<Option<Image>>,
    kept: Vec<(usize, PackedLevel)>,
    fallback: Image,
    store: &Arc<Store>,
) -> Levels {
    let count = plan.sizes.len();
    made.resize_with(count, || None);
    let of = Arc::new(PagedImage::new(plan.image.clone(), count, plan.resident_from, fallback, store));
    let level = |(level, image): (usize, Option<Image>)| match image {
        Some(image) => Level::resident(image),
        None => {
            let [width, height] = plan.sizes[level];
            let paged = Some(Arc::new(PagedLevel::new(&of, level, width)));
            Level { image: Image { width, height, ..plan.image.clone() }, paged }
        }
    };
    for (level, packed) in kept {
        of.keep(level, packed);
    }
    let mut levels = made.into_iter().enumerate().map(level);
    let finest = levels.next().unwrap_or_else(|| Level::resident(plan.image.clone()));
    Levels { finest, coarser: levels.collect() }
}
