//! The largest terminal set of a robot that can be certified.

use ballbot_scenario::{Prepared, RobotTable, ScenarioError, TerminalCertificate};
use lpvmpc::Bounds;
use lpvmpc_certificate::{
    CertificateProblem, CertifyError, Effort, MOST_BOXES, Proof, TerminalProblem, certify_terminal,
    raise_level,
};
use lpvmpc_design::number_text;
use nalgebra::{SVector, Vector2, Vector4};
use serde::Serialize;

/// Sizes that the search looks at: multiples of a thirty-second of the bounds.
const SIZES: usize = 32;

/// A certificate and its proof.
pub type Certified = (TerminalCertificate, Proof<4>);

/// What is asked of a set.
#[derive(Clone, Debug)]
pub struct CertificateSearch<'a> {
    /// Robot, sampling time, weights and bounds.
    pub prepared: &'a Prepared,
    /// Share of the bounds of tilt and tilt rate that the set may use; `None` for the one with the
    /// largest set.
    pub size: Option<f64>,
    /// eta: what the cost decreases by beyond the stage cost, as a part of itself.
    pub contraction: f64,
    /// Level of the designed set x'Px <= level, in units of the cost.
    pub level: f64,
    /// Boxes that a proof may take.
    pub boxes: usize,
    /// Larger levels that are tried once a set is proved.
    pub trials: usize,
    /// Who writes the certificate.
    pub written_by: String,
}

/// Why there is no certificate.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// The robot has what certificates do not know.
    #[error(transparent)]
    Robot(#[from] ScenarioError),
    /// What is asked makes no sense.
    #[error("{what} is {value}: it must be {expected}", value = number_text(*value))]
    Value {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A bound of which the set would be a share is infinite.
    #[error(
        "bounds.{key} = [{lower}, {upper}]: the set of a certificate is a share of it, so it needs a finite number on \
         either side, such as --set bounds.{key}=[-{usual},{usual}]"
    )]
    Unbounded {
        /// The bound's key in a scenario.
        key: &'static str,
        /// Its lower side.
        lower: f64,
        /// Its upper side.
        upper: f64,
        /// A number that fits many robots.
        usual: f64,
    },
    /// No set could be proved.
    #[error("no certificate: {0}")]
    Certify(#[from] CertifyError),
}

/// What a search is at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Searching {
    /// Sets of several sizes are designed; this part of them is done.
    Designing(f64),
    /// A set of this share of the bounds is being proved; this part is done.
    Proving {
        /// Share of the bounds.
        size: f64,
        /// Part that is done.
        done: f64,
    },
    /// The level of a proved set is being raised; this part of the trials is done.
    Raising(f64),
}

