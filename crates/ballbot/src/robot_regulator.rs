//! Both planes' regulators and the heading's on three motors, each with its limit.

use crate::heading::Heading;
use crate::regulator::OutputFeedback;
use crate::shares::PlaneTorques;
use crate::wheels::Wheels;
use lpvmpc::{
    Clock, Command, Measurement, Number, Observation, Planner, Regulator, Restart, Scalar, Status,
    Tick, Verdict,
};
use nalgebra::{SVector, Vector1, Vector2, Vector3, Vector4, convert};

/// The x plane's state, the y plane's, the heading (rad) and its rate (rad/s).
pub type RobotState<T> = SVector<T, 10>;

/// The place of the heading in a [`RobotState`].
pub const HEADING: usize = 8;

/// One plane's part of a [`RobotState`]: 0 for x, 1 for y.
pub fn plane_of<T: Scalar>(state: &RobotState<T>, index: usize) -> Vector4<T> {
    Vector4::from_fn(|i, _| state.get(4 * index + i).copied().unwrap_or_else(T::zero))
}

/// What the three motors have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorLimits<T> {
    /// Largest torque of each motor, N m.
    pub motor: T,
    /// Largest yaw torque, N m.
    pub yaw: T,
}

impl<T: Scalar + Number> MotorLimits<T> {
    /// What is left for the planes under the largest yaw torque.
    pub fn left(&self, wheels: &Wheels<T>) -> PlaneTorques<T> {
        wheels.plane_torques(self.motor, self.yaw)
    }
}

/// The law of the heading: a yaw torque for what is missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YawLaw<T> {
    /// Torque per missing angle, N m/rad.
    pub stiffness: T,
    /// Torque per missing rate, N m s/rad.
    pub damping: T,
}

impl<T: Scalar> YawLaw<T> {
    /// The wanted yaw torque in N m for the measured heading (rad) and rate (rad/s) and their
    /// targets. It turns the ball, which the floor holds, so the body turns the other way.
    pub fn torque(&self, measured: &Vector2<T>, target: &Vector2<T>) -> T {
        let error = measured - target;
        self.stiffness * error[0] + self.damping * error[1]
    }
}

/// A whole robot's regulator, with the planner `K` in both planes: from the ten readings of a
/// [`RobotState`], those of the planes along the floor's axes, to the three motors' torques (N m).
///
/// Yaw comes first, which is limited to what is kept for it; then the plane that needs more, then
/// the other one, within what the motors have left. Both planners work in one workspace.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct RobotRegulator<T: Scalar + Number, K: Planner<T, 4, 1>> {
    planes: [OutputFeedback<T, K>; 2],
    workspace: K::Workspace,
    wheels: Wheels<T>,
    limits: MotorLimits<T>,
    yaw: YawLaw<T>,
    /// Measured heading, rad, and its rate, rad/s.
    heading: Vector2<T>,
    /// Time of the heading.
    clock: Clock,
    /// Torques of the planes and of yaw, N m.
    torques: Vector3<T>,
    /// What each plane had for its last plan, N m.
    shares: [T; 2],
    /// What each plane decided at the last sample.
    commands: [Option<Command<T, 4, 1>>; 2],
    /// Why each plane began anew with the last measurement.
    restarts: [Option<Restart>; 2],
}

impl<T: Scalar + Number, K: Planner<T, 4, 1>> RobotRegulator<T, K> {
    /// The regulator of a robot that is expected to look along `heading`, rad.
    pub fn new(
        planes: [OutputFeedback<T, K>; 2],
        workspace: K::Workspace,
        wheels: Wheels<T>,
        limits: MotorLimits<T>,
        yaw: YawLaw<T>,
        heading: T,
    ) -> Self {
        Self {
            planes,
            workspace,
            wheels,
            limits,
            yaw,
            heading: Vector2::new(heading, T::zero()),
            clock: Clock::default(),
            torques: Vector3::zeros(),
            // There is no last plan: as if it had been cut off.
            shares: [T::zero(); 2],
            commands: [None; 2],
            restarts: [None; 2],
        }
    }

    /// What the plane `index` decided at the last sample.
    pub fn command_of(&self, index: usize) -> Option<&Command<T, 4, 1>> {
        self.commands.get(index)?.as_ref()
    }

    /// The cost J of the last plan of the plane `index`.
    pub fn cost_of(&self, index: usize) -> Option<T> {
        Some(self.planes.get(index)?.cost())
    }

    /// Why each plane began anew with the last measurement; `None` for one that went on.
    pub fn restarts(&self) -> &[Option<Restart>; 2] {
        &self.restarts
    }

    /// The wheels.
    pub fn wheels(&self) -> &Wheels<T> {
        &self.wheels
    }

    /// The measured heading, rad.
    pub fn heading(&self) -> T {
        self.heading[0]
    }

    fn motor_torques(&self) -> Vector3<T> {
        let planes = Heading::new(self.heading[0]).to_robot(&self.torques.xy());
        self.wheels.motors(&planes.push(self.torques[2]))
    }

    /// The largest torque of the last plan of each plane, N m; infinite for one that keeps to an
    /// equal share.
    fn largest_torques(&self) -> [T; 2] {
        self.planes.each_ref().map(|plane| {
            let largest = plane.largest_inputs();
            largest.map_or(convert(f64::INFINITY), |torque| torque[0])
        })
    }

