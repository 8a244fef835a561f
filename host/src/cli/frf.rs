//! `frf`: computes FRFs from any impact records, using good hits only.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::error::CliError;
use super::frf_matrix::{Wishes, average};
use super::hit_agreement::Agreement;
use super::output;
use crate::campaign::verdict::{Judgement, Limits, Verdict, judge_all};
use crate::exchange::frf_npz::direction_extras;
use crate::exchange::npz::Array;
use crate::exchange::record_file::RecordFile;
use crate::exchange::record_uff::read_record_file;
use crate::exchange::{Extra, StatedUnits, write_frf};
use crate::spectra::{
    CrossSpectra, ForceWeighting, FrfSettings, ImpactRecords, MotionQuantity, Origin, Pulse, PulseSamples,
    Windowing, estimate, reversed_peak_n, several_hits_s, usable_band,
};
use crate::substructuring::Band;
use crate::untrusted_text::tell_line;

/// Compute FRFs from any impact records: a verdict on every hit, and the average of the good ones.
///
/// RECORDS is an npz that contains `fs` (Hz), `force` (hit, sample) in N, `response` (hit, channel,
/// sample) in SI and `quantity` (velocity, acceleration or displacement), or a universal file of
/// time responses, with each hit's force first. FRFs are on s = sigma + i 2 pi f: the exponential
/// window's damping is part of s, not an error of the result.
///
/// A folder of universal files becomes one matrix (--out): their labels name impacts and sensors.
#[derive(Debug, Args)]
pub struct FrfArgs {
    /// The records, or a folder of universal files.
    #[arg(value_name = "RECORDS|DIR")]
    records: PathBuf,
    /// Print verdicts, settings and the usable band as one JSON document.
    #[arg(long)]
    json: bool,
    /// Write the FRFs: frequency, frf (H1), h2, hv, coherence, variance.
    #[arg(long, value_name = "FILE.npz")]
    out: Option<PathBuf>,
    /// Quantity of the FRFs [default: that of the records].
    #[arg(long, value_enum)]
    quantity: Option<FrfQuantity>,
    /// Damping of the exponential window, 1/s; 0 for none.
    #[arg(long, value_name = "PER_S", default_value_t = Windowing::default().sigma_per_s)]
    sigma: f64,
    /// The force is kept from this long before the pulse's start, s, or from its foot if that is
    /// earlier.
    #[arg(long, value_name = "S", default_value_t = Windowing::default().force_before_s)]
    force_before: f64,
    /// The force is kept until this long after the pulse's start, s, or until the pulse's end if
    /// that is later.
    #[arg(long, value_name = "S", default_value_t = Windowing::default().force_after_s)]
    force_after: f64,
    /// After that the force is tapered to zero with half a cosine of this length, s.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    force_taper: f64,
    /// Keep the force window rectangular and weight only the response (common practice, but not
    /// exact).
    #[arg(long)]
    plain_force: bool,
    /// Time of the hits from the records' start, s [default: the start of each pulse].
    #[arg(long, value_name = "S")]
    origin: Option<f64>,
    /// Length of the transform, samples; if longer than the records, they are padded with zeros.
    #[arg(long, value_name = "SAMPLES")]
    pad_to: Option<usize>,
    /// Delay of each response relative to the force, s (repeat the option, or give a
    /// comma-separated list).
    #[arg(long, value_name = "S", value_delimiter = ',', allow_hyphen_values = true)]
    delay: Vec<f64>,
    /// Frequency lines to output, Hz [default: all].
    #[arg(long, value_name = "LO:HI", value_parser = band)]
    band: Option<(f64, f64)>,
    /// Also output the variance by leaving out each hit in turn (array `variance_jackknife`).
    #[arg(long)]
    jackknife: bool,
    /// Ratio of noise powers for Hv, response over force, (SI/N)² [default: noise in proportion to
    /// the signals].
    #[arg(long, value_name = "RATIO")]
    noise_ratio: Option<f64>,
    /// Units that override those of the file's labels: response=mm/s,force=lbf,time=ms.
    #[arg(long, value_name = "UNITS", default_value = "")]
    units: StatedUnits,
    /// Names of the responses (repeat the option, or give a comma-separated list).
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    outputs: Vec<String>,
    /// Name of the impact.
    #[arg(long, value_name = "NAME", default_value = "impact")]
    input: String,
}

/// Quantity of an FRF's numerator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FrfQuantity {
    Receptance,
    Mobility,
    Accelerance,
}

