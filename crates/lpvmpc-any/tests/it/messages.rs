//! What is refused, and what is said in the plant's names.

use crate::plants::{cart_pole, chain};
use lpvmpc_any::{
    Limits, LinearModels, Mpc, MpcSettings, Penalty, Preview, Row, StateBounds, Terminal,
};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use nalgebra::{DMatrix, DVector, dmatrix};

fn settings() -> MpcSettings {
    MpcSettings {
        u_bounds: Some(Limits {
            lower: vec![-10.0],
            upper: vec![10.0],
        }),
        ..MpcSettings::new(0.05, 20, &[1.0, 10.0, 0.1, 0.1], &[0.01])
    }
}

#[test]
fn an_infeasible_plan_names_the_bounds_that_contradict_each_other() {
    let track = MpcSettings {
        x_bounds: Some(Limits {
            lower: vec![
                -0.5,
                f64::NEG_INFINITY,
                f64::NEG_INFINITY,
                f64::NEG_INFINITY,
            ],
            upper: vec![0.5, f64::INFINITY, f64::INFINITY, f64::INFINITY],
        }),
        state_bounds: StateBounds::Hard,
        ..settings()
    };
    let mut mpc = Mpc::new(&cart_pole(), &track).unwrap();
    // At 3 m/s the cart needs 0.45 m to stop with 10 m/s^2, and there are 0.1 m.
    let plan = mpc
        .step(&[0.4, 0.0, 3.0, 0.0], &Preview::default())
        .unwrap();
    assert!(!plan.is_solved());
    assert!(plan.status.starts_with("infeasible: "), "{}", plan.status);
    for word in [
        "position <= 0.5 m at stage ",
        " against ",
        "force >= -10 N at stages ",
    ] {
        assert!(plan.status.contains(word), "{}", plan.status);
    }
    assert!(plan.u.iter().all(|u| u.abs() <= 10.0));
}

#[test]
fn active_bounds_speak_the_plants_names() {
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let plan = mpc
        .step(&[0.0, 0.5, 0.0, 0.0], &Preview::to(&[2.0, 0.0, 0.0, 0.0]))
        .unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    assert!(
        plan.active_bounds().contains("force"),
        "{}",
        plan.active_bounds()
    );
    assert!(
        plan.active
            .iter()
            .all(|one| one.multiplier >= 0.0 && !one.exceeded)
    );
    // A row of the builder's own.
    let both = Row {
        name: "cart and pole".to_owned(),
        x: DVector::from_row_slice(&[1.0, 0.5, 0.0, 0.0]),
        u: DVector::from_row_slice(&[0.0]),
        lower: -0.2,
        upper: 0.2,
        soft: None,
    };
    let rows = MpcSettings {
        rows: vec![both],
        ..settings()
    };
    mpc.set_settings(&rows).unwrap();
    let plan = mpc
        .step(&[0.0, 0.1, 0.0, 0.0], &Preview::to(&[2.0, 0.0, 0.0, 0.0]))
        .unwrap();
    assert!(plan.is_solved(), "{}", plan.status);
    assert!(
        plan.active_bounds()
            .contains("cart and pole <= 0.2 at stage"),
        "{}",
        plan.active_bounds()
    );
    for i in 1..=20 {
        assert!(plan.x[(i, 0)] + 0.5 * plan.x[(i, 1)] <= 0.2 + 1e-6);
    }
}

