//! Serialization of a film's sums, for partial renders and checkpoints. Each list covers the whole film, independent of bands.

use super::Film;
use super::band::Band;
use super::channel::{Accumulator, AccumulatorData};
use super::cryptomatte::{Coverage, Entry};
use super::exact_sum::SumList;
use super::splats::Splats;
use bytemuck::Pod;
use std::io::{self, Read, Write};

impl Film {
    /// Writes the sums, the complete state of a film of a given size and layout.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_sums(&self, writer: &mut dyn Write) -> io::Result<()> {
        let bands = &self.bands;
        writer.write_all(&self.invalid_samples.to_le_bytes())?;
        write(writer, bands.iter().map(|band| &band.sums.rgba[..]))?;
        write(writer, bands.iter().map(|band| &band.sums.rgb_low[..]))?;
        write(writer, bands.iter().map(|band| &band.sums.count[..]))?;
        write(writer, bands.iter().map(|band| &band.sums.hits[..]))?;
        write(writer, bands.iter().map(|band| &band.sums.first_half[..]))?;
        for channel in 0..self.layout.extra().len() {
            let parts: Vec<&Accumulator> = bands.iter().map(|band| &band.sums.extra[channel]).collect();
            write_channel(writer, &parts)?;
        }
        let splats: Vec<&Splats> = bands.iter().filter_map(|band| band.splats.as_ref()).collect();
        writer.write_all(&[u8::from(!splats.is_empty())])?;
        if splats.is_empty() { Ok(()) } else { write_splats(writer, &splats) }
    }

    /// Replaces the sums by those written by [`Film::write_sums`]. Allocates no more memory than the size of the input.
    ///
    /// # Errors
    /// Those of the reader, or invalid data; the sums are then unspecified.
    pub fn read_sums(&mut self, reader: &mut dyn Read) -> io::Result<()> {
        let mut invalid = [0u64];
        read(reader, [&mut invalid[..]])?;
        self.invalid_samples = invalid[0];
        let bands = &mut self.bands;
        read(reader, bands.iter_mut().map(|band| &mut band.sums.rgba[..]))?;
        read(reader, bands.iter_mut().map(|band| &mut band.sums.rgb_low[..]))?;
        read(reader, bands.iter_mut().map(|band| &mut band.sums.count[..]))?;
        read(reader, bands.iter_mut().map(|band| &mut band.sums.hits[..]))?;
        read(reader, bands.iter_mut().map(|band| &mut band.sums.first_half[..]))?;
        for channel in 0..self.layout.extra().len() {
            let parts = bands.iter_mut().map(|band| &mut band.sums.extra[channel]).collect();
            read_channel(reader, parts)?;
        }
        let mut has_splats = [0u8];
        read(reader, [&mut has_splats[..]])?;
        bands.iter_mut().for_each(|band| band.splats = None);
        if has_splats[0] != 0 {
            read_splats(reader, bands.iter_mut().map(|band: &mut Band| band.splats(&self.layout)).collect())?;
        }
        Ok(())
    }
}

fn write_channel(writer: &mut dyn Write, parts: &[&Accumulator]) -> io::Result<()> {
    let all = |list: fn(&AccumulatorData) -> Option<&SumList>| {
        parts.iter().filter_map(move |part| list(&part.data))
    };
    write_sums(writer, all(sums))?;
    write_sums(writer, all(squares))?;
    write(writer, parts.iter().filter_map(|part| values(&part.data)))?;
    let lists: Vec<&Coverage> = parts.iter().filter_map(|part| coverage(&part.data)).collect();
    if lists.is_empty() {
        return Ok(());
    }
    let Coverage { heads, entries } = Coverage::joined(&lists);
    write(writer, [&heads[..]])?;
    writer.write_all(&(entries.len() as u64).to_le_bytes())?;
    write(writer, [&entries[..]])
}

fn read_channel(reader: &mut dyn Read, mut parts: Vec<&mut Accumulator>) -> io::Result<()> {
    read_sums(reader, &mut parts, |data| match data {
        AccumulatorData::Sums(sums) | AccumulatorData::Moments { sums, .. } => Some(sums),
        _ => None,
    })?;
    read_sums(reader, &mut parts, |data| match data {
        AccumulatorData::Moments { squares, .. } => Some(squares),
        _ => None,
    })?;
    let lists = parts.iter_mut().filter_map(|part| match &mut part.data {
        AccumulatorData::Minimum(values) | AccumulatorData::First(values) => Some(&mut values[..]),
        _ => None,
    });
    read(reader, lists)?;
    let lists = parts.iter_mut().filter_map(|part| match &mut part.data {
        AccumulatorData::Coverage(lists) => Some(lists),
        _ => None,
    });
    read_coverage(reader, lists.collect())
}

