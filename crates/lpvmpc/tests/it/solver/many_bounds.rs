//! Many inputs at their bounds: what is found at once is what is found one after the other.

use super::changes::saturated;
use super::support::{agree, cold, solve};
use lpvmpc::{
    Bounds, Capacity, GeneralRow, List, ManyBoundsArrays, Ocp, Solution, Solver, SolverArrays,
    SolverSettings, Status, WarmStart, infeasibility_margin, kkt_residual,
};
use lpvmpc_sequences::{Kind, Recipe};
use lpvmpc_testkit::problems::{Family, problem};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector};

/// What many problems have shown.
#[derive(Debug, Default)]
struct Findings {
    solved: usize,
    many: usize,
    /// Changes of both ways, where many bounds are active.
    at_once: usize,
    one_by_one: usize,
    worst_residual: f64,
    worst_input: f64,
}

/// Two solvers for up to `N` stages: on the heap, and in lent memory, where bounds are taken one by one.
pub struct Both<const NX: usize, const NU: usize> {
    pub at_once: (Solver<f64, NX, NU>, Solution<f64, NX, NU>),
    pub one_by_one: (Solver<f64, NX, NU>, Solution<f64, NX, NU>),
}

impl<const NX: usize, const NU: usize> Both<NX, NU> {
    pub fn new<const N: usize, const M: usize>() -> Self {
        let room = Capacity {
            stages: N,
            rows: M,
            active: M,
            ..Capacity::default()
        };
        let arrays = Box::leak(Box::new(SolverArrays::<f64, NX, NU, N, M>::default()));
        Self {
            at_once: (Solver::allocate(room), Solution::allocate(room)),
            one_by_one: (Solver::new(arrays.lend()), Solution::allocate(room)),
        }
    }

    fn solve(&mut self, ocp: &Ocp<f64, NX, NU>, warm_start: WarmStart, findings: &mut Findings) {
        let settings = SolverSettings {
            warm_start,
            ..cold()
        };
        let (solver, expected) = &mut self.one_by_one;
        solver.solve(ocp, &settings, expected);
        let (solver, found) = &mut self.at_once;
        solver.solve(ocp, &settings, found);
        assert!(
            agree(&found.status, &expected.status),
            "{} for {}",
            found.status,
            expected.status
        );
        if !(found.status.is_solved() && expected.status.is_solved()) {
            return;
        }
        findings.solved += 1;
        let n = ocp.horizon;
        for (i, u) in found.u.iter().enumerate().take(n) {
            assert!(ocp.common_at(i).u.contains(u, 0.0));
        }
        let residual = kkt_residual(ocp, found).largest();
        findings.worst_residual = findings.worst_residual.max(residual);
        let inputs = found.u.iter().zip(&*expected.u).take(n);
        let error = inputs.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        let size = expected.u.iter().take(n).map(SVector::amax);
        let bound = ocp.common.u.upper.amax();
        let size = if bound.is_finite() {
            bound
        } else {
            size.fold(0.0, f64::max)
        };
        findings.worst_input = findings.worst_input.max(error / size);
        if found.active.len() > n * NU / 2 {
            findings.many += 1;
            findings.at_once += found.changes;
            findings.one_by_one += expected.changes;
        }
    }
}

/// What `count` problems show, from nothing; a little later, from the answer; and from a start that is wrong, since no
/// stage is another one's.
fn sweep<const NX: usize, const NU: usize, const N: usize, const M: usize>(
    count: u64,
    problem: fn(u64) -> Ocp<f64, NX, NU>,
) -> [Findings; 3] {
    let mut both = Both::<NX, NU>::new::<N, M>();
    let mut all = [(); 3].map(|()| Findings::default());
    let [from_nothing, again, from_wrong] = &mut all;
    for seed in 0..count {
        let mut ocp = problem(seed);
        both.solve(&ocp, WarmStart::Cold, from_nothing);
        ocp.x0 *= 0.98;
        both.solve(&ocp, WarmStart::Same, again);
        both.solve(&ocp, WarmStart::Shifted, from_wrong);
    }
    println!("{NX} {NU} {N}: {all:?}");
    for findings in &all {
        assert!(findings.many > 10, "{findings:?}");
        assert!(findings.worst_residual < 1e-8, "{findings:?}");
        assert!(findings.worst_input < 1e-6, "{findings:?}");
    }
    all
}

