use super::super::assemble::assemble;
use super::super::averages::{Asked, CellSums, LINES_HZ};
use super::*;
use crate::analyse::missing::Missing;
use crate::campaign::plan::SMALL;
use crate::campaign::store::notes::utc_now;
use crate::campaign::store::record_table::NewRecord;
use crate::campaign::store::session_table::{Counters, SessionInfo};
use crate::campaign::store::stored::Hex;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use crate::substructuring::Frf;
use clap::Parser;
use jointrig_protocol::channel::{Axis, Channel};
use jointrig_protocol::shot::{Phase, Shot};
use std::f64::consts::{PI, TAU};
use std::path::Path;

const RATE: u32 = 51_200;
const TRIGGER: usize = 256;
/// Slope of the simulated loops, N/m.
const SLOPE: f64 = 150e6;

/// Delay of the responses, ns.
const LATE_NS: u32 = 20_000;

/// Channels with the rig's scales; the polarity of B's vibrometer is inverted, as indicated by the
/// sign of its scale.
fn map(late_ns: u32) -> ChannelMap {
    let channel = |name: &str, role, quantity, units_per_volt| Channel {
        name: name.try_into().expect("short"),
        role,
        quantity,
        units_per_volt,
        range_v: 10.0,
        delay_ns: if matches!(role, Role::Response(_)) { late_ns } else { 0 },
        bits: 16,
    };
    let mut channels = vec![channel("hammer", Role::HammerForce, Quantity::Force, 44.6)];
    for (name, axis) in [("x", Axis::X), ("y", Axis::Y), ("z", Axis::Z)] {
        channels.push(channel(name, Role::Response(axis), Quantity::Velocity, 0.005));
    }
    channels.push(channel("ldv_a", Role::SpecimenA, Quantity::Velocity, 0.001));
    channels.push(channel("ldv_b", Role::SpecimenB, Quantity::Velocity, -0.001));
    for name in ["lc1", "lc2", "lc3"] {
        channels.push(channel(name, Role::LoadCell, Quantity::Force, 20.0));
    }
    ChannelMap { id: 0, rate_hz: RATE, exact_hz: None, channels }
}

/// A hit at the trigger, and a decay at 208 Hz in all other channels, delayed by the channel's
/// delay; T and Δx in phase with the slope above.
fn recording(map: &ChannelMap, peak_n: f64) -> Recording {
    recording_off(map, peak_n, 0)
}

/// As [`recording`], with all channels but the force off by this many codes.
fn recording_off(map: &ChannelMap, peak_n: f64, codes: i16) -> Recording {
    let off = |role: Role| if role == Role::HammerForce { 0 } else { codes };
    let scans = TRIGGER + 2 * RATE as usize;
    let at = |scan: usize| (scan as f64 - TRIGGER as f64) / f64::from(RATE);
    let (w, decay) = (TAU * 208.0, 20.0);
    let value = |role: Role, t: f64| -> f64 {
        if role == Role::HammerForce {
            let share = t / 0.41e-3;
            return if (0.0..1.0).contains(&share) { peak_n * (PI * share).sin() } else { 0.0 };
        }
        if t < 0.0 {
            return 0.0;
        }
        let ring = (-decay * t).exp();
        let (sine, cosine) = (w * t).sin_cos();
        // derivative of ring · sine
        let rate = ring * (w * cosine - decay * sine);
        match role {
            Role::SpecimenA => peak_n * 6e-9 * rate,
            Role::SpecimenB => peak_n * 4e-9 * rate,
            Role::LoadCell => SLOPE * peak_n * 2e-9 * ring * sine / 3.0,
            _ => peak_n * 5e-9 * rate,
        }
    };
    let codes: Vec<i16> = map
        .channels
        .iter()
        .flat_map(|c| {
            (0..scans).map(move |s| {
                let late_s = f64::from(c.delay_ns) * 1e-9;
                (value(c.role, at(s) - late_s) / c.units_per_code()).round() as i16 + off(c.role)
            })
        })
        .collect();
    let shot = Shot {
        number: 1,
        phase: Phase::Done,
        fired_at: 0,
        trigger: TRIGGER as u64,
        pulse_us: 3_000,
        peak_n: peak_n as f32,
        width_us: 410.0,
        rebound_ratio: 0.0,
        rebound_after: 0,
        friction_peak_n: 0.0,
        quiet_ratio: 0.0,
    };
    Recording {
        epoch: 1,
        first_scan: 0,
        trigger_index: TRIGGER,
        samples: Samples::of_codes(&codes, map.len()),
        gaps: vec![],
        shot,
    }
}

