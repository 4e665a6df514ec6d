//! Logs whose columns are not what was said: never a robot that is none. Each is understood for what
//! it is, or refused with what is wrong.

use crate::laboratory::{Laboratory, Record, csv, healthy};
use ballbot_identification::log::BallAngle;
use ballbot_identification::{
    Choice, Config, EstimateError, IdentifiedRobot, Parameter, Suspect, Suspects, Tables, Verdict,
    Weight, identify, log,
};
use std::f64::consts::{PI, TAU};

const DEGREE: f64 = 180.0 / PI;

fn record() -> Record {
    laboratory().record(3)
}

fn laboratory() -> Laboratory {
    Laboratory {
        delay: 0.01,
        tilt_offset: 0.01,
        gyro_bias: 0.02,
        rate: 100.0,
        duration: 8.0,
        ..healthy()
    }
}

/// What becomes of the log after a change.
fn outcome(config: &str, change: impl Fn(&mut Record)) -> Result<IdentifiedRobot, String> {
    let mut record = record();
    change(&mut record);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, csv(&record)).unwrap();
    let config = Config::parse(config).unwrap();
    let read = log::recording(&path, &config.log, &|_| ()).map_err(|error| error.to_string())?;
    let found = identify(vec![read], &config, config.choices().unwrap(), &|_| {});
    found.map_err(|error| error.to_string())
}

/// There are no parameters, nothing is called good beside it, and the words say why.
fn refused(config: &str, words: &str, change: impl Fn(&mut Record)) {
    let said = match outcome(config, change) {
        Err(message) => message,
        Ok(found) => {
            let reasons = found.parameter_files().unwrap_err();
            let good = found
                .first()
                .verdicts()
                .iter()
                .any(|verdict| verdict.weight() == Weight::Good);
            assert!(!good, "{:?}", found.first().verdicts());
            let all = found.first().verdicts();
            let all: String = all.iter().map(|one| format!("{one}\n")).collect();
            assert_short(&all);
            reasons
                .iter()
                .map(|(_, reason)| format!("{reason}\n"))
                .collect()
        }
    };
    assert!(said.contains(words), "`{words}` is not in: {said}");
    assert_short(&said);
}

/// A sentence for people: no NaN, no infinity, no number of many digits.
fn assert_short(text: &str) {
    assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    let digits = text.split(|c: char| !c.is_ascii_digit());
    assert!(digits.map(str::len).max() <= Some(8), "{text}");
}

fn scaled(output: usize, factor: f64) -> impl Fn(&mut Record) {
    move |record| {
        let outputs = record.run.outputs.iter_mut();
        outputs.for_each(|row| row[output] *= factor);
    }
}

fn torque_scaled(factor: f64) -> impl Fn(&mut Record) {
    move |record| {
        record
            .run
            .torque
            .iter_mut()
            .for_each(|torque| *torque *= factor)
    }
}

const MASS: &str = "[parameters]\ntorque_gain_1_kg = { fixed = 0.1 }";

/// The body of the laboratory, from a drawing that is known to so much of itself.
fn drawing(uncertainty: f64) -> String {
    format!(
        "[body]\nbody_mass_kg = 10.0\nbody_inertia_kg_m2 = 0.4\nball_mass_kg = 2.0\n\
         ball_inertia_kg_m2 = 0.0144\nwheel_inertia_kg_m2 = 0.0463\nzenith_angle_deg = 45.0\n\
         uncertainty = {uncertainty}\n"
    )
}

#[test]
fn the_log_as_it_is_has_parameters() {
    for config in ["", MASS] {
        let found = outcome(config, |_| ()).unwrap();
        found.parameter_files().unwrap();
        assert_eq!(found.suspects, None);
        let b1 = found.estimate().values[Parameter::B1] / laboratory().plant.b1;
        assert!((b1 - 1.0).abs() < 0.05, "{b1}");
    }
}

/// Beside one wrong value of a torque among 800 there were no parameters.
#[test]
fn a_value_that_stands_out_changes_no_parameter_by_much() {
    let b1 = |found: IdentifiedRobot| {
        found.parameter_files().unwrap();
        found.estimate().values[Parameter::B1] / laboratory().plant.b1
    };
    let clean = b1(outcome("", |_| ()).unwrap());
    let torque = b1(outcome("", |record| record.run.torque[333] = 20.0).unwrap());
    let rate = b1(outcome("", |record| record.run.outputs[444][2] = -60.0).unwrap());
    for found in [torque, rate] {
        assert!((found - clean).abs() < 0.01, "{found} for {clean}");
    }
}

