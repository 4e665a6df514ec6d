//! Plants in discrete time.

use crate::plants::limits;
use crate::quadratic::{Affine, Quadratic};
use lpvmpc::Rk4;
use lpvmpc::{Dynamics, Number};
use lpvmpc_any::{Mpc, MpcSettings, Penalty, Preview, Row, StateBounds, Terminal};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use nalgebra::{DMatrix, DVector, Vector1, Vector2, dmatrix, dvector};

const PERIOD: f64 = 0.2;

fn settings(horizon: usize) -> MpcSettings {
    MpcSettings {
        u_bounds: limits(&[1.5]),
        terminal: Terminal::Cost(dmatrix![8.0, 2.0; 2.0, 5.0]),
        ..MpcSettings::new(PERIOD, horizon, &[2.0, 0.5], &[0.3])
    }
}

/// An oscillator with a constant push, sampled.
fn matrices() -> Matrices {
    Matrices {
        a: dmatrix![0.98, 0.19; -0.21, 0.95],
        b: dmatrix![0.02; 0.19],
        affine: Some(dvector![0.01, -0.03]),
        period: Some(PERIOD),
        ..Matrices::default()
    }
}

#[test]
fn plans_of_a_linear_plant_in_discrete_time_are_those_of_clarabel() {
    let Matrices { a, b, affine, .. } = matrices();
    let plant = Plant::new(PlantData::of_matrices("oscillator", &matrices()).unwrap()).unwrap();
    let plant = Plant::from_json(&plant.to_json()).unwrap();
    let horizon = 25;
    let settings = MpcSettings {
        x_bounds: limits(&[f64::INFINITY, 0.6]),
        state_bounds: StateBounds::Hard,
        u_ref: Some(dvector![0.1]),
        ..settings(horizon)
    };
    let Terminal::Cost(p) = &settings.terminal else {
        panic!()
    };
    let mut mpc = Mpc::new(&plant, &settings).unwrap();
    for (x0, x_ref) in [([1.0, -0.5], [0.0, 0.0]), ([-0.5, 0.2], [1.5, 0.0])] {
        let mut program = Quadratic::new(horizon);
        let mut x: Affine = program.given(&x0);
        let reference = DVector::from_row_slice(&x_ref);
        for k in 0..horizon {
            let u = program.unknown(k, 1);
            program.weigh(&x.shifted(&-&reference), &settings.q);
            program.weigh(&u.shifted(&dvector![-0.1]), &settings.r);
            program.within(&u, -1.5, 1.5);
            x = x
                .times(&a)
                .plus(&u.times(&b))
                .shifted(affine.as_ref().unwrap());
            program.within(&x.times(&dmatrix![0.0, 1.0]), -0.6, 0.6);
        }
        program.weigh(&x.shifted(&-&reference), p);
        let (cost, u) = program.solve();
        mpc.reset();
        let plan = mpc.step(&x0, &Preview::to(&x_ref)).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        assert!(
            (plan.cost - cost).abs() < 1e-6 * cost,
            "{} {cost}",
            plan.cost
        );
        for (k, u) in u.iter().enumerate() {
            assert!(
                (plan.u[(k, 0)] - u).abs() < 1e-4,
                "{k}: {} {u}",
                plan.u[(k, 0)]
            );
        }
        let predicted = plant.next(&x0, &plan.first_input()).unwrap();
        assert!((plan.x[(1, 0)] - predicted[0]).abs() < 1e-14);
    }
}

/// The pendulum's own Runge-Kutta step as a map.
struct Sampled;

struct Pendulum;

impl Dynamics<2, 1> for Pendulum {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        Vector2::new(x[1], N::constant(9.81) * x[0].sin() + u[0])
    }
}

impl Dynamics<2, 1> for Sampled {
    fn period(&self) -> Option<f64> {
        Some(0.05)
    }

    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let step =
            |k: &Vector2<N>, h: f64| Vector2::new(x[0] + number(h) * k[0], x[1] + number(h) * k[1]);
        let k1 = Pendulum.f(x, u);
        let k2 = Pendulum.f(&step(&k1, 0.025), u);
        let k3 = Pendulum.f(&step(&k2, 0.025), u);
        let k4 = Pendulum.f(&step(&k3, 0.05), u);
        let two = number(2.0);
        let sum = |i: usize| k1[i] + two * (k2[i] + k3[i]) + k4[i];
        Vector2::new(
            x[0] + number(0.05 / 6.0) * sum(0),
            x[1] + number(0.05 / 6.0) * sum(1),
        )
    }
}

