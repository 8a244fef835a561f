//! Universal files: 288 FRFs of 3600 complex lines, compared with pyuff and with a copy of the same
//! bytes.

use super::noise::numbers;
use super::peers::{self, Peers};
use super::row::{RUNS, Row, quickest};
use jointrig::exchange::uff::{
    Abscissa, ByteOrder, DataSet, Dof, Encoding, Function, Precision, Values, kind, read, write,
};
use num_complex::Complex;
use serde_json::json;
use std::error::Error;
use std::hint::black_box;

const FUNCTIONS: usize = 288;
const LINES: usize = 3600;

/// A row for each form and direction.
pub fn rows(all: &Peers) -> Result<Vec<Row>, Box<dyn Error>> {
    let theirs = all.run("universal.py", &json!({ "functions": FUNCTIONS, "lines": LINES }).to_string())?;
    let folder = tempfile::tempdir()?;
    let mut rows = Vec::new();
    for (encoding, name, wanted) in [
        (Encoding::Ascii, "ascii", [20.0, 10.0]),
        (Encoding::Binary(ByteOrder::Little), "binary", [20.0, 1.0]),
    ] {
        let path = folder.path().join(name);
        let sets: Vec<DataSet> =
            (0..FUNCTIONS).map(|i| DataSet::Function(Box::new(function(i, encoding)))).collect();
        let bytes = write(&sets)?;
        let mut copy = vec![0; bytes.len()];
        let [written, again, copied] = quickest(
            RUNS,
            [
                &mut || std::fs::write(&path, write(&sets).expect("writable")).expect("a disk with room"),
                &mut || {
                    let contents = read(&std::fs::read(&path).expect("just written"));
                    assert_eq!((contents.sets.len(), contents.faults.len()), (FUNCTIONS, 0));
                    black_box(contents);
                },
                &mut || black_box(&mut copy).copy_from_slice(black_box(&bytes)),
            ],
        );
        let megabytes = bytes.len() as f64 / 1e6;
        for (seconds, what, wanted) in [(written, "write", wanted[0]), (again, "read", wanted[1])] {
            let peer = theirs.as_ref().and_then(|t| peers::quickest(&t[format!("{name} {what}")]));
            rows.push(
                Row::of(
                    format!("UFF58 {name}, {what} {FUNCTIONS} × {LINES} lines ({megabytes:.0} MB)"),
                    seconds,
                )
                .beside("pyuff", peer, wanted)
                .against("memcpy of the bytes", copied, None),
            );
        }
    }
    Ok(rows)
}

fn function(i: usize, encoding: Encoding) -> Function {
    let parts = numbers(2 * LINES, i as u64);
    Function {
        id: ["speed".into(), String::new(), String::new(), String::new(), String::new()],
        kind: kind::FRF,
        number: 0,
        version: 0,
        load_case: 0,
        response: Dof { entity: "A1".into(), node: 1, direction: 1 },
        reference: Dof { entity: "AZ1".into(), node: 1, direction: 3 },
        precision: Precision::Double,
        abscissa: Abscissa::Even { start: 0.0, step: 0.25 },
        values: Values::Complex(parts.chunks(2).map(|p| Complex::new(p[0], p[1])).collect()),
        z: 0.0,
        axes: Default::default(),
        encoding,
    }
}
