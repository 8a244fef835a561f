//! Agreement of a set's hits: coherence, and the probable cause if one hit differs from the others.

use serde_json::{Value, json};

use crate::spectra::{
    CrossSpectra, Fit, FrfSettings, ImpactRecords, OddHit, SpectraError, estimate, odd_hit,
};
use crate::substructuring::Band;

/// Median coherence below which the hits of a response are compared individually.
const LOW: f64 = 0.95;

/// Median coherence above which a different order of the file's axes is assumed.
const HIGH: f64 = 0.98;

/// Coherence of one response over the excited lines.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Coherence {
    median: f64,
    lowest: f64,
    lowest_hz: f64,
}

/// Agreement of a set's hits.
pub(super) struct Agreement {
    /// Coherence of each response; `None` with a single hit, or without lines.
    coherence: Vec<Option<Coherence>>,
    /// Probable causes of disagreement, as sentences.
    pub(super) suspicions: Vec<String>,
}

impl Agreement {
    /// Evaluates the hits that are `used`, whose spectra are `found`; `names` are those of the
    /// responses.
    ///
    /// # Errors
    /// As for [`estimate`](fn@estimate).
    pub(super) fn of(
        records: &ImpactRecords,
        used: &[bool],
        settings: &FrfSettings,
        found: &CrossSpectra,
        excited: Option<Band>,
        names: &[String],
    ) -> Result<Self, SpectraError> {
        let inside = |y: &CrossSpectra| excited.map_or_else(|| y.clone(), |b| y.band(b.low_hz, b.high_hz));
        let coherence = coherence(&inside(found));
        let low: Vec<usize> = (0..coherence.len())
            .filter(|o| coherence[*o].is_some_and(|coherence| coherence.median < LOW))
            .collect();
        let mut suspicions = Vec::new();
        if !low.is_empty() {
            let hits: Vec<usize> = (0..used.len()).filter(|hit| used[*hit]).collect();
            let mut each = Vec::new();
            for hit in &hits {
                let one: Vec<bool> = (0..used.len()).map(|other| other == *hit).collect();
                each.push(inside(&estimate(records, &one, settings)?));
            }
            if let Some(odd) = odd_hit(&each) {
                suspicions.push(sentence(&odd, &hits, names));
            } else {
                let of: Vec<&str> = low.iter().map(|o| name(names, *o)).collect();
                suspicions.push(format!(
                    "the hits disagree in {}: their FRFs differ from hit to hit, or there is mostly noise",
                    of.join(", ")
                ));
            }
            if turned_axes_agree(records, settings, excited) {
                suspicions.push(
                    "the hits agree when the first two axes of `response` are swapped: it may be (channel, hit, sample), but \
                     (hit, channel, sample) is needed; np.swapaxes(response, 0, 1) swaps them"
                        .into(),
                );
            }
        }
        Ok(Self { coherence, suspicions })
    }

    /// Lines for the terminal.
    pub(super) fn lines(&self, names: &[String]) -> Vec<String> {
        let mut lines: Vec<String> = (self.coherence.iter().enumerate())
            .filter_map(|(o, coherence)| {
                let Coherence { median, lowest, lowest_hz } = (*coherence)?;
                let name = name(names, o);
                Some(format!(
                    "coherence of {name}: median {median:.3}, lowest {lowest:.3} at {lowest_hz:.1} Hz"
                ))
            })
            .collect();
        if lines.is_empty() {
            lines.push("there is no coherence: it needs at least two good hits".into());
        }
        lines.extend(self.suspicions.iter().cloned());
        lines
    }

