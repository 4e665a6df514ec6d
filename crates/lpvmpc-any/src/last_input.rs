//! A plant over one sample of a controller: with what acts on it besides the planned input, and with
//! the last input among its states where its changes cost something or are bounded.

use crate::model::Model;
use lpvmpc::{LpvModel, Rk4, SteadyState, SteadyStateProblem, Tangent};
use nalgebra::{SMatrix, SVector};

/// A plant under disturbances.
#[derive(Debug, Clone)]
pub(crate) struct Disturbed<const NX: usize, const NU: usize, const NS: usize> {
    pub plant: Model<NX, NU, NS>,
    /// What comes on top of x_dot, or of x+ in discrete time.
    pub disturbance: Option<SVector<f64, NX>>,
    /// What comes on top of the input.
    pub beside: Option<SVector<f64, NU>>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Disturbed<NX, NU, NS> {
    fn input(&self, u: &SVector<f64, NU>) -> SVector<f64, NU> {
        self.beside.map_or(*u, |beside| u + beside)
    }

    /// What of several points is asked `of` the plant, at the inputs that act there.
    #[inline(always)]
    fn at_inputs<const POINTS: usize>(
        &self,
        u: &[SVector<f64, NU>; POINTS],
        of: impl FnOnce(&[SVector<f64, NU>; POINTS]),
    ) {
        match &self.beside {
            None => of(u),
            Some(beside) => of(&u.map(|u| u + beside)),
        }
    }

    fn disturbed(&self, rate: SVector<f64, NX>) -> SVector<f64, NX> {
        self.disturbance.map_or(rate, |d| rate + d)
    }

    fn disturb(&self, tangents: &mut [Tangent<f64, NX, NU>]) {
        if let Some(disturbance) = self.disturbance {
            tangents
                .iter_mut()
                .for_each(|(rate, ..)| *rate += disturbance);
        }
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NU, NS>
    for Disturbed<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        self.plant.period()
    }

    fn scheduling(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NS> {
        self.plant.scheduling(x, &self.input(u))
    }

    fn matrices(
        &self,
        scheduling: &SVector<f64, NS>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        self.plant.matrices(scheduling)
    }

    fn offset(&self, scheduling: &SVector<f64, NS>) -> Option<SVector<f64, NX>> {
        let pushed = self.beside.map(|u| self.plant.matrices(scheduling).1 * u);
        let parts = [self.plant.offset(scheduling), self.disturbance, pushed];
        parts.into_iter().flatten().reduce(|sum, part| sum + part)
    }

    // Called for every stage of every step of every rollout.
    #[inline(always)]
    fn derivative(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX> {
        self.disturbed(self.plant.derivative(x, &self.input(u)))
    }

    fn jacobian(
        &self,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        self.plant.jacobian(x, &self.input(u))
    }

    fn tangent(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        let (rate, a, b) = self.plant.tangent(x, &self.input(u));
        (self.disturbed(rate), a, b)
    }

    fn embedded(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        let (rate, a, b) = self.plant.embedded(x, &self.input(u));
        (self.disturbed(rate), a, b)
    }

    const TOGETHER: bool = true;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        self.at_inputs(u, |u| self.plant.embedded_each(x, u, tangents));
        self.disturb(tangents);
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        self.at_inputs(u, |u| self.plant.tangent_each(x, u, tangents));
        self.disturb(tangents);
    }

    fn has_offset(&self) -> bool {
        self.disturbance.is_some() || self.beside.is_some() || self.plant.has_offset()
    }
}

/// Where the last input stands among the states, and the sample after which it is the present one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LastInput {
    /// The place of its first component.
    pub at: usize,
    /// How many inputs the plant has.
    pub inputs: usize,
    pub t_s: f64,
    pub rk4: Rk4,
}

impl LastInput {
    /// Writes the input `u` into its places.
    pub fn write<const NX: usize, const NU: usize>(
        &self,
        x: &mut SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) {
        for j in 0..self.inputs {
            x[self.at + j] = u[j];
        }
    }

    /// v+ = u in the rows of the last input v.
    fn write_rows<const NX: usize, const NU: usize>(
        &self,
        (mut a, mut b): (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>),
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        for j in 0..self.inputs {
            a.row_mut(self.at + j).fill(0.0);
            b.row_mut(self.at + j).fill(0.0);
            b[(self.at + j, j)] = 1.0;
        }
        (a, b)
    }

