//! Arbitrary numbers: whatever a problem, a setting or a warm start contains, the solver ends,
//! keeps the inputs finite and within their bounds, and does not call a bad answer solved.

use crate::numbers;
use crate::optimality::{Answer, residual};
use crate::support::rng::Rng;
use crate::well_scaled::{self, Kind};
use lpvmpc::{
    BoundId, Bounds, Ocp, Penalty, Quantity, Side, Softness, Solution, SolverSettings, Status,
    WarmStart, Workspace,
};
use nalgebra::{SMatrix, SVector};
use std::collections::BTreeMap;

/// "Solved" means that the conditions of optimality hold to this, relative to their terms, where
/// the numbers of the problem are of moderate size.
const OPTIMALITY: f64 = 1e-7;

/// What a problem of the campaign is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Origin {
    /// Well scaled and feasible.
    Sound,
    /// Small numbers, many of them zero; bounds that may contradict each other.
    Coarse,
    /// Sound, but for one to three numbers.
    Spoiled,
    /// Sound, but with some numbers multiplied by the same huge or tiny factor.
    Stretched,
    /// Every number has the same chance to be nonsense.
    Wild,
}

impl Origin {
    const ALL: [Self; 5] = [
        Self::Sound,
        Self::Coarse,
        Self::Spoiled,
        Self::Stretched,
        Self::Wild,
    ];

    /// Whether the numbers are of moderate size.
    fn is_moderate(self) -> bool {
        matches!(self, Self::Sound | Self::Coarse)
    }
}

/// A number that nobody checked.
fn nonsense(rng: &mut Rng) -> f64 {
    let numbers = [
        f64::NAN,
        f64::INFINITY,
        f64::MAX,
        1e300,
        1e160,
        1e20,
        1e-20,
        1e-160,
        1e-300,
        f64::MIN_POSITIVE,
        5e-324,
        0.0,
        1.0,
    ];
    let number = numbers[rng.index(numbers.len())];
    if rng.chance(0.5) { number } else { -number }
}

fn random_problem<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    origin: Origin,
) -> Box<Ocp<f64, NX, NU, N, NG>> {
    let kind = Kind::ALL[rng.index(Kind::ALL.len())];
    let mut ocp = well_scaled::problem(rng, kind);
    let mut count = 0;
    numbers::each(&mut ocp, &mut |_| count += 1);
    match origin {
        Origin::Sound => {}
        Origin::Coarse => coarse(rng, &mut ocp),
        Origin::Spoiled => {
            for _ in 0..1 + rng.index(3) {
                let place = rng.index(count);
                spoil(rng, &mut ocp, |_, i| i == place);
            }
        }
        Origin::Stretched => {
            let factor = rng.power_of_ten(-300.0, 300.0);
            let share = [0.01, 0.1, 1.0][rng.index(3)];
            numbers::each(&mut ocp, &mut |v| {
                if rng.chance(share) {
                    *v *= factor;
                }
            });
        }
        Origin::Wild => {
            let share = [0.01, 0.1, 0.5, 1.0][rng.index(4)];
            spoil(rng, &mut ocp, |rng, _| rng.chance(share));
        }
    }
    ocp.horizon = [0, 1, N / 2, N, N, N, N + 1, usize::MAX][rng.index(8)];
    if origin == Origin::Sound {
        // Elsewhere the known trajectory does not end.
        ocp.horizon = N;
    }
    ocp
}

/// Replaces the chosen numbers.
fn spoil<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
    chosen: impl Fn(&mut Rng, usize) -> bool,
) {
    let mut place = 0;
    numbers::each(ocp, &mut |v| {
        if chosen(rng, place) {
            *v = nonsense(rng);
        }
        place += 1;
    });
}