impl From<FrfQuantity> for MotionQuantity {
    fn from(quantity: FrfQuantity) -> Self {
        match quantity {
            FrfQuantity::Receptance => MotionQuantity::Displacement,
            FrfQuantity::Mobility => MotionQuantity::Velocity,
            FrfQuantity::Accelerance => MotionQuantity::Acceleration,
        }
    }
}

/// Parses a frequency band, Hz.
pub(super) fn band(text: &str) -> Result<(f64, f64), String> {
    let wrong =
        || format!("`{text}` is not a band: give two frequencies in Hz, the lower first, as in 300:600");
    let (low, high) = text.split_once(':').ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|f| f.is_finite() && *f >= 0.0);
    match (number(low), number(high)) {
        (Some(low), Some(high)) if low <= high => Ok((low, high)),
        _ => Err(wrong()),
    }
}

impl FrfArgs {
    pub fn run(self) -> Result<(), CliError> {
        self.check()?;
        if self.records.is_dir() {
            return self.of_folder();
        }
        let read = read_record_file(&self.records, &self.units).map_err(|e| CliError::Bad(e.to_string()))?;
        let RecordFile { records, delay_s, directions, taken, notes } = read.along_axes();
        for line in std::iter::once(&taken).chain(&notes) {
            tell_line!("{}: {line}", self.records.display());
        }
        let names = self.names(records.response.first().map_or(0, Vec::len))?;
        let verdicts = judge_all(&records, &Limits::default(), None);
        let used: Vec<bool> = verdicts.iter().map(|v| v.kind == Verdict::Good).collect();
        if !used.contains(&true) {
            if self.json {
                output::json(&self.document(&records, &verdicts, &self.settings(&delay_s), None))?;
            }
            return Err(CliError::Bad(self.nothing_good(&records, &verdicts)));
        }
        let settings = self.settings(&delay_s);
        let found = estimate(&records, &used, &settings)
            .map_err(|e| CliError::Bad(format!("{}: {e}", self.records.display())))?;
        let excited = usable_band(found.frequency_hz(), &found.force_spectrum(), 6.0);
        let agreement = Agreement::of(&records, &used, &settings, &found, excited, &names)
            .map_err(|e| CliError::Bad(format!("{}: {e}", self.records.display())))?;
        let quantity = self.quantity.map_or(records.quantity, MotionQuantity::from);
        let mut found = found.converted(records.quantity, quantity);
        if let Some((low, high)) = self.band {
            found = found.band(low, high);
            if found.lines() == 0 {
                return Err(CliError::Usage(format!(
                    "there is no frequency line between {low} and {high} Hz: widen --band"
                )));
            }
        }
        if let Some(path) = &self.out {
            let matrix = (found.to_matrix(quantity, names.clone(), self.input.clone()))
                .map_err(|e| CliError::Bad(format!("{}: {e}", self.records.display())))?;
            let mut further = extras(&found, self.noise_ratio);
            further.extend(direction_extras(&directions.responses, &[directions.force]));
            write_frf(path, &matrix, &further).map_err(|e| CliError::Bad(e.to_string()))?;
        }
        if self.json {
            return output::json(&self.document(
                &records,
                &verdicts,
                &settings,
                Some((&found, excited, quantity, &names, &agreement)),
            ));
        }
        let mut lines = self.words(&verdicts, &found, excited);
        // insert before the last line, which names the output file
        let last = lines.len() - 1;
        let told = [agreement.lines(&names), self.about_window(&records, &used)].concat();
        lines.splice(last..last, told);
        output::lines(lines)
    }

    /// Explains why there is nothing to average, with advice.
    fn nothing_good(&self, records: &ImpactRecords, verdicts: &[Judgement]) -> String {
        let file = self.records.display();
        let reversed: Vec<Option<f64>> = records.force_n.iter().map(|force| reversed_peak_n(force)).collect();
        if let (Some(Some(peak_n)), true) = (reversed.first(), reversed.iter().all(Option::is_some)) {
            return format!(
                "{file}: the force's sign is the wrong way round: peak {peak_n:.1} N in hit 0; a push is positive, so multiply the force by -1"
            );
        }
        let why: Vec<String> = verdicts
            .iter()
            .enumerate()
            .map(|(i, v)| {
                if reversed[i].is_some() {
                    format!("hit {i}: {}", v.sentence)
                } else {
                    format!("hit {i}: {}, {}", v.kind, v.sentence)
                }
            })
            .collect();
        let several = match records.force_n.as_slice() {
            [force] => several_hits_s(force, records.fs_hz),
            _ => None,
        };
        if let Some(hits_s) = several {
            let lines = cut_lines(&self.records.to_string_lossy(), records, &hits_s);
            return format!("{file}: {}\n{lines}", verdicts[0].sentence);
        }
        format!(
            "{file}: no hit is good, so there is nothing to average; measure again\n  {}",
            why.join("\n  ")
        )
    }

