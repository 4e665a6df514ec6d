//! Where a controller's memory comes from and how much there is: it changes no answer, and too little
//! of it is said.

use super::{along, assert_safe, controller, moving, settings, tilted};
use crate::method::plant::CartPole;
use crate::method::regulator::Regulator;
use lpvmpc::{
    Bounds, Capacity, Controller, ControllerArrays, ControllerError, ControllerSettings,
    Iterations, Penalty, Reference, Rk4, Solution, Status, TerminalIngredient, Weights, Workspace,
    WorkspaceArrays,
};
use nalgebra::{Vector1, Vector4};

const N: usize = 15;
/// More than any test here needs.
const LONG: usize = 25;
const MANY: usize = 80;

type Settings = ControllerSettings<f64, 4, 1, 2>;

/// The plant between two samples.
fn plant_moves(x: &Vector4<f64>, u: &Vector1<f64>) -> Vector4<f64> {
    Rk4 { substeps: 20 }.advance(&CartPole::laboratory(), x, u, 0.05)
}

/// A controller in lent memory for `STAGES` samples and `ROWS` active bounds.
fn lent<const STAGES: usize, const ROWS: usize>(settings: Settings) -> Regulator {
    let arrays = Box::leak(Box::new(
        ControllerArrays::<f64, 4, 1, STAGES, ROWS>::default(),
    ));
    Controller::new(CartPole::laboratory(), settings, arrays.lend()).unwrap()
}

/// A workspace in lent memory.
fn lent_workspace<const STAGES: usize, const ROWS: usize>() -> Workspace<f64, 4, 1> {
    let arrays = Box::leak(Box::new(
        WorkspaceArrays::<f64, 4, 1, STAGES, ROWS>::default(),
    ));
    Workspace::new(arrays.lend())
}

/// Every kind of program that a controller makes: hard and soft bounds, both ends, several programs
/// of a sample, and the descent.
fn all_settings() -> [Settings; 5] {
    let soft = Penalty {
        linear: 1e4,
        quadratic: 10.0,
    };
    let softened = Settings {
        soft_x: [Some(soft), None, None, None],
        ..settings(N)
    };
    [
        settings(N),
        softened,
        Settings {
            terminal: TerminalIngredient::Equality,
            ..settings(N)
        },
        Settings {
            iterations: Iterations::Fixed(3),
            ..settings(N)
        },
        Settings {
            iterations: Iterations::descent(1e-3, 8),
            ..softened
        },
    ]
}

/// Bit for bit, but for places that nothing is in.
fn assert_same(found: &Solution<f64, 4, 1>, expected: &Solution<f64, 4, 1>) {
    assert_eq!(found.u, expected.u);
    assert_eq!(found.x, expected.x);
    assert_eq!(found.cost, expected.cost);
    assert_eq!(found.status, expected.status);
    assert_eq!(found.changes, expected.changes);
    assert!(found.active.iter().eq(expected.active.iter()));
}

/// Larger than the horizon, handed in from outside, and with a reference that goes on behind the
/// horizon: none of it is seen, neither by `step` nor by its two parts.
#[test]
fn lent_memory_gives_the_answers_of_memory_on_the_heap() {
    for settings in all_settings() {
        let (mut heap, mut other) = (controller(settings), lent::<LONG, MANY>(settings));
        let (mut own, mut arrays) = (heap.workspace(), lent_workspace::<LONG, MANY>());
        let mut x = tilted() * 0.5;
        for k in 0..30 {
            let mut states = moving(N, k);
            let reference = along(&states);
            if k % 2 == 0 {
                heap.prepare(&reference, &mut own);
            }
            let expected = heap.feedback(&x, &reference, &mut own).clone();
            let cost = heap.tracking_cost(&x, &reference);
            let terminal = states[N];
            states[N] = Vector4::repeat(f64::NAN);
            // A reference at rest is known by its stages, those of the horizon.
            let padded = Reference {
                stages: &states,
                terminal,
            };
            if k % 2 == 0 {
                other.prepare(&padded, &mut arrays);
            }
            let found = other.feedback(&x, &padded, &mut arrays).clone();
            assert_same(&found, &expected);
            assert_eq!(other.rollout(), heap.rollout());
            assert_eq!(other.gap(), heap.gap());
            assert_eq!(other.problems(), heap.problems());
            assert_eq!(other.tracking_cost(&x, &padded), cost);
            x = plant_moves(&x, &expected.u[0]);
        }
    }
}

