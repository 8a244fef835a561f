use super::*;
use jointrig_protocol::block::Header;

const CHANNELS: usize = 2;

fn codes_of(scan: u64) -> [i16; CHANNELS] {
    let code = i16::try_from(scan % 3_000).expect("small") * 10;
    [code, code + 1]
}

fn block(first: u64, scans: u8, flags: u8) -> Vec<u8> {
    let header = Header { flags, map: 0, scans, epoch: 7, first_scan: first };
    let mut bytes = header.to_bytes().to_vec();
    for scan in first..first + u64::from(scans) {
        bytes.extend(codes_of(scan).iter().flat_map(|code| code.to_le_bytes()));
    }
    bytes
}

fn give(stream: &mut Stream, first: u64, scans: u8, flags: u8) -> bool {
    stream.take(&Block::from_payload(&block(first, scans, flags)).expect("whole scans"))
}

fn samples(range: Range<u64>) -> Samples {
    let of = |channel: usize| range.clone().map(move |scan| codes_of(scan)[channel]);
    Samples::of_codes(&(0..CHANNELS).flat_map(of).collect::<Vec<i16>>(), CHANNELS)
}

#[test]
fn gaps_are_named_filled_and_counted() {
    let mut stream = Stream::new(7, 0, 100, CHANNELS, 1000);
    assert!(give(&mut stream, 100, 4, 0));
    assert!(give(&mut stream, 108, 4, 0), "104..108 is missing");
    assert!(give(&mut stream, 116, 4, 0), "112..116 is missing too");
    assert_eq!(stream.expected(), 104);
    assert_eq!(stream.missing(), Some(104..108));
    assert!(give(&mut stream, 104, 4, RESENT));
    assert_eq!((stream.expected(), stream.missing()), (112, Some(112..116)));
    assert!(give(&mut stream, 112, 4, RESENT));
    assert!(give(&mut stream, 112, 4, RESENT), "twice");
    assert_eq!((stream.expected(), stream.missing()), (120, None));
    stream.note_tail(120, true);
    let accounts = stream.accounts();
    assert_eq!((accounts.received, accounts.recovered, accounts.duplicates), (12, 8, 4));
    assert_eq!(accounts.unexplained(), 0);
    assert_eq!(stream.cut(100..120), (samples(100..120), vec![]));
}

#[test]
fn what_is_gone_is_a_range_and_the_stream_goes_on() {
    let mut stream = Stream::new(7, 0, 0, CHANNELS, 1000);
    give(&mut stream, 0, 4, 0);
    give(&mut stream, 12, 4, 0);
    stream.mark_lost(4..10);
    assert_eq!(stream.expected(), 10);
    assert_eq!(stream.missing(), Some(10..12));
    stream.mark_lost(10..12);
    stream.mark_lost(20..24);
    give(&mut stream, 16, 4, 0);
    assert_eq!(stream.expected(), 24, "a loss told before it is reached");
    assert_eq!(stream.lost(), [4..12, 20..24]);
    stream.note_tail(24, true);
    assert_eq!(stream.accounts().unexplained(), 0);
    let (cut, gaps) = stream.cut(2..26);
    assert_eq!(gaps, [2..10, 18..22, 22..24]);
    for channel in 0..CHANNELS {
        let (early, late) = (samples(2..4), samples(12..20));
        assert_eq!(cut.channel(channel).part(0, 2), early.channel(channel));
        assert_eq!(cut.channel(channel).part(10, 18), late.channel(channel));
    }
}

#[test]
fn overlapping_blocks_give_each_scan_once() {
    let mut stream = Stream::new(7, 0, 0, CHANNELS, 1000);
    give(&mut stream, 8, 8, 0);
    give(&mut stream, 6, 4, RESENT);
    give(&mut stream, 0, 7, RESENT);
    assert_eq!(stream.expected(), 16);
    assert_eq!(stream.cut(0..16), (samples(0..16), vec![]));
    stream.note_tail(16, true);
    assert_eq!(stream.accounts().unexplained(), 0);
}

