//! Do parts make up a picture?

use super::header::{PartHeader, Region, differences};
use crate::error::{Error, Problem, Result};
use std::path::PathBuf;

/// Most items that an error lists.
const LISTED: usize = 20;

/// Samples of pixels: columns, rows, samples.
type Bounds = [(u32, u32); 3];

fn bounds(header: &PartHeader) -> Bounds {
    let Region { x0, y0, x1, y1 } = header.region;
    [(x0, x1), (y0, y1), (header.first_sample, header.end_sample)]
}

fn volume(bounds: &Bounds) -> u128 {
    bounds.iter().map(|(from, to)| u128::from(to - from)).product()
}

/// What two have in common.
fn common(a: &Bounds, b: &Bounds) -> Option<Bounds> {
    let both: Bounds = std::array::from_fn(|k| (a[k].0.max(b[k].0), a[k].1.min(b[k].1)));
    both.iter().all(|(from, to)| from < to).then_some(both)
}

fn words(&[(x0, x1), (y0, y1), (from, to)]: &Bounds) -> String {
    format!("samples {from}..{to} of the pixels {}", Region { x0, y0, x1, y1 })
}

/// Checks that all parts belong to the same picture and none has what another has. Returns what no part has.
///
/// # Errors
/// An input error that lists all that are wrong.
pub fn check_parts(parts: &[(PathBuf, PartHeader)]) -> Result<Vec<String>> {
    let Some((first_file, first)) = most_common(parts) else { return Ok(Vec::new()) };
    let foreign = parts.iter().filter_map(|(file, header)| {
        let mut different = differences(&first.identity, &header.identity);
        if (header.width, header.height, header.samples) != (first.width, first.height, first.samples)
            || header.channels != first.channels
        {
            different.push("it has other channels or numbers".to_string());
        }
        // What has no sample yet has been traced in no way.
        let is_empty = |header: &PartHeader| header.first_sample == header.end_sample;
        if header.way != first.way && !is_empty(header) && !is_empty(first) {
            different.push("its paths are traced in another way".to_string());
        }
        let what = format!("is of another picture than {}: {}", first_file.display(), different.join("; "));
        (!different.is_empty()).then(|| Problem::new(file.display().to_string(), what))
    });
    let mut problems: Vec<Problem> = foreign.collect();
    if problems.is_empty() {
        problems = overlaps(parts);
    }
    if !problems.is_empty() {
        let more = problems.len().saturating_sub(LISTED);
        problems.truncate(LISTED);
        if more > 0 {
            problems.push(Problem::new("", format!("and {more} more")));
        }
        return Err(Error::input_problems(first_file, problems));
    }
    Ok(missing(parts, first))
}

/// A part of the picture that most are of.
fn most_common(parts: &[(PathBuf, PartHeader)]) -> Option<&(PathBuf, PartHeader)> {
    let mut counts: Vec<(&(PathBuf, PartHeader), usize)> = Vec::new();
    for part in parts {
        match counts.iter_mut().find(|(other, _)| other.1.identity == part.1.identity) {
            Some((_, count)) => *count += 1,
            None => counts.push((part, 1)),
        }
    }
    counts.into_iter().rev().max_by_key(|(_, count)| *count).map(|(part, _)| part)
}

/// Pairs of parts that have something in common.
fn overlaps(parts: &[(PathBuf, PartHeader)]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (at, (file, header)) in parts.iter().enumerate() {
        for (earlier, other) in &parts[..at] {
            if let Some(both) = common(&bounds(header), &bounds(other)) {
                let message = format!("has {}, which {} has as well", words(&both), earlier.display());
                problems.push(Problem::new(file.display().to_string(), message));
            }
        }
    }
    problems
}

/// What no part has, of parts that don't overlap.
fn missing(parts: &[(PathBuf, PartHeader)], first: &PartHeader) -> Vec<String> {
    let whole = [(0, first.width), (0, first.height), (0, first.samples)];
    let all: Vec<Bounds> = parts.iter().map(|(_, header)| bounds(header)).collect();
    if all.iter().map(volume).sum::<u128>() == volume(&whole) {
        return Vec::new();
    }
    // Of the whole, take away one part after another.
    let mut left = vec![whole];
    for part in &all {
        left = left.iter().flat_map(|bounds| without(bounds, part)).collect();
    }
    let more = left.len().saturating_sub(LISTED);
    let mut list: Vec<String> = left.iter().take(LISTED).map(words).collect();
    list.extend((more > 0).then(|| format!("and {more} more")));
    list
}

/// What is left of a box without another: at most six boxes.
fn without(bounds: &Bounds, other: &Bounds) -> Vec<Bounds> {
    let Some(both) = common(bounds, other) else { return vec![*bounds] };
    let (mut left, mut rest) = (Vec::new(), *bounds);
    // Samples first, so that what is missing of whole pictures is told as such.
    for k in [2, 1, 0] {
        for (from, to) in [(rest[k].0, both[k].0), (both[k].1, rest[k].1)] {
            if from < to {
                let mut piece = rest;
                piece[k] = (from, to);
                left.push(piece);
            }
        }
        rest[k] = both[k];
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::part::{Channels, Effort, Finish, Identity};

    fn part(name: &str, region: [u32; 4], first_sample: u32, end_sample: u32) -> (PathBuf, PartHeader) {
        let [x0, y0, x1, y1] = region;
        let channels = Channels {
            aovs: Vec::new(),
            matte_levels: 6,
            light_groups: Vec::new(),
            halves: false,
            catchers: false,
            shadows_only: false,
        };
        let header = PartHeader {
            identity: Identity::from([("seed".to_string(), "0".to_string())]),
            width: 40,
            height: 30,
            samples: 32,
            region: Region { x0, y0, x1, y1 },
            first_sample,
            end_sample,
            way: None,
            channels,
            effort: Effort::default(),
            finish: Finish::default(),
            further_bytes: 0,
        };
        (name.into(), header)
    }

    #[test]
    fn what_is_missing_is_told() {
        let (left, right) = ([0, 0, 20, 30], [20, 0, 40, 30]);
        let mut parts = vec![part("a", left, 0, 32), part("b", right, 8, 32), part("c", right, 0, 8)];
        assert_eq!(check_parts(&parts).unwrap(), Vec::<String>::new());
        parts.pop();
        assert_eq!(check_parts(&parts).unwrap(), ["samples 0..8 of the pixels 20,0,40,30"]);
        parts.pop();
        assert_eq!(check_parts(&parts).unwrap(), ["samples 0..32 of the pixels 20,0,40,30"]);
        assert_eq!(check_parts(&[part("d", [5, 5, 6, 6], 8, 16)]).unwrap().len(), 6);
    }

    #[test]
    fn what_overlaps_or_is_foreign_is_refused() {
        let all = [0, 0, 40, 30];
        let error = check_parts(&[part("a", all, 0, 16), part("b", [3, 3, 5, 5], 8, 32)]).unwrap_err();
        assert!(
            error.to_string().contains("b: has samples 8..16 of the pixels 3,3,5,5, which a has"),
            "{error}"
        );
        let mut other = part("b", all, 16, 32);
        other.1.identity.insert("seed".to_string(), "1".to_string());
        let error = check_parts(&[part("a", all, 0, 16), other]).unwrap_err();
        assert!(
            error.to_string().contains("b: is of another picture than a: seed is 0 here and 1 there"),
            "{error}"
        );
    }
}
