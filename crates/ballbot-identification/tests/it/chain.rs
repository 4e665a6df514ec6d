//! From a file to a judged robot, and what a builder can do wrong on the way.

use crate::laboratory::{Laboratory, Record, csv, healthy};
use ballbot_identification::{Config, Identification, Parameter, Verdict, identify, log};
use std::fmt::Write as _;

pub fn identified(laboratory: &Laboratory, seed: u64, config: &str) -> Identification {
    identified_from(&csv(&laboratory.record(seed)), config)
}

pub fn identified_from(text: &str, config: &str) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    let config = Config::parse(config).unwrap();
    let recording = log::recording(&path, &config.log, &|_| ()).unwrap();
    let choices = config.choices().unwrap();
    let robot = identify(vec![recording], &config, choices, &|_| {}).unwrap();
    robot.first().clone()
}

/// A delay, an offset, a bias: a real robot, in a short log.
fn real() -> Laboratory {
    Laboratory {
        rate: 100.0,
        duration: 12.0,
        ..at_length()
    }
}

/// The same robot in a log long enough for what shows in a few per cent.
fn at_length() -> Laboratory {
    Laboratory {
        delay: 0.01,
        tilt_offset: 0.01,
        gyro_bias: 0.02,
        ..healthy()
    }
}

fn warnings(identification: &Identification) -> Vec<String> {
    identification
        .verdicts()
        .iter()
        .filter(|verdict| verdict.weight() == ballbot_identification::Weight::Warning)
        .map(ToString::to_string)
        .collect()
}

fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0).abs()
}

#[test]
fn a_good_log_gives_no_warning() {
    let laboratory = real();
    let found = identified(&laboratory, 3, "");
    assert!(warnings(&found).is_empty(), "{:?}", warnings(&found));
    assert!(found.is_white());
    // The unstable pole within its interval, from the laboratory's own linear model.
    let truth = laboratory.unstable_pole();
    let pole = found.poles.last().unwrap();
    let error = (pole.value.re - truth).abs();
    assert!(error < 3.0 * pole.standard_deviation.0, "{error}");
    assert!(error < 0.02 * truth, "{error}");
}

#[test]
fn an_ignored_delay_raises_the_alarm() {
    for delay in [0.005, 0.01, 0.02] {
        let laboratory = Laboratory { delay, ..real() };
        let found = identified(&laboratory, 3, "[parameters]\ndelay_s = { fixed = 0.0 }");
        let verdicts = found.verdicts();
        let wanted = verdicts.iter().find_map(|verdict| match verdict {
            Verdict::DelayAlarm { wanted, .. } => Some(*wanted),
            _ => None,
        });
        // What the residuals ask for is the truth within a third: a tangent, not a fit.
        assert!(
            (wanted.unwrap() - delay).abs() < 0.33 * delay,
            "{wanted:?} for {delay}"
        );
        // The normalised residual rises from about 1.
        let residual = found.normalised_residual();
        assert!(residual > 1.2, "{residual} at {delay} s");
        assert!(!found.is_white());
    }
}

#[test]
fn a_push_is_found_where_it_was() {
    let laboratory = Laboratory {
        push: Some((7.5, 0.5)),
        ..at_length()
    };
    let found = identified(&laboratory, 3, "");
    let when = found
        .verdicts()
        .into_iter()
        .find_map(|verdict| match verdict {
            Verdict::Disturbed { time, .. } => Some(time),
            _ => None,
        });
    let (from, to) = when.unwrap();
    assert!(from <= 7.5 && 7.5 <= to, "{from} to {to}");
}

#[test]
fn an_ignored_tilt_offset_is_found_out() {
    let config = "[parameters]\ntilt_offset_rad = { fixed = 0.0 }";
    let found = identified(&real(), 3, config);
    let b1 = found.estimate.values[Parameter::B1];
    assert!(percent(b1, real().plant.b1) > 50.0, "{b1}");
    let all = warnings(&found).join("\n");
    assert!(
        all.contains("the tilt sensor's offset is held at 0"),
        "{all}"
    );
    // A torque offset in its place does not help.
    let config = format!("{config}\ntorque_bias_nm = \"free\"");
    let found = identified(&real(), 3, &config);
    assert!(found.normalised_residual() > 1.3);
    let all = warnings(&found).join("\n");
    assert!(
        all.contains("the tilt sensor's offset is held at 0"),
        "{all}"
    );
}

