//! Lists the contents of a universal file, and where each of its FRFs is highest.
//!
//!     cargo run -p jointrig-uff --example read_universal_file
//!     cargo run -p jointrig-uff --example read_universal_file -- your_file.uff
//!
//! Without a path it reads two masses joined by a spring: 2 kg and 1 kg, 20 N/µm, so that both FRFs
//! are highest near 872 Hz.

use jointrig_uff::{DataSet, Values, kind, read};

const TWO_MASSES: &[u8] = include_bytes!("data/two_masses.uff");

fn main() -> std::io::Result<()> {
    let bytes = match std::env::args_os().nth(1) {
        Some(path) => std::fs::read(path)?,
        None => TWO_MASSES.to_vec(),
    };
    let contents = read(&bytes);

    for set in &contents.sets {
        match set {
            DataSet::Header(header) => println!("header: {}", header.description),
            DataSet::Units(units) => println!("units: {}, 1 m is {} here", units.description, units.length),
            DataSet::Nodes(nodes) | DataSet::NodesDouble(nodes) => println!("{} nodes", nodes.len()),
            DataSet::Function(function) => {
                let (response, reference) = (&function.response, &function.reference);
                println!(
                    "function of kind {}: {} values at {} {} over {} {}",
                    function.kind,
                    function.values.len(),
                    response.entity,
                    response.node,
                    reference.entity,
                    reference.node
                );
            }
            other => println!("data set {}", other.number()),
        }
    }
    for skipped in &contents.skipped {
        println!("left out: data set {} at byte {}", skipped.data_set, skipped.offset);
    }
    for fault in &contents.faults {
        println!("cannot be read: {fault}");
    }

    for frf in contents.functions().filter(|function| function.kind == kind::FRF) {
        let Values::Complex(values) = &frf.values else { continue };
        let highest = values.iter().enumerate().max_by(|(_, a), (_, b)| a.norm().total_cmp(&b.norm()));
        let Some((line, value)) = highest else { continue };
        println!("{}: {:.2} {} at {} Hz", frf.id[0], value.norm(), frf.axes[1].unit, frf.abscissa.at(line));
    }
    Ok(())
}
