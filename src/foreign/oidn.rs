//! Intel Open Image Denoise by its C interface, versions 1.4 to 2: <https://www.openimagedenoise.org/documentation.html>.

// The one place besides `simd` with unsafe code: foreign functions are unsafe to call.
#![allow(unsafe_code)]

use crate::error::{Error, Result};
use libloading::Library;
use std::ffi::{CStr, CString, OsString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;

type Handle = *mut c_void;
type New = unsafe extern "C" fn(c_int) -> Handle;
type NewFilter = unsafe extern "C" fn(Handle, *const c_char) -> Handle;
type On = unsafe extern "C" fn(Handle);
type SetNumber = unsafe extern "C" fn(Handle, *const c_char, c_int);
type SetFlag = unsafe extern "C" fn(Handle, *const c_char, bool);
type GetNumber = unsafe extern "C" fn(Handle, *const c_char) -> c_int;
type GetError = unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int;
type SetImage =
    unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// Names under which systems have it.
#[cfg(target_os = "windows")]
const NAMES: &[&str] = &["OpenImageDenoise.dll"];
#[cfg(target_os = "macos")]
const NAMES: &[&str] = &["libOpenImageDenoise.dylib", "libOpenImageDenoise.2.dylib"];
#[cfg(not(any(target_os = "windows", target_os = "macos")))]
const NAMES: &[&str] = &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so", "libOpenImageDenoise.so.1"];

/// The library, with a device that runs on the processor.
pub struct Oidn {
    functions: Functions,
    device: Handle,
    version: (i32, i32),
}

/// Its functions. They are valid as long as the library is there.
struct Functions {
    new_device: New,
    set_device_number: SetNumber,
    set_device_flag: SetFlag,
    get_device_number: GetNumber,
    get_device_error: GetError,
    commit_device: On,
    release_device: On,
    new_filter: NewFilter,
    set_image: SetImage,
    set_flag: SetFlag,
    commit_filter: On,
    execute_filter: On,
    release_filter: On,
    _library: Library,
}

/// One run of the library's filter for pictures of path tracers.
pub struct Run<'a> {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The name of what is filtered: `color`, `albedo` or `normal`.
    pub name: &'a str,
    /// Its pixels, red, green and blue of each.
    pub pixels: &'a [f32],
    /// What helps, by name; without noise.
    pub guides: &'a [(&'a str, &'a [f32])],
}

impl Functions {
    fn of(library: Library) -> std::result::Result<Functions, libloading::Error> {
        /// The first of some names that the library has.
        fn find<T: Copy>(library: &Library, names: &[&str]) -> std::result::Result<T, libloading::Error> {
            let mut last = None;
            for name in names {
                // SAFETY: the types above are those of the library's header, in all versions that have these names.
                match unsafe { library.get::<T>(name.as_bytes()) } {
                    Ok(symbol) => return Ok(*symbol),
                    Err(error) => last = Some(error),
                }
            }
            Err(last.expect("there is a name"))
        }
        Ok(Functions {
            new_device: find(&library, &["oidnNewDevice"])?,
            set_device_number: find(&library, &["oidnSetDeviceInt", "oidnSetDevice1i"])?,
            set_device_flag: find(&library, &["oidnSetDeviceBool", "oidnSetDevice1b"])?,
            get_device_number: find(&library, &["oidnGetDeviceInt", "oidnGetDevice1i"])?,
            get_device_error: find(&library, &["oidnGetDeviceError"])?,
            commit_device: find(&library, &["oidnCommitDevice"])?,
            release_device: find(&library, &["oidnReleaseDevice"])?,
            new_filter: find(&library, &["oidnNewFilter"])?,
            set_image: find(&library, &["oidnSetSharedFilterImage"])?,
            set_flag: find(&library, &["oidnSetFilterBool", "oidnSetFilter1b"])?,
            commit_filter: find(&library, &["oidnCommitFilter"])?,
            execute_filter: find(&library, &["oidnExecuteFilter"])?,
            release_filter: find(&library, &["oidnReleaseFilter"])?,
            _library: library,
        })
    }
}

