//! Which place of the plan each hit was at: hits are fitted to the plan's order, and where more
//! than one reading is possible, the answer is a list of questions instead of a guess.
//!
//! The evidence is the structure's answer ([`Answer::difference`]). Good hits whose answers agree
//! are one *group*: one place, however often and in how many visits it was struck. The plan states
//! the order in which places were first struck. The fit is accepted only if this leaves one
//! reading:
//!
//! - as many groups of enough hits as the plan has places, between any two places that are known
//!   (from the user's table);
//! - no hit whose answer is neither the same as that of a group nor clearly different from all;
//! - no two neighbouring groups that may be one place struck wrongly: together no more hits than
//!   one place should have, and no pause between them;
//! - no group of few hits without a pause before and after it, and none that comes first: hits
//!   beside the point, or test taps.
//!
//! Counting hits alone decides nothing: a place may have too few hits, or more than wanted because
//! some were repeated. A group of few hits is no place (test taps, or a hit beside the point); its
//! hits are left out and named. Refused hits (double, weak) go with the good hits around them, if
//! their answer does not contradict.

use super::alike::Answer;

/// Difference of two answers up to which they are the same, and from which they are not, where the
/// recording itself shows no gap between the two.
const SAME: f64 = 0.2;
const OTHER: f64 = 0.4;
/// Same and other are separated where two neighbouring differences have at least this ratio,
const GAP: f64 = 1.6;
/// the larger one is at least this,
const LEAST_OTHER: f64 = 0.15;
/// and the smaller one at most this.
const MOST_SAME: f64 = 0.5;
/// A difference below this is not compared with smaller ones: exact repetition says nothing about
/// the next one.
const SMALLEST: f64 = 0.02;
/// The hits of a group that a further hit is compared with: the last ones, because structures
/// drift.
const COMPARED: usize = 4;
/// A first group of at most this many good hits, if fewer than wanted, may be test taps.
const MOST_TAPS: usize = 3;
/// A pause is clear if it is this many times as long as nine of ten pauses between hits of a place.
const CLEAR_PAUSE: f64 = 1.5;

/// What is known of one hit.
#[derive(Clone, Debug)]
pub struct HitEvidence {
    /// When it was struck, s.
    pub at_s: f64,
    /// Whether its verdict is good.
    pub good: bool,
    /// The structure's answer.
    pub answer: Answer,
}

/// What the user states about a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// It was at this place of the order.
    Place(usize),
    /// It was at none: a test tap.
    Nowhere,
}

/// The places in the order in which they were struck.
#[derive(Clone, Debug)]
pub struct PlaceOrder {
    /// Each place's name, for messages.
    pub names: Vec<String>,
    /// Good hits wanted at each place.
    pub wanted: u32,
    /// Fewest good hits that make a place usable.
    pub minimum: u32,
}

impl PlaceOrder {
    /// Good hits from which a group counts as a place.
    fn enough(&self) -> usize {
        self.minimum.max(self.wanted.div_ceil(2)).max(1) as usize
    }
}

/// Consecutive hits at one place, or of one group.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// Indices of its first and last hit.
    pub hits: [usize; 2],
    /// Good hits in it.
    pub good: usize,
    /// The place, where it is known.
    pub place: Option<usize>,
}

/// A fit that leaves one reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The place of each hit; `None` for hits that are left out.
    pub places: Vec<Option<usize>>,
    /// What the user should know: hits that were left out, places struck again.
    pub notes: Vec<String>,
}

/// More than one reading is possible.
#[derive(Clone, Debug, PartialEq)]
pub struct Unclear {
    /// The visits, with the places that are certain.
    pub visits: Vec<Visit>,
    /// What is not certain, one sentence each.
    pub questions: Vec<String>,
}

/// Limits on the difference of two answers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Limits {
    same: f64,
    other: f64,
}

impl Limits {
    /// From the differences of consecutive good hits: most of them are of one place, some of two,
    /// and the widest gap between their sizes separates the two kinds.
    fn of(mut differences: Vec<f64>) -> Self {
        differences.sort_by(f64::total_cmp);
        let gaps = differences.windows(2).map(|two| (two[0].max(SMALLEST), two[1]));
        let widest = gaps
            .filter(|(low, high)| *high >= LEAST_OTHER && *low <= MOST_SAME && high / low >= GAP)
            .max_by(|a, b| (a.1 / a.0).total_cmp(&(b.1 / b.0)));
        match widest {
            None => Self { same: SAME, other: OTHER },
            Some((low, high)) => {
                let third = (high / low).cbrt();
                Self { same: low * third, other: high / third }
            }
        }
    }
}

