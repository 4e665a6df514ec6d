//! What a guaranteed controller leaves to one that takes its place.

use super::aim::Aims;
use super::{GuaranteedController, Planner};
use crate::model::{LpvModel, Scalar};
use crate::working_set::copy;

impl<P, T, const NX: usize, const NU: usize, const NS: usize> GuaranteedController<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + PartialEq,
{
    /// Goes on from the plan of another controller with the same model and the same settings, as if
    /// it were its own. `false`, and nothing is taken over, with any other: there that plan is backed
    /// by nothing.
    pub fn take_over(&mut self, previous: &Self) -> bool {
        let same = self.settings() == previous.settings() && self.model() == previous.model();
        if same {
            self.planner.go_on_from(&previous.planner);
            self.has_plan = previous.has_plan;
            self.last.copy_from(&previous.last);
            self.along.copy_from(&previous.along);
            self.trial.copy_from(&previous.trial);
            self.nearer.copy_from(&previous.nearer);
        }
        same
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    fn go_on_from(&mut self, previous: &Self) {
        // Exhaustive, so that what is added later is thought of here.
        let Self {
            model: _,
            settings: _,
            aims:
                Aims {
                    stages,
                    end,
                    changes,
                },
            wanted,
            damping,
            slope,
            without_room,
            drift,
            end_drift,
            pressure,
            touch,
            slopes,
        } = self;
        copy(stages, &previous.aims.stages);
        (*end, *changes) = (previous.aims.end, previous.aims.changes);
        copy(drift, &previous.drift);
        copy(slopes, &previous.slopes);
        (*wanted, *damping, *slope) = (previous.wanted, previous.damping, previous.slope);
        *without_room = previous.without_room;
        (*end_drift, *pressure) = (previous.end_drift, previous.pressure);
        *touch = previous.touch;
    }
}
