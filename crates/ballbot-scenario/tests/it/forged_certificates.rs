//! Certificates that do not belong to the scenario, or that claim what is not so: each is refused by
//! the name of what is wrong.

use ballbot_scenario::{Scenario, Standing, TerminalCertificate, TerminalTable, builtin};
use lpvmpc_certificate::{ClaimError, MOST_BYTES};
use nalgebra::Vector4;
use std::path::{Path, PathBuf};

fn certificate() -> TerminalCertificate {
    TerminalCertificate::from_json(builtin::TERMINAL_CERTIFICATE).unwrap()
}

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// What becomes of `far-setpoints` with this text as its certificate.
    fn load(&self, text: &str, change: impl Fn(&mut Scenario)) -> Result<Option<Standing>, String> {
        std::fs::write(self.0.join("forged.json"), text).unwrap();
        let mut scenario = Scenario::load("far-setpoints").unwrap();
        if let TerminalTable::Certified(table) = &mut scenario.controller.terminal {
            table.certificate = Some("forged.json".to_owned());
        }
        change(&mut scenario);
        let prepared = scenario.prepare(self.0.as_path());
        prepared
            .map(|prepared| prepared.certificate)
            .map_err(|error| error.to_string())
    }
}

type Forge = fn(&mut TerminalCertificate);
type Change = fn(&mut Scenario);

fn nothing(_: &mut Scenario) {}

/// None of them needs a proof: what is wrong is seen when the scenario is loaded.
#[test]
fn what_does_not_fit_is_refused_on_loading() {
    let folder = Folder::new("does-not-fit");
    let cases: [(&str, Forge, Change, &[&str]); 20] = [
        (
            "Q not symmetric",
            |c| c.q[(0, 1)] = 150.0,
            nothing,
            &["q is not symmetric", "150"],
        ),
        (
            "Q indefinite",
            |c| c.q[(1, 1)] = -1.0,
            nothing,
            &["q could not", "semidefinite"],
        ),
        (
            "R negative",
            |c| c.r[0] = -1000.0,
            nothing,
            &["r could not"],
        ),
        (
            "P not symmetric by one rounding",
            |c| c.terminal.p[(0, 1)] = c.terminal.p[(0, 1)].next_up(),
            nothing,
            &["terminal.p is not symmetric"],
        ),
        (
            "the other P not symmetric",
            |c| c.continuous.p[(3, 0)] = 0.0,
            nothing,
            &["continuous.p is not symmetric"],
        ),
        (
            "P that cannot be told from a singular one",
            |c| c.terminal.p = Vector4::repeat(1.0) * Vector4::repeat(1.0).transpose(),
            nothing,
            &["terminal.p could not"],
        ),
        ("tiny t_s", |c| c.t_s = 1e-300, nothing, &["t_s"]),
        (
            "another t_s",
            |c| c.t_s = 0.02,
            nothing,
            &["controller.t_s", "0.02 s"],
        ),
        (
            "huge level",
            |c| c.terminal.level = 1e300,
            nothing,
            &["terminal.level"],
        ),
        (
            "K at the end of the numbers",
            |c| c.terminal.k[2] = 1e308,
            nothing,
            &["terminal.k[0][2]"],
        ),
        (
            "a robot with friction in its drive",
            |c| c.plant.drive_friction_m2_s = 1e-3,
            nothing,
            &["another robot", "drive_friction_m2_s is 0.001"],
        ),
        (
            "a robot without mass",
            |c| c.plant.b1_m2 = 0.0,
            nothing,
            &["another robot"],
        ),
        (
            "a smaller Q, by a diagonal entry",
            |c| c.q[(0, 0)] = 199.0,
            nothing,
            &["controller.q", "199"],
        ),
        (
            "a smaller Q, with the same diagonal",
            |c| {
                c.q[(0, 1)] = 10.0;
                c.q[(1, 0)] = 10.0;
            },
            nothing,
            &["controller.q", "[200.0, 10.0, 0.0, 0.0]"],
        ),
        (
            "a smaller R",
            |c| c.r[0] = 999.0,
            nothing,
            &["controller.r", "999"],
        ),
        (
            "nothing said of the states",
            |c| c.state_limits = Vector4::repeat(f64::INFINITY),
            nothing,
            &["bounds.theta_rad", "inf"],
        ),
        (
            "bounds that the set keeps at the samples, and not between",
            |_| (),
            |s| s.bounds.theta_rad = [-0.28, 0.28],
            &["bounds.theta_rad", "0.3066"],
        ),
        (
            "the ball's way between samples",
            |_| (),
            |s| s.bounds.phi_rad = [-2.0, 2.0],
            &["bounds.phi_rad", "2.2863"],
        ),
        (
            "nothing said of the ball",
            |c| c.state_limits[0] = f64::INFINITY,
            |s| s.bounds.phi_rad = [-100.0, f64::INFINITY],
            &["bounds.phi_rad", "inf"],
        ),
        (
            "contraction 1",
            |c| c.terminal.contraction = 1.0,
            nothing,
            &["terminal.contraction"],
        ),
    ];
    for (forgery, forge, change, words) in cases {
        let mut forged = certificate();
        forge(&mut forged);
        // With the digest that belongs to it: a forger has the program, too.
        let said = folder
            .load(&forged.to_json().unwrap(), change)
            .expect_err(forgery);
        for word in words {
            assert!(said.contains(word), "{forgery}: no `{word}` in: {said}");
        }
    }
}

