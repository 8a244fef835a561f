//! The report presents the results in two files: `results.json` for scripts and `report.html` for
//! reading.
//!
//! The page is a single self-contained HTML text: figures are inline SVG, nothing is fetched, and
//! it can be printed. Everything shown is contained in [`Results`]; this module computes no
//! results. The document of a campaign file comes from [`analysed`]: `jointrig analyse` writes it,
//! and the live page shows it during the measurement.

use crate::analyse::{AnalyseError, Findings, Missing, Progress, Wanted, analyse};
use crate::campaign::store::Store;
use crate::results::{Compared, Place, Results, WearMeans};
use crate::structure::Structure;
use crate::substructuring::Frf;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::{fs, io};
use words::warning_sentences;

pub use document::{compare, document, mode_rows, scaling};
pub use page::{chart_style, comparison_page, figure_fragment, page, script, trend_figure, trend_page};

pub mod cell_records;
mod csv;
mod document;
pub mod figure;
mod figures;
mod html;
mod page;
#[cfg(feature = "png")]
mod png;
mod scale;
mod svg;
mod tables;
pub mod words;

/// The file for scripts.
pub const RESULTS_FILE: &str = "results.json";
/// The file for reading.
pub const REPORT_FILE: &str = "report.html";

/// The folder for figures as separate files.
pub const FIGURES_FOLDER: &str = "figures";

/// All figures for which these results have the data.
pub fn all_figures(results: &Results) -> Vec<figure::Figure> {
    figures::all(results)
}

/// A wear run along its cycles; `None` before two points of its curve.
pub fn wear_figure(curve: &[WearMeans]) -> Option<figure::Figure> {
    figures::wear(curve)
}

/// A file format for figures as separate files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Vector graphics.
    Svg,
    /// Pixels, two for each pixel of the drawing.
    #[cfg(feature = "png")]
    Png,
    /// Numbers.
    Csv,
}

impl Format {
    /// File name extension.
    fn ending(self) -> &'static str {
        match self {
            Format::Svg => "svg",
            #[cfg(feature = "png")]
            Format::Png => "png",
            Format::Csv => "csv",
        }
    }
}

/// Where hammer and vibrometer are to be placed according to the plan `plan`; `None` without any
/// position.
pub fn planned_places(places: &[Place], plan: &str) -> Option<figure::Figure> {
    let figure = figures::geometry(places)?;
    let version = env!("CARGO_PKG_VERSION").into();
    let from = figure::Source { file: plan.into(), version, ..figure::Source::default() };
    Some(figure::Figure { number: "", title: "Where hammer and vibrometer go".into(), from, ..figure })
}

/// Writes `results.json`, `report.html` and the figures in these formats into `folder`, which is
/// created if it does not exist. Each file is written atomically: under a temporary name, then
/// renamed.
///
/// # Errors
/// The folder cannot be created or written.
pub fn write(results: &Results, folder: &Path, formats: &[Format]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let json = || results.to_json().map_err(io::Error::other);
    let (for_scripts, for_people) = rayon::join(
        || write_whole(&folder.join(RESULTS_FILE), json()?.as_bytes()),
        || write_whole(&folder.join(REPORT_FILE), page(results).as_bytes()),
    );
    for_scripts.and(for_people)?;
    if formats.is_empty() {
        return Ok(());
    }
    write_figures(&figures::all(results), &folder.join(FIGURES_FOLDER), formats)
}

/// The comparison of two campaigns, for reading.
pub const COMPARISON_FILE: &str = "compare.html";
/// The comparison of two campaigns, for scripts.
pub const COMPARED_FILE: &str = "compare.json";

/// Writes `compare.json` and `compare.html` into `folder`, as [`write`](fn@write) does.
///
/// # Errors
/// The folder cannot be created or written.
pub fn write_comparison(compared: &Compared, both: [&Results; 2], folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut json = serde_json::to_string(compared).map_err(io::Error::other)?;
    json.push('\n');
    write_whole(&folder.join(COMPARED_FILE), json.as_bytes())?;
    write_whole(&folder.join(COMPARISON_FILE), comparison_page(compared, both).as_bytes())
}

