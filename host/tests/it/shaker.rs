//! The shaker's levels through the whole chain: simulated rig, firmware, link, campaign file,
//! analysis.
#![cfg(feature = "sim")]
#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig::analyse::{Wanted, analyse};
use jointrig::campaign::plan::PAPER;
use jointrig::campaign::plan::level::{Held, Level, Moment};
use jointrig::campaign::run::shaking::{
    self, ChannelLimits, LevelOptions, Outcome, ShakeError, Shortfall, Summary,
};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::level_table::LevelRow;
use jointrig::device::address::Address;
use jointrig::device::session::Session;
use jointrig::exchange::read_hysteresis;
use jointrig::exchange::uff::{self, DataSet, Values};
use jointrig::report::document;
use jointrig::results::{Excitation, Force, Hysteresis, Results, Shape};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn step(frequency_hz: f64, amplitude: f64) -> Level {
    Level { frequency_hz, end_hz: None, held: Held::Displacement, amplitude }
}

fn options(levels: Vec<Level>) -> LevelOptions {
    LevelOptions {
        levels,
        moment: Moment::Before,
        seconds: 0.6,
        sweep_hz_per_s: 40.0,
        most_drive_v: None,
        limits: ChannelLimits::default(),
        new_structure: false,
        stop: Arc::new(AtomicBool::new(false)),
    }
}

/// A campaign file in a separate folder.
struct Bench {
    _folder: tempfile::TempDir,
    file: PathBuf,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.jrig");
        Store::create(&file, PAPER, "paper.toml").unwrap().close().unwrap();
        Self { _folder: folder, file }
    }

    /// The address of a shipped rig without errors: loops are compared with the rig's own
    /// parameters here.
    fn exact(&self, name: &str) -> String {
        let shipped = format!("{}/../hil-sim/rigs/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(shipped).unwrap();
        let (body, _) = text.split_once("[errors]").unwrap_or((&text, ""));
        let path = self.file.with_extension("toml");
        std::fs::write(&path, format!("{body}\n[errors]\nnone = true\n")).unwrap();
        format!("sim:{}", path.display())
    }

    fn run(&self, address: &str, options: &LevelOptions) -> Result<Summary, ShakeError> {
        self.run_and_tell(address, options, &mut |_| {})
    }

    fn run_and_tell(
        &self,
        address: &str,
        options: &LevelOptions,
        tell: &mut dyn FnMut(Option<&Outcome>),
    ) -> Result<Summary, ShakeError> {
        let mut store = Store::open(&self.file).unwrap();
        let transport = address.parse::<Address>().unwrap().open(3).unwrap();
        let mut session = Session::open(transport, address).unwrap();
        let summary = shaking::run(&mut store, &mut session, options, &mut |_, _, outcome| tell(outcome));
        assert!(session.shaker_rests().unwrap(), "it must rest however the run ended");
        store.close().unwrap();
        summary
    }

    fn analysed(&self) -> Results {
        let store = Store::open_read_only(&self.file).unwrap();
        assert_eq!(store.verify().unwrap(), []);
        document(analyse(&store, Wanted::default(), &|_| {}).unwrap())
    }
}

fn rows(results: &Results, force: Force) -> Vec<&Hysteresis> {
    results.hysteresis.iter().filter(|h| h.kind == Excitation::Shaker && h.force == force).collect()
}

fn stored(summary: &Summary) -> usize {
    summary.outcomes.iter().filter(|outcome| matches!(outcome, Outcome::Stored(_))).count()
}

/// The levels of the file; every one must be intact.
fn rows_of(bench: &Bench) -> Vec<LevelRow> {
    let store = Store::open_read_only(path(bench)).unwrap();
    store.levels().unwrap().into_iter().collect::<Result<_, _>>().unwrap()
}

fn path(bench: &Bench) -> &Path {
    &bench.file
}

