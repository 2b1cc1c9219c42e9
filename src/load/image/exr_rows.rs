//! Rows of pixels of one part of an EXR file: reads and decodes only the blocks that contain them.

use super::source::Source;
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::error::{Error, Result};
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::meta::{MetaData, compute_block_count};
use exr::prelude::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io::Read;
use std::ops::Range;

/// Maximum decoded size for a single thread, bytes.
const MAX_SERIAL_BYTES: usize = 1 << 20;

/// A part of a file, at its largest resolution.
pub(super) struct Part<'a> {
    source: &'a Source<'a>,
    meta: &'a MetaData,
    index: usize,
    /// Indices of the channels to read.
    channels: Vec<usize>,
    /// Number of blocks along x and y.
    blocks: [usize; 2],
    /// File offset of each block, row by row.
    positions: Vec<u64>,
    is_sorted: bool,
}

impl<'a> Part<'a> {
    /// Opens the part at `index` of a file whose headers end at the file offset `end`.
    pub fn open(
        source: &'a Source<'a>,
        (meta, end): (&'a MetaData, u64),
        index: usize,
        channels: Vec<usize>,
    ) -> Result<Part<'a>> {
        let header = &meta.headers[index];
        let earlier: u64 = meta.headers[..index].iter().map(|header| header.chunk_count as u64).sum();
        let mut table = vec![0; header.chunk_count * 8];
        source.reader(end + earlier * 8).read_exact(&mut table)?;
        let positions: Vec<u64> =
            table.as_chunks().0.iter().map(|&bytes| u64::from_le_bytes(bytes)).collect();
        let (size, block) = (header.layer_size, header.max_block_pixel_size());
        let blocks = [compute_block_count(size.0, block.0), compute_block_count(size.1, block.1)];
        // Blocks of smaller resolutions follow.
        match positions.len() >= blocks[0] * blocks[1] {
            true => Ok(Part { source, meta, index, channels, blocks, positions, is_sorted: false }),
            false => Err(Error::Invalid("offset table".into())),
        }
    }

    fn header(&self) -> &'a Header {
        &self.meta.headers[self.index]
    }

    /// Number of rows of blocks.
    pub fn len(&self) -> usize {
        self.blocks[1]
    }

    /// Height of a row of blocks, pixels; the last may be lower.
    pub fn block_height(&self) -> usize {
        self.header().max_block_pixel_size().1
    }

    /// Decoded size of a row of blocks, bytes.
    pub fn row_bytes(&self) -> usize {
        self.header().layer_size.0
            * self.block_height().min(self.header().layer_size.1)
            * self.channels.len()
            * 4
    }

    /// Decodes rows of blocks to interleaved channels; `finish` post-processes each row of pixels. Uses all threads if
    /// `in_parallel`.
    pub fn rows(
        &mut self,
        rows: Range<usize>,
        in_parallel: bool,
        finish: impl Fn(&mut [f32]) + Sync,
    ) -> Result<Vec<f32>> {
        let (across, height, of) = (self.blocks[0], self.block_height(), self.header());
        let chunks = rows.start * across..rows.end * across;
        let chunks = chunks.map(|at| self.chunk(at)).collect::<Result<Vec<Chunk>>>()?;
        let lines = (rows.end * height).min(of.layer_size.1) - rows.start * height;
        let row_length = of.layer_size.0 * self.channels.len();
        let mut numbers = vec![0.0; lines * row_length];
        let in_parallel = in_parallel && numbers.len() * 4 > MAX_SERIAL_BYTES;
        let decompress = |chunk| decompressed(chunk, self.meta);
        let blocks: Vec<UncompressedBlock> = match in_parallel {
            true => chunks.into_par_iter().map(decompress).collect::<Result<_>>()?,
            false => chunks.into_iter().map(decompress).collect::<Result<_>>()?,
        };
        let fill = |scratch: &mut Scratch, (y, line): (usize, &mut [f32])| {
            for block in &blocks[y / height * across..][..across] {
                scratch.fill(block, of, &self.channels, y % height, line);
            }
            finish(line);
        };
        match in_parallel {
            true => {
                let lines = numbers.par_chunks_exact_mut(row_length).enumerate().with_min_len(8);
                lines.for_each_init(Scratch::default, fill);
            }
            false => {
                let mut scratch = Scratch::default();
                numbers.chunks_exact_mut(row_length).enumerate().for_each(|line| fill(&mut scratch, line));
            }
        }
        Ok(numbers)
    }

    /// A block by its index, row by row.
    fn chunk(&mut self, at: usize) -> Result<Chunk> {
        let chunk = self.read(self.positions[at])?;
        if self.block_index(&chunk)? == Some(at) {
            return Ok(chunk);
        }
        self.sort()?;
        self.read(self.positions[at])
    }

    fn read(&self, position: u64) -> Result<Chunk> {
        Chunk::read(&mut self.source.reader(position), self.meta)
    }

    /// The index of a block by the coordinates in its header; `None` if it belongs to another part or resolution.
    fn block_index(&self, chunk: &Chunk) -> Result<Option<usize>> {
        if chunk.layer_index != self.index {
            return Ok(None);
        }
        let of = self.header().get_block_data_indices(&chunk.compressed_block)?;
        let [x, y] = [of.tile_index.0, of.tile_index.1];
        let is_inside = of.is_largest_resolution_level() && x < self.blocks[0] && y < self.blocks[1];
        Ok(is_inside.then_some(y * self.blocks[0] + x))
    }

    /// Sorts the offset table by the coordinates in the blocks: some programs don't sort it.
    fn sort(&mut self) -> Result<()> {
        let mut sorted = vec![None; self.blocks[0] * self.blocks[1]];
        if !self.is_sorted {
            for &position in &self.positions {
                if let Some(at) = self.block_index(&self.read(position)?)? {
                    sorted[at] = Some(position);
                }
            }
        }
        let sorted: Option<Vec<u64>> = sorted.into_iter().collect();
        self.positions = sorted.ok_or(Error::Invalid("offset table: it lacks blocks".into()))?;
        self.is_sorted = true;
        Ok(())
    }
}