    fn decide_plane(
        &mut self,
        index: usize,
        share: T,
        reference: &dyn Fn(f64) -> RobotState<T>,
    ) -> Option<()> {
        let plane = self.planes.get_mut(index)?;
        plane.set_share(Vector1::new(share));
        let command = plane.decide(&|t| plane_of(&reference(t), index), &mut self.workspace);
        *self.shares.get_mut(index)? = share;
        *self.torques.get_mut(index)? = command.u[0];
        *self.commands.get_mut(index)? = Some(command);
        Some(())
    }
}

impl<T: Scalar + Number, K: Planner<T, 4, 1>> Regulator<T, 10, 3, 10> for RobotRegulator<T, K> {
    fn t_s(&self) -> T {
        let [x, _] = &self.planes;
        x.t_s()
    }

    fn observe(&mut self, measurement: &Measurement<T, 10>) -> Observation<10> {
        let Measurement { t, readings } = measurement;
        let mut verdicts = [Verdict::Missing; 10];
        let planes = self.planes.iter_mut().zip(&mut self.restarts);
        let planes = planes.zip(readings.chunks_exact(4));
        for (((plane, restart), readings), verdicts) in planes.zip(verdicts.chunks_exact_mut(4)) {
            let of_plane = plane.observe(&Measurement {
                t: *t,
                readings: core::array::from_fn(|i| readings.get(i).copied().flatten()),
            });
            verdicts.copy_from_slice(&of_plane.verdicts);
            *restart = of_plane.restart;
        }
        let [x, y] = self.restarts;
        let restart = x.or(y);
        let refused = match self.clock.tick::<T>(*t) {
            Tick::First | Tick::Elapsed(_) => None,
            // Out of order, unless the planes take it for another clock.
            Tick::Backward(_) if restart.is_none() => Some(Verdict::Stale),
            Tick::Backward(_) => {
                self.clock.reset();
                self.clock.tick::<T>(*t);
                None
            }
            Tick::NotFinite => Some(Verdict::NotFinite),
        };
        let of_heading = readings.iter().zip(&mut verdicts).skip(HEADING);
        for (place, (reading, verdict)) in self.heading.iter_mut().zip(of_heading) {
            match (reading, refused) {
                (Some(_), Some(refused)) => *verdict = refused,
                (Some(reading), None) if reading.value.is_finite() => {
                    (*place, *verdict) = (reading.value, Verdict::Used);
                }
                (Some(_), None) => *verdict = Verdict::NotFinite,
                (None, _) => {}
            }
        }
        Observation { verdicts, restart }
    }

    fn decide(&mut self, reference: &dyn Fn(f64) -> RobotState<T>) -> Command<T, 10, 3> {
        let x_ref = reference(self.clock.now().unwrap_or(0.0));
        let MotorLimits { motor, yaw } = self.limits;
        let target = x_ref.fixed_rows::<2>(HEADING).into_owned();
        let wanted = self.yaw.torque(&self.heading, &target);
        let turns = wanted.is_finite();
        // A limit that is NaN lets nothing through.
        self.torques[2] = if turns && yaw > T::zero() {
            wanted.max(-yaw).min(yaw)
        } else {
            T::zero()
        };
        let left = self.wheels.plane_torques(motor, self.torques[2]);
        let [x, y] = self.largest_torques();
        let [x_share, y_share] = self.shares;
        let needs = [(x, x_share), (y, y_share)]
            .map(|(largest, share)| PlaneTorques::need([largest], share));
        let (first, share) = left.first(needs);
        self.decide_plane(first, share, reference);
        let taken = self
            .largest_torques()
            .get(first)
            .map_or(share, |torque| torque.min(share));
        self.decide_plane(1 - first, left.rest(taken), reference);

        let commands = || self.commands.iter().flatten();
        let (mut estimate, mut gap) = (RobotState::zeros(), RobotState::zeros());
        let places = estimate.as_mut_slice().chunks_exact_mut(4);
        let places = places.zip(gap.as_mut_slice().chunks_exact_mut(4));
        for ((estimate, gap), command) in places.zip(commands()) {
            estimate.copy_from_slice(command.estimate.as_slice());
            gap.copy_from_slice(command.gap.as_slice());
        }
        (estimate[HEADING], estimate[HEADING + 1]) = (self.heading[0], self.heading[1]);
        let worse = |a: Status<T>, b: Status<T>| if a.is_solved() { b } else { a };
        let of_yaw = if turns {
            Status::Solved
        } else {
            Status::NotFinite
        };
        Command {
            u: self.motor_torques(),
            estimate,
            x_ref,
            status: commands().map(|command| command.status).fold(of_yaw, worse),
            active_bounds: commands().map(|command| command.active_bounds).sum(),
            gap,
            guarantee: commands().find_map(|command| command.guarantee),
        }
    }

    /// The planes' torques stay, or follow their ramps; the motors follow the heading.
    fn between(&mut self) -> Option<Vector3<T>> {
        for (torque, plane) in self.torques.iter_mut().zip(&mut self.planes) {
            if let Some(u) = plane.between() {
                *torque = u[0];
            }
        }
        Some(self.motor_torques())
    }

    fn take_over(&mut self, previous: &Self) {
        for (plane, before) in self.planes.iter_mut().zip(&previous.planes) {
            plane.take_over(before);
        }
        (self.heading, self.clock) = (previous.heading, previous.clock);
        (self.torques, self.shares) = (previous.torques, previous.shares);
        (self.commands, self.restarts) = (previous.commands, previous.restarts);
    }

    /// The sum over the planes.
    fn cost(&self) -> T {
        let [x, y] = &self.planes;
        x.cost() + y.cost()
    }
}
