//! The transform of a windowed record, as a whole or in pieces, with the lines in the order in
//! which they are computed.
//!
//! **As a whole**, a real record is transformed by a complex one of half its length: even samples
//! are the real parts, odd ones the imaginary parts. The lines are separated only where they are
//! read, which saves a pass through memory. With Z the transform of half the length M = N/2, X(k) =
//! ½ (Z(k) + Z*(M−k)) − ½ i e^(−i2πk/N) (Z(k) − Z*(M−k)).
//!
//! **In pieces**, one long transform of a real record is computed as eight short ones, because a
//! long transform and its factors do not fit into a core's fastest cache, and a piece does. One
//! pass over the sixteen parts of the record is needed, after which each piece is independent. For
//! N samples x(n) and q = N/16, piece p is y_p(j) = e^(−i2πpj/N) Σ_r e^(−i2πpr/16) x(j + rq), and
//! its transform holds X(16k + p) at k (decimation in frequency). Pieces 1 to 7 also contain the
//! mirrored lines 16k − p, because X(N − l) = X*(l). The remaining lines, every eighth one, form
//! the transform of a real record of an eighth of the length, Σ_r x(j + 2rq): this is piece 0.
//!
//! A transform leaves its lines in stretches, each from one piece, in which line numbers advance by
//! a constant step, and writes them to a destination. The window's weights are applied while
//! reading the samples. Scratch buffers are reused, because fresh memory costs as much as a
//! transform's first pass over it. Plans are kept for each recurring length, because computing a
//! plan's factors takes longer than a transform.

