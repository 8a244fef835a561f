//! Sentences for the comparison of two campaigns.

use crate::contact::Interval;
use crate::results::Difference;

/// Whether the contacts differ, by the quantity that decides it; a fixed sentence if neither
/// quantity is known in both.
pub fn verdict(told: Option<&Difference>) -> String {
    told.map_or_else(
        || {
            "Nothing tells whether the contacts differ: neither k_T nor the stiffness between the arms is known in both."
                .into()
        },
        of_difference,
    )
}

/// Sentence for a quantity that one of the two lacks.
pub fn lacking(quantity: &str, which: &str) -> String {
    format!("{quantity}: the {which} campaign has none")
}

fn of_difference(d: &Difference) -> String {
    let micro = |k: f64| 1e-6 * k;
    let Interval { mean, ci95: [low, high] } = d.b_minus_a;
    let part = 100.0 * mean / d.a.mean;
    if d.differ {
        let way = if mean > 0.0 { "stiffer" } else { "softer" };
        // the smaller change first, whatever its sign
        let [near, far] = if mean > 0.0 { [low, high] } else { [-high, -low] };
        format!(
            "They differ: {}, the second is {way} by {:.1} N/µm (95 % {:.1}…{:.1}), {:.0} % of the first.",
            d.quantity,
            micro(mean.abs()),
            micro(near),
            micro(far),
            part.abs()
        )
    } else {
        format!(
            "They do not differ as far as this measurement tells: {}, second minus first is {:.1} N/µm (95 % {:.1}…{:.1}).",
            d.quantity,
            micro(mean),
            micro(low),
            micro(high)
        )
    }
    .replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(mean: f64, differ: bool) -> Difference {
        let a = Interval { mean: 180e6, ci95: [174e6, 186e6] };
        let b = Interval { mean: 180e6 + mean, ci95: [174e6 + mean, 186e6 + mean] };
        let b_minus_a = Interval { mean, ci95: [mean - 7.8e6, mean + 7.8e6] };
        Difference { quantity: "k_T".into(), unit: "N/m", a, b, b_minus_a, differ }
    }

    #[test]
    fn the_smaller_change_comes_first_whichever_way_it_goes() {
        let softer = verdict(Some(&difference(-18e6, true)));
        assert!(softer.contains("softer by 18.0 N/µm (95 % 10.2…25.8), 10 %"), "{softer}");
        let stiffer = verdict(Some(&difference(18e6, true)));
        assert!(stiffer.contains("stiffer by 18.0 N/µm (95 % 10.2…25.8), 10 %"), "{stiffer}");
        let same = verdict(Some(&difference(-3e6, false)));
        assert!(same.contains("do not differ") && same.contains("−3.0 N/µm (95 % −10.8…4.8)"), "{same}");
    }
}