/// A plant whose map is a Runge-Kutta step is driven as the continuous one with that step: start, descent, target
/// and disturbance included.
#[test]
fn a_sampled_plant_is_driven_as_the_continuous_one() {
    let continuous = Plant::new(PlantData::of_dynamics("pendulum", &Pendulum)).unwrap();
    let sampled = Plant::new(PlantData::of_dynamics("pendulum", &Sampled)).unwrap();
    assert_eq!(sampled.period(), Some(0.05));
    let settings = MpcSettings {
        terminal: Terminal::Cost(DMatrix::from_row_slice(2, 2, &[147.0, 40.0, 40.0, 15.0])),
        u_bounds: limits(&[8.0]),
        ..MpcSettings::new(0.05, 30, &[1.0, 1.0], &[0.1])
    };
    let mut pair = [&continuous, &sampled].map(|plant| Mpc::new(plant, &settings).unwrap());
    let mut x = Vector2::new(0.8, 0.0);
    for k in 0..60 {
        let there = Preview::to(&[if k < 30 { 0.0 } else { 0.3 }, 0.0]);
        let plans = pair
            .each_mut()
            .map(|mpc| mpc.step(x.as_slice(), &there).unwrap());
        let difference = (&plans[0].u - &plans[1].u).amax();
        assert!(plans[0].is_solved() && plans[1].is_solved());
        assert!(difference < 1e-6, "sample {k}: {difference:e} N m");
        let model = lpvmpc::AlongMotion::<_, 3>(Pendulum);
        let u = Vector1::new(plans[0].u[(0, 0)]);
        x = Rk4 { substeps: 1 }.advance(&model, &x, &u, 0.05);
    }
    assert!((x[0] - 0.3).abs() < 0.02, "{x}");
}

/// The terminal cost of the regulator is that of the map itself: with it a plan of a linear plant without bounds
/// costs the same whatever its horizon.
#[test]
fn the_regulators_cost_does_not_depend_on_the_horizon() {
    let matrices = Matrices {
        affine: None,
        ..matrices()
    };
    let plant = Plant::new(PlantData::of_matrices("oscillator", &matrices).unwrap()).unwrap();
    let costs = [3, 40].map(|horizon| {
        let settings = MpcSettings {
            u_bounds: None,
            terminal: Terminal::Lqr,
            ..settings(horizon)
        };
        let mut mpc = Mpc::new(&plant, &settings).unwrap();
        mpc.step(&[1.0, -0.5], &Preview::default()).unwrap().cost
    });
    assert!((costs[0] - costs[1]).abs() < 1e-9 * costs[0], "{costs:?}");
}

#[test]
fn another_sampling_time_than_the_period_is_refused() {
    let plant = Plant::new(PlantData::of_matrices("oscillator", &matrices()).unwrap()).unwrap();
    let settings = MpcSettings {
        t_s: 0.1,
        ..settings(10)
    };
    let said = Mpc::new(&plant, &settings).err().unwrap().to_string();
    assert_eq!(
        said,
        "t_s: it is 0.1 s; the plant is in discrete time with a period of 0.2 s"
    );
}

/// x+ = x + u.
fn integrator() -> Plant {
    let matrices = Matrices {
        a: dmatrix![1.0],
        b: dmatrix![1.0],
        period: Some(0.1),
        ..Matrices::default()
    };
    Plant::new(PlantData::of_matrices("integrator", &matrices).unwrap()).unwrap()
}

/// A step from 2 under 4 + u^2 + linear e + quadratic e^2 / 2, e = 2 + u - 0.5: the minimum by hand.
#[test]
fn a_price_counts_its_quadratic_part_by_half() {
    for (linear, quadratic, expected) in
        [(0.0, 10.0, -1.25), (1.0, 0.0, -0.5), (1.0, 4.0, -7.0 / 6.0)]
    {
        let settings = MpcSettings {
            x_bounds: limits(&[0.5]),
            u_ref: Some(dvector![0.0]),
            state_bounds: StateBounds::Priced(vec![Some(Penalty { linear, quadratic })]),
            terminal: Terminal::Cost(dmatrix![0.0]),
            ..MpcSettings::new(0.1, 1, &[1.0], &[1.0])
        };
        let mut mpc = Mpc::new(&integrator(), &settings).unwrap();
        let plan = mpc.step(&[2.0], &Preview::default()).unwrap();
        assert!(plan.is_solved(), "{}", plan.status);
        let u = plan.u[(0, 0)];
        assert!((u - expected).abs() < 1e-9, "{linear} {quadratic}: {u}");
    }
}

/// Soft rows of a stage, more of them active than there are states and inputs: all have room.
#[test]
fn soft_rows_have_room_whatever_the_horizon() {
    for horizon in 1..30 {
        for count in 1..5 {
            let row = |i: usize| Row {
                name: format!("row {i}"),
                x: dvector![1.0 + 0.1 * i as f64],
                u: dvector![0.0],
                lower: f64::NEG_INFINITY,
                upper: 0.1,
                soft: Some(Penalty {
                    linear: 1.0,
                    quadratic: 5.0,
                }),
            };
            let settings = MpcSettings {
                u_bounds: limits(&[0.2]),
                u_ref: Some(dvector![0.0]),
                rows: (0..count).map(row).collect(),
                terminal: Terminal::Cost(dmatrix![1.0]),
                ..MpcSettings::new(0.1, horizon, &[1.0], &[1e-3])
            };
            let mut mpc = Mpc::new(&integrator(), &settings).unwrap();
            let plan = mpc.step(&[2.0], &Preview::default()).unwrap();
            assert!(plan.is_solved(), "{horizon} {count}: {}", plan.status);
            // As many again with the settings of a controller that had none.
            let none = MpcSettings {
                rows: Vec::new(),
                ..settings.clone()
            };
            let mut mpc = Mpc::new(&integrator(), &none).unwrap();
            mpc.set_settings(&settings).unwrap();
            let again = mpc.step(&[2.0], &Preview::default()).unwrap();
            assert!(again.is_solved(), "{horizon} {count}: {}", again.status);
        }
    }
}