/// What was said of the noise used to stand in place of the residuals, so that every fit was good.
#[test]
fn noise_that_is_known_does_not_hide_what_the_robot_does_not_explain() {
    let laboratory = real();
    let noise = laboratory.noise;
    let known = format!(
        "[noise]\nphi_rad = {:?}\ntheta_rad = {:?}\ntheta_dot_rad_s = {:?}\n",
        noise[0], noise[1], noise[2]
    );
    let config = format!("{known}[parameters]\ntilt_offset_rad = {{ fixed = 0.0 }}");
    let found = identified(&laboratory, 3, &config);
    let verdicts = found.verdicts();
    let too_large = verdicts
        .iter()
        .any(|verdict| matches!(verdict, Verdict::ResidualTooLarge { .. }));
    assert!(too_large, "{verdicts:?}");
    // Of the right robot the residuals are the noise that is there, not a larger one that was claimed.
    let claimed = "[noise]\nphi_rad = 0.003\ntheta_rad = 0.003\ntheta_dot_rad_s = 0.015";
    for config in [&known, claimed] {
        let found = identified(&laboratory, 3, config);
        for (residual, noise) in found.residuals.iter().zip(noise.iter()) {
            let spread = residual.spread;
            // A thousand rows tell a standard deviation to two or three per cent.
            assert!(percent(spread, *noise) < 10.0, "{spread} for {noise}");
        }
    }
}

#[test]
fn an_ignored_gyro_bias_hardly_matters() {
    let laboratory = at_length();
    let config = "[parameters]\ngyro_bias_rad_s = { fixed = 0.0 }";
    let found = identified(&laboratory, 3, config);
    for (parameter, truth) in [
        (Parameter::B1, laboratory.plant.b1),
        (Parameter::B2, laboratory.plant.b2),
        (Parameter::B3, laboratory.plant.b3),
    ] {
        let error = percent(found.estimate.values[parameter], truth);
        assert!(error < 1.5, "{parameter}: {error} %");
    }
    let all = warnings(&found).join("\n");
    assert!(all.contains("the gyroscope's bias is held at 0"), "{all}");
}

#[test]
fn friction_at_the_wrong_place_is_found_out() {
    let laboratory = Laboratory {
        drive_friction: 0.15,
        ..real()
    };
    let config = "[parameters]\ndrive_friction_m2_s = { fixed = 0.0 }";
    let found = identified(&laboratory, 3, config);
    let all = warnings(&found).join("\n");
    assert!(
        all.contains("the viscous friction in the drive is held at 0"),
        "{all}"
    );
    let other = found
        .verdicts()
        .iter()
        .any(|verdict| matches!(verdict, Verdict::OtherStructure { .. }));
    assert!(other, "the structure is not questioned");
    let pole = |found: &Identification| found.poles.last().unwrap().value.re;
    let truth = laboratory.unstable_pole();
    // What is at the wrong place is made up for by what is left: rolling friction that is not there.
    let rolling = found.estimate.values[Parameter::RollingFriction];
    assert!(percent(rolling, laboratory.plant.b4) > 100.0, "{rolling}");
    let right = identified(&laboratory, 3, "");
    assert!(percent(pole(&right), truth) < 3.0, "{}", pole(&right));
}

#[test]
fn a_torque_that_is_not_divided_by_the_body_mass_is_found_out() {
    let found = identified(
        &real(),
        3,
        "[parameters]\ntorque_gain_1_kg = { fixed = 1.0 }",
    );
    let b1 = found.estimate.values[Parameter::B1];
    assert!(percent(b1, real().plant.b1) > 100.0, "{b1}");
    let all = warnings(&found).join("\n");
    assert!(
        all.contains("the torque gain (1 / body mass) is held at 1"),
        "{all}"
    );
}

