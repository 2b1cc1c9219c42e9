//! The class of pictures: arrays by channel name, and files.

use super::choices;
use super::errors::{raised, texts, usage};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3};
use oscura::film::{Aov, Channel, Values};
use oscura::output::{OutputOptions, PngOptions, ViewTransform, check_target, encode_png, rgba8};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyIterator, PyList};
use std::path::PathBuf;

/// The name of the colour channel.
const COLOR: &str = "color";

/// A rendered picture.
#[pyclass(module = "oscura", frozen, mapping)]
pub struct Picture {
    picture: oscura::Picture,
    is_filmic: bool,
}

/// The user's name of a channel: an AOV by its name in `aovs`, others by their layer in files.
fn key(index: usize, channel: &Channel) -> String {
    let first = channel.names.first().map_or("", |name| name.as_ref());
    let aov = Aov::ALL.iter().map(|aov| aov.info()).find(|info| info.names[0] == first);
    match (index, aov) {
        (0, _) => COLOR.to_string(),
        (_, Some(info)) => info.option.to_string(),
        (_, None) => first.rsplit_once('.').map_or(first, |(layer, _)| layer).to_string(),
    }
}

/// Interleaves components: H x W x C.
fn interleaved<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    (height, width): (usize, usize),
    components: &[Vec<T>],
) -> PyResult<Bound<'py, PyAny>> {
    let count = components.len();
    let mut numbers = Vec::with_capacity(height * width * count);
    for pixel in 0..height * width {
        numbers.extend(components.iter().map(|component| component[pixel]));
    }
    let array = Array3::from_shape_vec((height, width, count), numbers);
    let array: Bound<'py, PyArray3<T>> =
        array.map_err(|_| usage("the picture is too large for an array"))?.into_pyarray(py);
    Ok(array.into_any())
}

impl Picture {
    /// A rendered picture.
    pub fn of(picture: oscura::Picture, is_filmic: bool) -> Picture {
        Picture { picture, is_filmic }
    }

    fn size(&self) -> (usize, usize) {
        (self.picture.film().height() as usize, self.picture.film().width() as usize)
    }

    fn look(
        &self,
        view: Option<&str>,
        exposure: Option<f32>,
        white_balance: Option<f32>,
    ) -> PyResult<PngOptions> {
        let usual = &self.picture.output_options().png;
        let of_scene = if self.is_filmic { ViewTransform::Filmic } else { usual.view.clone() };
        let view = view.map(choices::view).transpose()?.unwrap_or(of_scene);
        let exposure = exposure.unwrap_or(usual.exposure);
        if !(-100.0..=100.0).contains(&exposure) {
            return Err(usage("exposure must be -100 to 100 stops"));
        }
        if white_balance.is_some_and(|kelvin| !(1667.0..=25_000.0).contains(&kelvin)) {
            return Err(usage("white_balance must be 1667 to 25000 kelvin"));
        }
        Ok(PngOptions { view, exposure, white_balance: white_balance.or(usual.white_balance), ..usual.clone() })
    }
}

#[pymethods]
impl Picture {
    #[getter]
    fn width(&self) -> u32 {
        self.picture.film().width()
    }

    #[getter]
    fn height(&self) -> u32 {
        self.picture.film().height()
    }

    /// Names of the channels.
    fn keys(&self) -> Vec<String> {
        self.picture.film().channels().iter().enumerate().map(|(i, channel)| key(i, channel)).collect()
    }

    /// The component names of a channel in files.
    fn components(&self, name: &str) -> PyResult<Vec<String>> {
        let channels = self.picture.film().channels();
        let found = channels.iter().enumerate().find(|(i, channel)| key(*i, channel) == name);
        let (_, channel) = found.ok_or_else(|| self.missing(name))?;
        Ok(channel.names.iter().map(|name| name.to_string()).collect())
    }

    /// A channel as an array of H x W x C numbers, rows from the top.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let names = self.components(name)?;
        let film = self.picture.film();
        let planes: Option<Vec<Values>> =
            py.detach(|| names.iter().map(|component| film.plane(component)).collect());
        let planes = planes.ok_or_else(|| self.missing(name))?;
        let integers: Option<Vec<Vec<u32>>> = planes.iter().map(integers).collect();
        match integers {
            Some(components) => interleaved(py, self.size(), &components),
            None => {
                let components: Vec<Vec<f32>> = planes.into_iter().map(Values::into_floats).collect();
                interleaved(py, self.size(), &components)
            }
        }
    }

    fn __contains__(&self, name: &str) -> bool {
        self.keys().iter().any(|key| key == name)
    }

    fn __len__(&self) -> usize {
        self.picture.film().channels().len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.keys())?.into_any().try_iter()
    }

    /// The picture for display: H x W x 4 bytes, straight alpha.
    #[pyo3(signature = (*, view=None, exposure=None, white_balance=None, dither=false))]
    fn rgba8<'py>(
        &self,
        py: Python<'py>,
        view: Option<&str>,
        exposure: Option<f32>,
        white_balance: Option<f32>,
        dither: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options = PngOptions { dither, ..self.look(view, exposure, white_balance)? };
        let bytes = py.detach(|| rgba8(self.picture.film(), &options));
        let (height, width) = self.size();
        let array = Array3::from_shape_vec((height, width, 4), bytes);
        let array = array.map_err(|_| usage("the picture is too large for an array"))?;
        Ok(array.into_pyarray(py).into_any())
    }

    /// Writes .exr, .png, .jpg, .tif, .webp or .hdr; returns warnings about unsupported contents.
    #[pyo3(signature = (path, *, float32=false, view=None, exposure=None, white_balance=None, dither=false, deep=false))]
    #[expect(clippy::too_many_arguments, reason = "they are named in Python")]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        float32: bool,
        view: Option<&str>,
        exposure: Option<f32>,
        white_balance: Option<f32>,
        dither: bool,
        deep: bool,
    ) -> PyResult<Vec<String>> {
        let png = PngOptions { dither, deep, ..self.look(view, exposure, white_balance)? };
        let options = OutputOptions { float: float32, png, ..self.picture.output_options().clone() };
        let saved = py.detach(|| check_target(&path).and_then(|()| self.picture.save_with(&path, &options)));
        let warnings = saved.map_err(raised)?;
        Ok(texts(&warnings))
    }

    /// What was ignored, approximated or repaired.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        texts(self.picture.warnings())
    }

    /// Render statistics.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let statistics = self.picture.statistics();
        let dict = PyDict::new(py);
        dict.set_item("render_s", statistics.render_s)?;
        dict.set_item("rays", statistics.rays)?;
        dict.set_item("samples_per_pixel", statistics.samples_per_pixel)?;
        dict.set_item("invalid_samples", statistics.invalid_samples)?;
        dict.set_item("timed_out", statistics.timed_out)?;
        Ok(dict)
    }

    /// For notebooks.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let options = self.look(None, None, None)?;
        let encoded = py.detach(|| encode_png(self.picture.film(), &options)).map_err(usage)?;
        Ok(PyBytes::new(py, &encoded.bytes))
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.size();
        format!("<oscura.Picture {width} x {height}: {}>", self.keys().join(", "))
    }
}

impl Picture {
    fn missing(&self, name: &str) -> PyErr {
        PyKeyError::new_err(format!("{name} (the picture has {})", self.keys().join(", ")))
    }
}

/// Integers, for integer components.
fn integers(values: &Values) -> Option<Vec<u32>> {
    match values {
        Values::Uint(values) => Some(values.clone()),
        _ => None,
    }
}
