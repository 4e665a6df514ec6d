//! The rows that hold with equality, and an orthogonal factorisation of them.
//!
//! In the normalised deviations v the problem reads: minimise |v|^2 / 2 subject to
//! alpha_j'v >= beta_j. Over a working set W the multipliers solve G lambda = beta with
//! G = W W' + D, where D holds the compliance 1/quadratic of rows with a quadratic price (the
//! excess of such a row is one more deviation, of its own). The factorisation is
//! [W sqrt(D)] = L [Q E] with orthonormal rows [Q E] and lower triangular L, so G = L L'. It
//! grows by orthogonalising the new row twice, which is enough (Daniel, Gragg, Kaufman and
//! Stewart 1976), and shrinks by rotations. E is never needed: it is L^-1 sqrt(D).

use crate::list::List;
use crate::model::Scalar;
use crate::products::in_vectors;
use crate::solution::ActiveRow;
use nalgebra::{SVector, convert};

/// Stages of a product that are summed up side by side: two vector registers of `f64`.
const LANES: usize = 4;

/// A row of the problem in terms of the normalised deviations v.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct Row<T: 'static, const NU: usize> {
    /// alpha: d(slack)/dv by stage, zero from `support` on.
    pub alpha: List<SVector<T, NU>>,
    /// Stages that the row depends on.
    pub support: usize,
    /// What else is known of it.
    pub terms: Terms<T>,
}

/// What is known of a row besides its normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Terms<T> {
    /// 1 / quadratic price for an elastic row, else 0.
    pub compliance: T,
    /// Largest multiplier: the linear price, or infinity.
    pub cap: T,
    /// May the multiplier have any sign?
    pub equality: bool,
    /// The row is the mirror image of an exceeded soft bound that is being taken back: its
    /// multiplier counts down from the cap.
    pub mirrored: bool,
    /// Stages that the row of Q at this place depends on: those of the rows up to here.
    pub support: u16,
    /// Length of alpha, with the elastic part; set when the row joins the working set.
    pub size: T,
    /// Which bound it is, and its multiplier in the row's own direction.
    pub active: ActiveRow<T>,
}

impl<T: Scalar> Terms<T> {
    pub fn empty() -> Self {
        Self {
            compliance: T::zero(),
            cap: T::zero(),
            equality: false,
            mirrored: false,
            support: 0,
            size: T::zero(),
            active: ActiveRow::empty(),
        }
    }

    /// The bound with its multiplier in its own direction.
    pub fn reported(&self) -> ActiveRow<T> {
        let multiplier = self.active.multiplier;
        ActiveRow {
            multiplier: if self.mirrored {
                self.cap - multiplier
            } else {
                multiplier
            },
            ..self.active
        }
    }
}

impl<T: Scalar, const NU: usize> Row<T, NU> {
    pub fn new(alpha: List<SVector<T, NU>>) -> Self {
        Self {
            alpha,
            support: 0,
            terms: Terms::empty(),
        }
    }

    /// alpha'v: the change of the slack that the deviations `v` make.
    pub fn dot(&self, v: &[SVector<T, NU>]) -> T {
        dot(first(&self.alpha, self.support), v)
    }
}

/// How the current minimiser answers to one more unit of a candidate row's multiplier.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct Direction<T: 'static, const NU: usize> {
    /// Change of v: the part of alpha that the working set does not span.
    pub primal: List<SVector<T, NU>>,
    /// The part that it spans, in terms of the orthonormal rows.
    coefficients: List<T>,
    /// The part of it that was found last.
    spanned: List<T>,
    /// Change of the working set's multipliers, with the opposite sign.
    pub dual: List<T>,
    /// Change of the candidate's slack, >= 0; 0 when the row depends on the working set.
    pub slope: T,
    /// Length of `primal` that rounding alone can make: a row that is closer to the span of the
    /// working set depends on it, up to a small relative change of the rows.
    pub noise: T,
    /// Length of alpha, with the elastic part.
    pub size: T,
    /// Stages that `primal` depends on.
    support: usize,
}

impl<T: Scalar, const NU: usize> Direction<T, NU> {
    pub fn new(primal: List<SVector<T, NU>>, [coefficients, spanned, dual]: [List<T>; 3]) -> Self {
        Self {
            primal,
            coefficients,
            spanned,
            dual,
            slope: T::zero(),
            noise: T::zero(),
            size: T::zero(),
            support: 0,
        }
    }
}

