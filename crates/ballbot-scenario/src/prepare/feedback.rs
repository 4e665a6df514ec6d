//! The feedback pipeline around the controller of a real robot, checked: estimator, delay, ramps.

use crate::error::ScenarioError;
use crate::file::feedback_table::{
    DisturbancesTable, EstimatorTable, MotorsTable, ShapingTable, TorqueRateTable,
};
use crate::file::schema::{BoundsTable, ControllerTable, TerminalTable};
use crate::number::{not_negative, positive, text};
use crate::prepare::heading::Turning;
use crate::prepare::problem::{MOST_SUBSTEPS, dynamic};
use crate::prepare::three_motors::ThreeMotors;
use ballbot::{Ballbot, EstimatorSettings, MotorLimits, PlaneFeedback, RampedSettings, Wheels};
use lpvmpc::{
    Bounds, ControllerSettings, Gate, InputReference, LpvModel, MoveLimits, RampedInput,
    TerminalIngredient, Weights,
};
use nalgebra::{
    Complex, DMatrix, Matrix1, Matrix1x2, Matrix4, Matrix4x2, Matrix5, Vector1, Vector2, Vector3,
    Vector4, Vector5,
};
use std::f64::consts::FRAC_PI_2;

/// Longest Runge-Kutta step of estimator and delay compensation, as |step * fastest pole|.
const ESTIMATOR_STEP: f64 = 0.5;

impl ControllerTable {
    /// The feedback pipeline around the controller.
    pub(crate) fn feedback(&self, ballbot: &Ballbot<f64>) -> Result<PlaneFeedback, ScenarioError> {
        let estimator = self.estimator.as_ref();
        let delay = not_negative("controller.delay_s", self.delay_s)?;
        let longest_step = longest_step(ballbot)?;
        let steps = (delay / longest_step).ceil();
        if steps > MOST_SUBSTEPS as f64 {
            return Err(ScenarioError::value(
                "controller.delay_s",
                delay,
                format!(
                    "the fastest pole asks for {} steps over the delay, at most \
                     {MOST_SUBSTEPS} can be taken",
                    text(steps)
                ),
            ));
        }
        Ok(PlaneFeedback {
            estimator: estimator
                .map(|estimator| estimator.settings(ballbot))
                .transpose()?,
            delay,
            longest_step,
            preview: self.preview,
        })
    }

    /// The controller of the plant whose input is the torque's rate, where that is bounded;
    /// `settings` are those of the plain one.
    pub(crate) fn ramp(
        &self,
        ballbot: &Ballbot<f64>,
        settings: &ballbot::ControllerSettings<f64>,
    ) -> Result<Option<RampedSettings<f64>>, ScenarioError> {
        let ramp = self.torque_rate.as_ref();
        ramp.map(|ramp| ramp.settings(&self.terminal, ballbot, settings))
            .transpose()
    }
}

/// The poles of this robot at the upright equilibrium, 1/s.
pub(crate) fn poles(ballbot: &Ballbot<f64>) -> Result<Vec<Complex<f64>>, ScenarioError> {
    let (a, _) = ballbot.matrices(&Vector3::zeros());
    lpvmpc_design::poles(&dynamic(&a))
        .map_err(|error| ScenarioError::value("parameters", "(all)", error.to_string()))
}

/// The longest step in s with which the estimator follows this robot.
fn longest_step(ballbot: &Ballbot<f64>) -> Result<f64, ScenarioError> {
    let poles = poles(ballbot)?;
    let fastest = poles.iter().map(|pole| pole.norm()).fold(1.0, f64::max);
    Ok(ESTIMATOR_STEP / fastest)
}

