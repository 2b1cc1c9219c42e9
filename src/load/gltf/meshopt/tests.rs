//! Streams written here by hand or by small encoders, and damaged ones.

use super::*;

fn layout(mode: Mode, filter: Filter, count: usize, stride: usize) -> Layout {
    Layout { buffer: 0, offset: 0, length: 0, count, stride, mode, filter }
}

/// Writes elements in version 0 or 1 with the differences as whole bytes.
fn encode(elements: &[u8], stride: usize, version: u8) -> Vec<u8> {
    let mut stream = vec![0xa0 | version];
    let most = ((8192 / stride) & !15).min(256);
    let mut last = vec![0u8; stride];
    for block in elements.chunks(most * stride) {
        let count = block.len() / stride;
        if version == 1 {
            stream.extend(vec![0b1111_1111; stride / 4]);
        }
        for k in 0..stride {
            let mut deltas: Vec<u8> = Vec::new();
            for element in block.chunks(stride) {
                let d = element[k].wrapping_sub(last[k]);
                deltas.push(if d & 0x80 == 0 { d << 1 } else { !(d << 1) });
                last[k] = element[k];
            }
            if version == 0 {
                deltas.resize(count.next_multiple_of(16), 0);
                stream.extend(vec![0xff; (deltas.len() / 16).div_ceil(4)]);
            }
            stream.extend(deltas);
        }
    }
    let used = stride + if version == 1 { stride / 4 } else { 0 };
    stream.extend(vec![0; if version == 0 { 32 } else { 24 }.max(used)]);
    stream
}

#[test]
fn attributes_of_all_sizes_come_back() {
    for version in [0, 1] {
        for (count, stride) in [(1, 4), (16, 4), (17, 12), (256, 16), (300, 64), (700, 256)] {
            let elements: Vec<u8> = (0..count * stride).map(|i| (i * i / 7 + i) as u8).collect();
            let stream = encode(&elements, stride, version);
            let decoded = layout(Mode::Attributes, Filter::None, count, stride).decode(&stream);
            assert_eq!(decoded.as_ref(), Ok(&elements), "{count} of {stride}");
            for cut in [0, 1, 5, stream.len() / 2, stream.len() - 1] {
                assert!(
                    layout(Mode::Attributes, Filter::None, count, stride).decode(&stream[..cut]).is_err()
                );
            }
            let mut longer = stream.clone();
            longer.push(0);
            assert!(layout(Mode::Attributes, Filter::None, count, stride).decode(&longer).is_err());
        }
    }
}

/// 1-bit, 2-bit and 4-bit groups of version 1, with escapes.
#[test]
fn short_groups() {
    // Control: byte 0 mode 0, bytes 1 to 3 without data. Header: one group of 1 bit. Elements 0 and 9 escape.
    let mut stream = vec![0xa1, 0b10_10_10_00, 0b01, 0b0000_0001, 0b0000_0010, 4, 2];
    stream.extend([0; 24]);
    let decoded = layout(Mode::Attributes, Filter::None, 16, 4).decode(&stream).expect("it is whole");
    let first: Vec<u8> = decoded.chunks(4).map(|e| e[0]).collect();
    assert_eq!(first, [2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3]);
    assert!(decoded.chunks(4).all(|e| e[1..] == [0, 0, 0]));
}

