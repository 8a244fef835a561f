//! Private sysroots: a target's libraries, built once from the distribution's sources.
//!
//! Debian's `rustc-web` is a current compiler and `rust-web-src` its library sources
//! (`rust-web-clippy` is its clippy); none includes another target precompiled. This module builds
//! `core`, `alloc` and `compiler_builtins` for the microcontroller, or `std` and `test` for
//! Windows, into a folder next to the other build products, with the layout of a sysroot, and a
//! two-line wrapper that makes rustc use it. After that plain `cargo build` with `RUSTC` set to the
//! wrapper is enough. A compiler only reads libraries of its own version, so the folder's name
//! contains the version.
//!
//! It takes about 40 s once for the microcontroller, two minutes for Windows. The work is done in a
//! `.partial` folder under a file lock, and renamed when complete: a folder with the final name is
//! always complete, even after an interruption.

use crate::command;
use crate::command::{make_executable, symlink};
use crate::packages;
use crate::packages::Consent;
use crate::project::{Project, TARGET};
use anyhow::{Context, Result, bail};
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Path of the compiler in Debian's packages.
const RUSTC: &str = "/usr/bin/rustc";
/// Path of the clippy driver in Debian's packages.
pub const CLIPPY: &str = "/usr/bin/clippy-driver";
/// The packages: a current compiler, its library sources, and its clippy.
const PACKAGES: [&str; 3] = ["rustc-web", "rust-web-src", "rust-web-clippy"];
/// The libraries a `no_std` program with an allocator needs.
const LIBRARIES: [&str; 3] = ["core", "alloc", "compiler_builtins"];
/// 64-bit Windows with the GNU tools, which Debian has as a cross compiler.
pub const WINDOWS: &str = "x86_64-pc-windows-gnu";

/// What a sysroot is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sysroot {
    /// The microcontroller.
    Firmware,
    /// Windows.
    Windows,
}

impl Sysroot {
    fn target(self) -> &'static str {
        match self {
            Self::Firmware => TARGET,
            Self::Windows => WINDOWS,
        }
    }

    /// Beginning of its folder's name, and the name of its lock.
    fn name(self) -> &'static str {
        match self {
            Self::Firmware => "firmware-sysroot",
            Self::Windows => "windows-sysroot",
        }
    }

    /// The crates that cargo builds.
    fn crates(self) -> &'static str {
        match self {
            Self::Firmware => "core,alloc",
            Self::Windows => "std,panic_unwind,proc_macro,test",
        }
    }

    /// Library that exists only in a complete sysroot.
    fn last(self) -> &'static str {
        match self {
            Self::Firmware => "core",
            Self::Windows => "test",
        }
    }

    fn duration(self) -> &'static str {
        match self {
            Self::Firmware => "about 40 s",
            Self::Windows => "about two minutes",
        }
    }

    fn libraries(self, folder: &Path) -> PathBuf {
        folder.join("lib/rustlib").join(self.target()).join("lib")
    }
}

/// Environment variables of the caller that must not affect the build of `core`.
const FOREIGN: [&str; 7] = [
    "RUSTFLAGS",
    "CARGO_ENCODED_RUSTFLAGS",
    "CARGO_BUILD_RUSTFLAGS",
    "CARGO_BUILD_TARGET",
    "CARGO_TARGET_DIR",
    "RUSTC_WRAPPER",
    "RUSTC_WORKSPACE_WRAPPER",
];

/// The distribution's compiler with its library sources.
struct Distribution {
    /// Output of `rustc -vV`: all of it determines which sysroot fits.
    version: String,
    /// The compiler's own sysroot.
    sysroot: PathBuf,
}

impl Distribution {
    /// The installed compiler, if it is new enough and has its sources.
    fn find() -> Result<Option<Self>> {
        if !command::is_executable(Path::new(RUSTC)) {
            return Ok(None);
        }
        let version = command::output(Command::new(RUSTC).arg("-vV"))?;
        let sysroot = command::output(Command::new(RUSTC).args(["--print", "sysroot"]))?;
        let found = Self { version, sysroot: PathBuf::from(sysroot.trim()) };
        let usable = found.sources().join("core/src/lib.rs").is_file()
            && command::is_executable(Path::new(CLIPPY))
            && is_at_least(found.field("release")?, env!("CARGO_PKG_RUST_VERSION"));
        Ok(usable.then_some(found))
    }

