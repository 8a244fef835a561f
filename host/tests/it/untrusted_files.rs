//! Malicious files at every entry point of the command line: each is refused with a message that
//! names the problem, in a short time and with no more memory than its size allows. The operating
//! system limits the memory of the whole program.
#![cfg(target_os = "linux")]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Memory of the program without a file: its code, the threads' stacks.
const PROGRAM: u64 = 64 << 20;
/// Memory allowed for any file in addition to four times its size.
const BESIDE: u64 = 64 << 20;
/// Limit of processor time, s, for any file size: other load on the machine does not affect
/// processor time.
const SECONDS: u64 = 10;

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// A folder with the valid files that the commands need in addition to the bad one.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["A.npz", "B.npz", "AJB.npz"] {
        std::fs::copy(data(&format!("frf_rigid/{name}")), folder.path().join(name)).expect("test data");
    }
    std::fs::copy(data("positions/positions.xlsx"), folder.path().join("positions.xlsx")).expect("test data");
    let (code, said) = run(folder.path(), "campaign new c.jrig --paper", 0);
    assert_eq!(code, Some(0), "{said}");
    folder
}

/// Runs a command in `folder`, with memory for a file of `size` bytes; returns its exit code and
/// stderr.
fn run(folder: &Path, line: &str, size: u64) -> (Option<i32>, String) {
    let kilobytes = (PROGRAM + BESIDE + 4 * size) / 1024;
    let limits = format!("ulimit -v {kilobytes} && ulimit -t {SECONDS} && exec \"$0\" \"$@\"");
    // a timeout, because a blocked program uses no processor time
    let out = Command::new("timeout")
        .args(["120", "sh", "-c", &limits])
        .arg(env!("CARGO_BIN_EXE_jointrig"))
        .args(line.split(' '))
        .envs([("RAYON_NUM_THREADS", "2"), ("MALLOC_ARENA_MAX", "1")])
        .current_dir(folder)
        .output()
        .expect("the command runs");
    (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
}

/// Every command that reads external files, with `FILE` as a placeholder.
const DOORS: [&str; 14] = [
    "import FILE --out o.npz",
    "import FILE --into c.jrig --configuration A",
    "import FILE --into c.jrig --configuration A --impact AZ1 --response A1",
    "frf FILE",
    "hysteresis FILE",
    "identify --a FILE --b B.npz --ajb AJB.npz --geometry positions.xlsx",
    "identify --a A.npz --b B.npz --ajb AJB.npz --geometry FILE",
    "campaign new n.jrig --plan FILE",
    "campaign calibrate c.jrig --calibration FILE --reason x",
    "campaign status FILE",
    "campaign verify FILE",
    "analyse FILE --out o",
    "export FILE --format csv --out o",
    "demo --out d --rig FILE",
];

/// The command refuses `file` and names it, and its message contains one of `parts`.
fn refused(folder: &Path, door: &str, file: &str, parts: &[&str]) {
    // a demo continues with existing files
    let _ = std::fs::remove_dir_all(folder.join("d"));
    let size = std::fs::metadata(folder.join(file)).map_or(0, |there| there.len());
    let (code, said) = run(folder, &door.replace("FILE", file), size);
    assert_eq!(code, Some(1), "{door}, {file}: {said}");
    assert!(said.contains(file.trim_start_matches("./")), "{door} does not name {file}: {said}");
    assert!(parts.iter().any(|part| said.contains(part)), "{door}, {file}: {said}");
    assert!(!said.contains("panicked") && said.lines().count() <= 12, "{door}: {said}");
}

/// An archive with one array per name: a header, and the bytes after it.
fn npz(folder: &Path, file: &str, names: &[&str], header: &str, zeros: usize) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(folder.join(file)).expect("writable"));
    for name in names {
        zip.start_file(*name, zip::write::SimpleFileOptions::default()).expect("a member");
        zip.write_all(b"\x93NUMPY\x02\x00").expect("written");
        zip.write_all(&(header.len() as u32).to_le_bytes()).expect("written");
        zip.write_all(header.as_bytes()).expect("written");
        std::io::copy(&mut std::io::Read::take(std::io::repeat(0), zeros as u64), &mut zip).expect("written");
    }
    zip.finish().expect("closed");
}

/// The arrays that the readers request.
const ARRAYS: [&str; 8] = [
    "fs.npy",
    "force.npy",
    "response.npy",
    "frequency.npy",
    "outputs.npy",
    "frf.npy",
    "velocity_a.npy",
    "load_cells.npy",
];

