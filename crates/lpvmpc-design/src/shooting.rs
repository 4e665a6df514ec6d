//! Output-error identification by multiple shooting: parameters of a model from measured outputs.
//!
//! The recorded runs are cut into segments. In each the model is simulated from an initial state
//! of its own, and the parameters and all initial states are chosen so that the simulated outputs
//! fit the measured ones, weighted by the noise of each output. Nothing is differentiated, so
//! noise does not become a bias; and a segment is short enough for an unstable plant, whose
//! simulation over a whole run would become non-finite (Bock 1981; Ljung, System Identification,
//! 2nd ed., ch. 7).
//!
//! An initial state touches its own segment only, so the normal equations are bordered block
//! diagonal: eliminating the states leaves one small system in the parameters, and time and memory
//! grow linearly with the number of segments.

mod block;
mod fit;
mod unknown;

use crate::number_text;
use crate::parallel::{each, each_with};
use nalgebra::{DMatrix, DVector, SVector};
use thiserror::Error;

use block::Block;

pub use fit::{ShootingFit, ShootingSettings, ShootingTermination};
pub use unknown::{Prior, Unknown};

/// What a simulation of some thousand steps is right to, relative.
const EXACT: f64 = 1e-12;

/// A model with its data: simulated outputs beside measured ones, segment by segment.
pub trait ShootingModel<const NX: usize, const NY: usize>: Sync {
    /// The number of segments.
    fn segments(&self) -> usize;

    /// The measured outputs of a segment, one per row; NaN where a value is missing.
    fn measured(&self, segment: usize) -> &[SVector<f64, NY>];

    /// Standard deviation of the noise of a segment's outputs, in the unit of each, positive.
    fn noise(&self, segment: usize) -> SVector<f64, NY>;

    /// Pushes the simulated outputs of the segment's rows to `outputs`, which is empty. The first
    /// row is that of `initial`. A simulation that becomes non-finite may stop early.
    fn simulate(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &SVector<f64, NX>,
        outputs: &mut Vec<SVector<f64, NY>>,
    );

    /// The outputs of [`ShootingModel::simulate`] with their derivatives by the initial state and by
    /// the parameters `indices`. `None` of a model that has no derivatives: they are forward
    /// differences of whole simulations then.
    fn linearized(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &SVector<f64, NX>,
        indices: &[usize],
    ) -> Option<LinearizedOutputs<NY>> {
        let _ = (segment, parameters, initial, indices);
        None
    }
}

/// Simulated outputs of a segment, and how they change.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearizedOutputs<const NY: usize> {
    /// The outputs, one per row; fewer than there are rows when the simulation leaves all bounds.
    pub outputs: Vec<SVector<f64, NY>>,
    /// Their derivatives: NY rows for each row of the segment, a column for each component of the
    /// initial state, then for each parameter. Zero where there is none.
    pub slopes: DMatrix<f64>,
}

/// A fit to be made: the model with its data, and the unknown parameters.
#[derive(Debug)]
pub struct ShootingProblem<'a, M, const NX: usize, const NY: usize> {
    /// The model with its data.
    pub model: &'a M,
    /// The parameters, in the model's order.
    pub unknowns: &'a [Unknown],
    /// What is known of them beforehand.
    pub priors: &'a [Prior],
    /// What a state is measured in: differences, where there are any, are taken over a millionth of
    /// it, positive.
    pub state_scale: SVector<f64, NX>,
}

/// A mistake in the problem.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ShootingError {
    /// There is nothing to fit, or not enough to fit it to.
    #[error(
        "{values} measured values in {segments} segments cannot determine {unknowns} unknowns: \
         {states} initial states and {parameters} parameters"
    )]
    TooFewValues {
        /// Measured values that are not missing.
        values: usize,
        /// Segments.
        segments: usize,
        /// All unknowns.
        unknowns: usize,
        /// Components of the initial states.
        states: usize,
        /// Free parameters.
        parameters: usize,
    },
    /// The number of initial states is not the number of segments.
    #[error("there are {found} initial states for {expected} segments: one each is needed")]
    InitialStates {
        /// Segments.
        expected: usize,
        /// Initial states.
        found: usize,
    },
    /// A number of the problem is out of its range.
    #[error("{what} is {value}: it must be {allowed}", value = number_text(*value))]
    Value {
        /// What it is.
        what: String,
        /// Its value.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The simulation from the start becomes non-finite.
    #[error(
        "the simulation of segment {segment} (counted from 0) from the starting values \
         becomes infinite or NaN; better starting values or shorter segments are needed"
    )]
    NonFiniteStart {
        /// The segment.
        segment: usize,
    },
}

/// The free parameters' part of the normal equations, the initial states eliminated.
#[derive(Debug, Clone, PartialEq)]
pub struct Reduced {
    /// Which parameters, by their place in the model's order.
    pub indices: Vec<usize>,
    /// Gradient of chi^2 / 2, the states at their optimum.
    pub gradient: DVector<f64>,
    /// Fisher information: its inverse is the covariance, priors included.
    pub information: DMatrix<f64>,
    /// Each segment's gradient, without the priors.
    pub scores: Vec<DVector<f64>>,
}

