//! Designed excitation: limits are kept, and the expected precision is the precision.

use crate::laboratory::{Laboratory, csv, healthy};
use ballbot::Geometry;
use ballbot_identification::log::BallAngle;
use ballbot_identification::{
    Config, ExcitationError, ExcitationTask, Parameter, Split, Tables, Task, Values,
    identified_parameters, identify, log, noise,
};
use fastrand::Rng;
use nalgebra::Vector4;

fn task() -> ExcitationTask {
    let healthy = healthy();
    let mut robot = Values([0.0; Parameter::ALL.len()]);
    robot[Parameter::B1] = healthy.plant.b1;
    robot[Parameter::B2] = healthy.plant.b2;
    robot[Parameter::B3] = healthy.plant.b3;
    robot[Parameter::RollingFriction] = healthy.plant.b4;
    robot[Parameter::DriveFriction] = healthy.drive_friction;
    robot[Parameter::TorqueGain] = healthy.torque_gain;
    robot[Parameter::Delay] = 0.01;
    ExcitationTask {
        robot,
        geometry: healthy.plant.geometry,
        choices: Values::usual(),
        band: (0.2, 6.0),
        harmonics: 15,
        amplitude: 1.0,
        duration: 20.0,
        tilt_limit: 0.2,
        rate: 200.0,
        noise: healthy.noise,
        gain: None,
        segment: 1.0,
        gyroscope: true,
    }
}

#[test]
fn the_tilt_limit_is_kept_and_the_torque_as_large_as_it_allows() {
    let free = task().design().unwrap();
    assert_eq!(free.amplitude, 1.0);
    let most = free
        .torque
        .iter()
        .fold(0.0_f64, |most, torque| most.max(torque.abs()));
    assert!((most - 1.0).abs() < 1e-12);
    assert!((free.torque[0], *free.time.last().unwrap()) == (0.0, 19.995));
    let tight = ExcitationTask {
        tilt_limit: 0.5 * free.tilt,
        ..task()
    };
    let tight = tight.design().unwrap();
    assert!(tight.tilt <= 0.5 * free.tilt && tight.tilt > 0.4 * free.tilt);
    // Half the torque, twice the deviation.
    let ratio = tight.standard_deviations[Parameter::B1] / free.standard_deviations[Parameter::B1];
    assert!((ratio * tight.amplitude - 1.0).abs() < 0.05, "{ratio}");
}

#[test]
fn the_expected_precision_is_that_of_the_fit() {
    let task = task();
    let excitation = task.design().unwrap();
    // The laboratory plays the designed torque, with the gains that the design counted on.
    let laboratory = Laboratory {
        delay: 0.01,
        ..healthy()
    };
    let run = laboratory.play(&excitation.torque, &excitation.gain, &mut Rng::with_seed(1));
    let runs = [run.run];
    let fit = Task {
        runs: &runs,
        ball_angle: BallAngle::Inertial,
        geometry: task.geometry,
        choices: task.choices,
        physical: true,
        segment: task.segment,
        torque_known: true,
        noise: [None; 3],
        tables: Tables::default(),
    };
    let split = Split::new(&runs, 0.0);
    let floor = noise::floor(&runs);
    let estimate = fit.estimate(&split.fitted, floor, &|_| {}).unwrap();
    for parameter in Parameter::ALL {
        let index = parameter.index();
        let (expected, found) = (
            excitation.standard_deviations[parameter],
            estimate.covariance[(index, index)].sqrt(),
        );
        // The loop of the laboratory answers to noise, so it excites a little more.
        assert!(
            found <= 1.1 * expected && found >= 0.6 * expected,
            "{parameter}: {found} for {expected}"
        );
    }
    assert!(run.largest_tilt < 1.2 * excitation.tilt);
}

