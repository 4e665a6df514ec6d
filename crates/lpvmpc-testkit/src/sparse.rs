//! The problem as a sparse quadratic program in inputs and states.

use lpvmpc::{Bounds, Ocp, Penalty, SoftBounds};
use nalgebra::{SMatrix, SVector};

/// A matrix in compressed columns, rows ascending within a column.
#[derive(Clone, Debug)]
pub struct Csc {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Where each column begins, and the end.
    pub starts: Vec<usize>,
    /// The row of each value.
    pub row_indices: Vec<usize>,
    /// The values.
    pub values: Vec<f64>,
}

/// Minimise z'Pz/2 + q'z + constant with lower <= Az <= upper, where z = (u_0, x_1, u_1, x_2, ..)
/// and then the excess of each side of a soft bound.
#[derive(Clone, Debug)]
pub struct SparseQp {
    /// P, its upper triangle.
    pub p: Csc,
    /// q.
    pub q: Vec<f64>,
    /// What x_0 costs by itself.
    pub constant: f64,
    /// A; first the rows of the dynamics and of the terminal equality, whose bounds are equal.
    pub a: Csc,
    /// Lower bounds, some of them -infinity.
    pub lower: Vec<f64>,
    /// Upper bounds, some of them +infinity.
    pub upper: Vec<f64>,
}

impl SparseQp {
    /// One problem, without the entries that are zero.
    pub fn new<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Self {
        sequence(std::slice::from_ref(ocp)).remove(0)
    }
}

/// The problems of a sequence, which have the same horizon and the same finite bounds, all with the
/// same pattern: an entry is left out if it is zero in every one of them.
pub fn sequence<const NX: usize, const NU: usize>(problems: &[Ocp<f64, NX, NU>]) -> Vec<SparseQp> {
    let drafts: Vec<Draft> = problems.iter().map(Draft::new).collect();
    let columns = drafts.first().map_or(0, |draft| draft.q.len());
    let rows = drafts.first().map_or(0, |draft| draft.lower.len());
    let p = compress(columns, columns, drafts.iter().map(|draft| &draft.p));
    let a = compress(rows, columns, drafts.iter().map(|draft| &draft.a));
    let matrices = p.into_iter().zip(a);
    let assemble = |(draft, (p, a)): (Draft, (Csc, Csc))| SparseQp {
        p,
        q: draft.q,
        constant: draft.constant,
        a,
        lower: draft.lower,
        upper: draft.upper,
    };
    drafts.into_iter().zip(matrices).map(assemble).collect()
}

/// A value with its place.
#[derive(Clone, Copy)]
struct Entry {
    row: usize,
    column: usize,
    value: f64,
}

/// Matrices that list the same places in the same order, compressed to one pattern.
fn compress<'a>(
    rows: usize,
    columns: usize,
    all: impl Iterator<Item = &'a Vec<Entry>> + Clone,
) -> Vec<Csc> {
    let Some(places) = all.clone().next() else {
        return Vec::new();
    };
    let mut order: Vec<usize> = (0..places.len())
        .filter(|&index| all.clone().any(|entries| entries[index].value != 0.0))
        .collect();
    order.sort_by_key(|&index| (places[index].column, places[index].row));
    let row_indices: Vec<usize> = order.iter().map(|&index| places[index].row).collect();
    let starts: Vec<usize> = (0..=columns)
        .map(|column| order.partition_point(|&index| places[index].column < column))
        .collect();
    let fill = |entries: &Vec<Entry>| Csc {
        rows,
        columns,
        starts: starts.clone(),
        row_indices: row_indices.clone(),
        values: order.iter().map(|&index| entries[index].value).collect(),
    };
    all.map(fill).collect()
}

