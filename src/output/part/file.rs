//! Reading and writing files of sums.

use super::super::atomic::write_with;
use super::header::{Behind, PartHeader};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::image::{Encoding, Image, Pixels};
use crate::scene::Backdrop;
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// What files begin with; the number is that of the format.
const MAGIC: &[u8; 16] = b"oscura part 0002";

/// Longest head.
const LONGEST_HEAD: u64 = 64 << 20;

/// All that a file holds.
pub struct PartFile {
    /// What it says about itself.
    pub header: PartHeader,
    /// The sums, at their place in the picture.
    pub film: Film,
    /// What lies behind the picture.
    pub backdrop: Option<Backdrop>,
    /// What rendering needs besides to go on.
    pub further: Vec<u8>,
}

/// Passes bytes on and keeps their checksum.
struct Checked<T> {
    inner: T,
    sum: crc32fast::Hasher,
}

impl<T> Checked<T> {
    fn new(inner: T) -> Checked<T> {
        Checked { inner, sum: crc32fast::Hasher::new() }
    }
}

impl<T: Write> Write for Checked<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Checked<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }
}

/// Writes a file of sums, whole or not at all. The header's notes on what lies behind and on what follows are made here.
///
/// # Errors
/// An output error; an older file of that name is unharmed then.
pub fn write_part(
    path: &Path,
    mut header: PartHeader,
    film: &Film,
    backdrop: Option<&Backdrop>,
    further: &[u8],
) -> Result<()> {
    header.further_bytes = further.len() as u64;
    header.finish.behind = match backdrop {
        None => Behind::Nothing,
        Some(Backdrop::Color(color)) => Behind::Color(color.map(f32::to_bits)),
        Some(Backdrop::Picture(image)) => Behind::Picture(image.width, image.height),
    };
    let head = serde_json::to_vec(&header).map_err(|e| Error::output(path, e.to_string()))?;
    write_with(path, &mut |writer| {
        let mut writer = Checked::new(writer);
        writer.write_all(MAGIC)?;
        writer.write_all(&(head.len() as u64).to_le_bytes())?;
        writer.write_all(&head)?;
        film.write_sums(&mut writer)?;
        if let Some(Backdrop::Picture(image)) = backdrop {
            let places = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
            places.map(|(x, y)| image.rgba(x, y)).try_for_each(|rgba| {
                let bytes: [[u8; 4]; 4] = rgba.map(f32::to_le_bytes);
                writer.write_all(bytes.as_flattened())
            })?;
        }
        writer.write_all(further)?;
        let sum = writer.sum.clone().finalize();
        writer.write_all(&sum.to_le_bytes())
    })
}

/// Reads the head of a file of sums. Whether the rest is there and whole, [`read_part`] finds out.
///
/// # Errors
/// An input error if it is no such file.
pub fn read_header(path: &Path) -> Result<PartHeader> {
    let opened = open(path)?;
    Ok(opened.header)
}

/// Reads a file of sums.
///
/// # Errors
/// An input error if it is none or damaged, a usage error if there is no memory for it.
pub fn read_part(path: &Path) -> Result<PartFile> {
    let Opened { mut reader, header, left } = open(path)?;
    let region = header.region;
    let layout = header.channels.layout().ok_or_else(|| damaged(path, "its channels are unknown"))?;
    let pixels = u64::from(region.width()) * u64::from(region.height());
    let behind = match header.finish.behind {
        Behind::Picture(width, height) => (u64::from(width) * u64::from(height)).checked_mul(16),
        _ => Some(0),
    };
    // Before anything is allocated by what the head says.
    let needed = pixels.checked_mul(layout.bytes_per_pixel()).and_then(|n| n.checked_add(behind?));
    let needed = needed.and_then(|n| n.checked_add(header.further_bytes));
    if needed.is_none_or(|needed| needed > left) {
        return Err(damaged(path, "it ends early"));
    }
    let mut film = Film::of_layout(region.width(), region.height(), layout)?.at(region.x0, region.y0);
    let rest = film.read_sums(&mut reader).and_then(|()| {
        let backdrop = read_backdrop(&mut reader, &header.finish.behind)?;
        let mut further = Vec::new();
        Read::by_ref(&mut reader).take(header.further_bytes).read_to_end(&mut further)?;
        let sum = reader.sum.clone().finalize();
        let mut end = Vec::new();
        Read::by_ref(&mut reader).take(5).read_to_end(&mut end)?;
        Ok((backdrop, further, end == sum.to_le_bytes()))
    });
    match rest {
        Ok((backdrop, further, true)) => Ok(PartFile { header, film, backdrop, further }),
        Ok(_) => Err(damaged(path, "its checksum is wrong")),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(damaged(path, "it ends early")),
        Err(error) => Err(damaged(path, &error.to_string())),
    }
}

