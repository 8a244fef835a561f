//! `cargo xtask budgets`: the cost of the firmware, counted in the emulator, and its limits.
//!
//! The image's own benchmark counts executed instructions under QEMU's `-icount` clock; two runs
//! must agree exactly. Instructions are not cycles, and another compiler gives other counts: the
//! limits have a margin for that.

use crate::packages::Consent;
use crate::project::{EMULATED_BOARD, Project, WIRED_BOARD};
use crate::setup::Toolchain;
use crate::{emulator, firmware, setup, size};
use anyhow::{Context, Result, bail};
use std::fmt::Write;
use std::path::Path;

/// Output path of the table, relative to the repository's root.
const PAGE: &str = "docs/firmware-budgets.md";

/// One quantity: its name in the image's report, its heading in the table, its limit.
struct Budget {
    name: &'static str,
    what: &'static str,
    limit: u64,
}

const fn budget(name: &'static str, what: &'static str, limit: u64) -> Budget {
    Budget { name, what, limit }
}

/// Instructions per scan of sixteen channels.
const SCANS: [Budget; 6] = [
    budget("scan.steady", "streaming, hammer at rest", 350),
    budget("scan.waiting", "streaming, judging three channels for quiet", 450),
    budget("scan.shaking", "streaming, shaker running, two channels within limits", 410),
    budget("scan.flight", "streaming, hammer in flight", 410),
    budget("scan.listening", "streaming, following force and friction after contact", 520),
    budget("scan.stuffed", "streaming, hammer at rest, over a stream of bytes (COBS)", 700),
];

/// Instructions for the parts of a scan's cost, and for frames.
const PARTS: [Budget; 8] = [
    budget(
        "part.join",
        "a block of both converters: CRC-16, scans of sixteen channels, over-range (15 scans)",
        2_200,
    ),
    budget("frame.seal_packet", "CRC-32 of a full block of samples (15 scans), as a packet", 1_900),
    budget("frame.seal", "CRC-32 and COBS of a full block of samples (15 scans)", 7_000),
    budget(
        "part.half_band",
        "30 scans of sixteen channels into 15, by a half-band filter (in no image: docs/front-end.md)",
        9_000,
    ),
    budget("part.copy_480", "one copy of a block's samples (there are three on the way)", 600),
    budget("frame.seal_short", "CRC-32 and COBS of an acknowledgement", 500),
    budget("frame.read", "finding and checking a frame of the longest size", 20_000),
    budget("greet", "a handshake, received, answered and logged", 7_000),
];

/// Instructions from the first byte of a request to the last byte of its answer.
const COMMANDS: [Budget; 15] = [
    budget("info", "Info", 8_000),
    budget("channel", "Channel", 5_500),
    budget("status", "Status", 6_500),
    budget("start", "Start", 5_000),
    budget("stop", "Stop", 5_000),
    budget("resend", "Resend of fifteen scans, with the two blocks that hold them", 30_000),
    budget("trigger", "Trigger", 5_000),
    budget("load_cells", "LoadCells", 6_500),
    budget("arm", "Arm, with its event", 6_000),
    budget("disarm", "Disarm, with its event", 8_000),
    budget("fire", "Fire, with sixteen limits of quiet", 12_000),
    budget("shake", "Shake, with six limits and its event", 8_000),
    budget("rest", "Rest, with its event", 6_000),
    budget("stage", "Stage (virtual rigs only)", 8_500),
    budget("emergency_stop", "EmergencyStop, with its events", 12_000),
];

/// Instructions from a delivered block to the required reaction.
const LATENCIES: [Budget; 5] = [
    budget("latency.coil_on", "block delivered → coil on", 8_000),
    budget("latency.coil_off", "block with the guard open delivered → coil off", 8_000),
    budget("block.contact", "block with the trigger, until all tasks rest", 25_000),
    budget("block.guard", "block with the guard open, until all tasks rest", 25_000),
    budget("block.worst", "the worst block of the whole run: four blocks leave in COBS", 35_000),
];

