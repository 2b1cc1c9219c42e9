//! Mode "attributes": elements as differences from their predecessors, byte by byte, in groups of 16.

use super::stream::Stream;

/// Elements in a group.
const GROUP: usize = 16;
/// Most bytes and most elements of a block.
const BLOCK_BYTES: usize = 8192;
const BLOCK_ELEMENTS: usize = 256;

/// How differences become values (the low four bits of a channel's mode).
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Words,
    /// Exclusive or with 32 bits that are turned left by so many.
    Xor(u32),
}

/// Decodes `count` elements of `stride` bytes, a multiple of 4.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let mut stream = Stream { bytes };
    let version = match stream.byte()? {
        0xa0 => 0,
        0xa1 => 1,
        other => return Err(format!("{other:#04x} begins no stream of attributes")),
    };
    let (used, least) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let tail = stream.tail(used.max(least))?;
    let tail = &tail[tail.len() - used..];
    let (mut previous, modes) = (tail[..stride].to_vec(), &tail[stride..]);
    let channels: Vec<Channel> = match version {
        0 => vec![Channel::Bytes; stride / 4],
        _ => modes.iter().map(|&mode| channel(mode)).collect::<Result<_, _>>()?,
    };
    let mut out = vec![0u8; count.checked_mul(stride).ok_or("it claims too many elements")?];
    let most = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK_ELEMENTS);
    let mut deltas = vec![0u8; most * stride];
    for block in out.chunks_mut(most * stride) {
        let elements = block.len() / stride;
        read_deltas(&mut stream, version, elements, stride, most, &mut deltas)?;
        for (c, &channel) in channels.iter().enumerate() {
            let lanes: [&[u8]; 4] = std::array::from_fn(|lane| &deltas[(c * 4 + lane) * most..]);
            let mut last = [0, 1, 2, 3].map(|lane| previous[c * 4 + lane]);
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                last = restore(channel, last, lanes.map(|lane| lane[i]));
                element[c * 4..c * 4 + 4].copy_from_slice(&last);
            }
            previous[c * 4..c * 4 + 4].copy_from_slice(&last);
        }
    }
    stream.finish()?;
    Ok(out)
}

fn channel(mode: u8) -> Result<Channel, String> {
    match (mode & 15, mode >> 4) {
        (0, 0) => Ok(Channel::Bytes),
        (1, 0) => Ok(Channel::Words),
        (2, turn) => Ok(Channel::Xor(u32::from(turn))),
        _ => Err(format!("{mode:#04x} is no mode of a channel")),
    }
}

/// The next value of four bytes from the last and the stored difference.
fn restore(channel: Channel, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
    match channel {
        Channel::Bytes => {
            let step = |v: u8| if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
            std::array::from_fn(|i| last[i].wrapping_add(step(delta[i])))
        }
        Channel::Words => {
            let step = |v: u16| if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
            let next = |i: usize| {
                let delta = u16::from_le_bytes([delta[i], delta[i + 1]]);
                u16::from_le_bytes([last[i], last[i + 1]]).wrapping_add(step(delta)).to_le_bytes()
            };
            let ([a, b], [c, d]) = (next(0), next(2));
            [a, b, c, d]
        }
        Channel::Xor(turn) => {
            (u32::from_le_bytes(last) ^ u32::from_le_bytes(delta).rotate_left(turn)).to_le_bytes()
        }
    }
}

/// Reads the differences of one block: those of byte position k stand from `k * lane` on.
fn read_deltas(
    stream: &mut Stream,
    version: u8,
    elements: usize,
    stride: usize,
    lane: usize,
    deltas: &mut [u8],
) -> Result<(), String> {
    let controls = if version == 0 { &[][..] } else { stream.take(stride / 4)? };
    for k in 0..stride {
        let out = &mut deltas[k * lane..][..elements.next_multiple_of(GROUP)];
        let control = controls.get(k / 4).map(|byte| byte >> (k % 4 * 2) & 3);
        let lengths = match control {
            None => [0, 2, 4, 8],
            Some(0) => [0, 1, 2, 4],
            Some(1) => [1, 2, 4, 8],
            Some(2) => {
                out.fill(0);
                continue;
            }
            Some(_) => {
                out[..elements].copy_from_slice(stream.take(elements)?);
                continue;
            }
        };
        let groups = out.len() / GROUP;
        let header = stream.take(groups.div_ceil(4))?;
        for (g, group) in out.chunks_exact_mut(GROUP).enumerate() {
            let bits = lengths[usize::from(header[g / 4] >> (g % 4 * 2) & 3)];
            read_group(stream, bits, group)?;
        }
    }
    Ok(())
}

/// Reads 16 numbers of so many bits; those with all bits set stand for a byte that follows the group.
fn read_group(stream: &mut Stream, bits: usize, out: &mut [u8]) -> Result<(), String> {
    match bits {
        0 => out.fill(0),
        8 => out.copy_from_slice(stream.take(GROUP)?),
        _ => {
            let packed = stream.take(GROUP * bits / 8)?;
            let sentinel = (1u8 << bits) - 1;
            let per_byte = 8 / bits;
            for (i, out) in out.iter_mut().enumerate() {
                // Single bits begin at a byte's low end, longer numbers at its high end.
                let place = if bits == 1 { i % 8 } else { 8 - bits - i % per_byte * bits };
                let value = packed[i / per_byte] >> place & sentinel;
                *out = if value == sentinel { stream.byte()? } else { value };
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the specification's section on mode 0.
    #[test]
    fn the_specification_s_group() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let (mut stream, mut out) = (Stream { bytes: &bytes }, [0u8; 16]);
        read_group(&mut stream, 4, &mut out).expect("it is whole");
        stream.finish().expect("all is read");
        let step = |v: &u8| if v & 1 == 0 { (v >> 1) as i8 } else { !(v >> 1) as i8 };
        let deltas: Vec<i8> = out.iter().map(step).collect();
        assert_eq!(deltas, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
    }

    #[test]
    fn channels_restore() {
        assert_eq!(restore(Channel::Bytes, [0, 1, 255, 9], [1, 2, 2, 0]), [255, 2, 0, 9]);
        // 0x00ff + 1 carries into the higher byte; the other word goes down by one.
        assert_eq!(restore(Channel::Words, [0xff, 0, 0, 0], [2, 0, 1, 0]), [0, 1, 0xff, 0xff]);
        assert_eq!(restore(Channel::Xor(4), [0x0f, 0, 0, 0], [0, 0, 0, 0x10]), [0x0e, 0, 0, 0]);
    }
}
