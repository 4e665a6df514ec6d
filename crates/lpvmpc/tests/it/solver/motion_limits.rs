//! The textbook's problem: points with limits of speed, acceleration and their rates are to go far away. Along the way
//! they stay at one limit for many stages, which holds sampled states in place by inputs that alternate; what is
//! violated without the limits is many times what they allow.

use super::many_bounds::Both;
use super::support::{capacity, cold, solve_with};
use lpvmpc::{
    Bounds, GeneralRow, List, Ocp, Penalty, Solution, Solver, SolverSettings, WarmStart,
    kkt_residual,
};
use lpvmpc_sequences::{Kind, Recipe};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

const SAMPLES: usize = 6;

/// `NU` chains of integrators of equal length with random limits of input and states, sampled exactly, on their way to
/// the origin.
fn problem<const NX: usize, const NU: usize>(random: &mut Rng, horizon: usize) -> Ocp<f64, NX, NU> {
    let order = NX / NU;
    let log =
        |random: &mut Rng, low: f64, high: f64| random.power_of_ten(low.log10(), high.log10());
    let t_s = log(random, 0.02, 0.2);
    // t_s^k / k!
    let power = |k: usize| (1..=k).fold(1.0, |product, j| product * t_s / j as f64);
    let mut ocp = Ocp::allocate(horizon);
    let mut a = SMatrix::<f64, NX, NX>::identity();
    let mut b = SMatrix::<f64, NX, NU>::zeros();
    let weight = log(random, 1e-4, 1.0);
    for chain in 0..NU {
        let first = chain * order;
        let limit_u = log(random, 0.5, 20.0);
        if random.chance(0.7) {
            ocp.common.u.lower[chain] = -limit_u;
            ocp.common.u.upper[chain] = limit_u;
        }
        ocp.common.r[(chain, chain)] = weight;
        ocp.x0[first] = -log(random, 0.5, 20.0);
        for i in 0..order {
            for j in i..order {
                a[(first + i, first + j)] = power(j - i);
            }
            b[(first + i, chain)] = power(order - i);
            let state = first + i;
            ocp.common.q[(state, state)] = if i == 0 { 1.0 } else { 0.01 };
            ocp.terminal.p[(state, state)] = log(random, 1.0, 100.0);
            let limit = log(random, 0.3, 3.0);
            if i > 0 && random.chance(0.7) {
                ocp.common.x.lower[state] = -limit;
                ocp.common.x.upper[state] = limit;
            }
        }
    }
    ocp.terminal.x = ocp.common.x;
    for stage in ocp.stages.iter_mut() {
        (stage.a, stage.b) = (a, b);
    }
    ocp
}

/// The changes of a loop's samples, with all bounds at once where there are many and one by one, and the most
/// factorisations that a sample of the former takes.
fn changes<const NX: usize, const NU: usize, const N: usize, const M: usize>(
    seed: u64,
) -> [usize; 3] {
    let mut ocp = problem::<NX, NU>(&mut Rng::new(seed), N);
    let Both {
        mut at_once,
        mut one_by_one,
    } = Both::<NX, NU>::new::<N, M>();
    let mut sums = [0; 3];
    for _ in 0..SAMPLES {
        let changes = [&mut at_once, &mut one_by_one].map(|(solver, answer)| {
            solver.solve(&ocp, &SolverSettings::default(), answer);
            assert!(answer.status.is_solved(), "{seed}: {}", answer.status);
            let residual = kkt_residual(&ocp, answer).largest();
            assert!(residual < 1e-8, "{seed}: {residual:e}");
            answer.changes
        });
        sums = [
            sums[0] + changes[0],
            sums[1] + changes[1],
            sums[2].max(changes[0] / (NX + NU)),
        ];
        let u = at_once.1.u[0];
        let difference = (u - one_by_one.1.u[0]).amax();
        assert!(
            difference < 1e-6 * u.amax().max(1.0),
            "{seed}: {difference:e}"
        );
        ocp.x0 = ocp.stages[0].next(&ocp.x0, &u);
    }
    sums
}

/// All bounds at once take less than two fifths of the changes, and no sample takes more than 40 factorisations. The
/// interior-point method once began with so little slack that its steps were short, and its first guesses used up the
/// trials: the sum was larger than one by one. Of roles that a step does not say clearly it made guesses in vain.
#[test]
fn points_with_limits_take_few_factorisations() {
    let mut sums = [0; 3];
    for seed in 0..16 {
        let of = changes::<6, 2, 100, 300>(seed);
        sums = [sums[0] + of[0], sums[1] + of[1], sums[2].max(of[2])];
    }
    println!("{sums:?}");
    let [at_once, one_by_one, most] = sums;
    assert!(13 * at_once < 5 * one_by_one, "{at_once} for {one_by_one}");
    assert!(most <= 40, "{most}");
}

