use super::*;
use std::collections::HashSet;

#[test]
fn the_papers_plan_has_252_cells_and_2016_hits() {
    let plan = Plan::parse(PAPER, "paper.toml").expect("a good plan");
    let cells = plan.cells();
    assert_eq!(cells.len(), 252);
    assert_eq!(cells.iter().map(|cell| cell.wanted).sum::<u32>(), 2016);
    let of = |wanted| cells.iter().filter(|cell| cell.configuration == wanted).count();
    assert_eq!((of(Configuration::A), of(Configuration::B), of(Configuration::Ajb)), (48, 36, 168));
    assert_eq!(
        cells.iter().map(|cell| format!("{cell:?}")).collect::<HashSet<_>>().len(),
        252,
        "each cell once"
    );
    assert_eq!(plan.post_trigger_scans(), 102_400);
}

#[test]
fn hammer_and_laser_move_as_little_as_they_can() {
    for text in [PAPER, DEMO, SMALL, CONTACT, CONTACT_BY_HAND, FRF_ONLY, PAPER_CONTACT] {
        let plan = Plan::parse(text, "plan").expect("a good plan");
        let cells = plan.cells();
        let moves = |of: fn(&Cell) -> String| cells.windows(2).filter(|w| of(&w[0]) != of(&w[1])).count();
        let hammer = moves(|cell| format!("{:?}{}", cell.configuration, cell.impact));
        let impacts: HashSet<(&str, &str)> = plan
            .configuration
            .iter()
            .flat_map(|block| {
                block.impacts.iter().map(|impact| (&**block.name.get_ref(), &**impact.get_ref()))
            })
            .collect();
        assert_eq!(hammer + 1, impacts.len(), "each impact is visited once");
        for pair in cells.windows(2) {
            let same = pair[0].configuration == pair[1].configuration;
            let moved = (pair[0].impact != pair[1].impact, pair[0].response != pair[1].response);
            // to the known mass and to the open joint both go together
            let apart = pair.iter().any(|cell| {
                let point = plan.response(&cell.response);
                point.is_some_and(|point| SEPARATE.contains(&point.grouping))
            });
            assert!(!same || apart || moved != (true, true), "only one of the two moves: {pair:?}");
        }
    }
}

#[test]
fn the_contacts_plan_has_60_cells_and_no_a() {
    let plan = Plan::parse(CONTACT, "contact.toml").expect("a good plan");
    let cells = plan.cells();
    let of = |wanted| cells.iter().filter(|cell| cell.configuration == wanted).count();
    assert_eq!((of(Configuration::A), of(Configuration::B), of(Configuration::Ajb)), (0, 28, 32));
    assert_eq!((plan.hits.get_ref().wanted, plan.hits.get_ref().minimum), (6, 2));
    assert_eq!(plan.configuration.len(), 5);
    // a joint that is opened later is another one
    let open = cells.iter().position(|cell| cell.impact == "OPEN");
    assert_eq!(open, cells.iter().position(|cell| cell.configuration == Configuration::Ajb));
}

#[test]
fn blocks_of_a_configuration_add_up_and_no_cell_stands_twice() {
    let paper: HashSet<String> = Plan::parse(PAPER, "paper.toml")
        .expect("a good plan")
        .cells()
        .iter()
        .map(|c| format!("{c:?}"))
        .collect();
    let cells = Plan::parse(PAPER_CONTACT, "paper-contact.toml").expect("a good plan").cells();
    let whole: HashSet<String> = cells.iter().map(|cell| format!("{cell:?}")).collect();
    assert_eq!((cells.len(), whole.len()), (276, 276));
    assert!(whole.is_superset(&paper));
    let added: Vec<&Cell> = cells.iter().filter(|cell| !paper.contains(&format!("{cell:?}"))).collect();
    assert_eq!(added.len(), 24);
    for cell in added {
        assert!(cell.configuration == Configuration::Ajb && cell.response.starts_with('S'), "{cell:?}");
        assert!(["AZ1", "AZ2", "AZ3", "I_MZ"].contains(&cell.impact.as_str()), "{cell:?}");
    }
    let demo = Plan::parse(DEMO, "demo.toml").expect("a good plan").cells();
    assert_eq!(demo.len(), 276);

    let twice = PAPER_CONTACT.replace("responses = [\"S1\", \"S2\"", "responses = [\"B3\", \"S2\"");
    let said = Plan::parse(&twice, "my.toml").expect_err("a cell twice").to_string();
    assert!(said.contains("AZ1 × B3 is listed twice"), "{said}");
}