/// Unstable plants with hardly any room; one in three has soft state bounds, one hard ones.
fn hard<const NX: usize, const NU: usize, const N: usize>(seed: u64) -> Ocp<f64, NX, NU> {
    let mut ocp = saturated::<NX, NU>(&mut Rng::new(seed), N, 0);
    if !seed.is_multiple_of(3) {
        let family = [Family::SoftBoth, Family::Tight][seed as usize % 2];
        let other = problem::<NX, NU>(&mut Rng::new(seed), family, N, 0);
        ocp.common.x = other.common.x;
        ocp.common.soft_x = other.common.soft_x;
    }
    ocp
}

/// A stable plant follows waves with a tenth of the inputs that it would need; nothing else is bounded.
fn narrow<const NX: usize, const NU: usize, const N: usize>(seed: u64) -> Ocp<f64, NX, NU> {
    let mut ocp = problem::<NX, NU>(&mut Rng::new(seed), Family::Loose, N, 0);
    ocp.horizon = N;
    ocp.own = List::empty();
    (ocp.common.x, ocp.terminal.x) = (Bounds::none(), Bounds::none());
    ocp.common.u = Bounds::none();
    for (i, stage) in ocp.stages.iter_mut().enumerate() {
        stage.a = SMatrix::from_fn(|j, k| {
            let turn = 0.3 + 0.05 * (j / 2) as f64;
            let block = [[turn.cos(), turn.sin()], [-turn.sin(), turn.cos()]];
            let inside = f64::from(j / 2 == k / 2);
            0.95 * inside * block[j % 2][k % 2]
        });
        stage.linear_x = SVector::from_fn(|j, _| (0.4 * i as f64 + j as f64).sin());
    }
    let free = solve(&ocp);
    let limit = free
        .u
        .iter()
        .fold(SVector::zeros(), |most: SVector<f64, NU>, u| {
            most.sup(&u.abs())
        });
    (ocp.common.u.lower, ocp.common.u.upper) = (limit * -0.1, limit * 0.1);
    ocp
}

#[test]
fn bounds_found_at_once_are_those_found_one_by_one() {
    sweep::<4, 1, 20, 120>(300, hard::<4, 1, 20>);
    sweep::<8, 2, 20, 200>(150, hard::<8, 2, 20>);
    sweep::<4, 1, 60, 240>(60, hard::<4, 1, 60>);
    sweep::<6, 3, 30, 240>(60, hard::<6, 3, 30>);
    sweep::<12, 4, 25, 240>(30, hard::<12, 4, 25>);
}

/// Where the inputs alone are bounded, at least two fifths of the work are saved, a third with 8 states and 2 inputs; a
/// guess counts as NX + NU changes, which takes as long. From a start that is wrong it takes up to a third more than from
/// nothing. A single input's bounds are held again without a change, however many they are, and without the phase, too: there
/// a program from nothing and the next one from its answer take at most two fifths of what two take from nothing.
#[test]
fn many_inputs_at_once_take_fewer_changes() {
    let from_wrong_as_well = |[from_nothing, _, from_wrong]: &[Findings; 3]| {
        assert!(3 * from_wrong.at_once < 4 * from_nothing.at_once);
    };
    let of_one = sweep::<4, 1, 60, 240>(40, narrow::<4, 1, 60>);
    from_wrong_as_well(&of_one);
    let [from_nothing, again, _] = of_one;
    assert!(5 * (from_nothing.at_once + again.at_once) < 2 * 2 * from_nothing.one_by_one);
    assert!(20 * again.one_by_one < from_nothing.one_by_one);
    assert!(again.at_once < again.one_by_one);

    let saved = |part: (usize, usize), findings: [Findings; 3]| {
        from_wrong_as_well(&findings);
        let [from_nothing, again, _] = findings;
        let at_once = from_nothing.at_once + again.at_once;
        let one_by_one = from_nothing.one_by_one + again.one_by_one;
        assert!(part.1 * at_once < part.0 * one_by_one);
    };
    saved((2, 3), sweep::<8, 2, 50, 240>(40, narrow::<8, 2, 50>));
    saved((3, 5), sweep::<6, 3, 40, 240>(40, narrow::<6, 3, 40>));
}

