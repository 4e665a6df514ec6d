//! What is written is read again.

use lpvmpc::{Ocp, Solution, Solver, SolverSettings, WarmStart};
use lpvmpc_problems::header::Header;
use lpvmpc_problems::layout::Sizes;
use lpvmpc_problems::{ProblemError, file, layout};
use lpvmpc_sequences::{Kind, Recipe, working_memory};
use std::error::Error;
use std::path::PathBuf;

type Outcome = Result<(), Box<dyn Error>>;

fn problems(kind: Kind) -> Result<Vec<Ocp<f64, 8, 2>>, Box<dyn Error>> {
    let recipe = Recipe {
        kind,
        horizon: 6,
        samples: 3,
        share: 0.3,
        seed: 7,
    };
    Ok(recipe.make::<8, 2>()?.problems)
}

fn header(problems: &[Ocp<f64, 8, 2>], kind: Kind) -> Header {
    Header {
        sizes: Sizes::of(&problems[0]),
        common: true,
        problems: problems.len(),
        kind: kind.name().to_owned(),
        wanted: 0.3,
        share: 0.25,
    }
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

#[test]
fn problems_of_all_kinds_come_back_from_a_file() -> Outcome {
    for kind in Kind::ALL {
        let problems = problems(kind)?;
        let header = header(&problems, kind);
        let path = path(kind.name());
        file::write(&path, &header, &problems)?;
        assert_eq!(file::header(&path)?, header);
        for (number, expected) in problems.iter().enumerate() {
            let (_, numbers) = file::numbers(&path, number)?;
            let mut found = layout::empty::<8, 2>(&header.sizes, true)?;
            layout::read(&numbers, &mut found)?;
            // At the end only the state's part of a row counts, and only that is written.
            let mut expected = expected.clone();
            let end = expected.length() * expected.rows_per_stage;
            for row in expected.rows.iter_mut().skip(end) {
                row.u.fill(0.0);
            }
            assert_eq!(found, expected);
        }
    }
    Ok(())
}

/// Weights and bounds of their own for each stage are the same problem as common ones.
#[test]
fn weights_of_each_stage_lead_to_the_same_answer() -> Outcome {
    let settings = SolverSettings {
        warm_start: WarmStart::Cold,
        ..SolverSettings::default()
    };
    for kind in Kind::ALL {
        let problems = problems(kind)?;
        let room = working_memory(&problems);
        let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
        for expected in &problems {
            let mut numbers = Vec::new();
            layout::write(expected, &mut numbers)?;
            let mut own = layout::empty::<8, 2>(&Sizes::of(expected), false)?;
            layout::read(&numbers, &mut own)?;
            solver.solve(expected, &settings, &mut solution);
            let inputs = solution.u.clone();
            solver.solve(&own, &settings, &mut solution);
            assert_eq!(solution.u, inputs, "{}", kind.name());
        }
    }
    Ok(())
}

#[test]
fn a_file_that_is_cut_off_is_refused() -> Outcome {
    let problems = problems(Kind::Soft)?;
    let path = path("cut-off");
    file::write(&path, &header(&problems, Kind::Soft), &problems)?;
    let bytes = std::fs::read(&path)?;
    std::fs::write(&path, &bytes[..bytes.len() - 1])?;
    assert!(matches!(file::numbers(&path, 2), Err(ProblemError::Io(_))));
    assert!(file::numbers(&path, 1).is_ok());
    let beyond = file::numbers(&path, 3);
    assert!(matches!(beyond, Err(ProblemError::Size { found: 3, .. })));
    Ok(())
}

#[test]
fn a_header_without_a_size_is_refused_by_its_key() {
    let line =
        "lpvmpc-problems 1 nx 4 nu 1 rows 0 common 1 problems 3 kind inputs wanted 0 share 0";
    let refused = Header::parse(line);
    assert!(matches!(refused, Err(ProblemError::Header("horizon"))));
}
