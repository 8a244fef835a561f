//! The order in which a transform leaves its lines: piece by piece, of which each holds the lines that are alike modulo their number.

use std::ops::Range;

/// Lines in the order of so many pieces: line l is number l / pieces of piece l modulo pieces.
#[derive(Clone)]
pub(super) struct Order {
    pieces: usize,
    lines: Range<usize>,
}

impl Order {
    pub(super) fn of(pieces: usize, lines: Range<usize>) -> Order {
        Order { pieces, lines }
    }

    pub(super) fn pieces(&self) -> usize {
        self.pieces
    }

    /// The lines.
    pub(super) fn lines(&self) -> Range<usize> {
        self.lines.clone()
    }

    /// How many lines there are.
    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    /// Which of a piece's lines are among these, by their number in the piece.
    pub(super) fn within(&self, piece: usize) -> Range<usize> {
        let number = |line: usize| line.saturating_sub(piece).div_ceil(self.pieces);
        number(self.lines.start)..number(self.lines.end)
    }

    /// Where values of these lines of a piece are among the values of all lines in this order.
    pub(super) fn places(&self, piece: usize, within: &Range<usize>) -> Range<usize> {
        let before: usize = (0..piece).map(|piece| self.within(piece).len()).sum();
        let first = before + within.start - self.within(piece).start;
        first..first + within.len()
    }

    /// Values in this order, by rising line.
    pub(super) fn by_line<T: Clone>(&self, values: &[T]) -> Vec<T> {
        let pieces: Vec<(usize, &[T])> = (0..self.pieces)
            .map(|piece| {
                let within = self.within(piece);
                (within.start, &values[self.places(piece, &within)])
            })
            .collect();
        let value = |line: usize| {
            let (first, values) = pieces[line % self.pieces];
            values[line / self.pieces - first].clone()
        };
        self.lines.clone().map(value).collect()
    }

    /// Of values in this order, those of `fewer` lines in the order of these.
    pub(super) fn only<T: Copy>(&self, fewer: &Order, values: &[T]) -> Vec<T> {
        (0..self.pieces)
            .flat_map(|piece| &values[self.places(piece, &fewer.within(piece))])
            .copied()
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_has_its_place_and_is_found_there() {
        for pieces in [1, 3, 8] {
            let all = Order::of(pieces, 0..30);
            let mut ordered: Vec<usize> = (0..30).collect();
            ordered.sort_by_key(|line| (line % pieces, *line));
            assert_eq!(all.by_line(&ordered), (0..30).collect::<Vec<_>>());
            for (start, end) in (0..=30).flat_map(|start| (start..=30).map(move |end| (start, end))) {
                let band = Order::of(pieces, start..end);
                let own = all.only(&band, &ordered);
                assert_eq!(own.len(), band.len());
                assert_eq!(band.by_line(&own), (start..end).collect::<Vec<_>>());
            }
        }
    }
}