/// Sequences of problems as in a loop, four fifths of the bounds active: states, rows, soft states beside
/// inputs. What is found at once is what is found one after the other, and at least a quarter of the work is saved.
#[test]
fn many_bounds_of_every_kind_take_fewer_changes() {
    for kind in [Kind::States, Kind::Rows, Kind::Soft] {
        in_a_loop::<4, 1, 60, 240>(kind);
        in_a_loop::<8, 2, 60, 280>(kind);
    }
}

// Not inlined: optimised, several of them at once take more stack than a test has.
#[inline(never)]
fn in_a_loop<const NX: usize, const NU: usize, const N: usize, const M: usize>(kind: Kind) {
    let recipe = Recipe {
        kind,
        horizon: N,
        samples: 6,
        share: 0.8,
        seed: 3,
    };
    let problems = recipe.make::<NX, NU>().unwrap().problems;
    for warm_start in [WarmStart::Cold, WarmStart::Shifted] {
        let mut both = Both::<NX, NU>::new::<N, M>();
        let mut findings = Findings::default();
        for ocp in &problems {
            both.solve(ocp, warm_start, &mut findings);
        }
        println!("{kind:?} {NX} {NU} {N} {warm_start:?}: {findings:?}");
        assert_eq!(findings.many, problems.len(), "{findings:?}");
        assert!(findings.worst_residual < 1e-12, "{findings:?}");
        assert!(findings.worst_input < 1e-9, "{findings:?}");
        assert!(
            4 * findings.at_once < 3 * findings.one_by_one,
            "{kind:?}: {findings:?}"
        );
    }
}

/// A state that is held where the held inputs leave nothing that moves it, a little beyond its soft bound, is
/// exceeded; as long as it counted as held, the dual method had to find all of them once more.
#[test]
fn a_held_state_that_nothing_moves_is_exceeded() {
    let recipe = Recipe {
        kind: Kind::Soft,
        horizon: 50,
        samples: 12,
        share: 0.8,
        seed: 4,
    };
    let sequence = recipe.make::<8, 2>().unwrap();
    for ocp in &sequence.problems {
        let solution = solve(ocp);
        assert!(solution.status.is_solved(), "{}", solution.status);
        assert!(solution.changes <= 240);
        assert!(kkt_residual(ocp, &solution).largest() < 1e-12);
    }
}

/// Bounds of states that no inputs meet: the multipliers of the interior-point method prove it.
#[test]
fn many_bounds_that_contradict_each_other_are_proved_to() {
    const N: usize = 60;
    let mut proved = 0;
    for seed in 0..20 {
        let mut ocp = narrow::<8, 2, N>(seed);
        let free = solve(&ocp);
        let reached = free.x.iter().map(SVector::amax).fold(0.0, f64::max);
        // A state has to follow a wave that is far too much for the inputs.
        ocp.own = List::repeat(ocp.common, N);
        for (i, own) in ocp.own.iter_mut().enumerate().skip(10) {
            let wave = 5.0 * reached * (0.7 * i as f64).sin();
            (own.x.lower[0], own.x.upper[0]) = (wave - 0.1 * reached, wave + 0.1 * reached);
        }
        let solution = solve(&ocp);
        assert!(
            matches!(solution.status, Status::Infeasible(_)),
            "{}",
            solution.status
        );
        assert!(infeasibility_margin(&ocp, &solution.active) > 0.0);
        proved += usize::from(solution.changes < 500);
    }
    assert!(proved >= 18, "{proved} at once");
}