/// Rows that hold with equality, with their factorisation.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct WorkingSet<T: 'static, const NU: usize> {
    rows: List<Terms<T>>,
    /// Rows that there are places for in all lists.
    most: usize,
    /// L, row by row, each as long as `rows`.
    factor: List<T>,
    /// Q, row by row, each of `stages` entries.
    basis: List<SVector<T, NU>>,
    /// Length of the rows of Q.
    stages: usize,
    /// Stages that any row depends on.
    support: usize,
    len: usize,
}

impl<T: Scalar, const NU: usize> WorkingSet<T, NU> {
    pub fn new(
        (rows, most): (List<Terms<T>>, usize),
        factor: List<T>,
        (basis, stages): (List<SVector<T, NU>>, usize),
    ) -> Self {
        Self {
            rows,
            most,
            factor,
            basis,
            stages,
            support: 0,
            len: 0,
        }
    }

    pub fn clear(&mut self) {
        self.len = 0;
        self.support = 0;
    }

    pub fn is_full(&self) -> bool {
        self.len >= self.most
    }

    pub fn rows(&self) -> &[Terms<T>] {
        self.rows.get(..self.len).unwrap_or(&[])
    }

    pub fn rows_mut(&mut self) -> &mut [Terms<T>] {
        self.rows.get_mut(..self.len).unwrap_or(&mut [])
    }

    /// The rows of Q in use, as far as they are not zero.
    #[cfg_attr(feature = "simd", inline(always))]
    fn basis(&self) -> impl Iterator<Item = &[SVector<T, NU>]> {
        let lines = self.basis.chunks(self.stages.max(1));
        let rows = self.rows().iter().zip(lines);
        rows.map(|(row, line)| first(line, row.support.into()))
    }

    /// The rows of L in use, one after the other.
    fn factor(&self) -> &[T] {
        first(&self.factor, self.len * self.rows.len())
    }

    /// The answer of the minimiser over the working set to the candidate `row`.
    pub fn direction(&self, row: &Row<T, NU>, direction: &mut Direction<T, NU>) {
        direction.support = self.support.max(row.support);
        copy(&mut direction.primal, &row.alpha);
        for list in [&mut direction.coefficients, &mut direction.dual] {
            first_mut(list, self.len).fill(T::zero());
        }
        let compliance = row.terms.compliance;
        let square = row.dot(&row.alpha) + compliance;
        direction.size = square.sqrt();
        direction.slope = square;
        if self.len > 0 {
            self.orthogonalize(compliance, direction);
            let cancelled: T = convert(0.1);
            if direction.slope < cancelled * square {
                self.orthogonalize(compliance, direction);
            }
        }
        direction.noise = self.noise(direction);
        let rounding = direction.noise * direction.noise;
        let is_rounding = direction.slope <= rounding && rounding.is_finite();
        if is_rounding || self.spans(direction.support) {
            direction.slope = compliance;
        }
    }

    /// Whether the rows span all deviations of the first `stages` stages, so that every further row
    /// depends on them.
    fn spans(&self, stages: usize) -> bool {
        let space = stages * NU;
        self.len >= space && {
            let elastic = self.rows().iter().filter(|row| row.compliance > T::zero());
            self.len >= space + elastic.count()
        }
    }

    /// Removes from `direction.primal` what the orthonormal rows span of it.
    fn orthogonalize(&self, compliance: T, direction: &mut Direction<T, NU>) {
        in_vectors(
            NU > 1,
            #[inline(always)]
            || self.orthogonalize_here(compliance, direction),
        );
    }

    #[inline(always)]
    fn orthogonalize_here(&self, compliance: T, direction: &mut Direction<T, NU>) {
        let support = direction.support;
        let Direction {
            primal,
            coefficients,
            spanned,
            dual,
            ..
        } = direction;
        let [coefficients, spanned, dual] =
            [coefficients, spanned, dual].map(|list| first_mut(list, self.len));
        for ((s, d), row) in spanned.iter_mut().zip(dual.iter()).zip(self.rows()) {
            *s = -row.compliance * *d;
        }
        if self.rows().iter().any(|row| row.compliance > T::zero()) {
            self.solve_lower(spanned);
        }
        self.project(primal, spanned);
        for ((s, q), c) in spanned
            .iter()
            .zip(self.basis())
            .zip(coefficients.iter_mut())
        {
            add(primal, q, -*s);
            *c += *s;
        }
        copy(dual, coefficients);
        self.solve_upper(dual);
        let primal = first(primal, support);
        direction.slope = dot(primal, primal) + compliance;
        for (d, row) in dual.iter().zip(self.rows()) {
            direction.slope += row.compliance * *d * *d;
        }
    }