/// A file behind its head.
struct Opened {
    reader: Checked<BufReader<File>>,
    header: PartHeader,
    /// Bytes that follow.
    left: u64,
}

fn open(path: &Path) -> Result<Opened> {
    let unreadable = |e: io::Error| Error::input(path, format!("can't be read: {e}"));
    let file = File::open(path).map_err(unreadable)?;
    let size = file.metadata().map_err(unreadable)?.len();
    let mut reader = Checked::new(BufReader::new(file));
    let (mut magic, mut length) = ([0; 16], [0; 8]);
    let begun = reader.read_exact(&mut magic).and_then(|()| reader.read_exact(&mut length));
    let is_part = begun.is_ok() && magic[..12] == MAGIC[..12];
    if !is_part {
        let help = "such files are written by rendering a part of a picture, or as checkpoints";
        return Err(Error::input(path, "is no file of sums").with_help(help));
    }
    if &magic != MAGIC {
        let message = "is a file of sums of another version of the program";
        return Err(Error::input(path, message).with_help("render it again"));
    }
    let length = u64::from_le_bytes(length);
    let left = size.saturating_sub(24).checked_sub(length);
    let left = left.filter(|_| length <= LONGEST_HEAD).ok_or_else(|| damaged(path, "it ends early"))?;
    let mut head = Vec::new();
    Read::by_ref(&mut reader).take(length).read_to_end(&mut head).map_err(unreadable)?;
    let header: PartHeader =
        serde_json::from_slice(&head).map_err(|e| damaged(path, &format!("its head can't be read: {e}")))?;
    check(&header).map_err(|what| damaged(path, what))?;
    Ok(Opened { reader, header, left })
}

/// Do the numbers of a head make sense together?
fn check(header: &PartHeader) -> std::result::Result<(), &'static str> {
    let PartHeader { width, height, samples, region, first_sample, end_sample, .. } = header;
    let is_within =
        region.x0 <= region.x1 && region.x1 <= *width && region.y0 <= region.y1 && region.y1 <= *height;
    let has_samples = first_sample <= end_sample && end_sample <= samples;
    let has_behind = match header.finish.behind {
        Behind::Picture(width, height) => width > 0 && height > 0,
        _ => true,
    };
    if is_within && has_samples && has_behind { Ok(()) } else { Err("its numbers make no sense") }
}

fn read_backdrop(reader: &mut dyn Read, behind: &Behind) -> io::Result<Option<Backdrop>> {
    Ok(match *behind {
        Behind::Nothing => None,
        Behind::Color(bits) => Some(Backdrop::Color(bits.map(f32::from_bits))),
        Behind::Picture(width, height) => {
            let mut pixels = vec![0.0f32; width as usize * height as usize * 4];
            reader.read_exact(bytemuck::cast_slice_mut(&mut pixels))?;
            let pixels = Arc::new(Pixels::F32(pixels));
            let name = String::new();
            Some(Backdrop::Picture(Image {
                name,
                width,
                height,
                channels: 4,
                encoding: Encoding::Linear,
                pixels,
            }))
        }
    })
}

fn damaged(path: &Path, what: &str) -> Error {
    Error::input(path, format!("is damaged: {what}")).with_help("render it again")
}