#[test]
fn a_hammer_and_a_sensor_at_one_point_may_share_its_name() {
    let shared = SMALL.replace("\"AZ1\"", "\"1\"").replace("\"A1\"", "\"1\"");
    let plan = Plan::parse(&shared, "my.toml").expect("a hammer and a sensor");
    let cells = plan.cells();
    assert!(
        cells.iter().any(|cell| (cell.impact.as_str(), cell.response.as_str()) == ("1", "1")),
        "{cells:?}"
    );
    let twice = SMALL.replace("\"A2\"", "\"A1\"");
    let said = Plan::parse(&twice, "my.toml").expect_err("two sensors").to_string();
    assert!(said.contains("`A1` is listed twice"), "{said}");
}

#[test]
fn errors_point_at_line_and_field() {
    for (from, to, word) in [
        ("rate_hz = 51200", "rate_hz = \"fast\"", "fast"),
        ("rate_hz = 51200", "rate_hz = 0", "record.rate_hz"),
        ("wanted = 2", "wnated = 2", "wnated"),
        ("minimum = 1", "minimum = 3", "minimum <= wanted"),
        ("impacts = [\"BZ1\"]", "impacts = [\"BZ7\"]", "no point `BZ7`"),
        ("responses = [\"B1\"]", "responses = [\"B1\", \"B1\"]", "is listed twice"),
        ("name = \"B\"", "name = \"C\"", "must be A, B or AJB"),
        ("direction = [0, -1, 0]", "direction = [0, -2, 0]", "length 1"),
        ("{ name = \"A2\", grouping = 1", "{ name = \"A2\", grouping = 9", "must be 1 to 8"),
        (
            "{ name = \"A2\", grouping = 1",
            "{ name = \"A2\", sigma_m = -1e-5, grouping = 1",
            "sigma_m of `A2`",
        ),
        ("pulse_us = 3500", "pulse_us = 9000", "pulse_bounds_us"),
        ("noise_ratio = 3.0", "noise_ratio = 0.5", "limits.noise_ratio"),
        ("weak_n = 30.0", "weak_n = 80.0", "limits: 0 < weak_n < strong_n"),
        ("rebound_after_s = 0.001", "rebound_after_s = -1.0", "limits.rebound_after_s"),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let text = SMALL.replacen(from, to, 1);
        let line = 1 + text.lines().position(|line| line.contains(to)).expect("it is there");
        let wrong = Plan::parse(&text, "my.toml").expect_err(to);
        let said = wrong.to_string();
        assert!(said.contains(word), "{to}: {said}");
        // an error between two fields is reported at the table that contains them
        let near = if word.contains('.') || word.contains('<') || word.contains("bounds") { 6 } else { 0 };
        assert!(wrong.line <= line && wrong.line + near >= line, "{to}: line {line}, said {said}");
        assert!(said.starts_with("my.toml:"), "{said}");
    }
}

#[test]
fn lasers_are_compared_on_arm_b_and_only_there() {
    let of = |from: &str, to: &str| {
        assert!(CONTACT.contains(from), "{from}");
        Plan::parse(&CONTACT.replacen(from, to, 1), "my.toml")
    };
    let plan = Plan::parse(CONTACT, "contact.toml").expect("a good plan");
    assert!(plan.response("BL").is_some_and(|point| point.lasers));
    assert!(plan.response("B1").is_some_and(|point| !point.lasers));
    let said = of("grouping = 5, position_m", "grouping = 5, lasers = true, position_m")
        .expect_err("on a specimen")
        .to_string();
    assert!(said.contains("compared with the 3-D vibrometer on arm B"), "{said}");
}