#[test]
fn settings_without_sense_are_refused_by_name() {
    let refused = |change: &dyn Fn(&mut MpcSettings), words: &[&str]| {
        let mut settings = settings();
        change(&mut settings);
        let said = match Mpc::new(&cart_pole(), &settings) {
            Ok(_) => panic!("accepted, for {words:?}"),
            Err(error) => error.to_string(),
        };
        for word in words {
            assert!(said.contains(word), "`{word}` is not in: {said}");
        }
    };
    refused(&|s| s.t_s = 0.0, &["t_s", "0 s", "positive"]);
    refused(&|s| s.t_s = f64::NAN, &["t_s", "NaN"]);
    refused(&|s| s.horizon = 0, &["horizon: it is 0", "1 to 1000"]);
    refused(&|s| s.horizon = 1001, &["horizon: it is 1001", "1 to 1000"]);
    refused(&|s| s.substeps = 0, &["sub-step"]);
    refused(
        &|s| s.q = DMatrix::identity(3, 3),
        &["q", "3 x 3", "4 x 4", "position, angle, speed, rate"],
    );
    refused(&|s| s.q[(1, 1)] = f64::NAN, &["q", "(1, 1) is NaN"]);
    refused(
        &|s| s.q[(0, 0)] = -1.0,
        &["Q is not positive semidefinite", "-1"],
    );
    refused(&|s| s.r[(0, 0)] = 0.0, &["R is not positive definite"]);
    refused(
        &|s| s.terminal = Terminal::Cost(DMatrix::identity(2, 2)),
        &["terminal", "2 x 2"],
    );
    refused(
        &|s| s.u_ref = Some(DVector::zeros(2)),
        &["u_ref", "2 entries", "1 (force)"],
    );
    refused(
        &|s| s.linear_models = LinearModels::AlongRay { nodes: 40 },
        &["40 nodes"],
    );
    refused(
        &|s| {
            s.u_bounds = Some(Limits {
                lower: vec![1.0],
                upper: vec![-1.0],
            })
        },
        &["u_bounds", "force", "from 1 to -1"],
    );
    refused(
        &|s| {
            s.u_bounds = Some(Limits {
                lower: vec![f64::NAN],
                upper: vec![1.0],
            })
        },
        &["u_bounds", "force"],
    );
    refused(
        &|s| s.state_bounds = StateBounds::Priced(vec![None; 3]),
        &["3 prices for 4 states"],
    );
    // No weight sees the position, which drifts: no regulator exists for it.
    refused(&|s| s.q.fill(0.0), &["terminal", "regulator"]);
}

#[test]
fn a_step_that_is_told_nonsense_is_refused_and_changes_nothing() {
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let x = [0.0, 0.2, 0.0, 0.0];
    let said = mpc
        .step(&x[..3], &Preview::default())
        .unwrap_err()
        .to_string();
    assert_eq!(
        said,
        "x: it has 3 entries; there must be 4 (position, angle, speed, rate)"
    );
    let preview = Preview {
        x_ref: vec![
            DVector::zeros(4),
            DVector::from_row_slice(&[0.0, f64::INFINITY, 0.0, 0.0]),
        ],
        ..Preview::default()
    };
    let said = mpc.step(&x, &preview).unwrap_err().to_string();
    assert_eq!(said, "x_ref, stage 1: angle is inf; it must be finite");
    let preview = Preview {
        parameters: vec![vec![1.0]],
        ..Preview::default()
    };
    assert!(
        mpc.step(&x, &preview)
            .unwrap_err()
            .to_string()
            .contains("there must be 0")
    );
    // A measurement that is not finite has no plan, and the inputs are within their bounds.
    let plan = mpc
        .step(&[0.0, f64::NAN, 0.0, 0.0], &Preview::default())
        .unwrap();
    assert!(
        !plan.is_solved() && plan.u.iter().all(|u| u.abs() <= 10.0),
        "{}",
        plan.status
    );
    assert!(mpc.step(&x, &Preview::default()).unwrap().is_solved());
    assert!(mpc.set_parameter("mass", 1.0).is_err());
}

#[test]
fn what_is_too_large_is_refused_with_what_fits() {
    let settings = MpcSettings::new(0.1, 10, &[1.0; 17], &[1.0; 2]);
    let Err(error) = Mpc::new(&chain::<17, 2>(), &settings) else {
        panic!("17 states")
    };
    assert_eq!(
        error.to_string(),
        "plant: there are 17 states and 2 inputs; a controller has at most 16 and 6"
    );
}

