//! One fit of all planes that were logged: their segments side by side, what they share once.

use crate::coordinates::Coordinates;
use crate::covariance::covariances;
use crate::estimate::{COARSE, Estimate, EstimateError, Progress, START, Status, Task, problem};
use crate::model::{Segment, SegmentedRuns};
use crate::parameter::{Parameter, Values};
use crate::residuals::repetition;
use crate::segments::{Stretch, segments, spread};
use crate::variables::Variables;
use lpvmpc_design::{
    LinearizedOutputs, Prior, ShootingError, ShootingFit, ShootingModel, ShootingSettings, Unknown,
};
use nalgebra::{DMatrix, Vector3, Vector4};

/// Times that the noise is found anew from the residuals, at most.
const REWEIGHTINGS: usize = 6;

/// Steps of each fit after the first, which begins where that ended.
const STEPS_AGAIN: usize = 30;

/// Rows that are fitted, at most, to within a segment, those of each plane counted: of a longer log
/// segments that are spread evenly over it. Errors fall with the root of the rows, and at a hundred
/// thousand they are those of the model.
const MOST_ROWS: usize = 200_000;

/// The planes that are fitted together.
#[derive(Clone, Debug)]
pub struct Joint<'a> {
    /// Each plane by itself. Only choices about what is a plane's own may differ.
    pub tasks: Vec<Task<'a>>,
    /// What they share.
    pub variables: Variables,
}

/// A fitted robot, as all planes together show it.
#[derive(Clone, Debug)]
pub struct JointEstimate {
    /// Plane by plane.
    pub planes: Vec<Estimate>,
    /// Covariance of all variables from the information of the fit; see [`Estimate::covariance`].
    pub covariance: DMatrix<f64>,
    /// The same from the scatter of the segments; see [`Estimate::scatter_covariance`].
    pub scatter_covariance: DMatrix<f64>,
}

impl JointEstimate {
    /// What the first plane shows, or the only one.
    pub(crate) fn first(mut self) -> Estimate {
        self.planes.swap_remove(0)
    }
}

impl<'a> Joint<'a> {
    /// A single plane.
    pub fn alone(task: Task<'a>) -> Self {
        Self {
            tasks: vec![task],
            variables: Variables::of_robot(1, true),
        }
    }

    /// Fits the robot to each plane's stretches; `floors` is each plane's noise to begin with. What
    /// the planes share starts from the plane that a coarse fit explains better.
    ///
    /// # Errors
    /// [`EstimateError`].
    pub fn estimate(
        &self,
        stretches: &[&[Stretch]],
        floors: &[Vector3<f64>],
        progress: Progress<'_>,
    ) -> Result<JointEstimate, EstimateError> {
        let mut coarse = Vec::new();
        for (plane, task) in self.tasks.iter().enumerate() {
            let fit = task.coarse(stretches[plane], floors[plane], START, progress);
            coarse.push(fit.map_err(|error| self.of_plane(plane, error))?);
        }
        let best = (1..coarse.len()).fold(0, |best, plane| {
            let better = coarse[plane].chi_square < coarse[best].chi_square;
            if better { plane } else { best }
        });
        let starts = coarse.iter().map(|own| {
            Values(
                Parameter::ALL.map(|parameter| match self.variables.is_own(parameter) {
                    true => own.values[parameter],
                    false => coarse[best].values[parameter],
                }),
            )
        });
        self.refine(&starts.collect::<Vec<_>>(), stretches, floors, progress)
    }

    /// The error of a plane, which is named if there are several.
    fn of_plane(&self, plane: usize, error: EstimateError) -> EstimateError {
        match self.tasks.len() {
            1 => error,
            _ => EstimateError::Plane {
                plane: PLANES[plane],
                error: Box::new(error),
            },
        }
    }

    /// Fits the robot to each plane's stretches from a start.
    fn refine(
        &self,
        starts: &[Values],
        stretches: &[&[Stretch]],
        floors: &[Vector3<f64>],
        progress: Progress<'_>,
    ) -> Result<JointEstimate, EstimateError> {
        let mut length = self
            .tasks
            .iter()
            .map(|task| task.segment)
            .fold(0.0, f64::max);
        let most = MOST_ROWS / self.tasks.len();
        loop {
            let mut joint = self.clone();
            let mut cut = Vec::new();
            for (task, stretches) in joint.tasks.iter_mut().zip(stretches) {
                task.segment = length;
                let segments = segments(task.runs, stretches, length, task.lead());
                let rows: usize = segments.iter().map(|one| one.end - one.first).sum();
                cut.push(spread(&segments, segments.len() * most / rows.max(most)));
            }
            match joint.estimate_from(starts, cut, floors, progress) {
                // A wrong model can be so unstable that a segment is too long for it.
                Err(EstimateError::Shooting(ShootingError::NonFiniteStart { .. }))
                    if length > COARSE =>
                {
                    length = (0.5 * length).max(COARSE);
                }
                result => return result,
            }
        }
    }

