//! The figures of recorded runs.

use ballbot_scenario::{PhiReference, Prepared};
use ballbot_studies::recorded::Columns;
use lpvmpc::Bounds;
use lpvmpc_figures::{
    Band, Figure, GuaranteeRun, Limits, PathRun, PlaneRun, PlansRun, Reference, Role, closed_loop,
    motor_torques, path_in_plane, two_planes,
};
use nalgebra::Vector3;

/// A recorded run with its name and colour in a figure.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// Name in the legend.
    pub label: &'a str,
    /// Colour.
    pub role: Role,
    /// The run.
    pub columns: &'a Columns,
}

impl<'a> Shown<'a> {
    fn run(self) -> PlaneRun<'a> {
        PlaneRun {
            label: self.label,
            role: self.role,
            time: &self.columns.time,
            states: &self.columns.states,
            torque: &self.columns.torque,
            cost: &self.columns.cost,
        }
    }
}

/// The bounds of the controller's problem, as the figures shade them.
pub fn limits(x: &Bounds<f64, 4>, u: &Bounds<f64, 1>) -> Limits {
    Limits {
        states: std::array::from_fn(|i| Band {
            lower: x.lower[i],
            upper: x.upper[i],
        }),
        torque: Band {
            lower: u.lower[0],
            upper: u.upper[0],
        },
    }
}

fn reference<'a>(columns: &'a Columns, kind: &PhiReference) -> Reference<'a> {
    Reference {
        time: &columns.time,
        phi: &columns.phi_reference,
        held: matches!(kind, PhiReference::Steps(_)),
    }
}

/// Six panels of runs of one plane with a common reference.
pub fn one_plane(title: &str, prepared: &Prepared, shown: &[Shown<'_>]) -> Figure {
    let runs: Vec<PlaneRun<'_>> = shown.iter().map(|shown| shown.run()).collect();
    let followed = shown.first().zip(prepared.planes.first());
    let reference = followed.map(|(shown, plane)| reference(shown.columns, &plane.reference));
    closed_loop(
        title,
        &runs,
        reference,
        Some(limits(&prepared.settings.x, &prepared.settings.u)),
    )
}

/// Time series of both planes.
pub fn both_planes(title: &str, prepared: &Prepared, planes: [Shown<'_>; 2]) -> Figure {
    let references = match prepared.planes.as_slice() {
        [x, y] => Some([
            reference(planes[0].columns, &x.reference),
            reference(planes[1].columns, &y.reference),
        ]),
        _ => None,
    };
    two_planes(
        title,
        planes.map(Shown::run),
        references,
        Some(limits(&prepared.settings.x, &prepared.settings.u)),
    )
}

/// The path on the floor with its reference, for as long as both planes were recorded.
pub fn path(title: &str, prepared: &Prepared, planes: [&Columns; 2]) -> Figure {
    let geometry = &prepared.ballbot.geometry;
    let [x, y] = planes.map(|plane| plane.states.len());
    let metres = |phi: &mut dyn Iterator<Item = f64>| {
        let positions = phi.take(x.min(y)).map(|phi| geometry.position(phi));
        positions.collect::<Vec<_>>()
    };
    let positions = planes.map(|plane| metres(&mut plane.states.iter().map(|x| x[0])));
    let references = planes.map(|plane| metres(&mut plane.phi_reference.iter().copied()));
    let run = PathRun {
        label: "ballbot",
        role: Role::Lpv,
        x: &positions[0],
        y: &positions[1],
    };
    path_in_plane(title, &[run], Some((&references[0], &references[1])))
}

/// How far the plans of a run were from the model's rollout, and, for a run with a guarantee, what
/// each torque was backed by and where the plan was to end; `None` where neither is to be told.
pub fn plans(title: &str, columns: &Columns) -> Option<Figure> {
    let samples = columns.gap.len();
    let first = |values: &[f64]| values.get(..samples).unwrap_or(values).to_vec();
    let (time, wanted) = (first(&columns.time), first(&columns.phi_reference));
    let guarantee = columns.guarantee.iter();
    let (set_points, decisions): (Vec<f64>, Vec<f64>) = guarantee
        .map(|guarantee| (guarantee.set_point, f64::from(guarantee.decision as u8 + 1)))
        .unzip();
    let guarantee = (columns.guarantee.len() == samples).then_some(GuaranteeRun {
        set_points: &set_points,
        wanted: &wanted,
        decisions: &decisions,
    });
    let gap = &columns.gap;
    lpvmpc_figures::plans(
        title,
        &PlansRun {
            time: &time,
            gap,
            guarantee,
        },
    )
}

/// The three motors' torques, with their limits where the planes share them.
pub fn motors(
    title: &str,
    prepared: &Prepared,
    columns: &Columns,
    torques: &[Vector3<f64>],
) -> Figure {
    let of = |i: usize| torques.iter().map(|torque| torque[i]).collect::<Vec<_>>();
    let (first, second, third) = (of(0), of(1), of(2));
    let time = columns.time.get(..=torques.len()).unwrap_or(&columns.time);
    let limit = prepared.motors.map(|motors| Band {
        lower: -motors.limits.motor,
        upper: motors.limits.motor,
    });
    motor_torques(title, time, [&first, &second, &third], limit)
}
