//! Sequences of problems as in a loop, each begun with the last answer: what it saves, and what it must not cost.

use super::support::cold;
use lpvmpc::{Capacity, Ocp, Solution, Solver, SolverSettings, Status, WarmStart};
use lpvmpc_sequences::{Kind, Recipe, working_memory};

/// A solver and its answer for sequences of up to `stages` stages.
struct Loop<const NX: usize, const NU: usize> {
    solver: Solver<f64, NX, NU>,
    solution: Solution<f64, NX, NU>,
}

impl<const NX: usize, const NU: usize> Loop<NX, NU> {
    fn new(stages: usize) -> Self {
        let active = 2 * stages * NU;
        let room = Capacity {
            stages,
            rows: active,
            active,
            ..Capacity::default()
        };
        Self {
            solver: Solver::allocate(room),
            solution: Solution::allocate(room),
        }
    }

    /// Changes of the active set of all problems, one after the other.
    fn changes(&mut self, warm_start: WarmStart, problems: &[Ocp<f64, NX, NU>]) -> usize {
        let settings = SolverSettings {
            warm_start,
            ..cold()
        };
        let changes = problems.iter().map(|ocp| {
            self.solver.solve(ocp, &settings, &mut self.solution);
            assert!(self.solution.status.is_solved(), "{}", self.solution.status);
            self.solution.changes
        });
        changes.sum()
    }
}

/// Changes of the active set of a sequence: from the last answer, and from nothing.
fn changes<const NX: usize, const NU: usize>(recipe: Recipe) -> [usize; 2] {
    let sequence = recipe.make::<NX, NU>().unwrap();
    let mut both = Loop::<NX, NU>::new(recipe.horizon);
    let counts = [WarmStart::Shifted, WarmStart::Cold]
        .map(|warm_start| both.changes(warm_start, &sequence.problems));
    println!("{NX} {NU} {recipe:?}: {counts:?}");
    counts
}

/// The same in factorisations, each as much work as a change for each state and input.
fn factorisations<const NX: usize, const NU: usize>(
    kind: Kind,
    horizon: usize,
    share: f64,
    seed: u64,
) -> [usize; 2] {
    let recipe = Recipe {
        kind,
        horizon,
        samples: 12,
        share,
        seed,
    };
    changes::<NX, NU>(recipe).map(|count| count / (NX + NU))
}

/// Changes of the active set of the dearest sample of points on their way.
fn most_changes<const NX: usize, const NU: usize>(
    warm_start: WarmStart,
    share: f64,
    seed: u64,
) -> usize {
    let recipe = Recipe {
        kind: Kind::Motion,
        horizon: 20,
        samples: 12,
        share,
        seed,
    };
    let sequence = recipe.make::<NX, NU>().unwrap();
    let mut one = Loop::<NX, NU>::new(recipe.horizon);
    let problems = sequence.problems.iter().map(core::slice::from_ref);
    let each = problems.map(|ocp| one.changes(warm_start, ocp));
    each.max().unwrap()
}

/// Of three sequences with four fifths of the bounds active.
fn of_three<const NX: usize, const NU: usize>(kind: Kind, horizon: usize) -> [usize; 2] {
    let counts = [1, 2, 3].map(|seed| factorisations::<NX, NU>(kind, horizon, 0.8, seed));
    [0, 1].map(|i| counts.iter().map(|of| of[i]).sum())
}

/// Points on their way keep almost all that holds them at their limits. Over long horizons a loop takes at most
/// three eighths of the factorisations that it takes from nothing, and less than a third of the 455 and 489 that these took
/// from nothing once, since what is nearly right is looked at more closely, one stage after the other; of a short horizon a
/// third is solved by itself where the whole is wrong.
#[test]
fn points_at_their_limits_begin_with_what_holds_them() {
    for ([with, without], most) in [
        (of_three::<4, 1>(Kind::Motion, 100), 130),
        (of_three::<8, 2>(Kind::Motion, 100), 155),
    ] {
        assert!(with <= most, "{with} for {without}");
        assert!(8 * with < 3 * without, "{with} for {without}");
    }
    let [with, without] = of_three::<16, 6>(Kind::Motion, 20);
    assert!(4 * with < 3 * without, "{with} for {without}");
}