/// Along a limit a plan may touch it at every other stage, nearer than any loose tolerance shows. Such a guess is looked at
/// closely before it is exchanged, is tried before rounding ends the interior-point method, and no side is let go of twice:
/// these seven loops took 10 027 changes without that, 7642 with the first two alone.
#[test]
fn limits_that_are_touched_by_turns_are_found() {
    let seeds = [35, 48, 82, 96, 106, 139, 149];
    let found = seeds.map(changes::<6, 2, 100, 300>);
    println!("{found:?}");
    let sum: usize = found.iter().map(|[at_once, ..]| at_once).sum();
    assert!(sum <= 7200, "{found:?}");
}

/// Over 20 samples few limits hold at once, however many the trajectory without them violates: the phase for many bounds,
/// begun at once, took up to 160 changes where 33 are enough.
#[test]
fn few_limits_that_hold_are_found_one_by_one() {
    for (seed, share) in (1..=3).flat_map(|seed| [0.1, 0.2, 0.4].map(|share| (seed, share))) {
        let recipe = Recipe {
            kind: Kind::Motion,
            horizon: 20,
            samples: 12,
            share,
            seed,
        };
        let Both {
            mut at_once,
            mut one_by_one,
        } = Both::<8, 2>::new::<20, 100>();
        for ocp in &recipe.make::<8, 2>().unwrap().problems {
            let changes = [&mut at_once, &mut one_by_one].map(|(solver, answer)| {
                solver.solve(ocp, &cold(), answer);
                assert!(answer.status.is_solved(), "{}", answer.status);
                answer.changes
            });
            assert_eq!(changes[0], changes[1], "seed {seed}, share {share}");
        }
    }
}

/// Where more changes are needed than come before the phase, it has its turn after them; and where the cap leaves no
/// changes for that, but the dual method as many as it needs beside the quarter of the phase, it has them.
#[test]
fn limits_that_hold_in_numbers_are_found_later_or_one_by_one() {
    // Optimised, the arrays take more stack on their way than a test has.
    let large = std::thread::Builder::new().stack_size(1 << 26);
    large.spawn(in_numbers).unwrap().join().unwrap();
}

fn in_numbers() {
    let recipe = Recipe {
        kind: Kind::Motion,
        horizon: 50,
        samples: 12,
        share: 0.2,
        seed: 1,
    };
    let (mut solver, mut answer) = Both::<12, 4>::new::<50, 300>().one_by_one;
    let mut long = 0;
    for ocp in &recipe.make::<12, 4>().unwrap().problems {
        solver.solve(ocp, &cold(), &mut answer);
        assert!(answer.status.is_solved(), "{}", answer.status);
        let capped = SolverSettings {
            max_changes: Some(answer.changes + answer.changes.div_ceil(3) + 1),
            ..cold()
        };
        for settings in [cold(), capped] {
            let solution = solve_with(ocp, &settings);
            assert!(solution.status.is_solved(), "{}", solution.status);
            assert!(kkt_residual(ocp, &solution).largest() < 1e-8);
            assert!(solution.changes <= 64 + 16 * 16, "{}", solution.changes);
        }
        long += usize::from(answer.changes > 64);
    }
    assert!(long > 0);
}

/// One input, most of its stages at a limit of speed: where the last answer's limits are not quite those of the next one,
/// the dual method is through with little more than a change for each of them. The interior-point method was tried first,
/// in vain, and a sample took up to 172 changes.
#[test]
fn known_limits_that_hardly_change_are_begun_with_one_by_one() {
    let mut most = 0;
    for seed in 1..=6 {
        let recipe = Recipe {
            kind: Kind::Motion,
            horizon: 60,
            samples: 12,
            share: 0.8,
            seed,
        };
        let problems = recipe.make::<4, 1>().unwrap().problems;
        let room = capacity(&problems[0]);
        let (mut solver, mut answer) = (Solver::allocate(room), Solution::allocate(room));
        for ocp in &problems {
            let settings = SolverSettings {
                warm_start: WarmStart::Shifted,
                ..cold()
            };
            solver.solve(ocp, &settings, &mut answer);
            assert!(answer.status.is_solved(), "{}", answer.status);
            assert!(kkt_residual(ocp, &answer).largest() < 1e-9);
            most = most.max(answer.changes);
        }
    }
    println!("{most}");
    assert!(most <= 100, "{most}");
}