use super::SpectraError;
use super::window::{RUN, ResponseWeighting};
use crate::C;
use crate::vectors::{all_finite, wide};
use bytemuck::cast_slice_mut;
use num_complex::Complex;
use pulp::{NullaryFnOnce, bytemuck};
use realfft::{RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::array::from_fn;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::ops::{Deref, DerefMut, Range};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// A plan for records of one length.
pub(super) struct RecordTransform {
    samples: usize,
    /// For a record that is transformed in pieces.
    pieces: Option<Pieces>,
    /// For piece 0, or for the whole record.
    real: HalfLength,
}

static KEPT: Mutex<Vec<Arc<RecordTransform>>> = Mutex::new(Vec::new());
/// Number of plans kept.
const PLANS: usize = 8;
/// Number of samples from which pieces are faster: shorter transforms fit into the cache as a
/// whole.
const LONG: usize = 1 << 15;

impl RecordTransform {
    /// Returns a plan; plans are kept, since the same lengths recur.
    pub(super) fn of(samples: usize) -> Arc<RecordTransform> {
        // the list is valid even after a poisoned lock
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(plan) = kept.iter().find(|plan| plan.samples == samples) {
            return plan.clone();
        }
        let in_pieces = samples >= LONG && samples.is_multiple_of(PARTS);
        let plan = Arc::new(Self::planned(samples, in_pieces));
        if kept.len() == PLANS {
            kept.remove(0);
        }
        kept.push(plan.clone());
        plan
    }

    fn planned(samples: usize, in_pieces: bool) -> RecordTransform {
        RecordTransform {
            samples,
            pieces: in_pieces.then(|| Pieces::of(samples)),
            real: HalfLength::of(if in_pieces { samples / PIECES } else { samples }),
        }
    }

    /// Number of lines of a record's spectrum.
    pub(super) fn lines(&self) -> usize {
        self.samples / 2 + 1
    }

    /// The order in which these lines are computed.
    pub(super) fn order(&self, lines: Range<usize>) -> Order {
        Order::of(self.samples, self.pieces.is_some(), lines)
    }

    /// Transforms a record, zero-padded to the plan's length, and passes the lines of an
    /// [order](RecordTransform::order) to `to`.
    ///
    /// # Errors
    /// A value that is not finite; then no line was passed.
    #[inline(never)]
    pub(super) fn transform(
        &self,
        record: Windowed<'_>,
        order: &Order,
        to: &mut impl Lines,
    ) -> Result<(), SpectraError> {
        if self.samples == 0 {
            let within = order.within(0);
            to.take(0, within.clone(), [C::default()][within].iter().copied());
            return Ok(());
        }
        let fft = &self.real.fft;
        let points = fft.len();
        let mut scratch = Scratch::of(fft.get_inplace_scratch_len());
        let mut spectrum = Scratch::of(points * if self.pieces.is_some() { PIECES } else { 1 });
        if let Some(pieces) = &self.pieces {
            pieces.write(record, &mut spectrum);
        } else {
            record.write(0, &mut cast_slice_mut(&mut spectrum)[..self.samples]);
            self.real.pack(&mut spectrum);
        }
        let mut stretches = order.stretches().iter().enumerate().peekable();
        for (piece, own) in spectrum.chunks_exact_mut(points).enumerate() {
            fft.process_with_scratch(own, &mut scratch);
            if piece == 0 {
                self.check(record, own[0])?;
                stretches.next();
                self.real.read(own, order.within(0), to);
            }
            while let Some((number, stretch)) = stretches.next_if(|(_, stretch)| stretch.piece == piece) {
                let within = order.within(number);
                let own = own[within.clone()].iter();
                if stretch.mirrored {
                    to.take(number, within, own.map(Complex::conj));
                } else {
                    to.take(number, within, own.copied());
                }
            }
        }
        Ok(())
    }

    /// Every sample contributes to the first point of the spectrum, so a value that is not finite
    /// shows there.
    fn check(&self, record: Windowed<'_>, first: C) -> Result<(), SpectraError> {
        if (first.re + first.im).is_finite() {
            return Ok(());
        }
        let mut samples = vec![0.0; self.samples];
        record.write(0, &mut samples);
        check_finite(&samples)?;
        Err(SpectraError::Transform("the sum of the samples is beyond an f64".into()))
    }
}

/// Refuses NaN and infinite values, naming the first.
pub(super) fn check_finite(signal: &[f64]) -> Result<(), SpectraError> {
    if all_finite(signal) {
        return Ok(());
    }
    let sample = signal.iter().position(|v| !v.is_finite()).unwrap_or(0);
    Err(SpectraError::NotFinite { sample })
}

/// A plan for records of one length.
pub(super) struct HalfLength {
    samples: usize,
    /// Transform of the points that [`HalfLength::pack`] makes.
    pub(super) fft: Arc<dyn Fft<f64>>,
    /// ½ e^(−i2πk/N) of lines k; empty for a record of odd length, which is transformed as a whole.
    twiddles: Vec<C>,
}

static PLANNER: LazyLock<Mutex<FftPlanner<f64>>> = LazyLock::new(|| Mutex::new(FftPlanner::new()));

impl HalfLength {
    pub(super) fn of(samples: usize) -> HalfLength {
        let even = samples.is_multiple_of(2);
        let points = if even { samples / 2 } else { samples };
        // the planner is valid even after a poisoned lock
        let fft = PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(points);
        let twiddle = |k: usize| C::cis(-2.0 * PI * k as f64 / samples as f64) * 0.5;
        let twiddles = if even { (0..points).map(twiddle).collect() } else { Vec::new() };
        HalfLength { samples, fft, twiddles }
    }

    /// Converts the samples at the start of the buffer to points: two samples per point, or one.
    pub(super) fn pack(&self, points: &mut [C]) {
        if self.fft.len() == self.samples {
            // backwards, so that no sample is overwritten before it is read
            for i in (0..self.samples).rev() {
                let samples: &[f64] = bytemuck::cast_slice(points);
                points[i] = C::from(samples[i]);
            }
        }
    }

    /// Passes these lines of the transformed points to `to`, as those of its first stretch.
    pub(super) fn read(&self, spectrum: &[C], within: Range<usize>, to: &mut impl Lines) {
        let points = spectrum.len();
        let part = |from: usize, until: usize| {
            from.clamp(within.start, within.end)..until.clamp(within.start, within.end)
        };
        if points == self.samples {
            // the mean is real
            to.take(0, part(0, 1), [C::from(spectrum[0].re)].iter().copied());
            let rest = part(1, within.end);
            return to.take(0, rest.clone(), spectrum[rest].iter().copied());
        }
        // the two ends are real
        let Complex { re, im } = spectrum[0];
        to.take(0, part(0, 1), [C::from(re + im)].iter().copied());
        let between = part(1, points);
        if !between.is_empty() {
            let mirrored = &spectrum[points + 1 - between.end..points + 1 - between.start];
            let own = spectrum[between.clone()].iter().zip(mirrored.iter().rev());
            let own = own.zip(&self.twiddles[between.clone()]);
            let taken_apart = own.map(|((z, mirrored), twiddle)| {
                let (sum, difference) = (z + mirrored, z - mirrored);
                let turned_re = sum.im * twiddle.re + difference.re * twiddle.im;
                let turned_im = sum.im * twiddle.im - difference.re * twiddle.re;
                C::new(0.5 * sum.re + turned_re, 0.5 * difference.im + turned_im)
            });
            to.take(0, between, taken_apart);
        }
        to.take(0, part(points, points + 1), [C::from(re - im)].iter().copied());
    }
}

/// Number of pieces of a transform.
pub(super) const PIECES: usize = 8;

/// Number of parts of a record.
pub(super) const PARTS: usize = 16;

/// cos π/8 and sin π/8.
const COS: f64 = 0.923_879_532_511_286_7;
const SIN: f64 = 0.382_683_432_365_089_8;

/// Samples of each part that are folded together: those of all parts fit into half of a core's
/// first-level cache.
const BLOCK: usize = 128;
const _: () = assert!(BLOCK <= RUN, "weights are known for a run at a time");

/// The twiddle factors for one length.
pub(super) struct Pieces {
    /// e^(−i2πj/N); the factors of the other pieces are products of these.
    factors: Vec<C>,
}

impl Pieces {
    /// For a record of `samples` samples, a multiple of sixteen.
    pub(super) fn of(samples: usize) -> Pieces {
        let angle = |j: usize| -2.0 * PI * j as f64 / samples as f64;
        Pieces { factors: (0..samples / PARTS).map(|j| C::cis(angle(j))).collect() }
    }

    /// Writes the pieces of a record; two samples of piece 0 form one point.
    pub(super) fn write(&self, record: Windowed<'_>, pieces: &mut [C]) {
        let q = self.factors.len();
        let (zero, complex) = pieces.split_at_mut(q);
        let (zero, zero_later) = bytemuck::cast_slice_mut(zero).split_at_mut(q);
        let mut complex = complex.chunks_exact_mut(q);
        let mut complex: [&mut [C]; PIECES - 1] = from_fn(|_| complex.next().unwrap_or_default());
        let mut gathered = [0.0; PARTS * BLOCK];
        for start in (0..q).step_by(BLOCK) {
            let block = start..q.min(start + BLOCK);
            let in_record: [usize; PARTS] = from_fn(|part| part * q + start);
            let direct = in_record.iter().all(|at| record.weights(*at, block.len()).is_some());
            let (from, at) = if direct {
                (record, in_record)
            } else {
                for (at, own) in in_record.into_iter().zip(gathered.chunks_exact_mut(BLOCK)) {
                    record.write(at, &mut own[..block.len()]);
                }
                (Windowed::plain(&gathered), from_fn(|part| part * BLOCK))
            };
            let weights = at.map(|at| from.weights(at, block.len()).expect("samples of one kind"));
            wide(Fold {
                samples: from.samples(),
                at,
                places: from.places(),
                weights,
                factors: &self.factors[block.clone()],
                zero: &mut zero[block.clone()],
                zero_later: &mut zero_later[block.clone()],
                complex: complex.each_mut().map(|piece| &mut piece[block.clone()]),
            });
        }
    }
}

/// One block of every part, and its destination in every piece.
struct Fold<'a> {
    samples: &'a [f64],
    /// Start of each part's block.
    at: [usize; PARTS],
    places: &'a [f64],
    /// The weight of each part is this number times the entries of `places` from this index on.
    weights: [(f64, usize); PARTS],
    factors: &'a [C],
    zero: &'a mut [f64],
    zero_later: &'a mut [f64],
    /// Destinations in pieces 1 to 7.
    complex: [&'a mut [C]; PIECES - 1],
}

impl NullaryFnOnce for Fold<'_> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        let Fold { samples, at, places, weights, factors, .. } = self;
        let [p1, p2, p3, p4, p5, p6, p7] = self.complex;
        fold(
            (samples, at),
            (places, weights),
            factors,
            self.zero,
            self.zero_later,
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
            p7,
        );
    }
}

