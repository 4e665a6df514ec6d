//! Random optimal control problems by family.

use crate::rng::Rng;
use lpvmpc::{Bounds, Common, GeneralRow, List, Ocp, Penalty};
use nalgebra::{DMatrix, SMatrix, SVector, Vector1};

/// What a random problem is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    /// Bounds far from a feasible trajectory.
    Loose,
    /// Bounds close around a feasible trajectory.
    Tight,
    /// Many bounds with no room at all, many through one point, some listed twice.
    Degenerate,
    /// General rows that differ by 1e-3 to 1e-7 from a bound, beside it.
    NearlyParallel,
    /// Units that differ by 1e4 between states, inputs and cost.
    BadlyScaled,
    /// The terminal state is imposed.
    TerminalEquality,
    /// Soft bounds with a linear price.
    SoftLinear,
    /// Soft bounds with a quadratic price.
    SoftQuadratic,
    /// Soft bounds with both.
    SoftBoth,
    /// Bounds that know nothing of a feasible trajectory.
    Arbitrary,
    /// A bound beyond what the bounded inputs can reach.
    Infeasible,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Loose,
        Self::Tight,
        Self::Degenerate,
        Self::NearlyParallel,
        Self::BadlyScaled,
        Self::TerminalEquality,
        Self::SoftLinear,
        Self::SoftQuadratic,
        Self::SoftBoth,
        Self::Arbitrary,
        Self::Infeasible,
    ];

    /// Whether a feasible trajectory is known (or known not to exist).
    pub fn feasible(self) -> Option<bool> {
        match self {
            Self::Arbitrary => None,
            Self::Infeasible => Some(false),
            _ => Some(true),
        }
    }
}

/// A problem with 1 to `longest` stages and `rows` general rows at each of them and at the end.
pub fn problem<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    family: Family,
    longest: usize,
    rows: usize,
) -> Ocp<f64, NX, NU> {
    let mut ocp = Ocp::allocate(longest);
    ocp.horizon = 1 + rng.index(longest);
    ocp.rows = List::repeat(GeneralRow::default(), (longest + 1) * rows);
    ocp.rows_per_stage = rows;
    dynamics(rng, &mut ocp);
    costs(rng, &mut ocp);
    if family == Family::NearlyParallel {
        nearly_parallel_rows(rng, &mut ocp);
    }
    let (x, u) = feasible_trajectory(rng, &mut ocp);
    match family {
        Family::Loose => bounds_around(rng, &mut ocp, &x, &u, |rng| rng.uniform(0.5, 4.0)),
        Family::Tight | Family::NearlyParallel | Family::BadlyScaled => {
            bounds_around(rng, &mut ocp, &x, &u, |rng| rng.uniform(0.001, 0.3));
        }
        Family::Degenerate => {
            bounds_around(rng, &mut ocp, &x, &u, |rng| match rng.index(3) {
                0 => 0.0,
                1 => 0.25,
                _ => rng.uniform(0.0, 0.3),
            });
        }
        Family::TerminalEquality => {
            bounds_around(rng, &mut ocp, &x, &u, |rng| rng.uniform(0.05, 1.0));
            ocp.terminal.equality = Some(x[ocp.horizon]);
        }
        Family::SoftLinear | Family::SoftQuadratic | Family::SoftBoth => {
            arbitrary_bounds(rng, &mut ocp);
            soften(rng, &mut ocp, family);
        }
        Family::Arbitrary => arbitrary_bounds(rng, &mut ocp),
        Family::Infeasible => {
            bounds_around(rng, &mut ocp, &x, &u, |rng| rng.uniform(0.05, 1.0));
            unreachable_bound(rng, &mut ocp);
        }
    }
    if family == Family::BadlyScaled {
        change_units(rng, &mut ocp);
    }
    ocp
}

