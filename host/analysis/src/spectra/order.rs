//! The order in which a transform leaves its lines: in stretches, each from one piece, in which
//! line numbers advance by a constant step.

use super::pieces::{PARTS, PIECES};
use std::ops::Range;

/// The lines of a transform in the order in which they are computed.
#[derive(Clone)]
pub(super) struct Order {
    samples: usize,
    stretches: &'static [Stretch],
    lines: Range<usize>,
}

/// Consecutive lines of one piece.
#[derive(Clone, Copy)]
pub(super) struct Stretch {
    /// Index of the piece.
    pub(super) piece: usize,
    /// Element k of the piece is line `step` k + piece.
    step: usize,
    /// If true, it is instead line N − (`step` k + piece): the piece holds its conjugate.
    pub(super) mirrored: bool,
}

/// For a transform computed as a whole.
const WHOLE: [Stretch; 1] = [Stretch { piece: 0, step: 1, mirrored: false }];

/// For a transform computed in [pieces](super::pieces).
const IN_PIECES: [Stretch; 2 * PIECES - 1] = {
    let zero = Stretch { piece: 0, step: PARTS / 2, mirrored: false };
    let mut all = [zero; 2 * PIECES - 1];
    let mut piece = 1;
    while piece < PIECES {
        all[2 * piece - 1] = Stretch { piece, step: PARTS, mirrored: false };
        all[2 * piece] = Stretch { piece, step: PARTS, mirrored: true };
        piece += 1;
    }
    all
};

impl Order {
    /// These lines of the transform of `samples` samples.
    pub(super) fn of(samples: usize, in_pieces: bool, lines: Range<usize>) -> Order {
        Order { samples, stretches: if in_pieces { &IN_PIECES } else { &WHOLE }, lines }
    }

    /// The stretches, in their order.
    pub(super) fn stretches(&self) -> &'static [Stretch] {
        self.stretches
    }

    /// The lines.
    pub(super) fn lines(&self) -> Range<usize> {
        self.lines.clone()
    }

    /// Number of lines.
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    /// The elements of a stretch's piece that belong to these lines.
    pub(super) fn within(&self, stretch: usize) -> Range<usize> {
        let Stretch { piece, step, mirrored } = self.stretches[stretch];
        let Range { start, end } = self.lines;
        if mirrored {
            // largest k for which N − (step k + piece) ≥ line
            let until = |line: usize| (self.samples - piece - line) / step + 1;
            until(end)..until(start)
        } else {
            let from = |line: usize| line.saturating_sub(piece).div_ceil(step);
            from(start)..from(end)
        }
    }

    /// Positions of these elements of a stretch among the values of all lines in this order.
    pub(super) fn places(&self, stretch: usize, within: &Range<usize>) -> Range<usize> {
        let before: usize = (0..stretch).map(|stretch| self.within(stretch).len()).sum();
        let first = before + within.start - self.within(stretch).start;
        first..first + within.len()
    }

    /// The stretch of a line, and the position of its value among the values of all lines in this
    /// order.
    fn place(&self, line: usize) -> Option<(&Stretch, usize)> {
        self.stretches.iter().enumerate().find_map(|(number, stretch)| {
            let Stretch { piece, step, mirrored } = stretch;
            let turned = if *mirrored { self.samples.checked_sub(line)? } else { line };
            let beyond = turned.checked_sub(*piece).filter(|beyond| beyond.is_multiple_of(*step))?;
            let k = beyond / step;
            let among = self.within(number).contains(&k);
            among.then(|| (stretch, self.places(number, &(k..k + 1)).start))
        })
    }

    /// Converts values in this order to the order of rising lines.
    pub(super) fn by_line<T: Clone>(&self, values: &[T]) -> Vec<T> {
        // for lines that are equal modulo PARTS, positions advance by a constant step
        let mut cursors = [(0, 0); PARTS];
        for line in self.lines().take(PARTS) {
            if let Some((stretch, place)) = self.place(line) {
                let step = (PARTS / stretch.step).cast_signed();
                cursors[line % PARTS] = (place, if stretch.mirrored { -step } else { step });
            }
        }
        let value = |line: usize| {
            let (place, step) = &mut cursors[line % PARTS];
            let value = values[*place].clone();
            *place = place.wrapping_add_signed(*step);
            value
        };
        self.lines().map(value).collect()
    }

    /// From values in this order, those of `fewer` lines, in the order of `fewer`.
    pub(super) fn only<T: Copy>(&self, fewer: &Order, values: &[T]) -> Vec<T> {
        (0..self.stretches.len())
            .flat_map(|stretch| &values[self.places(stretch, &fewer.within(stretch))])
            .copied()
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_has_its_place_and_is_found_there() {
        for (samples, in_pieces) in
            [(1, false), (58, false), (59, false), (16, true), (48, true), (112, true)]
        {
            let lines = samples / 2 + 1;
            let all = Order::of(samples, in_pieces, 0..lines);
            // position of each line
            let mut ordered = vec![usize::MAX; lines];
            for line in 0..lines {
                let (_, place) = all.place(line).expect("a line");
                assert_eq!(ordered[place], usize::MAX, "line {line}");
                ordered[place] = line;
            }
            assert_eq!(all.by_line(&ordered), (0..lines).collect::<Vec<_>>());
            for (start, end) in (0..=lines).flat_map(|start| (start..=lines).map(move |end| (start, end))) {
                let band = Order::of(samples, in_pieces, start..end);
                let own = all.only(&band, &ordered);
                assert_eq!(own.len(), band.len());
                assert_eq!(band.by_line(&own), (start..end).collect::<Vec<_>>());
            }
        }
    }
}
