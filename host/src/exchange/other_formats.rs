//! Recognises files of other programs that are not read here by their first bytes, and shows Python
//! lines that convert each of them to npz.

use crate::untrusted_input;
use std::io::{self, Read};
use std::path::Path;

/// Number of bytes examined: HDF5 may begin after a block of 512 bytes that MATLAB writes.
const LOOKED_AT: u64 = 1024;

/// What the file is needed for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contents {
    /// FRFs.
    Frfs,
    /// Impact records.
    Records,
    /// A hysteresis loop.
    Loop,
}

impl Contents {
    /// Arguments of `numpy.savez` after the file name; `of` returns the expression that reads an
    /// array by its name.
    fn arrays(self, of: &dyn Fn(&str) -> String) -> String {
        let list: &[(&str, &str)] = match self {
            Contents::Frfs => &[("frequency", "f"), ("frf", "H")],
            Contents::Records => &[("force", "force"), ("response", "response")],
            Contents::Loop => &[("displacement_a", "x"), ("force", "force")],
        };
        let own: Vec<String> = list.iter().map(|(array, name)| format!("{array}={}", of(name))).collect();
        let more = match self {
            Contents::Frfs => "quantity=\"mobility\", outputs=[\"A1:x\", …], inputs=[\"AZ1\", …]",
            Contents::Records => "fs=51200, quantity=\"acceleration\"",
            Contents::Loop => "displacement_b=0*x, fs=51200",
        };
        format!("{}, {more}", own.join(", "))
    }
}

/// A known format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum KnownFormat {
    Matlab5,
    Matlab73,
    Hdf5,
    Tdms,
    LabView,
    Npy,
    Wave,
    Parquet,
    Utf16,
    Universal,
}

/// The signature of HDF5.
const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";

/// A line of Python that opens a file, and the expression for one of its arrays.
type PythonLines = (String, fn(&str) -> String);

impl KnownFormat {
    fn of(first: &[u8]) -> Option<KnownFormat> {
        let begins = |with: &[u8]| first.starts_with(with);
        let text = first.trim_ascii_start();
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let hdf5 = begins(HDF5) || first.get(512..).is_some_and(|rest| rest.starts_with(HDF5));
        Some(match () {
            () if begins(b"MATLAB 7.3") => KnownFormat::Matlab73,
            () if begins(b"MATLAB ") => KnownFormat::Matlab5,
            () if hdf5 => KnownFormat::Hdf5,
            () if begins(b"TDSm") || begins(b"TDSh") => KnownFormat::Tdms,
            () if text.starts_with(b"LabVIEW Measurement") => KnownFormat::LabView,
            () if begins(b"\x93NUMPY") => KnownFormat::Npy,
            () if begins(b"RIFF") && first.get(8..12) == Some(b"WAVE") => KnownFormat::Wave,
            () if begins(b"PAR1") => KnownFormat::Parquet,
            () if begins(b"\xff\xfe") || begins(b"\xfe\xff") => KnownFormat::Utf16,
            () if is_universal(first) => KnownFormat::Universal,
            () => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            KnownFormat::Matlab5 => "a MATLAB file",
            KnownFormat::Matlab73 => "a MATLAB file of version 7.3, which is HDF5",
            KnownFormat::Hdf5 => "an HDF5 file",
            KnownFormat::Tdms => "a TDMS file of LabVIEW",
            KnownFormat::LabView => "a LabVIEW measurement file (LVM)",
            KnownFormat::Npy => "a single numpy array (.npy)",
            KnownFormat::Wave => "a WAVE sound file",
            KnownFormat::Parquet => "a Parquet file",
            KnownFormat::Utf16 => "text in UTF-16",
            KnownFormat::Universal => "a universal file",
        }
    }

    /// The line of Python that opens the file as `m`, and the expression that reads an array of `m`
    /// by its name.
    fn python(self, file: &str) -> Option<PythonLines> {
        Some(match self {
            KnownFormat::Matlab5 => {
                (format!("import numpy, scipy.io; m = scipy.io.loadmat({file})"), |name| {
                    format!("m[\"{name}\"]")
                })
            }
            // MATLAB stores arrays with the axes reversed
            KnownFormat::Matlab73 => {
                (format!("import numpy, h5py; m = h5py.File({file})"), |name| format!("m[\"{name}\"][()].T"))
            }
            KnownFormat::Hdf5 => {
                (format!("import numpy, h5py; m = h5py.File({file})"), |name| format!("m[\"{name}\"][()]"))
            }
            KnownFormat::Tdms => {
                (format!("import numpy, nptdms; m = nptdms.TdmsFile.read({file})[\"GROUP\"]"), |name| {
                    format!("m[\"{name}\"][:]")
                })
            }
            KnownFormat::LabView => {
                (format!("import numpy, lvm_read; m = lvm_read.read({file})[0][\"data\"].T"), |name| {
                    match name {
                        "force" | "f" => "m[1]".into(),
                        _ => "m[2]".into(),
                    }
                })
            }
            KnownFormat::Npy => (format!("import numpy; m = numpy.load({file})"), |name| match name {
                "force" | "f" => "m[0]".into(),
                _ => "m[1:]".into(),
            }),
            KnownFormat::Wave => {
                (format!("import numpy, scipy.io.wavfile; fs, m = scipy.io.wavfile.read({file})"), |name| {
                    match name {
                        "force" | "f" => "SENSITIVITY*m[:, 0]".into(),
                        _ => "SENSITIVITY*m[:, 1:].T".into(),
                    }
                })
            }
            KnownFormat::Parquet => {
                (format!("import numpy, pandas; m = pandas.read_parquet({file})"), |name| {
                    format!("m[\"{name}\"].to_numpy()")
                })
            }
            KnownFormat::Utf16 | KnownFormat::Universal => return None,
        })
    }
}

/// Whether the first line that is not blank is `-1`, and a number follows it.
fn is_universal(first: &[u8]) -> bool {
    let first = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first);
    let mut lines = first.split(|byte| matches!(byte, b'\r' | b'\n')).map(<[u8]>::trim_ascii);
    let mut next = || lines.find(|line| !line.is_empty());
    next() == Some(b"-1") && next().is_some_and(|line| line.first().is_some_and(u8::is_ascii_digit))
}

