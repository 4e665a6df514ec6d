//! The normal equations of one segment: its initial state beside the parameters.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::{LinearizedOutputs, ShootingModel, ShootingProblem};

/// Differences are taken over this part of a scale: the truncation, about this part of the slope,
/// and the rounding, 1e-16 / 1e-6 of the value, are then both far below the noise of any data.
const DIFFERENCE: f64 = 1e-6;

/// Outputs with derivatives by forward differences of whole simulations.
fn differences<M, const NX: usize, const NY: usize>(
    problem: &ShootingProblem<'_, M, NX, NY>,
    segment: usize,
    parameters: &[f64],
    initial: &SVector<f64, NX>,
    indices: &[usize],
) -> LinearizedOutputs<NY>
where
    M: ShootingModel<NX, NY>,
{
    let simulated = |parameters: &[f64], initial: &SVector<f64, NX>| {
        let mut outputs = Vec::new();
        let model = problem.model;
        model.simulate(segment, parameters, initial, &mut outputs);
        outputs
    };
    let outputs = simulated(parameters, initial);
    let rows = problem.model.measured(segment).len();
    let mut slopes = DMatrix::zeros(rows * NY, NX + indices.len());
    let mut fill = |column: usize, moved: Vec<SVector<f64, NY>>, step: f64| {
        for (row, (moved, base)) in moved.iter().zip(&outputs).enumerate() {
            let slope = (moved - base) / step;
            slopes
                .view_mut((row * NY, column), (NY, 1))
                .copy_from(&slope);
        }
    };
    for state in 0..NX {
        let mut moved = *initial;
        moved[state] += DIFFERENCE * problem.state_scale[state];
        let step = moved[state] - initial[state];
        fill(state, simulated(parameters, &moved), step);
    }
    for (place, &index) in indices.iter().enumerate() {
        let unknown = &problem.unknowns[index];
        // Away from an upper bound, so that no bound is left.
        let wanted = DIFFERENCE * unknown.scale;
        let up = parameters[index] + wanted <= unknown.upper;
        let mut moved = parameters.to_vec();
        moved[index] += if up { wanted } else { -wanted };
        let step = moved[index] - parameters[index];
        fill(NX + place, simulated(&moved, initial), step);
    }
    LinearizedOutputs { outputs, slopes }
}

/// A' A, each product of two columns taken once.
fn square(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut square = DMatrix::zeros(a.ncols(), a.ncols());
    for j in 0..a.ncols() {
        for i in 0..=j {
            square[(i, j)] = a.column(i).dot(&a.column(j));
            square[(j, i)] = square[(i, j)];
        }
    }
    square
}

/// Gauss-Newton normal equations of chi^2 / 2 of one segment, in (initial state, parameters).
#[derive(Debug, Clone)]
pub(super) struct Block<const NX: usize> {
    states: SMatrix<f64, NX, NX>,
    /// NX x parameters.
    mixed: DMatrix<f64>,
    parameters: DMatrix<f64>,
    state_gradient: SVector<f64, NX>,
    parameter_gradient: DVector<f64>,
}

impl<const NX: usize> Block<NX> {
    /// From the outputs at these parameters and this initial state, with their derivatives.
    pub(super) fn new<M, const NY: usize>(
        problem: &ShootingProblem<'_, M, NX, NY>,
        segment: usize,
        parameters: &[f64],
        initial: &SVector<f64, NX>,
        indices: &[usize],
    ) -> Self
    where
        M: ShootingModel<NX, NY>,
    {
        let measured = problem.model.measured(segment);
        let noise = problem.model.noise(segment);
        let LinearizedOutputs { outputs, slopes } = problem
            .model
            .linearized(segment, parameters, initial, indices)
            .unwrap_or_else(|| differences(problem, segment, parameters, initial, indices));
        // The last column is the residual.
        let columns = NX + indices.len();
        let mut jacobian = slopes.insert_column(columns, 0.0);
        let rows = outputs.iter().zip(measured).enumerate();
        for (row, (output, measured)) in rows {
            for place in 0..NY {
                jacobian[(row * NY + place, columns)] = output[place] - measured[place];
            }
        }
        // What was not measured has no weight.
        let weights: Vec<f64> = measured
            .iter()
            .flat_map(|row| (0..NY).map(|output| (row[output], noise[output])))
            .map(|(value, noise)| if value.is_nan() { 0.0 } else { 1.0 / noise })
            .collect();
        for mut column in jacobian.column_iter_mut() {
            for (entry, weight) in column.iter_mut().zip(&weights) {
                *entry = if *weight > 0.0 { *entry * weight } else { 0.0 };
            }
        }
        Self::from_normal_equations(&square(&jacobian), indices.len())
    }

    /// From [J F]'[J F] with the columns (states, parameters, residual).
    fn from_normal_equations(square: &DMatrix<f64>, n: usize) -> Self {
        let last = NX + n;
        Self {
            states: square.fixed_view::<NX, NX>(0, 0).into_owned(),
            mixed: square.view((0, NX), (NX, n)).into_owned(),
            parameters: square.view((NX, NX), (n, n)).into_owned(),
            state_gradient: square.fixed_view::<NX, 1>(0, last).into_owned(),
            parameter_gradient: square.view((NX, last), (n, 1)).column(0).into_owned(),
        }
    }

    /// Those of the parameters at these places alone, the others held.
    pub(super) fn of(&self, places: &[usize]) -> Self {
        Self {
            states: self.states,
            mixed: self.mixed.select_columns(places),
            parameters: self.parameters.select_columns(places).select_rows(places),
            state_gradient: self.state_gradient,
            parameter_gradient: self.parameter_gradient.select_rows(places),
        }
    }

    /// The inverse of the states' block with its diagonal raised by `damping`.
    ///
    /// The damping is relative, so what no output tells of a state needs an absolute part too.
    fn inverse_states(&self, damping: f64) -> SMatrix<f64, NX, NX> {
        let mut states = self.states;
        for i in 0..NX {
            states[(i, i)] += damping * states[(i, i)];
            if states[(i, i)] == 0.0 {
                states[(i, i)] = 1.0;
            }
        }
        states
            .cholesky()
            .map_or_else(SMatrix::zeros, |factor| factor.inverse())
    }

    /// Information and gradient in the parameters, the state eliminated (Schur complement). The
    /// parameters' own diagonal is raised by `damping`, too.
    pub(super) fn eliminated(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let inverse = self.inverse_states(damping);
        let gain = self.mixed.tr_mul(&inverse);
        let mut information = &self.parameters - &gain * &self.mixed;
        for i in 0..information.nrows() {
            information[(i, i)] += damping * self.parameters[(i, i)];
        }
        (
            information,
            &self.parameter_gradient - gain * self.state_gradient,
        )
    }

    /// By how much the state's own undamped step lowers chi^2 of the quadratic model.
    pub(super) fn state_gain(&self) -> f64 {
        let step = self.inverse_states(0.0) * self.state_gradient;
        self.state_gradient.dot(&step)
    }

    /// The state's step that belongs to a step of the parameters.
    pub(super) fn state_step(&self, step: &DVector<f64>, damping: f64) -> SVector<f64, NX> {
        -self.inverse_states(damping) * (self.state_gradient + &self.mixed * step)
    }
}
