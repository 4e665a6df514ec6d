//! Both planes of one log at once.

use crate::laboratory::{Laboratory, Record, healthy};
use ballbot::Wheels;
use ballbot_identification::log::{self, BallAngle};
use ballbot_identification::{
    Choice, Config, IdentifiedRobot, Joint, JointEstimate, Parameter, Split, Tables, Task, Values,
    Variables, Verdict, Weight, identify, noise,
};
use lpvmpc_design::NORMAL_95;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt::Write as _;

/// The planes of a robot: of the same ball, wheels and delay, each with sensors of its own.
fn planes() -> [Laboratory; 2] {
    let x = Laboratory {
        delay: 0.01,
        tilt_offset: 0.01,
        gyro_bias: 0.02,
        ball_angle: BallAngle::RelativeToBody,
        ..healthy()
    };
    let y = Laboratory {
        tilt_offset: -0.02,
        gyro_bias: -0.01,
        ..x.clone()
    };
    [x, y]
}

/// A body that is longer along x than along y, by a tenth of b3.
fn asymmetric() -> [Laboratory; 2] {
    let [x, mut y] = planes();
    y.plant.b3 *= 1.1;
    [x, y]
}

fn records(planes: &[Laboratory; 2], seed: u64) -> [Record; 2] {
    [planes[0].record(seed), planes[1].record(seed + 10_000)]
}

/// Wheels that are not those of the paper.
fn wheels() -> Wheels<f64> {
    let wheel = |azimuth: f64, reversed| ballbot::Wheel {
        azimuth: azimuth.to_radians(),
        reversed,
    };
    let placed = [wheel(0.0, false), wheel(120.0, true), wheel(240.0, false)];
    Wheels::new(40_f64.to_radians(), placed).unwrap()
}

/// What one file shows of both planes: three encoders, three torques, two tilts and rates. The robot
/// turns meanwhile.
type Row = ([f64; 3], [f64; 3], [f64; 4]);

fn rows(records: &[Record; 2]) -> Vec<(f64, Row)> {
    let (wheels, gear) = (wheels(), 0.12 / 0.05);
    let angles = wheels.matrix().transpose().try_inverse().unwrap();
    let [x, y] = records.each_ref().map(|record| &record.run);
    let rows = x.time.iter().enumerate();
    rows.map(|(row, time)| {
        let (one, two) = (x.outputs[row], y.outputs[row]);
        let psi = Vector3::new(one[0], two[0], 0.2 * time + 0.1 * (0.7 * time).sin()) * gear;
        let torques = Vector3::new(x.torque[row], y.torque[row], 0.05 * time.sin());
        let tilts = [one[1], two[1], one[2], two[2]];
        let row = ((angles * psi).into(), wheels.motors(&torques).into(), tilts);
        (*time, row)
    })
    .collect()
}

fn csv(rows: &[(f64, Row)]) -> String {
    let mut text = "t,w1,w2,w3,m1,m2,m3,tx,ty,gx,gy\n".to_owned();
    for (time, (angles, torques, tilts)) in rows {
        let values = angles.iter().chain(torques).chain(tilts);
        let values: Vec<String> = values.map(f64::to_string).collect();
        writeln!(text, "{time},{}", values.join(",")).unwrap();
    }
    text
}