impl Oidn {
    /// Loads the library from a file, or from where the system finds it. Its filters take so many threads.
    ///
    /// # Errors
    /// A usage error that says which file can't be loaded, or what it lacks.
    pub fn load(file: Option<&Path>, threads: usize) -> Result<Oidn> {
        let names: Vec<OsString> = match file {
            Some(file) => vec![file.into()],
            None => NAMES.iter().map(OsString::from).collect(),
        };
        let refused = |why: String| Error::usage(format!("Open Image Denoise can't be loaded: {why}"));
        let mut first = None;
        for name in names {
            // SAFETY: what initializes the library is trusted as much as its user trusts the file that he names, or his
            // system.
            match unsafe { Library::new(&name) } {
                Ok(library) => {
                    let functions = Functions::of(library).map_err(|e| refused(e.to_string()))?;
                    return Oidn::start(functions, threads).map_err(refused);
                }
                Err(error) => first = first.or(Some(error)),
            }
        }
        Err(refused(first.map_or_else(String::new, |error| error.to_string())))
    }

    /// Makes the device.
    fn start(functions: Functions, threads: usize) -> std::result::Result<Oidn, String> {
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: the handle is that of a new device, which is committed before anything else asks it.
        let device = unsafe { (functions.new_device)(CPU) };
        let mut oidn = Oidn { functions, device, version: (0, 0) };
        if oidn.device.is_null() {
            return Err(oidn.error().unwrap_or_else(|| "it has no device for processors".to_string()));
        }
        let f = &oidn.functions;
        // SAFETY: as above; names are strings that end in zero.
        let version = unsafe {
            (f.set_device_number)(oidn.device, c"numThreads".as_ptr(), threads);
            (f.set_device_flag)(oidn.device, c"setAffinity".as_ptr(), false);
            (f.commit_device)(oidn.device);
            (f.get_device_number)(oidn.device, c"version".as_ptr())
        };
        oidn.version = (version / 10_000, version / 100 % 100);
        oidn.error().map_or(Ok(oidn), Err)
    }

    /// Its version: major, minor.
    pub fn version(&self) -> (i32, i32) {
        self.version
    }

    /// What went wrong since it was last asked, if something did. Without a device, when that was made.
    fn error(&self) -> Option<String> {
        let mut message = ptr::null();
        // SAFETY: the device is null or valid; the message is null or a string that the library keeps until its next call.
        unsafe {
            let code = (self.functions.get_device_error)(self.device, &mut message);
            let text = || match message.is_null() {
                true => format!("error {code}"),
                false => CStr::from_ptr(message).to_string_lossy().into_owned(),
            };
            (code != 0).then(text)
        }
    }

    /// Filters a picture.
    ///
    /// # Errors
    /// What the library says went wrong.
    ///
    /// # Panics
    /// If a list has not three values a pixel.
    pub fn filter(&self, run: &Run) -> std::result::Result<Vec<f32>, String> {
        let values = 3 * run.width * run.height;
        let mut output = vec![0.0f32; values];
        let f = &self.functions;
        // SAFETY: the device is valid.
        let filter = unsafe { (f.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            return Err(self.error().unwrap_or_else(|| "it has no filter of the kind RT".to_string()));
        }
        let set = |name: &str, data: *mut f32| {
            let name = CString::new(name).expect("names have no zeros");
            // SAFETY: the filter is valid, and the data, of the size that is told and packed, outlives it. It writes to the
            // output only.
            unsafe {
                (f.set_image)(filter, name.as_ptr(), data.cast(), FLOAT3, run.width, run.height, 0, 0, 0)
            }
        };
        for (name, pixels) in run.guides.iter().chain([&(run.name, run.pixels)]) {
            assert_eq!(pixels.len(), values, "{name} has another size");
            set(name, pixels.as_ptr().cast_mut());
        }
        set("output", output.as_mut_ptr());
        // SAFETY: the filter is valid until it is released, at the end.
        unsafe {
            (f.set_flag)(filter, c"hdr".as_ptr(), run.name == "color");
            (f.set_flag)(filter, c"cleanAux".as_ptr(), !run.guides.is_empty());
            (f.commit_filter)(filter);
            (f.execute_filter)(filter);
            (f.release_filter)(filter);
        }
        self.error().map_or(Ok(output), Err)
    }
}

impl Drop for Oidn {
    fn drop(&mut self) {
        if !self.device.is_null() {
            // SAFETY: it is valid, and nothing uses it afterwards.
            unsafe { (self.functions.release_device)(self.device) }
        }
    }
}
