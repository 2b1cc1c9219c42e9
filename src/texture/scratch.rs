//! A temporary file for what does not fit into memory; it has no name, and is gone with the process.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A temporary file that grows; several threads read it at once.
#[derive(Debug)]
pub(super) struct ScratchFile {
    file: File,
    /// Bytes written.
    length: Mutex<u64>,
}

impl ScratchFile {
    /// A new one in [`folder`].
    ///
    /// # Errors
    /// That of the system.
    pub fn new() -> io::Result<ScratchFile> {
        let file = tempfile::tempfile_in(folder())?;
        Ok(ScratchFile { file, length: Mutex::new(0) })
    }

    /// Appends bytes and gives the position of the first.
    ///
    /// # Errors
    /// That of the system, such as a full disk; what was written of the bytes is written over then.
    pub fn append(&self, bytes: &[u8]) -> io::Result<u64> {
        let mut length = self.length.lock().unwrap_or_else(PoisonError::into_inner);
        let start = *length;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(start))?;
        file.write_all(bytes)?;
        *length += bytes.len() as u64;
        Ok(start)
    }

    /// Reads what was appended.
    ///
    /// # Errors
    /// That of the system.
    pub fn read(&self, start: u64, into: &mut [u8]) -> io::Result<()> {
        #[cfg(unix)]
        {
            std::os::unix::fs::FileExt::read_exact_at(&self.file, into, start)
        }
        #[cfg(not(unix))]
        {
            use std::io::Read;
            let _alone = self.length.lock().unwrap_or_else(PoisonError::into_inner);
            let mut file = &self.file;
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(into)
        }
    }
}

/// The folder of temporary files: that of the variable `TMPDIR`; else `/var/tmp`, since `/tmp` is in memory on many systems.
pub(super) fn folder() -> PathBuf {
    let large = PathBuf::from("/var/tmp");
    if std::env::var_os("TMPDIR").is_none() && large.is_dir() { large } else { std::env::temp_dir() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let file = ScratchFile::new().expect("the folder can be written");
        let parts: Vec<Vec<u8>> = (0..20u8).map(|i| vec![i; 100 * usize::from(i)]).collect();
        let starts: Vec<u64> = parts.iter().map(|part| file.append(part).expect("there is room")).collect();
        for (part, start) in parts.iter().zip(starts) {
            let mut found = vec![0; part.len()];
            file.read(start, &mut found).expect("it was written");
            assert_eq!(*part, found);
        }
        assert!(file.read(1 << 40, &mut [0; 4]).is_err());
    }
}