fn decompressed(chunk: Chunk, meta: &MetaData) -> Result<UncompressedBlock> {
    let block = UncompressedBlock::decompress_chunk(chunk, meta, false)?;
    let bytes = block.index.pixel_size.area() * meta.headers[block.index.layer].channels.bytes_per_pixel;
    if block.data.len() == bytes { Ok(block) } else { Err(Error::Invalid("length of a block".into())) }
}

/// Buffers for a line of a block, planar.
#[derive(Default)]
struct Scratch {
    halves: Vec<f16>,
    planes: [Vec<f32>; 4],
}

impl Scratch {
    /// Copies line `y` of a block to its position in a line of the part.
    fn fill(
        &mut self,
        block: &UncompressedBlock,
        header: &Header,
        channels: &[usize],
        y: usize,
        line: &mut [f32],
    ) {
        let (first, width) = (block.index.pixel_position.0, block.index.pixel_size.0);
        let list = &header.channels.list;
        let bytes = width * header.channels.bytes_per_pixel;
        let bytes = &block.data[y * bytes..][..bytes];
        for (c, &channel) in channels.iter().enumerate() {
            let before: usize = list[..channel].iter().map(|of| of.sample_type.bytes_per_sample()).sum();
            let kind = list[channel].sample_type;
            self.read(&bytes[width * before..][..width * kind.bytes_per_sample()], kind, c);
        }
        let line = &mut line[first * channels.len()..][..width * channels.len()];
        match channels.len() {
            1 => self.interleave::<1>(line),
            2 => self.interleave::<2>(line),
            3 => self.interleave::<3>(line),
            _ => self.interleave::<4>(line),
        }
    }

    /// Reads the samples of a channel; half floats are converted as a slice, for speed.
    fn read(&mut self, samples: &[u8], kind: SampleType, channel: usize) {
        let plane = &mut self.planes[channel];
        match kind {
            SampleType::F16 => {
                self.halves.clear();
                let halves = samples.as_chunks().0.iter().map(|&b| f16::from_bits(u16::from_ne_bytes(b)));
                self.halves.extend(halves);
                plane.resize(self.halves.len(), 0.0);
                self.halves.convert_to_f32_slice(plane);
            }
            SampleType::F32 => {
                plane.clear();
                plane.extend(samples.as_chunks().0.iter().map(|&b| f32::from_ne_bytes(b)));
            }
            SampleType::U32 => {
                plane.clear();
                plane.extend(samples.as_chunks().0.iter().map(|&b| u32::from_ne_bytes(b) as f32));
            }
        }
    }

    fn interleave<const N: usize>(&self, line: &mut [f32]) {
        let pixels = line.as_chunks_mut::<N>().0;
        let planes: [&[f32]; N] = std::array::from_fn(|c| &self.planes[c][..pixels.len()]);
        for (i, pixel) in pixels.iter_mut().enumerate() {
            for c in 0..N {
                pixel[c] = planes[c][i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::write::WritableImage;
    use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, Layers};
    use exr::meta::attribute::LineOrder;
    use exr::meta::header::{ImageAttributes, LayerAttributes};
    use exr::prelude::{Blocks, Compression, IntegerBounds, ReadChannels, ReadLayers, Vec2};
    use std::io::Cursor;
    use std::path::Path;

    const SIZE: [usize; 2] = [75, 130];

    fn samples(kind: usize, seed: u32) -> FlatSamples {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed * 977) >> 22) as f32 / 64.0;
        let values = (0..(SIZE[0] * SIZE[1]) as u32).map(value);
        match kind {
            0 => FlatSamples::F16(values.map(f16::from_f32).collect()),
            1 => FlatSamples::F32(values.collect()),
            _ => FlatSamples::U32(values.map(|v| (v * 64.0) as u32).collect()),
        }
    }

    /// A file of two parts; the second has one channel of each sample type.
    fn file(encoding: Encoding) -> Vec<u8> {
        let layer = |name: &str, kinds: [usize; 3]| {
            let channel = |(i, name): (usize, &str)| AnyChannel::new(name, samples(kinds[i], i as u32));
            let channels = ["B", "G", "R"].into_iter().enumerate().map(channel).collect();
            Layer::new(
                (SIZE[0], SIZE[1]),
                LayerAttributes::named(name),
                encoding,
                AnyChannels::sort(channels),
            )
        };
        let layers = Layers::from(vec![layer("first", [0; 3]), layer("second", [0, 1, 2])]);
        let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((SIZE[0], SIZE[1])));
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layers(attributes, layers)
            .write()
            .non_parallel()
            .to_buffered(&mut bytes)
            .expect("written");
        bytes.into_inner()
    }

