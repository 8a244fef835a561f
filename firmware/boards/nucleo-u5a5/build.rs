//! Linker scripts, and the id by which a host finds the table of log strings that belongs to this build.

use std::process::Command;

fn main() {
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rustc-env=JOINTRIG_TARGET={}", std::env::var("TARGET").unwrap_or_default());
    println!("cargo:rustc-env=JOINTRIG_BUILD={}", build_id());
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../../../.git/HEAD");
}

/// The first 60 bits of the commit, as a decimal number; 0 outside a repository.
fn build_id() -> u64 {
    let commit = Command::new("git").args(["rev-parse", "HEAD"]).output();
    commit
        .ok()
        .filter(|output| output.status.success())
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .and_then(|commit| u64::from_str_radix(commit.get(..15)?, 16).ok())
        .unwrap_or(0)
}
