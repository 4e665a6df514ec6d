//! Single precision beside double precision, on problems whose numbers single precision holds
//! exactly: what differs is the arithmetic alone.

use crate::numbers;
use crate::optimality::{Answer, residual};
use crate::support::rng::Rng;
use crate::well_scaled::{Kind, problem, solve};
use lpvmpc::{
    Bounds, Ocp, Penalty, Softness, Solution, SolverSettings, Stage, Terminal, WarmStart, Workspace,
};
use nalgebra::{SMatrix, SVector};

const NX: usize = 4;
const NU: usize = 2;
const N: usize = 10;
const NG: usize = 1;
const M: usize = 80;
type Problem = Ocp<f64, NX, NU, N, NG>;

const PROBLEMS: u64 = 3_000;

fn narrow<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> SMatrix<f32, R, C> {
    m.map(|entry| entry as f32)
}

fn narrow_bounds<const K: usize>(bounds: &Bounds<f64, K>) -> Bounds<f32, K> {
    Bounds {
        lower: narrow(&bounds.lower),
        upper: narrow(&bounds.upper),
    }
}

fn narrow_prices<const K: usize>(soft: &Softness<f64, K>) -> Softness<f32, K> {
    soft.map(|price| {
        price.map(|Penalty { linear, quadratic }| Penalty {
            linear: linear as f32,
            quadratic: quadratic as f32,
        })
    })
}

fn narrow_stage(stage: &Stage<f64, NX, NU, NG>) -> Stage<f32, NX, NU, NG> {
    Stage {
        a: narrow(&stage.a),
        b: narrow(&stage.b),
        c: narrow(&stage.c),
        q: narrow(&stage.q),
        r: narrow(&stage.r),
        s: narrow(&stage.s),
        linear_x: narrow(&stage.linear_x),
        linear_u: narrow(&stage.linear_u),
        x: narrow_bounds(&stage.x),
        soft_x: narrow_prices(&stage.soft_x),
        u: narrow_bounds(&stage.u),
        row_x: narrow(&stage.row_x),
        row_u: narrow(&stage.row_u),
        rows: narrow_bounds(&stage.rows),
        soft_rows: narrow_prices(&stage.soft_rows),
    }
}

fn narrow_problem(ocp: &Problem) -> Ocp<f32, NX, NU, N, NG> {
    let end = &ocp.terminal;
    Ocp {
        x0: narrow(&ocp.x0),
        stages: ocp.stages.each_ref().map(narrow_stage),
        terminal: Terminal {
            p: narrow(&end.p),
            linear_x: narrow(&end.linear_x),
            x: narrow_bounds(&end.x),
            soft_x: narrow_prices(&end.soft_x),
            row_x: narrow(&end.row_x),
            rows: narrow_bounds(&end.rows),
            soft_rows: narrow_prices(&end.soft_rows),
            equality: end.equality.map(|target| narrow(&target)),
        },
        horizon: ocp.horizon,
    }
}

fn solve_in_single(ocp: &Problem) -> Solution<f32, NX, NU, N, M> {
    let settings = SolverSettings {
        max_changes: 5_000,
        warm_start: WarmStart::Cold,
        ..SolverSettings::default()
    };
    let mut solution = Solution::default();
    Workspace::new().solve(&narrow_problem(ocp), &settings, &mut solution);
    solution
}

/// Single precision holds every number of the problem.
fn rounded(mut ocp: Problem) -> Problem {
    numbers::each(&mut ocp, &mut |v| *v = f64::from(*v as f32));
    ocp
}

/// The problem with its cost `factor` times as large.
fn dearer(mut ocp: Problem, factor: f64) -> Problem {
    let price = |price: &mut Penalty<f64>| {
        price.linear *= factor;
        price.quadratic *= factor;
    };
    for stage in &mut ocp.stages {
        stage.q *= factor;
        stage.r *= factor;
        stage.s *= factor;
        stage.linear_x *= factor;
        stage.linear_u *= factor;
        stage.soft_x.iter_mut().flatten().for_each(price);
        stage.soft_rows.iter_mut().flatten().for_each(price);
    }
    ocp.terminal.p *= factor;
    ocp.terminal.linear_x *= factor;
    ocp.terminal.soft_x.iter_mut().flatten().for_each(price);
    ocp.terminal.soft_rows.iter_mut().flatten().for_each(price);
    ocp
}