/// A campaign in which only AJB was measured: two good hits and a refused one in each of its cells.
/// There is one session for each of the delays; the cells' hits alternate between them.
fn campaign(path: &Path, late_ns: &[u32]) -> Store {
    campaign_of(path, SMALL, late_ns, 1.0)
}

/// As [`campaign`], with this plan; the reading of the vibrometer on specimen A is `ldv_a` times
/// its motion along z.
fn campaign_of(path: &Path, plan: &str, late_ns: &[u32], ldv_a: f32) -> Store {
    campaign_with(path, plan, late_ns, &|map, peak_n| recording(&read_by(map, ldv_a), peak_n))
}

/// As [`campaign`], with this plan and these recordings.
fn campaign_with(
    path: &Path,
    plan: &str,
    late_ns: &[u32],
    recorded: &dyn Fn(&ChannelMap, f64) -> Recording,
) -> Store {
    let mut store = Store::create(path, plan, "small.toml").expect("created");
    let info = SessionInfo {
        address: "sim:".into(),
        board: "virtual".into(),
        serial: "7".into(),
        firmware_version: "0.1.0".into(),
        target: "x".into(),
        build: Hex(1),
        schema_hash: Hex(2),
    };
    let sessions: Vec<(i64, ChannelMap)> = late_ns
        .iter()
        .map(|late_ns| (store.begin_session(&info, &map(*late_ns)).expect("session"), map(*late_ns)))
        .collect();
    for cell in
        store.cells().expect("cells").iter().filter(|c| structure(c.cell.configuration) == Structure::Ajb)
    {
        for (attempt, (peak, kind)) in
            [(50.0, Verdict::Good), (48.0, Verdict::DoubleHit), (46.0, Verdict::Good)].into_iter().enumerate()
        {
            let verdict =
                Judgement { peak_n: peak, ..Judgement::without_pulse(kind, 0.0, 0.0, "made up".into()) };
            let (session, map) = &sessions[(attempt / 2) % sessions.len()];
            let record = NewRecord {
                cell: cell.id,
                attempt: attempt as u32,
                session: *session,
                utc: utc_now(),
                utc_error_s: None,
                recording: recorded(map, peak),
                verdict,
            };
            store.insert(&record, &Counters::new()).expect("stored");
        }
    }
    store
}

/// The channels as they would have to be to read the motion along z.
fn read_by(map: &ChannelMap, ldv_a: f32) -> ChannelMap {
    let mut map = map.clone();
    let own = map.channels.iter_mut().filter(|channel| channel.role == Role::SpecimenA);
    own.for_each(|channel| channel.units_per_volt *= ldv_a);
    map
}

#[test]
fn a_vibrometer_that_looks_the_other_way_changes_nothing_if_the_plan_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let ldv_a = "{ name = \"LDV_A\", position_m = [0.0006, 0.0005, 0.0], direction = [0, 0, 1] }";
    assert!(SMALL.contains(ldv_a));
    let plan = SMALL.replace(ldv_a, &ldv_a.replace("[0, 0, 1]", "[0, 0, -1]"));
    let found = |store: &Store| analyse(store, Wanted::default(), &|_| {}).expect("readable").contact;
    let usual = found(&campaign(&path("usual.jrig"), &[LATE_NS]));
    assert!(usual.as_ref().expect("looked for").impacts.is_some());
    assert!(found(&campaign_of(&path("said.jrig"), &plan, &[LATE_NS], -1.0)) == usual, "to the last bit");
    assert!(found(&campaign_of(&path("unsaid.jrig"), SMALL, &[LATE_NS], -1.0)) != usual);
}