/// The memory lists of a controller are as long as its horizon, however many places it is lent.
#[test]
fn a_short_horizon_is_that_of_a_smaller_controller() {
    const SHORT: usize = 11;
    let (mut short, mut long) = (
        controller(settings(SHORT)),
        lent::<LONG, MANY>(settings(SHORT)),
    );
    let (mut workspace, mut long_workspace) = (short.workspace(), lent_workspace::<LONG, MANY>());
    let mut x = tilted();
    for k in 0..30 {
        let states = moving(SHORT, k);
        let reference = along(&states);
        let expected = short.step(&x, &reference, &mut workspace).clone();
        let found = long.step(&x, &reference, &mut long_workspace);
        assert_eq!((found.u.len(), found.x.len()), (SHORT, SHORT));
        assert_same(found, &expected);
        assert_eq!(long.rollout(), short.rollout());
        assert_eq!(
            long.tracking_cost(&x, &reference),
            short.tracking_cost(&x, &reference)
        );
        x = plant_moves(&x, &expected.u[0]);
    }
}

#[test]
fn a_workspace_carries_nothing_between_controllers() {
    const N: usize = 20;
    let new = || controller(settings(N));
    let (mut first, mut second) = (new(), new());
    let (mut first_alone, mut second_alone) = (new(), new());
    let mut shared = first.workspace();
    let (mut memory, mut other_memory) = (first.workspace(), first.workspace());
    let (mut x, mut y) = (tilted(), Vector4::new(-0.3, -0.2, 0.5, 0.0));
    for k in 0..30 {
        let (one, other) = (moving(N, k), moving(N, 2 * k + 7));
        let (one, other) = (along(&one), along(&other));
        let u = first.step(&x, &one, &mut shared).u[0];
        let v = second.step(&y, &other, &mut shared).u[0];
        assert_eq!(first.solution(), first_alone.step(&x, &one, &mut memory));
        let alone = second_alone.step(&y, &other, &mut other_memory);
        assert_eq!(second.solution(), alone);
        (x, y) = (plant_moves(&x, &u), plant_moves(&y, &v));
    }
}

/// One workspace for controllers with other weights, bounds, ends, methods and horizons leaves no trace
/// of the one in the plan of the other.
#[test]
fn controllers_that_share_a_workspace_do_not_see_each_other() {
    const N: usize = 12;
    let other = Settings {
        horizon: N - 4,
        weights: Weights {
            q: settings(N).weights.q * 3.0,
            r: settings(N).weights.r * 0.5,
        },
        terminal: TerminalIngredient::Equality,
        u: Bounds {
            lower: Vector1::new(-50.0),
            upper: Vector1::new(60.0),
        },
        ..settings(N)
    };
    let descent = Settings {
        horizon: N - 2,
        iterations: Iterations::descent(1e-3, 4),
        ..settings(N)
    };
    let mut alone = [settings(N), other, descent].map(controller);
    let mut together = alone.clone();
    let mut own = alone.each_ref().map(|controller| controller.workspace());
    let room = alone
        .each_ref()
        .map(|controller| controller.settings().capacity());
    let largest = |of: fn(&Capacity) -> usize| room.iter().map(of).max().unwrap();
    let mut shared = Workspace::allocate(Capacity {
        stages: largest(|room| room.stages),
        rows: largest(|room| room.rows),
        active: largest(|room| room.active),
        ..Capacity::default()
    });
    let x = Vector4::new(0.05, 0.02, 0.3, 0.0);
    for k in 0..4 {
        let states = moving(N, k);
        let reference = along(&states);
        for (i, memory) in own.iter_mut().enumerate() {
            let expected = alone[i].step(&x, &reference, memory);
            let found = together[i].step(&x, &reference, &mut shared);
            assert_eq!(found, expected, "controller {i}, sample {k}");
            assert!(found.status.is_solved());
        }
    }
}

