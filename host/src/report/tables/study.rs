//! The table of a study's campaigns. Paths are those in trend.json.

use super::{HtmlTable, interval, number, words};
use crate::contact::Interval;
use crate::report::words::number::{decimals, interval_places};
use crate::report::words::trend_sentences::shown_as;
use crate::results::{TrendOverCampaigns, rounded};

/// The campaigns of a study with their values, and what the trend gives there.
pub fn campaigns_of_study(trend: &TrendOverCampaigns) -> String {
    let (symbol, unit, factor) = shown_as(trend.quantity);
    let of = |text: &str| if unit.is_empty() { text.to_owned() } else { format!("{text}, {unit}") };
    let grouped = trend.campaigns.iter().any(|one| one.found.reassembly.is_some());
    let mut heads = vec!["file".to_owned()];
    heads.extend(grouped.then(|| "reassembly".into()));
    heads.extend(trend.against.clone());
    heads.extend([of(symbol), "95 % interval".into(), of("trend"), "95 % interval".into()]);
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let mut table =
        HtmlTable::new(1 + usize::from(grouped), "Each campaign, and what the trend gives there", &heads);
    let both = |of: &Interval, place: &str| {
        let [mean, low, high] = [of.mean, of.ci95[0], of.ci95[1]].map(|value| factor * value);
        // a plain number has no interval of its own
        let (mean, ends) = if low < high {
            let places = interval_places(0.5 * (high - low));
            let [mean, low, high] = [mean, low, high].map(|value| decimals(value, places));
            (mean, Some(format!("{low} to {high}")))
        } else {
            (rounded(mean, 4).to_string(), None)
        };
        [number(Some(mean), format!("{place}/mean")), interval(ends, &format!("{place}/ci95"))]
    };
    for (i, one) in trend.campaigns.iter().enumerate() {
        let place = format!("/campaigns/{i}");
        let mut row = vec![words(&one.found.file)];
        row.extend(grouped.then(|| words(one.found.reassembly.as_deref().unwrap_or_default())));
        let covariate = one.found.covariate.map(|value| rounded(value, 4).to_string());
        row.extend(trend.against.is_some().then(|| number(covariate, format!("{place}/covariate"))));
        row.extend(both(&one.found.value, &format!("{place}/value")));
        row.extend(both(&one.trend, &format!("{place}/trend")));
        table.row(row);
    }
    table.finish()
}