/// Good hits at one place.
#[derive(Clone, Debug, Default)]
struct Group {
    members: Vec<usize>,
    place: Option<usize>,
    /// Whether the user named the place.
    named: bool,
}

/// Fits the hits to the order. `named` states what the user said of each hit.
///
/// # Errors
/// [`Unclear`] if more than one reading is possible.
pub fn fit(hits: &[HitEvidence], order: &PlaceOrder, named: &[Option<Named>]) -> Result<Fitted, Unclear> {
    let mut fit = Fit::new(hits, order, named);
    fit.group();
    fit.fill();
    fit.doubt_neighbours();
    if fit.questions.is_empty() {
        return Ok(fit.fitted());
    }
    Err(Unclear { visits: fit.visits(), questions: fit.questions })
}

/// What contradicts the places in `named`, of the hits in `marked` that only a marker names: a good
/// hit whose answer is clearly different from those of the other hits at its place. Each is the
/// hit's index and a sentence.
pub fn contradictions(
    hits: &[HitEvidence],
    order: &PlaceOrder,
    named: &[Option<Named>],
    marked: &[bool],
) -> Vec<(usize, String)> {
    let mut fit = Fit::new(hits, order, named);
    let good = fit.good();
    // one group for each place, of the hits named there
    fit.groups = (0..order.names.len())
        .map(|place| {
            let here = |hit: &usize| fit.said(*hit) == Some(Named::Place(place));
            let members = good.iter().copied().filter(here).collect();
            Group { members, place: Some(place), named: true }
        })
        .collect();
    let doubt = |hit: usize| {
        let Some(Named::Place(own)) = fit.said(hit).filter(|_| marked.get(hit) == Some(&true)) else {
            return None;
        };
        let away = fit.distance_from(hit, own).filter(|distance| *distance >= fit.limits.other)?;
        let other = (0..fit.groups.len())
            .filter(|place| *place != own)
            .filter_map(|place| Some((place, fit.distance_from(hit, place)?)))
            .filter(|(_, distance)| *distance <= fit.limits.same && *distance < away)
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let names = &order.names;
        let why = other.map_or_else(
            || "the response is that of no other hit there".to_owned(),
            |(place, _)| format!("the response is that of {}", names[place]),
        );
        Some((hit, format!("hit {}: the marker says {}, and {why}", hit + 1, names[own])))
    };
    good.iter().filter_map(|hit| doubt(*hit)).collect()
}

/// Consecutive good hits at one place, by what is stated; `open` ones are at no known place.
pub fn stated_visits(hits: &[HitEvidence], named: &[Option<Named>], open: &[usize]) -> Vec<Visit> {
    let mut visits: Vec<(Option<Named>, Visit)> = Vec::new();
    for hit in (0..hits.len()).filter(|hit| hits[*hit].good) {
        let said = named.get(hit).copied().flatten().filter(|_| !open.contains(&hit));
        let place = match said {
            Some(Named::Place(place)) => Some(place),
            Some(Named::Nowhere) => continue,
            None => None,
        };
        match visits.last_mut() {
            Some((last, visit)) if *last == said => {
                visit.hits[1] = hit;
                visit.good += 1;
            }
            _ => visits.push((said, Visit { hits: [hit, hit], good: 1, place })),
        }
    }
    visits.into_iter().map(|(_, visit)| visit).collect()
}

struct Fit<'f> {
    hits: &'f [HitEvidence],
    order: &'f PlaceOrder,
    named: &'f [Option<Named>],
    limits: Limits,
    groups: Vec<Group>,
    /// The group of each good hit.
    group_of: Vec<Option<usize>>,
    questions: Vec<String>,
}

/// Numbers of hits as the user sees them, from 1, with ranges.
pub fn numbers(hits: &[usize]) -> String {
    let mut ranges: Vec<[usize; 2]> = Vec::new();
    for hit in hits {
        match ranges.last_mut() {
            Some(last) if last[1] + 1 == *hit => last[1] = *hit,
            _ => ranges.push([*hit, *hit]),
        }
    }
    let text = |[first, last]: &[usize; 2]| {
        if first == last { format!("{}", first + 1) } else { format!("{}-{}", first + 1, last + 1) }
    };
    ranges.iter().map(text).collect::<Vec<_>>().join(", ")
}

