//! Impact records of a file with their units and the signed axes of their labels. Responses are
//! turned to x, y and z, or to the axes that a plan gives for the location.

use super::labelled_frf::{Beside, along, axis_name, beside, turned_words, vector_name, vector_names};
use crate::spectra::ImpactRecords;

/// Impact records of a file in SI, with the information from its labels.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordFile {
    /// The hits.
    pub records: ImpactRecords,
    /// Delay of each response relative to the force, s.
    pub delay_s: Vec<f64>,
    /// Positive directions of force and responses.
    pub directions: Directions,
    /// A one-line description of what was read: `velocity in mm/s, force in lbf, A1 along −z
    /// turned`.
    pub taken: String,
    /// What was left out or aligned in time.
    pub notes: Vec<String>,
}

impl RecordFile {
    /// Puts responses in the order x, y, z, and changes the sign of those along a negative axis.
    #[must_use]
    pub fn along_axes(mut self) -> Self {
        let turned = self.directions.turn_to_axes(&mut self.records, &mut self.delay_s);
        let turned: Vec<(String, i64)> = turned.into_iter().map(|d| ("response".to_owned(), d)).collect();
        self.taken.extend(turned_words(&turned).map(|words| format!(", {words}")));
        self
    }

    /// Puts responses in the order and along the directions that a plan gives for the cell.
    ///
    /// # Errors
    /// A label and the plan contradict one another; the message names both.
    pub fn along_plan(mut self, place: &PlannedPlace<'_>) -> Result<Self, String> {
        let told = self.directions.to_plan(&mut self.records, &mut self.delay_s, place)?;
        self.taken.extend(told.iter().map(|words| format!(", {words}")));
        Ok(self)
    }
}

/// Directions of a hit's force and responses from their labels; 0 where a label has none.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Directions {
    /// Direction of the force.
    pub force: i64,
    /// Direction of each response, in the order of the records.
    pub responses: Vec<i64>,
}

/// Reorders the channels of every hit by `order`.
fn reorder(records: &mut ImpactRecords, order: &[usize]) {
    for hit in &mut records.response {
        let mut own: Vec<Vec<f64>> = order.iter().map(|at| std::mem::take(&mut hit[*at])).collect();
        std::mem::swap(hit, &mut own);
    }
}

/// Changes the sign of one response of every hit.
fn turn(records: &mut ImpactRecords, channel: usize) {
    records.response.iter_mut().flat_map(|hit| &mut hit[channel]).for_each(|v| *v = -*v);
}

impl Directions {
    /// Puts responses that are along different axes in the order x, y, z, and changes the sign of
    /// those along a negative axis; returns the directions that were turned.
    pub(super) fn turn_to_axes(&mut self, records: &mut ImpactRecords, delay_s: &mut [f64]) -> Vec<i64> {
        let mut order: Vec<usize> = (0..self.responses.len()).collect();
        let axes: Vec<i64> = self.responses.iter().map(|d| d.saturating_abs()).collect();
        let apart = (1..axes.len()).all(|i| !axes[..i].contains(&axes[i]));
        if apart && axes.iter().all(|axis| (1..=3).contains(axis)) {
            order.sort_by_key(|at| axes[*at]);
            reorder(records, &order);
            self.reorder(&order, delay_s);
        }
        let turned: Vec<i64> = self.responses.iter().copied().filter(|d| (-3..0).contains(d)).collect();
        for (channel, direction) in self.responses.iter_mut().enumerate() {
            if (-3..0).contains(direction) {
                turn(records, channel);
                *direction = -*direction;
            }
        }
        turned
    }

    fn reorder(&mut self, order: &[usize], delay_s: &mut [f64]) {
        let (own, late) = (self.responses.clone(), delay_s.to_vec());
        for (to, from) in order.iter().enumerate() {
            self.responses[to] = own[*from];
            if let (Some(slot), Some(value)) = (delay_s.get_mut(to), late.get(*from)) {
                *slot = *value;
            }
        }
    }