/// From nothing the interior-point method begins with products that suit what is bounded, and guesses states and inputs that
/// bind each other once few of them are undecided: with the same products for all, and guesses that left more undecided, three
/// sequences of each took 455, 489, 500, 231 and 248 factorisations.
#[test]
fn from_nothing_few_steps_and_guesses_are_needed() {
    let found = [
        of_three::<4, 1>(Kind::Motion, 100)[1],
        of_three::<8, 2>(Kind::Motion, 100)[1],
        of_three::<12, 4>(Kind::Motion, 50)[1],
        of_three::<12, 4>(Kind::Inputs, 20)[1],
        of_three::<16, 6>(Kind::Inputs, 20)[1],
    ];
    let limits = [420, 450, 475, 228, 240];
    let within = found
        .iter()
        .zip(limits)
        .all(|(found, limit)| *found <= limit);
    assert!(within, "{found:?}");
}

/// What a sample changes of the active bounds is at the end of the horizon. Solved by itself first, it saves a third of
/// all factorisations at least; where general rows or soft bounds are guessed together, the last answer saves nothing.
#[test]
fn the_end_of_the_horizon_is_solved_by_itself() {
    let save_a_third = |[with, without]: [usize; 2]| {
        assert!(3 * with < 2 * without, "{with} for {without}");
    };
    save_a_third(of_three::<8, 2>(Kind::Rows, 100));
    save_a_third(of_three::<8, 2>(Kind::Soft, 100));
    save_a_third(of_three::<4, 1>(Kind::Soft, 200));
    save_a_third(of_three::<4, 1>(Kind::States, 200));
}

/// Over a short horizon, too, the last answer costs nothing: the end is worth a solution of its own for rows, and soft
/// bounds, which were found in up to 1.1 times as many changes with it as without, are found as from nothing.
#[test]
fn over_a_short_horizon_the_last_answer_costs_nothing() {
    let [with, without] = of_three::<12, 4>(Kind::Rows, 20);
    assert!(with < without, "{with} for {without}");
    for [with, without] in [
        of_three::<12, 4>(Kind::Soft, 20),
        of_three::<8, 2>(Kind::Soft, 20),
    ] {
        assert_eq!(with, without);
    }
}

/// A few active bounds that change from sample to sample are begun with only where the trajectory without bounds
/// violates them: to take the others, and drop them again, makes it 1.3 to 2 times as many changes as from nothing.
#[test]
fn a_few_bounds_that_do_not_hold_again_are_not_begun_with() {
    fn few<const NX: usize, const NU: usize>(kind: Kind, share: f64) {
        let [with, without] = changes::<NX, NU>(Recipe {
            kind,
            horizon: 20,
            samples: 60,
            share,
            seed: 1,
        });
        assert!(5 * with < 6 * without, "{with} for {without}");
    }
    few::<4, 1>(Kind::Inputs, 0.2);
    few::<4, 1>(Kind::States, 0.2);
    few::<8, 2>(Kind::Rows, 0.2);
    few::<12, 4>(Kind::Inputs, 0.1);
    few::<12, 4>(Kind::States, 0.1);
}