/// A program whose matrices are lists of entries, zeros included.
#[derive(Default)]
struct Draft {
    p: Vec<Entry>,
    q: Vec<f64>,
    constant: f64,
    a: Vec<Entry>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Draft {
    fn new<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Self {
        let mut draft = Self::default();
        draft.add_cost(ocp);
        draft.add_dynamics(ocp);
        for i in 0..ocp.length() {
            let input = i * (NX + NU);
            let state = input.checked_sub(NX);
            let common = ocp.common_at(i);
            draft.add_bounds(input, &common.u, &[None; NU]);
            if let Some(state) = state {
                draft.add_bounds(state, &common.x, &common.soft_x);
            }
            draft.add_rows(ocp, i, state, Some(input));
        }
        let (end, state) = (&ocp.terminal, ocp.length() * (NX + NU) - NX);
        draft.add_bounds(state, &end.x, &end.soft_x);
        draft.add_rows(ocp, ocp.length(), Some(state), None);
        draft
    }

    fn add_cost<const NX: usize, const NU: usize>(&mut self, ocp: &Ocp<f64, NX, NU>) {
        for (i, stage) in ocp.stages.iter().enumerate().take(ocp.length()) {
            let input = i * (NX + NU);
            let common = ocp.common_at(i);
            let mut linear_u = stage.linear_u;
            if let Some(state) = input.checked_sub(NX) {
                push_upper(&mut self.p, state, &common.q);
                push(&mut self.p, (state, input), &common.s.transpose());
                self.q.extend(stage.linear_x.iter());
            } else {
                linear_u += common.s * ocp.x0;
                self.constant = (common.q * ocp.x0 * 0.5 + stage.linear_x).dot(&ocp.x0);
            }
            push_upper(&mut self.p, input, &common.r);
            self.q.extend(linear_u.iter());
        }
        let last = ocp.length() * (NX + NU) - NX;
        push_upper(&mut self.p, last, &ocp.terminal.p);
        self.q.extend(ocp.terminal.linear_x.iter());
    }

    /// A x_i + B u_i - x_{i+1} = -c, and x_N if it is imposed.
    fn add_dynamics<const NX: usize, const NU: usize>(&mut self, ocp: &Ocp<f64, NX, NU>) {
        for (i, stage) in ocp.stages.iter().enumerate().take(ocp.length()) {
            let row = self.lower.len();
            let input = i * (NX + NU);
            let mut right = -stage.c;
            if let Some(state) = input.checked_sub(NX) {
                push(&mut self.a, (row, state), &stage.a);
            } else {
                right -= stage.a * ocp.x0;
            }
            push(&mut self.a, (row, input), &stage.b);
            push_diagonal::<NX>(&mut self.a, (row, input + NU), -1.0);
            self.lower.extend(right.iter());
            self.upper.extend(right.iter());
        }
        if let Some(target) = &ocp.terminal.equality {
            let row = self.lower.len();
            let last = ocp.length() * (NX + NU) - NX;
            push_diagonal::<NX>(&mut self.a, (row, last), 1.0);
            self.lower.extend(target.iter());
            self.upper.extend(target.iter());
        }
    }

    fn add_bounds<const K: usize>(
        &mut self,
        variable: usize,
        bounds: &Bounds<f64, K>,
        soft: &SoftBounds<f64, K>,
    ) {
        let limits = bounds.lower.iter().zip(&bounds.upper);
        for (j, ((lower, upper), price)) in limits.zip(soft).enumerate() {
            self.add_bound(&[(variable + j, 1.0)], (*lower, *upper), *price);
        }
    }

    /// The general rows of stage `i`; at 0 the state is given, at the end there is no input.
    fn add_rows<const NX: usize, const NU: usize>(
        &mut self,
        ocp: &Ocp<f64, NX, NU>,
        i: usize,
        state: Option<usize>,
        input: Option<usize>,
    ) {
        for row in (0..ocp.rows_per_stage).filter_map(|j| ocp.row(i, j)) {
            let given = if state.is_none() {
                row.x.dot(&ocp.x0)
            } else {
                0.0
            };
            let terms: Vec<_> = terms(state, &row.x).chain(terms(input, &row.u)).collect();
            self.add_bound(&terms, (row.lower - given, row.upper - given), row.soft);
        }
    }

    /// lower <= sum of coefficient * variable <= upper, at a price if soft.
    fn add_bound(
        &mut self,
        terms: &[(usize, f64)],
        (lower, upper): (f64, f64),
        soft: Option<Penalty<f64>>,
    ) {
        let Some(price) = soft else {
            if lower.is_finite() || upper.is_finite() {
                self.add_row(terms, lower, upper);
            }
            return;
        };
        let infinity = f64::INFINITY;
        for (sign, lower, upper) in [(1.0, lower, infinity), (-1.0, -infinity, upper)] {
            if lower.is_finite() || upper.is_finite() {
                let excess = self.q.len();
                self.q.push(price.linear);
                self.p.push(Entry {
                    row: excess,
                    column: excess,
                    value: price.quadratic,
                });
                self.add_row(&[(excess, 1.0)], 0.0, infinity);
                self.add_row(&[terms, &[(excess, sign)]].concat(), lower, upper);
            }
        }
    }

    fn add_row(&mut self, terms: &[(usize, f64)], lower: f64, upper: f64) {
        let row = self.lower.len();
        self.a.extend(
            terms
                .iter()
                .map(|&(column, value)| Entry { row, column, value }),
        );
        self.lower.push(lower);
        self.upper.push(upper);
    }
}

/// The coefficients by variable, the first of which is `variable`; none without it.
fn terms<const K: usize>(
    variable: Option<usize>,
    coefficients: &SVector<f64, K>,
) -> impl Iterator<Item = (usize, f64)> {
    let first = variable.into_iter();
    first.flat_map(|first| {
        coefficients
            .iter()
            .enumerate()
            .map(move |(j, c)| (first + j, *c))
    })
}

fn push<const R: usize, const C: usize>(
    entries: &mut Vec<Entry>,
    (row, column): (usize, usize),
    block: &SMatrix<f64, R, C>,
) {
    for j in 0..C {
        for i in 0..R {
            entries.push(Entry {
                row: row + i,
                column: column + j,
                value: block[(i, j)],
            });
        }
    }
}

fn push_upper<const R: usize>(entries: &mut Vec<Entry>, place: usize, block: &SMatrix<f64, R, R>) {
    for j in 0..R {
        for i in 0..=j {
            entries.push(Entry {
                row: place + i,
                column: place + j,
                value: block[(i, j)],
            });
        }
    }
}

fn push_diagonal<const R: usize>(
    entries: &mut Vec<Entry>,
    (row, column): (usize, usize),
    value: f64,
) {
    entries.extend((0..R).map(|i| Entry {
        row: row + i,
        column: column + i,
        value,
    }));
}
