//! Bounds as tight as a share of active ones needs.

use crate::closed_loop::{Sequence, needed, within};
use crate::plant::Plant;
use crate::{Recipe, SequenceError};

/// Where bounds that are never active lie, as a multiple of what plans need.
const FAR: f64 = 1.5;
/// The search ends this near, and nothing farther than the second is an answer.
const NEAR: f64 = 0.01;
const FARTHEST: f64 = 0.05;
/// Bisections, so that scales are multiples of 1/65 536.
const BISECTIONS: usize = 16;

/// The sequence whose share is nearest to what the recipe asks for.
///
/// # Errors
/// As [`Recipe::make`].
pub fn with_share<const NX: usize, const NU: usize>(
    recipe: &Recipe,
    plant: &impl Plant<NX, NU>,
) -> Result<Sequence<NX, NU>, SequenceError> {
    let limits = needed(recipe, plant)?;
    if recipe.share == 0.0 {
        return within(recipe, plant, &limits.scaled(FAR));
    }
    // Nothing is active at a scale of 1, but for where bounds change the loop.
    let (mut tight, mut wide) = (0.0, 1.0);
    let mut nearest: Option<Sequence<NX, NU>> = None;
    let distance = |sequence: &Sequence<NX, NU>| (sequence.share - recipe.share).abs();
    for _ in 0..BISECTIONS {
        let scale = 0.5 * (tight + wide);
        let found = within(recipe, plant, &limits.scaled(scale))?;
        if found.share > recipe.share {
            tight = scale;
        } else {
            wide = scale;
        }
        if nearest
            .as_ref()
            .is_none_or(|known| distance(&found) < distance(known))
        {
            nearest = Some(found);
        }
        if nearest
            .as_ref()
            .is_some_and(|known| distance(known) <= NEAR)
        {
            break;
        }
    }
    let refused = |nearest| SequenceError::Share {
        wanted: recipe.share,
        nearest,
    };
    let sequence = nearest.ok_or(refused(0.0))?;
    if distance(&sequence) <= FARTHEST {
        Ok(sequence)
    } else {
        Err(refused(sequence.share))
    }
}