/// These are arguments rather than fields because the compiler assumes only for arguments that they
/// do not alias; otherwise it adds one number at a time.
#[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
#[expect(clippy::too_many_arguments, reason = "see above")]
#[inline(always)]
fn fold(
    (samples, at): (&[f64], [usize; PARTS]),
    (places, weights): (&[f64], [(f64, usize); PARTS]),
    factors: &[C],
    zero: &mut [f64],
    zero_later: &mut [f64],
    p1: &mut [C],
    p2: &mut [C],
    p3: &mut [C],
    p4: &mut [C],
    p5: &mut [C],
    p6: &mut [C],
    p7: &mut [C],
) {
    let count = factors.len();
    let x: [&[f64]; PARTS] = from_fn(|part| &samples[at[part]..][..count]);
    let weight: [&[f64]; PARTS] = from_fn(|part| &places[weights[part].1..][..count]);
    let scale = weights.map(|(scale, _)| scale);
    let (zero, zero_later) = (&mut zero[..count], &mut zero_later[..count]);
    let (p1, p2, p3, p4) = (&mut p1[..count], &mut p2[..count], &mut p3[..count], &mut p4[..count]);
    let (p5, p6, p7) = (&mut p5[..count], &mut p6[..count], &mut p7[..count]);
    for j in 0..count {
        let x = |part: usize| x[part][j] * (scale[part] * weight[part][j]);
        // sums and differences of parts half a record apart: even pieces are made of sums, odd ones
        // of differences
        let apart = |part: usize| {
            let (one, other) = (x(part), x(part + PARTS / 2));
            (one + other, one - other)
        };
        let ((s0, d0), (s1, d1), (s2, d2), (s3, d3)) = (apart(0), apart(1), apart(2), apart(3));
        let ((s4, d4), (s5, d5), (s6, d6), (s7, d7)) = (apart(4), apart(5), apart(6), apart(7));
        let f1 = factors[j];
        let f2 = f1 * f1;
        let (f3, f4) = (f2 * f1, f2 * f2);

        let (a0, a1, a2, a3) = (s0 + s4, s1 + s5, s2 + s6, s3 + s7);
        let (b0, b1, b2, b3) = (s0 - s4, s1 - s5, s2 - s6, s3 - s7);
        zero[j] = a0 + a2;
        zero_later[j] = a1 + a3;
        let (less, more) = (FRAC_1_SQRT_2 * (b1 - b3), FRAC_1_SQRT_2 * (b1 + b3));
        p2[j] = C::new(b0 + less, -(b2 + more)) * f2;
        p4[j] = C::new(a0 - a2, a3 - a1) * f4;
        p6[j] = C::new(b0 - less, b2 - more) * (f4 * f2);

        // e^(−iπpr/8) of parts r and 8 − r differ only in the sign of the real part
        let (u1, u2, u3) = (d1 - d7, FRAC_1_SQRT_2 * (d2 - d6), d3 - d5);
        let (v1, v2, v3) = (d1 + d7, FRAC_1_SQRT_2 * (d2 + d6), d3 + d5);
        let (near, far) = (d0 + u2, d0 - u2);
        let (late, early) = (v2 + d4, v2 - d4);
        let (outer, inner) = (COS * u1 + SIN * u3, SIN * u1 - COS * u3);
        let (steep, flat) = (SIN * v1 + COS * v3, COS * v1 - SIN * v3);
        p1[j] = C::new(near + outer, -(steep + late)) * f1;
        p3[j] = C::new(far + inner, -(flat + early)) * f3;
        p5[j] = C::new(far - inner, early - flat) * (f4 * f1);
        p7[j] = C::new(near - outer, late - steep) * (f4 * f3);
    }
}

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

