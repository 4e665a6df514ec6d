//! The largest error of a sample, looked for.
//!
//! The error of a sample is that of step doubling (Richardson): for a method of order four the
//! difference of n and 2 n steps is 15/16 of the error of n. Upright without rates and torque there is
//! none, and it grows with them, so what is bounded is the error per share of the bounds: the largest
//! of |tilt|, |rate| and |torque| over its bound. How far a state lies beyond both ends of a step is looked
//! for among the steps in the middle of which it turns round.
//!
//! The largest values are looked for on a grid of tilts, rates and torques over their bounds, corners included, among
//! the motions that stay within them, and from the best points of the grid on by a pattern search (Hooke and Jeeves).
//! What is taken is [`ERROR_SAFETY`] and [`BETWEEN_SAFETY`] times that, for maxima that the search misses: an estimate
//! with a factor of safety, not a proof.
//!
//! The errors of a robot point in much the same direction, that of its fastest motion, along which they die away soon
//! and cost little. So they are bounded by a parallelepiped along their principal axes on the grid, in the metric of
//! the terminal cost.

use crate::prepare::problem::dynamic;
use ballbot::{Ballbot, ControllerSettings};
use lpvmpc::{Bounds, Rk4, Rollout, share_of_bounds};
use nalgebra::{Matrix4, Vector1, Vector4};

/// What the search may miss of the error.
pub const ERROR_SAFETY: f64 = 4.0;
/// What it may miss of the ways beyond both ends of a step.
pub const BETWEEN_SAFETY: f64 = 1.5;
/// Points of the grid per state, and of the torque.
const STATES: usize = 9;
const TORQUES: usize = 5;
/// Points of the grid from which the search goes on, for each value.
const BEST: usize = 8;
/// First and last stride of the search, in shares of the bounds.
const STRIDES: [f64; 2] = [0.125, 1e-3];

/// Where to look.
pub(super) struct Search<'a> {
    pub ballbot: &'a Ballbot<f64>,
    pub plain: &'a ControllerSettings<f64>,
    /// Positive definite: that of the errors' principal axes.
    pub metric: &'a Matrix4<f64>,
}

/// The largest errors found, without a factor of safety.
pub(super) struct Found {
    rk4: Rk4,
    /// Axes of the errors, and the inverse.
    axes: Matrix4<f64>,
    inverse: Matrix4<f64>,
    /// The largest errors along the axes per share of the bounds.
    sizes: Vector4<f64>,
    between: Vector4<f64>,
    /// What the grid shows of samples: their errors per share of the bounds.
    errors: Vec<(Vector4<f64>, Motion)>,
}

impl Found {
    /// The same with the factors of safety.
    pub fn rollout(&self) -> Rollout<f64, 4> {
        Rollout {
            rk4: self.rk4,
            error: self.axes * Matrix4::from_diagonal(&(self.sizes * ERROR_SAFETY)),
            between: self.between * BETWEEN_SAFETY,
        }
    }
}

/// A sample's start: tilt and rates, and the torque.
type Motion = (Vector4<f64>, Vector1<f64>);

