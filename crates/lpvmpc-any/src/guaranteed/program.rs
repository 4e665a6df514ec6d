//! What the controller is told, so that its plans are ones that are kept.

use super::motion::{Motion, finite_or};
use super::{Guarantee, MARGIN, Sample};
use crate::preview::Preview;
use crate::settings::{Limits, Row};
use lpvmpc::Penalty;
use nalgebra::DVector;

/// Programs are made with so much more room.
const PROGRAM_MARGIN: f64 = 2.0 * MARGIN;
/// What an end outside of the set costs, in units of what the terminal cost itself rises by there: soft, since a program
/// that cannot end there from the first plan may lead to one that can.
const PRICE: f64 = 20.0;

/// What a program is aimed at before its end.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// The references of the stages.
    AsWanted,
    /// The target alone, wherever the references are.
    Straight,
}

impl Guarantee {
    /// Bounds with room, and the tangent plane at the end.
    pub(super) fn told(&self, sample: &Sample, target: &DVector<f64>, way: Way) -> Preview {
        let Self { set, x_bounds, .. } = self;
        let moved = |bounds: &[f64]| -> Vec<f64> {
            let pairs = bounds.iter().zip(target.iter());
            pairs
                .map(|(bound, at)| bound - PROGRAM_MARGIN * finite_or(bound - at, 0.0))
                .collect()
        };
        let mut rows = Vec::new();
        if let Some(normal) = self.cut.as_ref().filter(|_| sample.level > 0.0) {
            // Of e'Pe <= level, where it is nearest to where the plan ended: at e* along P^-1 normal.
            let solved = set.p.clone().cholesky().map(|factor| factor.solve(normal));
            let size = solved.map_or(f64::INFINITY, |along| along.dot(normal).sqrt());
            let reach = sample.level.sqrt() * size;
            let upper = normal.dot(target) + reach * (1.0 - PROGRAM_MARGIN);
            // The gradient of e'Pe at e* is 2 sqrt(level) / size long.
            let linear = PRICE * 2.0 * sample.level.sqrt() / size;
            rows = vec![Vec::new(); self.horizon + 1];
            rows[self.horizon] = vec![Row {
                name: "terminal set".to_owned(),
                x: normal.clone(),
                u: DVector::zeros(set.u.len()),
                lower: f64::NEG_INFINITY,
                upper,
                soft: Some(Penalty {
                    linear,
                    quadratic: linear / reach,
                }),
            }];
        }
        Preview {
            x_ref: match way {
                Way::AsWanted => sample.aims.references(target),
                Way::Straight => vec![target.clone()],
            },
            u_ref: vec![&set.u - &sample.beside],
            x_bounds: vec![Limits {
                lower: moved(&x_bounds.lower),
                upper: moved(&x_bounds.upper),
            }],
            rows,
            ..Preview::default()
        }
    }

    pub(super) fn cut_at(&mut self, sample: &Sample, motion: &Motion) {
        if let Some(end) = motion.x.last()
            && motion.end > sample.level * (1.0 - PROGRAM_MARGIN)
            && motion.end.is_finite()
        {
            let normal = &self.set.p * (end - &motion.target);
            self.cut = Some(&normal / normal.norm());
        }
    }
}