/// The capacity of the settings is enough, for the bounds that can be active at once.
#[test]
fn the_capacity_of_the_settings_is_enough() {
    for mut settings in all_settings() {
        let Some(price) = settings.soft_x[0] else {
            continue;
        };
        // All of the horizon beyond soft bounds, with the force at its own.
        settings.soft_x = [Some(price); 4];
        let far = Vector4::repeat(1e-3);
        (settings.x.lower, settings.x.upper) = (-far, far);
        let mut tried = controller(settings);
        let mut workspace = tried.workspace();
        for scale in [1.0, -1.0, 0.5] {
            let rest = Reference::constant(Vector4::zeros());
            let plan = tried.step(&(tilted() * scale), &rest, &mut workspace);
            assert!(plan.status.is_solved(), "{}", plan.status);
            assert!(plan.active.len() > 2 * N, "{} active", plan.active.len());
        }
    }
}

/// A workspace without room for the horizon: it is said, in every way of taking a step, the inputs stay
/// within bounds that do not contain zero, and with room again the next sample has a plan.
#[test]
fn a_workspace_that_is_too_short_says_so() {
    let pushing = Bounds {
        lower: Vector1::new(2.0),
        upper: Vector1::new(15.0),
    };
    for settings in all_settings() {
        for u in [settings.u, pushing] {
            let settings = Settings { u, ..settings };
            for stages in [0, 1, N - 1] {
                let mut tried = controller(settings);
                let mut short = Workspace::allocate(Capacity {
                    stages,
                    ..settings.capacity()
                });
                for k in 0..6 {
                    let states = moving(N, k);
                    let reference = along(&states);
                    if k % 3 != 0 {
                        tried.prepare(&reference, &mut short);
                    }
                    let plan = tried.feedback(&tilted(), &reference, &mut short);
                    assert_eq!(plan.status, Status::HorizonTooLong, "{stages} {k}");
                    assert!(plan.active.is_empty());
                    assert_safe(plan, &u);
                }
                let mut enough = tried.workspace();
                let rest = Reference::constant(Vector4::zeros());
                let x = tilted() * 0.1;
                // Bounds that leave no way out are another matter.
                if u != pushing {
                    let plan = tried.step(&x, &rest, &mut enough);
                    assert!(plan.status.is_solved(), "{stages}: {}", plan.status);
                }
            }
        }
    }
}

/// Lent memory that is shorter than the horizon is refused; the error names both.
#[test]
fn memory_that_is_shorter_than_the_horizon_is_refused() {
    fn outcome<const STAGES: usize>() -> Result<Regulator, ControllerError> {
        let arrays = Box::leak(Box::new(ControllerArrays::<f64, 4, 1, STAGES, N>::default()));
        Controller::new(CartPole::laboratory(), settings(N), arrays.lend())
    }
    for (found, largest) in [(outcome::<0>(), 0), (outcome::<{ N - 1 }>(), N - 1)] {
        let expected = ControllerError::Horizon { given: N, largest };
        assert_eq!(found.err(), Some(expected));
    }
    assert!(outcome::<N>().is_ok());
}

#[test]
fn a_working_set_that_is_too_small_says_so() {
    fn with_room<const ROWS: usize>() -> (Regulator, Workspace<f64, 4, 1>) {
        let controller = lent::<N, ROWS>(settings(N));
        (controller, lent_workspace::<N, ROWS>())
    }
    let (states, bounds) = (moving(N, 0), settings(N).u);
    let reference = along(&states);
    let (mut none, mut workspace) = with_room::<0>();
    let plan = none.step(&tilted(), &reference, &mut workspace);
    assert_eq!(plan.status, Status::WorkingSetFull);
    assert_safe(plan, &bounds);

    let (mut one, mut workspace) = with_room::<1>();
    let plan = one.step(&tilted(), &reference, &mut workspace);
    assert_eq!(plan.status, Status::WorkingSetFull);
    assert_safe(plan, &bounds);

    // Without an active bound, no room is needed.
    let plan = one.step(&(tilted() * 0.1), &reference, &mut workspace);
    assert_eq!(plan.status, Status::Solved);
    assert!(plan.active.is_empty());

    // Room for the search, but not for its answer, and the other way round.
    let mut enough = controller(settings(N)).workspace();
    let (mut few, _) = with_room::<1>();
    let plan = few.step(&tilted(), &reference, &mut enough);
    assert_eq!(plan.status, Status::WorkingSetFull);
    assert_safe(plan, &bounds);
    let (_, mut few) = with_room::<1>();
    let mut tried = controller(settings(N));
    let plan = tried.step(&tilted(), &reference, &mut few);
    assert_eq!(plan.status, Status::WorkingSetFull);
    assert_safe(plan, &bounds);
}