impl Search<'_> {
    /// What the grid shows of the errors of `rk4`; `None` where there is nothing to be seen: no motion stays within the
    /// bounds, or the metric is none.
    pub fn on_grid(&self, rk4: Rk4) -> Option<Found> {
        let of_motion = |motion| (self.error(rk4, &motion), motion);
        let errors: Vec<(Vector4<f64>, Motion)> = motions(self.ballbot, self.plain, doubled(rk4))
            .map(of_motion)
            .collect();
        // Principal axes in coordinates in which the metric is the identity: its root times the state.
        let metric = dynamic(self.metric).symmetric_eigen();
        if errors.is_empty() || !(metric.eigenvalues.min() > 0.0) {
            return None;
        }
        let root = |i: usize| metric.eigenvalues[i].sqrt();
        let factor = Matrix4::from_fn(|i, j| root(i) * metric.eigenvectors[(j, i)]);
        let moments = errors.iter().fold(Matrix4::zeros(), |sum, (error, _)| {
            let error = factor * error;
            sum + error * error.transpose()
        });
        let turned = dynamic(&moments).symmetric_eigen().eigenvectors;
        let turned = Matrix4::from_fn(|i, j| turned[(i, j)]);
        let inverse = turned.tr_mul(&factor);
        let axes = Matrix4::from_fn(|i, j| metric.eigenvectors[(i, j)] / root(j)) * turned;
        let sizes = errors.iter().map(|(error, _)| (inverse * error).abs());
        Some(Found {
            rk4,
            axes,
            inverse,
            sizes: sizes.fold(Vector4::zeros(), |most, size| most.sup(&size)),
            between: Vector4::zeros(),
            errors,
        })
    }

    /// With what is larger between the points of the grid, and how far states go beyond both ends of a step.
    pub fn between_points(&self, found: Found) -> Found {
        let (rk4, inverse) = (found.rk4, found.inverse);
        let sizes = Vector4::from_fn(|i, _| {
            let along = |error: Vector4<f64>| (inverse * error)[i].abs();
            let known = found.errors.iter();
            let known = known.map(|(error, motion)| (along(*error), *motion));
            self.climb(known.collect(), &|motion| {
                let stays = self.stays(motion, doubled(rk4), self.plain.t_s);
                stays.then(|| along(self.error(rk4, motion)))
            })
        });
        let step = self.plain.t_s / rk4.substeps as f64;
        let between = Vector4::from_fn(|i, _| {
            let turned = (0..4).map(|k| {
                let turning = |motion: &Motion| self.turning(step, i, k, motion);
                let known = grid(self.plain).filter_map(|motion| Some((turning(&motion)?, motion)));
                self.climb(known.collect(), &turning)
            });
            turned.fold(0.0, f64::max)
        });
        Found {
            sizes,
            between,
            ..found
        }
    }

    /// Whether a motion is within the bounds after so many seconds.
    fn stays(&self, (start, u): &Motion, rk4: Rk4, seconds: f64) -> bool {
        stays(&self.plain.x, &rk4.advance(self.ballbot, start, u, seconds))
    }

    /// A sample's error per share of the bounds; none at rest.
    fn error(&self, rk4: Rk4, (start, u): &Motion) -> Vector4<f64> {
        let plain = self.plain;
        let share = share_of_bounds(start, &plain.x, u, &plain.u);
        let off = |rk4: Rk4| rk4.advance(self.ballbot, start, u, plain.t_s);
        if share > 0.0 {
            (off(rk4) - off(doubled(rk4))) * (16.0 / 15.0 / share)
        } else {
            Vector4::zeros()
        }
    }

    /// How far state `i` goes beyond both ends of the step near `motion` in the middle of which it turns round: the
    /// step that is found when tilt, a rate or the torque, the one of number `k`, is changed. `None` where there is
    /// none within the bounds.
    fn turning(&self, step: f64, i: usize, k: usize, motion: &Motion) -> Option<f64> {
        const ONE: Rk4 = Rk4 { substeps: 1 };
        let limits = limits(self.plain);
        let mut place = place_of(motion, &limits);
        let end = |place: &Vector4<f64>| {
            let (start, u) = at(place, &limits);
            let end = ONE.advance(self.ballbot, &start, &u, step);
            ((end - start)[i], (start, u), end)
        };
        // Newton's method: what the ends are apart is nearly linear in rates and torque.
        for _ in 0..2 {
            const SHIFT: f64 = 1e-4;
            let mut beside = place;
            beside[k] += SHIFT;
            let apart = end(&place).0;
            place[k] -= apart * SHIFT / (end(&beside).0 - apart);
        }
        let (apart, (start, u), end) = end(&place);
        let middle = ONE.advance(self.ballbot, &start, &u, 0.5 * step);
        let bend = (middle - (start + end) * 0.5)[i].abs();
        let turns = apart.abs() < bend && (0.0..=1.0).contains(&place[k]);
        (turns && stays(&self.plain.x, &end)).then_some(bend)
    }

    /// The largest value, from the best of those that are `seen` on.
    fn climb(&self, mut seen: Vec<(f64, Motion)>, value: &dyn Fn(&Motion) -> Option<f64>) -> f64 {
        let limits = limits(self.plain);
        let mut most = 0.0_f64;
        for _ in 0..BEST {
            let best = seen.iter().enumerate();
            let best = best.max_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b));
            let Some((best, _)) = best else { break };
            let (best, motion) = seen.swap_remove(best);
            most = most.max(top(best, place_of(&motion, &limits), &limits, value));
        }
        most
    }
}