/// Commands that read arrays and functions.
const OF_ARRAYS: [&str; 6] = [DOORS[0], DOORS[1], DOORS[2], DOORS[3], DOORS[4], DOORS[5]];

#[test]
fn pipes_and_devices_are_neither_waited_for_nor_read() {
    let folder = folder();
    assert!(Command::new("mkfifo").arg(folder.path().join("pipe")).status().expect("mkfifo").success());
    for door in DOORS {
        for file in ["pipe", "/dev/zero"] {
            refused(folder.path(), door, file, &["into a file", "no campaign file", "give the .jrig file"]);
        }
    }
    let (code, said) = run(folder.path(), "campaign run c.jrig --device sim:pipe", 0);
    assert!(code == Some(1) && said.contains("into a file"), "{said}");
    let (code, said) = run(folder.path(), "import . --into c.jrig --names pipe", 0);
    assert!(code == Some(1) && said.contains("into a file"), "{said}");
}

#[test]
fn archives_that_promise_or_hold_too_much() {
    let folder = folder();
    let at = folder.path();
    let header = |descr: &str, shape: &str| {
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n")
    };
    let brackets = format!("{}1{}", "(".repeat(40), ",)".repeat(40));
    npz(at, "nested.npz", &ARRAYS, &header("<f8", &brackets), 8);
    npz(at, "empty.npz", &ARRAYS, &header("|S0", "(1000000000000,)"), 0);
    npz(at, "long.npz", &ARRAYS, &"(".repeat(60_000_000), 0);
    npz(at, "zeros.npz", &ARRAYS[..6], &header("<f4", "(100000000,)"), 400_000_000);
    for door in OF_ARRAYS {
        refused(at, door, "nested.npz", &["its header"]);
        refused(at, door, "empty.npz", &["would take", "elements of type"]);
        refused(at, door, "long.npz", &["its header"]);
        refused(at, door, "zeros.npz", &["would take", "there is no array", "has 100000000 values"]);
    }
}

#[test]
fn workbooks_of_two_cells_and_tables_of_many_rows() {
    let folder = folder();
    let at = folder.path();
    let workbook = |file: &str, cells: &str, shared: &str| {
        let mut archive =
            zip::ZipArchive::new(std::fs::File::open(data("positions/positions.xlsx")).expect("test data"))
                .expect("a workbook");
        let mut zip = zip::ZipWriter::new(std::fs::File::create(at.join(file)).expect("writable"));
        for i in 0..archive.len() {
            let part = archive.by_index_raw(i).expect("a part");
            if part.name().is_ok_and(|name| name.ends_with("sheet1.xml")) {
                continue;
            }
            zip.raw_copy_file(part).expect("copied");
        }
        for (name, text) in [("xl/worksheets/sheet1.xml", cells), ("xl/sharedStrings.xml", shared)] {
            zip.start_file(name, zip::write::SimpleFileOptions::default()).expect("a part");
            zip.write_all(text.as_bytes()).expect("written");
        }
        zip.finish().expect("closed");
    };
    let sheet = |cells: &str| format!("<worksheet><sheetData>{cells}</sheetData></worksheet>");
    let row =
        |row: usize, cell: &str, value: &str| format!("<row r=\"{row}\"><c r=\"{cell}\"{value}</c></row>");
    let corners = row(1, "A1", "><v>1</v>") + &row(1_048_576, "XFD1048576", "><v>1</v>");
    workbook("corners.xlsx", &sheet(&corners), "<sst/>");
    refused(at, DOORS[6], "corners.xlsx", &["row 1048576: column 16384"]);
    workbook("claim.xlsx", &sheet(""), "<sst uniqueCount=\"900000000000\"></sst>");
    refused(at, DOORS[6], "claim.xlsx", &["sharedStrings.xml"]);
    workbook("bomb.xlsx", &sheet(&" ".repeat(200_000_000)), "<sst/>");
    refused(at, DOORS[6], "bomb.xlsx", &["sheet1.xml"]);
    let long = format!("<sst><si><t>{}</t></si></sst>", "x".repeat(1_000_000));
    let many: String = (1..5000).map(|r| row(r, &format!("A{r}"), " t=\"s\"><v>0</v>")).collect();
    workbook("shared.xlsx", &sheet(&many), &long);
    refused(at, DOORS[6], "shared.xlsx", &["of text"]);

    std::fs::create_dir(at.join("tables")).expect("a folder");
    let table = |text: &str| std::fs::write(at.join("tables/Channels_A.csv"), text).expect("written");
    for (text, part) in [
        ("1\n".repeat(2_000_000), "Channels_A.csv: row 10001"),
        ("a,b\n".repeat(25_000_000), "Channels_A.csv: it has 100 MB"),
        ("x".repeat(7_000_000) + &"\"\n".repeat(500_000), "Channels_A"),
        (",".repeat(8_000_000), "column 257"),
    ] {
        table(&text);
        refused(at, DOORS[6], "tables", &[part]);
    }
}