/// A quad, a fan that uses the fifos, and explicit corners.
#[test]
fn triangles_by_all_codes() {
    let table = [0x00, 0x76, 0x87, 0x56, 0x67, 0x78, 0xa9, 0x86, 0x65, 0x89, 0x68, 0x98, 0x01, 0x69, 0, 0];
    let mut stream = vec![0xe1];
    // 0 1 2 new; edge (2, 1) is the one before the last: with the new 3; then explicit 10 11 12 (differences 10, 1, 1);
    // then a new vertex and two recent ones by an explicit byte.
    stream.extend([0xf0, 0x10, 0xff, 0xfe]);
    stream.extend([0xff, 20, 2, 2]);
    stream.push(0x12);
    stream.extend(table);
    let decoded = layout(Mode::Triangles, Filter::None, 12, 4).decode(&stream).expect("it is whole");
    let indices: Vec<u32> = decoded.chunks(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert_eq!(indices, [0, 1, 2, 2, 1, 3, 10, 11, 12, 4, 12, 11]);
    let short = layout(Mode::Triangles, Filter::None, 12, 2).decode(&stream).expect("it is whole");
    assert_eq!(short.len(), 24);
    // An edge before there is one.
    let mut broken = vec![0xe1, 0x00];
    broken.extend(table);
    assert!(layout(Mode::Triangles, Filter::None, 3, 4).decode(&broken).is_err());
}

#[test]
fn indices_by_two_baselines() {
    // 5 from the first, 100 from the second, 6 from the first, 99 from the second.
    let zigzag = |delta: i32| ((delta << 1) ^ (delta >> 31)) as u32;
    let code = |delta: i32, baseline: u32| zigzag(delta) << 1 | baseline;
    let mut stream = vec![0xd1];
    for v in [code(5, 0), code(100, 1), code(1, 0), code(-1, 1)] {
        let mut v = v;
        while v > 0x7f {
            stream.push(v as u8 | 0x80);
            v >>= 7;
        }
        stream.push(v as u8);
    }
    stream.extend([0; 4]);
    let decoded = layout(Mode::Indices, Filter::None, 4, 2).decode(&stream).expect("it is whole");
    assert_eq!(decoded, [5, 0, 100, 0, 6, 0, 99, 0]);
    assert!(layout(Mode::Indices, Filter::None, 5, 2).decode(&stream).is_err());
    assert!(layout(Mode::Indices, Filter::None, 3, 2).decode(&stream).is_err());
}

#[test]
fn octahedral_vectors_are_unit_vectors() {
    let mut up = [0u8, 0, 127, 5];
    filters::octahedral8(&mut up);
    assert_eq!(up, [0, 0, 127, 5]);
    // (1, 1) of the octahedron lies straight below.
    let mut down = [127u8, 127, 127, 0];
    filters::octahedral8(&mut down);
    assert_eq!(down, [0, 0, (-127i8) as u8, 0]);
    let ten_bits = [(-300i16).to_le_bytes(), 150i16.to_le_bytes(), 511i16.to_le_bytes(), 7i16.to_le_bytes()];
    let mut bytes = ten_bits.concat();
    filters::octahedral16(&mut bytes);
    let v: Vec<f32> =
        bytes.chunks(2).map(|b| f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).collect();
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    assert!((length - 1.0).abs() < 1e-4 && v[0] < 0.0 && v[1] > 0.0 && v[2] > 0.0);
    assert!((v[0] / v[1] + 2.0).abs() < 1e-3);
}

#[test]
fn quaternions_regain_their_largest_part() {
    // A quarter turn about z: (0, 0, s, s); the largest is taken to be w (component 3).
    let one = (1i16 << 11) - 1;
    let largest_3 = one & !3 | 3;
    let z = i16::try_from(2047).expect("it fits");
    let mut bytes = [0i16, 0, z, largest_3].map(i16::to_le_bytes).concat();
    filters::quaternion(&mut bytes);
    let q: Vec<i16> = bytes.chunks(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
    let s = (32767.0 * std::f32::consts::FRAC_1_SQRT_2).round() as i16;
    assert_eq!((q[0], q[1]), (0, 0));
    assert!((q[2] - s).abs() <= 1 && (q[3] - s).abs() <= 1, "{q:?}");
}

#[test]
fn exponents_scale_exactly() {
    let packed = [(-2i32 << 24) | 5, (3 << 24) | 0x00ff_ffff, 100 << 24 | 1];
    let mut bytes: Vec<u8> = packed.iter().flat_map(|v: &i32| v.to_le_bytes()).collect();
    filters::exponential(&mut bytes);
    let floats: Vec<f32> = bytes.chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert_eq!(floats, [1.25, -8.0, 2f32.powi(100)]);
}

#[test]
fn colours_come_back_from_luma() {
    // RGB (200, 100, 50) in 8 bits: Co = (r - b) / 2, Cg = (g - t) / 2 with t = b + Co, Y = t + Cg.
    let (r, g, b) = (200i32, 100, 50);
    let co = (r - b) / 2;
    let t = b + co;
    let cg = (g - t) / 2;
    let y = t + cg;
    let mut bytes = [y as u8, co as i8 as u8, cg as i8 as u8, 0x80 | 64];
    filters::color8(&mut bytes);
    assert!(
        bytes[0].abs_diff(r as u8) <= 1 && bytes[1].abs_diff(g as u8) <= 1 && bytes[2].abs_diff(b as u8) <= 1
    );
    assert_eq!(bytes[3], 128);
}