    /// Puts the responses in the order and along the directions of a plan's `axes` for their
    /// location, and the force along the plan's `push`; returns notes for the user.
    ///
    /// # Errors
    /// A label and the plan contradict one another; the message names both.
    pub fn to_plan(
        &mut self,
        records: &mut ImpactRecords,
        delay_s: &mut [f64],
        place: &PlannedPlace<'_>,
    ) -> Result<Vec<String>, String> {
        let mut told = self.force_to_plan(records, place)?;
        let PlannedPlace { response, axes, .. } = *place;
        // without labels the plan's order applies; a wrong number of channels is refused elsewhere
        if self.responses.len() != axes.len() || self.responses.iter().all(|d| *d == 0) {
            return Ok(told);
        }
        let same = |found: Beside| found == Beside::Same;
        let either = |found: Beside| matches!(found, Beside::Same | Beside::Opposite);
        if let Some(order) = self.order_along(axes, same).or_else(|| self.own_numbers(place)) {
            if self.order_along(axes, same).is_none() {
                told.push(format!(
                    "{response}: the labels x, y, z number the sensor's own channels, which the plan has along {}",
                    vector_names(axes)
                ));
            }
            reorder(records, &order);
            self.reorder(&order, delay_s);
        } else if let Some(order) = self.order_along(axes, either) {
            reorder(records, &order);
            self.reorder(&order, delay_s);
            let mut turned = Vec::new();
            for (channel, axis) in axes.iter().enumerate() {
                let label = self.responses[channel];
                if beside(label, *axis) == Beside::Opposite {
                    turn(records, channel);
                    turned.push((response.to_owned(), label));
                    self.responses[channel] = -label;
                }
            }
            told.extend(turned_words(&turned));
        } else if axes.iter().all(|axis| along(*axis).is_none()) {
            told.push(format!(
                "{response}: no label can name its axes {}: the channels are taken in the plan's order",
                vector_names(axes)
            ));
        } else {
            let label = |d: &i64| axis_name(*d).unwrap_or_else(|| "no axis".into());
            return Err(format!(
                "the labels have {response} along {}, the plan has it along {}: correct one of them",
                self.responses.iter().map(label).collect::<Vec<_>>().join(", "),
                vector_names(axes)
            ));
        }
        Ok(told)
    }

    /// For each of `axes` a channel whose label relates to it as `wanted` requires; `None` where
    /// one is missing.
    fn order_along(&self, axes: &[[f64; 3]], wanted: impl Fn(Beside) -> bool + Copy) -> Option<Vec<usize>> {
        let Some((axis, rest)) = axes.split_first() else { return Some(Vec::new()) };
        (0..self.responses.len()).find_map(|at| {
            let label = self.responses[at];
            if label == 0 || !wanted(beside(label, *axis)) {
                return None;
            }
            // an oblique axis may match two labels, so each is tried
            let mut left = self.clone();
            left.responses[at] = 0;
            let mut order = left.order_along(rest, wanted)?;
            order.insert(0, at);
            Some(order)
        })
    }

    /// The channels in the order of labels x, y, z, where these number the axes of a triaxial
    /// sensor.
    fn own_numbers(&self, place: &PlannedPlace<'_>) -> Option<Vec<usize>> {
        let numbered = |axis: i64| self.responses.iter().position(|d| *d == axis);
        let order = [numbered(1)?, numbered(2)?, numbered(3)?];
        place.own_axes.then(|| order.to_vec())
    }