/// A few bounds of an earlier sample save little, and cost time where they are wrong: fewer than three are not begun with,
/// and fewer than nine are not held, which would take fewer changes than there are bounds, unless those of the sample before
/// were active again, or nothing speaks against it.
#[test]
fn fewer_bounds_of_an_earlier_sample_than_pay_are_found_from_nothing() {
    let kinds = [Kind::Inputs, Kind::States];
    let mut counts = [0; 3];
    for (kind, seed) in kinds
        .iter()
        .flat_map(|kind| (1..=4).map(move |seed| (*kind, seed)))
    {
        let recipe = Recipe {
            kind,
            horizon: 20,
            samples: 60,
            share: 0.15,
            seed,
        };
        let problems = recipe.make::<4, 1>().unwrap().problems;
        let [mut with, mut without] = [(); 2].map(|()| Loop::<4, 1>::new(20));
        let mut straight = false;
        let (mut known, mut lasted) = (Vec::new(), false);
        for ocp in &problems {
            let begun = with.changes(WarmStart::Shifted, std::slice::from_ref(ocp));
            let found = without.changes(WarmStart::Cold, std::slice::from_ref(ocp));
            let active = &with.solution.active;
            let held = begun < active.len();
            if known.len() < 3 && straight {
                assert_eq!(begun, found);
                counts[0] += usize::from(!known.is_empty());
            } else if known.len() < 9 && !lasted {
                assert!(!held, "{begun}");
                counts[1] += usize::from(known.len() >= 3);
            } else {
                counts[2] += usize::from(held);
            }
            straight = begun == active.len();
            let stages: Vec<_> = active.iter().map(|row| row.bound.stage).collect();
            let again = known
                .iter()
                .filter_map(|stage: &usize| stage.checked_sub(1));
            let all = again.clone().all(|stage| stages.contains(&stage));
            // Of fewer than three, or of nine, nothing is known.
            lasted = held || all || known.len() >= 9 || again.count() < 3;
            known = stages;
        }
    }
    assert!(counts.iter().all(|&count| count > 25), "{counts:?}");
}

/// Where many bounds are violated and few were active before, these are taken over one by one: guessed all at once, a sample
/// took up to four factorisations in vain, and the third of these sequences more changes than from nothing.
#[test]
fn few_known_bounds_are_no_guess_of_many() {
    for (seed, share) in (1..=8).flat_map(|seed| [(seed, 0.1), (seed, 0.2)]) {
        let [with, without] = changes::<8, 2>(Recipe {
            kind: Kind::Motion,
            horizon: 20,
            samples: 24,
            share,
            seed,
        });
        assert!(with < without, "{seed}, {share}: {with} for {without}");
    }
}

/// Where inputs and states bind each other, the last answer's bounds miss a few that come in at its end, and each that is taken
/// in makes the trajectory violate the next: exchanged by factorisations, these sequences took 1.2 times as many changes as
/// from nothing.
#[test]
fn a_guess_that_misses_a_few_bounds_is_completed() {
    let counts = (1..=5).map(|seed| {
        changes::<16, 6>(Recipe {
            kind: Kind::Motion,
            horizon: 20,
            samples: 12,
            share: 0.6,
            seed,
        })
    });
    let [with, without] = counts.fold([0; 2], |sums, [with, without]| {
        [sums[0] + with, sums[1] + without]
    });
    println!("{with} for {without}");
    assert!(10 * with < 9 * without, "{with} for {without}");
}

/// What completes guesses counts: however few changes there may be, there are no more.
#[test]
fn completed_guesses_take_no_more_changes_than_there_may_be() {
    let recipe = Recipe {
        kind: Kind::Motion,
        horizon: 20,
        samples: 12,
        share: 0.6,
        seed: 3,
    };
    let problems = recipe.make::<16, 6>().unwrap().problems;
    let room = working_memory(&problems);
    let mut ended = 0;
    for most in (20..600).step_by(20) {
        let settings = SolverSettings {
            max_changes: Some(most),
            ..SolverSettings::default()
        };
        let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
        for ocp in &problems {
            solver.solve(ocp, &settings, &mut solution);
            assert!(solution.changes <= most, "{} of {most}", solution.changes);
            ended += usize::from(solution.status == Status::MaxChanges);
        }
    }
    assert!(ended > 50, "{ended}");
}

/// Soft bounds of a single input are guessed where the end of the horizon is worth a solution of its own, which saves a third of
/// the changes. Where it is not, a guess made it 1.07 times as many as from nothing.
#[test]
fn soft_bounds_of_a_single_input_are_guessed_where_that_pays() {
    let of_eight = |horizon| {
        let counts = (1..=8).map(|seed| {
            changes::<4, 1>(Recipe {
                kind: Kind::Soft,
                horizon,
                samples: 24,
                share: 0.8,
                seed,
            })
        });
        counts.fold([0; 2], |sum, of| [sum[0] + of[0], sum[1] + of[1]])
    };
    let [with, without] = of_eight(48);
    assert!(3 * with < 2 * without, "{with} for {without}");
    let [with, without] = of_eight(20);
    assert!(with < without, "{with} for {without}");
}

