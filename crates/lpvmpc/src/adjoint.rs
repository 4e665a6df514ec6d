//! The adjoint recursion: the Lagrangian's gradient in the inputs, from the last stage to the first.

use crate::model::Scalar;
use crate::ocp::{Common, Ocp};
use crate::rows::{self, Places, Trajectory};
use crate::small_matrix::{product, transposed_sizes, transposed_times};
use crate::solution::ActiveSet;
use nalgebra::SVector;

/// A backward pass along the horizon, with the states eliminated.
pub(crate) struct Adjoint<'a, T: 'static, const NX: usize, const NU: usize> {
    ocp: &'a Ocp<T, NX, NU>,
    /// The point at which the cost counts; without one, the active rows are the whole Lagrangian.
    trajectory: Option<&'a Trajectory<'a, T, NX, NU>>,
    /// Derivative of the Lagrangian in x_`stage`, through what comes after it.
    pub costate: SVector<T, NX>,
    stage: usize,
    places: Places,
}

/// What the pass finds at a stage.
pub(crate) struct AdjointStage<T, const NX: usize, const NU: usize> {
    /// The stage i.
    pub stage: usize,
    /// Derivative in x_{i+1}.
    pub costate: SVector<T, NX>,
    /// Derivative in u_i.
    pub gradient: SVector<T, NU>,
    /// Sum of the sizes of its terms that come through the dynamics, |B|'|costate|.
    pub dynamics: SVector<T, NU>,
    /// Its part from the active rows at u_i.
    pub rows: SVector<T, NU>,
}

impl<'a, T: Scalar, const NX: usize, const NU: usize> Adjoint<'a, T, NX, NU> {
    /// Begins behind the last stage. `active` stays the same in all calls, but for rows at stages that
    /// have been visited.
    pub fn new(
        ocp: &'a Ocp<T, NX, NU>,
        trajectory: Option<&'a Trajectory<'a, T, NX, NU>>,
        active: &ActiveSet<T>,
    ) -> Self {
        let stage = ocp.length();
        let (mut costate, _) = rows::gradient(ocp, active.at(stage));
        if let Some(trajectory) = trajectory {
            let (end, x) = (&ocp.terminal, trajectory.state(ocp, stage));
            costate += product(&end.p, &x) + end.linear_x;
        }
        let mut places = Places::default();
        active.stages().for_each(|stage| places.add(stage));
        Self {
            ocp,
            trajectory,
            costate,
            stage,
            places,
        }
    }

    /// The next stage towards the beginning; `None` in front of the first.
    pub fn step(&mut self, active: &ActiveSet<T>) -> Option<AdjointStage<T, NX, NU>> {
        self.stage = self.stage.checked_sub(1)?;
        let stage = self.ocp.stages.get(self.stage)?;
        let costate = self.costate;
        let mut gradient = transposed_times(&stage.b, &costate);
        self.costate = transposed_times(&stage.a, &costate);
        let mut rows = SVector::zeros();
        if self.places.may_be_at(self.stage) {
            let (rows_x, rows_u) = rows::gradient(self.ocp, active.at(self.stage));
            gradient += rows_u;
            self.costate += rows_x;
            rows = rows_u;
        }
        if let Some(trajectory) = self.trajectory {
            let x = trajectory.state(self.ocp, self.stage);
            let u = trajectory.u.get(self.stage)?;
            let Common { q, r, s, .. } = self.ocp.common_at(self.stage);
            gradient += product(r, u) + product(s, &x) + stage.linear_u;
            self.costate += product(q, &x) + transposed_times(s, u) + stage.linear_x;
        }
        Some(AdjointStage {
            stage: self.stage,
            costate,
            gradient,
            dynamics: transposed_sizes(&stage.b, &costate),
            rows,
        })
    }

    /// Of a single input that holds component `j` of the state behind the stage that was visited last: what one more unit
    /// of that state costs. The input has no gradient then.
    pub fn hold_state(&mut self, at: &AdjointStage<T, NX, NU>, j: usize) -> T {
        let Some(stage) = self.ocp.stages.get(at.stage) else {
            return T::zero();
        };
        let component = |column: &[T; NX]| column.get(j).copied().unwrap_or(T::zero());
        let slope = at.gradient[0] / component(&stage.b.data.0[0]);
        for (costate, a) in self.costate.data.0[0].iter_mut().zip(&stage.a.data.0) {
            *costate -= component(a) * slope;
        }
        slope
    }
}
