//! What the solver says of problems that rounding makes hard: models that grow threefold per stage,
//! and inputs that are millions of times smaller than what the regulator would ask for.

use super::support::census::Counts;
use super::support::precision::single;
use super::support::{kind, solve, solve_with};
use lpvmpc::{
    ActiveSet, Bounds, Common, List, Ocp, Penalty, Quantity, Scalar, Side, Solution,
    SolverSettings, Status, WarmStart, infeasibility_margin, kkt_residual,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, SMatrix, SVector};

const N: usize = 20;

/// A model whose largest eigenvalue is `radius` per stage, and quadratic costs.
fn model<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    radius: f64,
    horizon: usize,
) -> Ocp<f64, NX, NU> {
    let a: SMatrix<f64, NX, NX> = rng.matrix();
    let eigenvalues = DMatrix::from_column_slice(NX, NX, a.as_slice()).complex_eigenvalues();
    let largest = eigenvalues.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let a = a * (radius / largest);
    let b: SMatrix<f64, NX, NU> = rng.matrix();
    let mut ocp = Ocp::allocate(N);
    ocp.horizon = horizon;
    ocp.own = List::repeat(Common::default(), N);
    for (stage, common) in ocp.stages.iter_mut().zip(&mut ocp.own) {
        (stage.a, stage.b) = (a, b);
        common.q = SMatrix::identity();
        common.r = SMatrix::identity() * rng.power_of_ten(-4.0, 1.0);
    }
    ocp.terminal.p = SMatrix::identity();
    ocp
}

/// Bounds with a tenth to a third of their size as room on both sides of a trajectory.
fn feasible<const NX: usize, const NU: usize>(rng: &mut Rng, horizon: usize) -> Ocp<f64, NX, NU> {
    let mut ocp = model(rng, 3.0, horizon);
    ocp.x0 = rng.matrix();
    let mut x: SVector<f64, NX> = ocp.x0;
    for i in 0..horizon {
        let u: SVector<f64, NU> = rng.matrix();
        let room = SVector::repeat(rng.uniform(0.1, 0.3));
        ocp.own[i].u = Bounds {
            lower: u - room,
            upper: u + room,
        };
        x = ocp.stages[i].a * x + ocp.stages[i].b * u;
        let room = x.map(|x: f64| x.abs().max(1.0)) * rng.uniform(0.1, 0.3);
        let bounds = Bounds {
            lower: x - room,
            upper: x + room,
        };
        if i + 1 < horizon {
            ocp.own[i + 1].x = bounds;
        } else {
            ocp.terminal.x = bounds;
        }
    }
    ocp
}

fn answer<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
) -> Solution<T, NX, NU> {
    let settings = SolverSettings {
        warm_start: WarmStart::Cold,
        max_changes: Some(2000),
        ..SolverSettings::default()
    };
    let solution = solve_with(ocp, &settings);
    for (i, u) in solution.u.iter().enumerate().take(ocp.horizon) {
        assert!(
            ocp.common_at(i).u.contains(u, T::zero()),
            "{u} outside its bounds"
        );
    }
    solution
}

/// The verdict in `f64`; what is called solved is optimal.
fn judged<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Status<f64> {
    let solution = answer(ocp);
    if solution.status.is_solved() {
        let residual = kkt_residual(ocp, &solution);
        assert!(residual.largest() <= 1e-6, "{residual:?}");
    }
    solution.status
}

#[test]
fn no_feasible_problem_of_an_unstable_model_is_called_infeasible() {
    let (mut double, mut float) = (Counts::default(), Counts::default());
    for seed in 0..1500 {
        let rng = &mut Rng::new(seed);
        let horizon = 2 + rng.index(N - 1);
        let ocp = feasible::<4, 1>(rng, horizon);
        double.add(kind(&judged(&ocp)));
        float.add(kind(&answer(&single(&ocp)).status));
        let ocp = feasible::<4, 2>(rng, horizon);
        double.add(kind(&judged(&ocp)));
        float.add(kind(&answer(&single(&ocp)).status));
    }
    println!("f64: {double}\nf32: {float}");
    assert_eq!(double.of("infeasible"), 0);
    assert_eq!(float.of("infeasible"), 0);
    // Threefold in each of 20 stages is 3e9: more than `f32` can tell from nothing.
    assert!(double.of("solved") >= 2970);
    assert!(float.of("solved") >= 1800);
}

#[test]
fn input_bounds_alone_are_never_infeasible() {
    let (mut double, mut float) = (Counts::default(), Counts::default());
    for seed in 0..1500 {
        let rng = &mut Rng::new(seed);
        let (radius, horizon) = (rng.uniform(0.5, 2.0), 2 + rng.index(N - 1));
        let mut ocp = model::<4, 1>(rng, radius, horizon);
        ocp.x0 = rng.matrix() * rng.power_of_ten(0.0, 8.0);
        for common in &mut ocp.own {
            common.u = Bounds {
                lower: SVector::repeat(-1.0),
                upper: SVector::repeat(1.0),
            };
        }
        double.add(kind(&judged(&ocp)));
        float.add(kind(&answer(&single(&ocp)).status));
    }
    println!("f64: {double}\nf32: {float}");
    assert_eq!(double.of("solved"), 1500);
    assert_eq!(float.of("infeasible"), 0);
    assert!(float.of("solved") >= 1485);
}