/// Where rounding ends the interior-point method, all but a few of the sides that it foretells are right, and the dual method
/// begins with them. The dearest of these took 653 changes, and six times the time of the others.
#[test]
fn where_rounding_ends_the_interior_point_method_its_sides_are_begun_with() {
    let found = most_changes::<12, 4>(WarmStart::Cold, 0.8, 6);
    assert!(found < 500, "{found}");
}

/// A right guess is not given up because rounding hides what one pass of its refinement has done: one of these samples
/// took fifteen factorisations.
#[test]
fn rounding_does_not_hide_a_right_guess() {
    let recipe = Recipe {
        kind: Kind::Rows,
        horizon: 20,
        samples: 8,
        share: 0.8,
        seed: 3,
    };
    let sequence = recipe.make::<12, 4>().unwrap();
    let mut from_nothing = Loop::new(20);
    for ocp in &sequence.problems {
        let changes = from_nothing.changes(WarmStart::Cold, core::slice::from_ref(ocp));
        assert!(changes < 10 * (12 + 4), "{changes}");
    }
}

/// Where the last sample's bounds come to nothing time and again, they are tried less and less often, until they would
/// have done.
#[test]
fn guesses_in_vain_are_not_tried_each_time() {
    const N: usize = 50;
    let recipe = Recipe {
        kind: Kind::Soft,
        horizon: N,
        samples: 60,
        share: 0.4,
        seed: 1,
    };
    let sequence = recipe.make::<12, 4>().unwrap();
    let mut both = Loop::new(N);
    let without = both.changes(WarmStart::Cold, &sequence.problems);
    let with = both.changes(WarmStart::Shifted, &sequence.problems);
    // At worst every sixteenth sample takes two factorisations more; tried each time the guess makes it 1.23 times as many.
    assert!(with < without + without / 10, "{with} for {without}");
    let last = &sequence.problems[59..];
    let again = [(); 3].map(|()| both.changes(WarmStart::Same, last));
    // What is known is right: one factorisation, as much as a change for each state and input.
    assert_eq!(again[2], 12 + 4, "{again:?}");
}

/// Where most inputs are saturated, those of the last sample, exchanged, save a fifth of the work.
#[test]
fn known_saturated_inputs_save_a_fifth() {
    let counts = [
        factorisations::<8, 2>(Kind::Inputs, 100, 0.8, 1),
        factorisations::<12, 4>(Kind::Inputs, 20, 0.6, 1),
        factorisations::<12, 4>(Kind::Inputs, 50, 0.8, 1),
        factorisations::<16, 6>(Kind::Inputs, 20, 0.6, 1),
        factorisations::<16, 6>(Kind::Inputs, 50, 0.8, 1),
    ];
    let [with, without] = [0, 1].map(|i| counts.iter().map(|of| of[i]).sum::<usize>());
    assert!(5 * with < 4 * without, "{with} for {without}");
}

/// The last bounds of a single input are held; a guess with few of them wrong is mended by two more, one with many is given up
/// at once. Loops take less than three fifths of the changes that they take from nothing (0.57); with two guesses, whatever was
/// wrong, they took 0.65.
#[test]
fn held_bounds_are_mended_where_few_are_wrong() {
    let (mut with, mut without) = (0, 0);
    for (kind, share) in [
        (Kind::Inputs, 0.4),
        (Kind::Inputs, 0.6),
        (Kind::States, 0.2),
        (Kind::States, 0.4),
    ] {
        for seed in 1..=8 {
            let [shifted, cold] = changes::<4, 1>(Recipe {
                kind,
                horizon: 20,
                samples: 60,
                share,
                seed,
            });
            with += shifted;
            without += cold;
        }
    }
    println!("held bounds: {with} for {without}");
    assert!(5 * with < 3 * without, "{with} for {without}");
}

