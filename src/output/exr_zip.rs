//! Scan lines under ZIP, which most EXRs are: packed and compressed on all threads of the current pool, several times as fast
//! as by the crate that writes all others. The format is that of "OpenEXR File Layout" (openexr.com): chunks of scan lines, and
//! of ImfZip.cpp for what is compressed.

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::image::write::layers::WritableLayers;
use exr::image::{AnyChannels, FlatSamples, Image, Layer, Layers};
use exr::math::Vec2;
use exr::prelude::{Blocks, Compression, LineOrder};
use flate2::Compression as Level;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use std::io::{Cursor, Write};

/// A file in memory.
pub(super) type AnyImage = Image<Layers<AnyChannels<FlatSamples>>>;
type AnyLayer = Layer<AnyChannels<FlatSamples>>;

/// Of zlib's levels: passes of the Cornell box are 0.5 % larger than at 4, in less than half of the time; below 2 they are 13 %
/// larger.
const LEVEL: Level = Level::new(2);

/// Is it written here?
pub(super) fn suits(image: &AnyImage) -> bool {
    let suits = |layer: &AnyLayer| {
        let encoding = &layer.encoding;
        matches!(encoding.compression, Compression::ZIP1 | Compression::ZIP16)
            && encoding.blocks == Blocks::ScanLines
            && encoding.line_order != LineOrder::Decreasing
            && layer.channel_data.list.iter().all(|channel| channel.sampling == Vec2(1, 1))
    };
    cfg!(target_endian = "little") && image.layer_data.iter().all(suits)
}

/// Encodes a file that [suits](suits).
///
/// # Errors
/// What the crate that writes headers objects to.
pub(super) fn encode(image: &AnyImage) -> exr::error::Result<Vec<u8>> {
    let headers = image.layer_data.infer_headers(&image.attributes);
    let blocks: Vec<(usize, usize)> = (image.layer_data.iter().enumerate())
        .flat_map(|(index, layer)| {
            (0..layer.size.height().div_ceil(lines(layer))).map(move |block| (index, block))
        })
        .collect();
    let compressed: Vec<Vec<u8>> = (blocks.par_iter())
        .map(|&(index, block)| compress(&image.layer_data[index], block))
        .collect::<std::io::Result<_>>()?;
    let mut bytes = Cursor::new(Vec::new());
    exr::block::write(&mut bytes, headers, true, |_, writer| {
        blocks.iter().zip(compressed).try_for_each(|(&(layer_index, block), compressed_pixels_le)| {
            let layer = &image.layer_data[layer_index];
            let y_coordinate = layer.attributes.layer_position.y() + (block * lines(layer)) as i32;
            let compressed_block =
                CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le });
            writer.write_chunk(block, Chunk { layer_index, compressed_block })
        })
    })?;
    Ok(bytes.into_inner())
}

/// Scan lines of a chunk.
fn lines(layer: &AnyLayer) -> usize {
    if layer.encoding.compression == Compression::ZIP1 { 1 } else { 16 }
}

/// A chunk as it stands in the file: compressed where that is smaller.
fn compress(layer: &AnyLayer, block: usize) -> std::io::Result<Vec<u8>> {
    let (width, first) = (layer.size.width(), block * lines(layer));
    let mut plain = Vec::new();
    for y in first..(first + lines(layer)).min(layer.size.height()) {
        let row = y * width..(y + 1) * width;
        for channel in &layer.channel_data.list {
            match &channel.sample_data {
                FlatSamples::F16(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
                FlatSamples::F32(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
                FlatSamples::U32(values) => {
                    plain.extend_from_slice(bytemuck::cast_slice(&values[row.clone()]))
                }
            }
        }
    }
    let mut encoder = ZlibEncoder::new(Vec::with_capacity(plain.len() / 2), LEVEL);
    encoder.write_all(&differences(&apart(&plain)))?;
    let compressed = encoder.finish()?;
    Ok(if compressed.len() < plain.len() { compressed } else { plain })
}

/// The bytes at even places, then those at odd ones: samples have two or four, so their number is even.
fn apart(plain: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; plain.len()];
    let (even, odd) = bytes.split_at_mut(plain.len() / 2);
    for ((even, odd), pair) in even.iter_mut().zip(odd).zip(plain.chunks_exact(2)) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    bytes
}

/// What each byte has more than the one before, and 128.
fn differences(bytes: &[u8]) -> Vec<u8> {
    let mut list = bytes.to_vec();
    let pairs = bytes.iter().zip(&bytes[bytes.len().min(1)..]);
    for (difference, (before, own)) in list.iter_mut().skip(1).zip(pairs) {
        *difference = own.wrapping_sub(*before).wrapping_add(128);
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::{AnyChannel, Encoding};
    use exr::meta::header::{ImageAttributes, LayerAttributes};
    use exr::prelude::{ReadChannels, ReadLayers, f16};

    fn layer(size: (usize, usize), position: (i32, i32), compression: Compression, noise: u32) -> AnyLayer {
        let count = size.0 * size.1;
        let random = |i: usize| ((i as u32).wrapping_mul(2_654_435_761) >> 8) % noise;
        let channels = vec![
            AnyChannel::new(
                "A",
                FlatSamples::F16((0..count).map(|i| f16::from_f32(random(i) as f32)).collect()),
            ),
            AnyChannel::new("Z", FlatSamples::F32((0..count).map(|i| (random(i) as f32).sqrt()).collect())),
            AnyChannel::new("id", FlatSamples::U32((0..count).map(|i| random(i) << 7).collect())),
        ];
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let attributes = LayerAttributes {
            layer_name: Some(format!("layer {noise}").as_str().into()),
            layer_position: Vec2(position.0, position.1),
            ..LayerAttributes::default()
        };
        Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()))
    }

    fn read(bytes: &[u8]) -> AnyImage {
        let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
        reader.all_layers().all_attributes().from_buffered(Cursor::new(bytes)).expect("a valid file")
    }

    /// Files with smooth values, with noise that nothing compresses, of one pixel and of several parts come back.
    #[test]
    fn files_come_back() {
        for (size, position) in [((37, 33), (0, 0)), ((1, 1), (-5, 7)), ((16, 48), (3, -20))] {
            for compression in [Compression::ZIP1, Compression::ZIP16] {
                let layers = [2, 3, u32::MAX].map(|noise| layer(size, position, compression, noise));
                let image = Image::from_layers(ImageAttributes::with_size(size), layers.to_vec());
                assert!(suits(&image));
                let bytes = encode(&image).expect("it is encoded");
                let found = read(&bytes);
                for (own, other) in image.layer_data.iter().zip(&found.layer_data) {
                    assert_eq!(
                        (own.size, own.attributes.layer_position),
                        (other.size, other.attributes.layer_position)
                    );
                    assert_eq!(own.channel_data, other.channel_data);
                }
                assert_eq!(found.layer_data.len(), 3);
            }
        }
    }

    #[test]
    fn others_are_left_to_the_crate() {
        let of = |compression| {
            let layer = layer((4, 4), (0, 0), compression, 2);
            Image::from_layers(ImageAttributes::with_size((4, 4)), vec![layer])
        };
        assert!(!suits(&of(Compression::PIZ)) && !suits(&of(Compression::Uncompressed)));
        let mut tiles = of(Compression::ZIP16);
        tiles.layer_data[0].encoding.blocks = Blocks::Tiles(Vec2(2, 2));
        assert!(!suits(&tiles));
    }
}
