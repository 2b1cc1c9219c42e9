//! Photometric files: IES LM-63 of 1986, 1991, 1995, 2002 and 2019, photometry of type C.
//!
//! Header lines, the last of which begins with `TILT=`, are followed by numbers: thirteen parameters of the luminaire,
//! vertical and horizontal angles (degrees), and candela values for each pair of angles, to be multiplied by the candela
//! multiplier and the two ballast factors. The TILT table (losses by orientation of the lamp) is ignored.

use crate::scene::LightProfile;

/// Maximum number of values in a file; real files have up to about ten thousand.
const MAX_NUMBERS: usize = 1 << 22;

/// Luminous efficacy of monochromatic light of 540 THz, lm/W (SI definition of the candela).
pub(super) const LUMENS_PER_WATT: f64 = 683.0;

/// The profile normalised to a maximum of 1, and its original maximum.
pub(super) fn normalized(profile: LightProfile) -> (LightProfile, f64) {
    let peak = profile.peak();
    let values = profile.values.iter().map(|value| value / peak).collect();
    (LightProfile { values, ..profile }, f64::from(peak))
}

/// Parses a profile, in candela.
///
/// # Errors
/// A message about the file.
pub(super) fn parse(bytes: &[u8]) -> Result<LightProfile, String> {
    // Header text may have any encoding.
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines().enumerate();
    let tilt = lines.find_map(|(_, line)| {
        let (key, value) = line.split_once('=')?;
        key.trim().eq_ignore_ascii_case("TILT").then(|| value.trim())
    });
    let Some(tilt) = tilt else {
        return Err("is not an IES file: no line begins with 'TILT='".into());
    };
    let mut numbers = Numbers { list: numbers(lines)?, at: 0 };
    if tilt.eq_ignore_ascii_case("INCLUDE") {
        numbers.take(1, "the geometry of its lamp")?;
        let pairs = numbers.count("tilts")?;
        numbers.take(pairs.saturating_mul(2), "tilts")?;
    }
    let header = numbers.take(3, "its header")?.to_vec();
    let multiplier = header[2];
    let (rows, columns) = (numbers.count("vertical angles")?, numbers.count("horizontal angles")?);
    let header = numbers.take(8, "its header")?.to_vec();
    if header[0] != 1.0 {
        let message = "has photometry of type {}, but only type C (1) is supported";
        return Err(message.replace("{}", &header[0].to_string()));
    }
    let factor = multiplier * header[5] * header[6];
    let vertical_deg = angles(numbers.take(rows, "vertical angles")?, "vertical")?;
    let mut horizontal_deg = angles(numbers.take(columns, "horizontal angles")?, "horizontal")?;
    let candela = numbers.take(rows.saturating_mul(columns), "candela values")?;
    let mut values: Vec<f32> = candela.iter().map(|c| (c * factor) as f32).collect();
    let [first, last] = [horizontal_deg[0], horizontal_deg[columns - 1]];
    // Some files omit the horizontal angle 360, which equals 0.
    let widest = horizontal_deg.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
    let is_open = last > 180.0 && last < 360.0 && columns > 2 && 360.0 - last <= 1.5 * widest;
    if first == 0.0 && is_open {
        horizontal_deg.push(360.0);
        values.extend_from_within(..rows);
    } else if !(first == 0.0 && [0.0, 90.0, 180.0, 360.0].contains(&last) || first == 90.0 && last == 270.0) {
        let message = "must go from 0 to 0, 90, 180 or 360, or from 90 to 270 degrees";
        return Err(format!("has horizontal angles from {first} to {last}, which {message}"));
    }
    let profile = LightProfile { vertical_deg, horizontal_deg, values };
    match profile.is_valid() && profile.peak() > 0.0 {
        true => Ok(profile),
        false => Err("has candela values that are negative, too large, or all 0".into()),
    }
}

/// All remaining numbers, separated by white space or commas.
fn numbers<'t>(lines: impl Iterator<Item = (usize, &'t str)>) -> Result<Vec<f64>, String> {
    let mut list = Vec::new();
    for (index, line) in lines {
        let words = line.split(|c: char| c.is_whitespace() || c == ',' || c == '\u{1a}');
        for word in words.filter(|word| !word.is_empty()) {
            let Some(number) = word.parse::<f64>().ok().filter(|n| n.is_finite()) else {
                let shown: String = word.chars().take(20).collect();
                return Err(format!("has '{shown}' instead of a number in line {}", index + 1));
            };
            list.push(number);
            if list.len() > MAX_NUMBERS {
                return Err(format!("has more than {MAX_NUMBERS} numbers"));
            }
        }
    }
    Ok(list)
}

