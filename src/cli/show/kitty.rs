//! The terminal graphics protocol of kitty.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

/// Most characters of a piece.
const PIECE: usize = 4096;

/// A PNG, drawn over so many columns and rows; the terminal gives no answer.
pub(super) fn text(png: &[u8], (columns, rows): (u32, u32)) -> String {
    let encoded = STANDARD.encode(png);
    let pieces: Vec<&str> =
        encoded.as_bytes().chunks(PIECE).filter_map(|piece| std::str::from_utf8(piece).ok()).collect();
    let mut text = String::new();
    for (i, piece) in pieces.iter().enumerate() {
        let first = if i == 0 { format!("f=100,a=T,q=2,c={columns},r={rows},") } else { String::new() };
        let more = u8::from(i + 1 < pieces.len());
        // Text that grows can't fail.
        let _ = write!(text, "\x1b_G{first}m={more};{piece}\x1b\\");
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_marked() {
        let text = text(&[7; 4000], (40, 12));
        let pieces: Vec<&str> = text.trim_end().split_inclusive("\x1b\\").collect();
        assert_eq!(pieces.len(), 2);
        assert!(pieces[0].starts_with("\x1b_Gf=100,a=T,q=2,c=40,r=12,m=1;"));
        assert!(pieces[1].starts_with("\x1b_Gm=0;"));
        let data: String = pieces.iter().map(|p| p[..p.len() - 2].split(';').next_back().unwrap()).collect();
        assert_eq!(STANDARD.decode(data).unwrap(), [7; 4000]);
    }
}
