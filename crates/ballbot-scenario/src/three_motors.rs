//! Two planes' regulators and the heading's on three motors, each with its limit.

use crate::heading::Turning;
use crate::whole_robot::{HEADING, State, plane};
use ballbot::{Heading, PlaneTorques, Wheels};
use ballbot_control::PlaneRegulator;
use lpvmpc::{Observation, Verdict};
use lpvmpc_sim::{Decision, LogRow, Measurement, Regulator, Sample};
use nalgebra::{Vector1, Vector2, Vector3};
use std::time::Duration;

/// What the three motors have, and what they turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motors {
    /// Largest torque of each motor, N m.
    pub limit: f64,
    /// Largest yaw torque, N m.
    pub yaw: f64,
    /// How the robot turns.
    pub turning: Turning,
}

impl Motors {
    /// What is left for the planes under the largest yaw torque.
    pub(crate) fn left(&self, wheels: &Wheels<f64>) -> PlaneTorques<f64> {
        wheels.plane_torques(self.limit, self.yaw)
    }
}

/// The heading and the motors at a control sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorSample {
    /// Time, s.
    pub t: f64,
    /// Heading, rad.
    pub heading: f64,
    /// Where the robot has to look, rad.
    pub target: f64,
    /// The motors' torques (tau_1, tau_2, tau_3) from here on, N m.
    pub torques: Vector3<f64>,
}

/// Two planes' regulators and the law of the heading.
pub(crate) struct PlanesAndYaw {
    planes: [Box<dyn PlaneRegulator>; 2],
    wheels: Wheels<f64>,
    motors: Motors,
    /// Measured heading, rad, and its rate, rad/s.
    heading: Vector2<f64>,
    /// Time of the last measurement, s.
    time: f64,
    /// Torques of the planes and of yaw, N m.
    torques: Vector3<f64>,
    /// What each plane had for its last plan, N m.
    shares: [f64; 2],
    /// What each plane decided at the last sample.
    decisions: [Option<Decision<4, 1>>; 2],
}

impl PlanesAndYaw {
    pub(crate) fn new(
        planes: [Box<dyn PlaneRegulator>; 2],
        wheels: Wheels<f64>,
        motors: Motors,
    ) -> Self {
        Self {
            planes,
            wheels,
            motors,
            heading: Vector2::new(motors.turning.initial, 0.0),
            time: 0.0,
            torques: Vector3::zeros(),
            // There is no last plan: as if it had been cut off.
            shares: [0.0; 2],
            decisions: [None; 2],
        }
    }

    /// One plane's sample of the whole robot's.
    pub(crate) fn of_plane(&self, index: usize, sample: &Sample<10, 3>) -> Option<Sample<4, 1>> {
        let decision = self.decisions[index]?;
        Some(Sample {
            t: sample.t,
            x: plane(&sample.x, index),
            estimate: decision.estimate,
            u: decision.u,
            x_ref: plane(&sample.x_ref, index),
            cost: decision.cost,
            status: decision.status,
            active_bounds: decision.active_bounds,
            step_time: decision.step_time,
            gap: decision.gap,
            guard: decision.guard,
        })
    }

    /// One plane's row of the whole robot's log: the motors' torques as the plane feels them at
    /// the true `heading`, rad.
    pub(crate) fn log_of_plane(
        &self,
        index: usize,
        row: &LogRow<10, 3>,
        heading: f64,
    ) -> LogRow<4, 1> {
        let felt = |motors: &Vector3<f64>| {
            let torques = self.wheels.virtual_torques(motors).xy();
            Vector1::new(Heading::new(heading).to_floor(&torques)[index])
        };
        LogRow {
            t: row.t,
            measured: std::array::from_fn(|i| row.measured[4 * index + i]),
            observation: Observation {
                verdicts: std::array::from_fn(|i| row.observation.verdicts[4 * index + i]),
                restart: row.observation.restart,
            },
            commanded: felt(&row.commanded),
            applied: felt(&row.applied),
        }
    }