/// A body on its way to a far target, at its largest speed and acceleration: bounds of states decide.
#[test]
fn bounds_of_states_are_found_at_once_too() {
    const N: usize = 40;
    let mut ocp = Ocp::<f64, 3, 1>::allocate(N);
    ocp.horizon = N;
    let h = 0.1;
    for stage in ocp.stages.iter_mut() {
        stage.a = SMatrix::<f64, 3, 3>::new(1.0, h, h * h / 2.0, 0.0, 1.0, h, 0.0, 0.0, 1.0);
        stage.b = SMatrix::<f64, 3, 1>::new(h * h * h / 6.0, h * h / 2.0, h);
        stage.linear_x = SVector::<f64, 3>::new(-1e3, 0.0, 0.0);
    }
    ocp.common.q = SMatrix::from_diagonal(&SVector::<f64, 3>::new(1.0, 0.1, 0.1));
    ocp.common.r = SMatrix::<f64, 1, 1>::new(0.1);
    ocp.terminal.p = ocp.common.q * 100.0;
    ocp.terminal.linear_x = SVector::<f64, 3>::new(-1e5, 0.0, 0.0);
    ocp.common.x.upper = SVector::<f64, 3>::new(f64::INFINITY, 1.0, 1.0);
    ocp.common.x.lower = -ocp.common.x.upper;
    ocp.terminal.x = ocp.common.x;
    (ocp.common.u.lower[0], ocp.common.u.upper[0]) = (-1.0, 1.0);
    let mut both = Both::<3, 1>::new::<N, 120>();
    for speed in [0.0, 0.5, 1.0] {
        let mut findings = Findings::default();
        ocp.x0[1] = speed;
        for warm_start in [WarmStart::Cold, WarmStart::Same] {
            both.solve(&ocp, warm_start, &mut findings);
        }
        assert_eq!(findings.many, 2, "{findings:?}");
        assert!(findings.worst_residual < 1e-12, "{findings:?}");
        assert!(findings.worst_input < 1e-8, "{findings:?}");
        assert!(findings.at_once < findings.one_by_one, "{findings:?}");
    }
}

/// A cart with a pole on its way to a place so far ahead, no faster than 1 m/s.
fn cart_pole<const N: usize>(target: f64) -> Ocp<f64, 4, 1> {
    // The upright pole falls by a factor of e in 1 / w.
    let (h, w) = (0.05, 3.5_f64);
    let (c, s) = ((w * h).cosh(), (w * h).sinh());
    let mut ocp = Ocp::<f64, 4, 1>::allocate(N);
    ocp.horizon = N;
    ocp.common.q = SMatrix::from_diagonal(&SVector::<f64, 4>::new(1.0, 0.1, 10.0, 1.0));
    ocp.common.r = SMatrix::<f64, 1, 1>::new(0.01);
    ocp.terminal.p = ocp.common.q * 20.0;
    // Place, speed, tilt and its rate; the input is the acceleration.
    let wanted = SVector::<f64, 4>::new(target, 0.0, 0.0, 0.0);
    for stage in ocp.stages.iter_mut() {
        #[rustfmt::skip]
        let a = SMatrix::<f64, 4, 4>::new(
            1.0, h, 0.0, 0.0,
            0.0, 1.0, 0.0, 0.0,
            0.0, 0.0, c, s / w,
            0.0, 0.0, s * w, c,
        );
        stage.a = a;
        stage.b = SMatrix::<f64, 4, 1>::new(h * h / 2.0, h, (1.0 - c) / (w * w), -s / w);
        stage.linear_x = -ocp.common.q * wanted;
    }
    ocp.terminal.linear_x = -ocp.terminal.p * wanted;
    (ocp.common.x.lower[1], ocp.common.x.upper[1]) = (-1.0, 1.0);
    ocp.terminal.x = ocp.common.x;
    ocp
}

/// At its largest speed all along the horizon nothing is left that would hold the pole: what the tilt costs grows by
/// the same factor at each stage towards the front, and so does rounding. Roles that follow from such a trajectory as
/// it is go in circles.
#[test]
fn rounding_that_grows_along_the_horizon_decides_nothing() {
    const N: usize = 60;
    let mut ocp = cart_pole::<N>(100.0);
    let mut both = Both::<4, 1>::new::<N, 120>();
    for k in 0..40 {
        let mut findings = Findings::default();
        both.solve(&ocp, WarmStart::Shifted, &mut findings);
        assert_eq!(findings.many, 1, "{k}: {findings:?}");
        assert!(findings.worst_residual < 1e-12, "{k}: {findings:?}");
        // The bounds change by one or two from sample to sample: 24 factorisations are those of a first phase in vain.
        assert!(findings.at_once < 24 * 5, "{k}: {findings:?}");
        ocp.x0 = ocp.stages[0].next(&ocp.x0, &both.at_once.1.u[0]);
    }
}

