//! A campaign exported in the formats of other programs: accepted data by default, everything on
//! request.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::exchange::npz::NpzFile;
use jointrig::exchange::uff::{Values, read};
use jointrig_tests::campaign::{one_second, small_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};
use std::collections::HashMap;
use std::path::Path;

type Row = HashMap<String, String>;

fn table(path: &Path) -> Vec<Row> {
    csv::Reader::from_path(path).unwrap().deserialize().collect::<Result<_, _>>().unwrap()
}

#[test]
fn every_channel_verdict_and_calibration_can_be_had() {
    // few cells and short records, because exported tables are large
    let (folder, file) =
        campaign(&one_second(&small_plan(&[("A", &["AZ1"], &["A1"]), ("B", &["BZ1"], &["B1"])])));
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&file));
    let rows: Vec<_> =
        Store::open_read_only(&file).unwrap().records().unwrap().into_iter().flatten().collect();
    let dropped = rows.iter().find(|row| row.kept()).unwrap().id;
    done(
        jointrig()
            .args(["campaign", "drop"])
            .arg(&file)
            .arg(dropped.to_string())
            .args(["--reason", "a truck, passing"]),
    );
    let calibration = folder.path().join("lab.toml");
    std::fs::write(&calibration, "[[channel]]\nname = \"ldv_a\"\nsensitivity_v = 40.0\nserial = \"77\"\n")
        .unwrap();
    done(
        jointrig()
            .args(["campaign", "calibrate"])
            .arg(&file)
            .arg("--calibration")
            .arg(&calibration)
            .args(["--reason", "yearly"]),
    );

    let out = |name: &str| folder.path().join(name);
    let export = |format: &str, to: &str, more: &[&str]| {
        done(jointrig().args(["export", "--format", format]).arg(&file).arg("--out").arg(out(to)).args(more));
    };
    export("npz", "npz", &[]);
    export("npz", "all", &["--all"]);
    export("uff58", "uff", &[]);
    export("csv", "csv", &[]);

    let counted = table(&out("npz/records.csv"));
    assert_eq!(counted.len(), rows.len());
    let row_of = |rows: &[Row], record: i64| {
        rows.iter().find(|row| row["record"] == record.to_string()).unwrap().clone()
    };
    let gone = row_of(&counted, dropped);
    assert_eq!((&*gone["verdict"], &*gone["standing"], &*gone["file"]), ("good", "dropped", ""));
    assert_eq!(gone["overruled_reason"], "a truck, passing");
    assert!(row_of(&table(&out("all/records.csv")), dropped)["file"].starts_with("records/"));
    let entered = table(&out("npz/calibrations.csv"));
    assert_eq!((entered.len(), &*entered[0]["channel"], &*entered[0]["serial"]), (1, "ldv_a", "77"));
    let scales = table(&out("npz/channels.csv"));
    let of = scales.iter().find(|row| row["channel"] == "ldv_a").unwrap();
    assert_eq!((&*of["units_per_volt"], &*of["unit"]), ("0.025", "m/s"));
    assert_ne!(of["units_per_volt"], of["units_per_volt_as_measured"]);

    // the signals of a record are those of the file in every format
    let store = Store::open_read_only(&file).unwrap();
    let kept = rows.iter().find(|row| row.kept() && row.id != dropped).unwrap();
    let (map, samples) = (store.channels(kept.session).unwrap(), store.samples(kept).unwrap());
    let place = row_of(&counted, kept.id);
    let hit: usize = place["hit"].parse().unwrap();
    let name = place["file"].trim_start_matches("records/").trim_end_matches(".npz").to_owned();
    let signals = |channel: &str| {
        let place = (0..map.len()).find(|place| map.channels[*place].name == channel).unwrap();
        map.to_si(place, samples.channel(place))
    };
    let mut npz = NpzFile::open(&out("npz").join("channels").join(format!("{name}.npz"))).unwrap();
    let all = npz.real("signals", "(hit, channel, sample)").unwrap();
    let names = ["ldv_a", "ldv_b"];
    let [_, channels, length] = all.shape[..] else { panic!("{:?}", all.shape) };
    for (channel, name) in names.into_iter().enumerate() {
        let from = (hit * channels + channel) * length;
        assert_eq!(all.values[from..from + length], signals(name));
    }
    let contents = read(&std::fs::read(out("uff").join("channels").join(format!("{name}.uff"))).unwrap());
    let wanted = format!("record {}, ldv_b", kept.id);
    let function = contents.functions().find(|f| f.id[0] == wanted).unwrap();
    assert!(matches!(&function.values, Values::Real(values) if *values == signals("ldv_b")));
    let text = table(&out("csv").join("channels").join(format!("{name}.csv")));
    let own: Vec<f64> = text
        .iter()
        .filter(|row| row["record"] == kept.id.to_string())
        .map(|row| row["ldv_a (m/s)"].parse().unwrap())
        .collect();
    assert_eq!(own, signals("ldv_a"));
}
