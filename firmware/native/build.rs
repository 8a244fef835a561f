//! Passes the build target to the crate, so that a virtual board can report it in its handshake.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let target = std::env::var("TARGET").unwrap_or_else(|_| "unknown".into());
    println!("cargo::rustc-env=JOINTRIG_TARGET={target}");
}
