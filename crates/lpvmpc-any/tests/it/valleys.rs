//! Plans that would stay in a dear local minimum, and prices of bounds from far away.
//!
//! What IPOPT finds is from `python/examples`: the optimal control problem of `problem.py`, solved by `references.py` to 1e-8
//! from the better of two guesses.

use crate::plants::limits;
use lpvmpc::{Dynamics, Number};
use lpvmpc_any::{Mpc, MpcSettings, Preview, World, WorldSettings};
use lpvmpc_plant::{Equilibrium, Matrices, Plant, PlantData, Signal};
use nalgebra::{DMatrix, DVector, SVector};

/// An inverted pendulum on a driven arm (Hespe and Werner 2021): angles of arm and rod from upright (rad) and their rates;
/// the torque (N m). Numbers of the gallery's `arm_pendulum.py`.
struct ArmPendulum;

impl Dynamics<4, 1> for ArmPendulum {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 1>) -> SVector<N, 4> {
        let number = N::constant;
        let (arm, rod, rod_mass, gravity) = (0.1395, 0.078, 0.0731, 9.81);
        let coupling = rod_mass * arm * rod;
        let weight = 0.115 * 0.06975 + (0.130 + rod_mass) * arm;
        let (a, c) = ((0.115 + rod_mass) * arm * arm, rod_mass * rod * rod);
        let (sin, cos) = (x[0] - x[1]).sin_cos();
        let b = number(coupling) * cos;
        let on_arm = u[0] + number(weight * gravity) * x[0].sin()
            - number(coupling) * sin * x[3] * x[3]
            - number(1.3e-3) * x[2];
        let on_rod = number(rod_mass * rod * gravity) * x[1].sin()
            + number(coupling) * sin * x[2] * x[2]
            - number(2.2e-5) * x[3];
        let det = number(a * c) - b * b;
        SVector::from([
            x[2],
            x[3],
            (number(c) * on_arm - b * on_rod) / det,
            (number(a) * on_rod - b * on_arm) / det,
        ])
    }
}

/// From where the regulator's closed loops go around a whole turn, the first plan costs what IPOPT's costs.
#[test]
fn a_first_plan_goes_the_short_way_round() {
    let mut data = PlantData::of_dynamics("arm-driven pendulum", &ArmPendulum);
    (data.inputs[0].lower, data.inputs[0].upper) = (Some(-1.0), Some(1.0));
    let plant = Plant::new(data).unwrap();
    let settings = MpcSettings::new(0.01, 40, &[200.0, 1000.0, 0.1, 10.0], &[2000.0]);
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    let third = core::f64::consts::FRAC_PI_3;
    for (x, ipopt) in [
        ([third, 0.0, 0.0, 0.0], 14917.09),
        ([0.0, 1.0, 0.0, 0.0], 61915.35),
        ([third, third, 0.0, 0.0], 55471.42),
        ([core::f64::consts::PI, 0.0, 0.0, 0.0], 76288.02),
        (
            [
                1.114_905_822_562_969,
                0.043_941_400_763_498_17,
                3.217_720_637_727_907,
                -0.182_771_809_286_349_73,
            ],
            53742.83,
        ),
    ] {
        mpc.reset();
        let plan = mpc.step(&x, &Preview::default()).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        assert!(
            plan.cost < 1.0001 * ipopt,
            "{} for {ipopt} from {x:?}",
            plan.cost
        );
        // With no more than the programs of any other sample there is no such search.
        let few = MpcSettings {
            iterations: lpvmpc_any::Iterations::default(),
            ..settings.clone()
        };
        let mut few = Mpc::new(&plant, &few).unwrap();
        assert!(few.step(&x, &Preview::default()).unwrap().problems <= 8);
    }
}

/// A continuous stirred tank reactor (Klatt and Engell 1998): concentrations (mol/l), temperatures of inside and jacket
/// (degrees Celsius); flow (1/h) and heat (MJ/h). Time in s.
struct Reactor;

impl Dynamics<4, 2> for Reactor {
    fn f<N: Number>(&self, x: &SVector<N, 4>, u: &SVector<N, 2>) -> SVector<N, 4> {
        let number = N::constant;
        let speed = |k: f64, e: f64| number(k) * (number(-e) / (x[2] + number(273.15))).exp();
        let (k1, k3) = (speed(1.287e12, 9758.3), speed(9.043e9, 8560.0));
        let (first, third) = (k1 * x[0], k3 * x[0] * x[0]);
        let second = k1 * x[1];
        let heat = number(4.2) * first - number(11.0) * second - number(41.85) * third;
        let through = number(4032.0 * 0.215) * (x[3] - x[2]);
        let capacity = 0.9342 * 3.01;
        let rates = [
            u[0] * (number(5.1) - x[0]) - first - third,
            first - u[0] * x[1] - second,
            u[0] * (number(130.0) - x[2]) - heat / number(capacity)
                + through / number(capacity * 10.01),
            (number(1000.0) * u[1] - through) / number(5.0 * 2.0),
        ];
        SVector::from(rates.map(|rate| rate / number(3600.0)))
    }
}