    fn noise(&self, direction: &Direction<T, NU>) -> T {
        let rows = self.rows().iter().zip(direction.dual.iter());
        let terms = rows.fold(direction.size, |sum, (row, d)| sum + d.abs() * row.size);
        rounding::<T>() * terms
    }

    /// Adds `row`, whose `direction` is current. The set must not be full.
    pub fn append(&mut self, row: &Row<T, NU>, direction: &Direction<T, NU>) {
        let m = self.len;
        let length = direction.slope.sqrt();
        let places = self.rows.len();
        if let Some(terms) = self.rows.get_mut(m) {
            *terms = Terms {
                size: direction.size,
                support: u16::try_from(direction.support).unwrap_or(u16::MAX),
                ..row.terms
            };
            let l = line_mut(&mut self.factor, m, places);
            copy(l, first(&direction.coefficients, m));
            if let Some(diagonal) = l.get_mut(m) {
                *diagonal = length;
            }
            let q = line_mut(&mut self.basis, m, self.stages);
            for (q, primal) in q.iter_mut().zip(direction.primal.iter()) {
                *q = primal / length;
            }
            self.support = direction.support;
            self.len = m + 1;
        }
    }

    /// Removes the row at `position`.
    pub fn remove(&mut self, position: usize) -> Terms<T> {
        let Some(removed) = self.rows().get(position).copied() else {
            return Terms::empty();
        };
        let places = self.rows.len();
        close_gap(&mut self.rows, position, self.len, 1);
        close_gap(&mut self.factor, position, self.len, places);
        self.len -= 1;
        // Row k of L now reaches one column too far.
        for k in position..self.len {
            self.rotate(k);
        }
        removed
    }

    /// Rotates columns `k` and `k` + 1 of L, and the same rows of Q, to clear entry (k, k + 1).
    fn rotate(&mut self, k: usize) {
        let places = self.rows.len();
        let diagonal = line(&self.factor, k, places).get(k..k + 2);
        let Some([a, b]) = diagonal else {
            return;
        };
        let length = (*a * *a + *b * *b).sqrt();
        if length == T::zero() {
            return;
        }
        let (c, s) = (*a / length, *b / length);
        for row in k..self.len {
            let row = line_mut(&mut self.factor, row, places);
            if let Some([left, right]) = row.get_mut(k..k + 2) {
                (*left, *right) = (c * *left + s * *right, c * *right - s * *left);
            }
        }
        let (before, after) = self
            .basis
            .split_at_mut_checked((k + 1) * self.stages)
            .unwrap_or_default();
        let pairs = line_mut(before, k, self.stages).iter_mut().zip(after);
        for (left, right) in pairs.take(self.support) {
            (*left, *right) = (*left * c + *right * s, *right * c - *left * s);
        }
    }

    /// The shortest change of v that changes the working rows' slacks, elastic parts included,
    /// by L `step`: v and the multipliers move by it. `step` is overwritten. Returns by how much the two may differ for
    /// rounding.
    pub fn shift(&mut self, step: &mut [T], v: &mut [SVector<T, NU>]) -> T {
        for (s, q) in step.iter().zip(self.basis()) {
            add(v, q, *s);
        }
        self.solve_upper(step);
        let mut terms = T::zero();
        for (row, change) in self.rows_mut().iter_mut().zip(step.iter()) {
            row.active.multiplier += *change;
            terms += change.abs() * row.size;
        }
        rounding::<T>() * terms
    }

    /// step += Q `v`
    #[cfg_attr(feature = "simd", inline(always))]
    pub fn project(&self, v: &[SVector<T, NU>], step: &mut [T]) {
        for (s, q) in step.iter_mut().zip(self.basis()) {
            *s += dot(q, v);
        }
    }

