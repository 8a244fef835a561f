//! Data set 55: data at nodes, such as mode shapes. Format 5 × 80A1; 6I10; 8I10; 6E13.5; then for
//! each node I10 and 6E13.5. Numbers have six digits.

use super::lines::{Lines, Words, Wrong, integer};
use super::number;
use crate::lines::{Output, integers};
use num_complex::Complex;

/// Data at nodes: one mode shape, or one result of a static or dynamic analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalData {
    /// Five lines of text.
    pub id: [String; 5],
    /// 1 structural, 2 heat transfer, 3 fluid flow.
    pub model: i64,
    /// 1 static, 2 normal mode, 3 and 7 complex eigenvalues, 4 transient, 5 frequency response.
    pub analysis: i64,
    /// 1 scalar, 2 translations along three axes, 3 translations and rotations.
    pub characteristic: i64,
    /// 8 displacement, 11 velocity, 12 acceleration, 0 unknown.
    pub quantity: i64,
    /// Integers that depend on the analysis. Normal mode and complex eigenvalues: load case, number
    /// of the mode.
    pub integers: Vec<i64>,
    /// Real numbers that depend on the analysis. Normal mode: frequency in Hz, modal mass, viscous
    /// and hysteretic damping ratio. Complex eigenvalues: real and imaginary part of the
    /// eigenvalue in 1/s, of modal A and of modal B.
    pub reals: Vec<f64>,
    /// Whether the values are complex.
    pub is_complex: bool,
    /// The number of each node and its values, the same number of values at each. The imaginary
    /// parts of values that are not complex are zero.
    pub nodes: Vec<(i64, Vec<Complex<f64>>)>,
}

/// Data types of real and of complex values, in single precision.
const TYPES: [i64; 2] = [2, 5];

impl NodalData {
    /// The eigenvalue of a mode, 1/s: stored, or of a normal mode computed from frequency and
    /// viscous damping ratio. `None` for data of another kind.
    pub fn eigenvalue_per_s(&self) -> Option<Complex<f64>> {
        match (self.analysis, &self.reals[..]) {
            (3 | 7, [re, im, ..]) => Some(Complex::new(*re, *im)),
            (2, [frequency_hz, _, damping_ratio, ..]) => {
                let omega = std::f64::consts::TAU * frequency_hz;
                let im = (1.0 - damping_ratio.powi(2)).max(0.0).sqrt();
                Some(Complex::new(-damping_ratio, im) * omega)
            }
            _ => None,
        }
    }

    /// The number of a mode; `None` for data of another kind.
    pub fn mode_number(&self) -> Option<i64> {
        matches!(self.analysis, 2 | 3 | 7).then(|| self.integers.get(1).copied()).flatten()
    }
}

pub(super) fn read(mut lines: Lines<'_>) -> Result<NodalData, Wrong> {
    let mut id: [String; 5] = Default::default();
    for text in &mut id {
        *text = lines.text("a line of text")?.label();
    }
    let first = lines.text("the kind of the data")?;
    let kinds: Vec<Option<i64>> = first.words().into_iter().map(integer).collect();
    let [Some(model), Some(analysis), Some(characteristic), Some(quantity), Some(of_type), Some(per_node)] =
        kinds[..]
    else {
        return Err(first.wrong("six whole numbers that describe the data are expected"));
    };
    if !TYPES.contains(&of_type) {
        return Err(first.wrong(format!("values of the type {of_type}: 2 (real) and 5 (complex) are read")));
    }
    let per_node = usize::try_from(per_node)
        .ok()
        .filter(|n| *n > 0)
        .ok_or_else(|| first.wrong(format!("{per_node} values at each node: at least 1 is expected")))?;
    let mut words = Words::new(lines);
    let mut count = |what: &str| -> Result<usize, Wrong> {
        let n = words.integer(what)?;
        usize::try_from(n).map_err(|_| first.wrong(format!("{what} is {n}")))
    };
    let (integers, reals) = (count("the count of integers")?, count("the count of real numbers")?);
    let integers = (0..integers).map(|_| words.integer("an integer")).collect::<Result<_, _>>()?;
    let reals = (0..reals).map(|_| words.real("a real number")).collect::<Result<_, _>>()?;
    let is_complex = of_type == TYPES[1];
    let mut nodes = Vec::new();
    while !words.is_empty() {
        let label = words.integer("a node's number")?;
        let value = |words: &mut Words<'_>| {
            let re = words.real("a value of the node")?;
            let im = if is_complex { words.real("an imaginary part at the node")? } else { 0.0 };
            Ok(Complex::new(re, im))
        };
        nodes.push((label, (0..per_node).map(|_| value(&mut words)).collect::<Result<_, Wrong>>()?));
    }
    Ok(NodalData { id, model, analysis, characteristic, quantity, integers, reals, is_complex, nodes })
}

