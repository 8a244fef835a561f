//! read(write(x)) = x for every data set, encoding and precision.

use super::*;
use num_complex::Complex;
use proptest::collection::vec;
use proptest::prelude::*;

/// A text that a line can represent: without surrounding blanks, and not the word `NONE`.
fn text(longest: usize) -> impl Strategy<Value = String> {
    proptest::string::string_regex(&format!("([!-~äµ°²]([ -~äµ°²]{{0,{}}}[!-~äµ°²])?)?", longest - 2))
        .expect("a pattern")
        .prop_filter("NONE is nothing, and -1 an end", |t| t != "NONE" && t != "-1")
}

/// A value rounded to the digits (or to single precision) that the encoding keeps.
fn kept(value: f64, precision: Precision, encoding: Encoding) -> f64 {
    match (precision, encoding) {
        (Precision::Single, Encoding::Binary(_)) => f64::from(value as f32),
        (Precision::Double, Encoding::Binary(_)) => value,
        (Precision::Single, Encoding::Ascii) => format!("{value:.5e}").parse().expect("a number"),
        (Precision::Double, Encoding::Ascii) => format!("{value:.12e}").parse().expect("a number"),
    }
}

fn place(value: f64, precision: Precision, encoding: Encoding) -> f64 {
    // next to double values, text has narrow abscissa columns
    let narrow = encoding == Encoding::Ascii;
    kept(value, if narrow { Precision::Single } else { precision }, encoding)
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-1e9..1e9f64, -1.0..1.0f64, Just(0.0), Just(-0.0), (-80..80i32).prop_map(|e| 10f64.powi(e))]
}

fn dof() -> impl Strategy<Value = Dof> {
    (text(10), -9_999_999..99_999_999i64, -6..=6i64).prop_map(|(entity, node, direction)| Dof {
        entity,
        node,
        direction,
    })
}

fn axis() -> impl Strategy<Value = Axis> {
    (0..21i64, [-3..4i64, -3..4i64, -3..4i64], text(20), text(20))
        .prop_map(|(quantity, exponents, label, unit)| Axis { quantity, exponents, label, unit })
}

prop_compose! {
    pub(super) fn function()(
        id in [text(80), text(80), text(80), text(80), text(80)],
        numbers in (0..28i64, 0..99_999i64, 0..999i64, 0..999_999i64),
        response in dof(), reference in dof(),
        precision in prop_oneof![Just(Precision::Single), Just(Precision::Double)],
        encoding in prop_oneof![
            Just(Encoding::Ascii), Just(Encoding::Binary(ByteOrder::Little)), Just(Encoding::Binary(ByteOrder::Big))
        ],
        complex in any::<bool>(),
        even in any::<bool>(),
        start in -9_999..9_999i64, step in 1..9_999i64, z in -99_999..99_999i64,
        raw in vec([number(), number(), number()], 0..40),
        axes in [axis(), axis(), axis(), axis()],
    ) -> Function {
        let keep = |v: f64| kept(v, precision, encoding);
        Function {
            id, kind: numbers.0, number: numbers.1, version: numbers.2, load_case: numbers.3, response, reference, precision,
            abscissa: if even {
                Abscissa::Even { start: start as f64 / 4.0, step: step as f64 / 8.0 }
            } else {
                Abscissa::Uneven(raw.iter().map(|v| place(v[0], precision, encoding)).collect())
            },
            values: if complex {
                Values::Complex(raw.iter().map(|v| Complex::new(keep(v[1]), keep(v[2]))).collect())
            } else {
                Values::Real(raw.iter().map(|v| keep(v[1])).collect())
            },
            z: z as f64 / 2.0,
            axes,
            encoding,
        }
    }
}

fn node() -> impl Strategy<Value = Node> {
    ([0..999_999_999i64, 0..99i64, 0..99i64, 0..99i64], [number(), number(), number()]).prop_map(
        |(n, position)| Node {
            label: n[0],
            definition_system: n[1],
            displacement_system: n[2],
            color: n[3],
            position,
        },
    )
}

fn element() -> impl Strategy<Value = Element> {
    (
        prop_oneof![Just(11), Just(22), Just(41), Just(44)],
        [0..99i64, 0..99i64, 0..99i64],
        vec(1..99_999_999i64, 0..20),
    )
        .prop_map(|(descriptor, n, nodes)| Element {
            label: n[0],
            descriptor,
            physical: n[1],
            material: n[2],
            color: 7,
            beam: (descriptor < 40).then_some(Beam {
                orientation: n[0],
                first_section: n[1],
                second_section: n[2],
            }),
            nodes,
        })
}

