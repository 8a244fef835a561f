//! QEMU: the same processor core as the rig's controller, without the rig.

use crate::packages::Consent;
use crate::packages::EMULATOR;
use crate::project::{EMULATED_BOARD, Project};
use crate::{command, firmware, setup};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::Path;
use std::process::Command;

/// Options of `cargo xtask qemu`.
#[derive(Args, Debug, Default)]
pub struct Options {
    /// Use a clock that counts instructions: counts are the same in every run.
    #[arg(long)]
    icount: bool,
    /// Run the image of golden vectors and benchmark instead of the board's.
    #[arg(long)]
    checks: bool,
    /// An argument for the image itself, read by it through semihosting; may be repeated.
    #[arg(long = "arg", value_name = "TEXT")]
    image_arguments: Vec<String>,
    /// Passed on to qemu-system-arm, for example `-- -serial pty`.
    #[arg(last = true)]
    extra: Vec<String>,
}

/// Builds the emulated board's image and runs it; fails unless QEMU's exit code, which is the
/// image's, is 0.
pub fn run(project: &Project, options: &Options) -> Result<()> {
    if firmware::board(project, EMULATED_BOARD)?.is_none() {
        bail!("there is no board image to run: firmware/boards/{EMULATED_BOARD} does not exist yet");
    }
    let consent = Consent::new(false);
    let toolchain = setup::everything(project, consent)?;
    let image = if options.checks {
        firmware::build_checks(project, &toolchain)?
    } else {
        firmware::build_board(project, &toolchain, EMULATED_BOARD)?
    };
    let mut qemu = Command::new(EMULATOR);
    qemu.args(arguments(&image, options)?);
    command::run(&mut qemu).context("the emulated board did not end well")
}

/// Runs an image with one argument and returns its output.
pub fn listen(image: &Path, argument: &str, icount: bool) -> Result<String> {
    let options = Options { icount, image_arguments: vec![argument.to_owned()], ..Options::default() };
    let mut qemu = Command::new(EMULATOR);
    qemu.args(arguments(image, &options)?);
    println!("  $ {}", command::line(&qemu));
    command::output(&mut qemu).context("the emulated board did not end well")
}

fn arguments(image: &Path, options: &Options) -> Result<Vec<String>> {
    let image =
        image.to_str().with_context(|| format!("{} is not UTF-8: choose another folder", image.display()))?;
    let mut semihosting = "enable=on,target=native".to_owned();
    for argument in &options.image_arguments {
        // QEMU splits at commas; a doubled comma stands for one.
        semihosting.push_str(",arg=");
        semihosting.push_str(&argument.replace(',', ",,"));
    }
    let mut arguments: Vec<String> =
        ["-M", EMULATED_BOARD, "-display", "none", "-monitor", "none"].map(String::from).into();
    if !options.extra.iter().any(|argument| argument == "-serial") {
        arguments.extend(["-serial", "null"].map(String::from));
    }
    arguments.extend(["-semihosting-config".into(), semihosting]);
    if options.icount {
        arguments.extend(["-icount", "shift=10,sleep=off"].map(String::from));
    }
    arguments.extend(["-kernel".into(), image.into()]);
    arguments.extend(options.extra.iter().cloned());
    Ok(arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_runs_without_display_and_monitor() {
        let line = arguments(Path::new("/t/mps2-an505"), &Options::default()).expect("UTF-8").join(" ");
        assert_eq!(
            line,
            "-M mps2-an505 -display none -monitor none -serial null -semihosting-config enable=on,target=native \
             -kernel /t/mps2-an505"
        );
    }

    #[test]
    fn arguments_reach_the_image_and_the_emulator() {
        let options = Options {
            icount: true,
            image_arguments: vec!["bench".into(), "1,2".into()],
            extra: vec!["-serial".into(), "pty".into()],
            ..Options::default()
        };
        let line = arguments(Path::new("i"), &options).expect("UTF-8").join(" ");
        assert!(
            line.contains("enable=on,target=native,arg=bench,arg=1,,2 -icount shift=10,sleep=off"),
            "{line}"
        );
        assert!(line.ends_with("-kernel i -serial pty") && !line.contains("null"), "{line}");
    }
}