pub(super) fn write(data: &NodalData, out: &mut Output) -> Result<(), String> {
    let NodalData { id, model, analysis, characteristic, quantity, is_complex, nodes, .. } = data;
    let per_node = nodes.first().map_or(1, |(_, values)| values.len());
    if let Some((label, values)) =
        nodes.iter().find(|(_, values)| values.len() != per_node || values.is_empty())
    {
        return Err(format!(
            "node {label} has {} values: each must have the same number, at least 1",
            values.len()
        ));
    }
    out.open(55, "");
    for text in id {
        out.label("a line of text", text)?;
    }
    let of_type = TYPES[usize::from(*is_complex)];
    let kinds = [*model, *analysis, *characteristic, *quantity, of_type, number::count(per_node)];
    out.line(&integers("a number that describes the data", &kinds, 10)?);
    let mut numbers = vec![number::count(data.integers.len()), number::count(data.reals.len())];
    numbers.extend(&data.integers);
    for row in numbers.chunks(8) {
        out.line(&integers("an integer of the data", row, 10)?);
    }
    reals(out, &data.reals);
    for (label, values) in nodes {
        out.line(&integers("a node's number", &[*label], 10)?);
        let parts = values.iter().flat_map(|v| [v.re, v.im].into_iter().take(1 + usize::from(*is_complex)));
        reals(out, &parts.collect::<Vec<_>>());
    }
    out.close();
    Ok(())
}

fn reals(out: &mut Output, values: &[f64]) {
    // the record has a line even if it holds no number
    if values.is_empty() {
        out.line("");
    }
    for row in values.chunks(6) {
        for value in row {
            number::print(&mut out.bytes, *value, 13, 5);
        }
        out.line("");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DataSet, read, write};

    /// A complex mode as another program writes it: lower-case exponents, blanks at the ends.
    const FOREIGN: &str = "    -1\n    55\nmodal test\nNONE\nNONE\nNONE\nNONE\n         1         3         2         8         5         3\n         2         6         1         7\n -1.25664e+00  6.28306e+02  1.00000e+00  0.00000e+00  0.00000e+00  0.00000e+00\n         4\n  1.00000e+00  0.00000e+00 -2.50000e-01  1.00000e-03  0.00000e+00  0.00000e+00\n        12\n  5.00000e-01  2.00000e-02  0.00000e+00  0.00000e+00  0.00000e+00  0.00000e+00\n    -1\n";

    #[test]
    fn a_complex_mode_is_read_and_written_as_it_was() {
        let contents = read(FOREIGN.as_bytes());
        assert_eq!((&contents.faults[..], contents.sets.len()), (&[][..], 1));
        let DataSet::NodalData(mode) = &contents.sets[0] else { panic!("{:?}", contents.sets) };
        assert_eq!((mode.id[0].as_str(), mode.mode_number()), ("modal test", Some(7)));
        let pole = mode.eigenvalue_per_s().expect("a mode");
        assert!((pole.norm() / std::f64::consts::TAU - 100.0).abs() < 3e-3, "{pole}");
        assert_eq!(mode.nodes[0].1[1], Complex::new(-0.25, 1e-3));
        assert_eq!(mode.nodes[1].0, 12);
        assert_eq!(read(&write(&contents.sets).expect("writable")).sets, contents.sets);
    }

    #[test]
    fn a_normal_mode_has_an_eigenvalue_and_a_static_result_none() {
        let mode = NodalData {
            id: Default::default(),
            model: 1,
            analysis: 2,
            characteristic: 2,
            quantity: 8,
            integers: vec![1, 3],
            reals: vec![50.0, 1.0, 0.02, 0.0],
            is_complex: false,
            nodes: vec![(1, vec![Complex::from(1.0); 3])],
        };
        let pole = mode.eigenvalue_per_s().expect("a mode");
        assert!((-pole.re / pole.norm() - 0.02).abs() < 1e-12 && pole.im > 314.0, "{pole}");
        let still = NodalData { analysis: 1, ..mode };
        assert_eq!((still.eigenvalue_per_s(), still.mode_number()), (None, None));
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_reason() {
        let wrong =
            |from: &str, to: &str| read(FOREIGN.replacen(from, to, 1).as_bytes()).faults[0].reason.clone();
        assert!(wrong("         5         3\n", "         4         3\n").contains("type 4"));
        assert!(wrong("         5         3\n", "         5        -3\n").contains("-3 values"));
        assert!(wrong("         2         6 ", "         2        -6 ").contains("count of real"));
        assert!(
            wrong("  2.00000e-02  0.00000e+00  0.00000e+00  0.00000e+00  0.00000e+00\n", "\n")
                .contains("missing")
        );
        let uneven = read(FOREIGN.as_bytes()).sets.into_iter().map(|set| match set {
            DataSet::NodalData(mut mode) => {
                mode.nodes[1].1.pop();
                DataSet::NodalData(mode)
            }
            other => other,
        });
        let said = write(&uneven.collect::<Vec<_>>()).expect_err("uneven").to_string();
        assert!(said.contains("node 12 has 2 values"), "{said}");
    }
}