impl<M, const NX: usize, const NY: usize> ShootingProblem<'_, M, NX, NY>
where
    M: ShootingModel<NX, NY>,
{
    /// chi^2: the sum of squares of all residuals over their standard deviations, priors included.
    /// Not finite when a simulation is not.
    pub fn chi_square(&self, parameters: &[f64], initial: &[SVector<f64, NX>]) -> f64 {
        // Collected first, so that the sum does not depend on the number of threads.
        let segments: Vec<f64> = each_with(initial, Vec::new, |outputs, segment, initial| {
            self.segment_chi_square(segment, parameters, initial, outputs)
        });
        segments.iter().sum::<f64>() + self.prior_chi_square(parameters)
    }

    fn segment_chi_square(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &SVector<f64, NX>,
        outputs: &mut Vec<SVector<f64, NY>>,
    ) -> f64 {
        outputs.clear();
        self.model.simulate(segment, parameters, initial, outputs);
        let (measured, noise) = (self.model.measured(segment), self.model.noise(segment));
        if outputs.len() != measured.len() {
            return f64::INFINITY;
        }
        let rows = measured.iter().zip(outputs.iter());
        rows.map(|(measured, simulated)| {
            let squares = (0..NY).map(|output| {
                let residual = (measured[output] - simulated[output]) / noise[output];
                if measured[output].is_nan() {
                    0.0
                } else {
                    residual * residual
                }
            });
            squares.sum::<f64>()
        })
        .sum()
    }

    fn prior_chi_square(&self, parameters: &[f64]) -> f64 {
        let residuals = self.priors.iter().map(|prior| prior.residual(parameters));
        residuals.map(|residual| residual * residual).sum()
    }

    /// The normal equations in the parameters `indices` at the given values, whatever else is held.
    /// With the parameters that were *not* fitted among them this tells what a fit of those would
    /// change (a score test).
    pub fn reduced(
        &self,
        parameters: &[f64],
        initial: &[SVector<f64, NX>],
        indices: &[usize],
    ) -> Reduced {
        let blocks = self.blocks(parameters, initial, indices);
        self.reduced_from(&blocks, parameters, indices)
    }

    /// [`ShootingProblem::reduced`] from the segments' normal equations in these parameters.
    fn reduced_from(&self, blocks: &[Block<NX>], parameters: &[f64], indices: &[usize]) -> Reduced {
        let n = indices.len();
        let (mut information, mut gradient) = self.prior_equations(parameters, indices);
        let mut scores = Vec::with_capacity(blocks.len());
        for block in blocks {
            let (segment_information, segment_gradient) = block.eliminated(0.0);
            information += segment_information;
            gradient += &segment_gradient;
            scores.push(segment_gradient);
        }
        debug_assert_eq!(information.nrows(), n);
        Reduced {
            indices: indices.to_vec(),
            gradient,
            information,
            scores,
        }
    }

    /// The priors' part of [`Reduced::information`] in the parameters `indices`.
    pub fn prior_information(&self, parameters: &[f64], indices: &[usize]) -> DMatrix<f64> {
        self.prior_equations(parameters, indices).0
    }

    /// Measured minus simulated outputs, segment by segment; NaN where a value is missing.
    pub fn residuals(
        &self,
        parameters: &[f64],
        initial: &[SVector<f64, NX>],
    ) -> Vec<Vec<SVector<f64, NY>>> {
        let segment = |segment: usize, initial: &SVector<f64, NX>| {
            let mut outputs = Vec::new();
            self.model
                .simulate(segment, parameters, initial, &mut outputs);
            let rows = self.model.measured(segment).iter().zip(&outputs);
            rows.map(|(measured, simulated)| measured - simulated)
                .collect()
        };
        each(initial, segment)
    }

    fn blocks(
        &self,
        parameters: &[f64],
        initial: &[SVector<f64, NX>],
        indices: &[usize],
    ) -> Vec<Block<NX>> {
        let block = |segment: usize, initial: &SVector<f64, NX>| {
            Block::new(self, segment, parameters, initial, indices)
        };
        each(initial, block)
    }

    /// The priors' part of information and gradient in the parameters `indices`.
    fn prior_equations(
        &self,
        parameters: &[f64],
        indices: &[usize],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = indices.len();
        let mut information = DMatrix::zeros(n, n);
        let mut gradient = DVector::zeros(n);
        for prior in self.priors {
            let slopes = prior.slopes();
            let slope = DVector::from_iterator(n, indices.iter().map(|index| slopes[*index]));
            information += &slope * slope.transpose();
            gradient += &slope * prior.residual(parameters);
        }
        (information, gradient)
    }

    /// The chi^2 of residuals as large as rounding makes them: measured values right to [`EXACT`] of themselves.
    fn rounding(&self) -> f64 {
        let segments = (0..self.model.segments()).map(|segment| {
            let noise = self.model.noise(segment);
            let rows = self.model.measured(segment).iter();
            let errors = rows.map(|row| row.component_div(&noise) * EXACT);
            // Missing ones are NaN.
            errors
                .map(|row| row.iter().map(|e| e * e).filter(|e| *e > 0.0).sum::<f64>())
                .sum::<f64>()
        });
        segments.sum()
    }

    /// Measured values that are not missing.
    fn values(&self) -> usize {
        let segments = (0..self.model.segments()).map(|segment| {
            let rows = self.model.measured(segment).iter();
            rows.map(|row| row.iter().filter(|value| !value.is_nan()).count())
                .sum::<usize>()
        });
        segments.sum()
    }
}