/// Points that begin far beyond soft limits of all states and of a row in which the inputs have a part, too: most inputs
/// are at their bounds beside rows that are exceeded. Such an input was not held by the factorisation, no guess was right,
/// and the dual method took up to 2698 changes.
#[test]
fn inputs_at_their_bounds_beside_exceeded_rows_are_found_at_once() {
    const N: usize = 100;
    let mut most = 0;
    for seed in 0..12 {
        let random = &mut Rng::new(seed);
        let mut ocp = problem::<4, 2>(random, N);
        ocp.x0 = SVector::from_fn(|_, _| random.uniform(-4.0, 4.0));
        ocp.common.u = within(1.0);
        let second = random.uniform(-1.0, 1.0);
        let prices = [price(10.0, 1.0), price(20.0, 1.0)];
        soften(&mut ocp, 0.4, [1.0, second], prices);
        most = most.max(factorisations(&ocp, seed));
    }
    println!("{most} factorisations");
    assert!(most <= 30, "{most}");
}

/// A chain of four integrators with a second input at a random place, from beyond soft limits. The trajectory without bounds
/// violates few of them where the answer has hundreds, interior-point steps went a twentieth of their way, or the method
/// ended when the roles were all but told: the dual method came to 1312 changes, which are worth 218 factorisations.
#[test]
fn more_bounds_than_the_start_tells_are_found_at_once() {
    const N: usize = 100;
    let mut most = 0;
    for seed in 0..40 {
        let random = &mut Rng::new(seed);
        let chain = problem::<4, 1>(random, N);
        let mut ocp = Ocp::<f64, 4, 2>::allocate(N);
        let log =
            |random: &mut Rng, low: f64, high: f64| random.power_of_ten(low.log10(), high.log10());
        let mut b = SMatrix::<f64, 4, 2>::zeros();
        b.set_column(0, &chain.stages[0].b);
        b[((random.uniform(0.0, 4.0) as usize).min(3), 1)] = random.uniform(0.02, 0.2);
        for stage in ocp.stages.iter_mut() {
            (stage.a, stage.b) = (chain.stages[0].a, b);
        }
        ocp.common.q = SMatrix::identity();
        ocp.common.r = SMatrix::identity() * log(random, 0.01, 1.0);
        ocp.terminal.p = SMatrix::identity() * 5.0;
        let far = log(random, 0.3, 6.0);
        ocp.x0 = SVector::from_fn(|_, _| random.uniform(-far, far));
        ocp.common.u = within(log(random, 0.3, 3.0));
        let (limit, u) = (
            log(random, 0.2, 1.0),
            [(); 2].map(|()| random.uniform(-1.0, 1.0)),
        );
        let prices = [(); 2].map(|()| price(log(random, 0.1, 100.0), log(random, 0.1, 100.0)));
        soften(&mut ocp, limit, u, prices);
        most = most.max(factorisations(&ocp, seed));
    }
    println!("{most} factorisations");
    assert!(most <= 60, "{most}");
}

fn price(linear: f64, quadratic: f64) -> Penalty<f64> {
    Penalty { linear, quadratic }
}

/// Gives all states this limit, and their sum with so much of the inputs another one, both soft at their prices.
fn soften(
    ocp: &mut Ocp<f64, 4, 2>,
    limit: f64,
    u: [f64; 2],
    [of_states, of_row]: [Penalty<f64>; 2],
) {
    (ocp.common.x, ocp.common.soft_x) = (within(limit), [Some(of_states); 4]);
    (ocp.terminal.x, ocp.terminal.soft_x) = (ocp.common.x, ocp.common.soft_x);
    ocp.rows_per_stage = 1;
    let row = GeneralRow {
        x: SVector::repeat(1.0),
        u: SVector::from(u),
        lower: -1.0,
        upper: 0.8,
        soft: Some(of_row),
    };
    ocp.rows = List::repeat(row, ocp.horizon + 1);
}

/// Solves the problem, and says how many factorisations its changes are worth.
fn factorisations(ocp: &Ocp<f64, 4, 2>, seed: u64) -> usize {
    let answer = solve_with(ocp, &SolverSettings::default());
    assert!(answer.status.is_solved(), "{seed}: {}", answer.status);
    let residual = kkt_residual(ocp, &answer).largest();
    assert!(residual < 1e-8, "{seed}: {residual:e}");
    let (changes, active) = (answer.changes, answer.active.len());
    println!("{seed}: {changes} changes, {active} active");
    changes / (4 + 2)
}

fn within<const N: usize>(limit: f64) -> Bounds<f64, N> {
    Bounds {
        lower: SVector::repeat(-limit),
        upper: SVector::repeat(limit),
    }
}
