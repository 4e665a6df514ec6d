//! Where plans may end, and what they are aimed at.

use crate::check::Names;
use crate::error::MpcError;
use crate::preview::Preview;
use crate::settings::{Limits, TerminalSet};
use crate::stage_lists::held;
use nalgebra::DVector;

/// Of a set point further away than so many lengths of the set, the direction counts: strides remain of use.
const FAR: f64 = 1e3;

/// What the plans of a sample are aimed at.
#[derive(Clone)]
pub(super) struct Aims {
    /// The references of the stages up to the last change that is seen. From there on a plan is aimed at where it ends.
    stages: Vec<DVector<f64>>,
    /// What is wanted at the end of the horizon, and beyond.
    pub end: DVector<f64>,
}

impl Aims {
    /// What a plan that ends at `target` is aimed at.
    pub fn at<'a>(&'a self, stage: usize, target: &'a DVector<f64>) -> &'a DVector<f64> {
        self.stages.get(stage).unwrap_or(target)
    }

    /// The references of the program of such a plan.
    pub fn references(&self, target: &DVector<f64>) -> Vec<DVector<f64>> {
        let stages = self.stages.iter().chain([target]);
        stages.cloned().collect()
    }
}

/// Where plans may end: at the equilibrium, and anywhere along states that the plant does not notice, as far as the set
/// stays within the bounds.
pub(super) struct Targets {
    x: DVector<f64>,
    limits: Limits,
    /// How far the set reaches along each state.
    lengths: Vec<f64>,
}

impl Targets {
    /// The targets of a set whose P has the inverse `p_inverse`, where the plant does not notice the states that are `free`.
    pub fn new(
        set: &TerminalSet,
        p_inverse: &nalgebra::DMatrix<f64>,
        free: &[bool],
        bounds: &Limits,
    ) -> Self {
        let target = |bound: &[f64], side: f64, wider: fn(f64, f64) -> f64| {
            let along = |i: usize| {
                let there = match free[i] {
                    true if bound[i].is_finite() => bound[i] - side * set.state_limits[i],
                    true => bound[i],
                    false => set.x[i],
                };
                // The equilibrium itself is always there, rounding apart.
                wider(there, set.x[i])
            };
            (0..set.x.len()).map(along).collect()
        };
        let lengths = (0..set.x.len()).map(|i| (set.level * p_inverse[(i, i)]).sqrt());
        Self {
            x: set.x.clone(),
            limits: Limits {
                lower: target(&bounds.lower, -1.0, f64::min),
                upper: target(&bounds.upper, 1.0, f64::max),
            },
            lengths: lengths.collect(),
        }
    }

    /// The target that is nearest to a state, coordinate by coordinate.
    pub fn nearest(&self, x: &DVector<f64>) -> DVector<f64> {
        let Limits { lower, upper } = &self.limits;
        DVector::from_fn(x.len(), |i, _| x[i].max(lower[i]).min(upper[i]))
    }

    /// Where the plant is to go from stage to stage of the horizon: the equilibrium, moved along the states that the plant
    /// does not notice to where the references are, as far as the bounds have room for the set about it.
    ///
    /// # Errors
    /// Something else is known ahead, or a reference is elsewhere in a state that the plant notices.
    pub fn aims(&self, names: &Names, horizon: usize, preview: &Preview) -> Result<Aims, MpcError> {
        if let Some(other) = other_than_x_ref(preview) {
            let fault = format!(
                "{other}: a controller with a certified terminal set takes references x_ref, and nothing else that is \
                 ahead; the certificate says nothing of it"
            );
            return Err(MpcError::new("preview", fault));
        }
        for (stage, x_ref) in preview.x_ref.iter().enumerate() {
            let place = match preview.x_ref.len() {
                1 => "x_ref".to_owned(),
                _ => format!("x_ref, stage {stage}"),
            };
            self.check(names, x_ref)
                .map_err(|fault| MpcError::new("preview", format!("{place}: {fault}")))?;
        }
        let wanted = |stage: usize| {
            held(&preview.x_ref, stage).map_or_else(|| self.x.clone(), |x_ref| self.nearest(x_ref))
        };
        let end = wanted(horizon);
        let mut stages: Vec<_> = (0..horizon).map(wanted).collect();
        let last_change = stages.iter().rposition(|aim| *aim != end);
        stages.truncate(last_change.map_or(0, |i| i + 1));
        Ok(Aims { stages, end })
    }

    fn check(&self, names: &Names, x_ref: &DVector<f64>) -> Result<(), String> {
        let n = self.x.len();
        if x_ref.len() != n || x_ref.iter().any(|value| !value.is_finite()) {
            return Err(format!("it must be {n} finite numbers"));
        }
        let is_fixed = |i: &usize| self.limits.lower[*i] == self.limits.upper[*i];
        let off = |i: &usize| (x_ref[*i] - self.x[*i]).abs() > 1e-9 * (1.0 + self.x[*i].abs());
        let Some(i) = (0..n).filter(is_fixed).find(off) else {
            return Ok(());
        };
        let free = (0..n).filter(|i| !is_fixed(i));
        let free: Vec<&str> = free.map(|i| names.states[i].as_str()).collect();
        let free = match free.as_slice() {
            [] => "no state".to_owned(),
            free => free.join(", "),
        };
        Err(format!(
            "{} is {}, and the certificate is about {}; elsewhere may be what no formula of the plant reads: {free}",
            names.states[i], x_ref[i], self.x[i]
        ))
    }

    /// The aims as seen from the state `x`: those far away no further than their direction counts.
    pub fn seen_from(&self, x: &DVector<f64>, aims: &Aims) -> Aims {
        let here = self.nearest(x);
        let near = |aim: &DVector<f64>| {
            DVector::from_fn(aim.len(), |i, _| {
                let far = FAR * self.lengths[i];
                aim[i].max(here[i] - far).min(here[i] + far)
            })
        };
        Aims {
            stages: aims.stages.iter().map(near).collect(),
            end: near(&aims.end),
        }
    }
}

/// What is known ahead besides the references of the states.
fn other_than_x_ref(preview: &Preview) -> Option<&'static str> {
    let Preview {
        x_ref: _,
        u_ref,
        weights,
        cross,
        linear_x,
        linear_u,
        x_bounds,
        u_bounds,
        rows,
        disturbance,
        parameters,
        y_ref,
        q_y,
        y_bounds,
        r_du,
        du_bounds,
        matrices,
        scheduling,
    } = preview;
    let lists = [
        ("u_ref", u_ref.is_empty()),
        ("q, r", weights.is_empty()),
        ("cross", cross.is_empty()),
        ("linear_x", linear_x.is_empty()),
        ("linear_u", linear_u.is_empty()),
        ("x_bounds", x_bounds.is_empty()),
        ("u_bounds", u_bounds.is_empty()),
        ("rows", rows.is_empty()),
        ("disturbance", disturbance.is_empty()),
        ("parameters", parameters.is_empty()),
        ("y_ref", y_ref.is_empty()),
        ("q_y", q_y.is_empty()),
        ("y_bounds", y_bounds.is_empty()),
        ("r_du", r_du.is_empty()),
        ("du_bounds", du_bounds.is_empty()),
        ("matrices", matrices.is_empty()),
        ("scheduling", scheduling.is_empty()),
    ];
    let mut lists = lists.into_iter();
    lists.find(|(_, is_empty)| !is_empty).map(|(name, _)| name)
}