/// The problem with states, inputs and their bounds `factor` times as large.
fn larger(mut ocp: Problem, factor: f64) -> Problem {
    fn scale<const K: usize>(bounds: &mut Bounds<f64, K>, factor: f64) {
        bounds.lower *= factor;
        bounds.upper *= factor;
    }
    let price = |price: &mut Penalty<f64>| price.linear *= factor;
    ocp.x0 *= factor;
    for stage in &mut ocp.stages {
        stage.c *= factor;
        stage.linear_x *= factor;
        stage.linear_u *= factor;
        scale(&mut stage.x, factor);
        scale(&mut stage.u, factor);
        scale(&mut stage.rows, factor);
        stage.soft_x.iter_mut().flatten().for_each(price);
        stage.soft_rows.iter_mut().flatten().for_each(price);
    }
    let end = &mut ocp.terminal;
    end.linear_x *= factor;
    scale(&mut end.x, factor);
    scale(&mut end.rows, factor);
    end.soft_x.iter_mut().flatten().for_each(price);
    end.soft_rows.iter_mut().flatten().for_each(price);
    end.equality = end.equality.map(|target| target * factor);
    ocp
}

/// Median and largest of some numbers.
fn median_and_largest(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    (values[values.len() / 2], values[values.len() - 1])
}

/// Largest difference of an input between the precisions, in units of its bound, and largest
/// violation of an optimality condition by the single-precision answer, by the median and the
/// worst of all problems.
struct Accuracy {
    difference: (f64, f64),
    residual: (f64, f64),
}

/// Solves all problems after `change`, which multiplies their inputs by `size`.
fn measure(kind: Kind, size: f64, change: fn(Problem) -> Problem) -> Accuracy {
    let (mut differences, mut residuals) = (Vec::new(), Vec::new());
    for seed in 0..PROBLEMS {
        let ocp = rounded(change(*problem(&mut Rng::new(seed), kind)));
        let double: Solution<f64, NX, NU, N, M> = solve(&ocp);
        let single = solve_in_single(&ocp);
        assert!(
            double.status.is_solved(),
            "{kind:?} {seed}: {}",
            double.status
        );
        if !single.status.is_solved() {
            println!("FAIL {kind:?} {seed}: {} after {} (f64: {} changes, {} active)", single.status, single.changes, double.changes, double.active.len());
            continue;
        }
        let answer = Answer::of(&single);
        let pairs = double.u.iter().zip(&answer.u);
        let difference = pairs.map(|(a, b): (&SVector<_, NU>, _)| (a - b).amax());
        differences.push(difference.fold(0.0, f64::max) / size);
        residuals.push(residual(&ocp, &answer));
    }
    let accuracy = Accuracy {
        difference: median_and_largest(differences),
        residual: median_and_largest(residuals),
    };
    println!(
        "{kind:?}: inputs differ by {:.1e} (median), {:.1e} (largest); residual {:.1e}, {:.1e}",
        accuracy.difference.0, accuracy.difference.1, accuracy.residual.0, accuracy.residual.1
    );
    accuracy
}

#[test]
fn well_scaled_problems() {
    for kind in Kind::ALL {
        measure(kind, 1.0, |ocp| ocp);
    }
}

#[test]
fn a_dear_cost() {
    for kind in Kind::ALL {
        measure(kind, 1.0, |ocp| dearer(ocp, 1e4));
    }
}

#[test]
fn large_bounds() {
    for kind in Kind::ALL {
        measure(kind, 1e4, |ocp| larger(ocp, 1e4));
    }
}