fn sums(data: &AccumulatorData) -> Option<&SumList> {
    match data {
        AccumulatorData::Sums(sums) | AccumulatorData::Moments { sums, .. } => Some(sums),
        _ => None,
    }
}

fn squares(data: &AccumulatorData) -> Option<&SumList> {
    match data {
        AccumulatorData::Moments { squares, .. } => Some(squares),
        _ => None,
    }
}

fn values(data: &AccumulatorData) -> Option<&[f32]> {
    match data {
        AccumulatorData::Minimum(values) | AccumulatorData::First(values) => Some(values),
        _ => None,
    }
}

fn coverage(data: &AccumulatorData) -> Option<&Coverage> {
    match data {
        AccumulatorData::Coverage(lists) => Some(lists),
        _ => None,
    }
}

fn read_coverage(reader: &mut dyn Read, parts: Vec<&mut Coverage>) -> io::Result<()> {
    if parts.is_empty() {
        return Ok(());
    }
    let pixels = parts.iter().map(|part| part.heads.len()).sum();
    let mut all = Coverage { heads: vec![0; pixels], entries: Vec::new() };
    let mut count = [0u64];
    read(reader, [&mut all.heads[..]])?;
    read(reader, [&mut count[..]])?;
    let length = count[0].saturating_mul(size_of::<Entry>() as u64);
    let mut entries = Vec::new();
    reader.take(length).read_to_end(&mut entries)?;
    all.entries =
        if entries.len() as u64 == length { bytemuck::pod_collect_to_vec(&entries) } else { Vec::new() };
    if entries.len() as u64 != length || !all.is_valid() {
        return Err(io::ErrorKind::InvalidData.into());
    }
    let mut from = 0;
    for part in parts {
        let pixels = part.heads.len();
        *part = all.of_pixels(from..from + pixels);
        from += pixels;
    }
    Ok(())
}

fn write_splats(writer: &mut dyn Write, parts: &[&Splats]) -> io::Result<()> {
    write(writer, parts.iter().map(|splats| &splats.all[..]))?;
    write(writer, parts.iter().map(|splats| &splats.first_half[..]))?;
    for layer in 0..parts[0].layers.len() {
        writer.write_all(&[1])?;
        write_sums(writer, parts.iter().map(|splats| &splats.layers[layer]))?;
    }
    write_sums(writer, parts.iter().filter_map(|splats| splats.squares.as_ref()))
}

fn read_splats(reader: &mut dyn Read, mut parts: Vec<&mut Splats>) -> io::Result<()> {
    read(reader, parts.iter_mut().map(|splats| &mut splats.all[..]))?;
    read(reader, parts.iter_mut().map(|splats| &mut splats.first_half[..]))?;
    for layer in 0..parts.first().map_or(0, |splats| splats.layers.len()) {
        // Earlier versions omitted empty layers.
        let mut is_present = [0u8];
        read(reader, [&mut is_present[..]])?;
        if is_present[0] != 0 {
            read_sums(reader, &mut parts, |splats| Some(&mut splats.layers[layer]))?;
        }
    }
    read_sums(reader, &mut parts, |splats| splats.squares.as_mut())
}

fn write_sums<'a>(
    writer: &mut dyn Write,
    lists: impl Iterator<Item = &'a SumList> + Clone,
) -> io::Result<()> {
    write(writer, lists.clone().map(|list| &list.high[..]))?;
    write(writer, lists.map(|list| &list.low[..]))
}

/// Reads lists of sums into the parts that have one.
fn read_sums<T: WithSums>(
    reader: &mut dyn Read,
    parts: &mut [&mut T],
    list: impl Fn(&mut T::Data) -> Option<&mut SumList>,
) -> io::Result<()> {
    read(reader, parts.iter_mut().filter_map(|part| Some(&mut list(part.data())?.high[..])))?;
    read(reader, parts.iter_mut().filter_map(|part| Some(&mut list(part.data())?.low[..])))
}

/// A type with lists of sums.
trait WithSums {
    type Data;
    fn data(&mut self) -> &mut Self::Data;
}

impl WithSums for Accumulator {
    type Data = AccumulatorData;
    fn data(&mut self) -> &mut AccumulatorData {
        &mut self.data
    }
}

impl WithSums for Splats {
    type Data = Splats;
    fn data(&mut self) -> &mut Splats {
        self
    }
}

fn write<'a, T: Pod>(writer: &mut dyn Write, lists: impl IntoIterator<Item = &'a [T]>) -> io::Result<()> {
    lists.into_iter().try_for_each(|list| writer.write_all(bytemuck::cast_slice(list)))
}

/// Fills lists with bytes of the reader.
fn read<'a, T: Pod>(reader: &mut dyn Read, lists: impl IntoIterator<Item = &'a mut [T]>) -> io::Result<()> {
    lists.into_iter().try_for_each(|list| reader.read_exact(bytemuck::cast_slice_mut(list)))
}