    /// What the plant does in a sample from each state, with what the last input does.
    fn complete<const NX: usize, const NU: usize, const POINTS: usize>(
        &self,
        u: [SVector<f64, NU>; POINTS],
        mut tangents: [Tangent<f64, NX, NU>; POINTS],
    ) -> [Tangent<f64, NX, NU>; POINTS] {
        for ((next, a, b), u) in tangents.iter_mut().zip(&u) {
            self.write(next, u);
            (*a, *b) = self.write_rows((*a, *b));
        }
        tangents
    }
}

/// What a controller has for a plant.
#[derive(Debug, Clone)]
pub(crate) struct Sampled<const NX: usize, const NU: usize, const NS: usize> {
    pub rates: Disturbed<NX, NU, NS>,
    /// With it the model is sampled itself: the last input does not move between samples.
    pub last_input: Option<LastInput>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Sampled<NX, NU, NS> {
    /// `plant`, undisturbed.
    pub fn new(plant: Model<NX, NU, NS>, last_input: Option<LastInput>) -> Self {
        Self {
            rates: Disturbed {
                plant,
                disturbance: None,
                beside: None,
            },
            last_input,
        }
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NU, NS>
    for Sampled<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        match &self.last_input {
            None => self.rates.period(),
            Some(last) => Some(last.t_s),
        }
    }

    fn scheduling(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NS> {
        self.rates.scheduling(x, u)
    }

    fn matrices(
        &self,
        scheduling: &SVector<f64, NS>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        let (a, b) = self.rates.matrices(scheduling);
        match (&self.last_input, self.rates.period()) {
            (None, _) => (a, b),
            (Some(last), Some(_)) => last.write_rows((a, b)),
            (Some(last), None) => last.write_rows(last.rk4.discretize(&a, &b, last.t_s)),
        }
    }

    fn offset(&self, scheduling: &SVector<f64, NS>) -> Option<SVector<f64, NX>> {
        let c = self.rates.offset(scheduling);
        match (&self.last_input, self.rates.period(), c) {
            (Some(last), None, Some(c)) => {
                // It acts as an input of 1 does.
                let (a, _) = self.rates.matrices(scheduling);
                Some(last.rk4.discretize(&a, &c, last.t_s).1)
            }
            (_, _, c) => c,
        }
    }

    fn derivative(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX> {
        let Some(last) = &self.last_input else {
            return self.rates.derivative(x, u);
        };
        let mut next = last.rk4.advance(&self.rates, x, u, last.t_s);
        last.write(&mut next, u);
        next
    }

    fn jacobian(
        &self,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        match &self.last_input {
            None => self.rates.jacobian(x, u),
            Some(last) => last.write_rows(last.rk4.differentiate(&self.rates, x, u, last.t_s)),
        }
    }

    fn tangent(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        let Some(last) = &self.last_input else {
            return self.rates.tangent(x, u);
        };
        let [there] = last.complete(
            [*u],
            last.rk4
                .differentiate_each(&self.rates, &[*x], &[*u], last.t_s),
        );
        there
    }

    fn embedded(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        let Some(last) = &self.last_input else {
            return self.rates.embedded(x, u);
        };
        let [there] = last.complete(
            [*u],
            last.rk4.linearize_each(&self.rates, &[*x], &[*u], last.t_s),
        );
        there
    }

    const TOGETHER: bool = true;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        match &self.last_input {
            None => self.rates.embedded_each(x, u, tangents),
            Some(last) => {
                let there = last.rk4.linearize_each(&self.rates, x, u, last.t_s);
                *tangents = last.complete(*u, there);
            }
        }
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        match &self.last_input {
            None => self.rates.tangent_each(x, u, tangents),
            Some(last) => {
                let there = last.rk4.differentiate_each(&self.rates, x, u, last.t_s);
                *tangents = last.complete(*u, there);
            }
        }
    }

    fn has_offset(&self) -> bool {
        self.rates.has_offset()
    }

    fn steady_state(
        &self,
        problem: &SteadyStateProblem<f64, NX, NU>,
    ) -> Option<SteadyState<f64, NX, NU>> {
        let mut found = self.rates.steady_state(problem)?;
        if let Some(last) = &self.last_input {
            last.write(&mut found.x, &found.u);
        }
        Some(found)
    }
}