    /// The response with the lowest median: its index, its median, its lowest value and the
    /// frequency of that, Hz.
    pub(super) fn worst(&self) -> Option<(usize, f64, f64, f64)> {
        (self.coherence.iter().enumerate())
            .filter_map(|(o, c)| c.map(|c| (o, c.median, c.lowest, c.lowest_hz)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Coherence of each response, for the JSON document.
    pub(super) fn document(&self) -> Value {
        let of = |coherence: &Option<Coherence>| {
            coherence.map(|c| json!({ "median": c.median, "lowest": c.lowest, "lowest_hz": c.lowest_hz }))
        };
        json!(self.coherence.iter().map(of).collect::<Vec<_>>())
    }
}

fn name(names: &[String], output: usize) -> &str {
    names.get(output).map_or("a response", String::as_str)
}

fn coherence(y: &CrossSpectra) -> Vec<Option<Coherence>> {
    (0..y.outputs())
        .map(|o| {
            let mut values: Vec<(f64, f64)> =
                (0..y.lines()).map(|line| (y.coherence(line, o), y.frequency_hz()[line])).collect();
            values.retain(|(coherence, _)| coherence.is_finite());
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (lowest, lowest_hz) = *values.first()?;
            Some(Coherence { median: values[values.len() / 2].0, lowest, lowest_hz })
        })
        .collect()
}

/// Whether the file may have its hits and channels in the wrong order: there are equally many of
/// each, and exchanging them gives high coherence.
fn turned_axes_agree(records: &ImpactRecords, settings: &FrfSettings, excited: Option<Band>) -> bool {
    let hits = records.response.len();
    if hits < 2 || records.response.iter().any(|responses| responses.len() != hits) {
        return false;
    }
    let turned: Vec<Vec<Vec<f64>>> = (0..hits)
        .map(|hit| (0..hits).map(|channel| records.response[channel][hit].clone()).collect())
        .collect();
    let turned = ImpactRecords { response: turned, ..records.clone() };
    let Ok(found) = estimate(&turned, &vec![true; hits], settings) else { return false };
    let found = excited.map_or_else(|| found.clone(), |band| found.band(band.low_hz, band.high_hz));
    coherence(&found).iter().all(|coherence| coherence.is_some_and(|coherence| coherence.median > HIGH))
}

/// The message about a hit that differs from the others; `hits` are the indices of the hits
/// compared.
fn sentence(odd: &OddHit, hits: &[usize], names: &[String]) -> String {
    let hit = hits.get(odd.hit).copied().unwrap_or(odd.hit);
    let others = match hits {
        [first, _] => format!("hit {first}"),
        _ => "the other hits".into(),
    };
    let differs = format!("hit {hit} differs from {others} by {:.0} %", 100.0 * odd.difference);
    let Some(fit) = &odd.fit else {
        return format!("{differs}: check whether a sensor, a cable or the place of impact was changed");
    };
    match fit {
        Fit::Scaled(factor) => {
            format!("{differs}: it fits when it is divided by {factor:.3} (a gain was changed?)")
        }
        Fit::Channels(own) if own.iter().enumerate().all(|(place, (channel, _))| place == *channel) => {
            let turned: Vec<&str> = (own.iter().enumerate())
                .filter(|(_, (_, negative))| *negative)
                .map(|(place, _)| name(names, place))
                .collect();
            format!("{differs}: it fits with the sign of {} reversed", turned.join(", "))
        }
        Fit::Channels(own) => {
            let signed =
                |text: &str, negative: bool| if negative { format!("−{text}") } else { text.into() };
            let order: Vec<String> =
                own.iter().map(|(channel, negative)| signed(name(names, *channel), *negative)).collect();
            let axes = if own.len() == 3 {
                let axis = |(channel, negative): &(usize, bool)| signed(["x", "y", "z"][*channel], *negative);
                format!(" ({})", own.iter().map(axis).collect::<Vec<_>>().join(", "))
            } else {
                String::new()
            };
            format!(
                "{differs}: its channels fit the others' in the order {}{axes} (a sensor was turned, or cables were swapped?)",
                order.join(", ")
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_a_hit_fit_is_said_with_its_number_in_the_file() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let say = |hit, fit| sentence(&OddHit { hit, difference: 0.85, fit }, &[0, 2, 3], &names);
        let text = say(1, Some(Fit::Channels(vec![(1, false), (2, true), (0, false)])));
        assert!(text.contains("hit 2") && text.contains("85 %"), "{text}");
        assert!(text.contains("in the order b, −c, a (y, −z, x)"), "{text}");
        let text = say(2, Some(Fit::Channels(vec![(0, false), (1, true), (2, false)])));
        assert!(text.contains("hit 3") && text.contains("sign of b reversed"), "{text}");
        assert!(say(0, Some(Fit::Scaled(0.5))).contains("divided by 0.500"));
        assert!(say(0, None).contains("check whether"));
    }

    #[test]
    fn coherence_and_turned_axes_are_told() {
        let ring = |part: f64| -> Vec<f64> {
            (0..2048)
                .map(|i| {
                    let t = (f64::from(i) - 44.0) / 4096.0;
                    if t > 0.0 { part * (-20.0 * t).exp() * (750.0 * t).sin() } else { 0.0 }
                })
                .collect()
        };
        let force: Vec<f64> = (0..2048)
            .map(|i| if (40..48).contains(&i) { (f64::from(i - 39) * 0.35).sin() } else { 0.0 })
            .collect();
        // (channel, hit, sample), with three channels that measure different fractions of the same
        // motion
        let records = ImpactRecords {
            fs_hz: 4096.0,
            force_n: vec![force; 3],
            response: [1.0, 0.5, 0.2].map(|part| vec![ring(part); 3]).to_vec(),
            quantity: crate::spectra::MotionQuantity::Velocity,
        };
        let names = ["a", "b", "c"].map(str::to_owned);
        let settings = FrfSettings::default();
        let found = estimate(&records, &[true; 3], &settings).expect("three hits");
        let told = Agreement::of(&records, &[true; 3], &settings, &found, None, &names).expect("three hits");
        let lines = told.lines(&names).join("\n");
        // (Σ p)² / (3 Σ p²) of 1, 0.5, 0.2
        assert!(lines.contains("coherence of a: median 0.747"), "{lines}");
        assert!(lines.contains("(channel, hit, sample)"), "{lines}");
        // in the right order the coherence is high
        let in_order = vec![[1.0, 0.5, 0.2].map(ring).to_vec(); 3];
        let records = ImpactRecords { response: in_order, ..records };
        let found = estimate(&records, &[true; 3], &settings).expect("three hits");
        let told = Agreement::of(&records, &[true; 3], &settings, &found, None, &names).expect("three hits");
        assert!(told.suspicions.is_empty(), "{:?}", told.suspicions);
        assert!(told.lines(&names)[0].contains("median 1.000"));
    }
}
