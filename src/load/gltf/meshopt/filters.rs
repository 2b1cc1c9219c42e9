//! What is done to attributes after decoding (appendix B of the specification). Each works on whole elements in place;
//! elements that no encoder writes give some value or other.

/// Unit vectors of four signed bytes, two of which hold octahedral coordinates.
pub(super) fn octahedral8(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<4>().0 {
        let [x, y, one, _] = element.map(|b| f32::from(b as i8));
        let [x, y, z] = octahedral(x, y, one).map(|v| (v * 127.0).round() as i8 as u8);
        (element[0], element[1], element[2]) = (x, y, z);
    }
}

/// The same with 16 bits.
pub(super) fn octahedral16(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let words = words(element).map(|w| w as i16);
        let [x, y, one] = [words[0], words[1], words[2]].map(f32::from);
        let [x, y, z] = octahedral(x, y, one).map(|v| (v * 32767.0).round() as i16);
        store(element, [x, y, z, words[3]].map(|w| w as u16));
    }
}

/// A point of the octahedron that is `one` high as a unit vector.
fn octahedral(x: f32, y: f32, one: f32) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // The lower half is folded outwards.
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// Unit quaternions of three components; the largest is left out and named by the last two bits.
pub(super) fn quaternion(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let words = words(element).map(|w| w as i16);
        let one = f32::from(words[3] | 3);
        let [x, y, z] =
            [words[0], words[1], words[2]].map(|c| f32::from(c) / one * std::f32::consts::FRAC_1_SQRT_2);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let largest = (words[3] & 3) as usize;
        let mut out = [0u16; 4];
        for (turn, value) in [w, x, y, z].into_iter().enumerate() {
            out[(largest + turn) % 4] = (value * 32767.0).round() as i16 as u16;
        }
        store(element, out);
    }
}

/// Floats of an 8-bit exponent above a 24-bit mantissa, both signed.
pub(super) fn exponential(bytes: &mut [u8]) {
    for word in bytes.as_chunks_mut::<4>().0 {
        let packed = i32::from_le_bytes(*word);
        // Exponents lie in -100..100, so that the product is exact.
        let (exponent, mantissa) = ((packed >> 24).clamp(-126, 127), packed << 8 >> 8);
        let scale = f32::from_bits(((exponent + 127) as u32) << 23);
        *word = (scale * mantissa as f32).to_le_bytes();
    }
}

/// Colours of four bytes: luma, two differences of colour, and alpha that also tells their number of bits.
pub(super) fn color8(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<4>().0 {
        let [y, co, cg, a] = *element;
        let rgba = color([y.into(), (co as i8).into(), (cg as i8).into(), a.into()], 255.0);
        *element = rgba.map(|v| v as u8);
    }
}

/// The same with 16 bits.
pub(super) fn color16(bytes: &mut [u8]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let [y, co, cg, a] = words(element);
        let rgba = color([y.into(), (co as i16).into(), (cg as i16).into(), a.into()], 65535.0);
        store(element, rgba.map(|v| v as u16));
    }
}

fn color([y, co, cg, a]: [i32; 4], most: f32) -> [f32; 4] {
    // The highest bit of alpha marks the number of bits.
    let scale = (1i64 << (32 - a.max(1).leading_zeros())) as i32 - 1;
    let alpha = a & (scale >> 1);
    let alpha = alpha << 1 | alpha & 1;
    let rgb = [y + co - cg, y + cg, y - co - cg];
    [rgb[0], rgb[1], rgb[2], alpha].map(|v| (v as f32 * (most / scale as f32)).round())
}

fn words(element: &[u8; 8]) -> [u16; 4] {
    std::array::from_fn(|i| u16::from_le_bytes([element[2 * i], element[2 * i + 1]]))
}

fn store(element: &mut [u8; 8], words: [u16; 4]) {
    for (out, word) in element.as_chunks_mut::<2>().0.iter_mut().zip(words) {
        *out = word.to_le_bytes();
    }
}
