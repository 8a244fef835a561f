//! A trend over several campaigns in words.

use crate::contact::Interval;
use crate::results::{FittedForm, StudiedQuantity, TrendOverCampaigns, rounded};

/// Symbol, unit in which it is shown, and factor from SI to that unit.
pub fn shown_as(quantity: StudiedQuantity) -> (&'static str, &'static str, f64) {
    match quantity {
        StudiedQuantity::KT => ("k_T", "N/µm", 1e-6),
        StudiedQuantity::CT => ("c_T", "N s/m", 1.0),
        StudiedQuantity::BetweenArms => ("k between the arms", "N/µm", 1e-6),
        StudiedQuantity::FrictionCoefficient => ("coefficient of friction", "", 1.0),
        StudiedQuantity::FirstMode => ("first mode of the assembly", "Hz", 1.0),
    }
}

/// The unit of a covariate of the files; empty for a column of a table, whose name states it.
pub fn covariate_unit(covariate: &str) -> &'static str {
    match covariate {
        "time" => "d",
        "temperature" => "°C",
        _ => "",
    }
}

/// A value with its unit.
pub fn value(quantity: StudiedQuantity, value: f64) -> String {
    let (_, unit, factor) = shown_as(quantity);
    let places = match quantity {
        StudiedQuantity::CT => 1,
        StudiedQuantity::FrictionCoefficient => 4,
        _ => 2,
    };
    format!("{:.places$} {unit}", factor * value).trim_end().to_owned()
}

/// A relative change with its interval.
fn percent(of: Interval) -> String {
    let [mean, low, high] = [of.mean, of.ci95[0], of.ci95[1]].map(|v| format!("{:+.2}", 100.0 * v));
    format!("{mean} % ({low} to {high})")
}

/// What was found, a sentence each.
pub fn sentences(trend: &TrendOverCampaigns) -> Vec<String> {
    let (symbol, ..) = shown_as(trend.quantity);
    let [level, low, high] =
        [trend.level.mean, trend.level.ci95[0], trend.level.ci95[1]].map(|of| value(trend.quantity, of));
    let at = match (&trend.against, trend.at) {
        (Some(name), Some(at)) => {
            let unit = covariate_unit(name);
            format!(" at {name} {} {unit}", rounded(at, 5)).trim_end().to_owned()
        }
        _ => String::new(),
    };
    let mut lines =
        vec![format!("{symbol}{at}: {level} ({low} to {high}), from {} campaigns", trend.campaigns.len())];
    if let Some(name) = &trend.against {
        lines.extend(dependence(trend, name));
    }
    let scatter = |of: Interval| {
        let [mean, low, high] = [of.mean, of.ci95[0], of.ci95[1]].map(|v| format!("{:.2}", 100.0 * v));
        format!("{mean} % ({low} to {high})")
    };
    if let Some(between) = trend.between {
        let grouped = trend.campaigns.iter().any(|one| one.found.reassembly.is_some());
        let what = if trend.within.is_some() || grouped {
            "standard deviation between reassemblies"
        } else {
            "standard deviation between campaigns, beyond their own errors"
        };
        lines.push(format!("{what}: {}", scatter(between)));
    }
    if let Some(within) = trend.within {
        lines.push(format!("standard deviation within a reassembly: {}", scatter(within)));
    }
    if trend.quantity == StudiedQuantity::KT {
        lines.push(format!(
            "error that all campaigns share (spots, gains, points): {:.2} %",
            100.0 * trend.shared_std
        ));
    }
    lines.push(match trend.reassemblies_needed {
        Some(needed) => format!("for a mean within ± {} %: {needed} reassemblies", trend.wanted_percent),
        None => format!(
            "a mean within ± {} % is out of reach: what all campaigns share prevents it, or more than a thousand reassemblies are needed",
            trend.wanted_percent
        ),
    });
    lines
}

fn dependence(trend: &TrendOverCampaigns, name: &str) -> Vec<String> {
    let Some(change) = trend.change else {
        return vec![format!("dependence on {name}: too few different values of it; three are needed")];
    };
    let mut lines = Vec::new();
    if let Some(slope) = trend.slope {
        let [low, high] = slope.ci95;
        lines.push(match (trend.dependence, name) {
            (Some(FittedForm::PowerLaw), _) => {
                format!("proportional to {name} to the power {:.3} ({low:.3} to {high:.3})", slope.mean)
            }
            (_, "time") => format!("change per day: {}", percent(slope)),
            (_, "temperature") => format!("change per °C: {}", percent(slope)),
            _ => format!("change per unit of {name}: {}", percent(slope)),
        });
    }
    let found = trend.depends == Some(true);
    if let Some(bends) = trend.bends {
        lines.push(format!("from the smallest {name} to the largest it changes by {}", percent(change)));
        lines.push(
            match (found, bends) {
                (false, _) => "no dependence found",
                (true, true) => "the curve bends: a line does not describe it",
                (true, false) => "no bend found: a line would describe it as well",
            }
            .into(),
        );
    } else if found {
        lines.push(format!("over the campaigns it changes by {}", percent(change)));
    } else {
        let largest = 100.0 * change.ci95[0].abs().max(change.ci95[1].abs());
        lines.push(format!("no change found; over the campaigns it is below {largest:.2} % with 95 %"));
    }
    lines
}