#[test]
fn large_files_of_any_kind_take_seconds_and_four_times_their_size() {
    let folder = folder();
    let at = folder.path();
    let function = |points: usize| {
        format!(
            "    -1\n    58\na\nb\nc\nd\ne\n    4         1    1         0         A1         1   3        AZ1         1  -3\n\
             {:>10}{points:>10}{:>10}  0.00000e+00  1.00000e+00  0.00000e+00\n{:>10}\n{:>10}\n{:>10}\n\n",
            5, 1, 18, 11, 13
        )
    };
    let megabytes = |text: &str, count: usize| text.repeat(count * 1_000_000 / text.len());
    let files = [
        ("noise", megabytes("0123456789abcdef\n", 100)),
        ("one_line", megabytes("x", 100)),
        ("ends", megabytes("    -1\n", 100)),
        ("empty_sets", megabytes("-1\n58\n-1\n", 100)),
        ("small_sets", megabytes("-1\n58\n\n\n\n\n\n\n5 0 1\n\n\n\n\n-1\n", 100)),
        ("narrow", function(25_000_000) + &megabytes("0 ", 100) + "\n    -1\n"),
        ("brackets", megabytes("[", 100)),
    ];
    for (name, text) in files {
        std::fs::write(at.join(name), text).expect("written");
        for door in DOORS {
            refused(at, door, name, &["in it", name]);
        }
        std::fs::remove_file(at.join(name)).expect("removed");
    }
    // nested as deeply as the size limit allows
    for text in ["a = ".to_owned() + &"[".repeat(500_000), "[a.".to_owned() + &"b.".repeat(400_000)] {
        std::fs::write(at.join("deep.toml"), text).expect("written");
        for door in [DOORS[6], DOORS[7], DOORS[8], DOORS[13]] {
            refused(at, door, "deep.toml", &["deep.toml"]);
        }
    }
}

#[test]
fn a_plan_of_two_long_lists_is_refused_before_its_cells_are_made() {
    let folder = folder();
    let list = |name: char| (0..5000).map(|i| format!("\"{name}{i}\"")).collect::<Vec<_>>().join(",");
    let lists = format!("impacts = [{}]\nresponses = [{}]", list('i'), list('r'));
    let plan = jointrig::campaign::plan::SMALL.replacen(
        "impacts = [\"AZ1\"]\nresponses = [\"A1\", \"A2\"]",
        &lists,
        1,
    );
    assert!(plan.contains("i4999"), "the small plan is another one");
    std::fs::write(folder.path().join("plan.toml"), plan).expect("written");
    for door in [DOORS[7], "plan check FILE"] {
        refused(folder.path(), door, "plan.toml", &["more than 20000 cells"]);
    }
}

#[test]
fn a_matrix_that_is_mostly_holes_is_not_made() {
    let folder = folder();
    let set = |i: usize| {
        format!(
            "    -1\n    58\n\n\n\n\n\n    4         1    1         0 {:>10}{:>10}   3 {:>10}{:>10}  -3\n\
             {:>10}{:>10}{:>10}  0.00000e+00  1.00000e+00  0.00000e+00\n{:>10}\n{:>10}\n{:>10}\n\n{:>13}{:>13}\n    -1\n",
            format!("o{i}"),
            i,
            format!("i{i}"),
            i,
            5,
            1,
            1,
            18,
            11,
            13,
            "1.0",
            "0.0"
        )
    };
    let text = (0..3000).map(set).collect::<Vec<_>>().concat();
    std::fs::write(folder.path().join("holes.uff"), text).expect("written");
    refused(folder.path(), DOORS[0], "holes.uff", &["mostly empty"]);
}

