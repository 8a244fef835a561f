//! The contact's law along z: sliders in parallel, each in series with its share of the spring and
//! dashpot.
//!
//! One slider is a Jenkins contact, several with different limits an Iwan contact, whose stiffness
//! falls with amplitude as one element after the other slips (microslip). With Δ the specimens'
//! relative displacement, wᵢ the slip of element i, k its spring and β k its dashpot, it carries
//!
//! ```text
//! Tᵢ = k (Δ − wᵢ) + β k (Δ' − wᵢ'),   |Tᵢ| ≤ Lᵢ,   wᵢ' = 0 unless |Tᵢ| = Lᵢ, and then along Tᵢ.
//! ```
//!
//! Lᵢ is its share of μN, and N may vary with the motion: N = N₀ (1 + c y), with y as below, which
//! is Δ plus the dashpot's lead.
//!
//! A stuck contact is the linear contact. In slip an element carries Lᵢ at any velocity: the
//! dashpot force is part of the limited force, not added to it, so the force does not jump when an
//! element slips or sticks again, and every element only dissipates energy.
//!
//! **How it is advanced.** With y = Δ + β Δ' and vᵢ = wᵢ + β wᵢ' the law reads Tᵢ = k (y − vᵢ), and
//! vᵢ = wᵢ clamped to y ± Lᵢ/k, so no event detection is needed. The linear contact would carry K
//! y; the difference, k Σ vᵢ, pushes the specimens apart and changes linearly over a step, so that
//! wᵢ follows vᵢ in closed form and y at the step's end is the root of a monotone, piecewise linear
//! equation of one unknown.

use super::config::Contact;

/// Limit of Newton steps. Two or three are usual; 64 halvings of the error bring any start to
/// rounding.
const ROUNDS: usize = 64;

/// Elements that are processed together (SIMD lanes).
const LANES: usize = 4;
/// Reach (m) of the padding in the last lanes: it never slips and carries no force.
const NEVER_SLIPS: f64 = 1e300;

/// One number per element, padded to whole lanes.
type Lanes = Vec<[f64; LANES]>;

/// The sliders of one contact.
#[derive(Debug, Clone)]
pub struct Sliders {
    /// k of each (N/m).
    stiffness: f64,
    friction_coefficient: f64,
    /// Each element's fraction of the limit μN; they sum to 1.
    shares: Vec<f64>,
    /// Lᵢ / k (m) at N₀.
    reach: Lanes,
    /// c (1/m).
    load_slope_per_m: f64,
    /// wᵢ (m).
    slip: Lanes,
    /// vᵢ (m).
    lead: Lanes,
    /// vᵢ if it sticks by the end of the step (m).
    stuck: Lanes,
    /// Σ vᵢ (m).
    leads: f64,
    /// Current y (m).
    y: f64,
    /// No element slips: every vᵢ is wᵢ.
    settled: bool,
    /// Range of y in which no element would slip, valid while `settled`.
    holds: (f64, f64),
    /// Coefficients of the decay of v − w over a step, see [`relaxation`].
    relaxation: (f64, f64),
    friction_j: f64,
    slid_m: f64,
}

impl Sliders {
    /// At rest, advanced by steps of `step_s`; `None` for the linear law, which has no sliders. The
    /// normal load grows by the fraction `load_slope_per_m` per metre; |`load_slope_per_m` · Lᵢ /
    /// k| must be less than 1.
    pub fn new(contact: &Contact, load_slope_per_m: f64, step_s: f64) -> Option<Self> {
        let shares = contact.shares();
        if shares.is_empty() {
            return None;
        }
        let rest = vec![[0.0; LANES]; shares.len().div_ceil(LANES)];
        let mut sliders = Self {
            stiffness: contact.stiffness_n_per_m[2] / shares.len() as f64,
            friction_coefficient: contact.friction_coefficient,
            shares,
            reach: vec![[NEVER_SLIPS; LANES]; rest.len()],
            load_slope_per_m,
            slip: rest.clone(),
            lead: rest.clone(),
            stuck: rest,
            leads: 0.0,
            y: 0.0,
            settled: true,
            holds: (0.0, 0.0),
            relaxation: relaxation(step_s / contact.damping_s[2]),
            friction_j: 0.0,
            slid_m: 0.0,
        };
        sliders.load(contact.normal_load_n);
        Some(sliders)
    }

