//! Tests that people with colour vision deficiencies can distinguish finished cells from others.
//!
//! Deficiencies are simulated as in Machado, Oliveira and Fernandes, IEEE Trans. Vis. Comput.
//! Graph. 15 (2009) 1291, severity 1; differences are Euclidean in CIE L*a*b*. Signs and texts
//! (`5/8`, `✕`) show the same information in addition.

use super::style;

/// A colour as linear red, green and blue.
type Linear = [f64; 3];

const SEES: [(&str, [Linear; 3]); 4] = [
    ("all", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    (
        "no red",
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
    ),
    (
        "no green",
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ),
    ("grey", [[0.2126, 0.7152, 0.0722], [0.2126, 0.7152, 0.0722], [0.2126, 0.7152, 0.0722]]),
];

/// Smallest difference that is noticed side by side on a screen without searching: twice the just
/// noticeable difference of 2.3.
const SEEN: f64 = 4.6;

fn linear(colour: &str) -> Linear {
    let digits = colour.trim_start_matches('#');
    let wide =
        if digits.len() == 3 { digits.chars().flat_map(|c| [c, c]).collect() } else { digits.to_owned() };
    [0, 2, 4].map(|at| {
        let v = f64::from(u8::from_str_radix(&wide[at..at + 2], 16).expect("a colour")) / 255.0;
        if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    })
}

fn lab(rgb: Linear) -> [f64; 3] {
    let xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
        .map(|row| row.iter().zip(rgb).map(|(m, v)| m * v.clamp(0.0, 1.0)).sum::<f64>());
    let f = |v: f64| if v > 0.008_856 { v.cbrt() } else { 7.787 * v + 16.0 / 116.0 };
    let [x, y, z] = [xyz[0] / 0.9505, xyz[1], xyz[2] / 1.089].map(f);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The values of a variable of the style sheet in light and dark mode.
fn colours(name: &str) -> [String; 2] {
    let head = format!("--{name}:");
    let mut all = style()
        .split(head.as_str())
        .skip(1)
        .map(|rest| rest.split([';', '}']).next().expect("a value").to_owned());
    let light = all.next().expect("light");
    [light, all.next().expect("dark")]
}

#[test]
fn cells_differ_for_every_eye_in_light_and_dark() {
    // finished, given up; cells in progress and open ones need only differ by their text
    let names = ["good", "bad", "open"];
    for light in [0, 1] {
        for (eye, matrix) in SEES {
            let seen = names.map(|name| {
                let rgb = linear(&colours(name)[light]);
                lab(matrix.map(|row| row.iter().zip(rgb).map(|(m, v)| m * v).sum()))
            });
            let differ = |a: usize, b: usize| {
                seen[a].iter().zip(seen[b]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            };
            // without any colour, finished and given-up cells differ by ✕ instead of a number;
            // otherwise their colours differ
            if eye != "grey" {
                assert!(
                    differ(0, 1) > SEEN,
                    "{eye}, {light}: done and given up differ by {:.1}",
                    differ(0, 1)
                );
                assert!(
                    differ(1, 2) > SEEN,
                    "{eye}, {light}: given up and open differ by {:.1}",
                    differ(1, 2)
                );
            }
            println!(
                "{eye:9} {} {:5.1} {:5.1} {:5.1}",
                ["light", "dark"][light],
                differ(0, 1),
                differ(1, 2),
                differ(0, 2)
            );
        }
    }
}
