//! A recorder behind a bridge: the rig's voltages in the format of docs/bridge.md, from a program.
//! Most tests play a file (`cat FILE`), whose blocks are changed where a fault is wanted.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use jointrig::campaign::run::error::RunError;
use jointrig::campaign::run::runner::Summary;
use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig::device::samples::ChannelView;
use jointrig::device::session::Session;
use jointrig_hil_sim::play::{Play, Samples, play};
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::campaign::{self, Kept, by_hand, origins, records, rows};
use jointrig_tests::command::{binary, jointrig};
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

const RIG: &str = include_str!("../../../hil-sim/rigs/by-hand.toml");
const RATE: u64 = 51_200;
/// Bytes of a block's head.
const HEAD: usize = 24;
const BLOCK: usize = 2_560;
const CHANNELS: usize = 16;
/// The operator of these rigs strikes this often, s; enough for a record of 0.5 s.
const EVERY_S: f64 = 1.5;

/// A stream of bytes: its header, and its blocks.
#[derive(Clone)]
struct Stream {
    header: String,
    blocks: Vec<Vec<u8>>,
}

/// Takes so many bytes, then closes the stream.
struct Taken(Vec<u8>, usize);

impl Write for Taken {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0.len() >= self.1 {
            return Err(ErrorKind::BrokenPipe.into());
        }
        self.0.extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Stream {
    /// The first seconds of the rig in one cell, with volts in single precision.
    fn of(seconds: f64) -> Self {
        Self::with_bits(16, seconds, 4)
    }

    /// The same with converters of so many bits, whose volts have `sample` bytes.
    fn with_bits(bits: u8, seconds: f64, sample: usize) -> Self {
        let rig = RIG.replace("every_s = 4.0", &format!("every_s = {EVERY_S:?}"));
        let rig = format!("{rig}\n[sensors]\nbits = {bits}\n");
        let visits = vec!["A/AZ3/A3".parse().unwrap()];
        let what = Play { seed: 7, visits, hits: 9, samples: Samples::Volts, block: BLOCK, paced: false };
        let size = HEAD + BLOCK * CHANNELS * sample;
        let blocks = (seconds * RATE as f64 / BLOCK as f64).ceil() as usize;
        let mut taken = Taken(Vec::new(), blocks * size);
        play(&RigConfig::from_toml(&rig).unwrap(), &what, &mut taken).unwrap();
        let end = 1 + taken.0.iter().position(|byte| *byte == b'\n').unwrap();
        let header = String::from_utf8(taken.0[..end].to_vec()).unwrap();
        Self { header, blocks: taken.0[end..].chunks_exact(size).map(<[u8]>::to_vec).collect() }
    }

    /// The block with the hit of this number (from 1), which begins soon after the operator's
    /// start, and whose record of half a second spans ten blocks.
    fn hit(&mut self, number: u32) -> &mut Vec<u8> {
        let at = (f64::from(number) * EVERY_S * RATE as f64) as usize / BLOCK;
        &mut self.blocks[at + 2]
    }

    fn bytes(&self) -> Vec<u8> {
        [self.header.as_bytes(), &self.blocks.concat()].concat()
    }

    /// A command line that writes it.
    fn written(&self, folder: &Path) -> String {
        let path = folder.join("stream");
        std::fs::write(&path, self.bytes()).unwrap();
        format!("bridge:cat {}", path.display())
    }
}

/// One cell, so many hits of half a second.
fn plan(wanted: u32) -> String {
    let plan = by_hand(wanted, &[("A", &["AZ3"], &["A3"])]);
    let plan = plan.replace("length_s = 2.0", "length_s = 0.5").replace("minimum = 2", "minimum = 1");
    // the structure still moves half a second after a hit
    plan.replace("quiet_relative = 0.003", "quiet_relative = 0.9")
}

fn attempt(file: &Path, wanted: u32, address: &str) -> Result<Summary, RunError> {
    campaign::attempt(file, &plan(wanted), address.parse::<Address>().unwrap().open(0).unwrap())
}

fn verdicts(kept: &[Kept]) -> Vec<&'static str> {
    kept.iter().map(|kept| kept.verdict).collect()
}