#[test]
fn a_torque_with_the_other_sign() {
    refused("", "the torque has the other sign", torque_scaled(-1.0));
}

#[test]
fn a_ball_angle_with_the_other_sign() {
    refused("", "the ball angle has the other sign", scaled(0, -1.0));
}

#[test]
fn a_tilt_with_the_other_sign() {
    refused("", "tilt and tilt rate have the other sign", |record| {
        scaled(1, -1.0)(record);
        scaled(2, -1.0)(record);
    });
    // One of both contradicts the other.
    refused("", "one of them has the other sign", scaled(1, -1.0));
    refused("", "one of them has the other sign", scaled(2, -1.0));
}

#[test]
fn everything_with_the_other_sign_is_the_same_robot_seen_from_behind() {
    let found = outcome("", |record| {
        torque_scaled(-1.0)(record);
        (0..3).for_each(|output| scaled(output, -1.0)(record));
    });
    found.unwrap().parameter_files().unwrap();
}

#[test]
fn a_torque_in_another_unit() {
    let (milli, kilo) = (
        "thousandths of the unit",
        "a thousand times those that are said",
    );
    refused("", milli, torque_scaled(1e3));
    refused("", kilo, torque_scaled(1e-3));
    let prior = "[parameters]\ntorque_gain_1_kg = { prior = { mean = 0.1, \
                 standard_deviation = 0.004 } }";
    refused(prior, "was expected at 0.1", torque_scaled(2.0));
    // With the body's mass the unit itself is known.
    refused(MASS, milli, torque_scaled(1e3));
    refused(MASS, kilo, torque_scaled(1e-3));
}

#[test]
fn a_torque_in_another_unit_on_a_body_from_a_drawing() {
    // No body of this size is a thousand times as heavy, however little is known of its mass, or as
    // light.
    for uncertainty in [0.3, 0.9] {
        let drawing = drawing(uncertainty);
        refused(&drawing, "a body weighs from 0.2641", torque_scaled(1e3));
    }
    let kilo = "a thousand times those that are said";
    refused(&drawing(0.3), kilo, torque_scaled(1e-3));
    // Some body is a hundred times as heavy, but not this one: it is 330 standard deviations away,
    // though the gain is not even four.
    let drawing = drawing(0.3);
    refused(&drawing, "was expected at 0.1", torque_scaled(100.0));
    // Twice as heavy is three standard deviations, and no contradiction.
    let found = outcome(&drawing, torque_scaled(2.0)).unwrap();
    found.parameter_files().unwrap();
    let verdicts = found.first().verdicts();
    let contradicted = |one: &Verdict| matches!(one, Verdict::PriorContradicted { .. });
    assert!(!verdicts.iter().any(contradicted), "{verdicts:?}");
}

#[test]
fn a_ball_angle_in_another_unit() {
    refused("", "degrees taken for radians", scaled(0, DEGREE));
    refused(
        "",
        "in radians and taken for degrees",
        scaled(0, 1.0 / DEGREE),
    );
    refused("", "in turns and taken for radians", scaled(0, 1.0 / TAU));
    // r_w / r_b is forgotten.
    refused(
        "",
        "is the angle of a wheel: set factor = 0.4167",
        scaled(0, 2.4),
    );
}

#[test]
fn a_tilt_in_another_unit() {
    let both = |factor: f64| {
        move |record: &mut Record| {
            scaled(1, factor)(record);
            scaled(2, factor)(record);
        }
    };
    refused("", "in radians and taken for degrees", both(1.0 / DEGREE));
    refused("", "seems to be in degrees", both(DEGREE));
    refused("", "degrees per second", scaled(2, DEGREE));
    refused(
        "",
        "the tilt seems to be in degrees",
        scaled(2, 1.0 / DEGREE),
    );
    refused(
        "",
        "degrees per second and the tilt in rad",
        scaled(1, 1.0 / DEGREE),
    );
}

