//! From the scenario file to controller, plant and references: every check a person may need.

use crate::error::ScenarioError;
use crate::feedback::Feedback;
use crate::heading::Turning;
use crate::heading_table::HeadingTable;
use crate::reference::{self, PhiReference, finite};
use crate::schema::{
    BoundsTable, ControllerTable, IterationsTable, LinearModelTable, ModelKind, ParameterTable,
    PredictorTable, Scenario, StateTable, TerminalTable,
};
use crate::three_motors::Motors;
use crate::world::PlaneWorld;
use crate::world_table::PlaneName;
use crate::{
    builtin,
    run::{GUARDED_HORIZONS, LONGEST_HORIZON},
};
use ballbot::{Ballbot, Geometry, LinearParameters, Wheels};
use lpvmpc::{
    Bounds, ControllerSettings, GuardedSettings, Iterations, LpvModel, Predictor, Rk4, Scheduling,
    SolverSettings, TerminalIngredient, Weights,
};
use lpvmpc_sim::Tolerances;
use nalgebra::{DMatrix, Matrix1, Matrix4, Vector1, Vector2, Vector4};
use std::path::Path;

/// A scenario that has passed all checks.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// One line for figures and lists.
    pub title: String,
    /// Plant and prediction model.
    pub ballbot: Ballbot<f64>,
    /// The torque map to the motors.
    pub wheels: Wheels<f64>,
    /// The controller's settings.
    pub settings: ControllerSettings<f64, 4, 1, 2>,
    /// What stands around the controller.
    pub feedback: Feedback,
    /// Where the terminal set is certified: the settings of the guarded controller, which then
    /// runs. `settings` are those of the same problem without guard.
    pub guarded: Option<GuardedSettings<f64, 4, 1>>,
    /// One plane, or x and y.
    pub planes: Vec<Plane>,
    /// The three motors, where the planes share them.
    pub motors: Option<Motors>,
    /// Samples in the run.
    pub samples: usize,
    /// Tolerances of the plant.
    pub tolerances: Tolerances,
}

/// One plane of the robot.
#[derive(Clone, Debug)]
pub struct Plane {
    /// What phi has to follow.
    pub reference: PhiReference,
    /// State at time zero.
    pub initial_state: Vector4<f64>,
    /// The world that it is simulated in.
    pub world: PlaneWorld,
}

impl Plane {
    /// The state reference at the time `t` (s): phi_ref and rest, as in the paper.
    pub fn state_reference(&self, t: f64) -> Vector4<f64> {
        Vector4::new(self.reference.at(t), 0.0, 0.0, 0.0)
    }
}

