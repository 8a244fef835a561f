//! Tests of the converter's driver with a register-level model of the converter.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod model;

use embassy_futures::block_on;
use jointrig_firmware::ad7606b::frames::data_crc;
use jointrig_firmware::ad7606b::part::{AD7606B, AD7606C_16, Lines, Oversampling};
use jointrig_firmware::ad7606b::{Converter, Error, Range, Settings, registers};
use model::{Faults, Model, Port, ResetPin};

type Chip = Converter<Port, ResetPin>;

fn chip(faults: Faults) -> (Model, Chip) {
    let model = Model::new(faults);
    let chip = Converter::new(model.port(), model.reset_pin(), &AD7606B);
    (model, chip)
}

/// Resets and configures the chip, as a board does.
fn ready(settings: &Settings) -> (Model, Chip) {
    let (model, mut chip) = chip(Faults::default());
    chip.reset(&mut model.clock()).unwrap();
    chip.configure(settings).unwrap();
    (model, chip)
}

fn convert(
    model: &Model,
    chip: &mut Chip,
) -> Result<[i32; 8], Error<std::convert::Infallible, std::convert::Infallible>> {
    block_on(chip.convert(&mut model.convst(), &mut model.busy(), &mut model.clock()))
}

#[test]
fn settings_arrive_in_the_registers() {
    let ranges = [
        Range::Volts2_5,
        Range::Volts5,
        Range::Volts10,
        Range::Volts10,
        Range::Volts5,
        Range::Volts2_5,
        Range::Volts10,
        Range::Volts5,
    ];
    let (model, _chip) = ready(&Settings { ranges, lines: Lines::Four, ..Settings::default() });
    assert_eq!(model.register(0x02), 0x10);
    assert_eq!([3, 4, 5, 6].map(|address| model.register(address)), [0x10, 0x33, 0x01, 0x13]);
    assert_eq!(model.register(0x08), 3);
    assert_eq!(model.register(0x21), 0x3F, "everything watched, CRC on");
}

#[test]
fn volts_come_back_as_volts_in_every_range() {
    for (range, volts) in [(Range::Volts2_5, 1.234), (Range::Volts5, -4.9), (Range::Volts10, 9.99)] {
        for crc in [false, true] {
            let (model, mut chip) = ready(&Settings { ranges: [range; 8], crc, ..Settings::default() });
            model.with(|state| state.volts = std::array::from_fn(|i| volts * (i as f64 + 1.0) / 8.0));
            let codes = convert(&model, &mut chip).unwrap();
            for (i, code) in codes.into_iter().enumerate() {
                let due = volts * (i as f64 + 1.0) / 8.0;
                let step = f64::from(range.full_scale_v()) / 32_768.0;
                assert!((f64::from(range.volts(code, 16)) - due).abs() <= step, "V{}", i + 1);
            }
            assert!(!model.in_registers(), "conversions are read in ADC mode");
        }
    }
}

#[test]
fn the_words_that_dma_would_bring_pass_the_same_check() {
    let (model, mut chip) = ready(&Settings::default());
    model.with(|state| state.volts = [0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7, -0.8]);
    let codes = convert(&model, &mut chip).unwrap();
    let bytes: Vec<u8> = codes.iter().flat_map(|code| (*code as i16).to_be_bytes()).collect();
    let codes = codes.map(|code| code as i16);
    assert_eq!(jointrig_hot::pair::data_crc(&codes), data_crc(&bytes));
}

#[test]
fn oversampling_is_waited_for() {
    for (oversampling, ns) in
        [(Oversampling::X1, 850), (Oversampling::X8, 9_900), (Oversampling::X256, 324_000)]
    {
        let (model, mut chip) = ready(&Settings { oversampling, ..Settings::default() });
        let before = model.with(|state| state.now_ns);
        convert(&model, &mut chip).unwrap();
        let took = model.with(|state| state.now_ns) - before;
        assert!((ns..ns + 1_000).contains(&took), "{oversampling:?}: {took} ns");
    }
}

#[test]
fn a_healthy_chip_passes_its_self_test_with_and_without_crc() {
    for crc in [false, true] {
        let (model, mut chip) = ready(&Settings { crc, ..Settings::default() });
        block_on(chip.self_test(&mut model.convst(), &mut model.busy(), &mut model.clock())).unwrap();
        assert_eq!(model.register(0x21) & registers::INTERFACE_CHECK, 0, "the pattern is off again");
        model.with(|state| state.volts = [5.0; 8]);
        assert_eq!(convert(&model, &mut chip).unwrap(), [16_384; 8]);
    }
}

#[test]
fn a_reset_undoes_the_settings_and_is_noticed() {
    let (model, mut chip) = ready(&Settings::default());
    assert!(!chip.was_reset().unwrap());
    chip.reset(&mut model.clock()).unwrap();
    assert_eq!(model.register(0x08), 0);
    chip.configure(&Settings::default()).unwrap();
    assert!(convert(&model, &mut chip).is_ok());
}

