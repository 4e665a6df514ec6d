//! From the scenario file to controller, plant and references: every check a person may need.

use crate::error::ScenarioError;
use crate::file::heading_table::HeadingTable;
use crate::file::schema::{ControllerTable, Scenario, StateTable, TerminalTable};
use crate::file::world_table::PlaneName;
use crate::number::{finite, positive};
use crate::prepare::files::Files;
use crate::prepare::heading::Turning;
use crate::prepare::parameters::check_motion;
use crate::prepare::reference::{self, PhiReference};
use crate::prepare::standing::Standing;
use crate::prepare::three_motors::ThreeMotors;
use crate::prepare::world::{ONE_PLANE, PlaneWorld};
use ballbot::{Ballbot, GuaranteedSettings, PlaneFeedback, PlanePlanner, RampedSettings, Wheels};
use lpvmpc::MoveLimits;
use lpvmpc_sim::Tolerances;
use nalgebra::Vector4;

/// A scenario that has passed all checks.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// One line for figures and lists.
    pub title: String,
    /// The prediction model.
    pub ballbot: Ballbot<f64>,
    /// The torque map to the motors that the controller counts on.
    pub wheels: Wheels<f64>,
    /// The controller's settings; those of the plain problem where another one is posed.
    pub settings: ballbot::ControllerSettings<f64>,
    /// Which problem is posed.
    pub problem: Problem,
    /// The feedback pipeline around the controller.
    pub feedback: PlaneFeedback,
    /// What is known of the certificate that this rests on.
    pub certificate: Option<Standing>,
    /// One plane, or x and y.
    pub planes: Vec<Plane>,
    /// The three motors, where the planes share them.
    pub motors: Option<ThreeMotors>,
    /// Where set points become smooth moves: what these may ask for.
    pub moves: Option<MoveLimits<f64>>,
    /// Samples in the run.
    pub samples: usize,
    /// Tolerances of the plant.
    pub tolerances: Tolerances,
}

/// What a plane's controller plans.
#[derive(Clone, Debug)]
pub enum Problem {
    /// The torque, held over a sample.
    Plain,
    /// The torque's rate, which is bounded.
    Ramped(RampedSettings<f64>),
    /// The torque, with a certified terminal set.
    Guaranteed(GuaranteedSettings<f64>),
}

impl Prepared {
    /// When the run ends, s.
    pub fn end(&self) -> f64 {
        self.samples as f64 * self.settings.t_s
    }

    /// The settings of the guaranteed controller, where that runs.
    pub fn guaranteed(&self) -> Option<&GuaranteedSettings<f64>> {
        match &self.problem {
            Problem::Guaranteed(settings) => Some(settings),
            Problem::Plain | Problem::Ramped(_) => None,
        }
    }

    /// What a plane's regulator plans with.
    pub(crate) fn planner(&self) -> PlanePlanner {
        match &self.problem {
            Problem::Plain => PlanePlanner::Held(self.settings),
            Problem::Ramped(settings) => PlanePlanner::Ramped(*settings),
            Problem::Guaranteed(settings) => PlanePlanner::Guaranteed(*settings),
        }
    }
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
    /// Checks everything and works out what the file leaves to be computed. Files that
    /// it names are looked for in `files`, a folder as a rule.
    ///
    /// # Errors
    /// A [`ScenarioError`] with key, value and what would be right.
    pub fn prepare(&self, files: impl Files) -> Result<Prepared, ScenarioError> {
        self.prepare_with(&files)
    }

    fn prepare_with(&self, files: &dyn Files) -> Result<Prepared, ScenarioError> {
        let duration = positive("duration_s", self.duration_s)?;
        self.check_plausible()?;
        let model = self.parameters.read("parameters", files)?;
        self.check_robot("parameters", &model)?;
        let (ballbot, wheels) = (model.ballbot, model.wheels);
        let real = match &self.world {
            Some(world) => {
                let check = |robot: &_| self.check_robot("world.parameters", robot);
                world.real_robot(&model, check, files)?
            }
            None => (ballbot, wheels),
        };
        let bounds = self.bounds.check()?;
        let references = reference::resolve(&self.reference, &ballbot.geometry, duration, files)?;
        for reference in &references {
            self.check_reference("reference (csv)", reference)?;
        }
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
        let guaranteed = self.controller.guaranteed(&ballbot, &settings, files)?;
        let feedback = self.controller.feedback(&ballbot)?;
        let ramp = self.controller.ramp(&ballbot, &settings)?;
        let direct = feedback.estimator.is_none() && feedback.delay == 0.0;
        if guaranteed.is_some() && !(direct && ramp.is_none()) {
            return Err(ScenarioError::value(
                "controller.terminal.certified",
                "(given)",
                "the guarantee is for the measured state and a torque that acts at once; leave \
                 estimator, delay_s and torque_rate out",
            ));
        }
        let samples = (duration / settings.t_s - 1e-9).ceil();
        if !(samples >= 1.0) {
            return Err(ScenarioError::value(
                "duration_s",
                duration,
                "it must be at least one sample, of controller.t_s",
            ));
        }
        if samples > MOST_SAMPLES {
            return Err(ScenarioError::value(
                "duration_s",
                duration,
                format!("at most {MOST_SAMPLES} samples of controller.t_s can be recorded"),
            ));
        }
        let shaping = self.controller.shaping.as_ref();
        let moves = shaping
            .map(|table| table.limits(&ballbot, &self.bounds))
            .transpose()?;
        let references = match moves {
            Some(limits) => {
                let planes = references.into_iter();
                planes.map(|plane| plane.shaped(limits)).collect()
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
        let planes = self.planes(references, &real, (settings.t_s, tolerances), files)?;
        // After all that is cheap to check.
        let certificate = guaranteed.as_ref().map(|found| found.standing(files));
        let problem = match (guaranteed, ramp) {
            (Some(found), _) => Problem::Guaranteed(found.settings),
            (None, Some(settings)) => Problem::Ramped(settings),
            (None, None) => Problem::Plain,
        };
        Ok(Prepared {
            title: self.title.clone(),
            ballbot,
            wheels,
            settings,
            problem,
            feedback,
            planes,
            certificate: certificate.transpose()?,
            motors,
            moves,
            samples: samples as usize,
            tolerances,
        })
    }

    /// The motors that two planes share.
    fn motors(
        &self,
        planes: usize,
        wheels: &Wheels<f64>,
    ) -> Result<Option<ThreeMotors>, ScenarioError> {
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
    fn shares(&self, motors: &Option<ThreeMotors>) -> bool {
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
        robot: &(Ballbot<f64>, Wheels<f64>),
        (t_s, tolerances): (f64, Tolerances),
        files: &dyn Files,
    ) -> Result<Vec<Plane>, ScenarioError> {
        let one_plane = references.len() == 1;
        if let (true, Some(world)) = (one_plane, &self.world) {
            world.check_one_plane()?;
        }
        let first = self.initial_state.check("initial_state")?;
        let second = match self.initial_state_y {
            Some(_) if one_plane => {
                return Err(ScenarioError::value(
                    "initial_state_y",
                    "(given)",
                    ONE_PLANE,
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
                    None => PlaneWorld::ideal(*robot, t_s, tolerances),
                    Some(table) => table.prepare(name, robot, t_s, tolerances, files)?,
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