/// Halves, ones and twos; whole matrices that are zero.
fn coarse<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    rng: &mut Rng,
    ocp: &mut Ocp<f64, NX, NU, N, NG>,
) {
    fn entries<const R: usize, const C: usize>(rng: &mut Rng) -> SMatrix<f64, R, C> {
        let share = [0.0, 0.3, 1.0][rng.index(3)];
        let values = [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0];
        SMatrix::from_fn(|_, _| match rng.chance(share) {
            true => values[rng.index(values.len())],
            false => 0.0,
        })
    }
    fn weight<const K: usize>(rng: &mut Rng) -> SMatrix<f64, K, K> {
        let factor = entries::<K, K>(rng);
        factor.tr_mul(&factor)
    }
    fn bounds<const K: usize>(rng: &mut Rng) -> Bounds<f64, K> {
        let mut bounds = Bounds::none();
        for j in 0..K {
            let (lower, upper) = (rng.index(4) as f64 - 2.5, rng.index(4) as f64 - 0.5);
            if rng.chance(0.4) {
                bounds.lower[j] = lower;
            }
            if rng.chance(0.4) {
                bounds.upper[j] = upper;
            }
        }
        bounds
    }
    fn prices<const K: usize>(rng: &mut Rng) -> Softness<f64, K> {
        std::array::from_fn(|_| {
            let price = Penalty {
                linear: rng.index(3) as f64,
                quadratic: rng.index(3) as f64,
            };
            rng.chance(0.2).then_some(price)
        })
    }
    ocp.x0 = entries(rng);
    for stage in &mut ocp.stages {
        (stage.a, stage.b, stage.c) = (entries(rng), entries(rng), entries(rng));
        stage.s.fill(0.0);
        // Zero, or indefinite together with P, now and then.
        stage.r = weight(rng) + SMatrix::identity() * [0.0, 1.0, 1.0, -1.0][rng.index(4)];
        stage.q = weight(rng);
        (stage.linear_x, stage.linear_u) = (entries(rng), entries(rng));
        (stage.x, stage.u, stage.rows) = (bounds(rng), bounds(rng), bounds(rng));
        (stage.row_x, stage.row_u) = (entries(rng), entries(rng));
        (stage.soft_x, stage.soft_rows) = (prices(rng), prices(rng));
    }
    let end = &mut ocp.terminal;
    (end.p, end.linear_x) = (weight(rng), entries(rng));
    (end.x, end.rows, end.row_x) = (bounds(rng), bounds(rng), entries(rng));
    (end.soft_x, end.soft_rows) = (prices(rng), prices(rng));
    end.equality = rng.chance(0.1).then(|| entries(rng));
}

fn random_settings(rng: &mut Rng) -> SolverSettings<f64> {
    let standard = SolverSettings::default();
    let tolerance = [0.0, -1.0, 1e-3, 1e300, f64::INFINITY, f64::NAN][rng.index(6)];
    SolverSettings {
        tolerance: if rng.chance(0.3) { tolerance } else { standard.tolerance },
        max_changes: [0, 1, 2, 7, 50, 500, 500, 500][rng.index(8)],
        warm_start: [WarmStart::Cold, WarmStart::Same, WarmStart::Shifted][rng.index(3)],
    }
}

/// Whether an input can be asked to lie within these bounds.
fn consistent<const K: usize>(bounds: &Bounds<f64, K>) -> bool {
    let mut sides = bounds.lower.iter().zip(bounds.upper.iter());
    sides.all(|(lower, upper)| {
        lower <= upper && *lower < f64::INFINITY && *upper > f64::NEG_INFINITY
    })
}

/// Whether the bound is one that the problem has.
fn exists<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
    bound: &BoundId,
) -> bool {
    let n = ocp.length();
    let equality = ocp.terminal.equality.is_some();
    match (bound.side, bound.quantity) {
        (Side::Equality, Quantity::State(j)) => j < NX && bound.stage == n && equality,
        (Side::Equality, _) => false,
        (_, Quantity::State(j)) => j < NX && (1..=n).contains(&bound.stage),
        (_, Quantity::Input(j)) => j < NU && bound.stage < n,
        (_, Quantity::Row(j)) => j < NG && bound.stage <= n,
    }
}

/// Whether some hard bound is not a number, or above its opposite by more than rounding.
fn contradicts_itself<const NX: usize, const NU: usize, const N: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
) -> bool {
    fn crossed<const K: usize>(bounds: &Bounds<f64, K>, soft: &Softness<f64, K>) -> bool {
        let sides = bounds.lower.iter().zip(bounds.upper.iter());
        sides.zip(soft).any(|((lower, upper), soft)| {
            let size = lower.abs().max(upper.abs());
            soft.is_none() && !(lower - upper <= 1e-6 * size || lower <= upper)
        })
    }
    let n = ocp.length();
    let stages = ocp.stages.iter().take(n).enumerate();
    let mut crossings = stages.map(|(i, stage)| {
        crossed(&stage.u, &[None; NU])
            || crossed(&stage.rows, &stage.soft_rows)
            || (i > 0 && crossed(&stage.x, &stage.soft_x))
    });
    let end = &ocp.terminal;
    let at_the_end = crossed(&end.x, &end.soft_x) || crossed(&end.rows, &end.soft_rows);
    crossings.any(|crossed| crossed) || at_the_end
}