/// The message for a file of a known format that is not read as `wanted`, from its first bytes;
/// `None` for any other file.
fn said(path: &Path, first: &[u8], wanted: Contents) -> Option<String> {
    let format = KnownFormat::of(first)?;
    let name = format.name();
    let file = |path: &Path| format!("{:?}", path.file_name().unwrap_or(path.as_os_str()).to_string_lossy());
    match (format, wanted) {
        (KnownFormat::Universal, Contents::Loop) => Some(format!(
            "it is {name}, but a loop is read only from npz: write one by numpy.savez with the arrays of docs/own-data.md"
        )),
        (KnownFormat::Universal, _) => None,
        (KnownFormat::Utf16, _) => Some(format!("it is {name}: save it as UTF-8 or ASCII")),
        _ => {
            let (open, array) = format.python(&file(path))?;
            let npz = file(&path.with_extension("npz"));
            Some(format!(
                "it is {name}, which is not read here. Two lines of Python make an npz of it (with your names for the arrays, in SI):\n  \
                 {open}\n  numpy.savez({npz}, {})",
                wanted.arrays(&array)
            ))
        }
    }
}

/// The message for a file of a known format that is not read as `wanted`; `None` for any other
/// file.
///
/// # Errors
/// An error of the operating system.
pub(super) fn not_read_here(path: &Path, wanted: Contents) -> io::Result<Option<String>> {
    let mut first = Vec::new();
    untrusted_input::open(path).and_then(|(file, _)| file.take(LOOKED_AT).read_to_end(&mut first))?;
    Ok(said(path, &first, wanted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_first_bytes_and_the_message_has_two_lines_of_python() {
        let block = |text: &[u8]| [text, &vec![0; 600 - text.len()][..]].concat();
        let behind_a_block = [&vec![0; 512][..], HDF5, &[0; 32]].concat();
        for (first, name, module) in [
            (block(b"MATLAB 5.0 MAT-file, Platform: GLNXA64"), "MATLAB", "scipy.io.loadmat"),
            (block(b"MATLAB 7.3 MAT-file, Platform"), "MATLAB", "h5py"),
            (block(HDF5), "HDF5", "h5py"),
            (behind_a_block, "HDF5", "h5py"),
            (block(b"TDSm\x0e\0\0\0"), "TDMS", "nptdms"),
            (block(b"LabVIEW Measurement\t\r\nWriter_Version\t2"), "LabVIEW", "lvm_read"),
            (block(b"\x93NUMPY\x01\0"), ".npy", "numpy.load"),
            (block(b"RIFF\0\0\0\0WAVEfmt "), "WAVE", "wavfile"),
            (block(b"PAR1"), "Parquet", "read_parquet"),
        ] {
            for (wanted, array) in [
                (Contents::Frfs, "frf="),
                (Contents::Records, "response="),
                (Contents::Loop, "displacement_a="),
            ] {
                let text = said(Path::new("d/my \"file\".mat"), &first, wanted).expect(name);
                for part in [name, module, array, "numpy.savez(\"my \\\"file\\\".npz\"", "fs="] {
                    assert!(
                        text.contains(part) || (part == "fs=" && wanted == Contents::Frfs),
                        "{name}: {text}"
                    );
                }
                assert_eq!(text.lines().count(), 3, "{text}");
            }
        }
        assert!(
            said(Path::new("x"), b"\xff\xfe-\x001\x00", Contents::Frfs).expect("UTF-16").contains("UTF-8")
        );
        let universal = b"\xef\xbb\xbf\r\n    -1\r\n    58\r\n";
        assert_eq!(said(Path::new("x"), universal, Contents::Records), None);
        assert!(said(Path::new("x"), universal, Contents::Loop).expect("no loop").contains("universal file"));
        for other in [&b"PK\x03\x04"[..], b"hello", b"", b"-1"] {
            assert_eq!(said(Path::new("x"), other, Contents::Loop), None);
        }
    }
}
