//! The page of a study: what the trend over several campaigns says, its figure, and a row for each
//! campaign.

use super::{figure_html, shell};
use crate::contact::Interval;
use crate::report::figure::{Along, Axis, Figure, Mark, Marker, Packed, Panel, Role, Shape, Source};
use crate::report::html::Html;
use crate::report::tables;
use crate::report::words::trend_sentences::{covariate_unit, sentences, shown_as, value};
use crate::results::{CampaignOfStudy, FittedForm, TrendOverCampaigns};
use std::collections::BTreeSet;

/// The whole page as HTML.
pub fn trend_page(trend: &TrendOverCampaigns) -> String {
    let figure = trend_figure(trend);
    let (symbol, ..) = shown_as(trend.quantity);
    let title = match &trend.against {
        Some(name) => format!("{symbol} against {name}"),
        None => format!("{symbol} over several campaigns"),
    };
    let mut body = Html::default();
    body.raw("<nav aria-label=\"contents\"><ul><li><a href=\"#answer\">What was found</a></li><li><a href=\"#campaigns\">The campaigns</a></li></ul></nav><main>");
    body.raw("<section id=\"answer\"><div class=\"words\">");
    body.element("h1", &title);
    for (place, line) in sentences(trend).iter().enumerate() {
        body.element(if place == 0 { "p class=\"headline\"" } else { "p" }, line);
    }
    body.raw("</div>");
    figure_html::figure(&mut body, &figure, 2);
    body.raw("</section>");
    body.raw("<section id=\"campaigns\"><h2>The campaigns</h2>");
    body.raw(&tables::campaigns_of_study(trend));
    body.raw("</section>");
    if !trend.left_out.is_empty() {
        body.raw("<section><h2>Left out</h2><ul>");
        for (file, why) in &trend.left_out {
            body.element("li", &format!("{file}: {why}"));
        }
        body.raw("</ul></section>");
    }
    body.raw("</main>");
    let banner = format!("{} campaigns", trend.campaigns.len());
    let simulated = trend.campaigns.iter().any(|one| one.found.simulated);
    shell(&title, &banner, simulated, &body.finish(), std::iter::once(&figure))
}

/// Every campaign with its interval, and the fitted line or curve with its 95 % band. Without a
/// covariate the campaigns stand in the order given, with the band of their level.
pub fn trend_figure(trend: &TrendOverCampaigns) -> Figure {
    let (symbol, unit, factor) = shown_as(trend.quantity);
    let power = trend.dependence == Some(FittedForm::PowerLaw);
    let place = |(number, one): (usize, &CampaignOfStudy)| one.found.covariate.unwrap_or(number as f64 + 1.0);
    let at: Vec<f64> = trend.campaigns.iter().enumerate().map(place).collect();
    let fitted: Vec<(f64, Interval)> = if trend.fitted.is_empty() {
        let [low, high] = [f64::min, f64::max].map(|of| at.iter().copied().reduce(of).unwrap_or_default());
        [low - 0.5, high + 0.5].map(|x| (x, trend.level)).into()
    } else {
        trend.fitted.iter().map(|point| (point.covariate, point.value)).collect()
    };
    let intervals =
        || trend.campaigns.iter().map(|one| one.found.value).chain(fitted.iter().map(|(_, of)| *of));
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let [low, high] = values
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        if power {
            let margin = (high / low).powf(0.05).max(1.02);
            [low / margin, high * margin]
        } else {
            let margin = (0.05 * (high - low)).max(1e-3 * high.abs()).max(f64::MIN_POSITIVE);
            [low - margin, high + margin]
        }
    };
    let x = range(&mut at.iter().copied().chain(fitted.iter().map(|(x, _)| *x)));
    let y = range(&mut intervals().flat_map(|of| of.ci95).map(|value| factor * value));
    let (name, of_name) = match &trend.against {
        Some(name) => (name.clone(), covariate_unit(name)),
        None => ("campaign, in the order given".into(), ""),
    };
    let axis = if power { Axis::log } else { Axis::linear };
    let along = || Along::of(&fitted.iter().map(|(x, _)| *x).collect::<Vec<_>>());
    let end = |which: usize| Packed::of(fitted.iter().map(|(_, of)| factor * of.ci95[which]));
    let ribbon = Shape::Ribbon { x: along(), low: end(0), high: end(1) };
    let what = match trend.dependence {
        None => "level",
        Some(FittedForm::Line) => "line",
        Some(FittedForm::PowerLaw) => "power law",
        Some(FittedForm::Curve) => "curve",
    };
    // paths in trend.json
    let of_fit = if trend.fitted.is_empty() { "/level" } else { "/fitted/*/value" };
    let mut panel = Panel::new(axis(name, of_name, x), axis(symbol.to_owned(), unit, y))
        .with(
            Mark::new(Role::Fitted, ribbon)
                .named(format!("{what}, 95 %"))
                .from("low", format!("{of_fit}/ci95/0"), factor)
                .from("high", format!("{of_fit}/ci95/1"), factor),
        )
        .with(
            Mark::line(Role::Fitted, along(), fitted.iter().map(|(_, of)| factor * of.mean))
                .named(what)
                .from("y", format!("{of_fit}/mean"), factor),
        );
    let groups: BTreeSet<Option<&str>> =
        trend.campaigns.iter().map(|one| one.found.reassembly.as_deref()).collect();
    for (number, group) in groups.iter().enumerate() {
        let own =
            || trend.campaigns.iter().zip(&at).filter(|(one, _)| one.found.reassembly.as_deref() == *group);
        let says = own().map(|(one, _)| {
            let [mean, low, high] = [one.found.value.mean, one.found.value.ci95[0], one.found.value.ci95[1]]
                .map(|v| value(trend.quantity, v));
            let known = one.found.value.ci95[0] < one.found.value.ci95[1];
            let interval = if known { format!(" ({low} to {high})") } else { String::new() };
            format!("{}: {mean}{interval}", one.found.file)
        });
        let role = if group.is_some() { Role::group(number) } else { Role::Measured };
        panel.marks.push(
            Mark::points(role, Marker::Dot, own().map(|(one, x)| [*x, factor * one.found.value.mean]))
                .barred("y", own().map(|(one, _)| one.found.value.ci95.map(|end| factor * end)))
                .saying(says.collect())
                .estimate("y", "/campaigns/*/value/mean", factor)
                .named(group.map_or_else(|| "campaigns, 95 %".into(), |name| format!("reassembly {name}"))),
        );
    }
    let mut figure = Figure::new(
        "trend",
        "",
        format!("{symbol} of {} campaigns", trend.campaigns.len()),
        "Each campaign with its own 95 % interval, and what was fitted. The band is the fit's 95 % interval; it includes what all campaigns share.",
    )
    .with(panel);
    figure.from = Source {
        records: Vec::new(),
        file: "trend.json".into(),
        simulated: trend.campaigns.iter().any(|one| one.found.simulated),
        version: env!("CARGO_PKG_VERSION").into(),
    };
    figure
}
