//! Random problems with everything at once, and the preview that says so.

use super::plants::{NU, NX, Scheduled};
use lpvmpc::{
    Bounds, ControllerSettings, GeneralRow, Iterations, Penalty, Preview, Reference, SoftBounds,
    TerminalIngredient, Weights,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{SMatrix, SVector, Vector1};

pub const T_S: f64 = 0.1;
pub type Row = GeneralRow<f64, NX, NU>;
pub type Settings = ControllerSettings<f64, NX, NU, 1>;

/// A problem of one sample, each list as long as it happened to become.
#[derive(Clone, Debug)]
pub struct Case {
    pub plant: Scheduled<f64>,
    pub horizon: usize,
    pub x0: SVector<f64, NX>,
    pub x_ref: Vec<SVector<f64, NX>>,
    pub u_ref: Vec<SVector<f64, NU>>,
    pub weights: Vec<Weights<f64, NX, NU>>,
    pub cross: Vec<SMatrix<f64, NU, NX>>,
    pub linear_x: Vec<SVector<f64, NX>>,
    pub linear_u: Vec<SVector<f64, NU>>,
    pub p: SMatrix<f64, NX, NX>,
    pub x: Vec<Bounds<f64, NX>>,
    pub soft_x: Vec<SoftBounds<f64, NX>>,
    pub u: Vec<Bounds<f64, NU>>,
    pub rows: Vec<Vec<Row>>,
    pub disturbance: Vec<SVector<f64, NX>>,
    pub scheduling: Vec<Vector1<f64>>,
    pub models: Vec<Scheduled<f64>>,
}

/// Whether a random problem may be infeasible, and whether only prices stand against it.
#[derive(Clone, Copy, PartialEq)]
pub enum Hardness {
    Soft,
    Hard,
}

fn weight<const K: usize>(rng: &mut Rng, shift: f64) -> SMatrix<f64, K, K> {
    let root = rng.matrix::<K, K>();
    root.transpose() * root + SMatrix::identity() * shift
}

/// S = M K L' with Q = L L', R = M M' and |K| < 1, so that Q - S' R^-1 S = L (1 - K'K) L'.
fn cross(rng: &mut Rng, Weights { q, r }: &Weights<f64, NX, NU>) -> SMatrix<f64, NU, NX> {
    let k = rng.matrix::<NU, NX>();
    let k = k * (rng.uniform(0.0, 0.99) / k.norm());
    let (l, m) = (q.cholesky().unwrap().l(), r.cholesky().unwrap().l());
    m * k * l.transpose()
}

fn around<const K: usize>(rng: &mut Rng, width: f64) -> Bounds<f64, K> {
    let middle = rng.matrix::<K, 1>() * 0.1 * width;
    let half = SVector::from_fn(|_, _| width * rng.uniform(0.5, 1.5));
    Bounds {
        lower: middle - half,
        upper: middle + half,
    }
}

fn price(rng: &mut Rng) -> Penalty<f64> {
    Penalty {
        linear: rng.power_of_ten(-1.0, 3.0),
        quadratic: if rng.chance(0.5) {
            0.0
        } else {
            rng.power_of_ten(-1.0, 3.0)
        },
    }
}

fn plant(rng: &mut Rng) -> Scheduled<f64> {
    Scheduled {
        a: rng.matrix() * 0.8,
        a_s: rng.matrix() * 0.5,
        b: rng.matrix(),
    }
}

/// `most` entries at most, none in one of six.
fn list<V>(rng: &mut Rng, most: usize, mut entry: impl FnMut(&mut Rng) -> V) -> Vec<V> {
    let length = if rng.chance(1.0 / 6.0) {
        0
    } else {
        1 + rng.index(most)
    };
    (0..length).map(|_| entry(rng)).collect()
}

impl Case {
    pub fn random(rng: &mut Rng, hardness: Hardness) -> Self {
        let horizon = 1 + rng.index(12);
        let most = horizon + 3;
        let row = |rng: &mut Rng| {
            let (of_state, of_input) = match rng.index(3) {
                0 => (1.0, 0.0),
                1 => (0.0, 1.0),
                _ => (1.0, 1.0),
            };
            let width = rng.power_of_ten(-0.5, 0.5);
            let open = rng.chance(0.5);
            Row {
                x: rng.matrix() * of_state,
                u: rng.matrix() * of_input,
                lower: if open { f64::NEG_INFINITY } else { -width },
                upper: width * rng.uniform(0.5, 1.0),
                soft: (hardness == Hardness::Soft || rng.chance(0.5)).then(|| price(rng)),
            }
        };
        let mut case = Self {
            plant: plant(rng),
            horizon,
            x0: rng.matrix(),
            x_ref: (0..=horizon).map(|_| rng.matrix() * 0.5).collect(),
            u_ref: list(rng, most, |rng| rng.matrix() * 0.3),
            weights: list(rng, most, |rng| Weights {
                q: weight(rng, 0.0),
                r: weight(rng, 0.3),
            }),
            cross: Vec::new(),
            linear_x: Vec::new(),
            linear_u: Vec::new(),
            p: weight(rng, 0.0),
            x: list(rng, most, |rng| {
                let mut x = around(rng, 1.5);
                let free = rng.index(NX);
                (x.lower[free], x.upper[free]) = (f64::NEG_INFINITY, f64::INFINITY);
                x
            }),
            soft_x: list(rng, most, |rng| {
                [(); NX]
                    .map(|()| (hardness == Hardness::Soft || rng.chance(0.7)).then(|| price(rng)))
            }),
            u: list(rng, most, |rng| around(rng, 1.0)),
            rows: list(rng, most, |rng| {
                (0..rng.index(3)).map(|_| row(rng)).collect::<Vec<_>>()
            }),
            disturbance: list(rng, most, |rng| rng.matrix() * 0.5),
            scheduling: list(rng, most, |rng| Vector1::new(rng.uniform(-1.0, 1.0))),
            models: if rng.chance(0.3) {
                list(rng, most, plant)
            } else {
                Vec::new()
            },
        };
        case.linear_x = list(rng, most, |rng| rng.matrix() * 0.5);
        case.linear_u = list(rng, most, |rng| rng.matrix() * 0.5);
        if rng.chance(0.5) {
            // As many as there are weights: each stage has a pair that makes sense.
            let weights = case.weights.iter();
            case.cross = weights.map(|weights| cross(rng, weights)).collect();
        }
        if case.weights.is_empty() {
            let identities = Weights {
                q: SMatrix::identity(),
                r: SMatrix::identity(),
            };
            case.cross = list(rng, most, |rng| cross(rng, &identities));
        }
        case
    }

    /// Settings that stand for what the preview leaves empty.
    pub fn settings(&self, iterations: Iterations<f64>) -> Settings {
        let weights = Weights {
            q: SMatrix::identity(),
            r: SMatrix::identity(),
        };
        let u = Bounds {
            lower: SVector::repeat(-1.5),
            upper: SVector::repeat(1.2),
        };
        let mut x = Bounds::none();
        (x.lower[0], x.upper[1]) = (-1.0, 1.0);
        let soft = Penalty {
            linear: 20.0,
            quadratic: 3.0,
        };
        ControllerSettings {
            x,
            soft_x: [Some(soft); NX],
            iterations,
            input_reference: lpvmpc::InputReference::Given(SVector::repeat(0.1)),
            ..Settings::new(
                T_S,
                self.horizon,
                weights,
                TerminalIngredient::Cost(SMatrix::identity()),
                u,
            )
        }
    }

    /// Rows by stage, as a preview takes them.
    pub fn row_lists(&self) -> Vec<&[Row]> {
        self.rows.iter().map(Vec::as_slice).collect()
    }

    pub fn preview<'a>(
        &'a self,
        rows: &'a [&'a [Row]],
    ) -> Preview<'a, Scheduled<f64>, f64, NX, NU, 1> {
        let (end, stages) = self.x_ref.split_last().unwrap();
        Preview {
            reference: Reference {
                stages,
                terminal: *end,
            },
            u_ref: &self.u_ref,
            weights: &self.weights,
            cross: &self.cross,
            linear_x: &self.linear_x,
            linear_u: &self.linear_u,
            terminal: Some(TerminalIngredient::Cost(self.p)),
            x: &self.x,
            soft_x: &self.soft_x,
            u: &self.u,
            rows,
            disturbance: &self.disturbance,
            scheduling: &self.scheduling,
            models: &self.models,
            outputs: None,
        }
    }
}