/// Memory, bytes.
const MEMORY: [Budget; 5] = [
    budget("flash", "flash of mps2-an505: code, constants, initial values", size::EMULATED_FLASH),
    budget("flash.wired", "flash of nucleo-u5a5", size::WIRED_FLASH),
    budget(
        "ram",
        "RAM of mps2-an505: variables, the ring of a second of sixteen channels among them",
        2 << 20,
    ),
    budget("ram.wired", "RAM of nucleo-u5a5", 2 << 20),
    budget("stack", "stack, high-water mark of the benchmark", 32 << 10),
];

/// The measured quantities of one image.
struct Figures(Vec<(String, u64)>);

impl Figures {
    fn of(&self, name: &str) -> Result<u64> {
        let found = self.0.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| *value).with_context(|| format!("the image's benchmark reports no {name}"))
    }
}

/// `cargo xtask budgets`.
pub fn command(project: &Project) -> Result<()> {
    let toolchain = setup::everything(project, Consent::new(false))?;
    let figures = measure(project, &toolchain)?;
    let page = page(&figures)?;
    let path = project.root.join(PAGE);
    std::fs::create_dir_all(project.root.join("docs"))?;
    std::fs::write(&path, &page).with_context(|| format!("could not write {}", path.display()))?;
    print!("{page}");
    enforce(&figures)
}

/// Counts and compares with the limits; returns a remark.
pub fn check(project: &Project, toolchain: &Toolchain) -> Result<String> {
    let figures = measure(project, toolchain)?;
    enforce(&figures)?;
    Ok(format!("{} instructions per scan", figures.of("scan.steady")?))
}

fn measure(project: &Project, toolchain: &Toolchain) -> Result<Figures> {
    let image = firmware::build_board(project, toolchain, EMULATED_BOARD)?;
    let wired = firmware::build_board(project, toolchain, WIRED_BOARD)?;
    let checks = firmware::build_checks(project, toolchain)?;
    let listen = || emulator::listen(&checks, "bench", true);
    let (first, second) = std::thread::scope(|scope| {
        let other = scope.spawn(listen);
        (listen(), other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    });
    let (first, second) = (first?, second?);
    if first != second {
        bail!("two runs of the benchmark differ, which must not be:\n{first}\n{second}");
    }
    figures(&first, &image, &wired)
}

fn figures(report: &str, image: &Path, wired: &Path) -> Result<Figures> {
    let mut figures = parse(report)?;
    let (sizes, wired) = (size::of_image(image)?, size::of_image(wired)?);
    let sizes = [
        ("flash", sizes.flash()),
        ("flash.wired", wired.flash()),
        ("ram", sizes.ram()),
        ("ram.wired", wired.ram()),
    ];
    figures.0.extend(sizes.map(|(name, bytes)| (name.to_owned(), bytes)));
    Ok(figures)
}

fn parse(report: &str) -> Result<Figures> {
    let lines = report.lines().map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["figure", name, value] => Ok((name.to_owned(), value.parse()?)),
            _ => bail!("the image's benchmark said something else than a figure: {line}"),
        }
    });
    lines.collect::<Result<_>>().map(Figures)
}

fn all() -> impl Iterator<Item = &'static Budget> {
    SCANS.iter().chain(&PARTS).chain(&COMMANDS).chain(&LATENCIES).chain(&MEMORY)
}

fn enforce(figures: &Figures) -> Result<()> {
    let mut over = Vec::new();
    for budget in all() {
        let value = figures.of(budget.name)?;
        if value > budget.limit {
            over.push(format!("{} ({}): {value}, allowed {}", budget.name, budget.what, budget.limit));
        }
    }
    if over.is_empty() {
        return Ok(());
    }
    bail!(
        "the firmware costs more than its budget: {}. Make it cheaper, or raise the limit in xtask/src/budgets.rs \
         and say why",
        over.join("; ")
    )
}