impl Scenario {
    /// A built-in scenario by its name, or a scenario file by its path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`], `Read` or `Syntax`.
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        if let Some(builtin) = builtin::find(name_or_path) {
            return Self::parse(builtin.text, builtin.name);
        }
        let path = Path::new(name_or_path);
        let looks_like_a_path = path.extension().is_some() || path.components().count() > 1;
        if !path.exists() && !looks_like_a_path {
            return Err(ScenarioError::unknown(name_or_path));
        }
        let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, name_or_path)
    }

    /// A scenario from the text of a TOML file; `origin` names it in messages.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line and column.
    pub fn parse(text: &str, origin: &str) -> Result<Self, ScenarioError> {
        toml::from_str(text).map_err(|error| ScenarioError::Syntax {
            origin: origin.to_owned(),
            message: error.to_string(),
        })
    }

    /// Checks everything and works out what the file leaves to be computed. Reference files
    /// are looked for in `directory`.
    ///
    /// # Errors
    /// A [`ScenarioError`] with key, value and what would be right.
    pub fn prepare(&self, directory: &Path) -> Result<Prepared, ScenarioError> {
        let duration = positive("duration_s", self.duration_s)?;
        let ballbot = self.parameters.ballbot()?;
        let wheels = self.parameters.wheels()?;
        let bounds = self.bounds.check()?;
        let references =
            reference::resolve(&self.reference, &ballbot.geometry, duration, directory)?;
        let motors = self.motors(references.len(), &wheels)?;
        let bounds = match &self.controller.motors {
            Some(table) => (
                bounds.0,
                table.within(&bounds.1, &wheels, self.shares(&motors))?,
            ),
            None => bounds,
        };
        check_motion(&ballbot, &self.bounds)?;
        let settings = self.controller.settings(&ballbot, bounds)?;
        let guarded = self.controller.guarded(&ballbot, &settings, directory)?;
        let feedback = Feedback::new(&self.controller, &ballbot, &settings)?;
        if guarded.is_some() && !feedback.is_direct() {
            return Err(ScenarioError::value(
                "controller.terminal.certified",
                "(given)",
                "the guarantee is for the measured state and a torque that acts at once; leave \
                 estimator, delay_s and torque_rate out",
            ));
        }
        let samples = (duration / settings.t_s - 1e-9).ceil();
        if samples > MOST_SAMPLES {
            return Err(ScenarioError::value(
                "duration_s",
                duration,
                format!("at most {MOST_SAMPLES} samples of controller.t_s can be recorded"),
            ));
        }
        let references = match &self.controller.shaping {
            Some(table) => {
                let limits = table.limits(&ballbot)?;
                references
                    .into_iter()
                    .map(|plane| plane.shaped(limits))
                    .collect()
            }
            None => references,
        };
        let tolerances = Tolerances {
            relative: self.integration.relative_tolerance,
            absolute: self.integration.absolute_tolerance,
        };
        let tolerances = tolerances.check().map_err(|error| {
            ScenarioError::value(
                "integration",
                format!("{:e}, {:e}", tolerances.relative, tolerances.absolute),
                error.to_string(),
            )
        })?;
        Ok(Prepared {
            title: self.title.clone(),
            ballbot,
            wheels,
            settings,
            feedback,
            planes: self.planes(references, &ballbot, settings.t_s, tolerances)?,
            guarded,
            motors,
            samples: samples as usize,
            tolerances,
        })
    }

    /// The motors that two planes share.
    fn motors(&self, planes: usize, wheels: &Wheels<f64>) -> Result<Option<Motors>, ScenarioError> {
        match (&self.controller.motors, &self.heading) {
            (Some(motors), heading) if planes == 2 => {
                let turning = heading.as_ref().map(HeadingTable::check).transpose()?;
                motors
                    .check(turning.unwrap_or(Turning::none()), wheels)
                    .map(Some)
            }
            (_, None) => Ok(None),
            (_, Some(_)) => Err(ScenarioError::value(
                "heading",
                "(given)",
                "a robot that turns needs two planes and [controller.motors]",
            )),
        }
    }

    /// Whether a plane may have more than an equal share of the motors: neither a ramp nor a
    /// guarantee can follow bounds that change from sample to sample.
    fn shares(&self, motors: &Option<Motors>) -> bool {
        let ControllerTable {
            torque_rate,
            terminal,
            ..
        } = &self.controller;
        let certified = matches!(terminal, TerminalTable::Certified(_));
        motors.is_some() && torque_rate.is_none() && !certified
    }

    fn planes(
        &self,
        references: Vec<PhiReference>,
        ballbot: &Ballbot<f64>,
        t_s: f64,
        tolerances: Tolerances,
    ) -> Result<Vec<Plane>, ScenarioError> {
        let first = self.initial_state.check("initial_state")?;
        let second = match self.initial_state_y {
            Some(_) if references.len() == 1 => {
                return Err(ScenarioError::value(
                    "initial_state_y",
                    "(given)",
                    "the reference has one plane only; leave it out",
                ));
            }
            Some(state) => state.check("initial_state_y")?,
            None => first,
        };
        let places = [(PlaneName::X, first), (PlaneName::Y, second)];
        let planes = references.into_iter().zip(places);
        planes
            .map(|(reference, (name, initial_state))| {
                let world = match &self.world {
                    None => PlaneWorld::ideal(*ballbot, t_s, tolerances),
                    Some(table) => table.prepare(name, ballbot, t_s, tolerances)?,
                };
                // What falls over must be integrable on its way to the floor.
                check_motion(&world.robot.mechanics.ballbot, &self.bounds)?;
                Ok(Plane {
                    reference,
                    initial_state,
                    world,
                })
            })
            .collect()
    }
}

/// A run of more samples would not fit in memory with its record.
const MOST_SAMPLES: f64 = 1e7;

pub(crate) fn positive(key: &str, value: f64) -> Result<f64, ScenarioError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(ScenarioError::value(
            key,
            value,
            "it must be a positive number",
        ))
    }
}

impl ParameterTable {
    /// The robot.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] for a number that is not finite or a length that is not
    /// positive.
    pub fn ballbot(&self) -> Result<Ballbot<f64>, ScenarioError> {
        finite("parameters.b1_m2", self.b1_m2)?;
        finite("parameters.b2_m2", self.b2_m2)?;
        finite("parameters.b3_m2", self.b3_m2)?;
        finite("parameters.b4_m2_s", self.b4_m2_s)?;
        Ok(Ballbot {
            b1: self.b1_m2,
            b2: self.b2_m2,
            b3: self.b3_m2,
            b4: self.b4_m2_s,
            geometry: Geometry {
                centre_of_mass: positive("parameters.centre_of_mass_m", self.centre_of_mass_m)?,
                ball_radius: positive("parameters.ball_radius_m", self.ball_radius_m)?,
                wheel_radius: positive("parameters.wheel_radius_m", self.wheel_radius_m)?,
                gravity: positive("parameters.gravity_m_s2", self.gravity_m_s2)?,
            },
        })
    }

