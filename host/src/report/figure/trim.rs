//! Trims curves to what their panel can show, since nothing beyond the full range of an axis is
//! visible.

use super::{Along, Mark, Packed, Panel, Shape};

impl Panel {
    /// Removes the points of curves that lie beyond the horizontal axis; one point on each side is
    /// kept, so that lines extend to the frame.
    pub fn trim(&mut self) {
        let range = self.x.range;
        for mark in &mut self.marks {
            mark.trim(range);
        }
    }
}

impl Mark {
    fn trim(&mut self, [low, high]: [f64; 2]) {
        let cut = |x: &mut Along, lists: [Option<&mut Packed>; 2]| {
            let inside = |i: &usize| (low..=high).contains(&x.at(*i));
            let (first, last) = ((0..x.len()).find(inside), (0..x.len()).rfind(inside));
            let Some((first, last)) = first.zip(last) else { return };
            let (from, to) = (first.saturating_sub(1), (last + 2).min(x.len()));
            for list in lists.into_iter().flatten() {
                let end = to.min(list.0.len());
                list.0 = list.0[from.min(end)..end].to_vec();
            }
            match x {
                Along::Regular { first, step, count } => {
                    (*first, *count) = (*first + *step * from as f64, to - from);
                }
                Along::List(values) => values.0 = values.0[from..to].to_vec(),
            }
        };
        match &mut self.shape {
            Shape::Line { x, y } => cut(x, [Some(y), None]),
            Shape::Ribbon { x, low, high } => cut(x, [Some(low), Some(high)]),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Axis, Role};
    use super::*;

    #[test]
    fn what_is_beyond_the_axis_is_left_out() {
        let along = Along::Regular { first: 10.0, step: 0.5, count: 100 };
        let line = Mark::line(Role::Measured, along, (0..100).map(f64::from));
        let axis = |range| Axis::linear("f", "Hz", range);
        let mut panel = Panel::new(axis([20.0, 30.0]), axis([0.0, 1.0])).with(line.clone());
        panel.trim();
        let Shape::Line { x, y } = &panel.marks[0].shape else { panic!("a line") };
        assert_eq!((x.at(0), x.len(), y.0[0], y.0.len()), (19.5, 23, 19.0, 23));
        let mut whole = Panel::new(axis([0.0, 100.0]), axis([0.0, 1.0])).with(line.clone());
        whole.trim();
        assert_eq!(whole.marks[0], line);
    }
}
