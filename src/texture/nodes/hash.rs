//! Hashes of lattice cells and of floating-point numbers: the last steps of Jenkins' lookup3 (2006, public domain), and the
//! permuted congruential generators of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering" (pcg2d, pcg3d, pcg4d).

/// A number of 0..1 from 32 bits.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    bits as f32 * (1.0 / u32::MAX as f32)
}

/// Final mixing of lookup3.
#[inline(always)]
fn finish(mut a: u32, mut b: u32, mut c: u32) -> u32 {
    c = (c ^ b).wrapping_sub(b.rotate_left(14));
    a = (a ^ c).wrapping_sub(c.rotate_left(11));
    b = (b ^ a).wrapping_sub(a.rotate_left(25));
    c = (c ^ b).wrapping_sub(b.rotate_left(16));
    a = (a ^ c).wrapping_sub(c.rotate_left(4));
    b = (b ^ a).wrapping_sub(a.rotate_left(14));
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

/// Hash of one to four words.
#[inline(always)]
pub fn hash_words<const N: usize>(words: [u32; N]) -> u32 {
    let start = 0xdead_beefu32.wrapping_add((N as u32) << 2).wrapping_add(13);
    let word = |i: usize| if i < N { words[i] } else { 0 };
    let (mut a, mut b, mut c) =
        (start.wrapping_add(word(0)), start.wrapping_add(word(1)), start.wrapping_add(word(2)));
    if N > 3 {
        a = a.wrapping_sub(c) ^ c.rotate_left(4);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(6);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(8);
        b = b.wrapping_add(a);
        a = a.wrapping_sub(c) ^ c.rotate_left(16);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(19);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(4);
        b = b.wrapping_add(a);
        a = a.wrapping_add(word(3));
    }
    finish(a, b, c)
}

/// A random number of 0..1 from the bits of one to four numbers.
#[inline(always)]
pub fn hash_floats<const N: usize>(k: [f32; N]) -> f32 {
    unit(hash_words(k.map(f32::to_bits)))
}

/// Three random numbers of 0..1 from one to four numbers.
#[inline(always)]
pub fn hash_to_vector(k: &[f32]) -> [f32; 3] {
    match *k {
        [x] => [hash_floats([x]), hash_floats([x, 1.0]), hash_floats([x, 2.0])],
        [x, y] => [hash_floats([x, y]), hash_floats([x, y, 1.0]), hash_floats([x, y, 2.0])],
        [x, y, z] => [hash_floats([x, y, z]), hash_floats([x, y, z, 1.0]), hash_floats([x, y, z, 2.0])],
        [x, y, z, w] => [hash_floats([x, y, z, w]), hash_floats([z, x, w, y]), hash_floats([w, z, y, x])],
        _ => [0.0; 3],
    }
}

/// A cell's random numbers, 0..1: `pcg2d`, `pcg3d` and `pcg4d` by the number of dimensions, on signed integers whose shifts keep the sign.
/// Loops over cells vectorise: there are no branches and no calls.
#[inline(always)]
pub fn hash_cell<const N: usize>(cell: [i32; N]) -> [f32; N] {
    let mut v = cell;
    for c in &mut v {
        *c = c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
    add_products(&mut v);
    for c in &mut v {
        *c ^= *c >> 16;
    }
    add_products(&mut v);
    let mut unit = [0.0; N];
    for i in 0..N {
        unit[i] = (v[i] & 0x7fff_ffff) as f32 * (1.0 / 0x7fff_ffff as f32);
    }
    unit
}

/// Adds products of numbers to others, in turn.
#[inline(always)]
fn add_products<const N: usize>(v: &mut [i32; N]) {
    match N {
        2 => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(1_664_525));
            v[1 % N] = v[1 % N].wrapping_add(v[0].wrapping_mul(1_664_525));
        }
        3 => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(v[2 % N]));
            v[1 % N] = v[1 % N].wrapping_add(v[2 % N].wrapping_mul(v[0]));
            v[2 % N] = v[2 % N].wrapping_add(v[0].wrapping_mul(v[1 % N]));
        }
        _ => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(v[3 % N]));
            v[1 % N] = v[1 % N].wrapping_add(v[2 % N].wrapping_mul(v[0]));
            v[2 % N] = v[2 % N].wrapping_add(v[0].wrapping_mul(v[1 % N]));
            v[3 % N] = v[3 % N].wrapping_add(v[1 % N].wrapping_mul(v[2 % N]));
        }
    }
}

/// A cell's random colour.
#[inline(always)]
pub fn cell_color<const N: usize>(cell: [i32; N]) -> [f32; 3] {
    match N {
        1 => hash_to_vector(&[cell[0] as f32]),
        2 => hash_cell([cell[0], cell[1], 0]),
        3 => hash_cell([cell[0], cell[1], cell[2 % N]]),
        _ => {
            let [x, y, z, _] = hash_cell([cell[0], cell[1 % N], cell[2 % N], cell[3 % N]]);
            [x, y, z]
        }
    }
}

/// A cell's random point of 0..1 in each dimension.
#[inline(always)]
pub fn cell_point<const N: usize>(cell: [i32; N]) -> [f32; N] {
    if N == 1 { [hash_floats([cell[0] as f32]); N] } else { hash_cell(cell) }
}