    fn sources(&self) -> PathBuf {
        self.sysroot.join("lib/rustlib/src/rust/library")
    }

    /// One line of `rustc -vV`, such as `host` or `release`.
    fn field(&self, name: &str) -> Result<&str> {
        field(&self.version, name)
            .with_context(|| format!("`{RUSTC} -vV` names no {name}: it answered\n{}", self.version))
    }

    /// The folder of the sysroot that fits this compiler.
    fn folder(&self, project: &Project, sysroot: Sysroot) -> Result<PathBuf> {
        let mut hasher = DefaultHasher::new();
        self.version.hash(&mut hasher);
        let (release, hash) = (self.field("release")?, hasher.finish() as u32);
        let (name, target) = (sysroot.name(), sysroot.target());
        Ok(project.target.join(format!("{name}-{target}-{release}-{hash:08x}")))
    }
}

/// The microcontroller's finished sysroot that fits the installed compiler; does not install or
/// build anything.
pub fn existing(project: &Project) -> Result<Option<PathBuf>> {
    let Some(distribution) = Distribution::find()? else { return Ok(None) };
    let folder = distribution.folder(project, Sysroot::Firmware)?;
    Ok(is_whole(&folder, Sysroot::Firmware).then_some(folder))
}

/// Installs what is missing, builds the sysroot if there is none, and returns the sysroot.
pub fn ensure(project: &Project, sysroot: Sysroot, consent: Consent) -> Result<PathBuf> {
    let distribution = if let Some(found) = Distribution::find()? {
        found
    } else {
        let names = PACKAGES.join(", ");
        println!("  installing Debian's {names}: a current compiler, its library sources and its clippy");
        packages::install(&PACKAGES, consent).context("no distribution compiler")?;
        Distribution::find()?.with_context(|| {
            format!(
                "{names} are installed, but {RUSTC} is older than {}, or there is no {CLIPPY}, or no sources: remove \
                 another compiler's packages, or update the system",
                env!("CARGO_PKG_RUST_VERSION")
            )
        })?
    };
    let folder = distribution.folder(project, sysroot)?;
    fs::create_dir_all(&project.target)
        .with_context(|| format!("could not create {}", project.target.display()))?;
    let lock_path = project.target.join(format!("{}.lock", sysroot.name()));
    let lock =
        fs::File::create(&lock_path).with_context(|| format!("could not create {}", lock_path.display()))?;
    if lock.try_lock().is_err() {
        println!("  another set-up is at work on the sysroot: waiting for it");
    }
    lock.lock().with_context(|| format!("could not lock {}", lock_path.display()))?;
    if is_whole(&folder, sysroot) {
        println!("  sysroot: {}", folder.display());
    } else {
        println!(
            "  building {} for {} with {RUSTC} {} ({})",
            sysroot.crates(),
            sysroot.target(),
            distribution.field("release")?,
            sysroot.duration()
        );
        complete(&folder, |partial| build(&distribution, sysroot, partial, &folder)).with_context(|| {
            format!("the sysroot could not be built; nothing was left in {}", folder.display())
        })?;
        println!("  sysroot: {} is complete", folder.display());
    }
    if sysroot == Sysroot::Firmware {
        link_linker(&distribution, &folder, consent)?;
    }
    Ok(folder)
}

/// Puts LLVM's linker into the microcontroller's sysroot. It may have moved since (a removed
/// toolchain): a dangling link is recreated. Windows is linked by a C compiler instead.
fn link_linker(distribution: &Distribution, folder: &Path, consent: Consent) -> Result<()> {
    let linker = if let Some(linker) = find_linker(distribution)? {
        linker
    } else {
        println!(
            "  installing lld: the target is linked by LLVM's linker, and neither rustup nor the system has it"
        );
        packages::install(&["lld"], consent).context("no linker for the target")?;
        find_linker(distribution)?
            .context("lld is installed, but there is no /usr/bin/ld.lld: reinstall it")?
    };
    let link = linker_link(folder, distribution)?;
    if !command::is_executable(&link) {
        let _ = fs::remove_file(&link);
        symlink(&linker, &link)?;
    }
    Ok(())
}