impl EstimatorTable {
    fn settings(&self, ballbot: &Ballbot<f64>) -> Result<EstimatorSettings<f64>, ScenarioError> {
        let variance = |key: &str, deviation: f64| {
            positive(&format!("controller.estimator.{key}"), deviation).map(|d| d * d)
        };
        let drift = |key: &str, deviation: f64| {
            not_negative(&format!("controller.estimator.{key}"), deviation).map(|d| d * d)
        };
        let mut settings = EstimatorSettings {
            longest_step: longest_step(ballbot)?,
            c: Matrix4::identity(),
            state_offset: Matrix4x2::zeros(),
            input_offset: Matrix1x2::zeros(),
            state_noise: Vector4::new(
                0.0,
                0.0,
                drift("phi_dot_drift_rad_s", self.phi_dot_drift_rad_s)?,
                drift("theta_dot_drift_rad_s", self.theta_dot_drift_rad_s)?,
            ),
            disturbance_noise: Vector2::zeros(),
            measurement_noise: Vector4::new(
                variance("phi_noise_rad", self.phi_noise_rad)?,
                variance("theta_noise_rad", self.theta_noise_rad)?,
                // A rate of the ball would be no more than its angle's difference.
                f64::INFINITY,
                variance("theta_dot_noise_rad_s", self.theta_dot_noise_rad_s)?,
            ),
            initial_state: Vector4::new(1.0, 0.1, 10.0, 1.0),
            initial_disturbance: Vector2::zeros(),
            gate: Gate {
                deviations: self.outlier_deviations,
                patience: self.outlier_patience,
                oldest: self.oldest_s,
                longest_gap: self.longest_gap_s,
            },
        };
        if !(self.outlier_deviations > 0.0) {
            return Err(ScenarioError::value(
                "controller.estimator.outlier_deviations",
                self.outlier_deviations,
                "it must be positive; inf to believe every reading",
            ));
        }
        if !(self.oldest_s >= 0.0) {
            return Err(ScenarioError::value(
                "controller.estimator.oldest_s",
                self.oldest_s,
                "it must not be negative; inf for any age",
            ));
        }
        if !(self.longest_gap_s > 0.0) {
            return Err(ScenarioError::value(
                "controller.estimator.longest_gap_s",
                self.longest_gap_s,
                "it must be positive; inf to predict for ever",
            ));
        }
        if let DisturbancesTable::TorqueAndTilt {
            torque_drift_nm,
            tilt_drift_rad,
        } = self.disturbances
        {
            let key = |name: &str| format!("disturbances.torque_and_tilt.{name}");
            settings.input_offset[0] = 1.0;
            settings.state_offset[(1, 1)] = 1.0;
            settings.disturbance_noise = Vector2::new(
                drift(&key("torque_drift_nm"), torque_drift_nm)?,
                drift(&key("tilt_drift_rad"), tilt_drift_rad)?,
            );
            settings.initial_disturbance = INITIAL_DISTURBANCE;
            check_offset_free(&settings, ballbot)?;
        }
        Ok(settings)
    }
}

/// Variances at the start: 0.1 N m and 30 mrad.
const INITIAL_DISTURBANCE: Vector2<f64> = Vector2::new(0.01, 0.0009);

/// The disturbances must be told apart at rest.
fn check_offset_free(
    settings: &EstimatorSettings<f64>,
    ballbot: &Ballbot<f64>,
) -> Result<(), ScenarioError> {
    // x_dot = A (x + E_x d) + B (u + E_u d).
    let (a, b) = ballbot.without_coulomb().matrices(&Vector3::zeros());
    let b_d = a * settings.state_offset + b * settings.input_offset;
    let [a, b_d] = [dynamic(&a), dynamic(&b_d)];
    let needed = settings.measurement_noise.map(f64::is_finite);
    let needed: Vec<usize> = (0..4).filter(|i| needed[*i]).collect();
    let c = dynamic(&settings.c).select_rows(&needed);
    let c_d = DMatrix::zeros(needed.len(), 2);
    lpvmpc_design::check_offset_free(&a, &b_d, &c, &c_d).map_err(|error| {
        ScenarioError::value(
            "controller.estimator.disturbances",
            "torque_and_tilt",
            error.to_string(),
        )
    })
}

