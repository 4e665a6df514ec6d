//! Decisions behind a filter and a delay that are told more than a reference.

use super::pendulum::{PENDULUM, settings};
use super::regulator::{
    DELAY, INSTANTS, LIMIT, N, PlannerOfTorque, Regulated, T_S, World, controller_settings, held,
};
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Capacity, Controller, ControllerMemory, DelayLine, Estimator, Measurement, Preview,
    Reference, Regulator, Status, Weights, Workspace,
};
use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};

type Told<'a> = Preview<'a, Pendulum<f64>, f64, 2, 1, 1>;

fn room() -> Capacity {
    let settings = controller_settings(N);
    settings.capacity().with_own_stages().with_general_rows(1)
}

/// [`held`] with room for everything.
fn roomy() -> Regulated<PlannerOfTorque> {
    let mut regulator = held(N);
    regulator.workspace = Workspace::allocate(room());
    regulator
}

fn at(angle: f64) -> Reference<'static, f64, 2> {
    Reference::constant(Vector2::new(angle, 0.0))
}

fn torques(limit: f64) -> Bounds<f64, 1> {
    Bounds {
        lower: Vector1::new(-limit),
        upper: Vector1::new(limit),
    }
}

/// A run of so many samples; the torques.
fn run(
    regulator: &mut Regulated<PlannerOfTorque>,
    world: &mut World,
    samples: usize,
    mut preview: impl FnMut(usize) -> Told<'static>,
) -> Vec<f64> {
    let one = |k| {
        regulator.observe(&world.measurement());
        let command = regulator.decide_with(&preview(k));
        assert!(command.status.is_solved(), "{k}: {}", command.status);
        assert!(command.u[0].abs() <= LIMIT, "{}", command.u);
        world.advance(command.u[0]);
        command.u[0]
    };
    (0..samples).map(one).collect()
}

/// With nothing but a reference it decides as the one that is told a reference: the torque that nobody
/// knows is in the plant instead of in the bounds.
#[test]
fn a_reference_alone_is_a_decision_as_before() {
    let (mut told, mut plain) = (roomy(), held(N));
    let [mut of_told, mut of_plain] = [(); 2].map(|()| World::new(0.6, 1e-3));
    for k in 0..300 {
        told.observe(&of_told.measurement());
        plain.observe(&of_plain.measurement());
        let angle = if k < 100 { 0.2 } else { -0.1 };
        let found = told.decide_with(&Told::new(at(angle)));
        let expected = plain.decide(&|_| Vector2::new(angle, 0.0));
        let error = (found.u - expected.u).amax();
        assert!(error < 1e-5, "{k}: {} for {}", found.u, expected.u);
        assert_eq!(found.x_ref, expected.x_ref);
        let largest = [&told, &plain].map(|one| one.feedback.largest_inputs().unwrap()[0]);
        assert!((largest[0] - largest[1]).abs() < 1e-3, "{k}: {largest:?}");
        let costs = [told.feedback.cost_with(&Told::new(at(angle))), plain.cost()];
        assert!(
            (costs[0] - costs[1]).abs() < 1e-4 * costs[1].max(1.0),
            "{k}: {costs:?}"
        );
        of_told.advance(found.u[0]);
        of_plain.advance(expected.u[0]);
    }
}

/// The same from its parts: a filter, a delay line and a controller that knows the filter's torque as a
/// disturbance of the state. Weights, cross weight, linear costs, an input reference, bounds and a row
/// count for the commanded torque.
#[test]
fn a_decision_is_filter_delay_and_controller_one_after_the_other() {
    let weights = [Weights {
        q: Matrix2::from_diagonal(&Vector2::new(50.0, 2.0)),
        r: Matrix1::new(0.3),
    }];
    let bounds: Vec<_> = (0..N).map(|i| torques(1.5 + 0.05 * i as f64)).collect();
    let row = lpvmpc::GeneralRow {
        x: Vector2::new(1.0, 0.2),
        u: Vector1::new(0.1),
        upper: 0.3,
        soft: Some(lpvmpc::Penalty {
            linear: 30.0,
            quadratic: 1.0,
        }),
        ..Default::default()
    };
    let (row, cross, linear) = ([row], [RowVector2::new(1.0, 0.1)], [Vector1::new(-0.4)]);
    let rows: [&[_]; 1] = [&row];
    let u_ref = [Vector1::new(0.5), Vector1::new(1.2)];
    let told = Told {
        u_ref: &u_ref,
        weights: &weights,
        cross: &cross,
        linear_u: &linear,
        u: &bounds,
        rows: &rows,
        ..Told::new(at(0.15))
    };
    let mut regulator = roomy();
    let mut world = World::new(0.6, 1e-3);
    let mut filter = Estimator::<_, _, 2, 1, 1, 1, 1>::allocate(
        PENDULUM,
        settings(),
        Vector2::zeros(),
        INSTANTS,
    )
    .unwrap();
    let mut line = DelayLine::new(lpvmpc::List::repeat((0.0, Vector1::zeros()), 8));
    let memory = ControllerMemory::allocate(room());
    let mut controller = Controller::new(PENDULUM, controller_settings(N), memory).unwrap();
    let mut workspace = Workspace::allocate(room());
    let mut at_bound = 0;
    for k in 0..150 {
        let measurement: Measurement<f64, 1> = world.measurement();
        regulator.observe(&measurement);
        let found = regulator.decide_with(&told);
        filter.observe(measurement.t, &mut line, &measurement.readings);
        let mut z = *filter.model_state();
        line.for_each(DELAY, |duration, u| z = filter.predict(&z, u, duration));
        let torque = filter.input_disturbance();
        let push = [Vector2::new(0.0, torque[0])];
        let preview = Told {
            disturbance: &push,
            ..told
        };
        let plan = controller.step_with(&z, &preview, &mut workspace);
        assert_eq!(found.status, plan.status, "{k}");
        let expected = plan.first_input();
        assert!(
            (found.u - expected).amax() < 1e-7,
            "{k}: {} {expected}",
            found.u
        );
        at_bound += usize::from(found.u[0].abs() > 1.5 - 1e-9);
        line.command(expected, DELAY);
        world.advance(expected[0]);
    }
    assert!(at_bound > 3, "{at_bound}");
}

