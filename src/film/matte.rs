//! Ids of Cryptomatte: hashes of names (Friedman, Jones 2015, "Fully automatic id mattes with support for motion blur and
//! transparency"; Psyop's specification 1.2.0).

/// The id of a name: its hash, with an exponent that a float of these bits can have: neither zero or a tiny number, which
/// arithmetic may flush, nor infinite or no number.
pub fn matte_id(name: &str) -> u32 {
    let hash = murmur3_32(name.as_bytes());
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

/// The key of a matte in headers: seven hexadecimal digits.
pub fn matte_key(kind: &str) -> String {
    let digits = format!("{:08x}", murmur3_32(kind.as_bytes()));
    digits[..7].to_string()
}

/// Appleby's MurmurHash3_x86_32 with a seed of 0.
fn murmur3_32(bytes: &[u8]) -> u32 {
    let scrambled = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = 0u32;
    for word in words {
        hash ^= scrambled(u32::from_le_bytes(*word));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let rest = rest.iter().rev().fold(0, |k, &byte| k << 8 | u32::from(byte));
    hash ^= scrambled(rest) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// What mattes of a scene need: the ids of its objects and materials, by their numbers. Lists that no matte asks for are
/// empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MatteIds {
    /// By object.
    pub objects: Vec<u32>,
    /// By material.
    pub materials: Vec<u32>,
    /// By object: the id of its asset.
    pub assets: Vec<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vectors of the reference implementation's users, and keys that the specification and Blender's files show.
    #[test]
    fn hashes_are_the_published_ones() {
        for (text, hash) in [
            ("", 0),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur3_32(text.as_bytes()), hash, "{text}");
        }
        assert_eq!(matte_key("crypto_asset"), "28322e9");
        assert_eq!(matte_key("ViewLayer.CryptoObject"), "542cafa");
    }

    #[test]
    fn ids_are_plain_floats() {
        let mut changed = 0;
        for i in 0..20_000 {
            let (name, id) = (format!("object {i}"), matte_id(&format!("object {i}")));
            assert!(f32::from_bits(id).is_normal(), "{name}");
            changed += u32::from(id != murmur3_32(name.as_bytes()));
        }
        assert!((100..220).contains(&changed), "{changed}: 2 of 256 exponents can't be");
    }
}
