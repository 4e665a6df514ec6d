//! What a regulator leaves to the one that takes its place when settings change on the run.

use lpvmpc::{ActiveRow, Controller, DelayLine, LastPlan, LpvModel};
use lpvmpc_sim::MeasuredState;
use nalgebra::{SMatrix, SVector, Vector1};
use std::any::Any;
use std::rc::Rc;

/// Instants that the filter remembers: enough for readings that are 0.1 s late at 1 kHz, with a
/// change of the torque in between.
const INSTANTS: usize = 256;

/// The filter on (phi, theta, theta_dot).
pub(crate) type Filter = ballbot::Estimator<f64, 2, INSTANTS>;

/// Torques that can be on their way at once.
const MOST_COMMANDS: usize = 256;

/// Torques that have been commanded, N m.
pub(crate) type Commands = DelayLine<f64, 1, MOST_COMMANDS>;

/// What outlives a regulator of one plane: what it knows of the robot, what it has commanded, and
/// what it plans.
#[derive(Clone, Debug)]
pub struct Handover {
    /// The state as the sensors see it, and the time of the last measurement.
    pub(crate) measured: MeasuredState<4>,
    pub(crate) filter: Option<Box<Filter>>,
    pub(crate) commands: Commands,
    /// The torque that was commanded last, N m.
    pub(crate) torque: f64,
    /// Where it is at the next sample: elsewhere, if it moves in a ramp, N m.
    pub(crate) next_torque: f64,
    /// Largest torque that the other plane leaves, N m.
    pub(crate) share: f64,
    pub(crate) plan: Option<PlanKind>,
}

impl Handover {
    /// Of a regulator that has nothing but the measured state, and holds a torque (N m).
    pub(crate) fn of_state(
        measured: MeasuredState<4>,
        torque: f64,
        plan: Option<PlanKind>,
    ) -> Self {
        let mut commands = Commands::default();
        commands.command(Vector1::new(torque), 0.0);
        Self {
            measured,
            filter: None,
            commands,
            torque,
            next_torque: torque,
            share: f64::INFINITY,
            plan,
        }
    }

    /// The torque that was commanded last, N m.
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// The same with another torque on top, N m.
    pub fn with_torque(self, torque: f64) -> Self {
        Self { torque, ..self }
    }
}

/// A plan, by what its input is.
#[derive(Clone, Debug)]
pub(crate) enum PlanKind {
    /// The torque.
    Held(Plan<4>),
    /// The torque's rate.
    Ramped(Plan<5>),
    /// The guarded controller itself: its plan is worth something under its certificate only.
    Guarded(Rc<dyn Any>),
}

/// The last plan of a controller.
#[derive(Clone, Debug)]
pub(crate) struct Plan<const NX: usize> {
    t_s: f64,
    x: Vec<SVector<f64, NX>>,
    u: Vec<Vector1<f64>>,
    gain: Vec<SMatrix<f64, 1, NX>>,
    active: Vec<ActiveRow<f64>>,
    cost: f64,
    damping: f64,
}

impl<const NX: usize> Plan<NX> {
    pub(crate) fn of<P>(controller: &Controller<P, f64, NX, 1, 3>) -> Option<Self>
    where
        P: LpvModel<f64, NX, 1, 3>,
    {
        let (plan, active) = controller.last_plan()?;
        Some(Self {
            t_s: controller.settings().t_s,
            x: plan.x.to_vec(),
            u: plan.u.to_vec(),
            gain: plan.gain.to_vec(),
            active: active.collect(),
            cost: plan.cost,
            damping: plan.damping,
        })
    }

    /// Gives it to a controller. At another sampling time its inputs would be another motion: then
    /// that begins without a past.
    pub(crate) fn hand_to<P>(&self, controller: &mut Controller<P, f64, NX, 1, 3>)
    where
        P: LpvModel<f64, NX, 1, 3>,
    {
        if self.t_s == controller.settings().t_s {
            let plan = LastPlan {
                x: &self.x,
                u: &self.u,
                gain: &self.gain,
                cost: self.cost,
                damping: self.damping,
            };
            controller.adopt(&plan, self.active.iter().copied());
        }
    }
}