    fn force_to_plan(
        &mut self,
        records: &mut ImpactRecords,
        place: &PlannedPlace<'_>,
    ) -> Result<Vec<String>, String> {
        let label = axis_name(self.force).unwrap_or_default();
        let planned = vector_name(place.push);
        let contradiction = || {
            Err(format!(
                "the label has the hammer at {} push along {label}, the plan along {planned}: correct one of them",
                place.impact
            ))
        };
        match beside(self.force, place.push) {
            Beside::Same => Ok(Vec::new()),
            // a hammer only pushes: a force that is positive against the plan's direction
            // contradicts it
            Beside::Opposite if records.force_n.iter().any(|force| is_push(force)) => contradiction(),
            Beside::Opposite => {
                records.force_n.iter_mut().flatten().for_each(|v| *v = -*v);
                let turned = turned_words(&[(place.impact.to_owned(), self.force)]);
                self.force = -self.force;
                Ok(turned.into_iter().collect())
            }
            Beside::Untold => Ok(vec![format!(
                "{}: labelled {label}, but no label can name the plan's direction {planned}, which is used",
                place.impact
            )]),
            Beside::Other => contradiction(),
        }
    }
}

/// Whether the largest positive force of a hit exceeds the largest negative one.
fn is_push(force_n: &[f64]) -> bool {
    let (low, high) =
        force_n.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high > -low
}