#[test]
fn the_papers_fifteen_levels_on_the_default_rig() {
    let bench = Bench::new();
    let levels: Vec<Level> = [100.0, 200.0, 250.0, 300.0, 500.0]
        .into_iter()
        .flat_map(|f| [0.1e-6, 0.15e-6, 0.2e-6].map(|a| step(f, a)))
        .collect();
    let summary = bench.run(&bench.exact("default"), &options(levels)).unwrap();
    assert_eq!(stored(&summary), 15);
    for row in rows_of(&bench) {
        let settled = row.settled();
        assert!((settled.reached / row.level().amplitude - 1.0).abs() < 0.02, "{row:?}");
        assert!(settled.overshoot < 1.2, "{row:?}");
    }
    let results = bench.analysed();
    let raw = rows(&results, Force::Raw);
    assert_eq!(raw.len(), 15);
    for row in raw {
        let (f, amplitude) = (row.frequency_hz.unwrap(), row.amplitude_m.unwrap());
        let k_t = row.stick_slope().map(|k| k.mean * 1e-6);
        assert!(row.findings.is_empty(), "{f} Hz: {:?}", row.findings);
        match f.round() as u32 {
            100 => assert!((k_t.unwrap() - 139.0).abs() < 5.0, "{row:?}"),
            200 => {
                let k_eq = row.k_eq_n_per_m.unwrap().mean * 1e-6;
                assert_eq!((row.shape, k_t), (Shape::Elliptical, None));
                assert!((75.0..100.0).contains(&k_eq), "{k_eq} at {amplitude}");
                assert!((row.phase_deg.unwrap() - 65.0).abs() < 3.0, "{row:?}");
            }
            250 => assert!((k_t.unwrap() / 195.0 - 1.0).abs() < 0.03, "{row:?}"),
            300 => assert!((k_t.unwrap() / 180.0 - 1.0).abs() < 0.03, "{row:?}"),
            _ => assert_eq!(row.shape, Shape::Stuck, "{row:?}"),
        }
    }
    // five frequencies, of which one has no contact stiffness and no two agree: a single mass
    // cannot explain that
    assert!(results.static_arm.is_none(), "{:?}", results.static_arm);
    assert!(results.missing.iter().any(|m| m.contains("--effective-mass")), "{:?}", results.missing);
}

#[test]
fn with_a_rigid_clamp_every_corrected_loop_is_the_contact() {
    let bench = Bench::new();
    let levels: Vec<Level> = [100.0, 200.0, 250.0, 300.0, 500.0].map(|f| step(f, 0.15e-6)).to_vec();
    bench.run(&bench.exact("rigid-clamp"), &options(levels)).unwrap();
    let results = bench.analysed();
    let arm = results.static_arm.expect("stuck loops at five frequencies tell the arm's mass");
    assert!((1.3..2.1).contains(&arm.correction.effective_mass_kg), "{arm:?}");
    let corrected = rows(&results, Force::Corrected);
    assert_eq!(corrected.len(), 5);
    for row in corrected {
        let k = row.stick_slope().expect("a straight line").mean;
        assert!((k / 180e6 - 1.0).abs() < 0.03, "{:?} Hz: {k}", row.frequency_hz);
    }
    // and without the correction it does not: 14 % too high at 500 Hz
    let raw = rows(&results, Force::Raw);
    assert!(raw.iter().any(|row| row.stick_slope().unwrap().mean > 1.1 * 180e6));
}

#[test]
fn a_sweep_finds_the_hidden_resonance() {
    let bench = Bench::new();
    let sweep = Level { frequency_hz: 120.0, end_hz: Some(320.0), held: Held::Force, amplitude: 2.0 };
    assert_eq!(stored(&bench.run("sim:", &options(vec![sweep])).unwrap()), 1);
    let results = bench.analysed();
    let check = results.check("hidden-resonance").unwrap();
    assert_eq!(check.ok, Some(false), "{check:?}");
    assert!((check.frequency_hz.unwrap() - 192.0).abs() < 3.0, "{check:?}");
}

/// A rig with a rigid clamp whose contact slips as a whole: k_T (N/µm), μ, N (N).
struct Slider {
    k: f64,
    friction: f64,
    load: f64,
}

impl Slider {
    /// Its address, with its description in the bench's folder.
    fn rig(&self, bench: &Bench) -> String {
        let path = bench.file.with_extension("toml");
        let Self { k, friction, load } = self;
        let text = format!(
            "[contact]\nlaw = \"jenkins\"\nstiffness_n_per_m = [180e6, 260e6, {k:e}]\nfriction_coefficient = {friction:?}\n\
             normal_load_n = {load:?}\n[clamp]\nrigid = true\n[errors]\nnone = true\n",
            k = 1e6 * k
        );
        std::fs::write(&path, text).unwrap();
        format!("sim:{}", path.display())
    }
}

