//! Parameters found from logs of a known robot.

use crate::laboratory::{Laboratory, healthy};
use ballbot_identification::{Estimate, Parameter, Split, Task, Values, noise};

pub fn estimate(laboratory: &Laboratory, seed: u64) -> Estimate {
    let record = laboratory.record(seed);
    let runs = [record.run];
    let task = Task {
        runs: &runs,
        ball_angle: laboratory.ball_angle,
        geometry: laboratory.plant.geometry,
        choices: Values::usual(),
        physical: true,
        segment: 1.0,
        noise: [None; 3],
    };
    let split = Split::new(&runs, 0.0);
    task.estimate(&split.fitted, noise::floor(&runs), &|_| {})
        .unwrap()
}

#[test]
fn look() {
    for amplitude in [0.5, 1.0, 2.0] {
        let laboratory = Laboratory {
            amplitude,
            delay: 0.01,
            tilt_offset: 0.01,
            gyro_bias: 0.02,
            ..healthy()
        };
        let tilt = laboratory.record(1).largest_tilt;
        let clock = std::time::Instant::now();
        let e = estimate(&laboratory, 1);
        println!(
            "amplitude {amplitude} tilt {tilt} time {:?} {} steps {:?} {}",
            clock.elapsed(),
            e.fit.history.len(),
            e.noise,
            e.fit.termination
        );
        println!(
            "chi2 {} dof {}",
            e.fit.chi_square,
            e.fit.degrees_of_freedom()
        );
        let truth = [
            laboratory.plant.b1,
            laboratory.plant.b2,
            laboratory.plant.b3,
            laboratory.plant.b4,
            laboratory.drive_friction,
            0.0,
            0.1,
            laboratory.delay,
            laboratory.tilt_offset,
            laboratory.gyro_bias,
            0.0,
        ];
        for p in Parameter::ALL {
            let i = p.index();
            println!(
                "{:22} {:10.6} +- {:10.6} ({:10.6}) truth {:10.6} {:?}",
                p.key(),
                e.values[p],
                e.covariance[(i, i)].sqrt(),
                e.scatter_covariance[(i, i)].sqrt(),
                truth[i],
                e.status[p]
            );
        }
    }
}
