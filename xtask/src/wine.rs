//! Wine: a Windows of our own below `target/windows`, in which built programs run.

use crate::command;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// C compiler and linker for Windows, with threads as std needs them.
pub const COMPILER: &str = "x86_64-w64-mingw32-gcc-posix";
/// Where Debian's package puts Wine's loader, which is not on PATH.
pub const WINE: &str = "/usr/lib/wine/wine64";
/// A library that Wine 8 lacks and every Rust program needs: random numbers.
const RANDOM: &str = "\
#include <windows.h>
#include <ntsecapi.h>
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T length) {
  while (length) {
    ULONG part = length > 0x10000000 ? 0x10000000 : (ULONG)length;
    if (!RtlGenRandom(bytes, part)) return FALSE;
    bytes += part;
    length -= part;
  }
  return TRUE;
}
";

/// A Windows of our own: its drive, and its registry.
pub struct Wine {
    prefix: PathBuf,
}

impl Wine {
    /// Makes the prefix, or takes the one of an earlier run.
    pub fn prepare(folder: &Path) -> Result<Self> {
        let wine = Self { prefix: folder.join("wine") };
        let library = wine.prefix.join("drive_c/windows/system32/bcryptprimitives.dll");
        if !library.is_file() {
            println!("  Wine: making a new prefix in {}", wine.prefix.display());
            fresh(&wine.prefix)?;
            command::run(wine.command(Path::new("wineboot")).arg("--init"))
                .context("Wine cannot be set up")?;
            let source = folder.join("bcryptprimitives.c");
            fs::write(&source, RANDOM).with_context(|| format!("could not write {}", source.display()))?;
            let mut compiler = Command::new(COMPILER);
            compiler.args(["-shared", "-o"]).args([&library, &source]).arg("-ladvapi32");
            command::run(&mut compiler).context("the library that Wine lacks does not compile")?;
        }
        Ok(wine)
    }

    /// A program for Windows, with the variables of the prefix.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = command::without_own_package(WINE);
        command.arg(program).env("WINEPREFIX", &self.prefix).env("WINEDEBUG", "-all");
        // neither a window nor an offer to install .NET and a browser
        command.env_remove("DISPLAY").env("WINEDLLOVERRIDES", "mscoree,mshtml=");
        command
    }

    /// Makes `folder` the network share `\\server\lab`.
    pub fn share(&self, folder: &Path) -> Result<&'static str> {
        let server = self.prefix.join("dosdevices/unc/server");
        fs::create_dir_all(&server).with_context(|| format!("could not create {}", server.display()))?;
        let share = server.join("lab");
        // left by an earlier run
        let _ = fs::remove_file(&share);
        command::symlink(folder, &share)?;
        Ok(r"\\server\lab")
    }
}

/// An empty folder.
pub fn fresh(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| format!("could not remove {}", folder.display()))?;
    }
    fs::create_dir_all(folder).with_context(|| format!("could not create {}", folder.display()))
}