#[test]
fn the_commanded_torque_of_a_saturated_robot_is_found_out() {
    let laboratory = Laboratory {
        amplitude: 2.0,
        limit: 1.5,
        ..real()
    };
    let record = laboratory.record(3);
    // Only what was asked for is logged, clipped nowhere.
    let text = csv(&record).replace("torque_applied_nm", "unknown");
    let found = identified_from(&text, "");
    assert!(found.normalised_residual() > 1.3);
    assert!(!warnings(&found).is_empty());
    // With both logged, the applied one is used, and the difference said.
    let found = identified_from(&csv(&record), "");
    let findings = found.findings[0].1.iter().map(ToString::to_string);
    let findings = findings.collect::<Vec<_>>().join("\n");
    assert!(
        findings.contains("differs from the commanded one"),
        "{findings}"
    );
    assert!(findings.contains("at its limit of 1.5"), "{findings}");
    let error = percent(found.estimate.values[Parameter::B3], laboratory.plant.b3);
    assert!(error < 3.0, "{error} %");
}

#[test]
fn little_excitation_tells_little_and_says_so() {
    let laboratory = Laboratory {
        amplitude: 0.02,
        duration: 3.0,
        ..real()
    };
    let found = identified(&laboratory, 3, "[fit]\nheld_back = 0.0");
    let weak = found
        .verdicts()
        .iter()
        .any(|verdict| matches!(verdict, Verdict::Weak { factor, .. } if *factor > 2.0));
    assert!(weak, "{:?}", found.verdicts());
}

#[test]
fn differentiated_noise_makes_a_healthy_robot_look_impossible() {
    let laboratory = Laboratory {
        amplitude: 0.1,
        ..at_length()
    };
    let found = identified(&laboratory, 3, "");
    let published = found.published.unwrap().parameters;
    let truth = laboratory.linear_parameters();
    // p4 > 0 for every rigid body: gravity tips it over.
    assert!(truth.p4 > 0.0);
    assert!(published.p4 < 0.0, "{published:?}");
    // The regression is sure of itself nevertheless.
    let deviation = found.published.unwrap().standard_deviations[3];
    assert!((published.p4 - truth.p4).abs() > 10.0 * deviation);
    // The trajectories of the same log are right.
    let fitted = found.linear_parameters().unwrap();
    assert!(percent(fitted.p4, truth.p4) < 10.0, "{fitted:?}");
}

#[test]
fn mechanics_is_imposed_unless_it_is_not_wanted() {
    // The paper's robot is none: only without mechanics can its log be explained.
    let laboratory = Laboratory::of_the_paper();
    let fixed = "[parameters]\ntorque_gain_1_kg = { fixed = 1.0 }\n\
                 drive_friction_m2_s = { fixed = 0.0 }";
    let imposed = identified(&laboratory, 3, fixed);
    assert!(imposed.consistency().is_physical());
    let at_bound = imposed
        .verdicts()
        .iter()
        .any(|v| matches!(v, Verdict::AtBound { .. }));
    assert!(at_bound && imposed.normalised_residual() > 1.3);
    let free = identified(&laboratory, 3, &format!("{fixed}\n[fit]\nphysical = false"));
    assert!(
        free.normalised_residual() < 1.1,
        "{}",
        free.normalised_residual()
    );
    let b1 = free.estimate.values[Parameter::B1];
    assert!(percent(b1, 0.002_483) < 5.0, "{b1}");
    let all = warnings(&free).join("\n");
    assert!(
        all.contains("no rigid ballbot has these parameters"),
        "{all}"
    );
}

