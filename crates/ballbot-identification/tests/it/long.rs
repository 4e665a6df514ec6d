//! Work that is bounded, however long the log.

use crate::laboratory::{Laboratory, healthy};
use ballbot_identification::log::BallAngle;
use ballbot_identification::{Parameter, Split, Tables, Task, Values, noise};

/// A log of a million rows that jumped every 21 s did not end in four minutes: all of its rows were
/// simulated in each of up to 420 steps.
#[test]
fn of_a_long_log_segments_are_fitted_that_are_spread_over_it() {
    let laboratory = Laboratory {
        rate: 1000.0,
        ..healthy()
    };
    let mut run = laboratory.record(1).run;
    let once = run.clone();
    let rows = once.time.len();
    for copy in 1..15 {
        let later = once.time.iter().map(|time| time + 21.0 * f64::from(copy));
        run.time.extend(later);
        run.outputs.extend(&once.outputs);
        run.torque.extend(&once.torque);
        run.stretches
            .push(copy as usize * rows..(copy as usize + 1) * rows);
    }
    let runs = [run];
    let task = Task {
        runs: &runs,
        ball_angle: BallAngle::Inertial,
        geometry: laboratory.plant.geometry,
        choices: Values::usual(),
        physical: true,
        segment: 1.0,
        torque_known: true,
        noise: [None; 3],
        tables: Tables::default(),
    };
    let split = Split::new(&runs, 0.0);
    let estimate = task.estimate(&split.fitted, noise::floor(&runs), &|_| {});
    let estimate = estimate.unwrap();
    let fitted: usize = estimate
        .segments
        .iter()
        .map(|one| one.end - one.first)
        .sum();
    // To within a segment.
    assert!((150_000..=201_001).contains(&fitted), "{fitted}");
    let last = estimate.segments.last().unwrap().end;
    assert!(last > runs[0].time.len() - rows, "{last}");
    let b1 = estimate.values[Parameter::B1] / laboratory.plant.b1;
    assert!((b1 - 1.0).abs() < 0.01, "{b1}");
}