#[test]
fn a_known_mass_has_a_cell_of_its_own_in_b() {
    let plan = Plan::parse(CONTACT, "contact.toml").expect("a good plan");
    let cell = plan.known_mass_cell().expect("a known mass");
    assert_eq!((&*cell.impact, &*cell.response, cell.axis, cell.lasers), ("MASS", "MASS", 2, true));
    let block = "name = \"B\"\nimpacts = [\"MASS\"]\nresponses = [\"MASS\"]";
    for (from, to, said) in [
        ("mass_kg = 3.0", "mass_kg = 3000.0", "mass_kg must be over 0"),
        ("sigma = 0.002", "sigma = 2.0", "relative standard deviation"),
        ("[known_mass]\nmass_kg = 3.0\nsigma = 0.002", "", "need [known_mass]"),
        (block, "name = \"B\"\nimpacts = [\"MASS\"]\nresponses = [\"B1\"]", "a block of its own"),
        (block, "name = \"AJB\"\nimpacts = [\"MASS\"]\nresponses = [\"MASS\"]", "are measured in B"),
        (block, "name = \"B\"\nimpacts = [\"BZ1\"]\nresponses = [\"C1\"]", "known_mass needs a block"),
        (
            "0.0363], direction = [0, 0, -1]",
            "0.0363], direction = [0, -1, 0]",
            "must be the sliding direction",
        ),
    ] {
        assert!(CONTACT.contains(from), "{from}");
        let wrong = Plan::parse(&CONTACT.replacen(from, to, 1), "my.toml").expect_err(from).to_string();
        assert!(wrong.contains(said), "{from}: {wrong}");
    }
}

#[test]
fn the_open_joint_has_a_cell_of_its_own_and_one_to_compare_with() {
    let plan = Plan::parse(CONTACT, "contact.toml").expect("a good plan");
    let cells = plan.open_joint_cells().expect("an open joint");
    assert_eq!((cells.open, cells.axes), (["OPEN", "OPEN"].map(String::from), [2, 2]));
    assert_eq!(cells.closed, ["AZ3", "A3"].map(String::from));
    let block = "name = \"AJB\"\nimpacts = [\"OPEN\"]\nresponses = [\"OPEN\"]";
    for (from, to, said) in [
        (block, "name = \"AJB\"\nimpacts = [\"OPEN\"]\nresponses = [\"A3\"]", "a block of their own"),
        (block, "name = \"B\"\nimpacts = [\"OPEN\"]\nresponses = [\"OPEN\"]", "are measured in AJB"),
        ("name = \"A3\", grouping = 3", "name = \"A3\", grouping = 4", "compared with the closed one"),
        ("{ name = \"LDV_B\", position_m", "{ name = \"LDV_C\", position_m", "LDV_B is stated"),
    ] {
        assert!(CONTACT.contains(from), "{from}");
        let wrong = Plan::parse(&CONTACT.replacen(from, to, 1), "my.toml").expect_err(from).to_string();
        assert!(wrong.contains(said), "{from}: {wrong}");
    }
}

