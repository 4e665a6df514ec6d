//! From recordings of one or both planes to a judged robot: the whole way.

use crate::config::Config;
use crate::covariance::correlation;
use crate::estimate::{Estimate, EstimateError, Progress, Task};
use crate::identification::Identification;
use crate::joint::{Joint, JointEstimate, PLANES};
use crate::log::{Finding, Recording, Run, WheelEncoders};
use crate::miswiring::WheelsRead;
use crate::noise;
use crate::parameter::{Choice, Parameter, Values};
use crate::residuals::{Difference, score_tests};
use crate::segments::{Split, Stretch};
use crate::structures::compare;
use crate::suspects::{Suspects, Tables};
use crate::variables::Variables;
use crate::verdict::{Verdict, Weight};
use nalgebra::{DMatrix, Vector3};

/// A robot found from recordings of one plane or of both, and what speaks for and against it.
#[derive(Clone, Debug)]
pub struct IdentifiedRobot {
    /// The robot as each plane shows it.
    pub planes: Vec<Identification>,
    /// What the planes share.
    pub variables: Variables,
    /// What of it the planes would rather have each for itself; empty for one plane.
    pub differences: Vec<Difference>,
    /// What is wrong between the planes, if no robot explains them as they are.
    pub suspects: Option<Suspects>,
    /// The wheels that were read.
    pub wheels: Option<WheelEncoders>,
    /// The covariance that the intervals are from, in the order of the variables.
    covariance: DMatrix<f64>,
}

/// A verdict with the plane it is of, where it is not of the whole robot.
pub type OfPlane = (Option<usize>, Verdict);

/// How often a usual identification tells its progress: coarse fits of three starts, the fit with its
/// noise, four structures.
pub const USUAL_STEPS: usize = 60;

/// Identifies one robot from all recordings: those planes together that the configuration names.
///
/// # Errors
/// There is too little to fit, or the robot cannot be simulated.
pub fn identify(
    recordings: Vec<Recording>,
    config: &Config,
    choices: Values<Choice>,
    progress: Progress<'_>,
) -> Result<IdentifiedRobot, EstimateError> {
    let logged = Logged::new(recordings, config);
    let tasks = logged.tasks(config, choices);
    let variables = Variables::of_robot(tasks.len(), config.fit.symmetric_body);
    let joint = Joint { tasks, variables };
    let splits = joint.tasks.iter();
    let splits: Vec<Split> = splits
        .map(|task| Split::new(task.runs, config.fit.held_back))
        .collect();
    let fitted: Vec<&[Stretch]> = splits.iter().map(|one| one.fitted.as_slice()).collect();
    let floors: Vec<Vector3<f64>> = logged.runs.iter().map(|runs| noise::floor(runs)).collect();
    let estimate = joint.estimate(&fitted, &floors, progress);
    let read = logged.wheels(config);
    let estimate = estimate.map_err(|error| explained(error, &joint, &fitted, read.as_ref()))?;
    let mut joint = joint;
    for (task, plane) in joint.tasks.iter_mut().zip(&estimate.planes) {
        task.segment = plane.segment;
    }
    let joint = joint;
    let mut robot = judged(
        config,
        &logged,
        &joint,
        estimate,
        (&splits, &floors),
        progress,
    );
    let verdicts = robot.verdicts();
    if verdicts
        .iter()
        .any(|(_, one)| one.weight() >= Weight::Warning)
    {
        for (plane, task) in robot.planes.iter_mut().zip(&joint.tasks) {
            let split = &fitted[plane.plane];
            plane.suspects = task.suspects(split);
        }
        robot.suspects = between(&joint, &fitted, read.as_ref());
    }
    Ok(robot)
}

/// What was logged, plane by plane.
struct Logged {
    runs: Vec<Vec<Run>>,
    findings: Vec<Vec<(String, Vec<Finding>)>>,
    turns: Vec<Run>,
}

impl Logged {
    fn new(recordings: Vec<Recording>, config: &Config) -> Self {
        let planes = config.log.planes().len();
        let mut logged = Self {
            runs: vec![Vec::new(); planes],
            findings: vec![Vec::new(); planes],
            turns: Vec::new(),
        };
        for recording in recordings {
            for (plane, log) in recording.planes.into_iter().enumerate() {
                logged.findings[plane].push((log.run.name.clone(), log.findings));
                logged.runs[plane].push(log.run);
            }
            logged.turns.extend(recording.turn);
        }
        logged
    }