    /// Sets the normal load (N).
    pub fn load(&mut self, normal_load_n: f64) {
        let limit_n = self.friction_coefficient * normal_load_n;
        for (reach, share) in self.reach.as_flattened_mut().iter_mut().zip(&self.shares) {
            *reach = limit_n * share / self.stiffness;
        }
        self.bound();
        // The new limit may be below the force that is carried now.
        self.settled &= self.holds.0 <= self.y && self.y <= self.holds.1;
    }

    /// Takes over the positions of as many elements of another stiffness or limit, and the totals.
    pub fn continues(&mut self, before: &Self) {
        self.slip.clone_from(&before.slip);
        self.lead.clone_from(&before.lead);
        self.stuck.clone_from(&before.stuck);
        (self.leads, self.y) = (before.leads, before.y);
        (self.friction_j, self.slid_m) = (before.friction_j, before.slid_m);
        self.settled = before.settled;
        self.bound();
        // the new limit may be below the force that is carried now
        self.settled &= self.holds.0 <= self.y && self.y <= self.holds.1;
    }

    /// Determines the range in which no element slips.
    fn bound(&mut self) {
        self.holds = (f64::NEG_INFINITY, f64::INFINITY);
        for (slip, reach) in self.slip.as_flattened().iter().zip(self.reach.as_flattened()) {
            // |y − w| = reach (1 + c y), solved for y; padding is excluded because its infinities
            // would give NaN.
            if *reach < NEVER_SLIPS {
                let grows = reach * self.load_slope_per_m;
                self.holds.0 = self.holds.0.max((slip - reach) / (1.0 + grows));
                self.holds.1 = self.holds.1.min((slip + reach) / (1.0 - grows));
            }
        }
    }

    /// N over N₀ at `y`; a negative load becomes zero.
    #[inline]
    fn load_factor(&self, y: f64) -> f64 {
        let factor = 1.0 + self.load_slope_per_m * y;
        if factor > 0.0 { factor } else { 0.0 }
    }

    /// Stiffness with all elements stuck (N/m).
    pub fn stiffness(&self) -> f64 {
        self.stiffness * self.shares.len() as f64
    }

    /// Force between the specimens by which the linear contact exceeds this one (N).
    #[inline]
    pub fn push_n(&self) -> f64 {
        self.stiffness * self.leads
    }

    /// Whether no element slips now.
    #[inline]
    pub fn settled(&self) -> bool {
        self.settled
    }

    /// Whether no element slips at `y` either; if so, y is set to it.
    #[inline]
    pub fn hold(&mut self, y: f64) -> bool {
        let holds = self.settled && self.holds.0 <= y && y <= self.holds.1 && self.load_factor(y) > 0.0;
        if holds {
            self.y = y;
        }
        holds
    }

    /// Advances one step; y at its end is `free + receptance` times the push then, which is
    /// returned (N).
    ///
    /// `receptance` times [`Sliders::stiffness`] must lie in 0..0.5.
    pub fn slide(&mut self, free: f64, receptance: f64) -> f64 {
        let towards_slip = self.relaxation.0;
        for ((stuck, slip), lead) in self.stuck.iter_mut().zip(&self.slip).zip(&self.lead) {
            for i in 0..LANES {
                stuck[i] = lead[i] + towards_slip * (slip[i] - lead[i]);
            }
        }
        let gain = receptance * self.stiffness;
        let before = self.load_factor(self.y);
        self.y = free + gain * self.leads;
        for _ in 0..ROUNDS {
            let sliding = self.follow();
            let off = self.y - free - gain * self.leads;
            if off.abs() <= 4.0 * f64::EPSILON * (self.y.abs() + free.abs()) {
                break;
            }
            // All slopes lie between 1 − gain · count and 1, so a wrong slope still reduces the
            // error; so does neglecting the slope of the limits.
            self.y -= off / (1.0 - gain * sliding);
        }
        self.relax(0.5 * (before + self.load_factor(self.y)));
        self.push_n()
    }

