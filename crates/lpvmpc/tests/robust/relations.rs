//! Relations between answers that hold for every problem: where a search begins never changes
//! where it ends, a dearer problem has dearer multipliers, a mirror image the mirrored answer.

use crate::optimality::{Answer, residual};
use crate::support::rng::Rng;
use crate::well_scaled::{Kind, problem, settings, solve};
use lpvmpc::{BoundId, Bounds, Ocp, Penalty, Side, Solution, WarmStart, Workspace};
use nalgebra::SVector;
use proptest::prelude::*;

const NX: usize = 4;
const NU: usize = 2;
const N: usize = 10;
const NG: usize = 1;
const M: usize = 80;
type Problem = Ocp<f64, NX, NU, N, NG>;
type Plan = Solution<f64, NX, NU, N, M>;

/// Inputs agree to this, relative to themselves or, if they are smaller, to 1.
const AGREEMENT: f64 = 1e-9;

fn random_problem(seed: u64) -> Problem {
    let mut rng = Rng::new(seed);
    let kind = Kind::ALL[rng.index(Kind::ALL.len())];
    *problem(&mut rng, kind)
}

fn solve_from(ocp: &Problem, start: WarmStart, before: &Plan) -> Plan {
    let mut solution = before.clone();
    Workspace::new().solve(ocp, &settings(start), &mut solution);
    solution
}

/// What may be in a solution that is handed in as a warm start, all with the active set of
/// `other`.
fn pasts(own: &Plan, other: &Plan) -> [Plan; 3] {
    let mut spoiled = other.clone();
    spoiled.u.fill(SVector::repeat(f64::NAN));
    spoiled.x.fill(SVector::repeat(f64::INFINITY));
    (spoiled.cost, spoiled.changes) = (f64::NAN, usize::MAX);
    [own.clone(), other.clone(), spoiled]
}

fn assert_same_inputs(one: &Plan, other: &Plan) -> Result<(), TestCaseError> {
    for (stage, (a, b)) in one.u.iter().zip(&other.u).enumerate() {
        let scale = a.amax().max(1.0);
        prop_assert!(
            (a - b).amax() <= AGREEMENT * scale,
            "stage {}: {} {}",
            stage,
            a,
            b
        );
    }
    Ok(())
}

/// The multiplier of a bound, over all parts of its price.
fn multiplier(plan: &Plan, bound: BoundId) -> f64 {
    let rows = plan.active.iter().filter(|row| row.bound == bound);
    rows.map(|row| row.multiplier).sum()
}

/// `other` has the multipliers of `one` times `factor`, bound by bound. In a mirror image a bound
/// is on the other side, and the multiplier of an equality has the other sign.
fn assert_multipliers(
    one: &Plan,
    other: &Plan,
    factor: f64,
    image: fn(BoundId) -> (BoundId, f64),
) -> Result<(), TestCaseError> {
    let sizes = one.active.iter().map(|row| row.multiplier.abs());
    let largest = sizes.fold(1.0, f64::max);
    let bounds = one.active.iter().map(|row| row.bound);
    let images = other.active.iter().map(|row| image(row.bound).0);
    for bound in bounds.chain(images) {
        let (place, sign) = image(bound);
        let (a, b) = (multiplier(one, bound) * sign, multiplier(other, place));
        prop_assert!(
            (a * factor - b).abs() <= 1e-7 * largest * factor,
            "{}: {} {}",
            bound,
            a,
            b
        );
    }
    Ok(())
}

/// The problem with all prices multiplied by `factor`.
fn dearer(ocp: &Problem, factor: f64) -> Problem {
    let price = |soft: Option<Penalty<f64>>| {
        soft.map(|price| Penalty {
            linear: price.linear * factor,
            quadratic: price.quadratic * factor,
        })
    };
    let mut dear = ocp.clone();
    for stage in &mut dear.stages {
        stage.q *= factor;
        stage.r *= factor;
        stage.s *= factor;
        stage.linear_x *= factor;
        stage.linear_u *= factor;
        stage.soft_x = stage.soft_x.map(price);
        stage.soft_rows = stage.soft_rows.map(price);
    }
    let end = &mut dear.terminal;
    end.p *= factor;
    end.linear_x *= factor;
    end.soft_x = end.soft_x.map(price);
    end.soft_rows = end.soft_rows.map(price);
    dear
}