/// A pendulum that hangs at an angle of pi stands at zero, too; one under a constant torque does not.
#[test]
fn a_regulator_is_designed_only_where_the_plant_stands() {
    let pushed = |equilibrium: &str| {
        let text = format!(
            r#"{{"schema": 1, "name": "pushed pendulum",
            "states": [{{"name": "angle", "unit": "rad"}}, {{"name": "rate", "unit": "rad/s"}}],
            "inputs": [{{"name": "torque", "unit": "N m"}}],
            "operations": [["state", 0], ["state", 1], ["input", 0], ["constant", 9.81],
                ["sin", 0], ["mul", 3, 4], ["add", 5, 2], ["constant", 2], ["add", 6, 7]],
            "derivative": [1, 8]{equilibrium}}}"#
        );
        Plant::from_json(&text).unwrap()
    };
    let settings = MpcSettings::new(0.05, 20, &[1.0, 1.0], &[0.1]);
    let Err(error) = Mpc::new(&pushed(""), &settings) else {
        panic!("it does not stand at zero")
    };
    assert_eq!(error.place, "terminal");
    assert!(error.fault.contains("2 per second"), "{error}");
    // Held by a torque against the push it does, and that is where it goes.
    let plant = pushed(r#", "equilibrium": {"x": [0, 0], "u": [-2]}"#);
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    let plan = mpc.step(&[0.0, 0.0], &Preview::default()).unwrap();
    assert!((plan.u[(0, 0)] + 2.0).abs() < 1e-6, "{}", plan.u);
}

/// Settings that are refused leave the controller as it was, rows included.
#[test]
fn settings_that_are_refused_change_nothing() {
    let mut mpc = Mpc::new(&cart_pole(), &settings()).unwrap();
    let x = [0.0, 0.2, 0.0, 0.0];
    let before = mpc.step(&x, &Preview::default()).unwrap();
    let row = Row {
        name: "both".to_owned(),
        x: DVector::from_row_slice(&[1.0, 1.0, 0.0, 0.0]),
        u: DVector::zeros(1),
        lower: -1.0,
        upper: 1.0,
        soft: Some(Penalty {
            linear: -1.0,
            quadratic: 0.0,
        }),
    };
    let other = MpcSettings {
        u_bounds: Some(Limits {
            lower: vec![-1.0],
            upper: vec![1.0],
        }),
        rows: vec![row],
        ..settings()
    };
    let said = mpc.set_settings(&other).unwrap_err().to_string();
    assert!(
        said.contains("rows `both`: the prices of exceeding it are -1 and 0"),
        "{said}"
    );
    let longer = MpcSettings {
        horizon: 30,
        ..settings()
    };
    assert!(mpc.set_settings(&longer).is_err());
    mpc.reset();
    assert_eq!(mpc.step(&x, &Preview::default()).unwrap(), before);
}

/// x_dot = -30 x + u: Runge-Kutta's steps of order four are stable up to 2.785 / 30 s, and the plan of a controller that is
/// allowed to is the plant's.
#[test]
fn steps_too_long_for_a_plant_are_refused_with_the_number_needed() {
    let matrices = Matrices {
        a: dmatrix![-30.0, 0.0; 0.0, 0.2],
        b: dmatrix![1.0; 1.0],
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("stiff", &matrices).unwrap()).unwrap();
    let made = |t_s: f64, substeps: usize| {
        let settings = MpcSettings {
            substeps,
            ..MpcSettings::new(t_s, 10, &[1.0, 1.0], &[1.0])
        };
        Mpc::new(&plant, &settings).map(|_| ())
    };
    assert!(made(0.0928, 1).is_ok());
    assert_eq!(
        made(0.4, 1).unwrap_err().to_string(),
        "substeps: with 1 in 0.4 s the prediction of what decays in 3.33e-2 s would grow without bound; at least 5 substeps are needed, and more for accuracy"
    );
    assert!(made(0.0929, 1).is_err());
    assert!(made(0.4, 4).is_err() && made(0.4, 5).is_ok());
}
