//! From a file to a judged robot.

use crate::laboratory::{Laboratory, Record, healthy};
use ballbot_identification::{Config, Identification, identify, log};
use std::fmt::Write as _;

/// The log as `ballbot simulate --log` writes it.
pub fn csv(record: &Record) -> String {
    let mut text =
        "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm,torque_applied_nm\n".to_owned();
    for (row, time) in record.run.time.iter().enumerate() {
        let outputs = record.run.outputs[row];
        writeln!(
            text,
            "{time},{},{},{},{},{}",
            outputs[0], outputs[1], outputs[2], record.commanded[row], record.run.torque[row]
        )
        .unwrap();
    }
    text
}

pub fn identified(laboratory: &Laboratory, seed: u64, config: &str) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, csv(&laboratory.record(seed))).unwrap();
    let config = Config::parse(config).unwrap();
    let log = log::read(&path, &config.log).unwrap();
    let choices = config.choices().unwrap();
    identify(vec![log], &config, choices, &|_| {}).unwrap()
}

#[test]
fn chain_look() {
    for config in [
        "",
        "[parameters]\ndelay_s = { fixed = 0.0 }",
        "[parameters]\ntilt_offset_rad = { fixed = 0.0 }",
        "[parameters]\ndrive_friction_m2_s = { fixed = 0.0 }",
    ] {
        let clock = std::time::Instant::now();
        let i = identified(
            &Laboratory {
                delay: 0.01,
                tilt_offset: 0.01,
                gyro_bias: 0.02,
                ..healthy()
            },
            3,
            config,
        );
        println!("==== {config}: {:?}", clock.elapsed());
        for p in ballbot_identification::Parameter::ALL {
            println!(
                "{:22} {:10.6} +- {:10.6}",
                p.key(),
                i.estimate.values[p],
                i.standard_deviation(p)
            );
        }
        for (_, f) in &i.findings {
            for f in f {
                println!("finding: {f}");
            }
        }
        for v in i.verdicts() {
            println!("{:?}: {v}", v.weight());
        }
        for p in &i.poles {
            println!("pole {} +- {:?}", p.value, p.standard_deviation);
        }
        for s in &i.structures {
            println!(
                "{:?} fit {:.4} held {:.4} {:?}",
                s.structure,
                s.fitted_chi_square,
                s.validation.chi_square,
                s.validation.errors.map(|e| e[1])
            );
        }
        println!("{:?}", i.validation);
    }
}