#[test]
fn busy_stuck_is_an_error_after_a_bounded_time_and_the_chip_says_so_too() {
    let (model, mut chip) = ready(&Settings::default());
    model.with(|state| state.faults.busy_stuck = true);
    let before = model.with(|state| state.now_ns);
    assert_eq!(convert(&model, &mut chip), Err(Error::BusyStuck { after_us: 30 }));
    assert!(model.with(|state| state.now_ns) - before < 32_000);
    assert_eq!(chip.digital_errors().unwrap(), registers::BUSY_STUCK_HIGH);
    assert_eq!(chip.digital_errors().unwrap(), 0, "asking clears");
    // and it recovers with reset, settings, conversion
    model.with(|state| state.faults.busy_stuck = false);
    chip.reset(&mut model.clock()).unwrap();
    chip.configure(&Settings::default()).unwrap();
    assert!(convert(&model, &mut chip).is_ok());
}

#[test]
fn any_single_wrong_bit_of_data_or_crc_is_noticed() {
    let (model, mut chip) = ready(&Settings::default());
    model.with(|state| state.volts = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0, -8.0]);
    for bit in 0..8 * 18 {
        model.with(|state| state.faults.flipped_bit = Some(bit));
        assert!(matches!(convert(&model, &mut chip), Err(Error::Data(_))), "bit {bit}");
    }
}

#[test]
fn without_crc_the_pattern_finds_a_broken_line() {
    let (model, mut chip) = ready(&Settings { crc: false, ..Settings::default() });
    model.with(|state| state.faults.flipped_bit = Some(33));
    let tested = block_on(chip.self_test(&mut model.convst(), &mut model.busy(), &mut model.clock()));
    assert_eq!(tested, Err(Error::Pattern { channel: 2, found: 0xA33A ^ 0x4000 }));
}

#[test]
fn another_chip_or_none_is_refused() {
    for (faults, found) in [
        (Faults { id: Some(0x31), ..Faults::default() }, 0x31),
        (Faults { no_dout: true, ..Faults::default() }, 0xFF),
    ] {
        let (model, mut chip) = chip(faults);
        assert_eq!(chip.reset(&mut model.clock()), Err(Error::Identity { found, part: "AD7606B" }));
    }
    let model = Model::new(Faults { id: Some(0x31), ..Faults::default() });
    let mut successor = Converter::new(model.port(), model.reset_pin(), &AD7606C_16);
    successor.reset(&mut model.clock()).unwrap();
}

#[test]
fn a_reset_that_did_not_reach_the_chip_is_noticed() {
    let (model, mut chip) = chip(Faults { no_reset: true, ..Faults::default() });
    assert_eq!(chip.reset(&mut model.clock()), Err(Error::NotReset { status: 0 }));
}

#[test]
fn a_range_that_does_not_stick_is_noticed() {
    let (model, mut chip) = chip(Faults { ranges_stick: true, ..Faults::default() });
    chip.reset(&mut model.clock()).unwrap();
    let settings = Settings { ranges: [Range::Volts5; 8], ..Settings::default() };
    assert_eq!(chip.configure(&settings), Err(Error::Readback { address: 0x03, wrote: 0x11, holds: 0x33 }));
}

#[test]
fn what_the_part_cannot_do_is_refused_before_anything_is_written() {
    let (model, mut chip) = ready(&Settings::default());
    let ranges = [Range::Volts12_5; 8];
    let refused = chip.configure(&Settings { ranges, ..Settings::default() });
    assert_eq!(refused, Err(Error::NoRange { range: Range::Volts12_5, part: "AD7606B" }));
    let refused = chip.configure(&Settings { lines: Lines::Eight, ..Settings::default() });
    assert_eq!(refused, Err(Error::NoLayout { part: "AD7606B" }));
    assert_eq!(model.register(0x03), 0x33);
}

#[test]
fn a_damaged_register_answer_is_noticed() {
    let (model, mut chip) = ready(&Settings::default());
    model.with(|state| state.faults.bad_answers = true);
    assert_eq!(chip.digital_errors(), Err(Error::RegisterCrc { address: 0x22 }));
}

#[test]
fn open_inputs_are_found_and_told_once() {
    let (model, mut chip) = ready(&Settings::default());
    model.with(|state| state.open = 0b1000_0100);
    chip.watch_inputs(0xFF, 5).unwrap();
    for _ in 0..5 {
        convert(&model, &mut chip).unwrap();
    }
    assert_eq!(chip.open_inputs().unwrap(), 0b1000_0100);
    model.with(|state| state.open = 0);
    assert_eq!(chip.open_inputs().unwrap(), 0);
}

#[test]
fn errors_say_what_to_look_at() {
    let error: Error<(), ()> = Error::Identity { found: 0xFF, part: "AD7606B" };
    assert_eq!(error.to_string(), "ID 0xff is no AD7606B: check supply, SDI, DOUTA, CS");
    assert_eq!(Error::<(), ()>::BusyStuck { after_us: 30 }.to_string(), "BUSY still high after 30 us");
}