#[test]
fn what_a_sensor_shows_before_the_hit_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    // codes by which all sensors but the hammer's are off, as by a body that still sways
    let hits = |codes: i16| {
        let path = folder.path().join(format!("{codes}.jrig"));
        let store = campaign_with(&path, SMALL, &[LATE_NS], &|map, peak_n| recording_off(map, peak_n, codes));
        let file = CampaignFile::open(&store, KnownContact::default()).expect("readable");
        let mut all = Vec::new();
        for name in file.cells() {
            file.each_hit(&name, true, &mut |hit, _| all.push(hit.clone())).expect("readable");
        }
        all
    };
    let (usual, off) = (hits(0), hits(700));
    assert!(!usual.is_empty());
    for (usual, off) in usual.iter().zip(&off) {
        assert!(usual.contact.is_some());
        let signals = |hit: &Hit| {
            let contact = hit.contact.clone().expect("measured");
            let own = [contact.specimen_a_m_per_s, contact.specimen_b_m_per_s, contact.tangential_n];
            hit.response.iter().cloned().chain(own).collect::<Vec<_>>()
        };
        for (usual, off) in signals(usual).iter().zip(&signals(off)) {
            let largest = usual.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            // rounding of sums of 192 samples
            let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * largest;
            assert!(usual.iter().zip(off).all(same));
        }
        assert_eq!(usual.force_n, off.force_n);
    }
}

#[test]
fn a_campaign_that_stopped_half_way_gives_what_it_can() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = campaign(&folder.path().join("half.jrig"), &[LATE_NS]);
    store.note_link(1, &[("frames_received".to_owned(), 17)].into()).expect("noted");
    let found = analyse(&store, Wanted::default(), &|_| {}).expect("readable");
    let contact = found.contact.as_ref().expect("looked for");
    let loops = contact.impacts.as_ref().expect("hits along z on A");
    let slope = loops.slope_n_per_m;
    // 16-bit steps: 0.3 µm/s in 2 mm/s
    assert!((slope.mean / SLOPE - 1.0).abs() < 0.01, "{slope:?}");
    // AZ1 is used, AY1 is not: two locations with two good hits
    assert_eq!((slope.cycles, loops.slopes.len(), loops.records.len()), (4, 4, 4));
    let ajb = found.completeness.iter().find(|c| c.configuration == "AJB").expect("counted");
    assert_eq!((ajb.kept, ajb.refused["double hit"]), (8, 4));
    assert_eq!(found.source.device["board"], "virtual");
    assert_eq!(found.source.link["frames_received"], 17);
    assert_eq!(found.source.file, "half.jrig");
    let unmeasured = |m: &Missing| matches!(m, Missing::NotMeasured { configuration: Structure::A, .. });
    assert!(found.missing.iter().any(unmeasured), "{:?}", found.missing);
    assert!(found.substructured.is_none() && found.fits.is_empty());
    let frfs = || found.configurations.iter().flat_map(|c| &c.frfs).chain(&contact.frfs);
    assert!(frfs().count() > 0 && frfs().all(|c| c.step_hz == 0.5), "two seconds give half-hertz lines");
}

/// The FRFs that the analysis passes to substructuring.
fn analysed(store: &Store) -> Frf {
    let file = CampaignFile::open(store, KnownContact::default()).expect("readable");
    let cells = file.cells();
    let averages = cells.iter().filter_map(|name| {
        let asked = Asked { contact: true, damped: false };
        let mut sums = CellSums::new(name.clone(), file.sigma_per_s(), asked, LINES_HZ);
        let mut add = |hit: &Hit, fs_hz| sums.add(hit, fs_hz).expect("alike");
        file.each_hit(name, true, &mut add).expect("readable");
        sums.finish().ok()
    });
    let averages: Vec<_> = averages.collect();
    assemble(Structure::Ajb, &file.geometry().ajb, &averages, file.quantity())
        .measured
        .expect("all of its cells")
}

#[test]
fn two_sessions_are_exported_as_they_are_analysed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    // a difference of sixteen samples between the sessions
    let store = campaign(&path("two.jrig"), &[LATE_NS, LATE_NS + 312_500]);
    let file = path("two.jrig");
    let out = path("out");
    let words =
        ["jointrig", "export", "--without-records", "--format", "npz", "--out"].map(std::ffi::OsStr::new);
    let words = words.into_iter().chain([out.as_os_str(), file.as_os_str()]);
    crate::cli::Cli::parse_from(words).run().expect("exported");
    let exported = crate::exchange::read_frf(&out.join("frf/AJB.npz")).expect("written");
    let two = analysed(&store);
    assert!(two.variance().is_some() && exported.coherence().is_some(), "two hits");
    // coherence is computed only for export
    assert_eq!(exported.lines(), two.lines(), "to the last bit");
    assert_eq!(exported.variance(), two.variance(), "to the last bit");
    assert_eq!([exported.outputs(), exported.inputs()], [two.outputs(), two.inputs()]);
    assert_eq!(exported.frequency_hz(), two.frequency_hz());
    // each hit is corrected by its own session's delays, so the FRFs equal those of one session
    let one = analysed(&campaign(&path("one.jrig"), &[LATE_NS]));
    for (line, f) in two.frequency_hz().iter().enumerate().filter(|(_, f)| (100.0..400.0).contains(*f)) {
        let difference = (&two.lines()[line] - &one.lines()[line]).norm();
        // 16-bit steps; an uncorrected delay would cause 0.1 at 100 Hz and more above
        assert!(difference < 1e-3 * one.lines()[line].norm(), "{f} Hz: {difference}");
    }
}