#[test]
fn sensors_that_stay_and_a_hammer_by_hand() {
    let of = |from: &str, to: &str| {
        assert!(SMALL.contains(from), "{from}");
        Plan::parse_new(&SMALL.replacen(from, to, 1), "my.toml")
    };
    let point = |channels: &str| format!("{{ name = \"A2\", channels = {channels}, grouping = 1");
    let stays = of("{ name = \"A2\", grouping = 1", &point("[\"a\", \"b\", \"c\"]")).expect("good");
    assert_eq!(stays.own_channels("A2").map(<[String]>::len), Some(3));
    assert_eq!(stays.own_channels("B1"), None);
    for (channels, word) in
        [("[\"a\"]", "must be 3, one for each axis, not 1"), ("[\"a\", \"b\", \"a\"]", "`a` is listed twice")]
    {
        let said = of("{ name = \"A2\", grouping = 1", &point(channels)).expect_err(channels).to_string();
        assert!(said.contains(word), "{said}");
    }
    assert_eq!(of("[force]", "[force]").expect("good").by_hand(), None);
    assert_eq!(of("[force]", "[hammer]\nby = \"hand\"\n[force]").expect("good").by_hand(), Some(600.0));
    // then no pulse is needed, and no second force may be requested
    let pulses = "pulse_us = 3500\npulse_bounds_us = [2500, 6000]";
    assert!(of(pulses, "").expect_err("a coil").to_string().contains("pulse_bounds_us"));
    let hand = |more: &str| of(pulses, &format!("{more}\n[hammer]\nby = \"hand\""));
    assert!(hand("").is_ok());
    assert!(hand("softer = 0.7").expect_err("softer").to_string().contains("force.softer needs the coil"));
    let said = of("[force]", "[hammer]\nby = \"hand\"\npatience_s = 0.0\n[force]").expect_err("no patience");
    assert!(said.to_string().contains("hammer.patience_s"), "{said}");
}

#[test]
fn what_may_be_left_out_is_checked_where_it_stands() {
    let with = |more: &str| Plan::parse(&format!("{SMALL}\n{more}\n"), "my.toml");
    let good = "[enough]\nrandom_error = 0.02\nband_hz = [100, 800]\n[[channel]]\nname = \"force\"\nserial = \"1\"\n\
                calibrated = \"2026-02-03\"\npolarity = -1\nsensitivity_v = 0.0224";
    assert_eq!(with(good).expect("good").channel[0].get_ref().polarity, Some(-1));
    for (more, word) in [
        ("[shaker]\nfrequencies_hz = [100]\namplitudes_m = [0.1]", "shaker.amplitudes_m"),
        ("[contact]\nnormal_load_n = 0", "contact: normal_load_n"),
        ("[contact]\nparallel_path = 1.0133", "contact.parallel_path"),
        ("[specimens]\na = { section_m = [18, 14], clamp_m = 12, young_pa = 2e11 }", "not in mm"),
        ("[specimens]\nb = { section_m = [0.018, 0.014], clamp_m = 0.012, young_pa = 210 }", "not in GPa"),
        ("[shaker]\nfrequencies_hz = []\namplitudes_m = [1e-7]", "shaker.frequencies_hz"),
        ("[shaker]\nfrequencies_hz = [6000]\namplitudes_m = [1e-7]", "shaker.frequencies_hz"),
        ("[enough]\nrandom_error = 2.0\nband_hz = [100, 800]", "enough.random_error"),
        ("[enough]\nrandom_error = 0.1\nband_hz = [900, 800]", "enough.band_hz"),
        ("[[channel]]\nname = \"a\"\npolarity = 0", "polarity"),
        ("[[channel]]\nname = \"a\"\nsensitivity_v = -1.0", "sensitivity_v"),
        ("[[channel]]\nname = \"a\"\ncalibrated = \"last May\"", "calibrated"),
        ("[[channel]]\nname = \"a\"\n[[channel]]\nname = \"a\"", "twice"),
    ] {
        let said = with(more).expect_err(more).to_string();
        assert!(said.contains(word), "{said}");
    }
}