fn log(file: &Path) -> String {
    let lines = Store::open_read_only(file).unwrap().log_lines(0).unwrap();
    lines.into_iter().map(|(_, _, text)| text).collect::<Vec<_>>().join("\n")
}

/// Measures one good hit of this stream; the summary, all records, and the log.
fn measured(stream: &Stream) -> (Summary, Vec<Kept>, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let summary = attempt(&file, 1, &stream.written(folder.path())).unwrap();
    assert_eq!(summary.accounts.unexplained(), 0, "{:?}", summary.accounts);
    (summary, records(&file), log(&file))
}

#[test]
fn lost_scans_are_named_and_their_hit_is_refused() {
    let whole = Stream::of(7.0);
    let (summary, kept, _) = measured(&whole);
    assert_eq!((summary.accounts.lost, verdicts(&kept)), (0, vec!["good"]));

    // reported with their number
    let mut lost = whole.clone();
    lost.hit(1)[8..16].copy_from_slice(&100_u64.to_le_bytes());
    let (summary, kept, _) = measured(&lost);
    assert_eq!((summary.accounts.lost, verdicts(&kept)), (100, vec!["gap", "good"]));

    // an overrun of unknown length is at least one scan
    let mut overrun = whole.clone();
    overrun.hit(1)[16] = 1;
    let (summary, kept, log) = measured(&overrun);
    assert_eq!((summary.accounts.lost, verdicts(&kept)), (1, vec!["gap", "good"]));
    assert!(log.contains("the recorder reports an overrun of unknown length: 1 scans"), "{log}");

    // a sample that is not a number: its scan
    let mut nan = whole.clone();
    nan.hit(1)[HEAD + 4 * (10 * CHANNELS + 3)..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let (summary, kept, log) = measured(&nan);
    assert_eq!((summary.accounts.lost, verdicts(&kept)), (1, vec!["gap", "good"]));
    assert!(log.contains("channel `vib_z`: a sample is not a number"), "{log}");
}

#[test]
fn volts_are_stored_to_half_a_code_of_24_bits() {
    // volts of 30 bits, from a recorder that states 24
    let mut stream = Stream::with_bits(30, 4.0, 8);
    stream.header = stream.header.replace("\"bits\":30", "\"bits\":24");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    attempt(&file, 1, &stream.written(folder.path())).unwrap();
    let store = Store::open_read_only(&file).unwrap();
    let row = &rows(&store)[0];
    let samples = store.samples(row).unwrap();
    let blocks: Vec<&[u8]> = stream.blocks.iter().map(|block| &block[HEAD..]).collect();
    let volts: Vec<f64> =
        blocks.concat().as_chunks::<8>().0.iter().map(|sample| f64::from_le_bytes(*sample)).collect();
    let (mut largest, mut loudest) = (0.0_f64, 0.0_f64);
    for (place, channel) in samples.each().enumerate() {
        let ChannelView::I32(codes) = channel else { panic!("{:?}", channel.of()) };
        for (scan, code) in (row.first_scan as usize..).zip(codes) {
            let source = volts[scan * CHANNELS + place] / 10.0 * 2_f64.powi(23);
            largest = largest.max((f64::from(*code) - source).abs());
            loudest = loudest.max(source.abs());
        }
    }
    assert!(largest <= 0.5 && largest > 0.49, "{largest} of a code");
    assert!(loudest > 2_f64.powi(19), "the hit is in the record: {loudest}");
}

#[test]
fn a_wrong_full_scale_is_told() {
    let whole = Stream::of(7.0);
    let with = |full_scale: &str| {
        let mut stream = whole.clone();
        let (force, rest) = stream.header.split_once("\"full_scale\":10").unwrap();
        stream.header = format!("{force}\"full_scale\":{full_scale}{rest}");
        stream
    };
    // a hit of 50 N is 1.1 V
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let told = attempt(&file, 1, &with("0.5").written(folder.path())).unwrap_err().to_string();
    assert!(told.contains("its output ended"), "no hit is good: {told}");
    let kept = records(&file);
    assert!(!kept.is_empty() && kept.iter().all(|kept| kept.verdict == "overload"), "{:?}", verdicts(&kept));
    assert!(log(&file).contains("channel `force`: a sample is 1."), "{}", log(&file));

    // a hit is 180 codes then: whether it is good does not matter here
    let coarse = folder.path().join("coarse.jrig");
    let _ = attempt(&coarse, 1, &with("200").written(folder.path()));
    assert!(log(&coarse).contains("channel `force`: its noise is 0.0"), "{}", log(&coarse));
}

#[test]
fn a_program_that_ends_or_prints_is_told_and_the_next_run_resumes() {
    let whole = Stream::of(9.0);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let short = folder.path().join("short");
    // the first two hits
    let cut =
        Stream { blocks: whole.blocks[..(4.0 * RATE as f64) as usize / BLOCK].to_vec(), ..whole.clone() };
    std::fs::write(&short, cut.bytes()).unwrap();
    let ends =
        format!("bridge:sh -c 'cat {}; echo driver: device was unplugged >&2; exit 3'", short.display());
    let told = attempt(&file, 3, &ends).unwrap_err().to_string();
    assert!(told.contains("its output ended; the program ended (exit status: 3); its last line: driver: device was unplugged"), "{told}");
    let first = records(&file);
    assert_eq!(verdicts(&first), ["good", "good"]);

    let prints = format!("bridge:sh -c 'head -c 500000 {0}; echo buffer full; cat {0}'", short.display());
    let told = attempt(&file, 3, &prints).unwrap_err().to_string();
    assert!(told.contains("print to standard error"), "{told}");

    let summary = attempt(&file, 3, &whole.written(folder.path())).unwrap();
    assert_eq!((summary.kept, summary.hits), (3, 1));
    let kept = records(&file);
    assert_eq!((&kept[..2], verdicts(&kept)), (&first[..], vec!["good"; 3]));
}

#[test]
fn what_is_no_recorder_is_told_before_anything_is_measured() {
    let open = |address: &str| {
        address.parse::<Address>().unwrap().open(0).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let said = open("bridge:/no/such/program --rate 1");
    assert!(said.contains("could not be started"), "{said}");
    let said = open("bridge:echo ready");
    assert!(said.contains("begins with `ready`") && said.contains("docs/bridge.md"), "{said}");
    let said = open("bridge:sh -c 'echo no licence for this device >&2; exit 1'");
    assert!(said.contains("exit status: 1") && said.contains("no licence for this device"), "{said}");
    let said = open("bridge:tcp:127.0.0.1:9");
    assert!(said.contains("does the recorder's program listen there?"), "{said}");
}

#[test]
fn no_load_cell_one_and_six_do_not_end_the_run() {
    let whole = Stream::of(4.0);
    for cells in [0, 1, 6] {
        let mut stream = whole.clone();
        stream.header = stream.header.replace("\"role\":\"load_cell\"", "\"role\":\"auxiliary\"");
        // the fixed vibrometers stand in for cells; what they measure does not matter here
        for _ in 0..cells {
            stream.header = stream.header.replacen("\"role\":\"auxiliary\"", "\"role\":\"load_cell\"", 1);
        }
        assert_eq!(stream.header.matches("load_cell").count(), cells);
        let (summary, ..) = measured(&stream);
        assert_eq!(summary.kept, 1, "{cells} load cells");
    }
}

#[test]
fn blocks_over_a_socket_are_measured_alike() {
    let stream = Stream::of(4.0);
    let (_, own, _) = measured(&stream);
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("bridge:tcp:{}", listener.local_addr().unwrap());
    let server = std::thread::spawn(move || {
        let (mut peer, _) = listener.accept().unwrap();
        // the host ends the connection when it has what it wants
        drop(peer.write_all(&stream.bytes()));
    });
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    attempt(&file, 1, &address).unwrap();
    server.join().unwrap();
    assert_eq!(records(&file), own);
}

/// Waits until the file has a record.
fn until_one_is_kept(file: &Path) {
    let begun = Instant::now();
    while Store::open_read_only(file).unwrap().records().unwrap().is_empty() {
        assert!(begun.elapsed() < Duration::from_mins(1), "no hit was stored");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn host_and_program_killed_in_the_middle_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("rig.toml"), RIG.replace("every_s = 4.0", "every_s = 1.5")).unwrap();
    std::fs::write(at("plan.toml"), plan(30).replace("most = 12", "most = 90")).unwrap();
    let file = at("c.jrig");
    let made = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(at("plan.toml")).output();
    assert!(made.as_ref().unwrap().status.success(), "{made:?}");
    // `exec`, so that the process id is that of the program
    let play = format!(
        "bridge:sh -c 'echo $$ > {}; exec {} play --rig {} --seed 7 --visit A/AZ3/A3 --hits 1000 --volts'",
        at("pid").display(),
        binary("JOINTRIG_HIL_SIM_BIN").display(),
        at("rig.toml").display()
    );
    let start = || {
        let mut command = jointrig();
        command.args(["campaign", "run", "--yes"]).arg(&file).args(["--device", &play]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let mut host = start();
    until_one_is_kept(&file);
    host.kill().unwrap();
    host.wait().unwrap();
    let pid = || std::fs::read_to_string(at("pid")).unwrap().trim().to_owned();
    // the program ends by itself, because its output is closed
    let begun = Instant::now();
    while Path::new("/proc").join(pid()).exists() && cfg!(target_os = "linux") {
        assert!(begun.elapsed() < Duration::from_secs(20), "the program outlives the host");
        std::thread::sleep(Duration::from_millis(10));
    }
    let first = records(&file);
    std::fs::remove_file(at("pid")).unwrap();
    let host = start();
    let begun = Instant::now();
    while Store::open_read_only(&file).unwrap().records().unwrap().len() <= first.len() {
        assert!(begun.elapsed() < Duration::from_mins(1), "no further hit was stored");
        std::thread::sleep(Duration::from_millis(5));
    }
    let killed = std::process::Command::new("kill").args(["-9", &pid()]).status().unwrap();
    let ended = host.wait_with_output().unwrap();
    let told = String::from_utf8(ended.stderr).unwrap();
    // a fast computer may have measured everything by then
    if killed.success() && !ended.status.success() {
        assert!(told.contains("the program ended (signal: 9"), "{told}");
    }
    let second = records(&file);
    assert_eq!(second[..first.len()], first[..]);
    let last = start().wait_with_output().unwrap();
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    let all = records(&file);
    assert_eq!(all[..second.len()], second[..]);
    let store = Store::open_read_only(&file).unwrap();
    assert_eq!(verdicts(&all).iter().filter(|verdict| **verdict == "good").count(), 30);
    assert!(origins(&rows(&store)).len() >= 30);
}

#[test]
fn the_example_in_c_is_a_recorder() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("bridge");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/bridge/bridge.c");
    let mut compiler = std::process::Command::new("cc");
    compiler.args(["-Wall", "-Wextra", "-Werror", "-O2", "-o"]).arg(&program).args([source, "-lm"]);
    let made = compiler.output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let address = format!("bridge:{}", program.display());
    let mut session = Session::open(address.parse::<Address>().unwrap().open(0).unwrap(), &address).unwrap();
    let info = session.info().unwrap();
    let map = session.channels(&info).unwrap();
    let names: Vec<&str> = map.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!((info.board.as_str(), names), ("example in C", vec!["force", "acc"]));
    session.start(&map).unwrap();
    session.wait_for(25_600).unwrap();
    let (samples, gaps) = session.cut(0..25_600).unwrap();
    assert!(gaps.is_empty());
    let force_n = map.to_si(0, samples.channel(0));
    let (at, peak) = force_n.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    // the middle of a millisecond after half a second lies 0.2 scans earlier, where the force is 15
    // mN larger; a code is 6 mN
    assert_eq!(at, 12_813);
    assert!((peak - 49.985).abs() < 0.01, "{peak}");
    let peak = map.to_si(1, samples.channel(1)).into_iter().fold(0.0, f64::max);
    assert!((peak - 29.3).abs() < 0.2, "30 m/s² after a quarter of a period: {peak}");
}