#[test]
fn what_cannot_be_done_is_said() {
    let refused = |change: fn(&mut ExcitationTask)| {
        let mut task = task();
        change(&mut task);
        task.design().unwrap_err()
    };
    let message = refused(|task| task.band = (0.2, 150.0)).to_string();
    assert!(
        message.contains("the highest frequency is 150") && message.contains("100 Hz"),
        "{message}"
    );
    let message = refused(|task| task.duration = 5.0).to_string();
    assert!(
        message.contains("the length is 5") && message.contains("10.0 s"),
        "{message}"
    );
    let message = refused(|task| task.tilt_limit = 1.6).to_string();
    assert!(message.contains("degrees is 91.67"), "{message}");
    let message = refused(|task| task.amplitude = 1e300).to_string();
    assert!(message.contains("1e6 N m"), "{message}");
    let message = refused(|task| task.amplitude = f64::NAN).to_string();
    assert!(message.contains("the torque is NaN"), "{message}");
    let message = refused(|task| task.harmonics = 1).to_string();
    assert!(message.contains("harmonics is 1"), "{message}");
    // Hundreds of millions of rows, or of cosines, are no mistake that memory or patience should tell.
    let message = refused(|task| (task.rate, task.duration) = (1e5, 3600.0)).to_string();
    assert!(
        message.contains("rows") && message.contains("4000000"),
        "{message}"
    );
    let many = |task: &mut ExcitationTask| {
        (task.rate, task.duration, task.harmonics) = (1e3, 3600.0, 1000);
    };
    let message = refused(many).to_string();
    assert!(message.contains("fewer harmonics"), "{message}");
    let unstable = refused(|task| task.gain = Some(Vector4::zeros()));
    assert!(
        matches!(unstable, ExcitationError::UnstableLoop { .. }),
        "{unstable}"
    );
    // Gains of another robot: they used to leave 1.8e-5 N m, as if that were an excitation.
    let message = refused(|task| task.gain = Some(Vector4::new(-0.5, -12.0, -0.6, -2.5)));
    let message = message.to_string();
    assert!(message.contains("it has a pole at +"), "{message}");
    let message = refused(|task| task.amplitude = 1e-4).to_string();
    assert!(message.contains("--amplitude"), "{message}");
}

/// The identified inertias used to be combined with the paper's lengths.
#[test]
fn the_lengths_of_an_identified_robot_are_those_of_its_file() {
    let geometry = Geometry {
        centre_of_mass: 0.25,
        ball_radius: 0.1,
        wheel_radius: 0.03,
        gravity: 9.81,
    };
    let mut laboratory = healthy();
    laboratory.plant.geometry = geometry;
    let lengths = "[geometry]\ncentre_of_mass_m = 0.25\nball_radius_m = 0.1\nwheel_radius_m = 0.03";
    let config = Config::parse(lengths).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, csv(&laboratory.record(1))).unwrap();
    let recording = log::recording(&path, &config.log, &|_| ()).unwrap();
    let choices = config.choices().unwrap();
    let robot = identify(vec![recording], &config, choices, &|_| {}).unwrap();
    let text = robot.parameter_files().unwrap()[0].1.clone();
    let identified = identified_parameters(&text).unwrap();
    // With a configuration of the same lengths, and without one.
    for config in [&config, &Config::default()] {
        let task = ExcitationTask::of(config, Some(&identified)).unwrap();
        for (found, given) in [
            (task.geometry.centre_of_mass, geometry.centre_of_mass),
            (task.geometry.ball_radius, geometry.ball_radius),
            (task.geometry.wheel_radius, geometry.wheel_radius),
            (task.geometry.gravity, geometry.gravity),
        ] {
            assert!((found - given).abs() <= 1e-15, "{found} for {given}");
        }
        let b1 = robot.first().estimate.values[Parameter::B1];
        assert_eq!(task.robot[Parameter::B1], b1);
    }
    let other = Config::parse(&lengths.replace("0.1\n", "0.11\n")).unwrap();
    let refused = ExcitationTask::of(&other, Some(&identified)).unwrap_err();
    let message = refused.to_string();
    assert!(
        message.contains("geometry.ball_radius_m = 0.11: it must be 0.1, with which"),
        "{message}"
    );
    for (key, value) in [("ball_radius_m", "-0.1"), ("gravity_m_s2", "nan")] {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        let damaged = text.replace(line, &format!("{key} = {value}"));
        let message = identified_parameters(&damaged).unwrap_err().to_string();
        assert!(
            message.contains("it must be a positive number"),
            "{message}"
        );
    }
}