const CONFIG: &str = "
[log.time]
column = \"t\"
unit = \"s\"
[log.theta]
column = \"tx\"
unit = \"rad\"
[log.theta_dot]
column = \"gx\"
unit = \"rad/s\"
[log.y]
theta = { column = \"ty\", unit = \"rad\" }
theta_dot = { column = \"gy\", unit = \"rad/s\" }
[log.wheels]
plane = \"both\"
zenith_angle_deg = 40.0
azimuths_deg = [0.0, 120.0, 240.0]
reversed = [false, true, false]
encoders = [
    { column = \"w1\", unit = \"rad\", factor = 0.4166666666666667 },
    { column = \"w2\", unit = \"rad\", factor = 0.4166666666666667 },
    { column = \"w3\", unit = \"rad\", factor = 0.4166666666666667 },
]
torques = [
    { column = \"m1\", unit = \"Nm\" },
    { column = \"m2\", unit = \"Nm\" },
    { column = \"m3\", unit = \"Nm\" },
]
";

fn outcome(text: &str, config: &str) -> Result<IdentifiedRobot, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, text).unwrap();
    let config = Config::parse(config).unwrap();
    let read = log::recording(&path, &config.log, &|_| ()).map_err(|error| error.to_string())?;
    let choices = config.choices().unwrap();
    identify(vec![read], &config, choices, &|_| {}).map_err(|error| error.to_string())
}

fn warnings(robot: &IdentifiedRobot) -> Vec<String> {
    let verdicts = robot.verdicts().into_iter();
    let grave = verdicts.filter(|(_, verdict)| verdict.weight() >= Weight::Warning);
    grave
        .map(|(plane, verdict)| format!("{plane:?} {verdict}"))
        .collect()
}

fn truth(plane: &Laboratory, parameter: Parameter) -> f64 {
    match parameter {
        Parameter::B1 => plane.plant.b1,
        Parameter::B2 => plane.plant.b2,
        Parameter::B3 => plane.plant.b3,
        Parameter::RollingFriction => plane.plant.b4,
        Parameter::DriveFriction => plane.drive_friction,
        Parameter::TorqueGain => plane.torque_gain,
        Parameter::Delay => plane.delay,
        Parameter::TiltOffset => plane.tilt_offset,
        Parameter::GyroBias => plane.gyro_bias,
        _ => 0.0,
    }
}

#[test]
fn both_planes_of_three_wheels_are_one_robot() {
    let laboratories = planes();
    let robot = outcome(&csv(&rows(&records(&laboratories, 1))), CONFIG).unwrap();
    assert!(warnings(&robot).is_empty(), "{:?}", warnings(&robot));
    for (plane, parameter) in robot.variables.all() {
        let found = &robot.planes[plane];
        let error = found.estimate.values[parameter] - truth(&laboratories[plane], parameter);
        let deviation = found.standard_deviation(parameter);
        assert!(
            error.abs() <= 4.0 * deviation,
            "{plane} {parameter}: {error} at {deviation}"
        );
    }
    // What is shared is the same number with the same interval in both.
    let [x, y] = robot.planes.as_slice() else {
        panic!("two planes")
    };
    for parameter in Parameter::ALL {
        let one = (x.estimate.values[parameter], x.interval(parameter));
        let other = (y.estimate.values[parameter], y.interval(parameter));
        let own = matches!(parameter, Parameter::TiltOffset | Parameter::GyroBias);
        assert_eq!(one == other, !own, "{parameter}");
    }
    // One file for a symmetric body, with the wheels that were read.
    let files = robot.parameter_files().unwrap();
    let [(name, text)] = files.as_slice() else {
        panic!("one robot, one file")
    };
    assert_eq!(name, "parameters.toml");
    for part in [
        "zenith_angle_deg = 40.0\nwheel_azimuths_deg = [0.0, 120.0, 240.0]\n\
         wheels_reversed = [false, true, false]",
        "[identification.b1_m2]",
        "[identification.x.tilt_offset_rad]",
        "[identification.y.tilt_offset_rad]",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
}

#[test]
fn a_body_that_is_not_symmetric_is_found_out_and_has_two_inertias() {
    let laboratories = asymmetric().map(|plane| Laboratory {
        rate: 100.0,
        ..plane
    });
    let text = csv(&rows(&records(&laboratories, 2)));
    let as_one = outcome(&text, CONFIG).unwrap();
    let said = as_one.verdicts();
    let said = said.iter().any(|(plane, verdict)| {
        plane.is_none()
            && matches!(
                verdict,
                Verdict::PlanesDiffer {
                    parameter: Parameter::B3,
                    matters: true,
                    ..
                }
            )
    });
    assert!(said, "{:?}", warnings(&as_one));
    let config = format!("{CONFIG}\n[fit]\nsymmetric_body = false\n");
    let robot = outcome(&text, &config).unwrap();
    assert!(warnings(&robot).is_empty(), "{:?}", warnings(&robot));
    for (plane, laboratory) in robot.planes.iter().zip(&laboratories) {
        let relative = plane.estimate.values[Parameter::B3] / laboratory.plant.b3 - 1.0;
        assert!(relative.abs() < 0.02, "{relative}");
    }
    let names = robot
        .parameter_files()
        .unwrap()
        .into_iter()
        .map(|(name, _)| name);
    assert_eq!(
        names.collect::<Vec<_>>(),
        ["parameters_x.toml", "parameters_y.toml"]
    );
}

#[test]
fn what_is_wrong_between_the_planes_is_refused_and_named() {
    let short = planes().map(|plane| Laboratory {
        rate: 100.0,
        duration: 6.0,
        // Where the delay is a whole number of rows, chi^2 has a kink, on which a fit may stagnate.
        delay: 0.012,
        ..plane
    });
    let good = rows(&records(&short, 3));
    let robot = outcome(&csv(&good), CONFIG).unwrap();
    assert!(robot.parameter_files().is_ok(), "{:?}", warnings(&robot));
    // What is changed, and what must be said then.
    type Change = fn(&mut Row);
    let cases: [(&str, Change, &[&str]); 7] = [
        (
            "tilts interchanged",
            |(_, _, tilts)| *tilts = [tilts[1], tilts[0], tilts[3], tilts[2]],
            &["the tilts of the two planes stand in each other's place"],
        ),
        (
            "inertial unit a quarter turn off",
            |(_, _, tilts)| *tilts = [-tilts[1], tilts[0], -tilts[3], tilts[2]],
            &[
                "the tilts of the two planes stand in each other's place",
                "a quarter turn off",
            ],
        ),
        (
            "tilt of y with the other sign",
            |(_, _, tilts)| {
                tilts[1] *= -1.0;
                tilts[3] *= -1.0;
            },
            &["set factor = -1.0 in [log.y.theta] and [log.y.theta_dot]"],
        ),
        (
            "wheels in another order",
            |(angles, torques, _)| {
                angles.rotate_left(1);
                torques.rotate_left(1);
            },
            &[
                "the encoders and torques of the wheels 1, 2, 3 are those that [log.wheels] names as 3, 1, 2",
            ],
        ),
        (
            "encoders in another order",
            |(angles, ..)| angles.swap(0, 2),
            &["the encoders of the wheels 1, 2, 3 are those that [log.wheels] names as 3, 2, 1"],
        ),
        (
            "an encoder that counts backwards",
            |(angles, ..)| angles[1] *= -1.0,
            &["the encoders of wheel 2 have the other sign"],
        ),
        (
            "a motor's torque with the other sign",
            |(_, torques, _)| torques[2] *= -1.0,
            &["the torques of wheel 3 have the other sign"],
        ),
    ];
    for (name, change, parts) in cases {
        let mut rows = good.clone();
        rows.iter_mut().for_each(|(_, row)| change(row));
        let said = match outcome(&csv(&rows), CONFIG) {
            Err(message) => message,
            Ok(robot) => {
                let Err(refusals) = robot.parameter_files() else {
                    panic!("{name}: {:?}", warnings(&robot))
                };
                let good = robot.verdicts();
                assert!(
                    good.iter().all(|(_, one)| one.weight() != Weight::Good),
                    "{name}"
                );
                refusals.iter().map(|(_, one)| format!("{one}\n")).collect()
            }
        };
        for part in parts {
            assert!(said.contains(part), "{name}: `{part}` is not in: {said}");
        }
    }
}

#[test]
fn planes_of_named_columns_need_no_wheels_and_a_gyroscope_may_be_missing_in_one() {
    let laboratories = planes().map(|plane| Laboratory {
        ball_angle: BallAngle::Inertial,
        ..plane
    });
    let [x, y] = records(&laboratories, 4);
    let mut text =
        "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_applied_nm,phi_y,theta_y,torque_y\n"
            .to_owned();
    for (row, time) in x.run.time.iter().enumerate() {
        let (one, two) = (x.run.outputs[row], y.run.outputs[row]);
        let [a, b, c] = one.into();
        let (u, v) = (x.run.torque[row], 1e3 * y.run.torque[row]);
        writeln!(
            text,
            "{time},{a},{b},{c},{u},{},{},{v}",
            two[0],
            two[1].to_degrees()
        )
        .unwrap();
    }
    let config = "[body]\nbody_mass_kg = 10.0\n[log.y]\n\
                  phi = { column = \"phi_y\", unit = \"rad\" }\n\
                  theta = { column = \"theta_y\", unit = \"deg\" }\n\
                  torque = { column = \"torque_y\", unit = \"mNm\" }\n";
    let robot = outcome(&text, config).unwrap();
    assert!(warnings(&robot).is_empty(), "{:?}", warnings(&robot));
    let [x, y] = robot.planes.as_slice() else {
        panic!("two planes")
    };
    assert_eq!(x.choices[Parameter::GyroBias], Choice::FREE);
    assert_eq!(y.choices[Parameter::GyroBias], Choice::Fixed(0.0));
    assert_eq!(y.residuals.len(), 2);
    let relative = y.estimate.values[Parameter::B1] / laboratories[1].plant.b1 - 1.0;
    assert!(relative.abs() < 0.03, "{relative}");
}

fn task<'a>(runs: &'a [log::Run], laboratory: &Laboratory) -> Task<'a> {
    Task {
        runs,
        ball_angle: laboratory.ball_angle,
        geometry: laboratory.plant.geometry,
        choices: Values::usual(),
        physical: true,
        segment: 1.0,
        torque_known: true,
        noise: [None; 3],
        tables: Tables::default(),
    }
}

fn together(
    laboratories: &[Laboratory; 2],
    records: &[Record; 2],
    variables: Variables,
) -> JointEstimate {
    let runs = records.each_ref().map(|record| [record.run.clone()]);
    let tasks = runs
        .iter()
        .zip(laboratories)
        .map(|(runs, laboratory)| task(runs, laboratory));
    let joint = Joint {
        tasks: tasks.collect(),
        variables,
    };
    let splits = runs.each_ref().map(|runs| Split::new(runs, 0.0));
    let stretches = splits.each_ref().map(|split| split.fitted.as_slice());
    let floors = runs.each_ref().map(|runs| noise::floor(runs));
    joint.estimate(&stretches, &floors, &|_| {}).unwrap()
}

#[test]
fn joint_intervals_cover_the_truth_and_are_no_wider_than_those_of_one_plane() {
    const TRIALS: u64 = 200;
    const ALONE: u64 = 20;
    let laboratories = asymmetric().map(|plane| Laboratory {
        rate: 100.0,
        duration: 5.0,
        // The planes' sensors need not be alike.
        noise: plane.noise * if plane.tilt_offset > 0.0 { 1.0 } else { 2.0 },
        ..plane
    });
    let variables = Variables::of_robot(2, false);
    let records = |seed: u64| records(&laboratories, 2000 + seed);
    let trials: Vec<JointEstimate> = (0..TRIALS)
        .into_par_iter()
        .map(|seed| together(&laboratories, &records(seed), variables))
        .collect();
    let alone: Vec<[JointEstimate; 2]> = (0..ALONE)
        .into_par_iter()
        .map(|seed| {
            let records = records(seed);
            [0, 1].map(|plane| {
                let runs = [records[plane].run.clone()];
                let joint = Joint::alone(task(&runs, &laboratories[plane]));
                let (split, floor) = (Split::new(&runs, 0.0), noise::floor(&runs));
                joint.estimate(&[&split.fitted], &[floor], &|_| {}).unwrap()
            })
        })
        .collect();
    for (plane, parameter) in variables.all() {
        if !Values::usual()[parameter].is_free() {
            continue;
        }
        let (place, index) = (variables.place(plane, parameter), parameter.index());
        let truth = truth(&laboratories[plane], parameter);
        let covered = trials.iter().filter(|joint| {
            let deviation = joint.covariance[(place, place)].sqrt();
            (joint.planes[plane].values[parameter] - truth).abs() <= NORMAL_95 * deviation
        });
        let part = covered.count() as f64 / TRIALS as f64;
        assert!((0.90..=0.99).contains(&part), "{plane} {parameter}: {part}");
        // Roots of the mean variances over some trials, against the better plane.
        let mean = |variances: Vec<f64>| {
            let count = variances.len() as f64;
            (variances.into_iter().sum::<f64>() / count).sqrt()
        };
        let joint = trials.iter().take(ALONE as usize);
        let joint = mean(joint.map(|one| one.covariance[(place, place)]).collect());
        let of = |plane: usize| {
            let alone = alone.iter().map(|planes| &planes[plane]);
            mean(alone.map(|one| one.covariance[(index, index)]).collect())
        };
        let least = match variables.is_own(parameter) {
            true => of(plane),
            false => of(0).min(of(1)),
        };
        assert!(joint <= least, "{plane} {parameter}: {joint} for {least}");
    }
}