fn dynamics<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    // A dense matrix, or a small step of a continuous system; its free motion grows at most
    // a thousandfold over the horizon, and by a fifth per stage.
    let mut a: SMatrix<f64, NX, NX> = if rng.chance(0.5) {
        rng.matrix()
    } else {
        SMatrix::identity() + rng.matrix() * 0.1 / (NX as f64).sqrt()
    };
    let growth = rng.power_of_ten(-3.0, 3.0).powf(1.0 / ocp.horizon as f64);
    a *= growth.clamp(0.5, 1.2) / spectral_radius(&a);
    let b = rng.matrix::<NX, NU>();
    let variation = if rng.chance(0.5) { 0.05 } else { 0.0 };
    let drift = if rng.chance(0.5) { 0.1 } else { 0.0 };
    for stage in &mut ocp.stages {
        stage.a = a + rng.matrix() * variation / (NX as f64).sqrt();
        stage.b = b + rng.matrix() * variation;
        stage.c = rng.matrix() * drift;
    }
    ocp.x0 = rng.matrix();
}

fn spectral_radius<const K: usize>(a: &SMatrix<f64, K, K>) -> f64 {
    let eigenvalues = DMatrix::from_column_slice(K, K, a.as_slice()).complex_eigenvalues();
    eigenvalues.iter().map(|z| z.norm()).fold(0.0, f64::max)
}

fn costs<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    // [Q S'; S R] = G'G + diag(0, r) is semidefinite, whatever the rows of G.
    let state_factor: SMatrix<f64, 4, NX> = rng.matrix();
    let input_factor: SMatrix<f64, 4, NU> = if rng.chance(0.5) {
        rng.matrix()
    } else {
        SMatrix::zeros()
    };
    let r = rng.power_of_ten(-2.0, 1.0);
    let slope = if rng.chance(0.5) { 1.0 } else { 0.0 };
    ocp.common.q = state_factor.tr_mul(&state_factor);
    ocp.common.s = input_factor.tr_mul(&state_factor);
    ocp.common.r = input_factor.tr_mul(&input_factor) + SMatrix::identity() * r;
    for stage in &mut ocp.stages {
        stage.linear_x = rng.matrix() * slope;
        stage.linear_u = rng.matrix() * slope;
    }
    let terminal: SMatrix<f64, NX, NX> = rng.matrix();
    if rng.chance(0.8) {
        ocp.terminal.p = terminal.tr_mul(&terminal);
    }
    ocp.terminal.linear_x = rng.matrix() * slope;
    random_rows(rng, ocp);
}

/// General rows with normal coefficients, of all stages that there are; the last ones drawn are those
/// of the end of the horizon.
fn random_rows<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    if ocp.rows_per_stage == 0 {
        return;
    }
    let end = ocp.stages.len();
    for (i, rows) in ocp.rows.chunks_mut(ocp.rows_per_stage).enumerate() {
        for k in 0..NX {
            rows.iter_mut().for_each(|row| row.x[k] = rng.normal());
        }
        for k in 0..if i < end { NU } else { 0 } {
            rows.iter_mut().for_each(|row| row.u[k] = rng.normal());
        }
    }
    let last = rows_of(ocp, end).to_vec();
    rows_of(ocp, ocp.horizon).copy_from_slice(&last);
}

/// The general rows of stage `i`.
fn rows_of<const NX: usize, const NU: usize>(
    ocp: &mut Ocp<f64, NX, NU>,
    i: usize,
) -> &mut [GeneralRow<f64, NX, NU>] {
    let first = i * ocp.rows_per_stage;
    &mut ocp.rows[first..first + ocp.rows_per_stage]
}

/// The weights and bounds of all stages, those that a problem has in common included.
pub fn each_common<const NX: usize, const NU: usize>(
    ocp: &mut Ocp<f64, NX, NU>,
) -> impl Iterator<Item = &mut Common<f64, NX, NU>> {
    ocp.own.iter_mut().chain(std::iter::once(&mut ocp.common))
}

fn nearly_parallel_rows<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU>,
) {
    let angle = rng.power_of_ten(-7.0, -3.0);
    random_rows(rng, ocp);
    let count = ocp.rows_per_stage;
    for (index, row) in ocp.rows.iter_mut().enumerate() {
        row.x *= angle;
        row.u *= angle;
        row.x[index % count % NX] += 1.0;
    }
}

