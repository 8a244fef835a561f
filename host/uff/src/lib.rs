//! Universal files (UFF): the exchange format of modal analysis, read and written.
//!
//! A universal file is a sequence of data sets between lines of `    -1`. Supported data sets: 58
//! and 58b ([`Function`]: FRFs, time signals, spectra, coherence), 55 ([`NodalData`]: mode shapes),
//! 15 and 2411 ([`Node`]), 82 ([`TraceLine`]), 2412 ([`Element`]), 151 ([`Header`]), 164
//! ([`Units`]). Others are listed with their number and position.
//!
//! An accelerance of three lines, written and read again:
//!
//! ```
//! use jointrig_uff::{Abscissa, Axis, Dof, Function, Values, kind, quantity, read, write};
//! use num_complex::Complex;
//!
//! let axis = |quantity, unit: &str| Axis { quantity, unit: unit.into(), ..Axis::default() };
//! let frf = Function {
//!     response: Dof { entity: "plate".into(), node: 4, direction: 3 },
//!     reference: Dof { entity: "plate".into(), node: 1, direction: -3 },
//!     axes: [
//!         axis(quantity::FREQUENCY, "Hz"),
//!         axis(quantity::ACCELERATION, "m/s^2"),
//!         axis(quantity::FORCE, "N"),
//!         Axis::default(),
//!     ],
//!     ..Function::new(
//!         kind::FRF,
//!         Abscissa::Even { start: 100.0, step: 50.0 },
//!         Values::Complex(vec![Complex::new(0.5, -0.25), Complex::new(-2.0, 8.0), Complex::new(1.0, 0.125)]),
//!     )
//! };
//! let file = write(&[frf.clone().into()])?; // bytes, for std::fs::write
//!
//! let contents = read(&file); // of std::fs::read
//! let back = contents.functions().next().expect("one FRF");
//! assert_eq!(*back, frf);
//! let Values::Complex(values) = &back.values else { panic!("an FRF is complex") };
//! for (line, value) in values.iter().enumerate() {
//!     println!("{} Hz: {} m/s² per N", back.abscissa.at(line), value.norm());
//! }
//! # Ok::<(), jointrig_uff::WriteError>(())
//! ```
//!
//! Reading accepts the variants that other programs write: line ends of any kind (also an extra one
//! between binary data and the closing `-1`), Latin-1 and UTF-8 texts, a byte order mark, text
//! outside the data sets (listed in [`Contents::outside`]), with or without trailing blanks, zeros
//! that pad the last line of values, `e`, `E`, `d` and `D` exponents, numbers outside their
//! columns, 4- and 8-byte floats of either byte order, wrong byte counts in the headers of 58b.
//! Each data set that cannot be read is reported as a [`Fault`] with its number, byte offset and
//! the reason; everything else is still read. No input causes a panic, and memory is limited to a
//! small multiple of the input's size: of a file with more data sets than expected for its size
//! only a part is read, which its last fault reports. [`read_functions`] and [`read_only`] skip all
//! other data sets.
//!
//! The structs of the data sets mirror a format that has been fixed for decades, so all their
//! fields are public. The feature `parallel` (off by default) reads and writes large files on all
//! processors.
#![forbid(unsafe_code)]

#[cfg(test)]
mod any_bytes_tests;
mod blocks;
#[cfg(test)]
mod foreign_tests;
mod function;
mod lines;
mod nodes;
mod number;
#[cfg(test)]
mod round_trip_tests;
mod set151;
mod set164;
mod set2412;
mod set55;
mod set58;
mod set58_values;
mod set82;

pub use function::{Abscissa, Axis, ByteOrder, Dof, Encoding, Function, Precision, Values, kind, quantity};
pub use nodes::Node;
pub use set55::NodalData;
pub use set82::TraceLine;
pub use set151::Header;
pub use set164::Units;
pub use set2412::{Beam, Element};

#[cfg(feature = "parallel")]
use rayon::prelude::*;
use std::fmt;