/// The same after the word "hit" or "hits".
fn numbered(hits: &[usize]) -> String {
    format!("hit{} {}", if hits.len() == 1 { "" } else { "s" }, numbers(hits))
}

impl<'f> Fit<'f> {
    fn new(hits: &'f [HitEvidence], order: &'f PlaceOrder, named: &'f [Option<Named>]) -> Self {
        let nothing = Limits { same: SAME, other: OTHER };
        let group_of = vec![None; hits.len()];
        let mut fit =
            Self { hits, order, named, limits: nothing, groups: Vec::new(), group_of, questions: Vec::new() };
        let good = fit.good();
        let differences = good.windows(2).filter_map(|two| fit.difference(two[0], two[1])).collect();
        fit.limits = Limits::of(differences);
        fit
    }

    fn said(&self, hit: usize) -> Option<Named> {
        self.named.get(hit).copied().flatten()
    }

    /// The good hits that may be at a place.
    fn good(&self) -> Vec<usize> {
        (0..self.hits.len())
            .filter(|hit| self.hits[*hit].good && self.said(*hit) != Some(Named::Nowhere))
            .collect()
    }

    fn difference(&self, one: usize, other: usize) -> Option<f64> {
        self.hits[one].answer.difference(&self.hits[other].answer)
    }

    /// The median difference of a hit from the last hits of a group.
    fn distance_from(&self, hit: usize, group: usize) -> Option<f64> {
        let members = &self.groups[group].members;
        let others = members.iter().rev().filter(|other| **other != hit).take(COMPARED);
        let mut all: Vec<f64> = others.filter_map(|other| self.difference(hit, *other)).collect();
        all.sort_by(f64::total_cmp);
        // of two, the larger one
        all.get(all.len() / 2).copied()
    }