/// Inputs in [-1, 1] and the states x_0.. that they lead to.
fn feasible_trajectory<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU>,
) -> (Vec<SVector<f64, NX>>, Vec<SVector<f64, NU>>) {
    let mut x = vec![ocp.x0];
    let mut u = Vec::new();
    for (i, stage) in ocp.stages.iter().enumerate().take(ocp.horizon) {
        u.push(SVector::from_fn(|_, _| rng.uniform(-1.0, 1.0)));
        x.push(stage.a * x[i] + stage.b * u[i] + stage.c);
    }
    (x, u)
}

/// Bounds on either side of `value`, some of them absent.
fn around<const K: usize>(
    rng: &mut Rng,
    value: &SVector<f64, K>,
    margin: fn(&mut Rng) -> f64,
    presence: f64,
) -> Bounds<f64, K> {
    let mut bounds = Bounds::none();
    for j in 0..K {
        if rng.chance(presence) {
            bounds.lower[j] = value[j] - margin(rng);
        }
        if rng.chance(presence) {
            bounds.upper[j] = value[j] + margin(rng);
        }
    }
    bounds
}

fn bounds_around<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU>,
    x: &[SVector<f64, NX>],
    u: &[SVector<f64, NU>],
    margin: fn(&mut Rng) -> f64,
) {
    let presence = [0.15, 0.5, 1.0][rng.index(3)];
    let n = ocp.horizon;
    ocp.own = List::repeat(ocp.common, ocp.stages.len());
    for i in 0..n {
        ocp.own[i].x = around(rng, &x[i], margin, presence);
        ocp.own[i].u = around(rng, &u[i], margin, presence);
        for row in rows_of(ocp, i) {
            let value = row.x.dot(&x[i]) + row.u.dot(&u[i]);
            bound_row(row, &around(rng, &Vector1::new(value), margin, presence));
        }
    }
    ocp.terminal.x = around(rng, &x[n], margin, presence);
    for row in rows_of(ocp, n) {
        let value = row.x.dot(&x[n]);
        bound_row(row, &around(rng, &Vector1::new(value), margin, presence));
    }
}

fn bound_row<const NX: usize, const NU: usize>(
    row: &mut GeneralRow<f64, NX, NU>,
    bounds: &Bounds<f64, 1>,
) {
    (row.lower, row.upper) = (bounds.lower[0], bounds.upper[0]);
}

/// The same random box at every stage.
fn arbitrary_bounds<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    let zero = |rng: &mut Rng| rng.uniform(0.3, 2.0);
    let x = around(rng, &SVector::zeros(), zero, 0.5);
    let u = around(rng, &SVector::zeros(), zero, 0.8);
    (ocp.common.x, ocp.common.u, ocp.terminal.x) = (x, u, x);
    for j in 0..ocp.rows_per_stage {
        let bounds = around(rng, &Vector1::zeros(), zero, 0.5);
        for row in ocp.rows.iter_mut().skip(j).step_by(ocp.rows_per_stage) {
            bound_row(row, &bounds);
        }
    }
}

fn soften<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU>,
    family: Family,
) {
    let linear = if family == Family::SoftQuadratic {
        0.0
    } else {
        rng.power_of_ten(-1.0, 4.0)
    };
    let quadratic = if family == Family::SoftLinear {
        0.0
    } else {
        rng.power_of_ten(-1.0, 4.0)
    };
    let price = Some(Penalty { linear, quadratic });
    for row in &mut ocp.rows {
        row.soft = price;
    }
    for Common { soft_x, .. } in each_common(ocp) {
        *soft_x = [price; NX];
    }
    ocp.terminal.soft_x = [price; NX];
}