    /// Updates every vᵢ for the current y; returns the number of slipping elements.
    #[inline]
    fn follow(&mut self) -> f64 {
        let (mut sum, mut sliding) = ([0.0; LANES], [0.0; LANES]);
        let factor = self.load_factor(self.y);
        for ((lead, stuck), reach) in self.lead.iter_mut().zip(&self.stuck).zip(&self.reach) {
            for i in 0..LANES {
                let (low, high) = (self.y - factor * reach[i], self.y + factor * reach[i]);
                let above = if stuck[i] < low { low } else { stuck[i] };
                lead[i] = if above > high { high } else { above };
                sum[i] += lead[i];
                sliding[i] += if lead[i] == stuck[i] { 0.0 } else { 1.0 };
            }
        }
        self.leads = sum.iter().sum();
        sliding.iter().sum()
    }

    /// Ends the step: every wᵢ relaxes towards its vᵢ, and the energy this dissipates at the mean
    /// load `factor` is added up.
    #[inline]
    fn relax(&mut self, factor: f64) {
        let rest = self.relaxation.1;
        let (mut path, mut work, mut apart) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for (((slip, lead), stuck), reach) in
            self.slip.iter_mut().zip(&self.lead).zip(&self.stuck).zip(&self.reach)
        {
            for i in 0..LANES {
                let after = lead[i] + rest * (stuck[i] - lead[i]);
                let moved = (after - slip[i]).abs();
                path[i] += moved;
                work[i] += moved * factor * reach[i];
                apart[i] += (lead[i] - after).abs();
                slip[i] = after;
            }
        }
        self.settled = apart.iter().all(|apart| *apart == 0.0);
        if self.settled {
            self.bound();
        }
        self.slid_m += path.iter().sum::<f64>() / self.shares.len() as f64;
        self.friction_j += work.iter().sum::<f64>() * self.stiffness;
    }

    /// Force that the contact carries now (N), from specimen A on B.
    pub fn force_n(&self) -> f64 {
        self.stiffness() * self.y - self.push_n()
    }

    /// The largest force that it can carry now (N).
    pub fn limit_n(&self) -> f64 {
        let factor = self.load_factor(self.y);
        factor * self.stiffness * self.reach.as_flattened()[..self.shares.len()].iter().sum::<f64>()
    }

    /// Fraction of the elements that slip now, 0…1.
    pub fn sliding(&self) -> f64 {
        let elements = self.lead.as_flattened().iter().zip(self.slip.as_flattened());
        let count = elements.filter(|(lead, slip)| lead != slip).count();
        count as f64 / self.shares.len() as f64
    }

    /// Mean of the distances that the elements have slid (m).
    pub fn slid_m(&self) -> f64 {
        self.slid_m
    }

    /// Energy dissipated by friction (J).
    pub fn friction_j(&self) -> f64 {
        self.friction_j
    }

    /// Energy in the springs (J) at the relative displacement `relative_m`.
    pub fn stored_j(&self, relative_m: f64) -> f64 {
        let slips = &self.slip.as_flattened()[..self.shares.len()];
        0.5 * self.stiffness * slips.iter().map(|slip| (relative_m - slip).powi(2)).sum::<f64>()
    }
}

