//! Writes the image to the rig's controller.

use crate::firmware;
use crate::packages::Consent;
use crate::project::Project;
use crate::{command, setup};
use anyhow::{Context, Result, bail};
use std::process::Command;

/// The rig controller's package.
const BOARD: &str = "nucleo-u5a5";
/// Its chip, as probe-rs names it.
const CHIP: &str = "STM32U5A5ZJTxQ";

/// `cargo xtask flash`: with `detach`, returns once the image is written; otherwise stays attached
/// and shows the board's log.
pub fn run(project: &Project, detach: bool) -> Result<()> {
    // Everything that is missing is reported together, before anything is built.
    let mut missing = Vec::new();
    if firmware::board(project, BOARD)?.is_none() {
        missing.push(format!("there is no board image: firmware/boards/{BOARD} does not exist yet"));
    }
    let probe = command::find_program("probe-rs");
    if probe.is_none() {
        missing.push(
            "probe-rs is not installed: run `cargo install probe-rs-tools --locked` (on Linux it also needs the udev \
             rules of https://probe.rs/docs/getting-started/probe-setup/)"
                .to_owned(),
        );
    }
    let (Some(probe), true) = (probe, missing.is_empty()) else {
        bail!("cannot flash:\n  - {}", missing.join("\n  - "));
    };
    let toolchain = setup::target(project, Consent::new(false))?;
    let image = firmware::build_board(project, &toolchain, BOARD)?;
    let mut command = Command::new(probe);
    command.args([if detach { "download" } else { "run" }, "--chip", CHIP]).arg(image);
    command::run(&mut command).context(
        "probe-rs could not write the image: is the board connected by its ST-LINK socket, and powered?",
    )
}
