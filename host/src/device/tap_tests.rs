use super::*;

const AT_ONCE: Duration = Duration::ZERO;

/// Scans of two channels, one rising and one falling.
fn scans(range: std::ops::Range<i32>) -> Vec<i16> {
    range.flat_map(|scan| [scan as i16, -(scan as i16)]).collect()
}

fn begun() -> (Tap, View) {
    let (mut tap, view) = tap();
    // 4 scans per millisecond
    tap.begin(2, 2, 100, 4_000.0);
    (tap, view)
}

#[test]
fn each_stretch_has_its_least_and_its_largest_code() {
    let (mut tap, mut view) = begun();
    assert!(view.next(AT_ONCE).is_none(), "nothing was folded");
    // blocks that do not align with stretches
    tap.fold(&scans(0..3));
    tap.fold(&scans(3..9));
    let seen = view.next(AT_ONCE).expect("a stretch is whole");
    assert_eq!((seen.first_scan, seen.scans_per_stretch, seen.stretches), (100, 4, 1));
    assert_eq!(seen.ends(), [[0, 3], [-3, 0]]);
    // the envelope was handed over at the first stretch after the request; later data belong to the
    // next one
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&scans(9..12));
    let seen = view.next(AT_ONCE).expect("two stretches");
    assert_eq!((seen.first_scan, seen.stretches), (104, 2));
    assert_eq!(seen.ends(), [[4, 7], [-7, -4], [8, 11], [-11, -8]]);
}

#[test]
fn mean_and_rms_follow_from_the_sums() {
    let (mut tap, mut view) = begun();
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&[3, i16::MIN, 5, i16::MIN, 3, i16::MIN, 5, i16::MIN]);
    let seen = view.next(AT_ONCE).expect("a stretch");
    assert_eq!((seen.arrived, seen.sums(0)), (4, (16, 68)));
    assert_eq!(seen.sums(1), (-4 * 32_768, 4 << 30));
    assert_eq!(seen.sums(99), (0, 0));
}

#[test]
fn who_looks_late_sees_everything_coarser() {
    let (mut tap, mut view) = begun();
    let all = 4 * 3 * 64;
    tap.fold(&scans(0..all));
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&scans(all..all + 16));
    let seen = view.next(AT_ONCE).expect("an envelope");
    assert_eq!((seen.first_scan, seen.scans_per_stretch), (100, 16));
    assert_eq!(seen.arrived, (all + 16) as u64);
    let whole = seen.ends().iter().step_by(2).fold(NOTHING, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    assert_eq!(whole, [0, (all + 15) as i16]);
    // then the resolution is fine again
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&scans(0..4));
    assert_eq!(view.next(AT_ONCE).expect("one more").scans_per_stretch, 4);
}

#[test]
fn lost_scans_leave_a_hole_and_time_goes_on() {
    let (mut tap, mut view) = begun();
    tap.fold(&scans(0..2));
    tap.skip(8);
    tap.fold(&scans(10..11));
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&scans(11..12));
    let seen = view.next(AT_ONCE).expect("three stretches");
    assert_eq!((seen.stretches, seen.arrived), (3, 4));
    assert_eq!(seen.ends(), [[0, 1], [-1, 0], NOTHING, NOTHING, [10, 11], [-11, -10]]);
    // after a gap longer than an envelope a new one begins
    tap.skip(1_000_000);
    assert!(view.next(AT_ONCE).is_none());
    tap.fold(&scans(0..4));
    assert_eq!(view.next(AT_ONCE).expect("behind it").first_scan, 100 + 12 + 1_000_000);
}

/// One thread writes as fast as it can, the other reads now and then: every scan is read once, in
/// order.
#[test]
fn nothing_is_seen_twice_and_nothing_is_left_out() {
    let (mut tap, mut view) = tap();
    tap.begin(1, 1, 0, 4_000.0);
    let folds = std::thread::spawn(move || {
        for _ in 0..20_000 {
            tap.fold(&[1; 7]);
        }
        tap
    });
    let (mut next, mut sum) = (0, 0);
    let mut look = |view: &mut View| {
        while let Some(seen) = view.next(Duration::from_millis(20)) {
            assert_eq!(seen.first_scan, next);
            next += seen.stretches as u64 * u64::from(seen.scans_per_stretch);
            sum += seen.sums(0).0;
        }
    };
    look(&mut view);
    let mut tap = folds.join().expect("folds");
    // a call requests the data left after the writer stopped; the next complete stretch hands them
    // over
    look(&mut view);
    while tap.over != 0 || tap.making.stretches > 0 {
        let rest = tap.making.scans_per_stretch - tap.over;
        tap.fold(&vec![1; rest as usize]);
        look(&mut view);
    }
    assert_eq!(next, sum as u64, "each scan holds a one");
    assert!(next >= 140_000);
}