    /// Puts good hits whose answers agree into groups.
    fn group(&mut self) {
        let good = self.good();
        if good.is_empty() {
            self.questions.push("no hit is good: their verdicts say why".into());
            return;
        }
        let mut current: Option<usize> = None;
        let mut unsure: Vec<(usize, Option<usize>)> = Vec::new();
        for hit in good {
            let distances: Vec<Option<f64>> =
                (0..self.groups.len()).map(|group| self.distance_from(hit, group)).collect();
            let said = match self.said(hit) {
                Some(Named::Place(place)) => Some(place),
                _ => None,
            };
            let nearest = distances
                .iter()
                .enumerate()
                .filter_map(|(group, distance)| distance.map(|distance| (group, distance)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let is_same = |group: usize| distances[group].is_some_and(|d| d <= self.limits.same);
            let matching = current
                .filter(|group| is_same(*group))
                .or(nearest.map(|(group, _)| group).filter(|group| is_same(*group)));
            let joined = match (said, matching) {
                (Some(place), matching) => {
                    let known =
                        self.groups.iter().position(|group| group.named && group.place == Some(place));
                    let free = matching.filter(|group| !self.groups[*group].named);
                    let group = known.or(free).unwrap_or_else(|| self.new_group());
                    self.groups[group].place = Some(place);
                    self.groups[group].named = true;
                    Some(group)
                }
                (None, Some(group)) => Some(group),
                (None, None) => match nearest {
                    _ if distances.iter().any(Option::is_none) => None,
                    Some((_, distance)) if distance < self.limits.other => None,
                    _ => Some(self.new_group()),
                },
            };
            match joined {
                Some(group) => {
                    self.groups[group].members.push(hit);
                    self.group_of[hit] = Some(group);
                    current = Some(group);
                }
                None => unsure.push((hit, current)),
            }
        }
        // a hit that is not clearly different from the group before and after it belongs to it
        let mut open = Vec::new();
        for (hit, before) in unsure {
            let after = self.group_of[hit + 1..].iter().copied().flatten().next();
            let within = before.filter(|group| after == Some(*group));
            let close =
                within.filter(|group| self.distance_from(hit, *group).is_none_or(|d| d < self.limits.other));
            match close {
                Some(group) => {
                    self.groups[group].members.push(hit);
                    self.groups[group].members.sort_unstable();
                    self.group_of[hit] = Some(group);
                }
                None => open.push(hit),
            }
        }
        if !open.is_empty() {
            self.questions.push(format!(
                "{}: the response is neither that of another place of the recording nor clearly different from all",
                numbered(&open)
            ));
        }
    }

    fn new_group(&mut self) -> usize {
        self.groups.push(Group::default());
        self.groups.len() - 1
    }

    /// Whether a group counts as a place.
    fn counts(&self, group: &Group) -> bool {
        group.named || group.members.len() >= self.order.enough()
    }

    /// The groups that count as places, in the order in which they were first struck.
    fn sequence(&self) -> Vec<usize> {
        let mut sequence: Vec<usize> =
            (0..self.groups.len()).filter(|group| self.counts(&self.groups[*group])).collect();
        sequence.sort_by_key(|group| self.groups[*group].members.first().copied());
        sequence
    }

    /// Gives groups their places by the plan's order, where the numbers of both agree.
    fn fill(&mut self) {
        if self.groups.is_empty() {
            return;
        }
        let all = self.order.names.len();
        let taken: Vec<usize> =
            self.groups.iter().filter(|group| group.named).filter_map(|group| group.place).collect();
        let sequence = self.sequence();
        let mut from = 0;
        let mut run: Vec<usize> = Vec::new();
        let mut runs = Vec::new();
        for group in &sequence {
            match self.groups[*group].place.filter(|_| self.groups[*group].named) {
                None => run.push(*group),
                Some(place) => {
                    runs.push((std::mem::take(&mut run), from, place));
                    from = place + 1;
                }
            }
        }
        runs.push((run, from, all));
        for (run, from, to) in runs.into_iter().filter(|(run, ..)| !run.is_empty()) {
            let free: Vec<usize> = (from..to.max(from)).filter(|place| !taken.contains(place)).collect();
            if run.len() == free.len() {
                run.iter().zip(free).for_each(|(group, place)| self.groups[*group].place = Some(place));
                continue;
            }
            let members: Vec<usize> = {
                let mut members: Vec<usize> =
                    run.iter().flat_map(|group| self.groups[*group].members.iter().copied()).collect();
                members.sort_unstable();
                members
            };
            let names = |places: &[usize]| match places {
                [] => "none".to_owned(),
                [one] => self.order.names[*one].clone(),
                [first, .., last] => format!("{} to {}", self.order.names[*first], self.order.names[*last]),
            };
            self.questions.push(format!(
                "{}: by the responses, the good hits are at {} place{}, and the plan's order has {} here ({})",
                numbered(&members),
                run.len(),
                if run.len() == 1 { "" } else { "s" },
                free.len(),
                names(&free)
            ));
        }
    }

    /// The pauses between consecutive good hits of one visit, sorted, s.
    fn pauses_within(&self) -> Vec<f64> {
        let good: Vec<usize> = (0..self.hits.len()).filter(|hit| self.group_of[*hit].is_some()).collect();
        let within = good.windows(2).filter(|two| self.group_of[two[0]] == self.group_of[two[1]]);
        let mut pauses: Vec<f64> = within.map(|two| self.pause_before(two[1])).collect();
        pauses.sort_by(f64::total_cmp);
        pauses
    }

    /// The pause before a hit, s; infinite before the first hit and after the last one.
    fn pause_before(&self, hit: usize) -> f64 {
        let before = hit.checked_sub(1).and_then(|before| self.hits.get(before));
        before.zip(self.hits.get(hit)).map_or(f64::INFINITY, |(before, own)| own.at_s - before.at_s)
    }

    /// Questions about groups that may be no place of their own.
    fn doubt_neighbours(&mut self) {
        let pauses = self.pauses_within();
        let usual = pauses.get(9 * pauses.len() / 10).copied();
        let sequence = self.sequence();
        let wanted = self.order.wanted as usize;
        let mut doubts = Vec::new();
        for two in sequence.windows(2) {
            let (one, other) = (&self.groups[two[0]], &self.groups[two[1]]);
            if one.named || other.named || one.members.len() + other.members.len() > wanted {
                continue;
            }
            let begin = other.members[0];
            if usual.is_some_and(|usual| self.pause_before(begin) >= CLEAR_PAUSE * usual) {
                continue;
            }
            let members: Vec<usize> = one.members.iter().chain(&other.members).copied().collect();
            doubts.push(format!(
                "{}: the response changes before hit {}, without a pause, and together they are not more hits than one place should \
                 have: two places with missing hits, or one place where the hammer or a sensor was moved",
                numbered(&members),
                begin + 1
            ));
        }
        let is_clear = |pause_s: f64| usual.is_some_and(|usual| pause_s >= CLEAR_PAUSE * usual);
        for (number, group) in sequence.iter().enumerate() {
            let group = &self.groups[*group];
            let few = if number == 0 {
                (wanted / 2).max(MOST_TAPS.min(wanted.saturating_sub(1)))
            } else {
                wanted / 2
            };
            if group.named || wanted == 1 || group.members.len() > few || sequence.len() == 1 {
                continue;
            }
            // a few hits beside the point have no pause on one side; test taps come first
            let (first, last) = (group.members[0], group.members[group.members.len() - 1]);
            let apart = is_clear(self.pause_before(first)) && is_clear(self.pause_before(last + 1));
            if number == 0 || !apart {
                doubts.push(format!(
                    "{}: {} of {wanted} good hits: a place with missing hits, or test taps or hits beside the point",
                    numbered(&group.members),
                    group.members.len()
                ));
            }
        }
        self.questions.extend(doubts);
    }

    /// The place of a good hit.
    fn place(&self, hit: usize) -> Option<usize> {
        self.group_of[hit].and_then(|group| self.groups[group].place)
    }

    /// The place of a refused hit: that of the good hits around it, if its answer does not
    /// contradict.
    fn refused_place(&self, hit: usize) -> Option<usize> {
        match self.said(hit) {
            Some(Named::Place(place)) => return Some(place),
            Some(Named::Nowhere) => return None,
            None => {}
        }
        let is_place = |group: &usize| self.groups[*group].place.is_some();
        let before = self.group_of[..hit].iter().rev().copied().flatten().find(is_place);
        let after = self.group_of[hit + 1..].iter().copied().flatten().find(is_place);
        let near = |group: usize| self.distance_from(hit, group);
        let is_same = |group: usize| near(group).is_some_and(|d| d <= self.limits.same);
        let is_other = |group: usize| near(group).is_some_and(|d| d >= self.limits.other);
        let group = match (before, after) {
            (Some(one), Some(other)) if one == other => (!is_other(one)).then_some(one),
            (Some(one), Some(other)) => match (is_same(one), is_same(other)) {
                (true, false) => Some(one),
                (false, true) => Some(other),
                _ => None,
            },
            (Some(one), None) | (None, Some(one)) => is_same(one).then_some(one),
            (None, None) => None,
        };
        group.and_then(|group| self.groups[group].place)
    }

    fn fitted(&self) -> Fitted {
        let places: Vec<Option<usize>> = (0..self.hits.len())
            .map(|hit| if self.group_of[hit].is_some() { self.place(hit) } else { self.refused_place(hit) })
            .collect();
        let mut notes = Vec::new();
        let left = |good: bool| -> Vec<usize> {
            let unplaced = |hit: &usize| places[*hit].is_none() && self.said(*hit).is_none();
            (0..places.len()).filter(unplaced).filter(|hit| self.hits[*hit].good == good).collect()
        };
        let (good, refused) = (left(true), left(false));
        if !good.is_empty() {
            notes.push(format!(
                "{}: left out, because their response is that of no place with at least {} good hits: test taps, or struck \
                 beside the point",
                numbered(&good),
                self.order.enough()
            ));
        }
        if !refused.is_empty() {
            notes.push(format!(
                "{}: refused, and left out, because it is not clear at which place they were",
                numbered(&refused)
            ));
        }
        for (number, group) in self.groups.iter().enumerate() {
            let Some(place) = group.place else { continue };
            let visits = self.visits().into_iter().filter(|visit| visit.place == Some(place)).count();
            if visits > 1 {
                let first = self.groups[..number].iter().any(|other| other.place == Some(place));
                if !first {
                    notes.push(format!(
                        "{} was struck in {visits} visits ({})",
                        self.order.names[place],
                        numbered(&group.members)
                    ));
                }
            }
        }
        Fitted { places, notes }
    }

    /// Consecutive good hits of one group.
    fn visits(&self) -> Vec<Visit> {
        let mut visits: Vec<(Option<usize>, Visit)> = Vec::new();
        for hit in self.good() {
            let group = self.group_of[hit];
            match visits.last_mut() {
                Some((last, visit)) if *last == group => {
                    visit.hits[1] = hit;
                    visit.good += 1;
                }
                _ => visits.push((group, Visit { hits: [hit, hit], good: 1, place: self.place(hit) })),
            }
        }
        visits.into_iter().map(|(_, visit)| visit).collect()
    }
}