/// Where nearly all of what will be active is known, and that is little, it is taken one by one, however many bounds
/// are violated as long as it is not.
#[test]
fn a_few_known_bounds_are_taken_one_by_one() {
    const N: usize = 60;
    let mut ocp = cart_pole::<N>(3.0);
    // Without the bound of speed the tilt would be beyond its own, too.
    let tilt = 0.06;
    (ocp.common.x.lower[2], ocp.common.x.upper[2]) = (-tilt, tilt);
    let mut both = Both::<4, 1>::new::<N, 120>();
    let mut few = 0;
    for _ in 0..80 {
        let known = both.at_once.1.active.len();
        both.one_by_one.1 = both.at_once.1.clone();
        both.solve(&ocp, WarmStart::Shifted, &mut Findings::default());
        if (20..32).contains(&known) {
            assert_eq!(both.at_once.1, both.one_by_one.1);
            few += 1;
        }
        ocp.x0 = ocp.stages[0].next(&ocp.x0, &both.at_once.1.u[0]);
    }
    assert!(few >= 10, "{few}");
}

/// A first phase that comes to no end costs what it took, and not the rows that were known.
#[test]
fn known_bounds_are_begun_with_after_a_first_phase_in_vain() {
    let recipe = Recipe {
        kind: Kind::States,
        horizon: 20,
        samples: 30,
        share: 0.8,
        seed: 1,
    };
    let sequence = recipe.make::<8, 2>().unwrap();
    let mut both = Both::<8, 2>::new::<20, 80>();
    // Enough for one factorisation, which counts as much as a change for each state and input, and then for the rest:
    // in vain each time, and so tried ever more rarely.
    let settings = SolverSettings {
        max_changes: Some(79),
        ..SolverSettings::default()
    };
    let mut tried = 0;
    for ocp in &sequence.problems {
        let solve = |(solver, solution): &mut (Solver<f64, 8, 2>, Solution<f64, 8, 2>)| {
            solver.solve(ocp, &settings, solution);
            assert!(solution.status.is_solved(), "{}", solution.status);
            solution.changes
        };
        let (changes, one_by_one) = (solve(&mut both.at_once), solve(&mut both.one_by_one));
        // What the factorisation has shown may be a better beginning.
        assert!(
            (one_by_one..=one_by_one + 8 + 2).contains(&changes),
            "{changes} for {one_by_one}"
        );
        tried += usize::from(changes > one_by_one);
    }
    // After 0, 0, 0, 1, 3 and 7 samples without; then it would be after 15.
    assert_eq!(tried, 6);
}

/// A problem that is infeasible by rounding has multipliers of 1e20; begun with them, the next one was refined from so far
/// away that its states no longer followed from its inputs, and it was called solved.
#[test]
fn states_follow_from_inputs_after_multipliers_without_meaning() {
    let family = Family::Degenerate;
    let mut largest = 0.0_f64;
    for seed in [16, 282, 316, 318, 334, 338, 367] {
        let mut random = Rng::new(seed << 40 | family as u64);
        let rows = usize::from(seed % 2 == 1);
        let mut ocp = problem::<4, 2>(&mut random, family, 30, rows);
        let x0 = ocp.x0;
        let mut both = Both::<4, 2>::new::<30, 200>();
        let settings = SolverSettings {
            warm_start: WarmStart::Same,
            ..SolverSettings::default()
        };
        for size in [0.0, 1e-9, 1e-6, 1e-3, 0.1] {
            if size > 0.0 {
                ocp.x0 = x0 + SVector::from_fn(|_, _| size * random.normal());
            }
            let (solver, solution) = &mut both.at_once;
            solver.solve(&ocp, &settings, solution);
            if solution.status.is_solved() {
                let residual = kkt_residual(&ocp, solution).largest();
                assert!(residual < 1e-8, "{seed}, {size:e}: {residual:e}");
                let multipliers = solution.active.iter().map(|row| row.multiplier);
                largest = multipliers.fold(largest, f64::max);
            }
        }
    }
    assert!(largest > 1e15, "{largest:e}");
}

