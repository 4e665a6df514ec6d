//! The problem as a sparse quadratic program in inputs and states.

use lpvmpc::{Bounds, Ocp};
use nalgebra::SMatrix;

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

/// Minimise z'Pz/2 + q'z with lower <= Az <= upper, where z = (u_0, x_1, u_1, x_2, ..). Rows
/// with equal bounds come first.
#[derive(Clone, Debug)]
pub struct SparseQp {
    /// P, its upper triangle.
    pub p: Csc,
    /// q.
    pub q: Vec<f64>,
    /// A.
    pub a: Csc,
    /// Lower bounds, some of them -infinity.
    pub lower: Vec<f64>,
    /// Upper bounds, some of them +infinity.
    pub upper: Vec<f64>,
}

/// The problems of a sequence, all with the same pattern: an entry is left out if it is zero in
/// every one of them. General rows and soft bounds are not translated.
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
            let common = ocp.common_at(i);
            draft.add_bounds(input, &common.u);
            if let Some(state) = input.checked_sub(NX) {
                draft.add_bounds(state, &common.x);
            }
        }
        draft.add_bounds(ocp.length() * (NX + NU) - NX, &ocp.terminal.x);
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

    fn add_bounds<const K: usize>(&mut self, variable: usize, bounds: &Bounds<f64, K>) {
        for (j, (lower, upper)) in bounds.lower.iter().zip(bounds.upper.iter()).enumerate() {
            if lower.is_finite() || upper.is_finite() {
                self.a.push(Entry {
                    row: self.lower.len(),
                    column: variable + j,
                    value: 1.0,
                });
                self.lower.push(*lower);
                self.upper.push(*upper);
            }
        }
    }
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
