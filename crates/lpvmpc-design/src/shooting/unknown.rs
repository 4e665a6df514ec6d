//! What may change in a fit, and what is known of it beforehand.

/// One parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// Value at the start; of a parameter that is held, its value.
    pub start: f64,
    /// Smallest value allowed; -inf for none.
    pub lower: f64,
    /// Largest value allowed; inf for none.
    pub upper: f64,
    /// What a change of the parameter is measured in, positive: differences are taken over a
    /// millionth of it.
    pub scale: f64,
    /// Whether the fit may change it.
    pub free: bool,
    /// Whether the outputs may have kinks as functions of it: their slopes are then those of one side, and
    /// a minimum at a kink, where no gradient vanishes, is looked at from both. Such parameters are tried
    /// one at a time.
    pub kinked: bool,
}

/// Knowledge beforehand: `coefficients` . parameters is `mean` with a standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// One per parameter, in the model's order.
    pub coefficients: Vec<f64>,
    /// Expected value of the combination.
    pub mean: f64,
    /// Its standard deviation, positive.
    pub standard_deviation: f64,
}

impl Prior {
    /// Distance from the expected value in standard deviations.
    pub fn residual(&self, parameters: &[f64]) -> f64 {
        let terms = self.coefficients.iter().zip(parameters);
        let value: f64 = terms.map(|(a, b)| a * b).sum();
        (value - self.mean) / self.standard_deviation
    }

    /// Derivative of [`Prior::residual`] by each parameter.
    pub(super) fn slopes(&self) -> Vec<f64> {
        let coefficients = self.coefficients.iter();
        coefficients.map(|c| c / self.standard_deviation).collect()
    }
}