#[test]
fn what_no_plan_can_mean_is_refused_for_a_new_campaign_and_read_in_an_old_one() {
    for (from, to, word) in [
        ("[-0.02, 0.02, 0.03]", "[-20.0, 20.0, 30.0]", "in m, not in mm"),
        ("virtual_point_m = [0.0, 0.0, 0.0]", "virtual_point_m = [0.0, nan, 0.0]", "virtual_point_m"),
        ("exponential_per_s = 2.3", "exponential_per_s = -2.3", "window.exponential_per_s"),
        ("exponential_per_s = 2.3", "exponential_per_s = 1e308", "window.exponential_per_s"),
        ("level_n = 3.0", "level_n = inf", "trigger.level_n"),
        ("level_n = 3.0", "level_n = 80.0", "trigger.level_n"),
        ("window_samples = 128", "window_samples = 0", "settle.window_samples"),
        ("quiet_relative = 0.003", "quiet_relative = 3.0", "settle.quiet_relative"),
        ("target_n = 50.0", "target_n = 25.0", "every hit is refused"),
        ("strong_n = 75.0", "strong_n = inf", "strong_n"),
        ("name = \"small\"", "name = \"\"", "name must have"),
        ("name = \"small\"", "name = \"\\u001b[2J\"", "name must have"),
        ("name = \"A2\"", "name = \"A/2\"", "files are named after it"),
        ("name = \"LC1\"", "name = \"\\u202eLC1\"", "must have one printable"),
        ("direction = [0, 0, 1]", "direction = [0, 0, 2]", "direction of `LDV_A` must have length 1"),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let text = SMALL
            .replace(from, to)
            .replace("\"A2\"]", &format!("\"{}\"]", if to.contains("A/2") { "A/2" } else { "A2" }));
        let said = Plan::parse_new(&text, "my.toml").expect_err(to).to_string();
        assert!(said.contains(word), "{to}: {said}");
        assert!(Plan::parse(&text, "my.toml").is_ok(), "{to}: a file that was made with it cannot be read");
    }
    for (priors, word) in [
        ("position_m = 0.5", "it is in m"),
        ("hammer_angle_rad = 2.0", "it is in rad"),
        ("gain = 1.0", "0.01 for 1 %"),
        ("skew_s = 2.0", "it is in s"),
    ] {
        let said = Plan::parse_new(&format!("{SMALL}\n[priors]\n{priors}\n"), "my.toml").expect_err(priors);
        assert!(said.to_string().contains(word), "{said}");
    }
    for text in [PAPER, DEMO, SMALL, CONTACT, CONTACT_BY_HAND, FRF_ONLY, PAPER_CONTACT] {
        Plan::parse_new(text, "plan").expect("a good plan");
    }
}

#[test]
fn everything_that_is_wrong_is_told_at_once_by_line() {
    let text = SMALL
        .replace("rate_hz = 51200", "rate_hz = 0\nrate = 3")
        .replace("wanted = 2", "wanted = 2\nwnated = 3")
        .replace("impacts = [\"BZ1\"]", "impacts = [\"BZ7\"]")
        .replace("direction = [0, -1, 0]", "direction = [0, -2, 0]");
    let all = Plan::parse_all(&text, "my.toml").expect_err("five faults");
    let said: Vec<String> = all.iter().map(ToString::to_string).collect();
    let line = |word: &str| 1 + text.lines().position(|line| line.contains(word)).expect("it is there");
    assert_eq!(all.len(), 5, "{said:#?}");
    for (fault, (at, word)) in all.iter().zip([
        ("[record]", "record.rate_hz"),
        ("rate = 3", "unknown field `rate`"),
        ("wnated", "unknown field `wnated`"),
        ("BZ7", "no point `BZ7`"),
        ("[0, -2, 0]", "length 1"),
    ]) {
        assert!(fault.line == line(at) && fault.what.contains(word), "{at}: {fault}");
    }
    let first = Plan::parse_new(&text, "my.toml").expect_err("five faults").to_string();
    assert!(first.contains("`jointrig plan check` lists 4 more"), "{first}");
    // a value of the wrong type hides the errors that only a complete plan shows
    let unreadable = text.replace("version = 1", "version = \"one\"");
    let all = Plan::parse_all(&unreadable, "my.toml").expect_err("it cannot be read");
    assert_eq!((all.len(), all[0].line), (3, line("version")), "{all:?}");
}
