//! Every number and every checkable statement of the paper beside what was computed.

use super::Reproduction;
use super::runs::Run;
use ballbot::Ballbot;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// What the paper says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Published {
    /// A number, to be met within a tolerance.
    Value {
        /// The number.
        value: f64,
        /// The tolerance.
        tolerance: f64,
    },
    /// A number that must not be exceeded.
    AtMost(f64),
    /// A number that must be reached or exceeded.
    AtLeast(f64),
}

/// Where the number that is to be met comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The paper prints it.
    Printed,
    /// The paper says it in words; the number, a tolerance or a starting point is ours.
    Derived,
    /// The paper does not say it: a check of our own.
    Own,
}

impl Source {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Printed, Self::Derived, Self::Own];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Printed => "printed",
            Self::Derived => "derived",
            Self::Own => "own check",
        }
    }
}

/// One line of the table published | computed | difference | verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Where the paper says it.
    pub place: &'static str,
    /// What it is, with its unit.
    pub quantity: &'static str,
    /// What the paper says.
    pub published: Published,
    /// What was computed.
    pub computed: f64,
    /// Where the number that is to be met comes from.
    pub source: Source,
}

impl Claim {
    fn derived(self) -> Self {
        Self {
            source: Source::Derived,
            ..self
        }
    }

    fn own(self) -> Self {
        Self {
            source: Source::Own,
            ..self
        }
    }

    /// Computed minus published.
    pub fn difference(&self) -> f64 {
        match self.published {
            Published::Value { value, .. } => self.computed - value,
            Published::AtMost(limit) | Published::AtLeast(limit) => self.computed - limit,
        }
    }

    /// Whether the computed number is what the paper says.
    pub fn agrees(&self) -> bool {
        match self.published {
            Published::Value { tolerance, .. } => self.difference().abs() <= tolerance,
            Published::AtMost(limit) => self.computed <= limit,
            Published::AtLeast(limit) => self.computed >= limit,
        }
    }
}

fn value(
    place: &'static str,
    quantity: &'static str,
    value: f64,
    tolerance: f64,
    computed: f64,
) -> Claim {
    Claim {
        place,
        quantity,
        published: Published::Value { value, tolerance },
        computed,
        source: Source::Printed,
    }
}

fn at_most(place: &'static str, quantity: &'static str, limit: f64, computed: f64) -> Claim {
    Claim {
        place,
        quantity,
        published: Published::AtMost(limit),
        computed,
        source: Source::Printed,
    }
}

fn at_least(place: &'static str, quantity: &'static str, limit: f64, computed: f64) -> Claim {
    Claim {
        place,
        quantity,
        published: Published::AtLeast(limit),
        computed,
        source: Source::Printed,
    }
}

impl Reproduction {
    /// All claims, in the order of the paper.
    pub fn claims(&self) -> Vec<Claim> {
        let mut claims = self.refinement_claims();
        claims.extend(self.model_claims());
        claims.extend(self.two_setpoints_claims());
        claims.extend(self.lissajous_claims());
        claims.extend(self.single_setpoint_claims());
        claims.extend(self.time_claims());
        claims.push(self.optimum_claim());
        claims
    }

    fn refinement_claims(&self) -> Vec<Claim> {
        let (found, printed) = (&self.refinement.ballbot, Ballbot::<f64>::paper());
        // One unit of the last printed digit.
        let (table, figure) = ("Table of b*", "Fig. convergence");
        vec![
            value(table, "b1 [m^2]", printed.b1, 1e-6, found.b1),
            value(table, "b2 [m^2]", printed.b2, 1e-6, found.b2),
            value(table, "b3 [m^2]", printed.b3, 1e-6, found.b3),
            value(table, "b4 [m^2/s]", printed.b4, 1e-5, found.b4),
            value(
                figure,
                "residual ||F(b*)||",
                0.4330,
                1e-4,
                self.refinement.damped.residual_norm,
            ),
            // The paper gives no starting point, so the count may differ by one.
            value(
                figure,
                "Gauss-Newton steps",
                5.0,
                1.0,
                self.refinement.gauss_newton.steps() as f64,
            )
            .derived(),
        ]
    }

    fn model_claims(&self) -> Vec<Claim> {
        let place = "Sec. II-D, Fig. models";
        let [first, second] = &self.regulators;
        vec![
            // "differences are buried in machine precision error": over 12 s of feedback.
            at_most(
                place,
                "LPV - nonlinear, largest",
                1e-10,
                self.models.lpv_difference,
            )
            .derived(),
            at_most(
                "Sec. II-D",
                "A - BK Hurwitz, Q of scenario 1, largest Re [1/s]",
                0.0,
                first.frozen.largest_real_part,
            )
            .derived(),
            at_most(
                "Sec. II-D",
                "A - BK Hurwitz, Q of scenario 2, largest Re [1/s]",
                0.0,
                second.frozen.largest_real_part,
            )
            .own(),
        ]
    }