/// A cold reactor is heated, though the plan of every sample before says to go on cooling: the closed loop
/// costs what IPOPT's costs, 518.63, and not 2.7 times as much.
#[test]
fn a_loop_leaves_a_valley_that_becomes_dear() {
    let bound = |signal: Signal, lower: f64, upper: f64| Signal {
        lower: Some(lower),
        upper: Some(upper),
        ..signal
    };
    let rest = Equilibrium {
        x: vec![0.705359440849293, 0.6, 134.0, 131.4271667177161],
        u: vec![8.814950789743813, -2.230337715746275],
    };
    let concentration = |name: &str| bound(Signal::new(name, "mol/l"), 0.1, 2.0);
    let temperature = |name: &str| bound(Signal::new(name, "C"), 50.0, 140.0);
    let plant = Plant::new(PlantData {
        states: vec![
            concentration("c_a"),
            concentration("c_b"),
            temperature("inside"),
            temperature("jacket"),
        ],
        inputs: vec![
            bound(Signal::new("flow", "1/h"), 5.0, 100.0),
            bound(Signal::new("power", "MJ/h"), -8.5, 0.0),
        ],
        equilibrium: Some(rest.clone()),
        ..PlantData::of_dynamics("reactor", &Reactor)
    })
    .unwrap();
    let (q, r) = ([1.0, 100.0, 0.001, 0.0001], [1e-4, 1e-3]);
    let mut mpc = Mpc::new(&plant, &MpcSettings::new(18.0, 40, &q, &r)).unwrap();
    let mut world =
        World::new(&plant, &[0.8, 0.3, 90.0, 90.0], &WorldSettings::ideal(18.0)).unwrap();
    let preview = Preview {
        x_ref: vec![DVector::from_row_slice(&rest.x)],
        u_ref: vec![DVector::from_row_slice(&rest.u)],
        ..Preview::default()
    };
    let (mut cost, mut searches) = (0.0, 0);
    for sample in 0..100 {
        let x = world.state().to_vec();
        let plan = mpc.step(&x, &preview).unwrap();
        searches += usize::from(sample > 0 && plan.problems > 8);
        let u = plan.first_input();
        let squares = |q: &[f64], at: &[f64], rest: &[f64]| -> f64 {
            let terms = q.iter().zip(at.iter().zip(rest));
            terms.map(|(q, (at, rest))| q * (at - rest).powi(2)).sum()
        };
        cost += squares(&q, &x, &rest.x) + squares(&r, &u, &rest.u);
        world.command(&u).unwrap();
        world.advance().unwrap();
    }
    assert!(cost < 1.01 * 518.63, "{cost}");
    // What has been in vain is not tried again at once.
    assert!(searches <= 10, "{searches}");
}

/// The altitude of an aircraft (Maciejowski 2002, section 2.8): the pitch is bounded, softly.
#[test]
fn a_far_set_point_does_not_buy_a_bound() {
    let a = DMatrix::from_row_slice(
        5,
        5,
        &[
            -1.2822, 0.0, 0.98, 0.0, -0.3, 0.0, 0.0, 1.0, 0.0, 0.0, -5.4293, 0.0, -1.8366, 0.0,
            -17.0, -128.2, 128.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ],
    );
    let matrices = Matrices {
        a,
        b: DMatrix::from_row_slice(5, 1, &[0.0, 0.0, 0.0, 0.0, 1.0]),
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("aircraft", &matrices).unwrap()).unwrap();
    let infinite = f64::INFINITY;
    let settings = MpcSettings {
        x_bounds: limits(&[infinite, 0.349, infinite, infinite, 0.262]),
        u_bounds: limits(&[0.524]),
        ..MpcSettings::new(0.25, 40, &[0.0, 100.0, 1.0, 0.01, 1.0], &[10.0])
    };
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    for altitude in [400.0, -1000.0, 5000.0, -20_000.0] {
        mpc.reset();
        let preview = Preview {
            x_ref: vec![DVector::from_row_slice(&[0.0, 0.0, 0.0, altitude, 0.0])],
            ..Preview::default()
        };
        let plan = mpc.step(&[0.0; 5], &preview).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        let pitch = plan.x.column(1).amax();
        assert!(pitch < 0.349 + 1e-6, "{pitch} on the way to {altitude} m");
        assert!(plan.x.column(4).amax() < 0.262 + 1e-6);
    }
}