/// What must hold of every answer.
fn check<const NX: usize, const NU: usize, const N: usize, const M: usize, const NG: usize>(
    ocp: &Ocp<f64, NX, NU, N, NG>,
    origin: Origin,
    settings: &SolverSettings<f64>,
    solution: &Solution<f64, NX, NU, N, M>,
) {
    assert!(solution.changes <= settings.max_changes);
    assert!(solution.active.len() <= M);
    for (stage, u) in ocp.stages.iter().zip(&solution.u).take(ocp.length()) {
        assert!(u.iter().all(|entry| entry.is_finite()), "{u}");
        assert!(!consistent(&stage.u) || stage.u.contains(u, 0.0), "{u}");
    }
    if let Status::Infeasible(bound) = &solution.status {
        assert!(exists(ocp, bound), "{bound}");
    }
    // A tolerance above this is a wish for less.
    let strict = settings.tolerance <= SolverSettings::<f64>::default().tolerance;
    if solution.status.is_solved() {
        assert!(solution.cost.is_finite());
        assert!(solution.active.iter().all(|row| exists(ocp, &row.bound)));
        assert!(solution.active.iter().all(|row| row.multiplier.is_finite()));
        assert!(!strict || !contradicts_itself(ocp));
        if strict && origin.is_moderate() {
            let residual = residual(ocp, &Answer::of(solution));
            assert!(residual <= OPTIMALITY, "{residual:e}");
        }
    }
    let generous = strict && settings.max_changes == 500 && M >= N * NU + NX;
    if origin == Origin::Sound && generous && settings.tolerance > 0.0 {
        let roomy = ocp.stages.iter().all(|stage| stage.soft_x == [None; NX]);
        assert!(!roomy || solution.status.is_solved(), "{}", solution.status);
    }
}

/// The kind of a status.
fn name(status: &Status<f64>) -> &'static str {
    match status {
        Status::Solved => "solved",
        Status::Infeasible(_) => "infeasible",
        Status::ChangeCap => "change cap",
        Status::WorkingSetFull => "working set full",
        Status::NumericalFailure { .. } => "numerical failure",
        Status::NotFinite => "not finite",
    }
}

/// The answer to the last bit: what is in use of the inputs and states, and the status.
fn bits<const NX: usize, const NU: usize, const N: usize, const M: usize>(
    solution: &Solution<f64, NX, NU, N, M>,
    length: usize,
) -> (Vec<u64>, String) {
    let inputs = solution.u.iter().take(length).flat_map(SVector::iter);
    let states = solution.x.iter().take(length).flat_map(SVector::iter);
    let numbers = inputs.chain(states).map(|v| v.to_bits()).collect();
    (numbers, format!("{:?} {}", solution.status, solution.changes))
}

/// Solves `problems` of one shape, each from the solution of the one before.
fn campaign<const NX: usize, const NU: usize, const N: usize, const M: usize, const NG: usize>(
    problems: u64,
) {
    let mut statuses = BTreeMap::<_, usize>::new();
    let mut workspace = Workspace::new();
    let mut solution = Solution::default();
    for seed in 0..problems {
        let mut rng = Rng::new(seed);
        let origin = Origin::ALL[rng.index(Origin::ALL.len())];
        let ocp = random_problem::<NX, NU, N, NG>(&mut rng, origin);
        let settings = random_settings(&mut rng);
        let before: Solution<f64, NX, NU, N, M> = solution.clone();
        workspace.solve(&ocp, &settings, &mut solution);
        // The seed stands in the message of whatever fails.
        println!("{seed} {origin:?}");
        check(&ocp, origin, &settings, &solution);
        *statuses.entry(name(&solution.status)).or_default() += 1;
        if seed % 8 == 0 {
            // Nothing in the workspace outlives a solve.
            let mut again = before;
            Workspace::new().solve(&ocp, &settings, &mut again);
            let length = ocp.length();
            assert_eq!(bits(&solution, length), bits(&again, length), "{seed}");
        }
    }
    println!("{statuses:?}");
    assert!(statuses.len() >= 5, "{statuses:?}");
    assert!(statuses.values().all(|count| *count > 50), "{statuses:?}");
}

#[test]
fn two_states_with_a_general_row() {
    campaign::<2, 1, 4, 16, 1>(70_000);
}

#[test]
fn four_states_with_room_for_few_active_bounds() {
    campaign::<4, 1, 8, 5, 0>(50_000);
}

#[test]
fn four_states() {
    campaign::<4, 1, 8, 40, 0>(30_000);
}

#[test]
fn two_inputs_with_general_rows() {
    campaign::<3, 2, 5, 40, 2>(50_000);
}