/// The value at the top of the hill on which `place` is, with the value `best`.
fn top(
    mut best: f64,
    mut place: Vector4<f64>,
    limits: &[Vector4<f64>; 2],
    value: &dyn Fn(&Motion) -> Option<f64>,
) -> f64 {
    let mut stride = STRIDES[0];
    while stride >= STRIDES[1] {
        let (from, below) = (place, best);
        for move_ in 0..8 {
            let mut neighbour = from;
            let along = if move_ % 2 == 0 { stride } else { -stride };
            neighbour[move_ / 2] = (from[move_ / 2] + along).clamp(0.0, 1.0);
            match value(&at(&neighbour, limits)) {
                Some(value) if value > best => (best, place) = (value, neighbour),
                _ => {}
            }
        }
        if !(best > below) {
            stride *= 0.5;
        }
    }
    best
}

fn doubled(rk4: Rk4) -> Rk4 {
    Rk4 {
        substeps: 2 * rk4.substeps,
    }
}

/// Lower and upper bounds of tilt, rates and torque.
fn limits(plain: &ControllerSettings<f64>) -> [Vector4<f64>; 2] {
    let of = |x: &Vector4<f64>, u: &Vector1<f64>| Vector4::new(x[1], x[2], x[3], u[0]);
    [
        of(&plain.x.lower, &plain.u.lower),
        of(&plain.x.upper, &plain.u.upper),
    ]
}

/// The start at a place between the limits, 0 to 1.
fn at(place: &Vector4<f64>, [lower, upper]: &[Vector4<f64>; 2]) -> Motion {
    let value = lower + (upper - lower).component_mul(place);
    let start = Vector4::new(0.0, value[0], value[1], value[2]);
    (start, Vector1::new(value[3]))
}

fn place_of((start, u): &Motion, [lower, upper]: &[Vector4<f64>; 2]) -> Vector4<f64> {
    let value = Vector4::new(start[1], start[2], start[3], u[0]);
    let share = |i: usize| (value[i] - lower[i]) / (upper[i] - lower[i]);
    // Of bounds without width every place is the same.
    Vector4::from_fn(|i, _| if upper[i] > lower[i] { share(i) } else { 0.0 })
}

/// States and torques on a grid over their bounds.
fn grid(plain: &ControllerSettings<f64>) -> impl Iterator<Item = Motion> {
    let limits = limits(plain);
    let point = move |point: usize| {
        let places = [
            point % STATES,
            point / STATES % STATES,
            point / STATES.pow(2) % STATES,
        ];
        let state = |i: usize| places[i] as f64 / (STATES - 1) as f64;
        let torque = (point / STATES.pow(3)) as f64 / (TORQUES - 1) as f64;
        at(&Vector4::new(state(0), state(1), state(2), torque), &limits)
    };
    (0..STATES.pow(3) * TORQUES).map(point)
}

/// Those from which a sample, with `rk4`, ends within the bounds.
pub fn motions(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    rk4: Rk4,
) -> impl Iterator<Item = Motion> {
    let ends = move |(start, u): &Motion| rk4.advance(ballbot, start, u, plain.t_s);
    grid(plain).filter(move |motion| stays(&plain.x, &ends(motion)))
}

/// Whether the tilt and the rates are within their bounds.
fn stays(bounds: &Bounds<f64, 4>, x: &Vector4<f64>) -> bool {
    (1..4).all(|i| x[i] >= bounds.lower[i] && x[i] <= bounds.upper[i])
}