impl TorqueRateTable {
    /// The plain controller's settings with the torque as a fifth state.
    fn settings(
        &self,
        terminal: &TerminalTable,
        ballbot: &Ballbot<f64>,
        plain: &ballbot::ControllerSettings<f64>,
    ) -> Result<RampedSettings<f64>, ScenarioError> {
        let limit = self.limit_nm_s;
        if !(limit > 0.0) {
            return Err(ScenarioError::value(
                "controller.torque_rate.limit_nm_s",
                limit,
                "it must be positive; inf for no limit",
            ));
        }
        let join = |x: &Vector4<f64>, u: f64| Vector5::new(x[0], x[1], x[2], x[3], u);
        let q = &plain.weights.q;
        let weights = Weights {
            q: Matrix5::from_diagonal(&join(&q.diagonal(), plain.weights.r[0])),
            r: Matrix1::new(positive("controller.torque_rate.weight", self.weight)?),
        };
        let terminal = match terminal {
            TerminalTable::None => TerminalIngredient::Cost(Matrix5::zeros()),
            TerminalTable::Equality => TerminalIngredient::Equality,
            TerminalTable::DiscreteRiccati | TerminalTable::Certified(_) => {
                let model = RampedInput::<_, 4>(ballbot.without_coulomb());
                let (a, b): (Matrix5<f64>, Vector5<f64>) = model.matrices(&Vector3::zeros());
                let (a, b) = plain.predictor.discretize(&a, &b, plain.t_s);
                let [a, b, q] = [dynamic(&a), dynamic(&b), dynamic(&weights.q)];
                let lqr = lpvmpc_design::lqr_discrete(&a, &b, &q, &dynamic(&weights.r))?;
                TerminalIngredient::Cost(Matrix5::from_fn(|i, j| lqr.p[(i, j)]))
            }
            TerminalTable::ContinuousRiccati { .. } | TerminalTable::Cost { .. } => {
                return Err(ScenarioError::value(
                    "controller.terminal",
                    "a matrix for four states",
                    "with controller.torque_rate the torque is a fifth state; take \
                     \"discrete_riccati\", \"equality\" or \"none\"",
                ));
            }
        };
        Ok(ControllerSettings {
            t_s: plain.t_s,
            horizon: plain.horizon,
            predictor: plain.predictor,
            weights,
            terminal,
            x: Bounds {
                lower: join(&plain.x.lower, plain.u.lower[0]),
                upper: join(&plain.x.upper, plain.u.upper[0]),
            },
            u: Bounds {
                lower: Vector1::new(-limit),
                upper: Vector1::new(limit),
            },
            // The torque's bounds are the motors' own.
            soft_x: [0, 1, 2, 3, 4].map(|i| plain.soft_x.get(i).copied().flatten()),
            raise_prices: plain.raise_prices,
            input_reference: InputReference::SteadyState,
            scheduling: plain.scheduling,
            iterations: plain.iterations,
            solver: plain.solver,
        })
    }
}

impl ShapingTable {
    /// What the ball may be asked for within the `bounds`.
    pub(crate) fn limits(
        &self,
        ballbot: &Ballbot<f64>,
        bounds: &BoundsTable,
    ) -> Result<MoveLimits<f64>, ScenarioError> {
        let tilt = self.tilt_rad;
        for (key, value, [lower, upper], bound) in [
            ("tilt_rad", tilt, bounds.theta_rad, "bounds.theta_rad"),
            (
                "phi_dot_rad_s",
                self.phi_dot_rad_s,
                bounds.phi_dot_rad_s,
                "bounds.phi_dot_rad_s",
            ),
        ] {
            let most = upper.min(-lower);
            if value > most {
                return Err(ScenarioError::value(
                    format!("controller.shaping.{key}"),
                    value,
                    format!("a move must keep {bound}, so it is at most {most}"),
                ));
            }
        }
        if !(tilt > 0.0 && tilt < FRAC_PI_2) {
            return Err(ScenarioError::value(
                "controller.shaping.tilt_rad",
                tilt,
                "it must be between 0 and pi/2 rad",
            ));
        }
        Ok(MoveLimits {
            speed: positive("controller.shaping.phi_dot_rad_s", self.phi_dot_rad_s)?,
            acceleration: ballbot.acceleration_at_tilt(tilt).abs(),
        })
    }
}

impl MotorsTable {
    /// The motors, checked.
    pub(crate) fn check(
        &self,
        turning: Turning,
        wheels: &Wheels<f64>,
    ) -> Result<ThreeMotors, ScenarioError> {
        let limits = MotorLimits {
            motor: positive("controller.motors.limit_nm", self.limit_nm)?,
            yaw: not_negative("controller.motors.yaw_reserve_nm", self.yaw_reserve_nm)?,
        };
        if limits.left(wheels).alone() > 0.0 {
            Ok(ThreeMotors { limits, turning })
        } else {
            Err(self.nothing_left())
        }
    }

    /// The part of the torque's bounds that no motor objects to: what a plane has where it
    /// `shares` what the other one leaves, else an equal part.
    pub(crate) fn within(
        &self,
        torque: &Bounds<f64, 1>,
        wheels: &Wheels<f64>,
        shares: bool,
    ) -> Result<Bounds<f64, 1>, ScenarioError> {
        let left = self.check(Turning::none(), wheels)?.limits.left(wheels);
        let equal = left.equal();
        let equal_part = Bounds {
            lower: torque.lower.map(|lower| lower.max(-equal)),
            upper: torque.upper.map(|upper| upper.min(equal)),
        };
        if !(equal_part.lower <= equal_part.upper) {
            return Err(self.nothing_left());
        }
        Ok(if shares { *torque } else { equal_part })
    }

    fn nothing_left(&self) -> ScenarioError {
        let Self {
            limit_nm,
            yaw_reserve_nm,
        } = self;
        ScenarioError::value(
            "controller.motors",
            format!("limit_nm {limit_nm}, yaw_reserve_nm {yaw_reserve_nm}"),
            "yaw and bounds.torque_nm leave no torque for the planes",
        )
    }
}