/// For a step of `x` time constants, w' = v − w and v linear: (α, φ), so that w ends at φ (α w + (1
/// − α) v) + (1 − φ) v₁. Without a dashpot (infinite x) w is v.
fn relaxation(x: f64) -> (f64, f64) {
    if x.is_finite() { (x / x.exp_m1(), -(-x).exp_m1() / x) } else { (0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::rig::RigConfig;
    use crate::rig::config::ContactLaw;

    fn contact(law: ContactLaw) -> Contact {
        let mut contact = RigConfig::default().contact;
        contact.law = law;
        contact.stiffness_n_per_m[2] = 143.7e6;
        contact.friction_coefficient = 0.57;
        contact.normal_load_n = 300.0;
        contact
    }

    /// One steady cycle of prescribed Δ = X sin: Δ and T, step by step, and the energy dissipated
    /// by friction.
    fn cycle(contact: &Contact, amplitude_m: f64, hz: f64, steps: u32) -> (Vec<(f64, f64)>, f64) {
        let beta = contact.damping_s[2];
        let mut sliders =
            Sliders::new(contact, 0.0, 1.0 / (hz * f64::from(steps))).expect("a law that slips");
        let (mut seen, mut before) = (Vec::new(), 0.0);
        for step in 1..=3 * steps {
            let angle = TAU * f64::from(step) / f64::from(steps);
            let relative = amplitude_m * angle.sin();
            sliders.slide(relative + beta * TAU * hz * amplitude_m * angle.cos(), 0.0);
            if step == 2 * steps {
                before = sliders.friction_j();
            } else if step > 2 * steps {
                seen.push((relative, sliders.force_n()));
            }
        }
        (seen, sliders.friction_j() - before)
    }

    fn area(seen: &[(f64, f64)]) -> f64 {
        let next = seen.iter().cycle().skip(1);
        seen.iter().zip(next).map(|(a, b)| 0.5 * (a.1 + b.1) * (b.0 - a.0)).sum()
    }

    /// Least-squares slope of T on Δ.
    fn slope(seen: &[(f64, f64)]) -> f64 {
        seen.iter().map(|(x, t)| x * t).sum::<f64>() / seen.iter().map(|(x, _)| x * x).sum::<f64>()
    }

    #[test]
    fn a_slow_jenkins_loop_has_its_closed_forms() {
        let mut contact = contact(ContactLaw::Jenkins);
        contact.damping_s[2] = 0.0;
        let (k, limit, x) = (143.7e6, 171.0, 6e-6);
        let (seen, friction_j) = cycle(&contact, x, 1.0, 200_000);
        let energy = 4.0 * limit * (x - limit / k);
        assert!((energy - 3.290e-3).abs() < 1e-6, "the figure of the text book example: {energy}");
        assert!((area(&seen) / energy - 1.0).abs() < 1e-6, "{}", area(&seen));
        assert!((friction_j / energy - 1.0).abs() < 1e-6, "{friction_j}");
        // Secant: μN / X. Least squares: from the loop's two branches, with X (1 − cos θ) = 2 μN /
        // k where slip begins.
        let most = seen.iter().map(|(_, t)| t.abs()).fold(0.0, f64::max);
        assert!((most / x / 28.5e6 - 1.0).abs() < 1e-6, "{}", most / x);
        let theta = (1.0 - 2.0 * limit / (k * x)).acos();
        let equivalent = k / (TAU / 2.0) * (theta - 0.5 * (2.0 * theta).sin());
        assert!((slope(&seen) / equivalent - 1.0).abs() < 1e-6, "{} for {equivalent}", slope(&seen));
        assert!((equivalent / 20.2e6 - 1.0).abs() < 5e-3, "{equivalent}");
    }

    #[test]
    fn a_slow_iwan_loop_is_masings() {
        let mut contact = contact(ContactLaw::Iwan);
        contact.damping_s[2] = 0.0;
        let (k, shares) = (143.7e6, contact.iwan.shares());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        // The first loading: each element's spring up to its own limit.
        let backbone = |x: f64| -> f64 { shares.iter().map(|share| (k / 20.0 * x).min(171.0 * share)).sum() };
        for x in [0.3e-6, 0.9e-6, 6e-6] {
            let (seen, friction_j) = cycle(&contact, x, 1.0, 200_000);
            for (at, force) in seen.iter().skip(50_000).take(100_000) {
                // Masing: unloading is the first loading, twice as large, from the tip.
                let expected = backbone(x) - 2.0 * backbone((x - at) / 2.0);
                assert!((force - expected).abs() < 2e-3, "{x} {at}: {force} for {expected}");
            }
            let energy: f64 = shares
                .iter()
                .map(|share| 4.0 * 171.0 * share * (x - 20.0 * 171.0 * share / k).max(0.0))
                .sum();
            assert!(
                (area(&seen) - energy).abs() < 1e-5 * energy + 1e-12,
                "{x}: {} for {energy}",
                area(&seen)
            );
            assert!((friction_j - energy).abs() < 1e-5 * energy + 1e-12, "{x}: {friction_j} for {energy}");
        }
        // Expected from the continuous distribution over 1 ± 0.9 times the mean; 20 elements agree
        // to 1e-3.
        let slips_at = |u: f64| u * 171.0 / k;
        let x = slips_at(1.0);
        let (low, high) = (0.1, 1.9);
        let uniform = 171.0 / (high - low) * (0.5 * (1.0 - low * low) + (high - 1.0));
        assert!((backbone(x) / uniform - 1.0).abs() < 1e-3, "{} for {uniform}", backbone(x));
    }

    #[test]
    fn no_force_is_beyond_the_limit_however_fast_and_a_fast_loop_takes_what_its_parts_take() {
        // 1300 Hz and 20 µm: 0.16 m/s, at which a dashpot in parallel with the slider would carry
        // 350 N.
        let contact = contact(ContactLaw::Jenkins);
        let (seen, friction_j) = cycle(&contact, 20e-6, 1300.0, 100_000);
        assert!(seen.iter().all(|(_, force)| force.abs() <= 171.0 + 1e-9));
        // The dashpot dissipates only while the contact sticks: β k ∫ Δ'² dt over the time in which
        // T reverses.
        let part = 1.0 - friction_j / area(&seen);
        assert!((0.0..0.05).contains(&part), "{part}");
    }

    #[test]
    fn the_load_is_the_limit_and_none_is_no_contact() {
        let mut sliders = Sliders::new(&contact(ContactLaw::Iwan), 0.0, 5e-6).expect("a law that slips");
        let (far, stuck) = (1e-4, 0.1 * 171.0 * 0.1 / 143.7e6);
        sliders.slide(stuck, 0.0);
        assert!((sliders.force_n() / (143.7e6 * stuck) - 1.0).abs() < 1e-12 && sliders.settled());
        for load in [300.0, 450.0, 100.0, 0.0] {
            sliders.load(load);
            assert!((sliders.limit_n() - 0.57 * load).abs() < 1e-9);
            for direction in [-1.0, 1.0] {
                for _ in 0..100 {
                    sliders.slide(direction * far, 0.0);
                }
                assert!((sliders.force_n() - direction * 0.57 * load).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_step_is_solved_whatever_the_receptance() {
        let contact = contact(ContactLaw::Iwan);
        for gain in [0.0, 1e-3, 0.1, 0.49] {
            let mut sliders = Sliders::new(&contact, 0.0, 5e-6).expect("a law that slips");
            let receptance = gain / sliders.stiffness();
            for step in 0..2_000 {
                let free = 4e-6 * (f64::from(step) * 0.01).sin();
                let push = sliders.slide(free, receptance);
                let y = free + receptance * push;
                assert!((sliders.force_n() - (sliders.stiffness() * y - push)).abs() < 1e-9, "{gain} {step}");
                assert!(sliders.force_n().abs() <= 171.0 + 1e-9);
            }
        }
    }
}