#[test]
fn strangers_are_refused_and_the_memory_is_bounded() {
    let mut stream = Stream::new(8, 0, 0, CHANNELS, 16);
    assert!(!give(&mut stream, 0, 4, 0), "another epoch");
    let mut stream = Stream::new(7, 0, 0, CHANNELS, 16);
    for first in (4..10_000).step_by(4) {
        give(&mut stream, first, 4, 0);
    }
    assert!(stream.held.len() <= 17, "{}", stream.held.len());
    stream.mark_lost(0..5_000);
    stream.mark_lost(5_000..1 << 60);
    assert!(stream.tape.len() < 100_000);
}

#[test]
fn a_lost_tail_is_missing_in_whole_blocks_until_the_stream_ends() {
    let mut stream = Stream::new(7, 0, 0, CHANNELS, 1000);
    let whole = jointrig_protocol::limits::scans_per_block(CHANNELS).expect("two channels") as u64;
    stream.note_tail(whole + 5, false);
    assert_eq!(stream.missing(), Some(0..whole));
    stream.note_tail(whole + 5, true);
    assert_eq!(stream.missing(), Some(0..whole + 5));
}

#[test]
fn forgetting_keeps_what_is_still_wanted() {
    let mut stream = Stream::new(7, 0, 0, CHANNELS, 1000);
    for first in (0..400).step_by(4) {
        give(&mut stream, first, 4, 0);
    }
    stream.forget_before(300);
    assert!(stream.tape.len() < 800);
    assert_eq!(stream.cut(300..400).0, samples(300..400));
}

#[test]
fn wide_channels_are_joined_from_their_two_words() {
    let channel = |name: &str, bits| jointrig_protocol::channel::Channel {
        name: name.parse().expect("short"),
        role: jointrig_protocol::channel::Role::Auxiliary,
        quantity: jointrig_protocol::channel::Quantity::Voltage,
        units_per_volt: 1.0,
        range_v: 10.0,
        delay_ns: 0,
        bits,
    };
    // 24 bits, 16 bits, 30 bits: five words per scan
    let bits = [24, 16, 30];
    let channels = bits.iter().enumerate().map(|(place, bits)| channel(&format!("c{place}"), *bits));
    let map = ChannelMap { id: 0, rate_hz: 51_200, exact_hz: None, channels: channels.collect() };
    let code = |scan: i32, place: usize| [-8_388_608, -32_768, 536_870_911][place] / (1 + scan);
    let scan = |scan: i32| {
        let [one, two, three] = [0, 1, 2].map(|place| code(scan, place));
        let [a, d] = jointrig_protocol::channel::split_code(one, 24);
        let [c, e] = jointrig_protocol::channel::split_code(three, 30);
        [a, two as i16, c, d, e].map(i16::to_le_bytes)
    };
    let header = Header { flags: 0, map: 0, scans: 4, epoch: 7, first_scan: 0 };
    let mut bytes = header.to_bytes().to_vec();
    bytes.extend((0..4).flat_map(scan).flatten());
    let mut stream = Stream::new(7, 0, 0, &map, 1000);
    assert!(stream.take(&Block::from_payload(&bytes).expect("whole scans")));
    stream.mark_lost(4..6);
    let (samples, gaps) = stream.cut(1..6);
    assert_eq!(gaps, vec![std::ops::Range { start: 3, end: 5 }]);
    let all = |place: usize| (1..4).map(move |scan| code(scan, place)).chain([0, 0]);
    let wanted = Samples::new(vec![
        ChannelSamples::I32(all(0).collect()),
        ChannelSamples::I16(all(1).map(|code| code as i16).collect()),
        ChannelSamples::I32(all(2).collect()),
    ]);
    assert_eq!(Some(samples), wanted);
    // a map of other widths has scans of another length
    assert!(!Stream::new(7, 0, 0, 3, 1000).take(&Block::from_payload(&bytes).expect("whole scans")));
}