/// A cart that starts beyond the end of its track: the track is the cause, not an input far ahead.
#[test]
fn the_earliest_cause_is_named_and_proved() {
    let mut ocp = Ocp::<f64, 2, 1>::allocate(N);
    ocp.x0 = SVector::from([0.5, 0.0]);
    for stage in &mut ocp.stages {
        stage.a = SMatrix::from_row_slice(&[1.0, 0.1, 0.0, 1.0]);
        stage.b = SMatrix::from([[0.005, 0.1]]);
    }
    (ocp.common.q, ocp.common.r) = (SMatrix::identity(), SMatrix::identity());
    ocp.common.u = Bounds {
        lower: SVector::from([-1.0]),
        upper: SVector::from([1.0]),
    };
    ocp.common.x.upper[0] = 0.4;
    ocp.terminal.p = SMatrix::identity();
    let solution = answer(&ocp);
    let Status::Infeasible(bound) = solution.status else {
        panic!("{}", solution.status);
    };
    assert_eq!(bound.quantity, Quantity::State(0));
    assert!(bound.stage < 12, "{bound}");
    assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
    // With room for the start the same multipliers prove nothing.
    ocp.common.x.upper[0] = 0.6;
    assert!(infeasibility_margin(&ocp, &solution.active) <= 0.0);
    assert!(infeasibility_margin(&ocp, &ActiveSet::with_capacity(0)) <= 0.0);
    assert_eq!(kind(&solve(&ocp).status), "solved");
}

/// A cart that is too fast for the end of its track. The proof was all bounds that the interior-point method had a multiplier
/// for, those of the other end of the track among them, and the bound of the input, without which there is no contradiction,
/// was not in it.
#[test]
fn a_proof_names_what_contradicts_each_other() {
    for (x0, target) in [([0.48, 2.0], 1.0), ([0.2, 1.5], 0.5), ([0.4, 3.0], 1.0)] {
        let mut ocp = Ocp::<f64, 2, 1>::allocate(30);
        ocp.x0 = SVector::from(x0);
        let q = SMatrix::from_diagonal(&SVector::from([1.0, 0.1]));
        for stage in &mut ocp.stages {
            stage.a = SMatrix::from_row_slice(&[1.0, 0.1, 0.0, 1.0]);
            stage.b = SMatrix::from([[0.005, 0.1]]);
            stage.linear_x = SVector::from([-target, 0.0]);
        }
        (ocp.common.q, ocp.common.r) = (q, SMatrix::from([[0.01]]));
        (ocp.terminal.p, ocp.terminal.linear_x) = (q, SVector::from([-target, 0.0]));
        ocp.common.u = Bounds {
            lower: SVector::from([-1.0]),
            upper: SVector::from([1.0]),
        };
        (ocp.common.x.lower[0], ocp.common.x.upper[0]) = (-0.2, 0.5);
        ocp.terminal.x = ocp.common.x;
        let solution = answer(&ocp);
        assert_eq!(kind(&solution.status), "infeasible");
        assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
        let mut inputs = 0;
        for row in solution.active.iter() {
            let side = match row.bound.quantity {
                Quantity::Input(_) => Side::Lower,
                _ => Side::Upper,
            };
            inputs += usize::from(side == Side::Lower);
            assert_eq!(row.bound.side, side, "{x0:?}: {}", row.bound);
        }
        assert!(inputs > 0, "{x0:?}");
    }
}

/// A soft bound of a state makes no terminal equality of it soft: what cannot be reached is proved to be out of reach.
#[test]
fn a_soft_bound_leaves_a_terminal_equality_as_hard_as_it_is() {
    for soft in [[false, false], [true, false], [false, true], [true, true]] {
        let mut ocp = Ocp::<f64, 2, 1>::allocate(1);
        ocp.stages[0].a = SMatrix::zeros();
        ocp.stages[0].b = SVector::from([1.0, 0.0]);
        ocp.common.r[(0, 0)] = 1.0;
        ocp.common.u = Bounds {
            lower: SVector::from([-1.0]),
            upper: SVector::from([1.0]),
        };
        ocp.terminal.equality = Some(SVector::from([0.0, 1.0]));
        for (price, soft) in ocp.terminal.soft_x.iter_mut().zip(soft) {
            *price = soft.then_some(Penalty {
                linear: 1.0,
                quadratic: 0.0,
            });
        }
        let solution = solve(&ocp);
        assert!(
            matches!(solution.status, Status::Infeasible(_)),
            "{soft:?}: {}",
            solution.status
        );
        assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
    }
}
