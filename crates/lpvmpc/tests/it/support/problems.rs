//! Random optimal control problems by family.

use super::rng::Rng;
use lpvmpc::{Bounds, Ocp, Penalty, Softness, Stage};
use nalgebra::{DMatrix, SMatrix, SVector};

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

/// A problem with 1 to `longest` stages.
pub fn problem<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    family: Family,
    longest: usize,
) -> Box<Ocp<f64, NX, NU, N, NG>> {
    let mut ocp = Box::new(Ocp::default());
    ocp.horizon = 1 + rng.index(longest.min(N));
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

fn dynamics<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
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

fn costs<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    // [Q S'; S R] = G'G + diag(0, r) is semidefinite, whatever the rows of G.
    let state_factor: SMatrix<f64, 4, NX> = rng.matrix();
    let input_factor: SMatrix<f64, 4, NU> = if rng.chance(0.5) {
        rng.matrix()
    } else {
        SMatrix::zeros()
    };
    let r = rng.power_of_ten(-2.0, 1.0);
    let slope = if rng.chance(0.5) { 1.0 } else { 0.0 };
    for stage in &mut ocp.stages {
        stage.q = state_factor.tr_mul(&state_factor);
        stage.s = input_factor.tr_mul(&state_factor);
        stage.r = input_factor.tr_mul(&input_factor) + SMatrix::identity() * r;
        stage.linear_x = rng.matrix() * slope;
        stage.linear_u = rng.matrix() * slope;
    }
    let terminal: SMatrix<f64, NX, NX> = rng.matrix();
    if rng.chance(0.8) {
        ocp.terminal.p = terminal.tr_mul(&terminal);
    }
    ocp.terminal.linear_x = rng.matrix() * slope;
    for stage in &mut ocp.stages {
        stage.row_x = rng.matrix();
        stage.row_u = rng.matrix();
    }
    ocp.terminal.row_x = rng.matrix();
}

fn nearly_parallel_rows<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    let angle = rng.power_of_ten(-7.0, -3.0);
    let same = SMatrix::<f64, NG, NX>::from_fn(|i, j| if i % NX == j { 1.0 } else { 0.0 });
    for stage in &mut ocp.stages {
        stage.row_x = same + rng.matrix() * angle;
        stage.row_u = rng.matrix() * angle;
    }
    ocp.terminal.row_x = same + rng.matrix() * angle;
}

/// Inputs in [-1, 1] and the states x_0.. that they lead to.
fn feasible_trajectory<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
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

fn bounds_around<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
    x: &[SVector<f64, NX>],
    u: &[SVector<f64, NU>],
    margin: fn(&mut Rng) -> f64,
) {
    let presence = [0.15, 0.5, 1.0][rng.index(3)];
    let n = ocp.horizon;
    for (i, stage) in ocp.stages.iter_mut().enumerate().take(n) {
        stage.x = around(rng, &x[i], margin, presence);
        stage.u = around(rng, &u[i], margin, presence);
        let rows = stage.row_x * x[i] + stage.row_u * u[i];
        stage.rows = around(rng, &rows, margin, presence);
    }
    ocp.terminal.x = around(rng, &x[n], margin, presence);
    let rows = ocp.terminal.row_x * x[n];
    ocp.terminal.rows = around(rng, &rows, margin, presence);
}

/// The same random box at every stage.
fn arbitrary_bounds<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    let zero = |rng: &mut Rng| rng.uniform(0.3, 2.0);
    let x = around(rng, &SVector::zeros(), zero, 0.5);
    let u = around(rng, &SVector::zeros(), zero, 0.8);
    let rows = around(rng, &SVector::zeros(), zero, 0.5);
    for stage in &mut ocp.stages {
        (stage.x, stage.u, stage.rows) = (x, u, rows);
    }
    (ocp.terminal.x, ocp.terminal.rows) = (x, rows);
}

fn soften<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
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
    for stage in &mut ocp.stages {
        stage.soft_rows = [price; NG];
    }
    ocp.soft_x = [price; NX];
    ocp.terminal.soft_x = [price; NX];
    ocp.terminal.soft_rows = [price; NG];
}

/// Moves one state bound beyond the reach of the inputs, whose bounds become finite.
fn unreachable_bound<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    for stage in &mut ocp.stages {
        for j in 0..NU {
            stage.u.lower[j] = stage.u.lower[j].max(-2.0);
            stage.u.upper[j] = stage.u.upper[j].min(2.0);
        }
    }
    let stage = 1 + rng.index(ocp.horizon);
    let component = rng.index(NX);
    let (lowest, highest) = reach(ocp, stage, component);
    let margin = rng.power_of_ten(-3.0, 0.0) * (1.0 + highest.abs().max(lowest.abs()));
    let bounds = match ocp.stages.get_mut(stage) {
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
fn reach<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
    stage: usize,
    component: usize,
) -> (f64, f64) {
    let mut costate = SVector::<f64, NX>::from_fn(|i, _| f64::from(i == component));
    let (mut lowest, mut highest) = (0.0, 0.0);
    for inner in ocp.stages.iter().take(stage).rev() {
        let effect = inner.b.tr_mul(&costate);
        for j in 0..NU {
            let ends = [effect[j] * inner.u.lower[j], effect[j] * inner.u.upper[j]];
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
pub fn change_units<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    let x = SVector::<f64, NX>::from_fn(|_, _| rng.power_of_ten(-2.0, 2.0));
    let u = SVector::<f64, NU>::from_fn(|_, _| rng.power_of_ten(-2.0, 2.0));
    let cost = rng.power_of_ten(-4.0, 4.0);
    ocp.x0.component_mul_assign(&x);
    for stage in &mut ocp.stages {
        stage_in_units(stage, &x, &u, cost);
    }
    let end = &mut ocp.terminal;
    end.p = divide(&end.p, &x, &x) * cost;
    end.linear_x.component_div_assign(&x);
    end.linear_x *= cost;
    scale_bounds(&mut end.x, &x);
    end.row_x = divide(&end.row_x, &SVector::repeat(1.0), &x);
    if let Some(target) = &mut end.equality {
        target.component_mul_assign(&x);
    }
}

fn stage_in_units<const NX: usize, const NU: usize, const NG: usize>(
    stage: &mut Stage<f64, NX, NU, NG>,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
    cost: f64,
) {
    let one = SVector::repeat(1.0);
    let inverse = x.map(f64::recip);
    stage.a = divide(&stage.a, &inverse, x);
    stage.b = divide(&stage.b, &inverse, u);
    stage.c.component_mul_assign(x);
    stage.q = divide(&stage.q, x, x) * cost;
    stage.r = divide(&stage.r, u, u) * cost;
    stage.s = divide(&stage.s, u, x) * cost;
    stage.linear_x = stage.linear_x.component_div(x) * cost;
    stage.linear_u = stage.linear_u.component_div(u) * cost;
    scale_bounds(&mut stage.x, x);
    scale_bounds(&mut stage.u, u);
    stage.row_x = divide(&stage.row_x, &one, x);
    stage.row_u = divide(&stage.row_u, &one, u);
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

/// No softness at all.
pub fn hard<const K: usize>() -> Softness<f64, K> {
    [None; K]
}
