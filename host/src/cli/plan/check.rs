//! `plan check`: lists all errors of a plan and the results that it yields, and draws it.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::advice::quoted;
#[cfg(feature = "sim")]
use crate::analyse::expected::expected;
use crate::analyse::places;
use crate::campaign::plan::{Plan, PlanError};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::plan::file;
use crate::report::{self, Format};
use crate::structure::Structure;
use crate::untrusted_text::tell_line;

/// List all errors of a plan and the results that it yields, and draw the positions of hammer and
/// vibrometer.
#[derive(Debug, Args)]
pub struct PlanCheck {
    /// The plan.
    #[arg(value_name = "PLAN.toml")]
    file: PathBuf,
    /// Where to write the picture, .svg or .png [default: PLAN-geometry.svg next to the plan].
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Draw nothing.
    #[arg(long, conflicts_with = "picture")]
    no_picture: bool,
}

impl PlanCheck {
    pub fn run(self) -> Result<(), CliError> {
        let text = file::read(&self.file)?;
        let plan = Plan::parse_all(&text, &self.file.display().to_string()).map_err(|all| refused(&all))?;
        output::lines(told(&plan))?;
        #[cfg(feature = "sim")]
        if let Some(all) = plan.contact_needs().is_empty().then(|| expected(&plan)).flatten() {
            output::lines(report::words::expected(&all))?;
        }
        if !self.no_picture {
            let picture = self.picture.unwrap_or_else(|| beside(&self.file));
            draw(&plan, &picture)?;
            tell_line!("{}: where hammer and vibrometer go", picture.display());
        }
        let path = quoted(&self.file);
        let campaign = quoted(&self.file.with_extension("jrig"));
        tell_line!("next: jointrig campaign new {campaign} --plan {path}");
        Ok(())
    }
}

fn refused(all: &[PlanError]) -> CliError {
    let lines: Vec<String> =
        all.iter().map(|wrong| format!("{}:{}: {}", wrong.source_name, wrong.line, wrong.what)).collect();
    let many = if all.len() == 1 { "one thing is wrong" } else { "these are wrong" };
    CliError::Bad(format!(
        "{many} with the plan; docs/campaigns.md explains every field\n{}",
        lines.join("\n")
    ))
}

/// The amount of measurement, and the results that it yields.
fn told(plan: &Plan) -> Vec<String> {
    let cells = plan.cells();
    let of = |structure: Structure| {
        let own = cells.iter().filter(|c| crate::campaign::plan::structure(c.configuration) == structure);
        (structure.name(), own.count())
    };
    let parts: Vec<String> = (Structure::ALL.into_iter().map(of))
        .filter(|(_, count)| *count > 0)
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    let hits = plan.hits_wanted();
    let answer = |name: &str, missing: Vec<String>| match missing.as_slice() {
        [] => format!("{name}: yes"),
        missing => format!("{name}: no, it needs {}", missing.join("; ")),
    };
    vec![
        format!("{} cells ({}), {hits} good hits wanted", cells.len(), parts.join(", ")),
        answer("k_T of the contact", plan.contact_needs()),
        answer("stiffness between the arms", plan.between_arms_needs()),
    ]
}

fn beside(plan: &Path) -> PathBuf {
    let stem = plan.file_stem().map_or_else(|| "plan".into(), |stem| stem.to_string_lossy().into_owned());
    plan.with_file_name(format!("{stem}-geometry.svg"))
}

fn draw(plan: &Plan, path: &Path) -> Result<(), CliError> {
    let Some(figure) = report::planned_places(&places(plan), plan.name.get_ref()) else {
        return Err(CliError::Bad("the plan has no positions to draw".into()));
    };
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let format = Format::from_str(ending, true)
        .map_err(|_| CliError::Usage(format!("{}: a picture must be .svg or .png", path.display())))?;
    report::write_figure(&figure, format, path).map_err(|source| CliError::File {
        path: path.into(),
        doing: "drawing the geometry",
        source,
    })
}