    /// Messages about the force windows of the hits used.
    fn about_window(&self, records: &ImpactRecords, used: &[bool]) -> Vec<String> {
        let windows = force_windows(records, &self.settings(&[]));
        let of_used = || {
            windows
                .iter()
                .enumerate()
                .filter(|(hit, _)| used[*hit])
                .filter_map(|(hit, w)| Some((hit, w.as_ref()?)))
        };
        let mut lines = Vec::new();
        let longest = of_used().max_by(|a, b| a.1.to_s.total_cmp(&b.1.to_s));
        if let Some((hit, window)) =
            longest.filter(|(_, window)| window.to_s > self.force_after + 1.0 / records.fs_hz)
        {
            lines.push(format!(
                "the force is kept until {:.1} ms after the pulse's start, not {:.1} ms: the pulse of hit {hit} lasts {:.1} ms",
                1e3 * window.to_s,
                1e3 * self.force_after,
                1e3 * window.pulse_s
            ));
        }
        let most = of_used().max_by(|a, b| a.1.outside.total_cmp(&b.1.outside));
        if let Some((hit, window)) = most.filter(|(_, window)| window.outside > OUTSIDE) {
            lines.push(format!(
                "hit {hit}: outside the force window the force has {:.1} % of the pulse's impulse, which is left out: the \
                 signal drifts, or another force acts",
                100.0 * window.outside
            ));
        }
        lines
    }

    fn of_folder(&self) -> Result<(), CliError> {
        let alone = !self.json && self.outputs.is_empty() && self.delay.is_empty();
        let (Some(out), true) = (&self.out, alone) else {
            return Err(CliError::Bad(format!(
                "{}: this is a folder: name a file in it; or, for one matrix of FRFs of all its universal files, give --out \
                 FILE.npz without --json, --outputs and --delay",
                self.records.display()
            )));
        };
        let quantity = self.quantity.map(MotionQuantity::from);
        let (settings, units) = (self.settings(&[]), &self.units);
        average(&self.records, out, &Wishes { settings: &settings, quantity, band: self.band, units })
    }

    /// Refuses invalid options.
    fn check(&self) -> Result<(), CliError> {
        let wrong = |text: String| Err(CliError::Usage(text));
        for (name, value) in [
            ("--sigma", self.sigma),
            ("--force-before", self.force_before),
            ("--force-after", self.force_after),
            ("--force-taper", self.force_taper),
            ("--noise-ratio", self.noise_ratio.unwrap_or(0.0)),
            ("--origin", self.origin.unwrap_or(0.0)),
        ] {
            if !value.is_finite() || value < 0.0 {
                return wrong(format!("{name} is {value}: a number of 0 or more is needed"));
            }
        }
        match self.delay.iter().find(|d| !d.is_finite()) {
            Some(delay) => wrong(format!("--delay is {delay}: a finite number of seconds is needed")),
            None => Ok(()),
        }
    }

    fn names(&self, channels: usize) -> Result<Vec<String>, CliError> {
        for (name, given) in [("--outputs", self.outputs.len()), ("--delay", self.delay.len())] {
            if given != 0 && given != channels {
                return Err(CliError::Usage(format!(
                    "{name} has {given} entries and {} has {channels} responses: give one for each, or none",
                    self.records.display()
                )));
            }
        }
        let repeated = (1..self.outputs.len()).find(|i| self.outputs[..*i].contains(&self.outputs[*i]));
        match repeated {
            Some(i) => {
                Err(CliError::Usage(format!("--outputs has `{}` twice: names must differ", self.outputs[i])))
            }
            None if self.outputs.is_empty() => Ok((1..=channels).map(|i| format!("response {i}")).collect()),
            None => Ok(self.outputs.clone()),
        }
    }

    /// Settings of the estimate. `of_file_s`: delay of each response relative to the force
    /// according to the file, s.
    fn settings(&self, of_file_s: &[f64]) -> FrfSettings {
        let late = of_file_s.iter().any(|s| *s != 0.0);
        let delay_s = match (self.delay.is_empty(), late) {
            (true, false) => Vec::new(),
            (true, true) => of_file_s.to_vec(),
            (false, _) => self.delay.iter().zip(of_file_s).map(|(own, file)| own + file).collect(),
        };
        FrfSettings {
            windowing: Windowing {
                force_before_s: self.force_before,
                force_after_s: self.force_after,
                force_taper_s: self.force_taper,
                sigma_per_s: self.sigma,
                force_weighting: if self.plain_force {
                    ForceWeighting::Rectangular
                } else {
                    ForceWeighting::Exponential
                },
            },
            origin: self.origin.map_or(Origin::PulseStart, Origin::At),
            delay_s,
            band_hz: None,
            transform_samples: self.pad_to,
            jackknife: self.jackknife,
            noise_ratio: self.noise_ratio,
        }
    }

