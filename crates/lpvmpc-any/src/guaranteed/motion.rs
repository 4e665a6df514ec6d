//! Rollouts of plans, and what they are worth.

use super::{Guarantee, Sample};
use crate::error::MpcError;
use crate::plan::Plan;
use crate::settings::Limits;
use lpvmpc_plant::{Plant, PlantError};
use nalgebra::{DMatrix, DVector};

/// What a target's distance from the set point costs, in units of the terminal cost of a state there: more than 1, so
/// that it is worth while to move on.
const OFFSET_PRICE: f64 = 10.0;

/// What a rollout gives.
#[derive(Clone)]
pub(super) struct Motion {
    /// The equilibrium that it is to end at.
    pub target: DVector<f64>,
    /// What acts at the plant's inputs: u with the disturbance beside it.
    pub u: Vec<DVector<f64>>,
    /// x_0 to x_N.
    pub x: Vec<DVector<f64>>,
    /// About what it is aimed at.
    pub cost: f64,
    /// e'Pe at the end, about the target.
    pub end: f64,
}

impl Motion {
    /// Becomes the answer of a sample, as inputs to be commanded beside a disturbance.
    pub fn write(&self, plan: &mut Plan, beside: &DVector<f64>, bounds: &Limits) {
        let (horizon, m, n) = (self.u.len(), plan.u.ncols(), plan.x.ncols());
        plan.u = DMatrix::from_fn(horizon, m, |i, j| {
            // They are within their bounds already, rounding apart.
            let u = self.u[i][j] - beside[j];
            u.max(bounds.lower[j]).min(bounds.upper[j])
        });
        plan.x = DMatrix::from_fn(horizon + 1, n, |i, j| self.x[i][j]);
        plan.cost = self.cost;
    }
}

impl Guarantee {
    /// The cost of a motion with that of its target's distance from the set point.
    pub(super) fn worth(&self, sample: &Sample, motion: &Motion) -> f64 {
        let off = &motion.target - &sample.aims.end;
        motion.cost + OFFSET_PRICE * off.dot(&(&self.set.p * &off))
    }

    /// Whether bounds are kept and the end is in the set, with this share of room.
    pub(super) fn keeps(&self, sample: &Sample, motion: &Motion, margin: f64) -> bool {
        let bounds = &self.x_bounds;
        let inside = |x: &DVector<f64>| {
            (0..x.len()).all(|i| {
                let room = |bound: f64| margin * finite_or((bound - motion.target[i]).abs(), 0.0);
                let (lower, upper) = (bounds.lower[i], bounds.upper[i]);
                x[i] >= lower + room(lower) && x[i] <= upper - room(upper)
            })
        };
        motion.cost.is_finite()
            && motion.end <= sample.level * (1.0 - margin)
            && motion.x[1..].iter().all(inside)
    }

    /// The motion of the nonlinear plant from the measured state to `target` under inputs that are moved into their bounds.
    pub(super) fn roll_out(
        &self,
        plant: &Plant,
        sample: &Sample,
        target: &DVector<f64>,
        input: &dyn Fn(usize, &DVector<f64>) -> DVector<f64>,
    ) -> Result<Motion, MpcError> {
        let set = &self.set;
        let mut motion = Motion {
            target: target.clone(),
            u: Vec::with_capacity(self.horizon),
            x: vec![sample.x.clone()],
            cost: 0.0,
            end: f64::NAN,
        };
        let mut x = sample.x.clone();
        for i in 0..self.horizon {
            let wanted = input(i, &x);
            let u = DVector::from_fn(wanted.len(), |j, _| {
                wanted[j].max(sample.u.lower[j]).min(sample.u.upper[j])
            });
            let (e, v) = (&x - sample.aims.at(i, target), &u - &set.u);
            motion.cost += e.dot(&(&set.q * &e)) + v.dot(&(&set.r * &v));
            x = advance(plant, &x, &u, set.t_s, self.substeps)?;
            motion.u.push(u);
            motion.x.push(x.clone());
        }
        let e = &x - target;
        motion.end = e.dot(&(&set.p * &e));
        motion.cost += motion.end;
        Ok(motion)
    }
}

/// A sample, in continuous time by the classical Runge-Kutta method.
fn advance(
    plant: &Plant,
    x: &DVector<f64>,
    u: &DVector<f64>,
    t_s: f64,
    steps: usize,
) -> Result<DVector<f64>, MpcError> {
    let known =
        |motion: Result<Vec<f64>, PlantError>| Ok::<_, MpcError>(DVector::from_vec(motion?));
    if plant.period().is_some() {
        return known(plant.next(x.as_slice(), u.as_slice()));
    }
    let rate = |x: &DVector<f64>| known(plant.derivative(x.as_slice(), u.as_slice()));
    let h = t_s / steps as f64;
    let mut x = x.clone();
    for _ in 0..steps {
        let k1 = rate(&x)?;
        let k2 = rate(&(&x + &k1 * (0.5 * h)))?;
        let k3 = rate(&(&x + &k2 * (0.5 * h)))?;
        let k4 = rate(&(&x + &k3 * h))?;
        x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
    }
    Ok(x)
}

pub(super) fn finite_or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() { value } else { otherwise }
}