    fn two_setpoints_claims(&self) -> Vec<Claim> {
        let place = "Scenario 1";
        let (lpv, linear) = (&self.runs.two_setpoints, &self.runs.two_setpoints_linear);
        let metrics = &lpv.metrics[0];
        let radius = lpv.prepared.ballbot.geometry.ball_radius;
        // "approaching the target 2 pi with satisfying accuracy" is taken as 2 %.
        let band = 0.02 * TAU;
        let arrival = lpv.reaches(TAU, band);
        let start = lpv.smallest_phi(0.0..1.0);
        vec![
            value(
                place,
                "distance of the set points 2 * 2 pi r_b [m]",
                1.5,
                0.05,
                2.0 * TAU * radius,
            ),
            at_most(
                place,
                "phi goes negative at first, smallest [rad]",
                0.0,
                start,
            )
            .derived(),
            value(
                place,
                "time when phi is within 2 % of 2 pi [s]",
                1.3,
                0.15,
                arrival,
            ),
            at_least(
                place,
                "the linear MPC is later by [s]",
                0.0,
                linear.reaches(TAU, band) - arrival,
            )
            .derived(),
            at_most(place, "largest tilt [rad]", 0.5, metrics.largest_tilt_rad),
            value(
                place,
                "phi at the end, 1 s after the jump back [rad]",
                0.0,
                0.05,
                lpv.phi_at(4.0),
            )
            .derived(),
            // "without overshooting" is taken as the same 2 % of the jump.
            at_least(
                place,
                "phi goes no further than 2 % beyond the origin, smallest after 3 s [rad]",
                -band,
                lpv.smallest_phi(3.0..f64::INFINITY),
            )
            .derived(),
            at_most(
                place,
                "largest torque [N m]",
                1.5,
                metrics.largest_torque_nm,
            ),
            at_most(
                place,
                "largest phi_dot [rad/s]",
                10.0 * PI,
                metrics.largest_phi_dot_rad_s,
            ),
            at_most(
                place,
                "largest theta_dot [rad/s]",
                TAU,
                metrics.largest_theta_dot_rad_s,
            ),
        ]
    }

    fn lissajous_claims(&self) -> Vec<Claim> {
        let place = "Scenario 2";
        let run = &self.runs.lissajous;
        let geometry = &run.prepared.ballbot.geometry;
        let extent = |plane: usize| {
            let phi = run.columns[plane].states.iter().map(|x| x[0]);
            let (low, high) = phi.fold((f64::MAX, f64::MIN), |(low, high), phi| {
                (low.min(phi), high.max(phi))
            });
            geometry.position(high - low)
        };
        let width = |plane: usize| {
            let rms = geometry.position(run.metrics[plane].rms_error_rad);
            100.0 * rms / extent(plane)
        };
        vec![
            value(
                place,
                "area of the curve's rectangle [m^2]",
                2.0,
                0.3,
                extent(0) * extent(1),
            ),
            // "accurately": the paper gives no number; one per cent is asked here.
            at_most(
                place,
                "rms distance from the reference over 70 s [% of the curve's width]",
                1.0,
                width(0).max(width(1)),
            )
            .derived(),
            at_most(place, "samples outside the bounds", 0.0, violations(run)).derived(),
        ]
    }

    fn single_setpoint_claims(&self) -> Vec<Claim> {
        let place = "Scenario 3";
        let (equality, cost) = (&self.runs.terminal_equality, &self.runs.terminal_cost);
        let planned = equality.trajectories[0].samples.len() as f64;
        let wanted = equality.prepared.samples as f64;
        let (with, without) = (&equality.metrics[0], &cost.metrics[0]);
        vec![
            at_least(
                place,
                "feasible samples with terminal equality",
                wanted,
                planned,
            )
            .derived(),
            at_most(
                place,
                "samples outside the bounds with it",
                0.0,
                violations(equality),
            )
            .derived(),
            value(
                place,
                "phi at the end with it [rad]",
                PI,
                0.01,
                equality.phi_at(4.0),
            )
            .derived(),
            at_least(
                place,
                "it loses performance: closed-loop cost rises by",
                0.0,
                with.closed_loop_cost - without.closed_loop_cost,
            )
            .derived(),
            at_least(
                place,
                "with it phi is within 2 % of pi sooner by [s]",
                0.0,
                cost.reaches(PI, 0.02 * PI) - equality.reaches(PI, 0.02 * PI),
            )
            .own(),
            at_least(
                place,
                "and overshoots pi by [rad]",
                0.0,
                equality.largest_phi() - PI,
            )
            .own(),
        ]
    }

    fn optimum_claim(&self) -> Claim {
        let quantity = "LPV MPC (descent) over nonlinear MPC, worst closed-loop cost";
        at_most("Beyond the paper", quantity, 1.01, self.optimum.worst()).own()
    }

    fn time_claims(&self) -> Vec<Claim> {
        let place = "Table of times";
        let mean = |run: &Run| {
            let times = run
                .metrics
                .iter()
                .map(|metrics| metrics.mean_step_us * 1e-3);
            times.fold(0.0, f64::max)
        };
        vec![
            at_most(
                place,
                "scenario 1, mean [ms]",
                8.6,
                mean(&self.runs.two_setpoints),
            ),
            at_most(
                place,
                "scenario 2, mean [ms]",
                8.7,
                mean(&self.runs.lissajous),
            ),
            at_most(
                place,
                "scenario 3, mean [ms]",
                5.8,
                mean(&self.runs.terminal_equality),
            ),
        ]
    }
}

fn violations(run: &Run) -> f64 {
    run.metrics
        .iter()
        .map(|metrics| metrics.violations)
        .sum::<usize>() as f64
}
