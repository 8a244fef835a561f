//! Linking: the memory map in this folder, and the scripts of cortex-m-rt, the log strings and the
//! build id.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory.x");
    let folder = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| ".".into());
    println!("cargo::rustc-link-search={folder}");
    for argument in ["-Tlink.x", "-Tdefmt.x", "-Tbuild-id.x", "--nmagic", "--build-id=sha1"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    let target = std::env::var("TARGET").unwrap_or_else(|_| "unknown".into());
    println!("cargo::rustc-env=JOINTRIG_TARGET={target}");
}
