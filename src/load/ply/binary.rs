//! Rows of binary elements, decoded from the file's bytes into one record that is used again for every row.
//!
//! `ply-rs` makes a string for every property and a list for every face, which takes most of its time.

use super::elements::{List, Record, Slot, number};
use ply_rs::ply::{ElementDef, Property, PropertyType, ScalarType};

/// A property of the rows.
struct Field<'a> {
    name: &'a str,
    data: &'a PropertyType,
    slot: Option<Slot>,
}

/// Reads all rows of an element from the front of `rest` and hands each with its number to `each`.
///
/// # Errors
/// The number of the row in which the bytes end, or whose list has an impossible length.
pub(super) fn read<E: Record>(
    rest: &mut &[u8],
    definition: &ElementDef,
    big: bool,
    mut each: impl FnMut(usize, &E),
) -> Result<(), usize> {
    let properties = definition.properties.iter();
    let fields: Vec<Field> =
        properties.map(|(name, p)| Field { name, data: &p.data_type, slot: E::slot(name) }).collect();
    let mut record = E::new();
    for row in 0..definition.count {
        for field in &fields {
            read_field(rest, field, big, &mut record).ok_or(row)?;
        }
        each(row, &record);
    }
    Ok(())
}

#[inline]
fn read_field<E: Record>(rest: &mut &[u8], field: &Field, big: bool, record: &mut E) -> Option<()> {
    match field.data {
        PropertyType::Scalar(kind) => {
            let bytes = take(rest, size(kind))?;
            if let Some(slot) = field.slot {
                record.set(slot, &scalar(kind, bytes, big));
            }
        }
        PropertyType::List(count, item) => {
            let length = match scalar(count, take(rest, size(count))?, big) {
                Property::Char(n) => usize::try_from(n).ok()?,
                Property::UChar(n) => usize::from(n),
                Property::Short(n) => usize::try_from(n).ok()?,
                Property::UShort(n) => usize::from(n),
                Property::Int(n) => usize::try_from(n).ok()?,
                Property::UInt(n) => usize::try_from(n).ok()?,
                _ => return None,
            };
            let bytes = take(rest, length.checked_mul(size(item))?)?;
            match record.list(field.name) {
                Some(List::Integers(list)) => integers(item, bytes, big, list),
                Some(List::Numbers(list)) => {
                    list.clear();
                    list.extend(bytes.chunks_exact(size(item)).map(|b| number(&scalar(item, b, big))));
                }
                None => {}
            }
        }
    }
    Some(())
}

#[inline]
fn take<'a>(rest: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    let (bytes, after) = rest.split_at_checked(length)?;
    *rest = after;
    Some(bytes)
}

/// Bytes of a number.
pub(super) fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The first `N` bytes in little-endian order; 0 where there are fewer.
#[inline]
fn ordered<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
    let mut out = bytes.first_chunk::<N>().copied().unwrap_or([0; N]);
    if big {
        out.reverse();
    }
    out
}

#[inline]
fn scalar(kind: &ScalarType, bytes: &[u8], big: bool) -> Property {
    match kind {
        ScalarType::Char => Property::Char(i8::from_le_bytes(ordered(bytes, big))),
        ScalarType::UChar => Property::UChar(u8::from_le_bytes(ordered(bytes, big))),
        ScalarType::Short => Property::Short(i16::from_le_bytes(ordered(bytes, big))),
        ScalarType::UShort => Property::UShort(u16::from_le_bytes(ordered(bytes, big))),
        ScalarType::Int => Property::Int(i32::from_le_bytes(ordered(bytes, big))),
        ScalarType::UInt => Property::UInt(u32::from_le_bytes(ordered(bytes, big))),
        ScalarType::Float => Property::Float(f32::from_le_bytes(ordered(bytes, big))),
        ScalarType::Double => Property::Double(f64::from_le_bytes(ordered(bytes, big))),
    }
}

/// Replaces the list by the integers in `bytes`. The header check refuses index lists of other types.
fn integers(kind: &ScalarType, bytes: &[u8], big: bool, list: &mut Vec<i64>) {
    fn fill<const N: usize>(list: &mut Vec<i64>, bytes: &[u8], big: bool, value: fn([u8; N]) -> i64) {
        list.clear();
        list.extend(bytes.chunks_exact(N).map(|b| value(ordered(b, big))));
    }
    match kind {
        ScalarType::Char => fill(list, bytes, big, |b| i8::from_le_bytes(b).into()),
        ScalarType::UChar => fill(list, bytes, big, |b| u8::from_le_bytes(b).into()),
        ScalarType::Short => fill(list, bytes, big, |b| i16::from_le_bytes(b).into()),
        ScalarType::UShort => fill(list, bytes, big, |b| u16::from_le_bytes(b).into()),
        ScalarType::Int => fill(list, bytes, big, |b| i32::from_le_bytes(b).into()),
        ScalarType::UInt => fill(list, bytes, big, |b| u32::from_le_bytes(b).into()),
        ScalarType::Float | ScalarType::Double => list.clear(),
    }
}