/// Calls `work` to fill a `.partial` folder and renames it to `folder` on success: `folder` is
/// complete or absent. The caller holds the lock, so a leftover `.partial` folder is not in use.
fn complete(folder: &Path, work: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut partial = folder.as_os_str().to_owned();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    for stale in [&*partial, folder] {
        if stale.exists() {
            fs::remove_dir_all(stale).with_context(|| format!("could not remove {}", stale.display()))?;
        }
    }
    let result = work(&partial).and_then(|()| {
        fs::rename(&partial, folder)
            .with_context(|| format!("could not rename {} to {}", partial.display(), folder.display()))
    });
    if result.is_err() {
        let _ = fs::remove_dir_all(&partial);
    }
    result
}

/// Builds the sysroot in `partial`; the wrapper it writes already contains `folder`, the final
/// path.
fn build(distribution: &Distribution, sysroot: Sysroot, partial: &Path, folder: &Path) -> Result<()> {
    let target = sysroot.target();
    let package = partial.join("build");
    write(&package.join("src/lib.rs"), "#![no_std]\n")?;
    write(
        &package.join("Cargo.toml"),
        "[package]\nname = \"sysroot\"\nversion = \"0.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         [profile.release]\ncodegen-units = 1\ndebug = 1\n",
    )?;
    let mut cargo = command::cargo(&package);
    for name in FOREIGN {
        cargo.env_remove(name);
    }
    cargo
        .env("RUSTC", RUSTC)
        // `-Zbuild-std` is the only unstable step; its result is used by stable means.
        .env("RUSTC_BOOTSTRAP", "1")
        // Debian's source package has no lock file where cargo looks for it; this variable sets the
        // folder explicitly.
        .env("__CARGO_TESTS_ONLY_SRC_ROOT", distribution.sources())
        .args(["build", "--release", &format!("-Zbuild-std={}", sysroot.crates()), "--target", target])
        .arg("--target-dir")
        .arg(package.join("target"));
    if sysroot == Sysroot::Firmware {
        // With bitcode in the libraries, link-time optimisation reaches into core.
        cargo.env(format!("CARGO_TARGET_{}_RUSTFLAGS", variable_form(target)), "-Cembed-bitcode=yes");
    }
    command::run(&mut cargo)?;

    let built = package.join("target").join(target).join("release/deps");
    let libraries = sysroot.libraries(partial);
    match sysroot {
        Sysroot::Firmware => {
            for library in LIBRARIES {
                copy_library(library, &built, &libraries)?;
            }
        }
        Sysroot::Windows => {
            copy_all_libraries(&built, &libraries)?;
            start_and_end(distribution, &libraries)?;
        }
    }
    // Build scripts and procedural macros run on this machine, so they link to the distribution's
    // own libraries.
    let host = distribution.field("host")?;
    let host_folder = partial.join("lib/rustlib").join(host);
    fs::create_dir_all(host_folder.join("bin"))
        .with_context(|| format!("could not create {}", host_folder.display()))?;
    let own = distribution.sysroot.join("lib/rustlib").join(host).join("lib");
    symlink(&own, &host_folder.join("lib"))?;

    write(&wrapper(partial), &script(folder)?)?;
    make_executable(&wrapper(partial))?;
    fs::remove_dir_all(&package).with_context(|| format!("could not remove {}", package.display()))
}

/// Whether `libraries` contains a compiled `core`.
pub fn has_core(libraries: &Path) -> bool {
    !matching(libraries, "core").is_empty()
}

fn copy_library(name: &str, from: &Path, to: &Path) -> Result<()> {
    let found = matching(from, name);
    let [library] = found.as_slice() else {
        bail!("expected one lib{name}-*.rlib in {}, found {}", from.display(), found.len());
    };
    fs::create_dir_all(to).with_context(|| format!("could not create {}", to.display()))?;
    let file = library.file_name().context("a listed file has a name")?;
    fs::copy(library, to.join(file)).with_context(|| format!("could not copy {}", library.display()))?;
    Ok(())
}