    /// Fits the robot to each plane's segments from a start.
    ///
    /// # Errors
    /// [`EstimateError`].
    pub fn estimate_from(
        &self,
        starts: &[Values],
        segments: Vec<Vec<Segment>>,
        floors: &[Vector3<f64>],
        progress: Progress<'_>,
    ) -> Result<JointEstimate, EstimateError> {
        for (plane, task) in self.tasks.iter().enumerate() {
            if segments[plane].is_empty() {
                let error = EstimateError::NoSegments {
                    segment: task.segment,
                    lead: task.lead(),
                };
                return Err(self.of_plane(plane, error));
            }
        }
        let mut model = self.model(segments, floors);
        let mut initial = model.initial_states(starts);
        let mut unknowns = self.unknowns(starts, &model);
        let priors = self.priors(&model, self.variables);
        let mut rounds = 0;
        let mut settings = ShootingSettings::default();
        let (fit, spreads) = loop {
            let problem = problem(&model, &unknowns, &priors);
            let fit = problem.fit(initial, &settings, progress)?;
            let residuals = problem.residuals(&fit.parameters, &fit.initial);
            let (mut spreads, mut noises, mut change) = (Vec::new(), Vec::new(), 0.0_f64);
            for (plane, task) in self.tasks.iter().enumerate() {
                let (residuals, noise) =
                    (&residuals[model.range(plane)], model.planes[plane].noise);
                let spread = residual_noise(residuals, &fit, noise);
                let coloured = spread.component_mul(&repetition(residuals).map(f64::sqrt));
                // Contacts give way and gears have play: of the three it is the ball angle whose
                // errors repeat themselves while the robot is as it should be.
                let next = task.known(Vector3::new(coloured[0], spread[1], spread[2]));
                let changes = next.component_div(&noise).map(|ratio| (ratio - 1.0).abs());
                change = change.max(changes.max());
                spreads.push((spread, task.known(coloured)));
                noises.push(next);
            }
            rounds += 1;
            if change < 0.01 || rounds > REWEIGHTINGS {
                break (fit, spreads);
            }
            for (plane, noise) in model.planes.iter_mut().zip(noises) {
                plane.noise = noise;
            }
            settings.max_iterations = STEPS_AGAIN;
            for (unknown, value) in unknowns.iter_mut().zip(&fit.parameters) {
                unknown.start = *value;
            }
            initial = fit.initial;
        };
        let weights: Vec<Vector3<f64>> = model.planes.iter().map(|plane| plane.noise).collect();
        for (plane, (_, coloured)) in model.planes.iter_mut().zip(&spreads) {
            plane.noise = *coloured;
        }
        let problem = problem(&model, &unknowns, &priors);
        let coordinates: Vec<Coordinates> =
            model.planes.iter().map(|plane| plane.coordinates).collect();
        let jacobian = self.variables.jacobian(&coordinates);
        let (covariance, scatter_covariance) = covariances(&problem, &fit, &jacobian);
        let planes = (0..self.tasks.len()).map(|plane| {
            let own = model.parameters(plane, &fit.parameters);
            let SegmentedRuns {
                segments,
                coordinates,
                ..
            } = &model.planes[plane];
            Estimate {
                values: coordinates.values(&own),
                covariance: self.variables.part(&covariance, plane),
                scatter_covariance: self.variables.part(&scatter_covariance, plane),
                status: self.status(plane, &fit),
                spread: spreads[plane].0,
                noise: weights[plane],
                coordinates: own.to_vec(),
                segments: segments.clone(),
                initial: fit.initial[model.range(plane)].to_vec(),
                segment: self.tasks[plane].segment,
                fit: fit.clone(),
            }
        });
        Ok(JointEstimate {
            planes: planes.collect(),
            covariance,
            scatter_covariance,
        })
    }