    fn document(
        &self,
        records: &ImpactRecords,
        verdicts: &[Judgement],
        settings: &FrfSettings,
        found: Option<Averaged<'_>>,
    ) -> Value {
        let windows = force_windows(records, &self.settings(&[]));
        let hits: Vec<Value> = verdicts
            .iter()
            .enumerate()
            .map(|(index, v)| {
                let window = windows[index].as_ref();
                json!({
                    "force_window_s": window.map(|w| [w.from_s, w.to_s]),
                    "force_outside_window": window.map(|w| w.outside),
                    "index": index, "verdict": v.kind, "measure": v.measure, "limit": v.limit,
                    "sentence": v.sentence, "peak_n": v.peak_n, "start_s": v.start_s,
                })
            })
            .collect();
        let mut document = json!({
            "records": self.records.display().to_string(),
            "fs_hz": records.fs_hz,
            "hits": hits,
            "used": found.map_or(0, |(y, ..)| y.hits()),
            "settings": settings,
        });
        if let Some((y, band, quantity, names, agreement)) = found {
            document["quantity"] = json!(quantity.frf_name());
            document["outputs"] = json!(names);
            document["input"] = json!(self.input);
            document["lines"] = json!(y.lines());
            document["usable_band_hz"] = json!(band.map(|b| [b.low_hz, b.high_hz]));
            document["median_coherence"] = json!(median_coherence(y, band));
            document["coherence"] = agreement.document();
            document["suspicions"] = json!(agreement.suspicions);
        }
        document
    }

    fn words(&self, verdicts: &[Judgement], found: &CrossSpectra, excited: Option<Band>) -> Vec<String> {
        let mut lines: Vec<String> = verdicts
            .iter()
            .enumerate()
            .map(|(i, v)| format!("hit {i}: {} ({})", v.kind, v.sentence))
            .collect();
        lines.push(format!("{} of {} hits averaged", found.hits(), verdicts.len()));
        if let Some(band) = excited {
            lines.push(format!(
                "the hammer excites {:.0} … {:.0} Hz (−6 dB of the force's auto-spectrum)",
                band.low_hz, band.high_hz
            ));
        }
        match &self.out {
            Some(path) => lines.push(format!("FRFs are in {}", path.display())),
            None => lines.push("nothing was written: --out FILE.npz saves the FRFs".into()),
        }
        lines
    }
}

/// Fraction of the pulse's impulse outside the window from which a message is printed.
const OUTSIDE: f64 = 0.01;

/// The force window of a hit.
struct ForceWindow {
    /// Start, relative to the windows' origin, s.
    from_s: f64,
    /// End, relative to the windows' origin, s.
    to_s: f64,
    /// Length of the pulse, s.
    pulse_s: f64,
    /// The force's impulse outside the window, as a fraction of the pulse's.
    outside: f64,
}

/// The windows of all hits; `None` for a hit without a pulse.
fn force_windows(records: &ImpactRecords, settings: &FrfSettings) -> Vec<Option<ForceWindow>> {
    let fs_hz = records.fs_hz;
    let of = |force: &Vec<f64>| {
        let pulse = Pulse::locate(force)?;
        let origin_s = match settings.origin {
            Origin::PulseStart => pulse.start as f64 / fs_hz,
            Origin::At(origin_s) => origin_s,
        };
        let whole = PulseSamples::of(&pulse, force);
        let [from_s, to_s] = settings.windowing.kept_s(fs_hz, origin_s, &whole);
        let kept = settings.windowing.kept(fs_hz, force.len(), origin_s, &whole);
        Some(ForceWindow {
            from_s: from_s - origin_s,
            to_s: to_s - origin_s,
            pulse_s: pulse.width() as f64 / fs_hz,
            outside: pulse.impulse_outside(force, kept),
        })
    };
    records.force_n.iter().map(of).collect()
}

/// Spectra, excited band, quantity of the FRFs, names of the responses, and agreement of the hits.
type Averaged<'a> = (&'a CrossSpectra, Option<Band>, MotionQuantity, &'a [String], &'a Agreement);