/// Where the factorisations of a guess overflow, no comparison says that it is wrong. It was called solved.
#[test]
fn what_is_no_number_is_no_answer() {
    let mut solved = 0;
    for seed in [35, 54, 59, 60, 68, 258] {
        let family = Family::NearlyParallel;
        let mut random = Rng::new(seed << 40 | family as u64);
        let mut ocp = problem::<6, 3>(&mut random, family, 40, 1);
        let scale = 1e100;
        ocp.x0 *= scale;
        for stage in ocp.stages.iter_mut() {
            stage.c *= scale;
            stage.linear_x *= scale;
            stage.linear_u *= scale;
        }
        for common in ocp.own.iter_mut() {
            common.x = scaled(&common.x, scale);
            common.u = scaled(&common.u, scale);
        }
        for row in ocp.rows.iter_mut() {
            row.lower *= scale;
            row.upper *= scale;
        }
        ocp.terminal.x = scaled(&ocp.terminal.x, scale);
        ocp.terminal.linear_x *= scale;
        let answer = solve(&ocp);
        if answer.status.is_solved() {
            let residual = kkt_residual(&ocp, &answer).largest();
            assert!(residual < 1e-6, "{seed}: {residual:e}");
            solved += 1;
        }
    }
    assert!(solved >= 3, "{solved}");
}

fn scaled<const K: usize>(bounds: &Bounds<f64, K>, scale: f64) -> Bounds<f64, K> {
    Bounds {
        lower: bounds.lower * scale,
        upper: bounds.upper * scale,
    }
}

/// Memory of the first phase for shorter horizons changes nothing for longer ones.
#[test]
fn too_little_memory_for_bounds_at_once_is_none() {
    const M: usize = 60;
    let arrays = || Box::leak(Box::new(SolverArrays::<f64, 4, 1, 40, M>::default())).lend();
    let many = Box::leak(Box::new(ManyBoundsArrays::<f64, 4, 1, 39, 400>::default()));
    let mut with = Solver::new(arrays().with_many_bounds(many));
    let mut without = Solver::new(arrays());
    let room = Capacity {
        stages: 40,
        rows: M,
        active: M,
        ..Capacity::default()
    };
    for seed in 0..10 {
        let ocp = narrow::<4, 1, 40>(seed);
        let [mut found, mut expected] = [(); 2].map(|()| Solution::allocate(room));
        with.solve(&ocp, &cold(), &mut found);
        without.solve(&ocp, &cold(), &mut expected);
        assert_eq!(found, expected);
    }
}

/// Numbers that are not finite, and no room at all, are said as they are without the first phase.
#[test]
fn what_has_no_answer_has_none_at_once() {
    let mut ocp = saturated::<4, 1>(&mut Rng::new(1), 20, 0);
    ocp.horizon = 20;
    ocp.common.u = Bounds {
        lower: SVector::repeat(-1e-3),
        upper: SVector::repeat(1e-3),
    };
    assert!(solve(&ocp).status.is_solved());
    let mut broken = ocp.clone();
    broken.stages[7].c[0] = f64::NAN;
    assert_eq!(solve(&broken).status, Status::NotFinite);
    let mut broken = ocp.clone();
    broken.common.u.upper = SVector::repeat(f64::NAN);
    assert!(!solve(&broken).status.is_solved());
    // A row that is NaN, be it without limits.
    let mut broken = ocp.clone();
    broken.rows_per_stage = 1;
    broken.rows = List::repeat(GeneralRow::default(), 21);
    assert!(solve(&broken).status.is_solved());
    broken.rows[7].u[0] = f64::NAN;
    assert_eq!(solve(&broken).status, Status::NotFinite);
    // Out of reach: it takes more than all inputs at their bounds.
    let mut broken = ocp;
    broken.common.x.lower[0] = solve(&broken).x[5][0].abs() * 10.0 + 1e6;
    assert!(matches!(
        solve(&broken).status,
        Status::Infeasible(_) | Status::Inaccurate(_)
    ));
}