/// The problem in -x and -u.
fn mirrored(ocp: &Problem) -> Problem {
    fn flip<const K: usize>(bounds: &mut Bounds<f64, K>) {
        (bounds.lower, bounds.upper) = (-bounds.upper, -bounds.lower);
    }
    let mut mirror = ocp.clone();
    mirror.x0.neg_mut();
    for stage in &mut mirror.stages {
        stage.c.neg_mut();
        stage.linear_x.neg_mut();
        stage.linear_u.neg_mut();
        flip(&mut stage.x);
        flip(&mut stage.u);
        flip(&mut stage.rows);
    }
    let end = &mut mirror.terminal;
    end.linear_x.neg_mut();
    flip(&mut end.x);
    flip(&mut end.rows);
    end.equality = end.equality.map(|target| -target);
    mirror
}

fn other_side(bound: BoundId) -> (BoundId, f64) {
    let (side, sign) = match bound.side {
        Side::Lower => (Side::Upper, 1.0),
        Side::Upper => (Side::Lower, 1.0),
        Side::Equality => (Side::Equality, -1.0),
    };
    (BoundId { side, ..bound }, sign)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 1_000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_warm_start_never_changes_the_answer(seed: u64, other: u64) {
        let ocp = random_problem(seed);
        let own = solve(&ocp);
        prop_assert!(own.status.is_solved(), "{}", own.status);
        prop_assert!(residual(&ocp, &Answer::of(&own)) <= AGREEMENT);
        for past in pasts(&own, &solve(&random_problem(other))) {
            for start in [WarmStart::Cold, WarmStart::Same, WarmStart::Shifted] {
                let warm = solve_from(&ocp, start, &past);
                prop_assert!(warm.status.is_solved(), "{}", warm.status);
                assert_same_inputs(&own, &warm)?;
                prop_assert!(residual(&ocp, &Answer::of(&warm)) <= AGREEMENT);
            }
        }
    }

    #[test]
    fn multipliers_scale_with_the_cost_and_inputs_stay(seed: u64, exponent in -4.0..4.0f64) {
        let factor = 10f64.powf(exponent);
        let ocp = random_problem(seed);
        let (one, dear) = (solve(&ocp), solve(&dearer(&ocp, factor)));
        prop_assert!(one.status.is_solved() && dear.status.is_solved());
        assert_same_inputs(&one, &dear)?;
        assert_multipliers(&one, &dear, factor, |bound| (bound, 1.0))?;
        let scale = one.cost.abs().max(1.0) * factor;
        prop_assert!((one.cost * factor - dear.cost).abs() <= AGREEMENT * scale);
    }

    #[test]
    fn the_mirror_image_has_the_mirrored_answer(seed: u64) {
        let ocp = random_problem(seed);
        let (one, mut mirror) = (solve(&ocp), solve(&mirrored(&ocp)));
        prop_assert!(one.status.is_solved() && mirror.status.is_solved());
        mirror.u.iter_mut().for_each(SVector::neg_mut);
        assert_same_inputs(&one, &mirror)?;
        assert_multipliers(&one, &mirror, 1.0, other_side)?;
        prop_assert_eq!(one.changes, mirror.changes);
    }
}

/// The relations would mean little where no bound is active.
#[test]
fn most_problems_have_active_bounds() {
    let active: Vec<usize> = (0..1_000)
        .map(|seed| {
            let plan = solve::<NX, NU, N, M, NG>(&random_problem(seed));
            let rows = plan.active.iter();
            rows.filter(|row| row.bound.side != Side::Equality).count()
        })
        .collect();
    let some = active.iter().filter(|count| **count > 0).count();
    let many = active.iter().filter(|count| **count > 5).count();
    println!(
        "{some} with, {many} with more than 5, most {:?}",
        active.iter().max()
    );
    assert!(some > 950 && many > 500, "{some} {many}");
}