impl CertificateSearch<'_> {
    /// A level that is usual.
    pub const LEVEL: f64 = 2000.0;
    /// A contraction that makes the proof short and P not too large.
    pub const CONTRACTION: f64 = 0.15;
    /// Boxes that are enough for the built-in robots.
    pub const BOXES: usize = 40_000;
    /// Trials after which a level hardly rises.
    pub const TRIALS: usize = 3;
    /// More trials than this bring nothing.
    pub const MOST_TRIALS: usize = 20;

    /// Designs and proves. `progress` is told what it is at.
    ///
    /// # Errors
    /// The robot has what certificates do not know; or no set could be proved.
    pub fn run(&self, progress: &(dyn Fn(Searching) + Sync)) -> Result<Certified, SearchError> {
        self.check()?;
        let robot = RobotTable::try_from(&self.prepared.ballbot)?;
        let (size, certified) = match self.size {
            Some(size) => (size, self.certify(robot, size, progress)?),
            None => self.search(robot, progress)?,
        };
        Ok(self.raise(size, certified, progress))
    }

    fn check(&self) -> Result<(), SearchError> {
        let Bounds { lower, upper } = &self.prepared.settings.x;
        for (key, j, usual) in [("theta_rad", 1, 0.5), ("theta_dot_rad_s", 3, 4.0)] {
            let (lower, upper) = (lower[j], upper[j]);
            if !(lower.is_finite() && upper.is_finite()) {
                return Err(SearchError::Unbounded {
                    key,
                    lower,
                    upper,
                    usual,
                });
            }
        }
        let share = "a share, above 0 and at most 1";
        let right = |value: f64| value > 0.0 && value <= 1.0;
        let boxes = (1..=MOST_BOXES).contains(&self.boxes);
        let asked = [
            (
                "the size",
                self.size.unwrap_or(1.0),
                share,
                self.size.is_none_or(right),
            ),
            (
                "the contraction",
                self.contraction,
                share,
                right(self.contraction),
            ),
            (
                "the level",
                self.level,
                "a positive number",
                self.level > 0.0 && self.level.is_finite(),
            ),
            (
                "the number of boxes",
                self.boxes as f64,
                "from 1 to 100000",
                boxes,
            ),
            (
                "the number of trials",
                self.trials as f64,
                "from 0 to 20",
                self.trials <= Self::MOST_TRIALS,
            ),
        ];
        match asked.into_iter().find(|(.., right)| !right) {
            None => Ok(()),
            Some((what, value, expected, _)) => Err(SearchError::Value {
                what,
                value,
                expected,
            }),
        }
    }

    /// A larger box of tilts allows a larger set, up to where the law has to cope with so many plants
    /// that the set shrinks again; the larger the set, the harder the proof. So the sizes up to the
    /// largest designed set are bisected.
    fn search(
        &self,
        robot: RobotTable,
        progress: &(dyn Fn(Searching) + Sync),
    ) -> Result<(f64, Certified), CertifyError> {
        let sizes = (1..=SIZES).map(|i| i as f64 / SIZES as f64);
        let designed: Vec<(f64, f64)> = sizes
            .enumerate()
            .map(|(done, size)| {
                progress(Searching::Designing(done as f64 / SIZES as f64));
                let design = self.problem(size).design(&robot);
                (size, design.map_or(f64::NEG_INFINITY, |set| set.log_det()))
            })
            .collect();
        let mut largest = 0;
        for (i, (_, volume)) in designed.iter().enumerate() {
            if *volume > designed[largest].1 {
                largest = i;
            }
        }
        // Below `low` there is a proof, from `high` on there is none.
        let (mut low, mut high) = (0, largest + 1);
        let mut best = None;
        loop {
            let middle = (low + high) / 2;
            let size = designed[middle].0;
            match self.certify(robot, size, progress) {
                Ok(certified) => {
                    low = middle + 1;
                    best = Some((size, certified));
                }
                Err(error) => {
                    high = middle;
                    if low == high && best.is_none() {
                        return Err(error);
                    }
                }
            }
            if low == high
                && let Some(found) = best
            {
                return Ok(found);
            }
        }
    }

    /// What is asked of the set that keeps tilt and tilt rate within `size` of their bounds.
    fn problem(&self, size: f64) -> CertificateProblem<4, 1, 2> {
        let settings = &self.prepared.settings;
        let state_limits = symmetric(&settings.x);
        let [theta, theta_dot] = [1, 3].map(|i| size * state_limits[i]);
        CertificateProblem {
            terminal: TerminalProblem {
                t_s: settings.t_s,
                q: settings.weights.q,
                r: settings.weights.r,
                state_limits: Vector4::new(state_limits[0], theta, state_limits[2], theta_dot),
                input_limits: symmetric(&settings.u),
                contraction: self.contraction,
                level: self.level,
            },
            state_limits,
            scheduling_limits: Vector2::new(theta, theta_dot),
            written_by: self.written_by.clone(),
        }
    }

    fn certify(
        &self,
        robot: RobotTable,
        size: f64,
        progress: &(dyn Fn(Searching) + Sync),
    ) -> Result<Certified, CertifyError> {
        let problem = self.problem(size);
        certify_terminal(robot, &problem, self.boxes, &|done| {
            progress(Searching::Proving { size, done });
        })
    }

    /// The certificate with the highest level that was tried and proved.
    fn raise(
        &self,
        size: f64,
        certified: Certified,
        progress: &(dyn Fn(Searching) + Sync),
    ) -> Certified {
        let effort = Effort {
            trials: self.trials,
            most_boxes: self.boxes,
        };
        let problem = self.problem(size);
        raise_level(&problem, certified, effort, &|trial, done| {
            progress(Searching::Raising(
                (trial as f64 + done) / self.trials.max(1) as f64,
            ));
        })
    }
}

/// The limit of |value| that the bounds leave on both sides.
fn symmetric<const N: usize>(bounds: &Bounds<f64, N>) -> SVector<f64, N> {
    SVector::from_fn(|i, _| bounds.upper[i].min(-bounds.lower[i]))
}

/// What was proved of a set, in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProvedSet {
    /// Sampling time, s.
    pub t_s: f64,
    /// K, for u = **-K** x, N m per rad and per rad/s.
    pub k: [f64; 4],
    /// P, by rows.
    pub p: [[f64; 4]; 4],
    /// The set is x'Px <= level.
    pub level: f64,
    /// What x'Px decreases by beyond the stage cost, as a part of itself.
    pub contraction: f64,
    /// Rate of quadratic stability in continuous time, 1/s.
    pub rate_1_s: f64,
    /// Largest |theta| and |theta_dot| of that, rad and rad/s.
    pub scheduling_limits: [f64; 2],
    /// The largest |x_i| in the set, rad and rad/s.
    pub largest_states_at_samples: [f64; 4],
    /// What no |x_i| reaches between samples, rad and rad/s.
    pub largest_states_between_samples: [f64; 4],
    /// Boxes of states in the proof.
    pub boxes: usize,
    /// Boxes of schedulings in the proof.
    pub scheduling_boxes: usize,
}

impl ProvedSet {
    /// The set of a certificate that this proof is of.
    pub fn new(certificate: &TerminalCertificate, proof: &Proof<4>) -> Self {
        let terminal = &certificate.terminal;
        Self {
            t_s: certificate.t_s,
            k: std::array::from_fn(|i| terminal.k[i]),
            p: std::array::from_fn(|i| std::array::from_fn(|j| terminal.p[(i, j)])),
            level: terminal.level,
            contraction: terminal.contraction,
            rate_1_s: certificate.continuous.rate_1_s,
            scheduling_limits: certificate.scheduling_limits.into(),
            largest_states_at_samples: terminal.largest_states().into(),
            largest_states_between_samples: proof.reach.into(),
            boxes: proof.boxes,
            scheduling_boxes: proof.scheduling_boxes,
        }
    }
}
