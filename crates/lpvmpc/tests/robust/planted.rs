//! One mistake in a problem that is otherwise in order: the status says which.

use crate::numbers;
use crate::support::rng::Rng;
use crate::well_scaled::{Kind, problem, settings, solve};
use lpvmpc::{
    BoundId, Ocp, Quantity, Side, Solution, SolverSettings, Stage, Status, WarmStart, Workspace,
};
use nalgebra::SVector;

const NX: usize = 3;
const NU: usize = 2;
const N: usize = 5;
const NG: usize = 2;
const M: usize = 40;
type Problem = Ocp<f64, NX, NU, N, NG>;
type Plan = Solution<f64, NX, NU, N, M>;

const PROBLEMS: u64 = 3_000;

/// Plants a mistake in `PROBLEMS` problems of every kind, and hands the answers to `check`.
fn plant(mistake: impl Fn(&mut Rng, &mut Problem), check: impl Fn(&Problem, &Plan)) {
    for kind in Kind::ALL {
        for seed in 0..PROBLEMS {
            let mut rng = Rng::new(seed);
            let mut ocp: Problem = *problem(&mut rng, kind);
            mistake(&mut rng, &mut ocp);
            println!("{kind:?} {seed}");
            check(&ocp, &solve(&ocp));
        }
    }
}

/// A number of the problem that every answer depends on, whatever bounds are active.
fn essential<'a>(rng: &mut Rng, ocp: &'a mut Problem) -> &'a mut f64 {
    let i = rng.index(N);
    let (row, column, input) = (rng.index(NX), rng.index(NX), rng.index(NU));
    let Stage { a, b, c, q, r, s, linear_x, linear_u, .. } = &mut ocp.stages[i];
    match rng.index(11) {
        0 => &mut a[(row, column)],
        1 => &mut b[(row, input)],
        2 => &mut c[row],
        3 => &mut q[(row, column)],
        4 => &mut r[(input, input)],
        5 => &mut s[(input, column)],
        6 => &mut linear_x[row],
        7 => &mut linear_u[input],
        8 => &mut ocp.terminal.p[(row, column)],
        9 => &mut ocp.terminal.linear_x[row],
        _ => &mut ocp.x0[row],
    }
}

fn assert_not_finite(plan: &Plan) {
    let told = match &plan.status {
        Status::NotFinite => true,
        Status::NumericalFailure { pivot, .. } => !pivot.is_finite(),
        _ => false,
    };
    assert!(told, "{}", plan.status);
}

#[test]
fn a_number_that_is_none() {
    plant(
        |rng, ocp| *essential(rng, ocp) = f64::NAN,
        |_, plan| assert_not_finite(plan),
    );
}

/// An infinite weight may make a pivot of the factorisation negative before it makes it NaN.
#[test]
fn an_infinite_number() {
    plant(
        |rng, ocp| {
            let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
            *essential(rng, ocp) = sign * f64::INFINITY;
        },
        |_, plan| {
            let failed = matches!(
                plan.status,
                Status::NotFinite | Status::NumericalFailure { .. }
            );
            assert!(failed, "{}", plan.status);
        },
    );
}

#[test]
fn a_terminal_state_that_is_none() {
    plant(
        |rng, ocp| {
            let mut target = ocp.terminal.equality.unwrap_or_default();
            target[rng.index(NX)] = f64::NAN;
            ocp.terminal.equality = Some(target);
        },
        |_, plan| assert_not_finite(plan),
    );
}

#[test]
fn a_bound_or_a_price_that_is_none() {
    plant(
        |rng, ocp| {
            let stage = &mut ocp.stages[1 + rng.index(N - 1)];
            let price = lpvmpc::Penalty { linear: 1.0, quadratic: f64::NAN };
            match rng.index(7) {
                0 => stage.u.lower[rng.index(NU)] = f64::NAN,
                1 => stage.u.upper[rng.index(NU)] = f64::NAN,
                2 => stage.x.upper[rng.index(NX)] = f64::NAN,
                3 => stage.rows.lower[rng.index(NG)] = f64::NAN,
                4 => ocp.terminal.x.lower[rng.index(NX)] = f64::NAN,
                5 => ocp.terminal.rows.upper[rng.index(NG)] = f64::NAN,
                _ => stage.soft_x[rng.index(NX)] = Some(price),
            }
        },
        |_, plan| assert_not_finite(plan),
    );
}

/// R so negative that no horizon makes up for it, at any stage: named with its pivot.
#[test]
fn a_negative_input_weight() {
    for stage in 0..N {
        plant(
            |_, ocp| ocp.stages[stage].r *= -1e6,
            |_, plan| match plan.status {
                Status::NumericalFailure { stage: named, pivot } => {
                    assert_eq!(named, stage);
                    assert!(pivot < 0.0, "{pivot}");
                }
                status => panic!("{status}"),
            },
        );
    }
}

/// lower > upper on an input: infeasible, and it is this input that is named.
#[test]
fn contradictory_input_bounds() {
    for stage in 0..N {
        plant(
            |_, ocp| {
                let bounds = &mut ocp.stages[stage].u;
                (bounds.lower[1], bounds.upper[1]) = (0.5, -0.5);
            },
            |_, plan| assert!(matches!(plan.status, Status::Infeasible(_)), "{}", plan.status),
        );
    }
}