/// For a transform computed in [pieces](super::fft).
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

/// Idle buffers, the most recently returned last.
static IDLE: Mutex<Vec<Vec<C>>> = Mutex::new(Vec::new());

/// Largest total size of idle buffers, complex numbers: 32 MB.
const KEPT_AT_MOST: usize = 1 << 21;

/// A buffer that returns to the pool when dropped. Its initial contents are arbitrary.
pub(super) struct Scratch(Vec<C>);

impl Scratch {
    /// A buffer of `count` numbers.
    pub(super) fn of(count: usize) -> Scratch {
        // the list is valid even after a poisoned lock
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        let place = idle.iter().rposition(|piece| piece.len() == count);
        let piece = place.map(|place| idle.remove(place));
        drop(idle);
        Scratch(piece.unwrap_or_else(|| vec![C::default(); count]))
    }

    /// A buffer of `count` zeros.
    pub(super) fn zeros(count: usize) -> Scratch {
        let mut own = Scratch::of(count);
        own.fill(C::default());
        own
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let own = std::mem::take(&mut self.0);
        if own.is_empty() {
            return;
        }
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push(own);
        // drop the oldest first: their length may not be needed again
        while idle.iter().map(Vec::len).sum::<usize>() > KEPT_AT_MOST {
            idle.remove(0);
        }
    }
}