/// `std` with every library that it depends on.
fn copy_all_libraries(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).with_context(|| format!("could not create {}", to.display()))?;
    let entries = fs::read_dir(from).with_context(|| format!("could not list {}", from.display()))?;
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.extension().is_some_and(|ending| ending == "rlib") && !name.starts_with("libsysroot") {
            fs::copy(&path, to.join(name)).with_context(|| format!("could not copy {}", path.display()))?;
        }
    }
    Ok(())
}

/// The two objects that rustc puts around every program for Windows with the GNU tools; they are
/// part of no crate.
fn start_and_end(distribution: &Distribution, libraries: &Path) -> Result<()> {
    for object in ["rsbegin", "rsend"] {
        let mut rustc = Command::new(RUSTC);
        rustc.env("RUSTC_BOOTSTRAP", "1").args(["--target", WINDOWS, "--crate-type=lib", "--emit=obj", "-o"]);
        rustc.arg(libraries.join(format!("{object}.o")));
        rustc.arg(distribution.sources().join("rtstartup").join(format!("{object}.rs")));
        command::run(&mut rustc)?;
    }
    Ok(())
}

/// The files `lib<name>-*.rlib` of a folder.
fn matching(folder: &Path, name: &str) -> Vec<PathBuf> {
    let prefix = format!("lib{name}-");
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let names = |path: &PathBuf| {
        path.extension().is_some_and(|extension| extension == "rlib")
            && path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(&prefix))
    };
    entries.filter_map(|entry| Some(entry.ok()?.path())).filter(names).collect()
}

/// LLVM's linker: rustup includes one, some distributions' compilers do too, and `lld` is a
/// package.
fn find_linker(distribution: &Distribution) -> Result<Option<PathBuf>> {
    let mut sysroots = vec![distribution.sysroot.clone()];
    // The compiler that cargo uses by default is usually rustup's.
    if let Ok(sysroot) = command::output(Command::new("rustc").args(["--print", "sysroot"])) {
        sysroots.push(PathBuf::from(sysroot.trim()));
    }
    let host = distribution.field("host")?;
    let mut candidates: Vec<PathBuf> =
        sysroots.iter().map(|sysroot| sysroot.join("lib/rustlib").join(host).join("bin/rust-lld")).collect();
    candidates.push(PathBuf::from("/usr/bin/ld.lld"));
    Ok(candidates.into_iter().find(|candidate| command::is_executable(candidate)))
}

/// Whether the sysroot is complete and intended for this path: the wrapper contains its folder, so
/// a moved sysroot is rebuilt.
fn is_whole(folder: &Path, sysroot: Sysroot) -> bool {
    let meant =
        fs::read_to_string(wrapper(folder)).ok().is_some_and(|own| script(folder).is_ok_and(|s| s == own));
    let last = matching(&sysroot.libraries(folder), sysroot.last());
    meant && command::is_executable(&wrapper(folder)) && !last.is_empty()
}

/// The wrapper that makes the compiler use `folder`.
fn script(folder: &Path) -> Result<String> {
    Ok(format!("#!/bin/sh\nexec {RUSTC} --sysroot {} \"$@\"\n", shell_quoted(folder)?))
}

/// The script in a sysroot that replaces `rustc`.
pub fn wrapper(folder: &Path) -> PathBuf {
    folder.join("bin/rustc")
}

fn linker_link(folder: &Path, distribution: &Distribution) -> Result<PathBuf> {
    Ok(folder.join("lib/rustlib").join(distribution.field("host")?).join("bin/rust-lld"))
}

fn write(path: &Path, text: &str) -> Result<()> {
    let folder = path.parent().with_context(|| format!("{} has no folder", path.display()))?;
    fs::create_dir_all(folder).with_context(|| format!("could not create {}", folder.display()))?;
    fs::write(path, text).with_context(|| format!("could not write {}", path.display()))
}

fn field<'a>(version: &'a str, name: &str) -> Option<&'a str> {
    version.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "))
}