#[test]
fn a_ball_angle_relative_to_something_else() {
    let relative = |record: &mut Record| {
        let outputs = record.run.outputs.iter_mut();
        outputs.for_each(|row| row[0] -= row[1]);
    };
    refused(MASS, "what ball_angle is relative to", relative);
    // Without the body's mass another robot nearly explains it. Said rightly, it is a robot's.
    refused("", "the ball angle is relative to the body", relative);
    let right = "[log]\nball_angle = \"relative_to_body\"";
    let found = outcome(right, relative).unwrap();
    found.parameter_files().unwrap();
    let other = found.first().other_reading.unwrap();
    assert!(other.is_worse(), "{other:?}");
    // The other way round.
    refused(right, "the ball angle is relative to the floor", |_| ());
    // A body that was weighed is not asked about.
    assert_eq!(outcome(MASS, |_| ()).unwrap().first().other_reading, None);
}

#[test]
fn a_ball_angle_relative_to_something_else_on_a_body_from_a_drawing() {
    let relative = |record: &mut Record| {
        let outputs = record.run.outputs.iter_mut();
        outputs.for_each(|row| row[0] -= row[1]);
    };
    for uncertainty in [0.1, 0.3] {
        let drawing = drawing(uncertainty);
        refused(&drawing, "the ball angle is relative to the body", relative);
    }
    // Said rightly, either way, it is a robot's.
    let (inertial, right) = (
        drawing(0.3),
        format!("{}[log]\nball_angle = \"relative_to_body\"", drawing(0.3)),
    );
    for found in [outcome(&inertial, |_| ()), outcome(&right, relative)] {
        let found = found.unwrap();
        found.parameter_files().unwrap();
        let other = found.first().other_reading.unwrap();
        assert!(other.is_worse(), "{other:?}");
    }
    refused(&right, "the ball angle is relative to the floor", |_| ());
}

#[test]
fn what_the_ball_angle_is_relative_to_is_asked_where_the_log_does_not_tell() {
    let quiet = Laboratory {
        amplitude: 0.05,
        ..laboratory()
    };
    let found = crate::chain::identified(&quiet, 3, "");
    let untold = found
        .verdicts()
        .into_iter()
        .find_map(|verdict| match verdict {
            Verdict::BallAngleUntold { reading, .. } => Some((reading, verdict.to_string())),
            _ => None,
        });
    let (reading, words) = untold.unwrap();
    assert_eq!(reading, Suspect::BallAngle(BallAngle::RelativeToBody));
    assert!(words.contains("body_mass_kg"), "{words}");
}

#[test]
fn columns_in_each_others_place() {
    refused("", "`phi_rad` jumps", |record| {
        let rows = record.run.outputs.iter_mut().zip(&mut record.run.torque);
        rows.for_each(|(row, torque)| std::mem::swap(&mut row[0], torque));
    });
    refused("", "do not belong together", |record| {
        let outputs = record.run.outputs.iter_mut();
        outputs.for_each(|row| row.as_mut_slice().swap(0, 1));
    });
}

#[test]
fn columns_that_do_not_belong_together() {
    let other = laboratory().record(9).run;
    refused("", "no robot explains", |record| {
        record.run.torque.clone_from(&other.torque);
    });
    // A quarter of a turn: tilt and rate of the other plane.
    refused("", "no robot explains", |record| {
        for (row, other) in record.run.outputs.iter_mut().zip(&other.outputs) {
            (row[1], row[2]) = (other[1], other[2]);
        }
    });
    // An encoder that is not connected, with the noise of its converter.
    let mut rng = fastrand::Rng::with_seed(1);
    let noise: Vec<f64> = (0..1500).map(|_| rng.f64()).collect();
    refused("", "", |record| {
        let rows = record.run.outputs.iter_mut().zip(&noise);
        rows.for_each(|(row, noise)| row[0] = 1e-3 * noise);
    });
}

const NO_GYROSCOPE: &str = "[log.theta_dot]\ncolumn = \"\"\nunit = \"rad/s\"";