/// One data set.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DataSet {
    /// 58 or 58b: a function at a degree of freedom.
    Function(Box<Function>),
    /// 55: data at nodes, such as a mode shape.
    NodalData(NodalData),
    /// 15: nodes, single precision.
    Nodes(Vec<Node>),
    /// 2411: nodes, double precision.
    NodesDouble(Vec<Node>),
    /// 82: a trace line.
    TraceLine(TraceLine),
    /// 2412: elements.
    Elements(Vec<Element>),
    /// 151: the file's header.
    Header(Header),
    /// 164: units.
    Units(Units),
}

impl DataSet {
    /// Its number in the file.
    pub fn number(&self) -> u32 {
        match self {
            DataSet::Function(_) => 58,
            DataSet::NodalData(_) => 55,
            DataSet::Nodes(_) => 15,
            DataSet::NodesDouble(_) => 2411,
            DataSet::TraceLine(_) => 82,
            DataSet::Elements(_) => 2412,
            DataSet::Header(_) => 151,
            DataSet::Units(_) => 164,
        }
    }
}

impl From<Function> for DataSet {
    fn from(function: Function) -> Self {
        DataSet::Function(Box::new(function))
    }
}

/// A data set that could not be read.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Fault {
    /// Its number; 0 if it cannot be read.
    pub data_set: u32,
    /// Its position among the data sets of the file, from 1.
    pub place: usize,
    /// Position of the error, in bytes from the start of the file.
    pub offset: usize,
    /// What is wrong.
    pub reason: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Fault { data_set, place, offset, reason } = self;
        write!(f, "data set {place} (type {data_set}), byte {offset}: {reason}")
    }
}

/// A data set of a type that is not supported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Skipped {
    /// Its number.
    pub data_set: u32,
    /// Byte offset of its opening `-1`.
    pub offset: usize,
}

/// Text outside the data sets, which is ignored.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Outside {
    /// Where it begins, in bytes from the start of the file.
    pub offset: usize,
    /// The beginning of its first line.
    pub text: String,
    /// Number of its lines, without blank ones.
    pub lines: usize,
}

/// Contents of a universal file.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Contents {
    /// Every data set that could be read, in the order of the file.
    pub sets: Vec<DataSet>,
    /// Every data set that could not be read.
    pub faults: Vec<Fault>,
    /// Every data set of a type that is not supported, or that was not requested.
    pub skipped: Vec<Skipped>,
    /// Text before the first data set, between two or after the last.
    pub outside: Vec<Outside>,
}

impl Contents {
    /// The functions (58 and 58b) among the data sets, in the order of the file.
    pub fn functions(&self) -> impl Iterator<Item = &Function> {
        self.sets.iter().filter_map(|set| match set {
            DataSet::Function(function) => Some(&**function),
            _ => None,
        })
    }
}

/// Number of data sets that any file may have.
const LEAST_SETS: usize = 32_768;
/// One more data set is allowed for each of this many bytes: the header of a function alone
/// has 400.
const BYTES_OF_SET: usize = 512;
/// Number of data sets that are read at a time.
const BATCH: usize = 1024;

/// Reads all data sets of a file's bytes; large ones in parallel.
pub fn read(bytes: &[u8]) -> Contents {
    read_those(bytes, |_| true)
}

/// Reads only the functions (58 and 58b); every other data set is skipped like an unsupported one.
pub fn read_functions(bytes: &[u8]) -> Contents {
    read_only(bytes, &[58])
}

/// Reads only the data sets of these numbers (58 includes 58b); every other one is skipped like an
/// unsupported one.
pub fn read_only(bytes: &[u8], numbers: &[u32]) -> Contents {
    read_those(bytes, |number| numbers.contains(&number))
}

