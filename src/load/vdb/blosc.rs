//! Buffers of the library Blosc (format 1 and 2), in which OpenVDB stores values: blocks of bytes that are sorted by their position in a
//! number (byte shuffle), split by that position, and compressed with LZ4.

/// Bytes of a buffer's header.
const HEADER: usize = 16;
const SHUFFLED: u8 = 1;
const STORED: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const UNSPLIT: u8 = 0x10;
/// Only blocks of numbers up to this size are split, bytes,
const WIDEST_SPLIT: usize = 16;
/// and only if they hold this many numbers.
const SHORTEST_SPLIT: usize = 128;

/// Unpacks a buffer that holds `wanted` bytes; an error is a sentence.
pub(super) fn unpack(packed: &[u8], wanted: usize) -> Result<Vec<u8>, String> {
    if packed.len() < HEADER {
        return Err(DAMAGED.into());
    }
    let (flags, width) = (packed[2], usize::from(packed[3]).max(1));
    let [length, block] = [4, 8].map(|at| word(packed, at).unwrap_or(0) as usize);
    if length != wanted || block == 0 {
        return Err(DAMAGED.into());
    }
    if flags & STORED != 0 {
        let stored = packed.get(HEADER..HEADER + length).ok_or(DAMAGED)?;
        return Ok(stored.to_vec());
    }
    let codec = flags >> 5;
    if codec != 1 || flags & BITS_SHUFFLED != 0 {
        let name = ["BloscLZ", "LZ4", "Snappy", "zlib", "Zstandard"].get(usize::from(codec));
        let name = name.copied().unwrap_or("an unknown codec");
        return Err(format!(
            "is compressed by {name} within Blosc, of which only LZ4 with byte shuffle is supported"
        ));
    }
    let mut unpacked = Vec::with_capacity(length);
    for (number, start) in (0..length).step_by(block).enumerate() {
        let size = block.min(length - start);
        let at = word(packed, HEADER + 4 * number).ok_or(DAMAGED)? as usize;
        let is_split = flags & UNSPLIT == 0
            && width <= WIDEST_SPLIT
            && block / width >= SHORTEST_SPLIT
            && size == block
            && size.is_multiple_of(width);
        let bytes = unpack_block(packed, at, size, if is_split { width } else { 1 })?;
        match flags & SHUFFLED != 0 && width > 1 {
            true => unshuffle(&bytes, width, &mut unpacked),
            false => unpacked.extend(bytes),
        }
    }
    Ok(unpacked)
}

const DAMAGED: &str = "holds a damaged Blosc buffer";

fn word(packed: &[u8], at: usize) -> Option<u32> {
    let bytes = packed.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

/// A block of `pieces`, each after its length.
fn unpack_block(packed: &[u8], mut at: usize, size: usize, pieces: usize) -> Result<Vec<u8>, String> {
    let piece = size / pieces;
    let mut bytes = Vec::with_capacity(size);
    for _ in 0..pieces {
        let length = word(packed, at).ok_or(DAMAGED)? as usize;
        let end = (at + 4).checked_add(length).ok_or(DAMAGED)?;
        let source = packed.get(at + 4..end).ok_or(DAMAGED)?;
        let wanted = bytes.len() + piece;
        match length == piece {
            true => bytes.extend_from_slice(source),
            false => unpack_lz4(source, wanted, &mut bytes).ok_or(DAMAGED)?,
        }
        at = end;
    }
    Ok(bytes)
}

/// Appends a block of LZ4 (its "block format") until there are `wanted` bytes. Matches must not reach before its start.
fn unpack_lz4(mut source: &[u8], wanted: usize, out: &mut Vec<u8>) -> Option<()> {
    let first = out.len();
    let byte = |source: &mut &[u8]| {
        let (&first, rest) = source.split_first()?;
        *source = rest;
        Some(first)
    };
    loop {
        let token = byte(&mut source)?;
        let length = |nibble: u8, source: &mut &[u8]| {
            let mut length = usize::from(nibble);
            if nibble == 15 {
                loop {
                    let more = byte(source)?;
                    length += usize::from(more);
                    if more != 255 {
                        break;
                    }
                }
            }
            Some(length)
        };
        let literals = length(token >> 4, &mut source)?;
        if literals > source.len() || out.len() + literals > wanted {
            return None;
        }
        let (now, rest) = source.split_at(literals);
        out.extend_from_slice(now);
        source = rest;
        if source.is_empty() {
            return (out.len() == wanted).then_some(());
        }
        let (low, rest) = source.split_first_chunk::<2>()?;
        source = rest;
        let back = usize::from(u16::from_le_bytes(*low));
        let count = length(token & 15, &mut source)? + 4;
        if back == 0 || back > out.len() - first || out.len() + count > wanted {
            return None;
        }
        for _ in 0..count {
            out.push(out[out.len() - back]);
        }
    }
}

/// Reverses the byte shuffle. Trailing bytes that make no whole number are copied.
fn unshuffle(bytes: &[u8], width: usize, out: &mut Vec<u8>) {
    let count = bytes.len() / width;
    for i in 0..count {
        out.extend((0..width).map(|k| bytes[k * count + i]));
    }
    out.extend_from_slice(&bytes[count * width..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lz4_blocks_are_unpacked() {
        // Three literals, a match of seven that overlaps itself, and two literals.
        let packed = [0x33, b'a', b'b', b'c', 3, 0, 0x20, b'x', b'y'];
        let mut out = Vec::new();
        unpack_lz4(&packed, 12, &mut out).expect("a block");
        assert_eq!(out, b"abcabcabcaxy");
        for length in 0..packed.len() {
            assert!(unpack_lz4(&packed[..length], 12, &mut Vec::new()).is_none(), "{length}");
        }
        let mut far = packed;
        far[4] = 4;
        assert!(unpack_lz4(&far, 12, &mut Vec::new()).is_none(), "a match before the beginning");
        // A long run of literals.
        let long: Vec<u8> = [0xf0, 255, 5].into_iter().chain((0..275).map(|i| i as u8)).collect();
        let mut out = Vec::new();
        unpack_lz4(&long, 275, &mut out).expect("a block");
        assert_eq!(out.len(), 275);
    }

    #[test]
    fn numbers_are_put_together() {
        let mut out = Vec::new();
        unshuffle(&[1, 2, 3, 11, 12, 13, 9], 2, &mut out);
        assert_eq!(out, [1, 11, 2, 12, 3, 13, 9]);
    }

    #[test]
    fn stored_buffers_are_copied_and_others_named() {
        let header = |flags: u8| [2, 1, flags, 4, 4, 0, 0, 0, 4, 0, 0, 0, 20, 0, 0, 0];
        let stored = [&header(STORED)[..], &[1, 2, 3, 4]].concat();
        assert_eq!(unpack(&stored, 4).expect("stored"), [1, 2, 3, 4]);
        assert!(unpack(&stored, 5).is_err() && unpack(&stored[..19], 4).is_err());
        let other = [&header(4 << 5)[..], &[0; 8]].concat();
        assert!(unpack(&other, 4).expect_err("another codec").contains("Zstandard"));
    }
}