/// Moves one state bound beyond the reach of the inputs, whose bounds become finite.
fn unreachable_bound<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    for Common { u, .. } in each_common(ocp) {
        u.lower = u.lower.map(|lower| lower.max(-2.0));
        u.upper = u.upper.map(|upper| upper.min(2.0));
    }
    let stage = 1 + rng.index(ocp.horizon);
    let component = rng.index(NX);
    let (lowest, highest) = reach(ocp, stage, component);
    let margin = rng.power_of_ten(-3.0, 0.0) * (1.0 + highest.abs().max(lowest.abs()));
    let bounds = match ocp.own.get_mut(stage) {
        Some(inner) if stage < ocp.horizon => &mut inner.x,
        _ => &mut ocp.terminal.x,
    };
    if rng.chance(0.5) {
        bounds.lower[component] = highest + margin;
        bounds.upper[component] = f64::INFINITY;
    } else {
        bounds.lower[component] = f64::NEG_INFINITY;
        bounds.upper[component] = lowest - margin;
    }
}

/// Least and largest value of a component of x_`stage` over all inputs within their bounds.
fn reach<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
    stage: usize,
    component: usize,
) -> (f64, f64) {
    let mut costate = SVector::<f64, NX>::from_fn(|i, _| f64::from(i == component));
    let (mut lowest, mut highest) = (0.0, 0.0);
    for (i, inner) in ocp.stages.iter().enumerate().take(stage).rev() {
        let effect = inner.b.tr_mul(&costate);
        let Bounds { lower, upper } = ocp.common_at(i).u;
        for j in 0..NU {
            let ends = [effect[j] * lower[j], effect[j] * upper[j]];
            lowest += ends[0].min(ends[1]);
            highest += ends[0].max(ends[1]);
        }
        lowest += costate.dot(&inner.c);
        highest += costate.dot(&inner.c);
        costate = inner.a.tr_mul(&costate);
    }
    let free = costate.dot(&ocp.x0);
    (lowest + free, highest + free)
}

/// States and inputs in units between 1e-2 and 1e2, the cost in units between 1e-4 and 1e4.
pub fn change_units<const NX: usize, const NU: usize>(rng: &mut Rng, ocp: &mut Ocp<f64, NX, NU>) {
    let x = SVector::<f64, NX>::from_fn(|_, _| rng.power_of_ten(-2.0, 2.0));
    let u = SVector::<f64, NU>::from_fn(|_, _| rng.power_of_ten(-2.0, 2.0));
    let cost = rng.power_of_ten(-4.0, 4.0);
    ocp.x0.component_mul_assign(&x);
    let inverse = x.map(f64::recip);
    for stage in &mut ocp.stages {
        stage.a = divide(&stage.a, &inverse, &x);
        stage.b = divide(&stage.b, &inverse, &u);
        stage.c.component_mul_assign(&x);
        stage.linear_x = stage.linear_x.component_div(&x) * cost;
        stage.linear_u = stage.linear_u.component_div(&u) * cost;
    }
    for common in each_common(ocp) {
        common.q = divide(&common.q, &x, &x) * cost;
        common.r = divide(&common.r, &u, &u) * cost;
        common.s = divide(&common.s, &u, &x) * cost;
        scale_bounds(&mut common.x, &x);
        scale_bounds(&mut common.u, &u);
    }
    for row in &mut ocp.rows {
        row.x.component_div_assign(&x);
        row.u.component_div_assign(&u);
    }
    let end = &mut ocp.terminal;
    end.p = divide(&end.p, &x, &x) * cost;
    end.linear_x.component_div_assign(&x);
    end.linear_x *= cost;
    scale_bounds(&mut end.x, &x);
    if let Some(target) = &mut end.equality {
        target.component_mul_assign(&x);
    }
}

/// m_ij / (rows_i columns_j)
fn divide<const R: usize, const C: usize>(
    m: &SMatrix<f64, R, C>,
    rows: &SVector<f64, R>,
    columns: &SVector<f64, C>,
) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)] / (rows[i] * columns[j]))
}

fn scale_bounds<const K: usize>(bounds: &mut Bounds<f64, K>, scale: &SVector<f64, K>) {
    bounds.lower.component_mul_assign(scale);
    bounds.upper.component_mul_assign(scale);
}