/// Python code that cuts a record with several hits.
fn cut_lines(file: &str, records: &ImpactRecords, hits_s: &[f64]) -> String {
    let gap_s = hits_s.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let first_s = hits_s.first().copied().unwrap_or(0.0);
    let before_s = first_s.min(0.05 * gap_s).min(0.05);
    let after_s = records.force_n[0].len() as f64 / records.fs_hz - hits_s.last().copied().unwrap_or(0.0);
    let length = (gap_s.min(after_s + before_s) * records.fs_hz) as usize;
    let starts: Vec<String> =
        hits_s.iter().map(|t| (((t - before_s) * records.fs_hz) as usize).to_string()).collect();
    let channels = records.response.first().map_or(0, Vec::len);
    if !std::path::Path::new(file).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz")) {
        return format!(
            "write one record of {length} samples for each hit, from the samples {} on",
            starts.join(", ")
        );
    }
    let cut = file.strip_suffix(".npz").unwrap_or(file);
    format!(
        "these lines of Python cut it into {} records of {length} samples; check that the motion has died away within that time:\n\
         \x20 import numpy as np\n\
         \x20 r = np.load(\"{file}\")\n\
         \x20 starts, n = [{}], {length}\n\
         \x20 force = np.stack([r[\"force\"].reshape(-1)[s:s + n] for s in starts])\n\
         \x20 response = np.stack([r[\"response\"].reshape({channels}, -1)[:, s:s + n] for s in starts])\n\
         \x20 rest = {{key: r[key] for key in r.files if key not in (\"force\", \"response\")}}\n\
         \x20 np.savez(\"{cut}-cut.npz\", force=force, response=response, **rest)",
        hits_s.len(),
        starts.join(", ")
    )
}

/// Median coherence of each response over the excited lines; `None` for a single hit.
fn median_coherence(y: &CrossSpectra, band: Option<Band>) -> Option<Vec<f64>> {
    let band = band?;
    let inside = y.band(band.low_hz, band.high_hz);
    if inside.lines() == 0 {
        return None;
    }
    (0..inside.outputs())
        .map(|o| {
            let mut values: Vec<f64> = (0..inside.lines()).map(|line| inside.coherence(line, o)).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().filter(|v| v.is_finite())
        })
        .collect()
}

/// The arrays in addition to H1.
fn extras(y: &CrossSpectra, noise_ratio: Option<f64>) -> Vec<Extra> {
    let real = |name: &str, rows: &[Vec<f64>]| {
        let shape = vec![rows.len(), rows.first().map_or(0, Vec::len)];
        Extra::Real(name.into(), Array { shape, values: rows.concat() })
    };
    let complex = |name: &str, rows: &[Vec<num_complex::Complex<f64>>]| {
        let shape = vec![rows.len(), rows.first().map_or(0, Vec::len), 1];
        Extra::Complex(name.into(), Array { shape, values: rows.concat() })
    };
    let mut extras = vec![
        real("coherence", &y.rows(CrossSpectra::coherence)),
        real("variance", &y.rows(CrossSpectra::variance)),
        complex("h2", &y.rows(CrossSpectra::h2)),
        complex("hv", &y.rows(|y, line, output| y.hv(line, output, noise_ratio))),
    ];
    extras.extend(y.jackknife().map(|rows| real("variance_jackknife", &rows)));
    let force = Array { shape: vec![y.lines()], values: y.force_spectrum() };
    extras.push(Extra::Real("force_spectrum".into(), force));
    extras
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_two_frequencies_in_order() {
        assert_eq!(band("300:600"), Ok((300.0, 600.0)));
        for text in ["300", "600:300", "-1:5", "a:b", "1:inf", ""] {
            assert!(band(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_row_of_hits_is_cut_between_them() {
        let records = ImpactRecords {
            fs_hz: 1000.0,
            force_n: vec![vec![0.0; 3000]],
            response: vec![vec![vec![0.0; 3000]; 2]],
            quantity: MotionQuantity::Velocity,
        };
        let said = cut_lines("row.npz", &records, &[0.3, 1.3, 2.4]);
        // 50 ms before each hit; the last one is followed by 600 ms
        assert!(said.contains("starts, n = [250, 1250, 2350], 650"), "{said}");
        assert!(said.contains("reshape(2, -1)") && said.contains("row-cut.npz"), "{said}");
        let said = cut_lines("row.uff", &records, &[0.3, 1.3, 2.4]);
        assert!(said.contains("650 samples") && said.contains("250, 1250, 2350"), "{said}");
    }
}
