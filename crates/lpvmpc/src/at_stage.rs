//! A plant as it is in one sample of the horizon.

use crate::embedding::Tangent;
use crate::model::{LpvModel, Scalar};
use crate::steady_state::{self, SteadyState, SteadyStateProblem};
use nalgebra::{SMatrix, SVector};

/// A plant with the scheduling and under the disturbances of one sample.
pub(crate) struct AtStage<'a, P, T, const NX: usize, const NU: usize, const NS: usize> {
    pub plant: &'a P,
    /// `None`: that of the state.
    pub scheduling: Option<&'a SVector<T, NS>>,
    /// What comes on top of x_dot.
    pub disturbance: Option<&'a SVector<T, NX>>,
    /// What comes on top of u.
    pub beside: Option<&'a SVector<T, NU>>,
}

impl<P, T: Scalar, const NX: usize, const NU: usize, const NS: usize>
    AtStage<'_, P, T, NX, NU, NS>
{
    /// Whether it has none of these.
    pub fn is_the_plant(&self) -> bool {
        self.scheduling.is_none() && self.disturbance.is_none() && self.beside.is_none()
    }

    fn disturbed(&self, rate: SVector<T, NX>) -> SVector<T, NX> {
        self.disturbance.map_or(rate, |d| rate + d)
    }

    /// The whole input.
    fn input(&self, u: &SVector<T, NU>) -> SVector<T, NU> {
        self.beside.map_or(*u, |beside| u + beside)
    }

    /// A, B and the rate of the plant, undisturbed, with a scheduling from outside.
    fn along(
        &self,
        scheduling: &SVector<T, NS>,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
    ) -> Tangent<T, NX, NU>
    where
        P: LpvModel<T, NX, NU, NS>,
    {
        let (a, b) = self.plant.matrices(scheduling);
        let rate = a * x + b * u;
        let c = self.plant.offset(scheduling);
        (c.map_or(rate, |c| rate + c), a, b)
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> LpvModel<T, NX, NU, NS>
    for AtStage<'_, P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    fn period(&self) -> Option<T> {
        self.plant.period()
    }

    fn scheduling(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NS> {
        let given = self.scheduling.copied();
        given.unwrap_or_else(|| self.plant.scheduling(x, &self.input(u)))
    }

    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NX>> {
        let c = match self.plant.offset(scheduling) {
            Some(c) => Some(self.disturbed(c)),
            None => self.disturbance.copied(),
        };
        let pushed = self.beside.map(|u| self.plant.matrices(scheduling).1 * u);
        match (c, pushed) {
            (Some(c), Some(pushed)) => Some(c + pushed),
            (c, pushed) => c.or(pushed),
        }
    }

    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        self.plant.matrices(scheduling)
    }

    fn a_times<const C: usize>(
        &self,
        a: &SMatrix<T, NX, NX>,
        v: &SMatrix<T, NX, C>,
    ) -> SMatrix<T, NX, C> {
        self.plant.a_times(a, v)
    }

    fn derivative(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> SVector<T, NX> {
        let u = self.input(u);
        self.disturbed(match self.scheduling {
            None => self.plant.derivative(x, &u),
            Some(scheduling) => self.along(scheduling, (x, &u)).0,
        })
    }

    fn jacobian(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        match self.scheduling {
            None => self.plant.jacobian(x, &self.input(u)),
            Some(scheduling) => self.plant.matrices(scheduling),
        }
    }

    fn tangent(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        let u = self.input(u);
        let (rate, a, b) = match self.scheduling {
            None => self.plant.tangent(x, &u),
            Some(scheduling) => self.along(scheduling, (x, &u)),
        };
        (self.disturbed(rate), a, b)
    }

    fn embedded(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Tangent<T, NX, NU> {
        let u = self.input(u);
        let (rate, a, b) = match self.scheduling {
            None => self.plant.embedded(x, &u),
            Some(scheduling) => self.along(scheduling, (x, &u)),
        };
        (self.disturbed(rate), a, b)
    }

    const TOGETHER: bool = P::TOGETHER;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        if self.is_the_plant() {
            return self.plant.embedded_each(x, u, tangents);
        }
        for (i, tangent) in tangents.iter_mut().enumerate() {
            *tangent = self.embedded(&x[i], &u[i]);
        }
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        if self.is_the_plant() {
            return self.plant.tangent_each(x, u, tangents);
        }
        for (i, tangent) in tangents.iter_mut().enumerate() {
            *tangent = self.tangent(&x[i], &u[i]);
        }
    }

    fn has_offset(&self) -> bool {
        self.disturbance.is_some() || self.beside.is_some() || self.plant.has_offset()
    }

    fn steady_state(
        &self,
        problem: &SteadyStateProblem<T, NX, NU>,
    ) -> Option<SteadyState<T, NX, NU>> {
        if self.is_the_plant() {
            self.plant.steady_state(problem)
        } else {
            steady_state::nearest(self, problem)
        }
    }
}
