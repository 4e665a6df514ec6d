//! What may change while a controller runs.

use crate::controller::{Controller, Reference};
use crate::list::List;
#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Bounds, GeneralRow};
use crate::preview::{Preview, check_rows};
use crate::settings::{ControllerError, ControllerSettings, Iterations, check, check_bounds};
#[cfg(feature = "alloc")]
use crate::solution::ActiveSet;
use crate::working_set::copy;
use crate::workspace::Workspace;
use nalgebra::{SMatrix, SVector};

/// General rows of every sample, beside the step that knows them: without any, a program has no machine
/// code for rows.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct FixedRows<P, T: 'static, const NX: usize, const NU: usize, const NS: usize> {
    pub rows: List<GeneralRow<T, NX, NU>>,
    pub run: Run<P, T, NX, NU, NS>,
}

/// A step from a measured state, or without one what can be prepared. It puts the rows back.
type Run<P, T, const NX: usize, const NU: usize, const NS: usize> = fn(
    &mut Controller<P, T, NX, NU, NS>,
    Option<&SVector<T, NX>>,
    &Reference<'_, T, NX>,
    FixedRows<P, T, NX, NU, NS>,
    &mut Workspace<T, NX, NU>,
);

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Controller<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// Bounds of state and input from the next step on, over its whole horizon: for what is known
    /// at run time only, such as the part of a motor that somebody else needs, or an estimated
    /// disturbance of the input.
    ///
    /// # Errors
    /// [`ControllerError::Bounds`]; the bounds are then as they were.
    pub fn set_bounds(
        &mut self,
        x: Bounds<T, NX>,
        u: Bounds<T, NU>,
    ) -> Result<(), ControllerError> {
        check_bounds(&x, "state")?;
        check_bounds(&u, "input")?;
        (self.settings.x, self.settings.u) = (x, u);
        self.put_back();
        self.aimed_at = None;
        Ok(())
    }

    /// General rows for every stage of every sample from the next one on, unless a preview has others;
    /// `List::empty()` for none. Workspace and controller need room for them
    /// ([`Capacity::with_general_rows`](crate::Capacity::with_general_rows)).
    ///
    /// # Errors
    /// [`ControllerError::Rows`]; the rows are then as they were.
    pub fn set_rows(&mut self, rows: List<GeneralRow<T, NX, NU>>) -> Result<(), ControllerError> {
        check_rows(&rows).map_err(ControllerError::Rows)?;
        let run: Run<P, T, NX, NU, NS> = Self::run_with_rows;
        self.fixed = (!rows.is_empty()).then_some(FixedRows { rows, run });
        self.put_back();
        Ok(())
    }

    /// Room for as many active bounds as `capacity` says, on the heap, for more general rows than before, say. The plan
    /// stays.
    #[cfg(feature = "alloc")]
    pub fn make_room(&mut self, capacity: Capacity) {
        let mut active = ActiveSet::with_capacity(capacity.active);
        active.copy_from(&self.solution.active);
        self.solution.active = active;
    }

    /// Another model of the plant from the next step on; the last plan stays its start. It is one in the same kind of
    /// time: with the same period, or with none.
    pub fn set_model(&mut self, model: P) {
        self.model = model;
        self.put_back();
        self.aimed_at = None;
    }

    /// Other settings from the next step on: weights, bounds, prices, terminal ingredient, input
    /// reference, scheduling, iterations. Horizon and sampling time stay; for others
    /// another controller [takes over](Self::take_over).
    ///
    /// # Errors
    /// A [`ControllerError`] names the first setting that makes no sense; they are then as they were.
    pub fn set_settings(
        &mut self,
        settings: ControllerSettings<T, NX, NU, NS>,
    ) -> Result<(), ControllerError> {
        let ControllerSettings { horizon, t_s, .. } = self.settings;
        if (settings.horizon, settings.t_s) != (horizon, t_s) {
            return Err(ControllerError::Another);
        }
        check(&settings, horizon)?;
        self.put_back();
        if let (Iterations::Fixed(_), Iterations::Descent { .. }) =
            (self.settings.iterations, settings.iterations)
        {
            self.begin_descent();
        }
        self.settings = settings;
        (self.aimed_at, self.target) = (None, None);
        Ok(())
    }

    /// The plan of the paper's loop becomes one of a descent: without feedback, and so dear that others are looked for
    /// beside it.
    #[cold]
    fn begin_descent(&mut self) {
        self.make_up(());
        copy(&mut self.policy.u, &self.solution.u);
        self.policy.feedback.fill(SMatrix::zeros());
        (self.policy.cost, self.policy.damping) = (T::zero(), T::zero());
    }

    /// A sample with the controller's own rows.
    fn run_with_rows(
        &mut self,
        x: Option<&SVector<T, NX>>,
        reference: &Reference<'_, T, NX>,
        fixed: FixedRows<P, T, NX, NU, NS>,
        workspace: &mut Workspace<T, NX, NU>,
    ) {
        self.fixed = Some(fixed);
        let preview = Preview::new(*reference);
        match x {
            Some(x) => {
                self.step_with(x, &preview, workspace);
            }
            None => self.prepare_with(&preview, workspace),
        }
    }
}