/// Whatever a preview says, the actuators' own bounds hold, also those of a share that others leave;
/// within them its bounds do.
#[test]
fn bounds_hold_within_those_of_the_actuators() {
    static WIDE: [Bounds<f64, 1>; 1] = [Bounds {
        lower: Vector1::new(-50.0),
        upper: Vector1::new(50.0),
    }];
    static BEYOND: [Bounds<f64, 1>; 1] = [Bounds {
        lower: Vector1::new(6.0),
        upper: Vector1::new(7.0),
    }];
    static NARROW: [Bounds<f64, 1>; 1] = [Bounds {
        lower: Vector1::new(-1.5),
        upper: Vector1::new(1.0),
    }];
    let kicked = |share: f64, u: &'static [Bounds<f64, 1>]| {
        let (mut regulator, mut world) = (roomy(), World::new(0.3, 0.0));
        run(&mut regulator, &mut world, 100, |_| Told::new(at(0.0)));
        regulator.feedback.set_share(Vector1::new(share));
        world.x[1] -= 0.2;
        let found = run(&mut regulator, &mut world, 30, |_| Told {
            u,
            ..Told::new(at(0.0))
        });
        let largest = regulator.feedback.largest_inputs().unwrap()[0];
        assert!(largest <= share.min(LIMIT) + 1e-12, "{largest}");
        found
            .into_iter()
            .fold((0.0_f64, 0.0_f64), |(low, high), u| {
                (low.min(u), high.max(u))
            })
    };
    let (low, high) = kicked(f64::INFINITY, &WIDE);
    assert!(high > 1.6 && low >= -LIMIT && high <= LIMIT, "{low} {high}");
    let (low, high) = kicked(1.6, &WIDE);
    assert!(low >= -1.6 && high == 1.6, "{low} {high}");
    let (low, high) = kicked(f64::INFINITY, &NARROW);
    assert!(low >= -1.5 && high == 1.0, "{low} {high}");
    // Nothing lies in both: the nearest that the actuators can.
    let (mut regulator, mut world) = (roomy(), World::new(0.3, 0.0));
    regulator.observe(&world.measurement());
    let command = regulator.decide_with(&Told {
        u: &BEYOND,
        ..Told::new(at(0.0))
    });
    assert_eq!(command.u[0], LIMIT);
}

/// A torque that comes at 1 s and goes at 1.6 s, behind filter, delay and noise: told ahead it costs
/// less than found by the filter.
#[test]
fn a_disturbance_known_ahead_costs_less_than_one_that_the_filter_finds() {
    let gust = |k: usize| if (50..80).contains(&k) { 1.5 } else { 0.0 };
    let cost = |ahead: bool| {
        let (mut regulator, mut world) = (roomy(), World::new(0.0, 1e-4));
        world.x = Vector2::zeros();
        // Stage i is the delay, a sample and a half, after sample k + i.
        let lag = (DELAY / T_S).round() as usize;
        let mut sum = 0.0;
        for k in 0..200 {
            world.disturbance = gust(k);
            let known: Vec<_> = (0..N)
                .map(|i| Vector2::new(0.0, if ahead { gust(k + i + lag) } else { 0.0 }))
                .collect();
            regulator.observe(&world.measurement());
            let command = regulator.decide_with(&Told {
                disturbance: &known,
                ..Told::new(at(0.0))
            });
            assert!(command.status.is_solved());
            world.advance(command.u[0]);
            sum += 100.0 * world.x[0].powi(2) + world.x[1].powi(2);
        }
        sum
    };
    let (ahead, found) = (cost(true), cost(false));
    assert!(ahead < 0.7 * found, "{ahead} {found}");
}

/// A preview that makes no sense leaves a command within the actuators' bounds, and says so.
#[test]
fn a_preview_without_sense_is_refused() {
    let (mut regulator, mut world) = (roomy(), World::new(0.3, 0.0));
    run(&mut regulator, &mut world, 20, |_| Told::new(at(0.0)));
    regulator.observe(&world.measurement());
    let command = regulator.decide_with(&Told {
        u_ref: &[Vector1::new(f64::NAN)],
        ..Told::new(at(0.0))
    });
    assert!(matches!(command.status, Status::Refused(_)));
    assert!(command.u[0].abs() <= LIMIT);
    // The state counts as lost before the first measurement, or the filter says so: no input then.
    let mut regulator = roomy();
    let command = regulator.decide_with(&Told::new(at(f64::NAN)));
    assert!(!command.status.is_solved() && command.u[0].abs() <= LIMIT);
}
