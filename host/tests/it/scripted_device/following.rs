//! A follower of the campaign file that reports changes incrementally has the same state as one
//! that starts later and reads all in one pass.
#![cfg(feature = "dashboard")]

use std::path::Path;

use crate::scripted_device::by_summary::ByShotSummary;
use crate::scripted_device::fake::Fake;
use crate::scripted_device::runner::{create, options, plan, run_on};
use jointrig::campaign::plan::{Cell, Plan};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::campaign::verdict::judge::Judge;
use jointrig::campaign::verdict::others::Others;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::device::channels::ChannelMap;
use jointrig::device::stream::Recording;
use jointrig::live::bus::Bus;
use jointrig::live::follow::Follower;
use jointrig::live::message::Message;
use serde_json::Value;

/// Judges as usual, after reading the file's changes.
struct Looks {
    follower: Follower,
    bus: Bus,
    messages: usize,
}

impl Looks {
    fn look(&mut self) {
        for message in self.follower.look().unwrap() {
            assert!(!matches!(message, Message::Snapshot(_)) || self.messages == 0, "told anew as a whole");
            self.messages += 1;
            self.bus.say(message);
        }
    }
}

impl Judge for Looks {
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        self.look();
        ByShotSummary.judge(cell, plan, channels, recording, others)
    }
}

fn whole(bus: &Bus) -> Value {
    let mut whole: Value = serde_json::from_str(&bus.since(None)[0].text).unwrap();
    whole.as_object_mut().unwrap().remove("seq").unwrap();
    whole
}

/// The state of a follower that starts now.
fn at_once(path: &Path) -> Value {
    let bus = Bus::default();
    bus.say(Message::Snapshot(Box::new(Follower::new(path).unwrap().whole())));
    whole(&bus)
}

#[test]
fn what_is_told_bit_by_bit_is_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = create(&folder, "a.jrig", &plan());
    let mut looks = Looks { follower: Follower::new(&path).unwrap(), bus: Bus::default(), messages: 0 };
    looks.bus.say(Message::Snapshot(Box::new(looks.follower.whole())));
    let summary = run_on(&path, Fake::default(), &options(), &mut looks).unwrap();
    looks.look();
    assert!(looks.messages as u64 > summary.hits / 2, "{} messages", looks.messages);
    assert_eq!(whole(&looks.bus), at_once(&path));
    assert_eq!(whole(&looks.bus)["hits"].as_array().unwrap().len() as u64, summary.hits);

    // a verdict overruled afterwards, and the overruling undone
    let store = Store::open(&path).unwrap();
    let good = store.records().unwrap().into_iter().flatten().find(RecordRow::kept).unwrap();
    for verdict in [Verdict::Dropped, Verdict::Good] {
        store.overrule(good.id, verdict, "test").unwrap();
        let before = whole(&looks.bus);
        looks.look();
        assert_ne!(before, whole(&looks.bus));
        assert_eq!(whole(&looks.bus), at_once(&path));
    }
}