fn read_those(bytes: &[u8], wanted: impl Fn(u32) -> bool + Sync) -> Contents {
    let most = LEAST_SETS + bytes.len() / BYTES_OF_SET;
    let mut contents = Contents::default();
    let (mut blocks, mut place) = (blocks::Blocks::of(bytes), 0);
    loop {
        let batch: Vec<_> = blocks.by_ref().take(BATCH).collect();
        contents.outside.append(&mut blocks.outside);
        if batch.is_empty() {
            return contents;
        }
        let first = place + 1;
        place += batch.len();
        for item in of_each(batch, |(i, block)| one(first + i, block, &wanted)) {
            match item {
                Read::Set(set) => contents.sets.push(*set),
                Read::Fault(fault) => contents.faults.push(fault),
                Read::Skipped(skipped) => contents.skipped.push(skipped),
            }
        }
        if place > most {
            contents.faults.push(Fault {
                data_set: 0,
                place,
                offset: blocks.offset(),
                reason: format!(
                    "a file of {} bytes may have {most} data sets: what follows was left unread, split the file",
                    bytes.len()
                ),
            });
            return contents;
        }
    }
}

/// Result of reading one data set.
enum Read {
    Set(Box<DataSet>),
    Fault(Fault),
    Skipped(Skipped),
}

fn one(
    place: usize,
    block: Result<blocks::Block<'_>, blocks::Unusable>,
    wanted: impl Fn(u32) -> bool,
) -> Read {
    let fault = |number, at: lines::Wrong| {
        Read::Fault(Fault { data_set: number, place, offset: at.offset, reason: at.reason })
    };
    let block = match block {
        Ok(block) => block,
        Err(unusable) => return fault(unusable.number, unusable.wrong),
    };
    if !wanted(block.number) {
        return Read::Skipped(Skipped { data_set: block.number, offset: block.offset });
    }
    let body = lines::Lines::of(block.body);
    let set = match block.number {
        58 => set58::read(&block).map(DataSet::from),
        55 => set55::read(body).map(DataSet::NodalData),
        15 => nodes::read(body).map(DataSet::Nodes),
        2411 => nodes::read(body).map(DataSet::NodesDouble),
        82 => set82::read(body).map(DataSet::TraceLine),
        2412 => set2412::read(body).map(DataSet::Elements),
        151 => set151::read(body).map(DataSet::Header),
        164 => set164::read(body).map(DataSet::Units),
        data_set => return Read::Skipped(Skipped { data_set, offset: block.offset }),
    };
    match set {
        Ok(set) => Read::Set(Box::new(set)),
        Err(wrong) => fault(block.number, wrong),
    }
}

/// Calls `f` for each item with its index, in order; on all processors with the feature `parallel`.
fn of_each<T: Send, R: Send>(items: Vec<T>, f: impl Fn((usize, T)) -> R + Send + Sync) -> Vec<R> {
    #[cfg(feature = "parallel")]
    return items.into_par_iter().enumerate().map(f).collect();
    #[cfg(not(feature = "parallel"))]
    return items.into_iter().enumerate().map(f).collect();
}

/// Why a data set cannot be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("data set {place} (type {data_set}) cannot be written: {reason}")]
pub struct WriteError {
    /// Its number.
    pub data_set: u32,
    /// Its position, from 1.
    pub place: usize,
    /// What does not fit the format, and what would.
    pub reason: String,
}

/// The bytes of a universal file with these data sets; large ones are formatted in parallel.
///
/// # Errors
/// [`WriteError`] for a text that is too long or has line ends, a number that its column cannot
/// hold, or values that do not match their abscissa.
pub fn write(sets: &[DataSet]) -> Result<Vec<u8>, WriteError> {
    let parts = of_each(sets.iter().collect(), |(place, set)| {
        let mut out = lines::Output::default();
        let written = match set {
            DataSet::Function(function) => set58::write(function, &mut out),
            DataSet::NodalData(data) => set55::write(data, &mut out),
            DataSet::Nodes(nodes) => nodes::write_single(nodes, &mut out),
            DataSet::NodesDouble(nodes) => nodes::write_double(nodes, &mut out),
            DataSet::TraceLine(line) => set82::write(line, &mut out),
            DataSet::Elements(elements) => set2412::write(elements, &mut out),
            DataSet::Header(header) => set151::write(header, &mut out),
            DataSet::Units(units) => set164::write(units, &mut out),
        };
        match written {
            Ok(()) => Ok(out.into_bytes()),
            Err(reason) => Err(WriteError { data_set: set.number(), place: place + 1, reason }),
        }
    });
    Ok(parts.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
}
