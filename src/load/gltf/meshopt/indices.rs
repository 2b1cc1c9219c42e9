//! Modes "triangles" and "indices".

use super::stream::Stream;

/// The last 16 things pushed, the newest first.
struct Fifo<T> {
    entries: [Option<T>; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new() -> Fifo<T> {
        Fifo { entries: [None; 16], next: 0 }
    }

    fn push(&mut self, entry: T) {
        self.entries[self.next] = Some(entry);
        self.next = (self.next + 1) % 16;
    }

    /// The entry that so many were pushed after; reading what was never written is an error.
    fn get(&self, age: u8) -> Result<T, String> {
        let at = (self.next + 15 - usize::from(age & 15)) % 16;
        self.entries[at].ok_or_else(|| "it refers to an entry before its start".to_string())
    }
}

/// The state between triangles.
struct Decoder<'s> {
    data: Stream<'s>,
    edges: Fifo<(u32, u32)>,
    vertices: Fifo<u32>,
    /// The next index that was not used before.
    next: u32,
    /// The last index written in full.
    last: u32,
}

/// Decodes a list of triangles of `count` indices, a multiple of 3.
pub(super) fn triangles(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let mut stream = Stream { bytes };
    match stream.byte()? {
        0xe1 => {}
        other => return Err(format!("{other:#04x} begins no stream of triangles")),
    }
    let table: &[u8; 16] = stream.tail(16)?.try_into().map_err(|_| "its table is cut off")?;
    let codes = stream.take(count / 3)?;
    let mut decoder = Decoder { data: stream, edges: Fifo::new(), vertices: Fifo::new(), next: 0, last: 0 };
    let mut out = Vec::with_capacity(count);
    for &code in codes {
        out.extend(decoder.triangle(code, table)?);
    }
    decoder.data.finish()?;
    Ok(out)
}

impl Decoder<'_> {
    fn triangle(&mut self, code: u8, table: &[u8; 16]) -> Result<[u32; 3], String> {
        match (code >> 4, code & 15) {
            (15, low @ (14 | 15)) => self.explicit(low == 14),
            (15, low) => {
                let entry = table[usize::from(low)];
                let a = self.fresh();
                let b = self.recent(entry >> 4)?;
                let c = self.recent(entry & 15)?;
                self.push_triangle([a, b, c], [true, entry >> 4 == 0, entry & 15 == 0])
            }
            (edge, low) => self.with_edge(edge, low),
        }
    }

    /// A triangle on an edge that was met before.
    fn with_edge(&mut self, edge: u8, low: u8) -> Result<[u32; 3], String> {
        let (a, b) = self.edges.get(edge)?;
        let (c, is_new) = match low {
            0 => (self.fresh(), true),
            13 | 14 => {
                self.last = if low == 13 { self.last.wrapping_sub(1) } else { self.last.wrapping_add(1) };
                (self.last, true)
            }
            15 => (self.written()?, true),
            _ => (self.vertices.get(low)?, false),
        };
        self.edges.push((c, b));
        self.edges.push((a, c));
        if is_new {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle whose corners are described one by one.
    fn explicit(&mut self, starts_fresh: bool) -> Result<[u32; 3], String> {
        let entry = self.data.byte()?;
        if entry == 0 {
            self.next = 0;
        }
        let a = if starts_fresh { self.fresh() } else { self.written()? };
        let mut corner = |low: u8| if low == 15 { self.written() } else { self.recent(low) };
        let (b, c) = (corner(entry >> 4)?, corner(entry & 15)?);
        let is_new = |low: u8| low == 0 || low == 15;
        self.push_triangle([a, b, c], [true, is_new(entry >> 4), is_new(entry & 15)])
    }

    fn push_triangle(&mut self, triangle: [u32; 3], is_new: [bool; 3]) -> Result<[u32; 3], String> {
        let [a, b, c] = triangle;
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        for (vertex, _) in triangle.into_iter().zip(is_new).filter(|(_, is_new)| *is_new) {
            self.vertices.push(vertex);
        }
        Ok(triangle)
    }

    /// An index not used before for 0, else one of the last vertices.
    fn recent(&mut self, low: u8) -> Result<u32, String> {
        if low == 0 { Ok(self.fresh()) } else { self.vertices.get(low - 1) }
    }

    fn fresh(&mut self) -> u32 {
        let index = self.next;
        self.next = index.wrapping_add(1);
        index
    }

    /// An index written as the difference from the last one.
    fn written(&mut self) -> Result<u32, String> {
        let v = self.data.varint()?;
        let delta = if v & 1 == 0 { v >> 1 } else { !(v >> 1) };
        self.last = self.last.wrapping_add(delta);
        Ok(self.last)
    }
}

/// Decodes `count` indices: each a difference from one of two running values.
pub(super) fn indices(bytes: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let mut stream = Stream { bytes };
    match stream.byte()? {
        0xd1 => {}
        other => return Err(format!("{other:#04x} begins no stream of indices")),
    }
    stream.tail(4)?;
    if count > stream.bytes.len() {
        return Err(format!("{count} indices don't fit into {} bytes", stream.bytes.len()));
    }
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count);
    for _ in 0..count {
        let v = stream.varint()?;
        let delta = if v & 2 == 0 { v >> 2 } else { !(v >> 2) };
        let value = &mut last[(v & 1) as usize];
        *value = value.wrapping_add(delta);
        out.push(*value);
    }
    stream.finish()?;
    Ok(out)
}