impl Deref for Scratch {
    type Target = [C];

    fn deref(&self) -> &[C] {
        &self.0
    }
}

impl DerefMut for Scratch {
    fn deref_mut(&mut self) -> &mut [C] {
        &mut self.0
    }
}

/// Receives the lines of a transform.
pub(super) trait Lines {
    /// Takes lines of a stretch, by their index in its piece, with one value each; called in a loop
    /// compiled for the processor in use.
    fn take(&mut self, stretch: usize, within: Range<usize>, values: impl Iterator<Item = C>);
}

/// Writes lines in their order.
pub(super) struct Put<'a> {
    pub(super) order: &'a Order,
    pub(super) out: &'a mut [C],
}

impl Lines for Put<'_> {
    #[inline]
    fn take(&mut self, stretch: usize, within: Range<usize>, values: impl Iterator<Item = C>) {
        let own = &mut self.out[self.order.places(stretch, &within)];
        wide(|| own.iter_mut().zip(values).for_each(|(own, value)| *own = value));
    }
}

/// A record times its window, followed by zeros.
#[derive(Clone, Copy)]
pub struct Windowed<'a> {
    samples: &'a [f64],
    weighting: Option<&'a ResponseWeighting<'a>>,
}

/// Weights of a record without a window.
static ONES: [f64; RUN] = [1.0; RUN];

impl<'a> Windowed<'a> {
    /// A record without a window.
    pub fn plain(samples: &'a [f64]) -> Self {
        Windowed { samples, weighting: None }
    }

    /// A response, SI, with its window.
    pub fn response(samples: &'a [f64], weighting: &'a ResponseWeighting<'a>) -> Self {
        Windowed { samples, weighting: Some(weighting) }
    }

    /// Writes the windowed samples from `first` on into `out`.
    pub(super) fn write(self, first: usize, out: &mut [f64]) {
        if let Some(weighting) = self.weighting {
            return weighting.response_into(self.samples, first, out);
        }
        let kept = self.samples.len().saturating_sub(first).min(out.len());
        let (out, beyond) = out.split_at_mut(kept);
        out.copy_from_slice(self.samples.get(first..first + kept).unwrap_or_default());
        beyond.fill(0.0);
    }

    /// The samples without their weights.
    pub(super) fn samples(self) -> &'a [f64] {
        self.samples
    }

    /// Weights that are common to all runs of the window.
    pub(super) fn places(self) -> &'a [f64] {
        self.weighting.map_or(&ONES, ResponseWeighting::places)
    }

    /// The weights of `count` samples (up to [`RUN`]) from `first` on: a factor, and the index from
    /// which on it multiplies the [places](Windowed::places). `None` if the samples cannot be
    /// weighted uniformly.
    pub(super) fn weights(self, first: usize, count: usize) -> Option<(f64, usize)> {
        if first + count > self.samples.len() {
            return None;
        }
        self.weighting.map_or(Some((1.0, 0)), |weighting| weighting.weights(first))
    }
}