    fn wheels(&self) -> Result<Wheels<f64>, ScenarioError> {
        Wheels::new(self.zenith_angle_deg.to_radians()).map_err(|error| {
            ScenarioError::value(
                "parameters.zenith_angle_deg",
                self.zenith_angle_deg,
                error.to_string(),
            )
        })
    }
}

impl From<LinearModelTable> for LinearParameters<f64> {
    fn from(table: LinearModelTable) -> Self {
        let LinearModelTable {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        } = table;
        Self {
            p1,
            p2,
            p3,
            p4,
            p5,
            p6,
        }
    }
}

impl StateTable {
    fn check(&self, key: &str) -> Result<Vector4<f64>, ScenarioError> {
        finite(&format!("{key}.phi_rad"), self.phi_rad)?;
        finite(&format!("{key}.theta_rad"), self.theta_rad)?;
        finite(&format!("{key}.phi_dot_rad_s"), self.phi_dot_rad_s)?;
        finite(&format!("{key}.theta_dot_rad_s"), self.theta_dot_rad_s)?;
        Ok(Vector4::new(
            self.phi_rad,
            self.theta_rad,
            self.phi_dot_rad_s,
            self.theta_dot_rad_s,
        ))
    }
}

impl BoundsTable {
    fn check(&self) -> Result<(Bounds<f64, 4>, Bounds<f64, 1>), ScenarioError> {
        let rows = [
            ("phi_rad", self.phi_rad),
            ("theta_rad", self.theta_rad),
            ("phi_dot_rad_s", self.phi_dot_rad_s),
            ("theta_dot_rad_s", self.theta_dot_rad_s),
            ("torque_nm", self.torque_nm),
        ];
        for (key, [lower, upper]) in rows {
            // Negated, so that a bound that is not a number fails.
            if !(lower <= upper) || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
                return Err(ScenarioError::value(
                    format!("bounds.{key}"),
                    format!("[{lower}, {upper}]"),
                    "the lower bound must not be above the upper one; use -inf and inf for none",
                ));
            }
        }
        let side = |i: usize| {
            Vector4::new(
                self.phi_rad[i],
                self.theta_rad[i],
                self.phi_dot_rad_s[i],
                self.theta_dot_rad_s[i],
            )
        };
        let x = Bounds {
            lower: side(0),
            upper: side(1),
        };
        let u = Bounds {
            lower: Vector1::new(self.torque_nm[0]),
            upper: Vector1::new(self.torque_nm[1]),
        };
        Ok((x, u))
    }
}

/// The equations of motion must have a solution at every tilt within the bounds.
fn check_motion(ballbot: &Ballbot<f64>, bounds: &BoundsTable) -> Result<(), ScenarioError> {
    let [lower, upper] = bounds.theta_rad;
    let tilt = lower.abs().max(upper.abs()).min(std::f64::consts::PI);
    let consistency = ballbot.consistency(tilt);
    if consistency.mass_invertible {
        Ok(())
    } else {
        Err(ScenarioError::Parameters(consistency.to_string()))
    }
}

fn check_weights(table: &ControllerTable) -> Result<(), ScenarioError> {
    for (i, weight) in table.q.iter().enumerate() {
        if !(*weight >= 0.0 && weight.is_finite()) {
            return Err(ScenarioError::value(
                format!("controller.q[{i}]"),
                weight,
                "a state weight must be zero or positive",
            ));
        }
    }
    positive("controller.r", table.r)?;
    positive("controller.t_s", table.t_s)?;
    if table.horizon == 0 || table.horizon > LONGEST_HORIZON {
        return Err(ScenarioError::value(
            "controller.horizon",
            table.horizon,
            format!(
                "it must be from 1 to {LONGEST_HORIZON} samples (the library itself takes any \
                 compile-time size)"
            ),
        ));
    }
    Ok(())
}

impl ControllerTable {
    fn settings(
        &self,
        ballbot: &Ballbot<f64>,
        (x, u): (Bounds<f64, 4>, Bounds<f64, 1>),
    ) -> Result<ControllerSettings<f64, 4, 1, 2>, ScenarioError> {
        check_weights(self)?;
        let weights = Weights {
            q: Matrix4::from_diagonal(&Vector4::from(self.q)),
            r: Matrix1::new(self.r),
        };
        let upright = ballbot.matrices(&Vector2::zeros());
        let predictor = self.predictor(&upright.0)?;
        let terminal = self.terminal(upright, &weights, predictor)?;
        let scheduling = match self.model {
            ModelKind::Lpv => Scheduling::Predicted,
            ModelKind::Linear => Scheduling::Held(Vector2::zeros()),
        };
        Ok(ControllerSettings {
            t_s: self.t_s,
            horizon: self.horizon,
            predictor,
            weights,
            terminal,
            x,
            u,
            scheduling,
            iterations: self.iterations(),
            solver: SolverSettings::default(),
        })
    }