    /// L^-1 in place on the first `len` entries.
    #[cfg_attr(feature = "simd", inline(always))]
    pub fn solve_lower(&self, rhs: &mut [T]) {
        for (i, l) in self.factor().chunks(self.rows.len().max(1)).enumerate() {
            if let (Some((before, [entry, ..])), Some(pivot)) =
                (rhs.split_at_mut_checked(i), l.get(i))
            {
                let known = l.iter().zip(before.iter());
                *entry = known.fold(*entry, |rest, (l, x)| rest - *l * *x) / *pivot;
            }
        }
    }

    /// L'^-1 in place on the first `len` entries.
    #[cfg_attr(feature = "simd", inline(always))]
    pub fn solve_upper(&self, rhs: &mut [T]) {
        let lines = self.factor().rchunks(self.rows.len().max(1));
        for (i, l) in (0..self.len).rev().zip(lines) {
            if let (Some((before, [entry, ..])), Some(pivot)) =
                (rhs.split_at_mut_checked(i), l.get(i))
            {
                *entry /= *pivot;
                for (x, l) in before.iter_mut().zip(l) {
                    *x -= *l * *entry;
                }
            }
        }
    }
}

/// What rounding makes of a sum of rows, relative to the sum of their lengths.
fn rounding<T: Scalar>() -> T {
    T::default_epsilon() * convert(8.0)
}

/// Moves the lines of `width` entries behind `position`, up to `len`, one place forward.
fn close_gap<V>(entries: &mut [V], position: usize, len: usize, width: usize) {
    let used = entries.get_mut(position * width..len * width);
    let used = used.unwrap_or_default();
    // What a rotation by any number of places takes is a kilobyte of machine code.
    for k in width..used.len() {
        if let Ok([before, here]) = used.get_disjoint_mut([k - width, k]) {
            core::mem::swap(before, here);
        }
    }
}

/// Line `k` of a matrix that is stored line by line, each of `width` entries.
fn line<V>(entries: &[V], k: usize, width: usize) -> &[V] {
    entries.get(k * width..(k + 1) * width).unwrap_or_default()
}

fn line_mut<V>(entries: &mut [V], k: usize, width: usize) -> &mut [V] {
    entries
        .get_mut(k * width..(k + 1) * width)
        .unwrap_or_default()
}

/// The first `length` entries, none where there are fewer.
#[inline(always)]
pub(crate) fn first<V>(list: &[V], length: usize) -> &[V] {
    list.get(..length).unwrap_or_default()
}

/// The first `length` entries, none where there are fewer.
#[inline(always)]
pub(crate) fn first_mut<V>(list: &mut [V], length: usize) -> &mut [V] {
    list.get_mut(..length).unwrap_or_default()
}

/// Copies as many entries as both have.
pub(crate) fn copy<V: Copy>(to: &mut [V], from: &[V]) {
    let length = to.len().min(from.len());
    first_mut(to, length).copy_from_slice(first(from, length));
}

/// a'b over the stages that both have, in sums that do not wait for each other.
#[cfg_attr(feature = "simd", inline(always))]
fn dot<T: Scalar, const NU: usize>(a: &[SVector<T, NU>], b: &[SVector<T, NU>]) -> T {
    let length = a.len().min(b.len());
    let (a, a_rest) = first(a, length).as_chunks::<LANES>();
    let (b, b_rest) = first(b, length).as_chunks::<LANES>();
    let mut sums = [T::zero(); LANES];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            add_products(sum, a, b);
        }
    }
    for ((sum, a), b) in sums.iter_mut().zip(a_rest).zip(b_rest) {
        add_products(sum, a, b);
    }
    let [first, second, third, fourth] = sums;
    (first + third) + (second + fourth)
}

/// sum += a'b; without the zero that a product begins with.
#[inline(always)]
fn add_products<T: Scalar, const NU: usize>(sum: &mut T, a: &SVector<T, NU>, b: &SVector<T, NU>) {
    for (a, b) in a.data.0.as_flattened().iter().zip(b.data.0.as_flattened()) {
        *sum += *a * *b;
    }
}

/// v += factor * a over the stages that both have.
#[cfg_attr(feature = "simd", inline(always))]
fn add<T: Scalar, const NU: usize>(v: &mut [SVector<T, NU>], a: &[SVector<T, NU>], factor: T) {
    for (v, a) in v.iter_mut().zip(a) {
        *v += a * factor;
    }
}