fn write_figures(figures: &[figure::Figure], folder: &Path, formats: &[Format]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    for figure in figures {
        for format in formats {
            write_figure(figure, *format, &folder.join(format!("{}.{}", figure.name, format.ending())))?;
        }
    }
    Ok(())
}

/// A figure for a notebook: an SVG that follows the reader's light or dark theme.
pub fn notebook_figure(figure: &figure::Figure) -> String {
    svg::notebook(figure)
}

/// A matrix of FRFs over frequency, at most six of its pairs; `None` without a line above 0 Hz.
pub fn frf_figure(frf: &crate::frf::Frf, title: &str) -> Option<figure::Figure> {
    let version = env!("CARGO_PKG_VERSION").into();
    let from = figure::Source { file: title.into(), version, ..figure::Source::default() };
    Some(figure::Figure { from, ..figures::frf_matrix(frf)? })
}

/// Writes one figure, as [`write`](fn@write) does.
///
/// # Errors
/// The file cannot be written.
pub fn write_figure(figure: &figure::Figure, format: Format, path: &Path) -> io::Result<()> {
    let content = match format {
        Format::Svg => svg::file(figure).into_bytes(),
        #[cfg(feature = "png")]
        Format::Png => png::png(&svg::file(figure)).map_err(io::Error::other)?,
        Format::Csv => csv::csv(figure).into_bytes(),
    };
    write_whole(path, &content)
}

/// The labels of an axis' ticks, including the empty ones of minor ticks: used by the test that
/// compares them with the page's script. `length` in px.
pub fn axis_labels(logarithmic: bool, range: [f64; 2], length: f64, upright: bool) -> Vec<String> {
    let scale = if logarithmic {
        scale::Scale::logarithmic(range, [0.0, length])
    } else {
        scale::Scale::linear(range, [0.0, length])
    };
    let lie = if upright { scale::Lie::Up } else { scale::Lie::Across };
    scale.ticks(lie).into_iter().map(|tick| tick.label).collect()
}

/// Writes a file atomically: it gets its name only when it is complete.
///
/// # Errors
/// It cannot be written; then no partial file is left, and an existing file of that name is
/// unchanged.
pub fn write_whole(place: &Path, content: &[u8]) -> io::Result<()> {
    let beside = place.with_added_extension(format!("{}.part", std::process::id()));
    let written = File::create(&beside)
        .and_then(|mut file| file.write_all(content).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&beside, place));
    if written.is_err() {
        // report the first error and ignore this one
        let _ = fs::remove_file(&beside);
    }
    written
}