/// In a problem without other bounds the named bound is one of the two.
#[test]
fn contradictory_bounds_alone() {
    for seed in 0..PROBLEMS {
        let mut rng = Rng::new(seed);
        let mut ocp: Problem = *problem(&mut rng, Kind::Hard);
        lift_all_bounds(&mut ocp);
        let stage = rng.index(N);
        let (lower, upper) = (rng.uniform(-1.0, 1.0), rng.power_of_ten(-4.0, 2.0));
        let (lower, upper) = (lower, lower - upper);
        let quantity = match rng.index(3) {
            0 => {
                let bounds = &mut ocp.stages[stage].u;
                (bounds.lower[1], bounds.upper[1]) = (lower, upper);
                Quantity::Input(1)
            }
            1 if stage > 0 => {
                let bounds = &mut ocp.stages[stage].x;
                (bounds.lower[2], bounds.upper[2]) = (lower, upper);
                Quantity::State(2)
            }
            _ => {
                let bounds = &mut ocp.stages[stage].rows;
                (bounds.lower[0], bounds.upper[0]) = (lower, upper);
                Quantity::Row(0)
            }
        };
        let plan: Plan = solve(&ocp);
        let Status::Infeasible(named) = plan.status else {
            panic!("{seed}: {}", plan.status);
        };
        assert_eq!((named.stage, named.quantity), (stage, quantity), "{seed}");
    }
}

fn lift_all_bounds(ocp: &mut Problem) {
    let free = Stage::<f64, NX, NU, NG>::new();
    for stage in &mut ocp.stages {
        (stage.x, stage.u, stage.rows) = (free.x, free.u, free.rows);
    }
    (ocp.terminal.x, ocp.terminal.rows) = (free.x, free.rows);
}

/// A lower bound at plus infinity is beyond every reach, and worse than any other.
#[test]
fn a_lower_bound_at_plus_infinity() {
    let at = |stage, quantity| BoundId {
        stage,
        quantity,
        side: Side::Lower,
    };
    for stage in 1..N {
        let plants: [(fn(&mut Stage<f64, NX, NU, NG>), Quantity); 3] = [
            (|stage| stage.u.lower[0] = f64::INFINITY, Quantity::Input(0)),
            (|stage| stage.x.lower[1] = f64::INFINITY, Quantity::State(1)),
            (|stage| stage.rows.lower[1] = f64::INFINITY, Quantity::Row(1)),
        ];
        for (mistake, quantity) in plants {
            plant(
                |_, ocp| mistake(&mut ocp.stages[stage]),
                |_, plan| assert_eq!(plan.status, Status::Infeasible(at(stage, quantity))),
            );
        }
    }
}

/// With one stage and no effect of the inputs, any other terminal state is out of reach.
#[test]
fn a_terminal_state_out_of_reach() {
    plant(
        |rng, ocp| {
            lift_all_bounds(ocp);
            for stage in &mut ocp.stages {
                stage.b.fill(0.0);
            }
            ocp.terminal.equality = Some(SVector::repeat(1e3) + rng.matrix());
        },
        |_, plan| match plan.status {
            Status::Infeasible(bound) => assert_eq!((bound.stage, bound.side), (N, Side::Equality)),
            status => panic!("{status}"),
        },
    );
}

/// What lies behind the horizon is not read, and a horizon out of range is the nearest in range.
#[test]
fn stages_behind_the_horizon() {
    for seed in 0..PROBLEMS {
        let mut rng = Rng::new(seed);
        let mut ocp: Problem = *problem(&mut rng, Kind::Soft);
        for (asked, used) in [(0, 1), (1, 1), (3, 3), (N + 1, N), (usize::MAX, N)] {
            ocp.horizon = used;
            let plain: Plan = solve(&ocp);
            let mut spoiled = ocp.clone();
            spoiled.horizon = asked;
            let template = spoil_all(&ocp);
            spoiled.stages[used..].clone_from_slice(&template.stages[used..]);
            let same: Plan = solve(&spoiled);
            assert_eq!(plain.status, same.status, "{seed}");
            assert_eq!(plain.u, same.u, "{seed}");
        }
    }
}

/// The problem with NaN for every number.
fn spoil_all(ocp: &Problem) -> Problem {
    let mut spoiled = ocp.clone();
    numbers::each(&mut spoiled, &mut |v| *v = f64::NAN);
    spoiled
}

/// The cap is kept to the change, and the fallback within the input bounds; without active
/// bounds no change is needed.
#[test]
fn the_cap_on_changes() {
    let mut capped = 0;
    for seed in 0..PROBLEMS {
        let ocp: Problem = *problem(&mut Rng::new(seed), Kind::Hard);
        let full: Plan = solve(&ocp);
        for max_changes in 0..=full.changes {
            let settings = SolverSettings {
                max_changes,
                ..settings(WarmStart::Cold)
            };
            let mut plan = Plan::default();
            Workspace::new().solve(&ocp, &settings, &mut plan);
            if max_changes == full.changes {
                assert_eq!(plan.status, Status::Solved);
                assert_eq!(plan.u, full.u);
            } else {
                assert_eq!(plan.status, Status::ChangeCap);
                assert_eq!(plan.changes, max_changes);
                capped += 1;
            }
            let mut inputs = plan.u.iter().zip(&ocp.stages);
            assert!(inputs.all(|(u, stage)| stage.u.contains(u, 0.0)));
        }
    }
    assert!(capped > 1_000, "{capped}");
}