#[test]
fn without_a_gyroscope_its_bias_is_held() {
    let found = outcome(NO_GYROSCOPE, |_| ()).unwrap();
    assert_eq!(
        found.first().choices[Parameter::GyroBias],
        Choice::Fixed(0.0)
    );
    let [(_, file)] = &found.parameter_files().unwrap()[..] else {
        panic!("one plane, one file")
    };
    assert!(!file.contains("NaN") && !file.contains("inf"), "{file}");
    let b3 = found.estimate().values[Parameter::B3] / laboratory().plant.b3;
    assert!((b3 - 1.0).abs() < 0.05, "{b3}");
}

#[test]
fn without_a_gyroscope_signs_are_tested_too() {
    refused(
        NO_GYROSCOPE,
        "the torque has the other sign",
        torque_scaled(-1.0),
    );
    refused(
        NO_GYROSCOPE,
        "the ball angle has the other sign",
        scaled(0, -1.0),
    );
    refused(
        NO_GYROSCOPE,
        "tilt and tilt rate have the other sign",
        scaled(1, -1.0),
    );
}

#[test]
fn a_builder_may_insist() {
    let found = outcome("[log]\naccept_suspicious_units = true", torque_scaled(-1.0));
    let found = match found {
        Ok(found) => found,
        Err(message) => return assert!(message.contains("the other sign"), "{message}"),
    };
    let accepted = Verdict::WrongColumns {
        suspects: Suspects {
            mistakes: vec![Suspect::TorqueSign],
            tables: Tables::default(),
        },
        accepted: true,
    };
    assert_eq!(accepted.weight(), Weight::Warning);
    assert!(found.first().verdicts().contains(&accepted));
    // What the fit says for itself stands.
    assert!(found.parameter_files().is_err());
}

#[test]
fn a_body_that_was_never_upright_is_refused() {
    // Mounted a quarter turn off: the middle of the tilt is no offset of a sensor.
    let askew = |record: &mut Record| {
        record.run.outputs.iter_mut().for_each(|row| row[1] += 1.5);
    };
    refused("", "the tilt sensor's offset goes to 0.35 rad", askew);
}

#[test]
fn an_error_of_the_fit_names_the_columns() {
    let error = EstimateError::Suspect {
        suspects: Suspects {
            mistakes: vec![Suspect::BallSign],
            tables: Tables::default(),
        },
        error: Box::new(EstimateError::NoSegments {
            segment: 1.0,
            lead: 0.1,
        }),
    };
    assert!(
        error
            .to_string()
            .contains("the ball angle has the other sign")
    );
}

#[test]
fn a_duty_cycle_with_back_emf_is_a_torque_and_a_friction() {
    // A drive of 24 V: 0.05 N m per volt at standstill, and 0.02 N m less per rad/s of the ball
    // against the body.
    let laboratory = laboratory();
    let gear = laboratory.plant.geometry.ball_radius / laboratory.plant.geometry.wheel_radius;
    let mut driven = laboratory.clone();
    driven.drive_friction += gear * laboratory.torque_gain * 0.02;
    let mut record = driven.record(3);
    record
        .run
        .torque
        .iter_mut()
        .for_each(|torque| *torque /= 24.0 * 0.05);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, csv(&record)).unwrap();
    let identified = |factor: &str| {
        let config =
            format!("[log.torque]\ncolumn = \"torque_applied_nm\"\nunit = \"1\"\n{factor}");
        let config = Config::parse(&config).unwrap();
        let read = log::recording(&path, &config.log, &|_| ()).unwrap();
        let found = identify(vec![read], &config, config.choices().unwrap(), &|_| {}).unwrap();
        found.parameter_files().unwrap();
        found
    };
    let found = identified("");
    let said = found.first().verdicts().contains(&Verdict::NoTorque);
    assert!(said, "{:?}", found.first().verdicts());
    let gain = found.estimate().values[Parameter::TorqueGain];
    assert!((gain / (0.1 * 24.0 * 0.05) - 1.0).abs() < 0.05, "{gain}");
    let friction = found.estimate().values[Parameter::DriveFriction];
    assert!(
        (friction / driven.drive_friction - 1.0).abs() < 0.1,
        "{friction}"
    );
    // With the torque per unit it is one.
    let found = identified("factor = 1.2");
    assert!(!found.first().verdicts().contains(&Verdict::NoTorque));
    let gain = found.estimate().values[Parameter::TorqueGain];
    assert!((gain / 0.1 - 1.0).abs() < 0.05, "{gain}");
}
