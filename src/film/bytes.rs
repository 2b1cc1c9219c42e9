//! The sums of a film as bytes, and back: for files from which pictures are put together or gone on with.

use super::Film;
use super::accumulator::{Accumulator, Kept};
use super::coverage::Entry;
use super::exact::SumList;
use super::splats::Splats;
use std::io::{self, Read, Write};

impl Film {
    /// Writes the sums: all that a film of the same size and layout needs to go on.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_sums(&self, writer: &mut dyn Write) -> io::Result<()> {
        let sums = &self.sums;
        writer.write_all(&self.invalid_samples.to_le_bytes())?;
        writer.write_all(bytemuck::cast_slice(&sums.rgba))?;
        writer.write_all(bytemuck::cast_slice(&sums.rgb_low))?;
        writer.write_all(bytemuck::cast_slice(&sums.count))?;
        writer.write_all(bytemuck::cast_slice(&sums.hits))?;
        writer.write_all(bytemuck::cast_slice(&sums.first_half))?;
        sums.further.iter().try_for_each(|accumulator| accumulator.write(writer))?;
        writer.write_all(&[u8::from(self.splats.is_some())])?;
        self.splats.iter().try_for_each(|splats| splats.write(writer))
    }

    /// Reads sums that [`Film::write_sums`] wrote, in place of those that there are. Nothing is allocated beyond what the
    /// reader has.
    ///
    /// # Errors
    /// Those of the reader, and of invalid data; the film is of no use then.
    pub fn read_sums(&mut self, reader: &mut dyn Read) -> io::Result<()> {
        let mut invalid = [0u64];
        read(reader, &mut invalid)?;
        self.invalid_samples = invalid[0];
        let sums = &mut self.sums;
        read(reader, &mut sums.rgba)?;
        read(reader, &mut sums.rgb_low)?;
        read(reader, &mut sums.count)?;
        read(reader, &mut sums.hits)?;
        read(reader, &mut sums.first_half)?;
        sums.further.iter_mut().try_for_each(|accumulator| accumulator.read(reader))?;
        let mut has_splats = [0u8];
        read(reader, &mut has_splats)?;
        self.splats = None;
        if has_splats[0] != 0 {
            let mut splats = Splats::new(self.sums.count.len(), &self.layout);
            splats.read(reader)?;
            self.splats = Some(splats);
        }
        Ok(())
    }
}

impl Accumulator {
    fn write(&self, writer: &mut dyn Write) -> io::Result<()> {
        match &self.kept {
            Kept::Sums(sums) => sums.write(writer),
            Kept::Moments { sums, squares } => sums.write(writer).and_then(|()| squares.write(writer)),
            Kept::Minimum(values) | Kept::First(values) => writer.write_all(bytemuck::cast_slice(values)),
            Kept::Coverage(lists) => {
                writer.write_all(bytemuck::cast_slice(&lists.heads))?;
                writer.write_all(&(lists.entries.len() as u64).to_le_bytes())?;
                writer.write_all(bytemuck::cast_slice(&lists.entries))
            }
            Kept::Counts => Ok(()),
        }
    }

    fn read(&mut self, reader: &mut dyn Read) -> io::Result<()> {
        match &mut self.kept {
            Kept::Sums(sums) => sums.read(reader),
            Kept::Moments { sums, squares } => sums.read(reader).and_then(|()| squares.read(reader)),
            Kept::Minimum(values) | Kept::First(values) => read(reader, values),
            Kept::Coverage(lists) => {
                let mut count = [0u64];
                read(reader, &mut lists.heads)?;
                read(reader, &mut count)?;
                let length = count[0].saturating_mul(size_of::<Entry>() as u64);
                let mut entries = Vec::new();
                reader.take(length).read_to_end(&mut entries)?;
                let is_whole = entries.len() as u64 == length;
                lists.entries = bytemuck::pod_collect_to_vec(&entries);
                let is_valid = is_whole && lists.is_valid();
                is_valid.then_some(()).ok_or_else(|| io::ErrorKind::InvalidData.into())
            }
            Kept::Counts => Ok(()),
        }
    }
}

impl Splats {
    fn write(&self, writer: &mut dyn Write) -> io::Result<()> {
        writer.write_all(bytemuck::cast_slice(&self.all))?;
        writer.write_all(bytemuck::cast_slice(&self.first_half))?;
        for layer in &self.layers {
            writer.write_all(&[u8::from(layer.is_some())])?;
            layer.iter().try_for_each(|sums| sums.write(writer))?;
        }
        self.squares.iter().try_for_each(|squares| squares.write(writer))
    }

    fn read(&mut self, reader: &mut dyn Read) -> io::Result<()> {
        read(reader, &mut self.all)?;
        read(reader, &mut self.first_half)?;
        let pixels = self.all.len();
        for layer in &mut self.layers {
            let mut is_there = [0u8];
            read(reader, &mut is_there)?;
            *layer = (is_there[0] != 0).then(|| Splats::list(pixels));
            layer.iter_mut().try_for_each(|sums| sums.read(reader))?;
        }
        self.squares.iter_mut().try_for_each(|squares| squares.read(reader))
    }
}

impl SumList {
    fn write(&self, writer: &mut dyn Write) -> io::Result<()> {
        writer.write_all(bytemuck::cast_slice(&self.high))?;
        writer.write_all(bytemuck::cast_slice(&self.low))
    }

    fn read(&mut self, reader: &mut dyn Read) -> io::Result<()> {
        read(reader, &mut self.high)?;
        read(reader, &mut self.low)
    }
}

/// Fills a list.
fn read<T: bytemuck::Pod>(reader: &mut dyn Read, list: &mut [T]) -> io::Result<()> {
    reader.read_exact(bytemuck::cast_slice_mut(list))
}
