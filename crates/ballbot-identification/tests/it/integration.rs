//! What the steps of the integration add to the outputs, beside twenty times as many.

use crate::accuracy::truth;
use crate::laboratory::{Laboratory, healthy};
use ballbot_identification::log::Run;
use ballbot_identification::{Coordinates, Segment, SegmentedRuns, Values};
use lpvmpc_design::ShootingModel;
use nalgebra::Vector3;

/// Rows that each row is divided into: at 200 rows per second, one every 0.25 ms.
const PARTS: usize = 20;

/// The same torques in more rows, so that each has a step to itself.
fn divided(run: &Run) -> Run {
    let rows = 0..run.time.len() - 1;
    let times = rows.clone().flat_map(|row| {
        let part = (run.time[row + 1] - run.time[row]) / PARTS as f64;
        (0..PARTS).map(move |index| run.time[row] + index as f64 * part)
    });
    let each = |row| std::iter::repeat_n(row, PARTS);
    Run {
        time: times.collect(),
        outputs: rows
            .clone()
            .flat_map(|row| each(row).map(|row| run.outputs[row]))
            .collect(),
        torque: rows
            .flat_map(|row| each(row).map(|row| run.torque[row]))
            .collect(),
        stretches: std::iter::once(0..PARTS * (run.time.len() - 1)).collect(),
        ..run.clone()
    }
}

/// The largest difference from a simulation in fine steps, over the noise of the sensors.
fn added(laboratory: &Laboratory) -> Vector3<f64> {
    let run = laboratory.record(1).run;
    let coordinates = Coordinates::new(&Values::usual(), laboratory.plant.geometry, true);
    let values = truth(laboratory);
    // Segments of a second, as they are by default, after the longest delay.
    let second = laboratory.rate as usize;
    let segments = |parts: usize| -> Vec<Segment> {
        let starts = (second..run.time.len() - second - 1).step_by(second);
        let segment = |first: usize| Segment {
            run: 0,
            first: first * parts,
            end: (first + second) * parts + 1,
        };
        starts.map(segment).collect()
    };
    let (coarse, fine) = ([run.clone()], [divided(&run)]);
    let model = |runs, parts| SegmentedRuns {
        runs,
        segments: segments(parts),
        coordinates,
        ball_angle: laboratory.ball_angle,
        noise: laboratory.noise,
    };
    let (coarse, fine) = (model(&coarse, 1), model(&fine, PARTS));
    let parameters = coordinates.of(&values);
    let initial = coarse.initial_states(&values);
    let mut largest = Vector3::zeros();
    for (segment, initial) in initial.iter().enumerate() {
        let (mut found, mut right) = (Vec::new(), Vec::new());
        coarse.simulate(segment, &parameters, initial, &mut found);
        fine.simulate(segment, &parameters, initial, &mut right);
        assert_eq!(found.len(), second + 1);
        assert_eq!(right.len(), PARTS * second + 1);
        for (found, right) in found.iter().zip(right.iter().step_by(PARTS)) {
            let error = (found - right).abs().component_div(&laboratory.noise);
            largest = largest.sup(&error);
        }
    }
    largest
}

#[test]
fn the_steps_add_less_than_the_noise_to_a_second() {
    let late = Laboratory {
        // In the middle of a step: the torque changes within it.
        delay: 0.01125,
        ..healthy()
    };
    let sticky = Laboratory {
        coulomb: 0.1,
        ..late.clone()
    };
    let slow = Laboratory {
        rate: 50.0,
        ..late.clone()
    };
    for (name, laboratory, most) in [
        ("without delay", healthy(), 1e-6),
        ("of the paper", Laboratory::of_the_paper(), 1e-4),
        ("late", late, 0.03),
        ("rows every 20 ms", slow, 0.03),
        // Near rest it is by far the fastest mode.
        ("with Coulomb friction", sticky, 0.2),
    ] {
        let added = added(&laboratory);
        assert!(added.max() < most, "{name}: {added}");
    }
}
