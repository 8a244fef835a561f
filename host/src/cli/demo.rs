//! `demo`: the complete workflow on the built-in simulator.

use std::path::{Path, PathBuf};

use clap::Args;

use super::analyse::analyse_into;
use super::campaign::run;
use super::error::CliError;
use super::output;
use crate::advice::quoted;
use crate::analyse::Wanted;
use crate::campaign::plan;
use crate::campaign::run::stage::Stage;
use crate::campaign::store::Store;
use crate::campaign::verdict::judge::ByRecord;
use crate::device::address::Address;
use crate::report::words;
use crate::untrusted_text::tell_line;

/// The complete workflow on the built-in simulator: campaign, analysis, report.
#[derive(Debug, Args)]
pub struct Demo {
    /// Folder for campaign.jrig, results.json and report.html.
    #[arg(long, value_name = "DIR", default_value = "jointrig-demo")]
    out: PathBuf,
    /// The paper's 2016 impacts instead of a short campaign.
    #[arg(long)]
    full: bool,
    /// A rig description to use in place of the built-in one.
    #[arg(long, value_name = "FILE.toml")]
    rig: Option<PathBuf>,
    /// Seed of noise, scatter and position errors.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print every method, check and loop too.
    #[arg(long)]
    details: bool,
    #[command(flatten)]
    page: crate::cli::page::Page,
}

/// Notes in the file that identify a demo: key and value.
type Marks = [(&'static str, String); 3];

impl Demo {
    pub fn run(self) -> Result<(), CliError> {
        let folder = &self.out;
        std::fs::create_dir_all(folder).map_err(|source| CliError::File {
            path: folder.clone(),
            doing: "making the folder",
            source,
        })?;
        let file = folder.join("campaign.jrig");
        let store = self.open(&file)?;
        let stop = output::flag();
        let mut onlooker = self.page.start(Some(&file), &stop, false)?;
        let again = self.again();
        let address = Address::Sim { rig: self.rig.clone() };
        let device = run::Device { address: &address, seed: self.seed, log_tables: None };
        let who = run::Who { stage: Stage::Device, yes: true, new_structure: false, further: None, stop };
        let summary = run::measure(store, device, who, &mut onlooker, Some(&again), &mut ByRecord)?;
        if summary.interrupted {
            let (file, folder) = (quoted(&file), quoted(folder));
            tell_line!("`jointrig analyse {file} --out {folder}` works on what is there");
            return Err(CliError::Bad("stopped before the campaign was complete".into()));
        }
        let store = Store::open_read_only(&file)?;
        let found = analyse_into(&store, Wanted::default(), folder, &[])?;
        if self.details {
            output::lines(words::summary(&found))?;
            output::lines([String::new()])?;
        }
        // two more lines are printed after this
        output::lines(words::brief::terminal(&found, 2))?;
        let (stored, raw) = store.sample_bytes()?;
        output::lines([
            format!(
                "campaign.jrig holds {:.0} MB of samples in {:.0} MB ({:.1} : 1, lossless).",
                raw as f64 / 1e6,
                stored as f64 / 1e6,
                raw as f64 / (stored.max(1)) as f64
            ),
            format!("Open {} for figures and tables.", folder.join("report.html").display()),
        ])
    }

    /// The command that repeats this one.
    fn again(&self) -> String {
        let full = if self.full { " --full" } else { "" };
        let rig = self.rig.as_ref().map(|path| format!(" --rig {}", quoted(path))).unwrap_or_default();
        format!("jointrig demo --out {} --seed {}{full}{rig}", quoted(&self.out), self.seed)
    }

    fn marks(&self) -> Result<Marks, CliError> {
        let rig = match &self.rig {
            None => "built-in".into(),
            Some(path) => {
                crate::untrusted_input::text(path, crate::untrusted_input::SETTINGS).map_err(|source| {
                    CliError::Read { path: path.clone(), doing: "reading the rig's description", source }
                })?
            }
        };
        let plan = if self.full { "paper" } else { "demo" };
        Ok([("demo_plan", plan.into()), ("demo_seed", self.seed.to_string()), ("demo_rig", rig)])
    }

    /// The campaign file: a new one, or that of an earlier run with the same options.
    fn open(&self, file: &Path) -> Result<Store, CliError> {
        let marks = self.marks()?;
        if !file.exists() {
            let (text, name) =
                if self.full { (plan::PAPER, "paper.toml") } else { (plan::DEMO, "demo.toml") };
            let store = Store::create(file, text, name)?;
            for (key, value) in &marks {
                store.set_meta(key, value)?;
            }
            return Ok(store);
        }
        let store = Store::open(file)?;
        for (key, value) in &marks {
            if store.meta(key)?.as_ref() != Some(value) {
                let what = key.trim_start_matches("demo_");
                return Err(CliError::Bad(format!(
                    "{} holds another campaign (its {what} differs): remove it, or choose another --out",
                    file.display()
                )));
            }
        }
        tell_line!("{} exists already: continuing with it", file.display());
        Ok(store)
    }
}