    fn motor_torques(&self) -> Vector3<f64> {
        let planes = Heading::new(self.heading[0]).to_robot(&self.torques.xy());
        self.wheels.motors(&planes.push(self.torques[2]))
    }

    fn decide_plane(
        &mut self,
        index: usize,
        share: f64,
        reference: &dyn Fn(f64) -> State,
        clock: &dyn Fn() -> Duration,
    ) {
        let regulator = &mut self.planes[index];
        regulator.set_share(share);
        let decision = regulator.decide(&|t| plane(&reference(t), index), clock);
        self.shares[index] = share;
        self.torques[index] = decision.u[0];
        self.decisions[index] = Some(decision);
    }
}

impl Regulator<10, 3, 10> for PlanesAndYaw {
    fn t_s(&self) -> f64 {
        self.planes[0].t_s()
    }

    fn observe(&mut self, measurement: &Measurement<10>) -> Observation<10> {
        let Measurement { t, values, ages } = *measurement;
        let mut verdicts = [Verdict::Missing; 10];
        let mut restart = None;
        for (index, regulator) in self.planes.iter_mut().enumerate() {
            let of_plane = regulator.observe(&Measurement {
                t,
                values: std::array::from_fn(|i| values[4 * index + i]),
                ages: std::array::from_fn(|i| ages[4 * index + i]),
            });
            verdicts[4 * index..][..4].copy_from_slice(&of_plane.verdicts);
            restart = restart.or(of_plane.restart);
        }
        let places = self.heading.iter_mut().zip(&mut verdicts[HEADING..]);
        for ((place, verdict), value) in places.zip(&values[HEADING..]) {
            match value {
                Some(value) if value.is_finite() => (*place, *verdict) = (*value, Verdict::Used),
                Some(_) => *verdict = Verdict::NotFinite,
                None => {}
            }
        }
        self.time = t;
        Observation { verdicts, restart }
    }

    /// Yaw first, which is limited to what is kept for it; then the plane that needs more.
    fn decide(
        &mut self,
        reference: &dyn Fn(f64) -> State,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<10, 3> {
        let x_ref = reference(self.time);
        let Motors {
            limit,
            yaw,
            turning,
        } = self.motors;
        let target = x_ref.fixed_rows::<2>(HEADING).into_owned();
        self.torques[2] = turning.yaw(&self.heading, &target).max(-yaw).min(yaw);
        let left = self.wheels.plane_torques(limit, self.torques[2]);
        let needs = [0, 1].map(|index| {
            let largest = self.planes[index].largest_torque();
            PlaneTorques::need([largest], self.shares[index])
        });
        let (first, share) = left.first(needs);
        self.decide_plane(first, share, reference, clock);
        let taken = self.planes[first].largest_torque().min(share);
        self.decide_plane(1 - first, left.rest(taken), reference, clock);

        let decisions = self.decisions.iter().flatten();
        let total = decisions.clone().map(|decision| decision.cost).sum();
        let unsolved = decisions.clone().map(|decision| decision.status);
        let worst = unsolved.reduce(|a, b| if a.is_solved() { b } else { a });
        Decision {
            u: self.motor_torques(),
            estimate: State::zeros(),
            x_ref,
            cost: total,
            status: worst.unwrap_or(lpvmpc::Status::Solved),
            active_bounds: decisions.clone().map(|d| d.active_bounds).sum(),
            step_time: decisions.clone().map(|d| d.step_time).sum(),
            gap: State::zeros(),
            guard: decisions.clone().find_map(|d| d.guard),
        }
    }

    /// The planes' torques stay, or follow their ramps; the motors follow the heading.
    fn between(&mut self) -> Option<Vector3<f64>> {
        for (torque, regulator) in self.torques.iter_mut().zip(&mut self.planes) {
            if let Some(u) = regulator.between() {
                *torque = u[0];
            }
        }
        Some(self.motor_torques())
    }

    fn prediction(&self) -> Vec<State> {
        Vec::new()
    }
}
