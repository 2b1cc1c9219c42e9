use super::*;

fn hair(arrays: u32, strands: u32, points: u32) -> Vec<u8> {
    let mut bytes = b"HAIR".to_vec();
    bytes.extend([strands, points, arrays, 1].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend([0.5f32, 0.0, 0.1, 0.2, 0.3].into_iter().flat_map(f32::to_le_bytes));
    bytes.resize(HEADER, b' ');
    bytes
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Two strands of three and two points, with all arrays.
fn whole() -> Vec<u8> {
    let mut bytes = hair(31, 2, 5);
    bytes.extend([2u16, 1].into_iter().flat_map(u16::to_le_bytes));
    let points: Vec<f32> = (0..15).map(|i| i as f32).collect();
    bytes.extend(floats(&points));
    bytes.extend(floats(&[0.2, 0.2, 0.1, 0.4, 0.4]));
    bytes.extend(floats(&[0.0; 5]));
    bytes.extend(floats(&[0.5; 15]));
    bytes
}

#[test]
fn text_is_read() {
    let text = "curves 1\nbasis bspline # smooth\n\n0 0 0 .1 1 0 0\n1 0 0 .1 1 0 0\n\n\n# another\n0 1 0 .2 0 1 0\n1 1 1 0 0 1 0\n";
    let file = parse(text.as_bytes()).expect("curves");
    assert_eq!((file.basis, &file.strands[..]), (Some(CurveBasis::BSpline), &[2, 2][..]));
    assert_eq!(file.points[3], [1.0; 3]);
    assert_eq!((file.radii, file.colors[2]), (vec![0.1, 0.1, 0.2, 0.0], [0.0, 1.0, 0.0]));
    let plain = parse(b"\xef\xbb\xbfcurves 1\r\n0 0 0\r\n1 0 0\r\n").expect("curves");
    assert_eq!((&plain.strands[..], plain.radii.len(), plain.basis), (&[2][..], 0, None));
    assert_eq!(parse(b"curves 1").expect("nothing"), CurveFile::default());
}

#[test]
fn hair_is_read() {
    let file = parse(&whole()).expect("hair");
    assert_eq!(file.strands, [3, 2]);
    assert_eq!((file.points[4], file.radii[4], file.colors[0]), ([12.0, 13.0, 14.0], 0.2, [0.5; 3]));
    let mut plain = hair(2, 2, 4);
    plain.extend(floats(&[1.0; 12]));
    let file = parse(&plain).expect("hair");
    assert_eq!((file.strands, file.radii, file.colors.len()), (vec![2, 2], vec![0.25; 4], 0));
}

#[test]
fn damaged_files_are_told() {
    let with = |at: usize, byte: u8| {
        let mut bytes = whole();
        bytes[at] = byte;
        bytes
    };
    let cut = |n: usize| whole()[..n].to_vec();
    let mut nan = whole();
    nan[HEADER + 4..HEADER + 8].copy_from_slice(&f32::NAN.to_le_bytes());
    for (bytes, words) in [
        (Vec::new(), "holds no curves"),
        (b"solid".to_vec(), "holds no curves"),
        (b"curves 2\n".to_vec(), "version '2'"),
        (b"curves 1\n0 0 0\n1 1\n".to_vec(), "line 3: has 2 numbers, but must have 3"),
        (b"curves 1\n0 0\n".to_vec(), "line 2: has 2 numbers, but must have 3, 4 or 7"),
        (b"curves 1\n0 0 nan\n".to_vec(), "line 2: 'nan' is no finite number"),
        (b"curves 1\n0 x 0\n".to_vec(), "line 2: 'x' is no finite number"),
        (b"curves 1\nbasis wavy\n".to_vec(), "no basis 'wavy'"),
        (b"curves 1\n\xff".to_vec(), "not UTF-8"),
        (cut(20), "has 20 bytes"),
        (cut(HEADER + 2), "within its numbers of segments"),
        (cut(HEADER + 4), "within its points"),
        (cut(HEADER + 70), "within its thicknesses"),
        (cut(whole().len() - 1), "within its colours"),
        ([&whole()[..], &[0]].concat(), "1 bytes more"),
        (with(4, 1), "strands of 3 points together"),
        (with(7, 0xff), "within its numbers of segments"),
        (with(11, 0xff), "points"),
        (with(12, 29), "has no points"),
        (nan, "points that are NaN"),
        (hair(2, u32::MAX, u32::MAX), "says 4294967295 strands"),
        (hair(2, 0, 0), ""),
    ] {
        match parse(&bytes) {
            Err(message) => assert!(message.contains(words), "{message}: {words}"),
            Ok(file) => assert!(words.is_empty() && file.strands.is_empty(), "{words}"),
        }
    }
}

/// Whatever the bytes are, there is an answer, and no more memory is taken than they are worth.
#[test]
fn any_bytes_have_an_answer() {
    let mut state = 1u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    for _ in 0..20_000 {
        let mut bytes = whole();
        for _ in 0..1 + random() % 4 {
            let at = random() as usize % bytes.len();
            bytes[at] = random() as u8;
        }
        bytes.truncate(random() as usize % (2 * bytes.len()));
        if let Ok(file) = parse(&bytes) {
            assert_eq!(file.strands.iter().sum::<u32>() as usize, file.points.len());
        }
    }
}