#[test]
fn sessions_of_other_rates_are_not_averaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = campaign(&folder.path().join("two.jrig"), &[LATE_NS]);
    let mut file = CampaignFile::open(&store, KnownContact::default()).expect("readable");
    let other = ChannelMap { rate_hz: RATE / 2, ..map(LATE_NS) };
    let session = file.channels.keys().max().expect("a session") + 1;
    file.channels.insert(session, other);
    let cell = file.records.values_mut().next().expect("a cell");
    cell.last_mut().expect("three records").as_mut().expect("whole").session = session;
    let told: Vec<String> =
        file.cells().iter().filter_map(|name| file.read(name, true).err()).map(|e| e.to_string()).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("25600 Hz") && told[0].contains("51200 Hz"), "{told:?}");
}

#[test]
fn a_new_campaign_is_no_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::create(&folder.path().join("new.jrig"), SMALL, "small.toml").expect("created");
    let seen = std::sync::atomic::AtomicUsize::new(0);
    let found = analyse(&store, Wanted::default(), &|p| {
        seen.fetch_max(p.done, std::sync::atomic::Ordering::Relaxed);
    })
    .expect("readable");
    assert_eq!(seen.into_inner(), store.cells().expect("cells").len());
    let contact = found.contact.expect("looked for");
    assert!(contact.impacts.is_none() && contact.levels.is_empty() && !found.missing.is_empty());
}

#[test]
fn the_plan_becomes_a_geometry() {
    let plan = Plan::parse(SMALL, "small.toml").expect("a plan");
    let geometry = geometry(&plan);
    assert_eq!(geometry.ajb.output_names(), ["A1:x", "A1:y", "A1:z", "B1:x", "B1:y", "B1:z"]);
    assert_eq!(geometry.ajb.input_names(), ["AZ1", "AY1"]);
    assert_eq!(geometry.b.impacts[0].direction, [0.0, 0.0, -1.0]);
}

#[test]
fn records_from_files_are_used_whole_where_nothing_was_measured() {
    let lengths = |range: Option<[f64; 2]>, measured| AnalysedLength {
        plan_s: 1.0,
        // 10 ms more than the time after the lead
        imported: range.map(|own| ImportedLengths {
            shortest: own[0] + 0.01,
            longest: own[1] + 0.01,
            from_lead: own,
        }),
        measured,
    };
    // no imported records, or imported records of the plan's length plus lead: as planned, without
    // a message
    for alone in [lengths(None, true), lengths(Some([1.0, 1.001]), false), lengths(Some([1.0; 2]), true)] {
        assert_eq!((alone.whole_s(), alone.notice()), (None, None));
    }
    let said = |length: AnalysedLength| length.notice().expect("something to say");
    let longer = lengths(Some([4.0; 2]), false);
    assert_eq!(longer.whole_s(), Some(4.01));
    assert!(said(longer).contains("last 4.010 s") && said(longer).contains("used in full"));
    let shorter = lengths(Some([0.5; 2]), false);
    assert_eq!(shorter.whole_s(), Some(0.51));
    assert!(said(shorter).contains("every 1.961 Hz"));
    // FRFs of one campaign have the same lines
    let several = lengths(Some([2.0, 4.0]), false);
    assert_eq!(several.whole_s(), Some(2.01));
    assert!(said(several).contains("from 2.010 to 4.010 s"));
    let beside = lengths(Some([4.0; 2]), true);
    assert_eq!(beside.whole_s(), None);
    assert!(said(beside).contains("cut to the plan's length_s of 1 s"));
}