/// Analyses the file's contents. The true parameters of a simulated rig are added to the document
/// after the analysis, so that no estimator can use them.
///
/// # Errors
/// The file cannot be read, or holds nothing to analyse.
pub fn analysed(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Results, AnalyseError> {
    written(store, analyse(store, wanted, progress)?)
}

/// Results of a file together with its FRFs.
#[derive(Debug)]
pub struct WithFrfs {
    /// As returned by [`analysed`].
    pub results: Results,
    /// The FRFs of [`Findings::frfs`].
    pub frfs: Vec<(Structure, Frf)>,
    /// Messages about records that cannot be used.
    pub told: Vec<String>,
}

/// As [`analysed`], with the FRFs of all pairs.
///
/// # Errors
/// As for [`analysed`].
pub fn analysed_with_frfs(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<WithFrfs, AnalyseError> {
    let mut found = analyse(store, Wanted { frfs: true, ..wanted }, progress)?;
    let frfs = std::mem::take(&mut found.frfs);
    let of_records = found.missing.iter().filter(|missing| matches!(missing, Missing::Records { .. }));
    let told = of_records.map(warning_sentences::missing).collect();
    Ok(WithFrfs { results: written(store, found)?, frfs, told })
}

fn written(store: &Store, found: Findings) -> Result<Results, AnalyseError> {
    let mut results = document(found);
    if let Some(answer) = &mut results.answer {
        answer.truth = store.simulated_truth()?;
    }
    Ok(results)
}

/// Checks that anything was found at all: an empty document must not be mistaken for a result.
///
/// # Errors
/// The first reason, as a sentence.
pub fn must_hold_something(found: &Results) -> Result<(), String> {
    let answered = found.answer.as_ref().is_some_and(|answer| {
        answer.contact.k_t_n_per_m.is_some()
            || answer.between_arms.k_n_per_m.is_some()
            || answer.clamp.is_some()
    });
    if answered || !found.joint.is_empty() || !found.recommended.is_empty() || !found.hysteresis.is_empty() {
        return Ok(());
    }
    Err(format!(
        "{}: no stiffness could be found from this file: {}",
        found.source.file,
        found.missing.first().map_or("it holds no good hits and no levels", String::as_str)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{Source, example_tests as example};

    /// The page's text, with no-break spaces between number and unit as plain spaces.
    fn read(results: &Results) -> String {
        page(results).replace('\u{a0}', " ").replace('\u{2060}', "")
    }

    #[test]
    fn the_page_shows_the_numbers_of_the_results() {
        let html = read(&example::results());
        for text in [
            "26.8 ± 0.9 N/µm",
            "148 ± 4",
            "not k_T",
            "double hit",
            "campaign.jrig",
            "6 IDMs: 26.8",
            "192 Hz",
            "32.7 N/µm",
        ] {
            assert!(html.contains(text), "`{text}` is not on the page");
        }
        let drawn = figures::all(&example::results());
        assert_eq!(html.matches("<figure").count(), drawn.len());
        for name in [
            "comparison",
            "joint-spectrum",
            "contact-loop",
            "decay-loops",
            "impacts",
            "levels",
            "shaker-loops",
            "specimens",
            "rebuilt",
            "receptances",
        ] {
            assert!(drawn.iter().any(|f| f.name == name), "{name}");
        }
    }

    #[test]
    fn the_page_shows_the_estimate_to_quote_and_how_well_the_interface_is_held() {
        let mut results = example::results();
        example::add_interface(&mut results);
        let html = read(&results);
        for text in [
            "95 % interval 25.7…27.7",
            "25.7…27.7<",
            "What coupling adds: 4 modes suggested",
            "Quality of the virtual points",
            "A2:z 0.81",
            "N m/rad",
            "not identified",
            "Hits resampled 500 times",
        ] {
            assert!(html.contains(text), "`{text}` is not on the page");
        }
        assert!(html.contains("id=\"fig-interface-modes\"") && html.contains("id=\"fig-participation\""));
    }

    #[test]
    fn the_page_needs_nothing_from_outside_and_stays_small() {
        let html = page(&example::results());
        // the chart library's script contains its author's URL, but does not access it
        let (markup, _) = html.split_once("<script").expect("a script");
        for outside in ["http:", "https:", "<link", "src=\"", "url(h", "@import", "NaN", "inf\""] {
            assert!(!markup.contains(outside), "`{outside}` on the page");
        }
        assert_eq!(html.matches("<script").count(), 2, "the figures' data, and what makes them alive");
        assert!(html.len() < 3_000_000, "{} bytes", html.len());
    }

    #[test]
    fn names_from_a_file_cannot_break_the_page() {
        let mut results =
            Results::new(Source { file: "<script>alert(1)</script>".into(), ..Source::default() });
        results.missing.push("<b>".into());
        let html = page(&results);
        assert!(!html.contains("<script>alert") && html.contains("&lt;b&gt;"));
        assert!(html.contains("No stiffness could be found"));
    }

    #[test]
    fn every_part_may_be_missing() {
        let full = example::results();
        for part in 0..7 {
            let mut results = full.clone();
            match part {
                0 => results.joint.clear(),
                1 => results.joint_spectrum = None,
                2 => results.hysteresis.clear(),
                3 => results.frfs.truncate(1),
                4 => results.example_loop = None,
                5 => results.impact_slopes.truncate(1),
                _ => results.frfs.iter_mut().for_each(|c| c.magnitude_m_per_n.clear()),
            }
            assert!(page(&results).ends_with("</html>\n"));
        }
    }

    #[test]
    fn both_files_are_written_whole_and_no_others() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let place = folder.path().join("new/folder");
        write(&example::results(), &place, &[]).expect("written");
        write(&example::results(), &place, &[]).expect("written over");
        let mut names: Vec<_> =
            fs::read_dir(&place).expect("there").map(|e| e.expect("entry").file_name()).collect();
        names.sort();
        assert_eq!(names, [REPORT_FILE, RESULTS_FILE]);
    }
}