#[test]
fn several_runs_are_one_fit_and_a_drawing_is_a_prior() {
    let folder = tempfile::tempdir().unwrap();
    let body = "[body]\nbody_mass_kg = 9.0\nbody_inertia_kg_m2 = 0.5\nball_mass_kg = 2.0\n\
                ball_inertia_kg_m2 = 0.0115\nwheel_inertia_kg_m2 = 0.04\nzenith_angle_deg = 45.0\n\
                uncertainty = 0.3";
    let config = Config::parse(body).unwrap();
    let logs = [1, 2].map(|seed| {
        let path = folder.path().join(format!("{seed}.csv"));
        let laboratory = Laboratory {
            duration: 10.0,
            ..real()
        };
        std::fs::write(&path, csv(&laboratory.record(seed))).unwrap();
        log::recording(&path, &config.log, &|_| ()).unwrap()
    });
    let choices = config.choices().unwrap();
    let robot = identify(logs.to_vec(), &config, choices, &|_| {}).unwrap();
    let found = robot.first();
    let runs = found.simulated.iter().map(|segment| segment.run);
    assert_eq!(runs.collect::<std::collections::BTreeSet<_>>().len(), 2);
    let error = percent(found.estimate.values[Parameter::B1], real().plant.b1);
    assert!(error < 5.0, "{error} %");
    assert!(warnings(found).is_empty(), "{:?}", warnings(found));
}

/// The log with three encoders of the wheels, in a unit each, in place of the ball angle.
fn with_wheels(laboratory: &Laboratory, record: &Record) -> String {
    let geometry = laboratory.plant.geometry;
    let gear = geometry.ball_radius / geometry.wheel_radius;
    // psi = W' m, so m = W'^-1 psi.
    let wheels = ballbot::Wheels::<f64>::paper().matrix().transpose();
    let wheels = wheels.try_inverse().unwrap();
    let mut text =
        "t_s,m1_deg,m2_turn,m3_rad,theta_rad,theta_dot_rad_s,torque_applied_nm\n".to_owned();
    for (row, time) in record.run.time.iter().enumerate() {
        let outputs = record.run.outputs[row];
        // The other plane moves, too, and the robot turns a little.
        let other = (3.0 * time).sin();
        let psi = nalgebra::Vector3::new(gear * outputs[0], other, 0.3 * time);
        let m = wheels * psi;
        writeln!(
            text,
            "{time},{},{},{},{},{},{}",
            m[0].to_degrees(),
            m[1] / std::f64::consts::TAU,
            -m[2],
            outputs[1],
            outputs[2],
            record.run.torque[row]
        )
        .unwrap();
    }
    text
}

#[test]
fn three_encoders_of_the_wheels_are_put_together() {
    let laboratory = Laboratory {
        ball_angle: log::BallAngle::RelativeToBody,
        ..real()
    };
    let record = laboratory.record(3);
    let text = with_wheels(&laboratory, &record);
    let config = |plane: &str| {
        let ratio = 0.05 / 0.12;
        format!(
            "[log.wheels]\nplane = \"{plane}\"\nzenith_angle_deg = 45.0\nencoders = [\n\
             {{ column = \"m1_deg\", unit = \"deg\", factor = {ratio} }},\n\
             {{ column = \"m2_turn\", unit = \"turn\", factor = {ratio} }},\n\
             {{ column = \"m3_rad\", unit = \"rad\", factor = -{ratio} }},\n]"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, &text).unwrap();
    let read = |plane: &str| {
        let config = Config::parse(&config(plane)).unwrap();
        log::read(&path, &config.log, &|_| ()).unwrap().run
    };
    for (x, truth) in read("x").outputs.iter().zip(&record.run.outputs) {
        assert!((x - truth).norm() < 1e-12, "{x} for {truth}");
    }
    for (y, time) in read("y").outputs.iter().zip(&record.run.time) {
        assert!((y[0] - 0.05 / 0.12 * (3.0 * time).sin()).abs() < 1e-12);
    }
    // Relative to the body without a word about it.
    let found = identified_from(&text, &config("x"));
    let error = percent(found.estimate.values[Parameter::B1], laboratory.plant.b1);
    assert!(error < 5.0, "{error} %");
    assert!(warnings(&found).is_empty(), "{:?}", warnings(&found));
}
