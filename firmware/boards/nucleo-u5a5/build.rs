//! Linker scripts: start-up, log strings, and the build id by which a host finds the table of these
//! strings.

fn main() {
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x", "-Tbuild-id.x", "--build-id=sha1"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rustc-env=JOINTRIG_TARGET={}", std::env::var("TARGET").unwrap_or_default());
    println!("cargo:rerun-if-changed=build.rs");
}