/// Errors of the raw k_T, μ and energy of each level through the whole chain, in per cent. The
/// paper's plan states N = 300 N.
fn slipped(slider: &Slider, levels: Vec<Level>) -> Vec<(Level, [f64; 3])> {
    let bench = Bench::new();
    let Slider { k, friction, load } = *slider;
    let options = LevelOptions { seconds: 1.0, ..options(levels) };
    let summary = bench.run(&slider.rig(&bench), &options).unwrap();
    for outcome in &summary.outcomes {
        assert!(matches!(outcome, Outcome::Stored(_)), "k_T {k} N/µm, μ {friction}: {outcome:?}");
    }
    let results = bench.analysed();
    let rows = rows(&results, Force::Raw);
    let levels = rows_of(&bench);
    assert_eq!(rows.len(), levels.len());
    let errors = rows.into_iter().map(|row| {
        assert_eq!(row.shape, Shape::GrossSlip, "{row:?}");
        // no findings for these loops, however much they ring
        assert!(row.findings.is_empty(), "{:?}", row.findings);
        let limit = friction * load;
        let energy = 4.0 * limit * (row.amplitude_m.unwrap() - limit / k * 1e-6);
        let pairs = [
            (row.stick_slope().unwrap().mean, 1e6 * k),
            (row.friction_coefficient.unwrap(), limit / 300.0),
            (row.energy_j.unwrap().mean, energy),
        ];
        pairs.map(|(found, truth)| 100.0 * (found / truth - 1.0))
    });
    levels.iter().map(LevelRow::level).zip(errors).collect()
}

/// Raw force, whole chain: k_T, μ and energy of a contact that slips as a whole.
#[test]
fn gross_slip_gives_back_the_rigs_friction() {
    let reference = Slider { k: 180.0, friction: 0.6, load: 300.0 };
    let weaker = Slider { k: 180.0, friction: 0.35, load: 300.0 };
    let softer = Slider { k: 95.0, friction: 0.6, load: 300.0 };
    let found = [
        slipped(&reference, vec![step(32.0, 3e-6), step(25.0, 10e-6)]),
        slipped(&weaker, vec![step(30.0, 3e-6), step(32.0, 10e-6)]),
        slipped(&softer, vec![step(27.0, 6e-6)]),
    ];
    for (level, errors) in found.into_iter().flatten() {
        assert!(errors.iter().all(|error| error.abs() < 3.0), "{level}: {errors:?} %");
    }
}

/// A table over contacts, frequencies and amplitudes (`--nocapture` prints it). No level may be
/// missing. The error due to a tilt over 0.5 mm between spot and contact grows with k_T: see
/// `docs/hysteresis.md`.
#[test]
fn slip_table() {
    println!("k_T N/µm, μN N, level: errors of raw k_T, μ, energy in per cent");
    for (k, most) in [(95.0, 3.0), (180.0, 3.0), (320.0, 4.5)] {
        for friction in [0.35, 0.6, 0.9] {
            let slider = Slider { k, friction, load: 300.0 };
            // well beyond the slip limit
            let slips = |amplitude: &f64| *amplitude > 1.3e-6 * friction * 300.0 / k;
            let amplitudes: Vec<f64> = [3e-6, 5e-6, 10e-6].into_iter().filter(slips).collect();
            let levels: Vec<Level> =
                [25.0, 28.5, 32.0].iter().flat_map(|f| amplitudes.iter().map(|a| step(*f, *a))).collect();
            let wanted = levels.len();
            let found = slipped(&slider, levels);
            assert_eq!(found.len(), wanted, "{k} {friction}");
            for (level, errors) in found {
                let [k_t, mu, energy] = errors;
                println!("{k:4} {:4} {level}: {k_t:5.2} {mu:5.2} {energy:5.2}", 300.0 * friction);
                assert!(k_t.abs() < most && mu.abs() < 3.0 && energy.abs() < 3.0, "{k} {friction} {level}");
            }
        }
    }
}

/// k_eq of Iwan elements (20, together 180 N/µm and 180 N, limits spread by 0.9) for this closed
/// cycle of Δx, m.
fn iwan(displacement_m: &[f64]) -> f64 {
    let elements = 20;
    let each = 180e6 / f64::from(elements);
    let limits = (0..elements).map(|i| 180.0 / 20.0 * (0.1 + 1.8 * f64::from(i) / 19.0));
    let mut sliders: Vec<(f64, f64)> = limits.map(|limit| (limit, 0.0)).collect();
    let mut force = Vec::new();
    // the first cycle is the transient
    for x in displacement_m.iter().chain(displacement_m) {
        force.push(
            sliders
                .iter_mut()
                .map(|(limit, slider)| {
                    let force = (each * (x - *slider)).clamp(-*limit, *limit);
                    *slider = x - force / each;
                    force
                })
                .sum(),
        );
    }
    jointrig::hysteresis::loops::slope(displacement_m, &force[displacement_m.len()..])
}

