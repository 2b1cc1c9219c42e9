//! Rows of ascii elements, one a line.

use super::elements::{List, Record, Slot};
use super::lines::{cut, split_line};
use crate::error::Problem;
use crate::load::words::{integer, next_word};
use ply_rs::ply::{ElementDef, Property, PropertyType, ScalarType};

/// The lines of an ascii payload.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the line that was taken last, from 1.
    number: usize,
}

impl<'a> Lines<'a> {
    /// The lines of `bytes`, which follow line `before` of the file.
    pub fn new(bytes: &'a [u8], before: usize) -> Lines<'a> {
        Lines { rest: bytes, number: before }
    }

    /// The next line that isn't blank.
    fn next(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let (line, next) = split_line(self.rest);
            self.rest = &self.rest[next..];
            self.number += 1;
            let line = line.trim_ascii();
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }
}

/// Where a property goes.
enum Target<'a> {
    Scalar(&'a ScalarType, Option<Slot>),
    List(&'a str),
}

/// Reads all rows of an element and hands each with its number to `each`.
///
/// # Errors
/// The line that doesn't fit the definition, or the row in which the file ends.
pub(super) fn read<E: Record>(
    lines: &mut Lines,
    definition: &ElementDef,
    mut each: impl FnMut(usize, &E),
) -> Result<(), Problem> {
    let targets: Vec<Target> = definition
        .properties
        .iter()
        .map(|(name, p)| match &p.data_type {
            PropertyType::Scalar(kind) => Target::Scalar(kind, E::slot(name)),
            PropertyType::List(..) => Target::List(name),
        })
        .collect();
    let mut record = E::new();
    for row in 0..definition.count {
        let line = lines.next().ok_or_else(|| cut(definition, row))?;
        read_row(line, &targets, &mut record).ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(line).chars().take(60).collect();
            let message = format!("'{shown}' is not a '{}' as the header defines it", definition.name);
            Problem::new(format!("line {}", lines.number), message)
        })?;
        each(row, &record);
    }
    Ok(())
}

/// Fills the record from a line, which must hold exactly its values.
#[inline]
fn read_row<E: Record>(line: &[u8], targets: &[Target], record: &mut E) -> Option<()> {
    let mut words = Words(line);
    for target in targets {
        let word = words.next()?;
        match target {
            Target::Scalar(_, None) => {}
            Target::Scalar(kind, Some(slot)) => record.set(*slot, &scalar(kind, *slot, word)?),
            Target::List(name) => {
                let length = usize::try_from(integer(word)?).ok()?;
                match record.list(name) {
                    Some(List::Integers(list)) => {
                        list.clear();
                        for _ in 0..length {
                            list.push(integer(words.next()?)?);
                        }
                    }
                    Some(List::Numbers(list)) => {
                        list.clear();
                        for _ in 0..length {
                            list.push(std::str::from_utf8(words.next()?).ok()?.parse().ok()?);
                        }
                    }
                    None => {
                        for _ in 0..length {
                            words.next()?;
                        }
                    }
                }
            }
        }
    }
    words.next().is_none().then_some(())
}

/// The words of a line.
struct Words<'a>(&'a [u8]);

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let (word, rest) = next_word(self.0)?;
        self.0 = rest;
        Some(word)
    }
}

/// A number of a type; those of whole types that are out of range count as their type's limits.
/// Positions keep all digits that are written.
#[inline]
fn scalar(kind: &ScalarType, slot: Slot, word: &[u8]) -> Option<Property> {
    let text = std::str::from_utf8(word).ok()?;
    Some(match kind {
        ScalarType::Float if matches!(slot, Slot::Position(_)) => Property::Double(text.parse().ok()?),
        ScalarType::Float => Property::Float(text.parse().ok()?),
        ScalarType::Double => Property::Double(text.parse().ok()?),
        // `as` saturates.
        ScalarType::Char => Property::Char(whole(text)? as i8),
        ScalarType::UChar => Property::UChar(whole(text)? as u8),
        ScalarType::Short => Property::Short(whole(text)? as i16),
        ScalarType::UShort => Property::UShort(whole(text)? as u16),
        ScalarType::Int => Property::Int(whole(text)? as i32),
        ScalarType::UInt => Property::UInt(whole(text)? as u32),
    })
}

/// A whole number, also when it is written as `3.0`.
fn whole(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|v| v.is_finite())
}