/// A plan's impact and response location of a cell.
#[derive(Debug, Clone, Copy)]
pub struct PlannedPlace<'p> {
    /// Name of the impact.
    pub impact: &'p str,
    /// Direction in which the hammer pushes, a unit vector.
    pub push: [f64; 3],
    /// Name of the response location.
    pub response: &'p str,
    /// Measuring direction of each channel at the location, unit vectors.
    pub axes: &'p [[f64; 3]],
    /// Whether the plan defines these axes itself, instead of using x, y and z.
    pub own_axes: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::MotionQuantity;

    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Y: [f64; 3] = [0.0, 1.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];
    const DOWN: [f64; 3] = [0.0, 0.0, -1.0];
    const SLANTED: [f64; 3] = [0.6, 0.8, 0.0];

    /// A hit whose channels have the values 1, 2, 3.
    fn hit(force: f64, channels: usize) -> ImpactRecords {
        ImpactRecords {
            fs_hz: 1000.0,
            force_n: vec![vec![0.0, force, 0.0]],
            response: vec![(1..=channels).map(|channel| vec![channel as f64]).collect()],
            quantity: MotionQuantity::Velocity,
        }
    }

    fn values(records: &ImpactRecords) -> Vec<f64> {
        records.response[0].iter().map(|channel| channel[0]).collect()
    }

    fn labels(force: i64, responses: &[i64]) -> Directions {
        Directions { force, responses: responses.to_vec() }
    }

    #[test]
    fn without_a_plan_axes_are_put_in_order_and_negative_ones_turned() {
        for (own, wanted) in [
            (&[-3][..], &[-1.0][..]),
            (&[1, -3], &[1.0, -2.0]),
            (&[-3, 1], &[2.0, -1.0]),
            (&[1, -2, 3], &[1.0, -2.0, 3.0]),
            (&[3, -1, 2], &[-2.0, 3.0, 1.0]),
            (&[0, -3], &[1.0, -2.0]),
            (&[3, 3], &[1.0, 2.0]),
        ] {
            let mut records = hit(1.0, own.len());
            let mut delay_s: Vec<f64> = (1..=own.len()).map(|channel| channel as f64).collect();
            let mut directions = labels(-3, own);
            let turned = directions.turn_to_axes(&mut records, &mut delay_s);
            assert_eq!(values(&records), wanted, "{own:?}");
            assert_eq!(turned, own.iter().copied().filter(|d| *d < 0).collect::<Vec<_>>());
            assert!(delay_s.iter().zip(wanted).all(|(late, value)| *late == value.abs()), "{own:?}");
            assert_eq!(directions.force, -3, "the hammer's own direction stays");
        }
    }

    #[test]
    fn labels_are_turned_into_the_plans_axes_or_contradict_them_by_name() {
        let place = |axes: &'static [[f64; 3]], push| PlannedPlace {
            impact: "AZ1",
            push,
            response: "A1",
            axes,
            own_axes: axes != [X, Y, Z],
        };
        let turned = |axes: &'static [[f64; 3]], own: &[i64]| {
            let mut records = hit(1.0, own.len());
            let mut delay_s = vec![0.0; own.len()];
            let told = labels(-3, own).to_plan(&mut records, &mut delay_s, &place(axes, DOWN));
            told.map(|told| (values(&records), told.join("; ")))
        };
        for (axes, own, wanted, word) in [
            (&[X, Y, Z][..], &[1, -2, 3][..], &[1.0, -2.0, 3.0][..], "A1 along −y turned"),
            (&[X, Y, Z], &[3, 1, 2], &[2.0, 3.0, 1.0], ""),
            (&[Z], &[3], &[1.0], ""),
            (&[Z], &[-3], &[-1.0], "A1 along −z turned"),
            (&[DOWN], &[3], &[-1.0], "A1 along +z turned"),
            (&[DOWN], &[-3], &[1.0], ""),
            (&[X, Z], &[-3, 1], &[2.0, -1.0], "A1 along −z turned"),
            (&[X, Z], &[0, 0], &[1.0, 2.0], ""),
            // a sensor mounted upside down whose labels number its channels, and one whose labels
            // are the plan's axes
            (&[X, [0.0, -1.0, 0.0], DOWN], &[1, 2, 3], &[1.0, 2.0, 3.0], "own channels"),
            (&[X, [0.0, -1.0, 0.0], DOWN], &[1, -2, -3], &[1.0, 2.0, 3.0], ""),
            (&[X, [0.0, -1.0, 0.0], DOWN], &[1, -2, 3], &[1.0, 2.0, -3.0], "A1 along +z turned"),
            (&[SLANTED], &[3], &[1.0], "no label can name"),
            (&[SLANTED], &[-1], &[-1.0], "A1 along −x turned"),
        ] {
            let (found, told) = turned(axes, own).expect("no contradiction");
            assert_eq!(found, wanted, "{axes:?} {own:?}");
            assert!(told.contains(word) && (word.is_empty() == told.is_empty()), "{axes:?} {own:?}: {told}");
        }
        for (axes, own) in
            [(&[Z][..], &[1][..]), (&[X, Z], &[1, 2]), (&[X, Y, Z], &[1, 2, 0]), (&[X, Y, Z], &[1, 1, 3])]
        {
            let said = turned(axes, own).expect_err("a contradiction");
            assert!(said.contains("A1") && said.contains("the plan has it along"), "{said}");
        }
    }

    #[test]
    fn a_hammer_told_the_other_way_is_turned_where_it_pushes_the_plans_way() {
        let with = |label: i64, force: f64, push: [f64; 3]| {
            let mut records = hit(force, 1);
            let place = PlannedPlace { impact: "AZ1", push, response: "A1", axes: &[Z], own_axes: true };
            let told = labels(label, &[3]).to_plan(&mut records, &mut [0.0], &place);
            told.map(|told| (records.force_n[0][1], told.join("; ")))
        };
        assert_eq!(with(-3, 20.0, DOWN), Ok((20.0, String::new())));
        assert_eq!(with(0, 20.0, DOWN), Ok((20.0, String::new())));
        assert_eq!(with(3, -20.0, DOWN), Ok((20.0, "AZ1 along +z turned".into())));
        assert!(with(3, 20.0, SLANTED).expect("no label can say it").1.contains("(0.6, 0.8, 0)"));
        for (label, force, push, word) in [(3, 20.0, DOWN, "−z"), (1, 20.0, DOWN, "−z"), (-3, 20.0, X, "+x")]
        {
            let said = with(label, force, push).expect_err("a contradiction");
            assert!(said.contains("AZ1") && said.contains(word), "{said}");
        }
    }
}