#[test]
fn microslip_softens_the_loop_with_amplitude_as_its_law_says() {
    let bench = Bench::new();
    // at 0.1 µm the integrated noise, some nanometres at 32 Hz, reduces the slope by 1 to 4 %
    let levels: Vec<Level> = [0.4e-6, 0.8e-6, 1.2e-6, 1.6e-6].map(|a| step(32.0, a)).to_vec();
    bench.run(&bench.exact("iwan"), &options(levels)).unwrap();
    let store = Store::open_read_only(path(&bench)).unwrap();
    let mut before = f64::INFINITY;
    for row in rows_of(&bench) {
        let channels = store.channels(row.session).unwrap();
        let record = shaking::record(
            &channels,
            &store.plan().unwrap().load_cells(&channels),
            &store.level_samples(&row).unwrap(),
            &row.level(),
        )
        .unwrap();
        let found = jointrig::hysteresis::analyse(&record).unwrap();
        let (k, law) = (found.k_eq_n_per_m.mean, iwan(&found.loop_displacement_m));
        println!("{} {:?}: {k:.4e} for {law:.4e}", row.level(), found.shape);
        assert!((k / law - 1.0).abs() < 0.03, "{}: {k} for {law}", row.level());
        assert!(k < before, "{}", row.level());
        before = k;
    }
    // at 1.6 µm most elements slip
    assert!(before < 0.65 * 180e6);
}

/// 139 N/µm between the spots at 100 Hz, an ellipse at 200 Hz, and a contact of 180 N/µm: these
/// must not be confused.
#[test]
fn a_records_loop_is_never_called_the_contacts_own_stiffness() {
    let bench = Bench::new();
    bench.run(&bench.exact("default"), &options(vec![step(100.0, 1e-7), step(200.0, 1e-7)])).unwrap();
    let folder = path(&bench).with_extension("exported");
    let jointrig = || std::process::Command::new(env!("CARGO_BIN_EXE_jointrig"));
    assert!(
        jointrig()
            .arg("export")
            .arg(path(&bench))
            .args(["--format", "npz", "--out"])
            .arg(&folder)
            .status()
            .unwrap()
            .success()
    );
    for level in ["level_1.npz", "level_2.npz"] {
        let record = folder.join("levels").join(level);
        let said =
            String::from_utf8(jointrig().arg("hysteresis").arg(&record).output().unwrap().stdout).unwrap();
        assert!(
            said.contains("between the spots") && !said.contains("own") && !said.contains("k_T"),
            "{said}"
        );
        let out = jointrig().arg("hysteresis").arg(&record).arg("--json").output().unwrap();
        let found: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        assert!(found["hysteresis"][0]["k_t_n_per_m"].is_null(), "{found}");
    }
}

