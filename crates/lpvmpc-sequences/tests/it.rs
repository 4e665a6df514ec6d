//! What a sequence promises.

use lpvmpc::{Solution, Solver, SolverSettings, Status, WarmStart, kkt_residual};
use lpvmpc_sequences::{Kind, Recipe, Sequence, SequenceError, working_memory};

const SHARES: [f64; 4] = [0.0, 0.2, 0.5, 0.8];

fn recipe(kind: Kind, share: f64) -> Recipe {
    Recipe {
        kind,
        horizon: 15,
        samples: 8,
        share,
        seed: 1,
    }
}

/// Every problem is solved, from nothing and from the sample before, and its optimality conditions hold.
fn solved<const NX: usize, const NU: usize>(recipe: &Recipe, sequence: &Sequence<NX, NU>) {
    assert_eq!(sequence.problems.len(), recipe.samples);
    let room = working_memory(&sequence.problems);
    let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
    for warm_start in [WarmStart::Cold, WarmStart::Shifted] {
        let settings = SolverSettings {
            warm_start,
            ..SolverSettings::default()
        };
        for (k, ocp) in sequence.problems.iter().enumerate() {
            solver.solve(ocp, &settings, &mut solution);
            let what = format!("{NX}x{NU}, {recipe:?}, {warm_start:?}, problem {k}");
            assert_eq!(solution.status, Status::Solved, "{what}");
            let residual = kkt_residual(ocp, &solution).largest();
            assert!(residual < 1e-7, "{what}: {residual:e}");
            if recipe.share == 0.0 {
                assert!(solution.active.is_empty(), "{what}");
            }
        }
    }
}

fn every_sequence_keeps_its_promise<const NX: usize, const NU: usize>() -> Result<(), SequenceError>
{
    for kind in Kind::ALL {
        for share in SHARES {
            let recipe = recipe(kind, share);
            let sequence = recipe.make::<NX, NU>()?;
            let found = sequence.share;
            assert!((found - share).abs() <= 0.05, "{recipe:?}: {found}");
            solved(&recipe, &sequence);
        }
    }
    Ok(())
}

#[test]
fn the_share_is_reached_and_everything_is_solved() -> Result<(), SequenceError> {
    every_sequence_keeps_its_promise::<4, 1>()?;
    every_sequence_keeps_its_promise::<8, 2>()?;
    every_sequence_keeps_its_promise::<12, 4>()?;
    every_sequence_keeps_its_promise::<16, 6>()
}

#[test]
fn a_seed_is_a_sequence() {
    for kind in Kind::ALL {
        let one: Sequence<8, 2> = recipe(kind, 0.4).make().expect("a sequence");
        let again = recipe(kind, 0.4).make().expect("a sequence");
        assert_eq!(one, again);
        let seed = Recipe {
            seed: 2,
            ..recipe(kind, 0.4)
        };
        assert_ne!(one, seed.make().expect("a sequence"));
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let good = recipe(Kind::Inputs, 0.2);
    let cases = [
        (Recipe { horizon: 0, ..good }, "horizon is 0"),
        (Recipe { samples: 0, ..good }, "samples is 0"),
        (Recipe { share: 1.5, ..good }, "share is 1.5"),
        (
            Recipe {
                share: f64::NAN,
                ..good
            },
            "share is NaN",
        ),
    ];
    for (bad, words) in cases {
        let error = bad.make::<4, 1>().expect_err(words);
        assert!(error.to_string().contains(words), "{error}");
    }
    let error = good.make::<1, 2>().expect_err("more inputs than states");
    assert!(error.to_string().contains("size is 1x2"), "{error}");
    // One stage with one input has a share of 0 or 1 in each of two problems.
    let coarse = Recipe {
        horizon: 1,
        samples: 2,
        share: 0.25,
        ..good
    };
    let error = coarse.make::<4, 1>().expect_err("a share between");
    assert!(matches!(error, SequenceError::Share { .. }), "{error}");
}
