//! From FRF files to the stiffness of a joint.
//!
//! ```sh
//! cargo run -p jointrig-analysis --example joint_from_frf_files
//! ```
//!
//! Two bodies were hit at one point each, along y and z: alone (A.csv, B.csv) and joined (AJB.csv).
//! The files hold mobilities measured with an exponential window of 2.3 1/s. They were computed for
//! a contact of 260 N/µm along y and 180 N/µm along z.

mod csv;

use jointrig_analysis::substructuring::{
    Band, Configuration, Geometry, Grouping, IdmSet, Method, Point, identify,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (a, b, ajb) = (csv::frf("A.csv")?, csv::frf("B.csv")?, csv::frf("AJB.csv")?);
    let (on_a, on_b) = (points("A", Grouping::InterfaceA), points("B", Grouping::InterfaceB));
    let both = Configuration {
        channels: [on_a.channels.clone(), on_b.channels.clone()].concat(),
        impacts: [on_a.impacts.clone(), on_b.impacts.clone()].concat(),
    };
    let geometry =
        Geometry { a: on_a, b: on_b, ajb: both, virtual_point_a_m: [0.0; 3], virtual_point_b_m: [0.0; 3] };
    let band = Band { low_hz: 300.0, high_hz: 600.0 };
    let methods = [Method::Internal, Method::Interface, Method::Inverse];
    let found = identify(&a, &b, &ajb, &geometry, &methods, &[IdmSet::Two], &[band])?;
    println!(
        "stiffness over {} to {} Hz, mean ± standard deviation of the lines:",
        band.low_hz, band.high_hz
    );
    for row in found.joint {
        for (dof, k) in &row.stiffness_n_per_m {
            println!("{:>10}  k_{dof} = {:6.2} ± {:.2} N/µm", row.method, k.mean * 1e-6, k.std * 1e-6);
        }
    }
    for refused in found.refused {
        println!("{}: {}", refused.method.name(), refused.reason);
    }
    Ok(())
}

/// A sensor on one body and the hits on it, all at the contact.
fn points(body: &str, grouping: Grouping) -> Configuration {
    let point = |name: String, description: String, direction| Point {
        name,
        description,
        grouping,
        position_m: [0.0; 3],
        direction,
    };
    let axes = [("y", "Y", [0.0, 1.0, 0.0]), ("z", "Z", [0.0, 0.0, 1.0])];
    Configuration {
        // the axes of one sensor share its name
        channels: axes.map(|(axis, _, d)| point(format!("{body}1"), format!("{body}1:{axis}"), d)).to_vec(),
        impacts: axes.map(|(_, axis, d)| point(format!("{body}{axis}1"), String::new(), d)).to_vec(),
    }
}
