//! Bounds that change while the controller runs.

use super::{along, assert_safe, controller, moving, settings, tilted};
use crate::method::plant::CartPole;
use lpvmpc::{Bounds, ControllerError, Rk4, Status, kkt_residual};
use nalgebra::Vector1;

const N: usize = 15;

fn force(lower: f64, upper: f64) -> Bounds<f64, 1> {
    Bounds {
        lower: Vector1::new(lower),
        upper: Vector1::new(upper),
    }
}

/// Wide and narrow by turns, not symmetric: the plan is the optimum of the program with the
/// bounds of this sample, though the search starts from the active bounds of the last one.
#[test]
fn every_plan_is_the_optimum_within_the_bounds_of_its_sample() {
    let settings = settings(N);
    let mut planner = controller(settings);
    let mut workspace = planner.workspace();
    let (mut x, mut at_bound) = (tilted(), [0, 0]);
    for k in 0..40 {
        let narrow = k % 3 != 0;
        let bounds = if narrow { force(-8.0, 9.0) } else { settings.u };
        // Without bounds of the state there is always a plan.
        planner.set_bounds(Bounds::none(), bounds).unwrap();
        let plan = planner.step(&x, &along(&moving(N, k)), &mut workspace);
        assert_eq!(plan.status, Status::Solved, "sample {k}");
        assert_safe(plan, &bounds);
        let residual = kkt_residual(workspace.ocp(), plan).largest();
        assert!(residual < 1e-9, "sample {k}: {residual}");
        at_bound[usize::from(narrow)] += plan.active.len();
        x = Rk4 { substeps: 20 }.advance(&CartPole::laboratory(), &x, &plan.u[0], 0.05);
    }
    let [wide, narrow] = at_bound;
    assert!(wide > 0 && narrow > wide, "{at_bound:?} active bounds");
}

#[test]
fn from_the_first_step_they_are_those_of_a_controller_made_with_them() {
    let mut settings = settings(N);
    let mut set = controller(settings);
    settings.u = force(-8.0, 5.0);
    settings.x.upper[0] = 0.5;
    set.set_bounds(settings.x, settings.u).unwrap();
    let mut made = controller(settings);
    let mut workspace = set.workspace();
    let states = moving(N, 0);
    let reference = along(&states);
    let from_set = set.step(&tilted(), &reference, &mut workspace).clone();
    assert_eq!(&from_set, made.step(&tilted(), &reference, &mut workspace));
}

#[test]
fn bounds_that_make_no_sense_are_refused_and_change_nothing() {
    let mut controller = controller(settings(N));
    let before = *controller.settings();
    for (lower, upper) in [(1.0, -1.0), (f64::NAN, 1.0), (-1.0, f64::NAN)] {
        let refused = controller.set_bounds(before.x, force(lower, upper));
        let expected = ControllerError::Bounds {
            quantity: "input",
            component: 0,
        };
        assert_eq!(refused, Err(expected));
        assert_eq!(*controller.settings(), before);
    }
}