    /// The planes' segments as data of one fit.
    pub(crate) fn model(
        &self,
        segments: Vec<Vec<Segment>>,
        noises: &[Vector3<f64>],
    ) -> SegmentedPlanes<'_> {
        let planes = self.tasks.iter().zip(segments).zip(noises);
        SegmentedPlanes {
            planes: planes
                .map(|((task, segments), noise)| task.model(segments, task.known(*noise)))
                .collect(),
            variables: self.variables,
        }
    }

    /// The unknowns of the fit; see [`Task::unknowns`].
    pub(crate) fn unknowns(&self, starts: &[Values], model: &SegmentedPlanes<'_>) -> Vec<Unknown> {
        let planes = self.tasks.iter().zip(starts).zip(&model.planes);
        let planes: Vec<Vec<Unknown>> = planes
            .map(|((task, start), plane)| task.unknowns(start, &plane.coordinates))
            .collect();
        let all = model.variables.all();
        all.map(|(plane, parameter)| planes[plane][parameter.index()])
            .collect()
    }

    /// What is known beforehand, of each of the robot's variables once, as priors of the variables
    /// `of`.
    pub(crate) fn priors(&self, model: &SegmentedPlanes<'_>, of: Variables) -> Vec<Prior> {
        let all = self.variables.all();
        all.filter_map(|(plane, parameter)| {
            let coordinates = &model.planes[plane].coordinates;
            let prior = self.tasks[plane].prior(parameter, coordinates)?;
            let mut coefficients = vec![0.0; of.count()];
            for (place, coefficient) in of.places(plane).0.into_iter().zip(prior.coefficients) {
                coefficients[place] = coefficient;
            }
            Some(Prior {
                coefficients,
                ..prior
            })
        })
        .collect()
    }

    fn status(&self, plane: usize, fit: &ShootingFit<4>) -> Values<Status> {
        Values(Parameter::ALL.map(|parameter| {
            let place = self.variables.place(plane, parameter);
            if fit.reduced.indices.contains(&place) {
                Status::Found
            } else if self.tasks[plane].choices[parameter].is_free() {
                Status::AtBound
            } else {
                Status::Held
            }
        }))
    }
}

/// What the planes of a log are called.
pub const PLANES: [&str; 2] = ["x", "y"];

/// The segments of all planes, one plane's after the other's.
#[derive(Clone, Debug)]
pub(crate) struct SegmentedPlanes<'a> {
    pub(crate) planes: Vec<SegmentedRuns<'a>>,
    /// What the fit's parameters are of each plane.
    pub(crate) variables: Variables,
}

impl SegmentedPlanes<'_> {
    /// The places of a plane's segments.
    fn range(&self, plane: usize) -> std::ops::Range<usize> {
        let before = self.planes[..plane].iter();
        let start = before.map(|plane| plane.segments.len()).sum();
        start..start + self.planes[plane].segments.len()
    }

    /// The coordinates of a plane among those of the fit.
    fn parameters(&self, plane: usize, all: &[f64]) -> [f64; Parameter::ALL.len()] {
        self.variables.places(plane).0.map(|place| all[place])
    }

    /// The plane that a segment is of, and which of its segments it is.
    fn locate(&self, segment: usize) -> (usize, usize) {
        let mut rest = segment;
        for (plane, runs) in self.planes.iter().enumerate() {
            if rest < runs.segments.len() {
                return (plane, rest);
            }
            rest -= runs.segments.len();
        }
        // Past the last segment, which no fit asks for.
        (self.planes.len() - 1, rest)
    }

    fn initial_states(&self, values: &[Values]) -> Vec<Vector4<f64>> {
        let planes = self.planes.iter().zip(values);
        planes
            .flat_map(|(plane, values)| plane.initial_states(values))
            .collect()
    }
}

impl ShootingModel<4, 3> for SegmentedPlanes<'_> {
    fn segments(&self) -> usize {
        self.planes.iter().map(|plane| plane.segments.len()).sum()
    }

    fn measured(&self, segment: usize) -> &[Vector3<f64>] {
        let (plane, segment) = self.locate(segment);
        self.planes[plane].measured(segment)
    }

    fn noise(&self, segment: usize) -> Vector3<f64> {
        self.planes[self.locate(segment).0].noise
    }

    fn simulate(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        outputs: &mut Vec<Vector3<f64>>,
    ) {
        let (plane, segment) = self.locate(segment);
        let parameters = self.parameters(plane, parameters);
        self.planes[plane].simulate(segment, &parameters, initial, outputs);
    }

    fn linearized(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        indices: &[usize],
    ) -> Option<LinearizedOutputs<3>> {
        let (plane, segment) = self.locate(segment);
        let own = self.parameters(plane, parameters);
        let places = self.variables.places(plane);
        // What is another plane's own has no effect here.
        let of_plane = indices.iter().map(|index| {
            let mut parameters = Parameter::ALL.into_iter();
            parameters.find(|parameter| places[*parameter] == *index)
        });
        let of_plane: Vec<Option<Parameter>> = of_plane.collect();
        Some(self.planes[plane].derivatives(segment, &own, initial, &of_plane))
    }
}

/// Standard deviation of the residuals of each output; what it was for one that is not measured.
fn residual_noise(
    residuals: &[Vec<Vector3<f64>>],
    fit: &ShootingFit<4>,
    noise: Vector3<f64>,
) -> Vector3<f64> {
    let lost = fit.values as f64 / fit.degrees_of_freedom().max(1.0);
    Vector3::from_fn(|output, _| {
        let values = residuals.iter().flatten().map(|row| row[output]);
        let (sum, count) = values
            .filter(|value| !value.is_nan())
            .fold((0.0, 0), |(sum, count), value| {
                (sum + value * value, count + 1)
            });
        if count == 0 || sum == 0.0 {
            return noise[output];
        }
        (sum / f64::from(count) * lost).sqrt()
    })
}