static REAL_PLANNER: LazyLock<Mutex<RealFftPlanner<f64>>> =
    LazyLock::new(|| Mutex::new(RealFftPlanner::new()));

/// The transform of records of `samples` samples. Plans are never discarded, so it is meant for a
/// small number of lengths.
pub(crate) fn forward(samples: usize) -> Arc<dyn RealToComplex<f64>> {
    // the planner is valid even after a poisoned lock
    REAL_PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(samples)
}

#[cfg(test)]
mod tests {
    use super::super::window::{ForceWeighting, Windowing};
    use super::Put;
    use super::forward;
    use super::*;
    use std::f64::consts::PI;

    fn record(samples: usize) -> Vec<f64> {
        let mut seed = samples as u64;
        let mut dice = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        (0..samples).map(|_| dice()).collect()
    }

    fn lines(plan: &RecordTransform, record: &[f64], band: Range<usize>) -> Vec<C> {
        let order = plan.order(band);
        let mut found = vec![C::new(f64::NAN, f64::NAN); order.len()];
        let to = &mut Put { order: &order, out: &mut found };
        plan.transform(Windowed::plain(record), &order, to).expect("numbers");
        order.by_line(&found)
    }

    /// All methods available for records of this many samples.
    fn plans(samples: usize) -> Vec<RecordTransform> {
        let pieces = samples.is_multiple_of(PARTS);
        [false, true]
            .into_iter()
            .filter(|way| pieces || !way)
            .map(|way| RecordTransform::planned(samples, way))
            .collect()
    }

    #[test]
    fn lines_are_the_sums_that_define_them() {
        for samples in (1..=24).chain([32, 36, 60, 80, 96, 97, 98]) {
            let record = record(samples);
            for (plan, k) in plans(samples).iter().flat_map(|plan| (0..=samples / 2).map(move |k| (plan, k)))
            {
                let turn = |n: usize| C::cis(-2.0 * PI * (k * n % samples) as f64 / samples as f64);
                let sum: C = record.iter().enumerate().map(|(n, x)| x * turn(n)).sum();
                let found = lines(plan, &record, 0..samples / 2 + 1)[k];
                // rounding of a sum of 98 numbers up to 1
                assert!((found - sum).norm() < 1e-13, "{samples} samples, line {k}: {found} for {sum}");
            }
        }
    }

    #[test]
    fn a_band_is_the_same_lines_wherever_it_begins_and_ends() {
        for samples in (1..=24).chain([100, 101, 102, 304]) {
            let record = record(samples);
            for plan in plans(samples) {
                let all = plan.lines();
                let whole = lines(&plan, &record, 0..all);
                for (first, end) in (0..=all).flat_map(|first| (first..=all).map(move |end| (first, end))) {
                    let found = lines(&plan, &record, first..end);
                    assert_eq!(found, whole[first..end], "{samples} samples, lines {first} to {end}");
                }
            }
        }
    }

    #[test]
    fn they_are_as_exact_as_those_of_the_library() {
        for samples in [1_000, 1_001, 1_024, 3_000, 32_768, 51_200, 102_400, 102_402] {
            let (record, plan) = (record(samples), forward(samples));
            let mut whole = plan.make_output_vec();
            plan.process(&mut record.clone(), &mut whole).expect("lengths fit");
            let power: f64 = whole.iter().map(C::norm_sqr).sum();
            for plan in plans(samples) {
                let found = lines(&plan, &record, 0..plan.lines());
                let off: f64 = found.iter().zip(&whole).map(|(a, b)| (a - b).norm_sqr()).sum();
                // the relative precision of an f64 is 1.1e-16, and each pass of a transform adds a
                // little
                assert!((off / power).sqrt() < 1e-15, "{samples} samples: {:e}", (off / power).sqrt());
            }
        }
    }