#[test]
fn a_file_that_is_no_certificate_is_refused() {
    let folder = Folder::new("no-certificate");
    let good = builtin::TERMINAL_CERTIFICATE;
    let twice = good.replacen("\"t_s\": 0.05", "\"t_s\": 0.05,\n\"t_s\": 0.05", 1);
    let changed = good.replacen("1999.998", "2999.998", 1);
    let long = format!("{good}{}", " ".repeat(4 * MOST_BYTES));
    let deep = "{\"certificate\":".repeat(50_000);
    for (text, word) in [
        (twice, "duplicate field `t_s`"),
        (changed, "digest"),
        (long, "bytes"),
        (deep, "not a certificate"),
        (format!("{good} 1"), "trailing"),
        (String::new(), "EOF"),
    ] {
        let said = folder.load(&text, nothing).unwrap_err();
        assert!(said.contains(word), "no `{word}` in: {said}");
    }
    std::fs::write(folder.0.join("forged.json"), b"\xff\xfe").unwrap();
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    if let TerminalTable::Certified(table) = &mut scenario.controller.terminal {
        table.certificate = Some("forged.json".to_owned());
    }
    let said = scenario
        .prepare(folder.0.as_path())
        .unwrap_err()
        .to_string();
    assert!(said.contains("cannot read"), "{said}");
}

/// A library that only reads a file does not say that it was proved. The record of the first run is
/// no claim, and nothing rests on it.
#[test]
fn who_did_not_prove_says_so() {
    let folder = Folder::new("not-proved");
    let mut forged = certificate();
    forged.record.smallest_contraction = 0.9;
    forged.record.boxes = 0;
    let standing = folder.load(&forged.to_json().unwrap(), nothing).unwrap();
    assert_eq!(standing, Some(Standing::NotProved));
    assert!(Standing::NotProved.to_string().contains("not proved here"));
    let far = Scenario::load("far-setpoints").unwrap();
    let built_in = far.prepare(Path::new(".")).unwrap().certificate;
    assert_eq!(built_in, Some(Standing::BuiltIn));
    let plain = Scenario::load("two-setpoints").unwrap();
    assert_eq!(plain.prepare(Path::new(".")).unwrap().certificate, None);
}

fn refused(forged: &TerminalCertificate, boxes: usize) -> ClaimError {
    forged
        .prove(&forged.plant, boxes, &|_| ())
        .expect_err("a forgery was proved")
}

#[test]
fn false_claims_are_refused_by_their_names() {
    let cases: [(&str, Forge, &str); 12] = [
        (
            "a singular mass matrix",
            |c| c.plant.b3_m2 = 0.0,
            "continuous",
        ),
        (
            "a plant whose accelerations are 0/0",
            |c| {
                c.plant.b1_m2 = 0.0;
                c.plant.b2_m2 = 0.0;
                c.plant.b3_m2 = 0.0;
                c.plant.b4_m2_s = 0.0;
                c.plant.centre_of_mass_m = 0.0;
            },
            "continuous",
        ),
        ("no wheels", |c| c.plant.wheel_radius_m = 0.0, "continuous"),
        (
            "parameters beyond all sizes",
            |c| c.plant.gravity_m_s2 = 1e300,
            "continuous",
        ),
        (
            "a set that leaves the schedulings",
            |c| c.scheduling_limits[0] = 0.26,
            "scheduling_limits[0] = 0.26: the set reaches",
        ),
        (
            "states without limits, and schedulings too narrow",
            |c| {
                c.state_limits = Vector4::repeat(f64::INFINITY);
                c.scheduling_limits[1] *= 0.5;
            },
            "scheduling_limits[1]",
        ),
        (
            "a torque that is not kept",
            |c| c.input_limits[0] = 0.1,
            "input_limits[0] = 0.1: the set reaches",
        ),
        (
            "the contraction of another law",
            |c| c.terminal.contraction = 0.5,
            "decrease of x'Px is false",
        ),
        (
            "more decrease than there is",
            |c| c.q *= 10.0,
            "decrease of x'Px is false",
        ),
        (
            "a law for another direction",
            |c| c.terminal.k *= -1.0,
            "continuous",
        ),
        (
            "the P of the other claim",
            |c| {
                c.terminal.p = c.continuous.p;
                c.terminal.level = 0.1;
            },
            "decrease",
        ),
        (
            "the other way round",
            |c| c.continuous.p = c.terminal.p,
            "continuous",
        ),
    ];
    for (forgery, forge, part) in cases {
        let mut forged = certificate();
        forge(&mut forged);
        let message = refused(&forged, 3000).to_string();
        assert!(
            message.contains(part),
            "{forgery}: no `{part}` in: {message}"
        );
    }
}

/// Three times the level: by 20 000 motions from the edge the claim is true, and the proof is too weak
/// for it. It was called false.
#[test]
fn a_true_claim_beyond_the_proof_is_not_called_false() {
    let mut large = certificate();
    large.state_limits = Vector4::repeat(f64::INFINITY);
    large.terminal.level *= 3.0;
    large.scheduling_limits *= 3.0_f64.sqrt() * (1.0 + 1e-6);
    large.continuous.rate_1_s = 0.01;
    let error = refused(&large, 3000);
    assert!(!error.is_false(), "{error}");
    assert!(
        matches!(error, ClaimError::DecreaseNotShown { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("could not be shown"), "{error}");
}