/// Factorisations of the dearest sample of eight sequences, or three of a long horizon.
fn dearest<const NX: usize, const NU: usize>(
    kind: Kind,
    horizon: usize,
    warm_start: WarmStart,
) -> usize {
    let seeds = if horizon > 20 { 1..4 } else { 1..9 };
    let each = seeds.flat_map(|seed| {
        let recipe = Recipe {
            kind,
            horizon,
            samples: 12,
            share: 0.8,
            seed,
        };
        let sequence = recipe.make::<NX, NU>().unwrap();
        let mut one = Loop::new(horizon);
        let changes = sequence.problems.iter().map(|ocp| {
            let problem = core::slice::from_ref(ocp);
            one.changes(warm_start, problem).div_ceil(NX + NU)
        });
        changes.collect::<Vec<_>>()
    });
    let most = each.max().unwrap();
    println!("{NX} {NU} {horizon} {kind:?}: {most}");
    most
}

/// Sides that go in circles, exchanged all at once, are exchanged by halves, and then one at a time: no sample of a loop
/// takes long. Given up after two guesses that were no better, some of these took 14 to 21 factorisations.
#[test]
fn sides_that_go_in_circles_are_exchanged_one_at_a_time() {
    for most in [
        dearest::<16, 6>(Kind::Inputs, 20, WarmStart::Shifted),
        dearest::<8, 2>(Kind::Inputs, 50, WarmStart::Shifted),
        dearest::<12, 4>(Kind::Inputs, 100, WarmStart::Shifted),
        dearest::<12, 4>(Kind::Soft, 50, WarmStart::Shifted),
        dearest::<12, 4>(Kind::Soft, 100, WarmStart::Shifted),
    ] {
        assert!(most <= 12, "{most}");
    }
    for most in [
        dearest::<12, 4>(Kind::Inputs, 20, WarmStart::Shifted),
        dearest::<4, 1>(Kind::Inputs, 50, WarmStart::Cold),
    ] {
        assert!(most <= 10, "{most}");
    }
}

/// Of hundreds of soft bounds a tenth may still change its role when the interior-point method foretells them, and such a
/// guess is wrong: with twelve at most it is right after a few exchanges. Some of these took 13 to 15 factorisations.
#[test]
fn soft_bounds_are_guessed_when_few_still_change() {
    for most in [
        dearest::<8, 2>(Kind::Soft, 200, WarmStart::Cold),
        dearest::<16, 6>(Kind::Soft, 50, WarmStart::Cold),
    ] {
        assert!(most <= 12, "{most}");
    }
}

/// Where inputs and states bind each other, what is wrong with the last sample's is exchanged stage by stage as long as no more
/// is wrong than before: six times whatever was left, the first of these had a sample of 29 factorisations; only while what
/// is wrong halves, the others had one of 29 each.
#[test]
fn bounds_that_bind_each_other_are_exchanged_while_that_helps() {
    let shifted = WarmStart::Shifted;
    let found = [
        most_changes::<12, 4>(shifted, 0.8, 1).div_ceil(16),
        most_changes::<8, 2>(shifted, 0.8, 6).div_ceil(10),
        most_changes::<8, 2>(shifted, 0.8, 8).div_ceil(10),
    ];
    let limits = [22, 15, 13];
    let within = found
        .iter()
        .zip(limits)
        .all(|(found, limit)| *found <= limit);
    assert!(within, "{found:?}");
}

/// Where rounding ends the interior-point method, the dual method begins with what is foretold, though bounds of the samples
/// before did not hold again, and though it was begun late. That was not so once: without most of what was foretold, samples
/// took 1000 to 1800 changes for 300 to 500 from nothing.
#[test]
fn what_is_foretold_is_begun_with_though_known_bounds_are_doubted() {
    let recipe = Recipe {
        kind: Kind::Motion,
        horizon: 200,
        samples: 20,
        share: 0.8,
        seed: 13,
    };
    let [with, without] = changes::<6, 1>(recipe);
    assert!(2 * with < 3 * without, "{with} for {without}");
}