#[test]
fn exported_levels_say_the_same_to_other_programs() {
    let bench = Bench::new();
    let sweep = Level { frequency_hz: 240.0, end_hz: Some(260.0), held: Held::Drive, amplitude: 0.1 };
    bench.run("sim:", &options(vec![step(250.0, 1e-7), sweep])).unwrap();
    let results = bench.analysed();
    let folder = path(&bench).with_extension("exported");
    let export = |format: &str, more: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_jointrig"));
        command.arg("export").arg(path(&bench)).args(["--format", format, "--out"]).arg(&folder).args(more);
        let out = command.output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    };
    assert!(export("npz", &[]).contains("2 levels of the shaker"));
    let record = read_hysteresis(&folder.join("levels/level_1.npz")).unwrap();
    let again = jointrig::hysteresis::analyse(&record).unwrap();
    let raw = rows(&results, Force::Raw);
    assert_eq!(raw.iter().map(|row| row.level).collect::<Vec<_>>(), [Some(1)], "a sweep has no loop");
    assert_eq!(Some(again.k_eq_n_per_m), raw[0].k_eq_n_per_m);
    assert_eq!(read_hysteresis(&folder.join("levels/level_2.npz")).unwrap().excitation_hz, None);

    let table = |name: &str| -> Vec<Vec<String>> {
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).from_path(folder.join("levels").join(name)).unwrap();
        reader.records().map(|row| row.unwrap().iter().map(String::from).collect()).collect()
    };
    let levels = table("levels.csv");
    let column = |name: &str| levels[0].iter().position(|heading| heading == name).unwrap();
    assert_eq!(levels.len(), 3);
    assert_eq!([&levels[1][column("amplitude")], &levels[2][column("end_hz")]], ["0.0000001", "260"]);
    assert_eq!(levels[2][column("file")], "level_2.npz");

    export("csv", &[]);
    let samples = table("level_1.csv");
    assert_eq!(samples[0], ["time_s", "velocity_a_m_per_s", "velocity_b_m_per_s", "force_n"]);
    assert_eq!(samples.len(), record.force_n.len() + 1);
    assert_eq!(samples[100][3].parse(), Ok(record.force_n[99]));

    export("uff58", &[]);
    let contents = uff::read(&std::fs::read(folder.join("levels/level_1.uff")).unwrap());
    let forces: Vec<_> = contents
        .sets
        .iter()
        .filter_map(|set| match set {
            DataSet::Function(function) if function.response.entity == "contact" => Some(function),
            _ => None,
        })
        .collect();
    assert!(matches!(&forces[..], [f] if f.values == Values::Real(record.force_n.clone())));

    // without the records only the table is exported
    std::fs::remove_dir_all(&folder).unwrap();
    export("npz", &["--without-records"]);
    assert_eq!(table("levels.csv")[1][column("file")], "");
    assert!(!folder.join("levels/level_1.npz").exists());
}

#[test]
fn levels_in_the_file_are_skipped_and_an_interrupt_comes_to_rest() {
    let bench = Bench::new();
    let levels = vec![step(250.0, 1e-7), step(300.0, 1e-7), step(250.0, 2e-7)];
    let stopped = options(levels.clone());
    let stop = stopped.stop.clone();
    let summary = bench
        .run_and_tell("sim:", &stopped, &mut |outcome| {
            // during the second level
            if outcome.is_some() {
                stop.store(true, Ordering::Relaxed);
            }
        })
        .unwrap();
    assert!(summary.interrupted && stored(&summary) == 1, "{summary:?}");
    let summary = bench.run("sim:", &options(levels.clone())).unwrap();
    assert!(matches!(summary.outcomes[0], Outcome::Known(_)) && stored(&summary) == 2);
    // measured after the cells they are separate levels
    let after = LevelOptions { moment: Moment::After, ..options(levels) };
    assert_eq!(stored(&bench.run("sim:", &after).unwrap()), 3);
    let results = bench.analysed();
    assert_eq!(results.check("contact-unchanged").unwrap().ok, Some(true));
}

#[test]
fn limits_end_the_run_by_name_and_what_is_out_of_reach_only_the_level() {
    let bench = Bench::new();
    let levels = vec![step(250.0, 1e-7), step(300.0, 2e-7)];
    // 250 Hz and 0.1 µm need 0.23 V, 300 Hz and 0.2 µm 1.03 V
    let weak = LevelOptions { most_drive_v: Some(0.5), ..options(levels.clone()) };
    let summary = bench.run("sim:", &weak).unwrap();
    assert!(matches!(summary.outcomes[1], Outcome::Short(_, Shortfall::Weak { .. })), "{summary:?}");
    assert_eq!(stored(&summary), 1);
    // x_A moves 0.2 µm · 2.5 at 300 Hz: 1 mm/s
    let name = {
        let store = Store::open_read_only(path(&bench)).unwrap();
        let channels = store.channels(1).unwrap();
        channels.channels[channels.place(jointrig_protocol::channel::Role::SpecimenA).unwrap()]
            .name
            .to_string()
    };
    let limited =
        LevelOptions { limits: ChannelLimits(vec![(name.clone(), 2e-4)]), ..options(levels.clone()) };
    let error = bench.run("sim:", &limited).unwrap_err().to_string();
    assert!(error.contains("300 Hz, 0.2 µm") && error.contains(&name) && error.contains("0.0002"), "{error}");
    let unknown = LevelOptions { limits: ChannelLimits(vec![("LDV_Z".into(), 1.0)]), ..options(levels) };
    assert!(bench.run("sim:", &unknown).unwrap_err().to_string().contains("LDV_Z"));
}