    /// All rows of the second part, R, G and B, read `step` rows of blocks at a time.
    fn by_rows(bytes: &[u8], step: usize) -> Result<Vec<u32>> {
        let source = Source::new(bytes, (Path::new("a.exr"), ""), None);
        let mut head = Cursor::new(bytes);
        let meta = MetaData::read_from_buffered(&mut head, false)?;
        let mut part = Part::open(&source, (&meta, head.position()), 1, vec![2, 1, 0])?;
        let mut bits = Vec::new();
        for first in (0..part.len()).step_by(step) {
            let rows = part.rows(first..(first + step).min(part.len()), false, |_| {})?;
            bits.extend(rows.into_iter().map(f32::to_bits));
        }
        Ok(bits)
    }

    fn at_once(bytes: &[u8]) -> Vec<u32> {
        let image = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        let image =
            image.all_layers().all_attributes().from_buffered(Cursor::new(bytes)).expect("it is read");
        let list = &image.layer_data[1].channel_data.list;
        let planes: Vec<Vec<f32>> =
            [2, 1, 0].iter().map(|&c: &usize| list[c].sample_data.values_as_f32().collect()).collect();
        (0..planes[0].len()).flat_map(|i| [0, 1, 2].map(|c| planes[c][i].to_bits())).collect()
    }

    #[test]
    fn rows_of_every_layout_equal_those_of_the_crate() {
        let compressions = [
            Compression::Uncompressed,
            Compression::RLE,
            Compression::ZIP1,
            Compression::ZIP16,
            Compression::PIZ,
            Compression::PXR24,
            Compression::B44,
        ];
        for compression in compressions {
            for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(32, 24)), Blocks::Tiles(Vec2(100, 200))] {
                for line_order in [LineOrder::Increasing, LineOrder::Decreasing] {
                    let bytes = file(Encoding { compression, blocks, line_order });
                    let expected = at_once(&bytes);
                    assert_eq!(expected.len(), SIZE[0] * SIZE[1] * 3);
                    for step in [1, 3, 1000] {
                        let found = by_rows(&bytes, step).expect("it is read");
                        assert!(found == expected, "{compression:?} {blocks:?} {line_order:?} {step}");
                    }
                }
            }
        }
    }

    /// File offset and number of entries of the second part's offset table.
    fn table(bytes: &[u8]) -> (usize, usize) {
        let mut head = Cursor::new(bytes);
        let meta = MetaData::read_from_buffered(&mut head, false).expect("headers");
        let [first, second] = [0, 1].map(|part| meta.headers[part].chunk_count);
        (head.position() as usize + first * 8, second)
    }

    #[test]
    fn unsorted_offset_tables_are_repaired() {
        let blocks = Blocks::Tiles(Vec2(32, 24));
        let encoding =
            Encoding { compression: Compression::ZIP16, blocks, line_order: LineOrder::Increasing };
        let mut bytes = file(encoding);
        let expected = by_rows(&bytes, 2).expect("it is read");
        let (start, count) = table(&bytes);
        bytes[start..start + count * 8].as_chunks_mut::<8>().0.reverse();
        assert!(by_rows(&bytes, 2).expect("it is read") == expected);
        // Two entries for one block leave none for another.
        let entries = bytes[start..start + count * 8].as_chunks_mut::<8>().0;
        entries[1] = entries[2];
        assert!(by_rows(&bytes, 2).is_err());
    }

    #[test]
    fn damaged_blocks_are_errors() {
        let encoding = Encoding::FAST_LOSSLESS;
        let bytes = file(encoding);
        let (start, count) = table(&bytes);
        let position = u64::from_le_bytes(bytes[start + 8..start + 16].try_into().expect("eight")) as usize;
        assert!(count > 1);
        for byte in [position, position + 4, position + 8, position + 9] {
            let mut damaged = bytes.clone();
            damaged[byte] = 0x7f;
            damaged[byte + 3] = 0x7f;
            assert!(by_rows(&damaged, 1).is_err(), "{}", byte - position);
        }
        for length in [start, start + 9, position + 20, bytes.len() - 1] {
            assert!(by_rows(&bytes[..length], 1).is_err(), "{length}");
        }
    }
}