    fn tasks(&self, config: &Config, choices: Values<Choice>) -> Vec<Task<'_>> {
        let planes = self.runs.iter().enumerate();
        planes
            .map(|(plane, runs)| {
                let mut task = Task {
                    runs,
                    ball_angle: config.log.ball_angle_read(),
                    geometry: config.geometry(),
                    choices,
                    physical: config.fit.physical,
                    segment: config.fit.segment_s,
                    torque_known: config.log.torque_known(),
                    noise: config.noise(),
                    tables: Tables {
                        second: plane > 0,
                        wheels: config.log.wheels.is_some(),
                        motors: config.log.has_motors(),
                    },
                };
                task.choices = choices.with_sensors(task.measures_rate());
                task
            })
            .collect()
    }

    /// The wheels, where all three were read for every run.
    fn wheels(&self, config: &Config) -> Option<WheelsRead<'_>> {
        let wheels = config.log.wheels.as_ref()?.wheels().ok()?;
        (self.turns.len() == self.runs[0].len()).then_some(WheelsRead {
            wheels,
            torques: config.log.has_motors(),
            turns: &self.turns,
        })
    }
}

/// The fit, plane by plane, with all that judges it but what is wrong with the columns.
fn judged(
    config: &Config,
    logged: &Logged,
    joint: &Joint<'_>,
    estimate: JointEstimate,
    (splits, floors): (&[Split], &[Vector3<f64>]),
    progress: Progress<'_>,
) -> IdentifiedRobot {
    let scores = score_tests(joint, &estimate.planes);
    let held_back: Vec<&[Stretch]> = splits.iter().map(|one| one.held_back.as_slice()).collect();
    let structures = match held_back.iter().any(|stretches| stretches.is_empty()) {
        true => vec![Vec::new(); joint.tasks.len()],
        false => compare(joint, &estimate.planes, &held_back, progress),
    };
    let JointEstimate {
        planes,
        covariance,
        scatter_covariance,
    } = estimate;
    let parts = planes.into_iter().zip(scores.held).zip(structures);
    let mut planes: Vec<Identification> = parts
        .enumerate()
        .map(|(plane, ((estimate, scores), structures))| {
            let (task, split) = (&joint.tasks[plane], &splits[plane]);
            let mut judged = Identification::new(plane, task, estimate, split, floors[plane]);
            judged.segment = config.fit.segment_s;
            judged.columns_accepted = config.log.accept_suspicious_units;
            judged.findings = logged.findings[plane].clone();
            judged.scores = scores;
            judged.structures = structures;
            judged
        })
        .collect();
    let white = planes.iter().all(Identification::is_white);
    let scatter = !white && !planes.iter().any(Identification::has_few_segments);
    let mut covariance = if scatter {
        scatter_covariance
    } else {
        covariance
    };
    let variables = joint.variables;
    for (plane, parameter) in variables.all() {
        let place = variables.place(plane, parameter);
        let alike = planes
            .iter()
            .enumerate()
            .filter(|(other, _)| variables.place(*other, parameter) == place);
        let errors = alike.map(|(_, plane)| plane.model_variance(parameter));
        covariance[(place, place)] += errors.fold(0.0, f64::max);
    }
    for (index, plane) in planes.iter_mut().enumerate() {
        plane.set_covariance(variables.part(&covariance, index));
    }
    IdentifiedRobot {
        planes,
        variables,
        differences: scores.differences,
        suspects: None,
        wheels: config.log.wheels.clone(),
        covariance,
    }
}

/// Why there is no estimate, with what is wrong with the columns if that is why.
fn explained(
    error: EstimateError,
    joint: &Joint<'_>,
    stretches: &[&[Stretch]],
    read: Option<&WheelsRead<'_>>,
) -> EstimateError {
    if error.is_too_short() {
        return error;
    }
    let planes = joint.tasks.iter().zip(stretches);
    let suspects = planes.filter_map(|(task, stretches)| task.suspects(stretches));
    let suspects = suspects.chain(between(joint, stretches, read));
    suspects.fold(error, |error, suspects| EstimateError::Suspect {
        suspects,
        error: Box::new(error),
    })
}

