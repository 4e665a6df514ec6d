//! Steps controllers and regulators of the ballbot on inputs that the compiler
//! knows nothing about, in `f32` and in `f64`, and maps the torques to the motors: this image must
//! link.
#![no_std]
#![no_main]

use ballbot::{
    Ballbot, Held, OutputFeedback, PlaneTorques, Ramped, RobotRegulator, RobotState, Wheels,
};
use core::hint::black_box;
use lpvmpc::{
    Bounds, Controller, GeneralRow, List, Measurement, Number, Preview, Reference, Regulator,
    Scalar, Workspace,
};
use nalgebra::{Vector1, Vector3, Vector4, convert};
use no_panic as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    loop {
        step::<f32>();
        step::<f64>();
        step_with::<f32>();
        step_with::<f64>();
        regulate::<f32>();
        regulate::<f64>();
    }
}

/// One step of a controller that is never built: what matters is the code, not a run.
#[inline(never)]
fn step<T: Scalar + Number>() {
    let controller: Option<&mut Controller<Ballbot<T>, T, 4, 1, 3>> = black_box(None);
    let workspace: Option<&mut Workspace<T, 4, 1>> = black_box(None);
    let inputs: Option<&(Vector4<T>, Reference<'_, T, 4>)> = black_box(None);
    let wheels: Option<&Wheels<T>> = black_box(None);
    if let (Some(controller), Some(workspace)) = (controller, workspace)
        && let (Some((x, reference)), Some(wheels)) = (inputs, wheels)
    {
        // The motors' limit and the yaw torque, N m; what the other plane takes.
        let [limit, yaw, taken] = black_box([T::one(); 3]);
        let left = wheels.plane_torques(limit, yaw);
        let share = Vector1::new(left.rest(taken));
        let bounds = Bounds {
            lower: -share,
            upper: share,
        };
        let states = controller.settings().x;
        black_box(controller.set_bounds(states, bounds).is_ok());
        controller.prepare(reference, workspace);
        black_box(controller.feedback(x, reference, workspace));
        let plan = controller.step(x, reference, workspace);
        let torque = plan.first_input()[0];
        let needed = PlaneTorques::need(plan.u.iter().map(|u| u[0]), taken);
        black_box(plan);
        black_box(left.first([needed, taken]));
        black_box(wheels.motors(&Vector3::new(torque, torque, T::zero())));
    }
}

/// The same with all that may be known ahead, and with what may change while a controller runs.
#[inline(never)]
fn step_with<T: Scalar + Number>() {
    let controller: Option<&mut Controller<Ballbot<T>, T, 4, 1, 3>> = black_box(None);
    let workspace: Option<&mut Workspace<T, 4, 1>> = black_box(None);
    let told: Option<(&Vector4<T>, &Preview<'_, Ballbot<T>, T, 4, 1, 3>)> = black_box(None);
    let rows: Option<List<GeneralRow<T, 4, 1>>> = black_box(None);
    if let (Some(controller), Some(workspace), Some((x, preview)), Some(rows)) =
        (controller, workspace, told, rows)
    {
        black_box(controller.set_rows(rows).is_ok());
        black_box(
            controller
                .set_settings(*black_box(controller.settings()))
                .is_ok(),
        );
        controller.set_model(*black_box(controller.model()));
        controller.prepare_with(preview, workspace);
        black_box(controller.feedback_with(x, preview, workspace));
        black_box(controller.step_with(x, preview, workspace));
        black_box(controller.tracking_cost_with(x, preview));
        black_box(controller.step(x, &preview.reference, workspace));
    }
}

/// A sample of a whole robot's regulator, and of a plane whose torque moves in ramps.
#[inline(never)]
fn regulate<T: Scalar + Number>() {
    let reference: &dyn Fn(f64) -> RobotState<T> = &|t| black_box(RobotState::repeat(convert(t)));
    let measurement: Option<&Measurement<T, 10>> = black_box(None);
    let robot: Option<&mut RobotRegulator<T, Held<T>>> = black_box(None);
    let before: Option<&RobotRegulator<T, Held<T>>> = black_box(None);
    if let (Some(robot), Some(measurement)) = (robot, measurement) {
        if let Some(before) = before {
            robot.take_over(before);
        }
        black_box(robot.observe(measurement));
        black_box(robot.decide(reference));
        black_box(robot.between());
        black_box(robot.cost());
    }
    let reference: &dyn Fn(f64) -> Vector4<T> = &|t| black_box(Vector4::repeat(convert(t)));
    let measurement: Option<&Measurement<T, 4>> = black_box(None);
    let plane: Option<&mut OutputFeedback<T, Ramped<T>>> = black_box(None);
    let before: Option<&OutputFeedback<T, Ramped<T>>> = black_box(None);
    let workspace: Option<&mut Workspace<T, 5, 1>> = black_box(None);
    if let (Some(plane), Some(measurement), Some(workspace)) = (plane, measurement, workspace) {
        if let Some(before) = before {
            plane.take_over(before);
        }
        black_box(plane.observe(measurement));
        black_box(plane.decide(reference, workspace));
        black_box(plane.between());
        black_box((plane.cost(), plane.predicted(0), plane.active_bound(0)));
    }
}