/// Compares versions such as `1.96.0` and `1.95`; a suffix after the numbers (`-nightly`) is
/// ignored.
fn is_at_least(version: &str, minimum: &str) -> bool {
    let numbers = |text: &str| -> Vec<u32> {
        text.split(['.', '-', '+']).map_while(|part| part.parse().ok()).take(3).collect()
    };
    numbers(version) >= numbers(minimum)
}

/// The form of a target's name in cargo's environment variables.
pub fn variable_form(target: &str) -> String {
    target.to_ascii_uppercase().replace(['-', '.'], "_")
}

fn shell_quoted(path: &Path) -> Result<String> {
    let text =
        path.to_str().with_context(|| format!("{} is not UTF-8: choose another folder", path.display()))?;
    Ok(format!("'{}'", text.replace('\'', r"'\''")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERSION: &str = "rustc 1.96.0 (built from a source tarball)\nbinary: rustc\nhost: x86_64-unknown-linux-gnu\n\
                           release: 1.96.0\nLLVM version: 22.1.8\n";

    #[test]
    fn fields_of_the_version_are_read() {
        assert_eq!(field(VERSION, "host"), Some("x86_64-unknown-linux-gnu"));
        assert_eq!(field(VERSION, "release"), Some("1.96.0"));
        assert_eq!(field(VERSION, "commit-hash"), None);
    }

    #[test]
    fn versions_compare_as_numbers() {
        assert!(is_at_least("1.96.0", "1.95"));
        assert!(is_at_least("1.100.0-nightly", "1.95"));
        assert!(!is_at_least("1.63.0", "1.95"));
        assert!(!is_at_least("garbage", "1.95"));
    }

    #[test]
    fn a_folder_without_core_is_not_a_sysroot() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        assert!(!has_core(folder.path()));
        fs::write(folder.path().join("libcore-123.rmeta"), "").expect("a writable folder");
        fs::write(folder.path().join("libcore_other-123.rlib"), "").expect("a writable folder");
        assert!(!has_core(folder.path()));
        fs::write(folder.path().join("libcore-123.rlib"), "").expect("a writable folder");
        assert!(has_core(folder.path()));
    }

    #[cfg(unix)]
    #[test]
    fn a_sysroot_that_was_moved_is_not_taken_for_a_whole_one() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (here, there) = (folder.path().join("it's here"), folder.path().join("there"));
        let (firmware, windows) = (Sysroot::Firmware, Sysroot::Windows);
        write(&firmware.libraries(&here).join("libcore-123.rlib"), "").expect("a writable folder");
        write(&wrapper(&here), &script(&here).expect("a path in UTF-8")).expect("a writable folder");
        assert!(!is_whole(&here, firmware), "the wrapper is no program yet");
        make_executable(&wrapper(&here)).expect("our own file");
        assert!(is_whole(&here, firmware) && !is_whole(&here, windows));
        write(&windows.libraries(&here).join("libstd-123.rlib"), "").expect("a writable folder");
        assert!(!is_whole(&here, windows), "it has no library for tests");
        write(&windows.libraries(&here).join("libtest-123.rlib"), "").expect("a writable folder");
        assert!(is_whole(&here, windows));
        fs::rename(&here, &there).expect("a writable folder");
        assert!(!is_whole(&there, firmware) && !is_whole(&here, firmware));
    }

    #[test]
    fn a_failed_or_interrupted_build_is_never_taken_for_a_whole_one() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("sysroot-1.96.0");
        let leftover = folder.path().join("sysroot-1.96.0.partial");
        write(&leftover.join("half"), "").expect("a writable folder");

        let failed = complete(&target, |partial| {
            assert!(!partial.exists(), "the leftover is removed first");
            write(&partial.join("half"), "")?;
            bail!("interrupted")
        });
        assert!(failed.is_err() && !target.exists() && !leftover.exists());

        complete(&target, |partial| write(&partial.join("whole"), "")).expect("nothing fails");
        assert!(target.join("whole").is_file() && !leftover.exists());
    }

    #[test]
    fn names_are_put_into_the_form_their_reader_expects() {
        assert_eq!(variable_form(TARGET), "THUMBV8M_MAIN_NONE_EABIHF");
        assert_eq!(shell_quoted(Path::new("/a b/it's")).expect("UTF-8"), r"'/a b/it'\''s'");
    }
}