    /// Blocks within the window, across its origin, and beyond the record's end, where zeros are
    /// added.
    #[test]
    fn a_window_applied_on_the_way_in_is_that_of_the_windowed_record() {
        let (samples, recorded) = (6_400, 5_003);
        let record = record(recorded);
        for force_weighting in [ForceWeighting::Exponential, ForceWeighting::Rectangular] {
            let window = Windowing { sigma_per_s: 3.0, force_weighting, ..Windowing::default() };
            let decay = window.decay(5120.0, recorded);
            let weighting = window.of_response(&decay, 0.21);
            let mut windowed = vec![0.0; samples];
            weighting.response_into(&record, 0, &mut windowed);
            for plan in plans(samples) {
                let order = plan.order(0..plan.lines());
                let mut found = vec![C::default(); order.len()];
                let to = &mut Put { order: &order, out: &mut found };
                plan.transform(Windowed::response(&record, &weighting), &order, to).expect("numbers");
                let whole = lines(&plan, &windowed, 0..plan.lines());
                let power: f64 = whole.iter().map(C::norm_sqr).sum();
                let off: f64 =
                    order.by_line(&found).iter().zip(&whole).map(|(a, b)| (a - b).norm_sqr()).sum();
                // weights are rounded twice instead of once
                assert!((off / power).sqrt() < 1e-15, "{force_weighting:?}: {:e}", (off / power).sqrt());
            }
        }
    }

    #[test]
    fn what_is_no_number_is_named() {
        for samples in [5, 8, 1 << 15] {
            let mut record = record(samples);
            record[3] = f64::INFINITY;
            let plan = RecordTransform::of(samples);
            let order = plan.order(0..plan.lines());
            let mut out = vec![C::default(); order.len()];
            let to = &mut Put { order: &order, out: &mut out };
            let found = plan.transform(Windowed::plain(&record), &order, to);
            assert_eq!(found, Err(SpectraError::NotFinite { sample: 3 }));
            assert_eq!(out, vec![C::default(); order.len()]);
        }
    }
}

#[cfg(test)]
mod order_tests {
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

#[cfg(test)]
mod lent_tests {
    use super::*;

    #[test]
    fn memory_is_lent_again_and_only_so_much_of_it_kept() {
        let quarter = KEPT_AT_MOST / 4;
        drop((0..9).map(|i| Scratch::of(quarter + i)).collect::<Vec<_>>());
        assert!(IDLE.lock().expect("whole").iter().map(Vec::len).sum::<usize>() <= KEPT_AT_MOST);
        let piece = Scratch::of(quarter + 100);
        let place = piece.as_ptr();
        drop(piece);
        let lengths: Vec<usize> = IDLE.lock().expect("whole").iter().map(Vec::len).collect();
        assert!(lengths.contains(&(quarter + 100)), "{lengths:?}");
        let again = Scratch::of(quarter + 100);
        assert_eq!((again.len(), again.as_ptr()), (quarter + 100, place));
        assert_eq!(Scratch::of(0).len(), 0);
    }
}

#[cfg(test)]
mod windowed_tests {
    use super::super::window::Windowing;
    use super::*;

    #[test]
    fn weights_are_what_is_written() {
        let record: Vec<f64> = (0..3000).map(|i| f64::from(i) + 1.0).collect();
        let window = Windowing { sigma_per_s: 4.0, ..Windowing::default() };
        let decay = window.decay(1000.0, record.len());
        let weighting = window.of_response(&decay, 0.1);
        for record in [Windowed::plain(&record), Windowed::response(&record, &weighting)] {
            for first in [0, 1, 511, 512, 1000, 3000 - RUN] {
                let mut written = [f64::NAN; RUN];
                record.write(first, &mut written);
                let (scale, place) = record.weights(first, RUN).expect("of one kind");
                let places = &record.places()[place..][..RUN];
                for (i, (written, place)) in written.iter().zip(places).enumerate() {
                    let exact = record.samples()[first + i] * (scale * place);
                    // rounding of the weights, which after the end of a run are computed from
                    // different products
                    assert!((written - exact).abs() < 1e-14 * exact, "{}: {written} for {exact}", first + i);
                }
            }
            assert_eq!(record.weights(3000 - RUN + 1, RUN), None);
            let mut beyond = [f64::NAN; 4];
            record.write(2998, &mut beyond);
            assert!(beyond[..2].iter().all(|x| *x != 0.0) && beyond[2..] == [0.0; 2], "{beyond:?}");
            record.write(4000, &mut beyond);
            assert_eq!(beyond, [0.0; 4]);
        }
    }
}