/// A cursor over the numbers.
struct Numbers {
    list: Vec<f64>,
    at: usize,
}

impl Numbers {
    fn take(&mut self, count: usize, what: &str) -> Result<&[f64], String> {
        let remaining = &self.list[self.at..];
        let Some(taken) = remaining.get(..count) else {
            return Err(format!("ends too early: it has {} of {count} numbers for {what}", remaining.len()));
        };
        self.at += count;
        Ok(taken)
    }

    /// A count, at least 1.
    fn count(&mut self, what: &str) -> Result<usize, String> {
        let number = self.take(1, what)?[0];
        match number.fract() == 0.0 && (1.0..=MAX_NUMBERS as f64).contains(&number) {
            true => Ok(number as usize),
            false => Err(format!("declares {number} {what}")),
        }
    }
}

fn angles(list: &[f64], what: &str) -> Result<Vec<f32>, String> {
    let max_angle = if what == "vertical" { 180.0 } else { 360.0 };
    let list: Vec<f32> = list.iter().map(|x| *x as f32).collect();
    let increase = list.windows(2).all(|w| w[0] < w[1]);
    match increase && list[0] >= 0.0 && list[list.len() - 1] <= max_angle {
        true => Ok(list),
        false => Err(format!("has {what} angles that do not increase from 0 to at most {max_angle} degrees")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "1 1000 2 3 2 1 2 0 0 0\n1 0.5 40\n0 45, 90\n0 90\n100 50 0\n200 100 0\n";

    #[test]
    fn all_editions_are_parsed() {
        let heads = [
            "TILT=NONE",
            "IESNA91\n[TEST] a \u{e9}\nTILT=NONE",
            "IESNA:LM-63-1995\r\n[MANUFAC] TILT\r\nTILT=NONE\r",
            "IESNA:LM-63-2002\nTILT=lamp.tlt",
            "IESNA91\n[OTHER] a=b\ntilt = none",
            "IES:LM-63-2019\n  TILT=INCLUDE\n1\n2\n0 90\n1 0.9",
        ];
        for head in heads {
            let profile = parse(format!("{head}\n{BODY}").as_bytes()).expect(head);
            assert_eq!(profile.vertical_deg, [0.0, 45.0, 90.0], "{head}");
            assert_eq!(profile.horizontal_deg, [0.0, 90.0]);
            assert_eq!(profile.values, [100.0, 50.0, 0.0, 200.0, 100.0, 0.0], "candela x 2 x 0.5");
        }
        let open =
            BODY.replace("3 2 1 2", "3 4 1 2").replace("0 90\n100", "0 90 180 270\n100") + "7 7 7 8 8 8\n";
        let closed = parse(format!("TILT=NONE\n{open}").as_bytes()).expect("it closes");
        let angles = [0.0, 90.0, 180.0, 270.0, 360.0];
        assert_eq!((closed.horizontal_deg.as_slice(), closed.values[12]), (&angles[..], 100.0));
    }

    #[test]
    fn damaged_files_are_reported() {
        let body = |from: &str, to: &str| format!("TILT=NONE\n{}", BODY.replacen(from, to, 1));
        let cases = [
            (String::new(), "TILT="),
            ("TILT=NONE".into(), "0 of 3 numbers for its header"),
            (format!("TILT=NONE\n{}", &BODY[..BODY.len() - 8]), "ends too early"),
            (body("50", "fifty"), "has 'fifty' instead of a number in line 6"),
            (body("50", "1e999"), "'1e999'"),
            (body("50", "-50"), "negative"),
            (body("3 2 1 2", "3 2 2 2"), "type 2"),
            (body("3 2 1 2", "0 2 1 2"), "0 vertical angles"),
            (body("3 2 1 2", "1e15 2 1 2"), "vertical angles"),
            (body("3 2 1 2", "3 2.5 1 2"), "2.5 horizontal angles"),
            (body("0 45, 90", "0 90 45"), "do not increase"),
            (body("0 45, 90", "0 45 270"), "at most 180"),
            (body("0 90\n100", "0 100\n100"), "from 0 to 100"),
            (body("0 90\n100", "0 200\n100"), "from 0 to 200"),
            (body("1 1000 2", "1 1000 0"), "all 0"),
            ("TILT=INCLUDE\n1\n1e6\n0 90\n".into(), "numbers for tilts"),
        ];
        for (text, words) in cases {
            let message = parse(text.as_bytes()).expect_err(words);
            assert!(message.contains(words), "'{words}' is not in: {message}");
        }
        let whole = format!("TILT=NONE\n{BODY}");
        for end in 0..whole.len() - 8 {
            assert!(parse(&whole.as_bytes()[..end]).is_err(), "{end}");
        }
    }
}