fn page(figures: &Figures) -> Result<String> {
    let mut page = String::from(
        "# What the firmware costs\n\n\
         The firmware's own benchmark counts these figures in QEMU (`firmware/boards/mps2-an505/src/checks/bench.rs`): the real tasks\n\
         process sixteen channels of small noise at 51.2 kHz. Everything is included: both converters' words are checked, proven in step\n\
         and joined; the block is judged for the hammer, kept in the ring, sealed as a packet and handed to the link;\n\
         acknowledgements, reports and the executor count too. No CRC uses any of the chip's units.\n\
         The figures are instructions of a Cortex-M33, equal in every run with one compiler; they are not cycles. At 160 MHz a scan\n\
         has 3125 cycles, and a block of 15 scans 46 875.\n\n\
         This page is written by `cargo xtask budgets`; `cargo xtask test` fails when a limit is exceeded.\n",
    );
    table(&mut page, figures, "Instructions per scan", &SCANS)?;
    let (scan, seal) = (figures.of("scan.steady")?, figures.of("frame.seal_packet")?.div_ceil(15));
    let join = figures.of("part.join")?.div_ceil(15);
    let copies = (3 * figures.of("part.copy_480")?).div_ceil(15);
    let rest = scan.saturating_sub(join + seal + copies);
    // Writing into a String cannot fail.
    let _ = writeln!(
        page,
        "\nWhere the instructions go at rest: {join} CRC-16 and scans of both converters, {seal} CRC-32, about {copies} for three copies, and \
         {rest} for the rest\n(proof that the converters are in step, hammer, ring, tasks and their wake-ups, acknowledgements, reports).\n\n\
         What the chip's units would save (estimated, not measured): its CRC unit takes a word in one store, so that each of a\n\
         block's 124 words costs a load, a store and a quarter of a loop. That is about 300 instructions instead of {}, and saves about\n\
         {} a scan. The serial port's own CRC unit could check the converters' CRC (9 words of 16 bits, any polynomial), which would save\n\
         about 90 more a scan. Neither is used, because neither has been seen to work on a board.",
        figures.of("frame.seal_packet")?,
        figures.of("frame.seal_packet")?.saturating_sub(300) / 15
    );
    table(&mut page, figures, "Instructions per frame and part", &PARTS)?;
    table(&mut page, figures, "Instructions per command", &COMMANDS)?;
    table(&mut page, figures, "Instructions of the longest ways", &LATENCIES)?;
    table(&mut page, figures, "Bytes", &MEMORY)?;
    Ok(page)
}

fn table(page: &mut String, figures: &Figures, title: &str, budgets: &[Budget]) -> Result<()> {
    let _ = write!(page, "\n## {title}\n\n| what | measured | limit |\n|---|---:|---:|\n");
    for budget in budgets {
        let _ = writeln!(page, "| {} | {} | {} |", budget.what, figures.of(budget.name)?, budget.limit);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(value: u64) -> Figures {
        Figures(all().map(|budget| (budget.name.to_owned(), budget.limit.min(value))).collect())
    }

    #[test]
    fn a_report_is_figures_and_nothing_else() {
        let figures = parse("figure scan.steady 572\nfigure stack 15188\n").expect("two figures");
        assert_eq!(figures.of("scan.steady").expect("it is there"), 572);
        assert!(figures.of("scan.waiting").is_err());
        assert!(parse("qemu: something is wrong\n").is_err());
    }

    #[test]
    fn what_is_over_its_limit_is_named() {
        assert!(enforce(&report(u64::MAX)).is_ok(), "the limit itself is allowed");
        let mut figures = report(100);
        figures.0[0].1 = 351;
        let message = enforce(&figures).expect_err("over the limit").to_string();
        assert!(message.contains("scan.steady (streaming, hammer at rest): 351, allowed 350"), "{message}");
    }

    #[test]
    fn the_page_has_every_figure() {
        let page = page(&report(100)).expect("all figures are there");
        assert!(all().all(|budget| page.contains(&format!("| {} | 100 | {} |", budget.what, budget.limit))));
    }
}
