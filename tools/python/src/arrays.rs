//! Numeric arguments from Python: lists, tuples and numpy arrays of any number type.

use super::errors::usage;
use numpy::{AllowTypeChange, PyArrayLike2, PyArrayMethods, PyUntypedArrayMethods};
use oscura::glam::{DAffine3, DMat3, DVec3};
use oscura::image::{Encoding, Image, Pixels};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::sync::Arc;

/// `N` numbers per row.
pub fn rows<const N: usize>(argument: &str, numbers: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; N]>> {
    let array: PyArrayLike2<'_, f32, AllowTypeChange> = numbers
        .extract()
        .map_err(|_| PyTypeError::new_err(format!("{argument} must be an array of {N} numbers per row")))?;
    let shape = array.shape();
    if shape[1] != N {
        return Err(usage(format!("{argument} has {} numbers per row instead of {N}", shape[1])));
    }
    let array = array.as_array();
    Ok(array.outer_iter().map(|row| std::array::from_fn(|i| row[i])).collect())
}

/// Rows of three indices below `count`.
pub fn triangles(numbers: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<[u32; 3]>> {
    let wrong = || PyTypeError::new_err("triangles must be an array of 3 whole numbers per row");
    let numpy = numbers.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (numbers,)).map_err(|_| wrong())?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind != "i" && kind != "u" {
        return Err(wrong());
    }
    let array: PyArrayLike2<'_, i64, AllowTypeChange> = array.extract().map_err(|_| wrong())?;
    if array.shape()[1] != 3 {
        return Err(usage(format!("triangles have {} indices per row instead of 3", array.shape()[1])));
    }
    let index = |value: i64| {
        let fits = u32::try_from(value).ok().filter(|&index| (index as usize) < count);
        fits.ok_or_else(|| usage(format!("a triangle refers to position {value} of {count}")))
    };
    let array = array.as_array();
    array.outer_iter().map(|row| Ok([index(row[0])?, index(row[1])?, index(row[2])?])).collect()
}

/// An affine transform from rows: 3 x 4, or 4 x 4 with (0, 0, 0, 1) below.
pub fn transform(matrix: Option<&Bound<'_, PyAny>>) -> PyResult<DAffine3> {
    let Some(matrix) = matrix else { return Ok(DAffine3::IDENTITY) };
    let wrong = || PyTypeError::new_err("transform must be a 3 x 4 or 4 x 4 matrix of numbers");
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = matrix.extract().map_err(|_| wrong())?;
    let is_whole = array.shape() == [4, 4];
    if !is_whole && array.shape() != [3, 4] {
        return Err(wrong());
    }
    let array = array.as_array();
    if is_whole && (0..4).any(|c| array[[3, c]] != [0.0, 0.0, 0.0, 1.0][c]) {
        return Err(usage("the last row of transform must be (0, 0, 0, 1)"));
    }
    let column = |c: usize| DVec3::new(array[[0, c]], array[[1, c]], array[[2, c]]);
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}

/// An image of H x W or H x W x C numbers, C from 1 to 4: bytes encoded as in files, floats linear.
pub fn image(name: &str, pixels: &Bound<'_, PyAny>, is_srgb: Option<bool>) -> PyResult<Image> {
    let numpy = pixels.py().import("numpy")?;
    let array = numpy.call_method1("atleast_3d", (pixels,))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let [height, width, channels] = shape[..] else {
        return Err(usage(format!("{name} has {} dimensions instead of 2 or 3", shape.len())));
    };
    if !(1..=4).contains(&channels) || width == 0 || height == 0 {
        return Err(usage(format!("{name} is {height} x {width} x {channels}; it needs 1 to 4 channels")));
    }
    let size = |edge: usize| u32::try_from(edge).map_err(|_| usage(format!("{name} is too large")));
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    let dtype: String = dtype.getattr("name")?.extract()?;
    let is_bytes = dtype == "uint8";
    if !is_bytes && kind != "f" {
        // For other integers, the value of white is unknown.
        return Err(usage(format!(
            "{name} is an array of {dtype}; give bytes (uint8), or floats of which 1 is white: numpy.float32(pixels) / 255, or / 65535"
        )));
    }
    let flat = array.call_method0("ravel")?;
    let stored = match is_bytes {
        true => Pixels::U8(flat.cast::<numpy::PyArray1<u8>>()?.to_vec()?),
        false => {
            let floats = flat.call_method1("astype", (numpy.getattr("float32")?,))?;
            Pixels::F32(floats.cast::<numpy::PyArray1<f32>>()?.to_vec()?)
        }
    };
    if is_srgb == Some(true) && !is_bytes {
        return Err(usage(format!("{name} has floats, which are linear; srgb=True is for bytes (uint8)")));
    }
    let encoding = match is_srgb.unwrap_or(is_bytes) {
        true => Encoding::Srgb,
        false => Encoding::Linear,
    };
    Ok(Image {
        name: name.to_string(),
        width: size(width)?,
        height: size(height)?,
        channels: channels as u32,
        encoding,
        pixels: Arc::new(stored),
    })
}
