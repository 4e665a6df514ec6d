//! Feasible problems whose numbers are all of the size of one, with bounds that are active.

use crate::support::rng::Rng;
use lpvmpc::{Bounds, Ocp, Penalty, Softness, Solution, SolverSettings, WarmStart, Workspace};
use nalgebra::{DMatrix, SMatrix, SVector};

/// What is at the end of the horizon, and whether state bounds have a price.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Hard bounds.
    Hard,
    /// Soft state bounds and general rows.
    Soft,
    /// Hard bounds, and a terminal state that must be reached.
    TerminalEquality,
}

impl Kind {
    pub const ALL: [Self; 3] = [Self::Hard, Self::Soft, Self::TerminalEquality];
}

/// A problem of `N` stages with a known feasible trajectory, and a reference outside its bounds.
///
/// The inputs are within -1 and 1.
pub fn problem<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    kind: Kind,
) -> Box<Ocp<f64, NX, NU, N, NG>> {
    let mut ocp = Box::new(Ocp::default());
    dynamics(rng, &mut ocp);
    costs(rng, &mut ocp);
    bounds(rng, &mut ocp, kind);
    if kind == Kind::Soft {
        prices(rng, &mut ocp);
    }
    ocp
}

fn dynamics<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    // Free motion that grows or shrinks by at most a tenth per stage, in any direction.
    let a = SMatrix::<f64, NX, NX>::identity() + rng.matrix() * 0.3;
    let stretch = DMatrix::from_column_slice(NX, NX, a.as_slice());
    let a = a * rng.uniform(0.9, 1.1) / stretch.singular_values().max();
    let b = rng.matrix::<NX, NU>();
    for stage in &mut ocp.stages {
        stage.a = a + rng.matrix() * 0.02;
        stage.b = b + rng.matrix() * 0.02;
        stage.c = rng.matrix() * 0.1;
        stage.row_x = rng.matrix();
        stage.row_u = rng.matrix();
    }
    ocp.terminal.row_x = rng.matrix();
    ocp.x0 = rng.matrix();
}

fn costs<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    let mut weight = || rng.power_of_ten(-1.0, 1.0);
    let q = SMatrix::from_diagonal(&SVector::from_fn(|_, _| weight()));
    let r = SMatrix::from_diagonal(&SVector::from_fn(|_, _| weight()));
    let p = SMatrix::from_diagonal(&SVector::from_fn(|_, _| weight()));
    let target = rng.matrix::<NX, 1>() * 3.0;
    for stage in &mut ocp.stages {
        (stage.q, stage.r) = (q, r);
        stage.s = rng.matrix() * 0.02;
        stage.linear_x = -q * target;
    }
    ocp.terminal.p = p;
    ocp.terminal.linear_x = -p * target;
}

/// Bounds at distances of 0.05 to 1 from a trajectory with inputs between -0.9 and 0.9.
fn bounds<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
    kind: Kind,
) {
    let mut x = ocp.x0;
    for stage in &mut ocp.stages {
        let u = SVector::<f64, NU>::from_fn(|_, _| rng.uniform(-0.9, 0.9));
        stage.u.lower.fill(-1.0);
        stage.u.upper.fill(1.0);
        stage.x = around(rng, &x);
        stage.rows = around(rng, &(stage.row_x * x + stage.row_u * u));
        x = stage.a * x + stage.b * u + stage.c;
    }
    ocp.terminal.x = around(rng, &x);
    ocp.terminal.rows = around(rng, &(ocp.terminal.row_x * x));
    if kind == Kind::TerminalEquality {
        ocp.terminal.equality = Some(x);
    }
}

fn around<const K: usize>(rng: &mut Rng, value: &SVector<f64, K>) -> Bounds<f64, K> {
    let mut bounds = Bounds::none();
    for j in 0..K {
        if rng.chance(0.3) {
            bounds.lower[j] = value[j] - rng.uniform(0.05, 1.0);
        }
        if rng.chance(0.3) {
            bounds.upper[j] = value[j] + rng.uniform(0.05, 1.0);
        }
    }
    bounds
}

/// A linear price, a quadratic price, or both, by component.
fn prices<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    fn soft<const K: usize>(rng: &mut Rng) -> Softness<f64, K> {
        std::array::from_fn(|_| {
            let (linear, quadratic) = (rng.power_of_ten(-1.0, 1.0), rng.power_of_ten(-1.0, 1.0));
            [
                None,
                Some(Penalty { linear, quadratic }),
                Some(Penalty {
                    linear,
                    quadratic: 0.0,
                }),
                Some(Penalty {
                    linear: 0.0,
                    quadratic,
                }),
            ][rng.index(4)]
        })
    }
    for stage in &mut ocp.stages {
        (stage.soft_x, stage.soft_rows) = (soft(rng), soft(rng));
    }
    (ocp.terminal.soft_x, ocp.terminal.soft_rows) = (soft(rng), soft(rng));
}

/// Room for any search that ends, and the given start.
pub fn settings(warm_start: WarmStart) -> SolverSettings<f64> {
    SolverSettings {
        max_changes: 5_000,
        warm_start,
        ..SolverSettings::default()
    }
}

/// The answer from a cold start.
pub fn solve<const NX: usize, const NU: usize, const N: usize, const M: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
) -> Solution<f64, NX, NU, N, M> {
    let mut solution = Solution::default();
    Workspace::new().solve(ocp, &settings(WarmStart::Cold), &mut solution);
    solution
}