prop_compose! {
    fn header()(
        model in text(80), description in text(80), database_program in text(80), program in text(80),
        dates in [text(9), text(9), text(9), text(9), text(9), text(9)], n in [0..9999i64, 0..9999i64, 0..3i64],
    ) -> Header {
        let [a, b, c, d, e, f] = dates;
        Header {
            model, description, database_program, created: [a, b], versions: [n[0], n[1]], file_type: n[2], saved: [c, d],
            program, written: [e, f],
        }
    }
}

prop_compose! {
    fn nodal()(
        id in [text(80), text(80), text(80), text(80), text(80)], kinds in [0..9i64, 0..9i64, 0..9i64, 0..20i64],
        integers in vec(0..99_999i64, 0..12), reals in vec(number(), 0..12), is_complex in any::<bool>(),
        nodes in (1..8usize).prop_flat_map(|n| vec((1..9_999i64, vec([number(), number()], n..=n)), 0..4)),
    ) -> NodalData {
        let keep = |v: f64| kept(v, Precision::Single, Encoding::Ascii);
        let value = |v: [f64; 2]| Complex::new(keep(v[0]), if is_complex { keep(v[1]) } else { 0.0 });
        let [model, analysis, characteristic, quantity] = kinds;
        NodalData {
            id, model, analysis, characteristic, quantity, integers, is_complex,
            reals: reals.into_iter().map(keep).collect(),
            nodes: nodes.into_iter().map(|(n, of)| (n, of.into_iter().map(value).collect())).collect(),
        }
    }
}

pub(super) fn set() -> impl Strategy<Value = DataSet> {
    prop_oneof![
        4 => function().prop_map(|f| DataSet::Function(Box::new(f))),
        1 => vec(node(), 0..5).prop_map(|mut nodes| {
            for x in nodes.iter_mut().flat_map(|n| &mut n.position) {
                *x = format!("{x:.5e}").parse().expect("a number");
            }
            DataSet::Nodes(nodes)
        }),
        1 => vec(node(), 0..5).prop_map(DataSet::NodesDouble),
        1 => (0..999i64, 0..99i64, text(80), vec(0..9999i64, 0..30))
            .prop_map(|(number, color, name, nodes)| DataSet::TraceLine(TraceLine { number, color, name, nodes })),
        1 => vec(element(), 0..5).prop_map(DataSet::Elements),
        1 => header().prop_map(DataSet::Header),
        1 => nodal().prop_map(DataSet::NodalData),
        1 => (1..10i64, text(20), 1..3i64, [number(), number(), number(), number()]).prop_map(|(code, description, mode, n)| {
            DataSet::Units(Units {
                code, description, temperature_mode: mode, length: n[0], force: n[1], temperature: n[2], temperature_offset: n[3],
            })
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, rng_seed: proptest::test_runner::RngSeed::Fixed(58), ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read(sets in vec(set(), 0..6)) {
        let bytes = write(&sets).expect("writable");
        let read = read(&bytes);
        prop_assert_eq!(&read.faults, &vec![]);
        prop_assert_eq!(read.sets, sets);
    }
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let line =
        |name: &str| DataSet::TraceLine(TraceLine { number: 1, color: 0, name: name.into(), nodes: vec![1] });
    let error = write(&[line("ok"), line(&"x".repeat(81))]).expect_err("too long");
    assert_eq!((error.place, error.data_set), (2, 82));
    assert!(error.to_string().contains("80 characters"), "{error}");
    assert!(write(&[line("a\nb")]).expect_err("two lines").to_string().contains("control character"));
    assert!(write(&[line("-1")]).expect_err("a delimiter").to_string().contains("end the data set"));
}

#[test]
fn an_abscissa_is_even_where_its_header_can_say_so() {
    let grid = |step: f64| (0..1000).map(|i| 5.0 + i as f64 * step).collect::<Vec<_>>();
    assert_eq!(Abscissa::of(&grid(0.5)), Abscissa::Even { start: 5.0, step: 0.5 });
    assert_eq!(Abscissa::of(&grid(1.0 / 51_200.0)), Abscissa::Even { start: 5.0, step: 1.953_125e-5 });
    assert!(matches!(Abscissa::of(&grid(1.0 / 3.0)), Abscissa::Uneven(_)));
    assert!(matches!(Abscissa::of(&[1.0, 2.0, 4.0]), Abscissa::Uneven(_)));
}