    fn iterations(&self) -> Iterations<f64> {
        match self.iterations {
            None => Iterations::Fixed(1),
            Some(IterationsTable::Fixed(most)) => Iterations::Fixed(most),
            Some(IterationsTable::UntilConverged { tolerance, most }) => {
                Iterations::UntilConverged { tolerance, most }
            }
        }
    }

    fn guarded(
        &self,
        ballbot: &Ballbot<f64>,
        settings: &ControllerSettings<f64, 4, 1, 2>,
        directory: &Path,
    ) -> Result<Option<GuardedSettings<f64, 4, 1>>, ScenarioError> {
        let TerminalTable::Certified(table) = &self.terminal else {
            return Ok(None);
        };
        if self.model == ModelKind::Linear {
            return Err(ScenarioError::value(
                "controller.model",
                "linear",
                "a guarantee needs the nonlinear prediction, \"lpv\"",
            ));
        }
        let guarded = table.settings(ballbot, settings, directory)?;
        if !GUARDED_HORIZONS.contains(&self.horizon) {
            return Err(ScenarioError::value(
                "controller.horizon",
                self.horizon,
                format!(
                    "with a certified terminal set it must be one of {GUARDED_HORIZONS:?} samples \
                     (the library itself takes any compile-time size)"
                ),
            ));
        }
        Ok(Some(guarded))
    }

    fn predictor(&self, upright: &Matrix4<f64>) -> Result<Predictor, ScenarioError> {
        let a = dynamic(upright);
        let default = PredictorTable::StageConsistent { substeps: None };
        let table = self.predictor.unwrap_or(default);
        let (kind, given, key): (fn(Rk4) -> Predictor, _, _) = match table {
            PredictorTable::Rk4 { substeps } => (Predictor::FrozenRk4, Some(substeps), "rk4"),
            PredictorTable::Exact { substeps } => (Predictor::FrozenExact, substeps, "exact"),
            PredictorTable::StageConsistent { substeps } => {
                (Predictor::StageConsistent, substeps, "stage_consistent")
            }
        };
        let substeps = match given {
            Some(0) => {
                return Err(ScenarioError::value(
                    format!("controller.predictor.{key}.substeps"),
                    0,
                    "at least one step per sample is needed",
                ));
            }
            Some(substeps) => substeps,
            None => {
                let poles = lpvmpc_design::poles(&a).map_err(|error| {
                    ScenarioError::value("parameters", "(all)", error.to_string())
                })?;
                let fastest = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
                (self.t_s * fastest / ACCURATE_STEP).ceil().max(1.0) as usize
            }
        };
        lpvmpc_design::check_rk4_step(&a, self.t_s, substeps)?;
        Ok(kind(Rk4 { substeps }))
    }

    fn terminal(
        &self,
        (a, b): (Matrix4<f64>, Vector4<f64>),
        weights: &Weights<f64, 4, 1>,
        predictor: Predictor,
    ) -> Result<TerminalIngredient<f64, 4>, ScenarioError> {
        let q = dynamic(&weights.q);
        let r = DMatrix::from_element(1, 1, weights.r[0]);
        let cost = |p: DMatrix<f64>| TerminalIngredient::Cost(Matrix4::from_fn(|i, j| p[(i, j)]));
        Ok(match &self.terminal {
            TerminalTable::None => TerminalIngredient::Cost(Matrix4::zeros()),
            TerminalTable::Equality => TerminalIngredient::Equality,
            // The certified cost is the guarded controller's; without guard it is as by default.
            TerminalTable::DiscreteRiccati | TerminalTable::Certified(_) => {
                let (a_d, b_d) = predictor.discretize(&a, &b, self.t_s);
                cost(lpvmpc_design::lqr_discrete(&dynamic(&a_d), &dynamic(&b_d), &q, &r)?.p)
            }
            TerminalTable::ContinuousRiccati { linear_model } => {
                let (a, b) = match linear_model {
                    Some(table) => LinearParameters::from(*table).matrices(),
                    None => (a, b),
                };
                cost(lpvmpc_design::lqr_continuous(&dynamic(&a), &dynamic(&b), &q, &r)?.p)
            }
            TerminalTable::Cost { p } => TerminalIngredient::Cost(Matrix4::from_fn(|i, j| p[i][j])),
        })
    }
}

/// |step * fastest pole| that the predictor stays below when it is left to choose.
const ACCURATE_STEP: f64 = 0.7;

pub(crate) fn dynamic<const R: usize, const C: usize>(
    m: &nalgebra::SMatrix<f64, R, C>,
) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| m[(i, j)])
}
