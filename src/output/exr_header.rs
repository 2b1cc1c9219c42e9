//! Puts the attributes of an encoded EXR file in alphabetical order, as OpenEXR itself writes them. The encoder keeps
//! some of them in a hash map, so that without this two runs would give different bytes.

/// Magic number and version come before the attributes.
const ATTRIBUTES_START: usize = 8;

/// Of the version's bits, the one that says that there are several parts.
const IS_MULTIPART: u8 = 1 << 4;

/// Sorts the attributes of each header in place. Headers keep their length, so that the offsets that follow stay right.
/// `None` if the bytes are no such file.
pub(super) fn sort_attributes(file: &mut [u8]) -> Option<()> {
    let is_multipart = *file.get(5)? & IS_MULTIPART != 0;
    let mut at = ATTRIBUTES_START;
    loop {
        // Behind the header is a zero.
        at = sort_header(file, at)? + 1;
        if !is_multipart || *file.get(at)? == 0 {
            return Some(());
        }
    }
}

/// Sorts the attributes of the header that starts at a place; returns where it ends.
fn sort_header(file: &mut [u8], start: usize) -> Option<usize> {
    let mut attributes: Vec<(Vec<u8>, Vec<u8>)> = Vec::new();
    let mut at = start;
    while *file.get(at)? != 0 {
        let name_end = at + file[at..].iter().position(|&b| b == 0)?;
        let kind_end = name_end + 1 + file.get(name_end + 1..)?.iter().position(|&b| b == 0)?;
        let size: [u8; 4] = file.get(kind_end + 1..kind_end + 5)?.try_into().ok()?;
        let end = kind_end + 5 + usize::try_from(i32::from_le_bytes(size)).ok()?;
        attributes.push((file[at..name_end].to_vec(), file.get(at..end)?.to_vec()));
        at = end;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, bytes)| bytes).collect();
    file[start..at].copy_from_slice(&sorted);
    Some(at)
}