/// What is wrong between the planes.
fn between(
    joint: &Joint<'_>,
    stretches: &[&[Stretch]],
    read: Option<&WheelsRead<'_>>,
) -> Option<Suspects> {
    let mistakes = joint.miswirings(stretches, read);
    (!mistakes.is_empty()).then_some(Suspects {
        mistakes,
        tables: Tables::default(),
    })
}

impl IdentifiedRobot {
    /// What a plane is called, where there are two.
    pub fn plane_name(&self, plane: usize) -> Option<&'static str> {
        (self.planes.len() > 1).then_some(PLANES[plane])
    }

    /// The covariance of all variables that the intervals are from.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// The first plane's fit, or that of the only plane: of what the planes share it is the robot's.
    pub fn first(&self) -> &Identification {
        &self.planes[0]
    }

    /// The fit that all planes are of.
    pub fn estimate(&self) -> &Estimate {
        &self.first().estimate
    }

    /// Correlation of two variables, each a parameter of a plane; zero if one was held.
    pub fn correlation(&self, one: (usize, Parameter), other: (usize, Parameter)) -> f64 {
        let place = |(plane, parameter)| self.variables.place(plane, parameter);
        correlation(&self.covariance, place(one), place(other))
    }

    /// Whether all residuals of all planes are white noise.
    pub fn is_white(&self) -> bool {
        self.planes.iter().all(Identification::is_white)
    }

    /// The key of a variable, with the plane where each has its own.
    pub fn key(&self, plane: usize, parameter: Parameter) -> String {
        match self.variables.is_own(parameter) {
            true => format!("{}.{}", PLANES[plane], parameter.key()),
            false => parameter.key().to_owned(),
        }
    }

    /// What is odd about each log, of both planes once.
    pub fn findings(&self) -> Vec<(String, Vec<Finding>)> {
        let mut all = self.first().findings.clone();
        for plane in &self.planes[1..] {
            for ((_, known), (_, more)) in all.iter_mut().zip(&plane.findings) {
                let new = more.iter().filter(|finding| !known.contains(finding));
                let new: Vec<Finding> = new.cloned().collect();
                known.extend(new);
            }
        }
        all
    }

    /// All that is to be said, the gravest first, with the plane it is of where it is not of both.
    pub fn verdicts(&self) -> Vec<OfPlane> {
        let planes: Vec<Vec<Verdict>> = self.planes.iter().map(Identification::verdicts).collect();
        let [first, second] = planes.as_slice() else {
            let all = planes.into_iter().flatten();
            return all.map(|verdict| (None, verdict)).collect();
        };
        let mut all: Vec<OfPlane> = Vec::new();
        let suspects = self.suspects.clone();
        all.extend(suspects.map(|suspects| {
            let accepted = self.first().columns_accepted;
            (None, Verdict::WrongColumns { suspects, accepted })
        }));
        let difference = self.difference();
        all.extend(difference.map(|one| (None, self.first().planes_differ(one))));
        for verdict in first {
            let plane = (!second.contains(verdict)).then_some(0);
            all.push((plane, verdict.clone()));
        }
        let of_second = second.iter().filter(|verdict| !first.contains(verdict));
        all.extend(of_second.map(|verdict| (Some(1), verdict.clone())));
        if all.iter().any(|(_, one)| one.weight() == Weight::Refusal) {
            all.retain(|(_, one)| one.weight() != Weight::Good);
        }
        all.sort_by_key(|(plane, verdict)| (std::cmp::Reverse(verdict.rank()), plane.is_some()));
        all
    }

    /// The difference between the planes to look at first: each is tested alone, and one makes others
    /// alarm. Bodies are not symmetric by design, so that comes before a fault.
    fn difference(&self) -> Option<&Difference> {
        let alarms = self.differences.iter().filter(|one| one.is_alarm());
        alarms.max_by(|a, b| {
            let rank = |one: &Difference| (one.parameter == Parameter::B3, one.significance());
            rank(a)
                .partial_cmp(&rank(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
    }

    /// A verdict in words, with the plane that it is of.
    pub fn told(&self, (plane, verdict): &OfPlane) -> String {
        match plane.and_then(|plane| self.plane_name(plane)) {
            Some(name) => format!("plane {name}: {verdict}"),
            None => verdict.to_string(),
        }
    }

    /// Why this is no result; empty if it is one.
    pub fn refusals(&self) -> Vec<OfPlane> {
        let mut verdicts = self.verdicts();
        verdicts.retain(|(_, one)| one.weight() == Weight::Refusal);
        verdicts
    }
}
