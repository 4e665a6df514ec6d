//! A plan in the plant's sizes and names.

use crate::plan::{ActiveBound, Plan, Target};
use crate::settings::Limits;
use crate::sized::Sized;
use crate::stage_lists::{StageLists, held};
use crate::tasks::{About, Tasks};
use crate::words::{Bounded, Named};
use lpvmpc::{BoundId, Bounds, Quantity, Side};
use lpvmpc_plant::Signal;
use nalgebra::{DMatrix, SVector};

/// What a step was told.
pub(crate) struct Said<'a, const NX: usize, const NU: usize, const NS: usize> {
    pub lists: &'a StageLists<NX, NU, NS>,
    pub tasks: &'a Option<Tasks<NX, NU, NS>>,
    /// The names of the rows of each stage.
    pub rows: Vec<Vec<String>>,
    /// The bounds of the first input without those of its change.
    pub u_first: Option<Bounds<f64, NU>>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Said<'_, NX, NU, NS> {
    /// Whether a bound of the input `i` is that of its first change.
    fn is_first_change(&self, bound: BoundId, i: usize) -> bool {
        let (Some(first), Some(within)) = (&self.u_first, self.lists.u_bounds.first()) else {
            return false;
        };
        bound.stage == 0
            && match bound.side {
                Side::Lower => within.lower[i] > first.lower[i],
                _ => within.upper[i] < first.upper[i],
            }
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> Sized<NX, NU, NS> {
    /// The answer of the last step, in the plant's sizes and names.
    pub fn plan(
        &self,
        x: &SVector<f64, NX>,
        said: &Said<'_, NX, NU, NS>,
        cost: f64,
        target: Option<Target>,
    ) -> Plan {
        let solution = self.controller.solution();
        let (n, m) = (self.names.states.len(), self.names.inputs.len());
        let horizon = self.settings.horizon;
        let of = |bound: BoundId| self.named(bound, said);
        let bounded = Bounded { of: &of };
        let mut active: Vec<ActiveBound> = solution
            .active
            .iter()
            .map(|row| ActiveBound {
                stage: row.bound.stage,
                bound: bounded.words(row.bound),
                // The solver's cost is half of the plan's.
                multiplier: 2.0 * row.multiplier,
                exceeded: row.exceeded,
            })
            .collect();
        active.sort_by_key(|one| one.stage);
        Plan {
            u: DMatrix::from_fn(horizon, m, |i, j| solution.u[i][j]),
            x: DMatrix::from_fn(horizon + 1, n, |i, j| match i.checked_sub(1) {
                None => x[j],
                Some(i) => solution.x[i][j],
            }),
            status: bounded.status(&solution.status, &solution.active),
            kind: solution.status,
            cost,
            active,
            problems: self.controller.problems(),
            target,
            decision: None,
        }
    }

    /// What a bound acts on.
    fn named(&self, bound: BoundId, said: &Said<'_, NX, NU, NS>) -> Option<Named> {
        let Said {
            lists, tasks, rows, ..
        } = said;
        let data = self.plant.data();
        let of = |signals: &[Signal], i: usize, lower: f64, upper: f64| {
            let signal = signals.get(i)?;
            Some(Named {
                name: signal.name.clone(),
                unit: signal.unit.clone(),
                lower,
                upper,
            })
        };
        let stage = bound.stage;
        let change = |i: usize, within: &Limits| {
            let named = of(&data.inputs, i, within.lower[i], within.upper[i])?;
            let name = format!("change of {}", named.name);
            Some(Named { name, ..named })
        };
        match bound.quantity {
            Quantity::State(i) => {
                let x = held(&lists.x_bounds, stage).unwrap_or(&self.bounds.x);
                of(&data.states, i, x.lower[i], x.upper[i])
            }
            // The first change is bounded by bounds of the input.
            Quantity::Input(i) if said.is_first_change(bound, i) => {
                let tasks = tasks.as_ref()?;
                change(i, held(&tasks.du_bounds, 0)?)
            }
            Quantity::Input(i) => {
                let u = held(&lists.u_bounds, stage).unwrap_or(&self.bounds.u);
                of(&data.inputs, i, u.lower[i], u.upper[i])
            }
            Quantity::Row(i) => {
                let bounded = tasks.as_ref().map_or(0, |tasks| tasks.bounded.len());
                let Some(i) = i.checked_sub(bounded) else {
                    let tasks = tasks.as_ref()?;
                    return match tasks.bounded[i] {
                        About::Output(k) => {
                            let y = held(&tasks.y_bounds, stage)?;
                            of(&data.outputs, k, y.lower[k], y.upper[k])
                        }
                        About::Change(k) => change(k, held(&tasks.du_bounds, stage)?),
                    };
                };
                let own = held(&lists.rows, stage).and_then(|rows| rows.get(i));
                let (lower, upper) = match own {
                    Some(row) => (row.lower, row.upper),
                    None => {
                        let row = self.settings.rows.get(i)?;
                        (row.lower, row.upper)
                    }
                };
                let names: Option<&Vec<String>> = held(rows.as_slice(), stage);
                let name = match names {
                    Some(names) => names.get(i)?.clone(),
                    None => self.settings.rows.get(i)?.name.clone(),
                };
                Some(Named {
                    name,
                    unit: String::new(),
                    lower,
                    upper,
                })
            }
        }
    }
}
