//! The `jointrig` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    jointrig::cli::main()
}