/// A campaign with three hits, and FRFs.
fn measured(folder: &Path) {
    let mut hits = jointrig::exchange::read_impacts(&data("impacts/good.npz")).expect("test data");
    for hit in &mut hits.response {
        *hit = vec![hit[0].clone(); 3];
    }
    jointrig::exchange::uff_output::write_records(&folder.join("hits.uff"), &hits, "A1", "AZ1")
        .expect("written");
    for line in [
        "import hits.uff --into c.jrig --configuration A --impact AZ1 --response A1",
        "import B.npz --into c.jrig --configuration B",
    ] {
        let (code, said) = run(folder, line, 0);
        assert_eq!(code, Some(0), "{said}");
    }
}

/// Every command that reads a campaign.
const OF_CAMPAIGNS: [&str; 8] = [
    "campaign verify c.jrig",
    "campaign verify c.jrig --deep",
    "campaign status c.jrig",
    "campaign show c.jrig A/AZ1/A1",
    "campaign backup c.jrig copy.jrig",
    "analyse c.jrig --out o",
    "export c.jrig --format npz --out e",
    "campaign drop c.jrig 1 --reason x",
];

#[test]
fn campaign_files_that_claim_too_much_are_refused_or_named() {
    let folder = folder();
    let at = folder.path();
    measured(at);
    let whole = std::fs::read(at.join("c.jrig")).expect("read");
    let numbers = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1000000)";
    let cells = format!(
        "INSERT INTO cells (configuration, impact, response, wanted) {numbers} SELECT 'A', 'i' || i, 'A1', 1 FROM n"
    );
    for (sql, parts) in [
        ("UPDATE records SET scans = 1000000000", ["description", "checksum"]),
        ("UPDATE records SET channels = 1000000000", ["description", "checksum"]),
        ("UPDATE records SET scans = -1", ["description", "checksum"]),
        ("UPDATE sessions SET rate_hz = 0", ["of `sessions` was changed", "0 Hz"]),
        ("UPDATE frfs SET frf = zeroblob(500000000)", ["FRFs", "frfs"]),
        ("PRAGMA user_version = -1", ["version", "version"]),
        ("PRAGMA user_version = 4", ["version", "version"]),
        (
            "PRAGMA foreign_keys = OFF; DROP TABLE cells; CREATE VIEW cells AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) \
             SELECT i AS id, 'A' AS configuration, 'x' AS impact, 'y' AS response, 1 AS wanted, NULL AS given_up, NULL AS settled FROM n",
            ["not as jointrig makes it", "not as jointrig makes it"],
        ),
        (cells.as_str(), ["cells", "cells"]),
    ] {
        std::fs::write(at.join("c.jrig"), &whole).expect("written");
        let file = rusqlite::Connection::open(at.join("c.jrig")).expect("open");
        let triggers: Vec<String> = {
            let mut names =
                file.prepare("SELECT name FROM sqlite_schema WHERE type = 'trigger'").expect("SQL");
            names.query_map([], |row| row.get(0)).expect("SQL").flatten().collect()
        };
        let definitions: Vec<String> = {
            let mut all = file.prepare("SELECT sql FROM sqlite_schema WHERE type = 'trigger'").expect("SQL");
            all.query_map([], |row| row.get(0)).expect("SQL").flatten().collect()
        };
        for name in triggers {
            file.execute_batch(&format!("DROP TRIGGER {name}")).expect("SQL");
        }
        file.execute_batch(sql).expect("SQL");
        // unchanged, so that the file looks like a valid campaign
        for definition in definitions {
            let _ = file.execute_batch(&definition);
        }
        file.close().expect("closed");
        let size = std::fs::metadata(at.join("c.jrig")).expect("there").len();
        for door in OF_CAMPAIGNS {
            for made in ["copy.jrig", "o", "e"] {
                let _ = std::fs::remove_file(at.join(made));
                let _ = std::fs::remove_dir_all(at.join(made));
            }
            let (code, said) = run(at, door, size);
            assert!(matches!(code, Some(0 | 1)), "{door}, {sql}: {code:?} {said}");
            assert!(!said.contains("panicked"), "{door}, {sql}: {said}");
            if door == OF_CAMPAIGNS[0] {
                assert_eq!(code, Some(1), "{sql}: {said}");
            }
        }
        let mut verify = Command::new(env!("CARGO_BIN_EXE_jointrig"));
        let out = verify.current_dir(at).args(["campaign", "verify", "c.jrig"]).output().expect("runs");
        let said =
            [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        assert!(parts.iter().any(|part| said.contains(part)), "{sql}: {said}");
    }
}
