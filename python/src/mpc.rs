//! Controllers.

use crate::arrays::{Matrices, Matrix, Vector, entries, matrix, pairs, rows, stack};
use crate::errors::{of_certificate, of_setting, setting};
use crate::plan::{PlanTuple, fields};
use crate::plant::Plant;
use lpvmpc_any::{
    Disturbance, EstimatorSettings, Gate, Iterations, Limits, LinearModels, MpcSettings, Penalty,
    Preview, Row, StageMatrices, StateBounds, Terminal, Verdict,
};
use lpvmpc_certify::Certificate;
use nalgebra::{DMatrix, DVector};
use pyo3::prelude::*;

/// A linear row: name, coefficients of x and u, bounds, linear and quadratic price.
type RowTuple = (String, Vec<f64>, Vec<f64>, f64, f64, Option<(f64, f64)>);

fn row((name, x, u, lower, upper, soft): RowTuple) -> Row {
    Row {
        name,
        x: DVector::from_vec(x),
        u: DVector::from_vec(u),
        lower,
        upper,
        soft: soft.map(penalty),
    }
}

fn penalty((linear, quadratic): (f64, f64)) -> Penalty<f64> {
    Penalty { linear, quadratic }
}

fn limits((lower, upper): (Vec<f64>, Vec<f64>)) -> Limits {
    Limits { lower, upper }
}

/// The price of a state bound, as Python hands it over.
#[derive(FromPyObject)]
enum StateBoundsArgument {
    Word(String),
    Prices(Vec<Option<(f64, f64)>>),
}

impl StateBoundsArgument {
    fn build(self, place: &str) -> PyResult<StateBounds> {
        Ok(match self {
            Self::Prices(prices) => {
                let prices = prices.into_iter();
                StateBounds::Priced(prices.map(|price| price.map(penalty)).collect())
            }
            Self::Word(word) => match word.as_str() {
                "soft" => StateBounds::Soft,
                "hard" => StateBounds::Hard,
                _ => {
                    let right = "\"soft\", \"hard\" or prices by name";
                    return Err(one_of(place, &word, right));
                }
            },
        })
    }
}

/// A terminal ingredient, as Python hands it over.
#[derive(FromPyObject)]
enum TerminalArgument<'py> {
    Word(String),
    /// The text of a certificate, in a tuple.
    Certificate((String,)),
    Cost(Matrix<'py>),
}

/// Settings, as Python hands them over: all keys are there.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings<'py> {
    t_s: f64,
    horizon: usize,
    substeps: usize,
    q: Matrix<'py>,
    r: Matrix<'py>,
    terminal: TerminalArgument<'py>,
    x_bounds: Option<(Vec<f64>, Vec<f64>)>,
    u_bounds: Option<(Vec<f64>, Vec<f64>)>,
    state_bounds: StateBoundsArgument,
    u_ref: Option<Vector<'py>>,
    rows: Vec<RowTuple>,
    q_y: Option<Matrix<'py>>,
    y_bounds: Option<(Vec<f64>, Vec<f64>)>,
    output_bounds: StateBoundsArgument,
    r_du: Option<Matrix<'py>>,
    du_bounds: Option<(Vec<f64>, Vec<f64>)>,
    linear_models: String,
    nodes: usize,
    method: String,
    max_programs: usize,
    first_programs: usize,
    tolerance: f64,
}

impl Settings<'_> {
    pub fn build(self, plant: &lpvmpc_plant::Plant) -> PyResult<MpcSettings> {
        Ok(MpcSettings {
            t_s: self.t_s,
            horizon: self.horizon,
            substeps: self.substeps,
            q: matrix(&self.q),
            r: matrix(&self.r),
            terminal: match self.terminal {
                TerminalArgument::Cost(p) => Terminal::Cost(matrix(&p)),
                TerminalArgument::Certificate((text,)) => {
                    let certificate = Certificate::from_json(&text).map_err(of_certificate)?;
                    let set = certificate.terminal_set(plant).map_err(of_certificate)?;
                    Terminal::Certified(Box::new(set))
                }
                TerminalArgument::Word(word) => match word.as_str() {
                    "lqr" => Terminal::Lqr,
                    "equality" => Terminal::Equality,
                    _ => {
                        return Err(one_of(
                            "terminal",
                            &word,
                            "\"lqr\", \"equality\", a matrix P or a Certificate",
                        ));
                    }
                },
            },
            x_bounds: self.x_bounds.map(limits),
            u_bounds: self.u_bounds.map(limits),
            state_bounds: self.state_bounds.build("state_bounds")?,
            u_ref: self.u_ref.map(|u_ref| DVector::from_vec(entries(&u_ref))),
            rows: self.rows.into_iter().map(row).collect(),
            q_y: self.q_y.as_ref().map(matrix),
            y_bounds: self.y_bounds.map(limits),
            output_bounds: self.output_bounds.build("output_bounds")?,
            r_du: self.r_du.as_ref().map(matrix),
            du_bounds: self.du_bounds.map(limits),
            linear_models: match self.linear_models.as_str() {
                "own" => LinearModels::Own,
                "motion" => LinearModels::AlongMotion,
                "ray" => LinearModels::AlongRay { nodes: self.nodes },
                other => {
                    return Err(one_of(
                        "linear_models",
                        other,
                        "\"own\", \"motion\" or \"ray\"",
                    ));
                }
            },
            iterations: match self.method.as_str() {
                "descent" => Iterations::Descent {
                    tolerance: self.tolerance,
                    most: self.max_programs,
                    first: self.first_programs,
                },
                "fixed" => Iterations::Fixed(self.max_programs),
                other => return Err(one_of("method", other, "\"descent\" or \"fixed\"")),
            },
        })
    }
}

fn one_of(place: &str, found: &str, right: &str) -> PyErr {
    setting(place, &format!("it is {found:?}; it must be {right}"))
}

/// What is known ahead, as Python hands it over: every key but the first may be absent.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Known<'py> {
    x_ref: Option<Matrix<'py>>,
    #[pyo3(default)]
    u_ref: Option<Matrix<'py>>,
    #[pyo3(default)]
    q: Option<Matrices<'py>>,
    #[pyo3(default)]
    r: Option<Matrices<'py>>,
    #[pyo3(default)]
    cross: Option<Matrices<'py>>,
    #[pyo3(default)]
    linear_x: Option<Matrix<'py>>,
    #[pyo3(default)]
    linear_u: Option<Matrix<'py>>,
    #[pyo3(default)]
    x_lower: Option<Matrix<'py>>,
    #[pyo3(default)]
    x_upper: Option<Matrix<'py>>,
    #[pyo3(default)]
    u_lower: Option<Matrix<'py>>,
    #[pyo3(default)]
    u_upper: Option<Matrix<'py>>,
    #[pyo3(default)]
    rows: Option<Vec<Vec<RowTuple>>>,
    #[pyo3(default)]
    disturbance: Option<Matrix<'py>>,
    #[pyo3(default)]
    parameters: Option<Matrix<'py>>,
    #[pyo3(default)]
    y_ref: Option<Matrix<'py>>,
    #[pyo3(default)]
    q_y: Option<Matrices<'py>>,
    #[pyo3(default)]
    y_lower: Option<Matrix<'py>>,
    #[pyo3(default)]
    y_upper: Option<Matrix<'py>>,
    #[pyo3(default)]
    r_du: Option<Matrices<'py>>,
    #[pyo3(default)]
    du_lower: Option<Matrix<'py>>,
    #[pyo3(default)]
    du_upper: Option<Matrix<'py>>,
    #[pyo3(default)]
    a: Option<Matrices<'py>>,
    #[pyo3(default)]
    b: Option<Matrices<'py>>,
    #[pyo3(default)]
    c: Option<Matrix<'py>>,
    #[pyo3(default)]
    scheduling: Option<Matrix<'py>>,
}

fn bounds(
    place: &str,
    lower: Option<&Matrix<'_>>,
    upper: Option<&Matrix<'_>>,
) -> PyResult<Vec<Limits>> {
    let pairs = pairs(place, rows(lower), rows(upper))?;
    let pairs = pairs.into_iter();
    Ok(pairs
        .map(|(lower, upper)| Limits {
            lower: lower.as_slice().to_vec(),
            upper: upper.as_slice().to_vec(),
        })
        .collect())
}

impl Known<'_> {
    fn build(self) -> PyResult<Preview> {
        let weights: Vec<(DMatrix<f64>, DMatrix<f64>)> =
            pairs("weights", stack(self.q.as_ref()), stack(self.r.as_ref()))?;
        let parameters = rows(self.parameters.as_ref());
        let pairs_of_stages = pairs("a, b", stack(self.a.as_ref()), stack(self.b.as_ref()))?;
        let affine = rows(self.c.as_ref());
        let matrices = pairs_of_stages.into_iter().enumerate();
        let matrices = matrices.map(|(stage, (a, b))| StageMatrices {
            a,
            b,
            affine: affine.get(stage).cloned(),
        });
        Ok(Preview {
            y_ref: rows(self.y_ref.as_ref()),
            q_y: stack(self.q_y.as_ref()),
            y_bounds: bounds("y_bounds", self.y_lower.as_ref(), self.y_upper.as_ref())?,
            r_du: stack(self.r_du.as_ref()),
            du_bounds: bounds("du_bounds", self.du_lower.as_ref(), self.du_upper.as_ref())?,
            matrices: matrices.collect(),
            scheduling: rows(self.scheduling.as_ref()),
            x_ref: rows(self.x_ref.as_ref()),
            u_ref: rows(self.u_ref.as_ref()),
            weights,
            cross: stack(self.cross.as_ref()),
            linear_x: rows(self.linear_x.as_ref()),
            linear_u: rows(self.linear_u.as_ref()),
            x_bounds: bounds("x_bounds", self.x_lower.as_ref(), self.x_upper.as_ref())?,
            u_bounds: bounds("u_bounds", self.u_lower.as_ref(), self.u_upper.as_ref())?,
            rows: match self.rows {
                Some(stages) => {
                    let stages = stages.into_iter();
                    stages
                        .map(|rows| rows.into_iter().map(row).collect())
                        .collect()
                }
                None => Vec::new(),
            },
            disturbance: rows(self.disturbance.as_ref()),
            parameters: parameters
                .iter()
                .map(|values| values.as_slice().to_vec())
                .collect(),
        })
    }
}

/// An estimator, as Python hands it over: all keys are there.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Estimator {
    measured: Vec<String>,
    measurement_noise: Vec<f64>,
    state_noise: Vec<f64>,
    start: Option<Vec<f64>>,
    initial_state: Vec<f64>,
    /// Where each acts, its noise and its variance at the start.
    disturbances: Vec<(String, f64, f64)>,
    delay: f64,
    /// Deviations, patience, oldest reading, longest gap.
    gate: (f64, usize, f64, f64),
}

impl From<Estimator> for EstimatorSettings {
    fn from(given: Estimator) -> Self {
        let disturbance = |(on, noise, initial)| Disturbance { on, noise, initial };
        let (deviations, patience, oldest, longest_gap) = given.gate;
        Self {
            measured: given.measured,
            measurement_noise: given.measurement_noise,
            state_noise: given.state_noise,
            start: given.start,
            initial_state: given.initial_state,
            disturbances: given.disturbances.into_iter().map(disturbance).collect(),
            delay: given.delay,
            gate: Gate {
                deviations,
                patience,
                oldest,
                longest_gap,
            },
        }
    }
}

/// The word for what became of a reading.
fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Used => "used",
        Verdict::UsedAfterBlow => "used after a blow",
        Verdict::Missing => "missing",
        Verdict::NotNeeded => "not needed",
        Verdict::NotFinite => "not finite",
        Verdict::Stale => "stale",
        Verdict::Repeated => "repeated",
        Verdict::Outlier => "outlier",
    }
}

/// The controller of a plant.
#[pyclass(module = "lpvmpc._lpvmpc")]
pub struct Mpc {
    inner: lpvmpc_any::Mpc,
}

#[pymethods]
impl Mpc {
    #[new]
    fn new(py: Python<'_>, plant: &Plant, settings: Settings<'_>) -> PyResult<Self> {
        let settings = settings.build(&plant.inner)?;
        let inner = py.detach(|| lpvmpc_any::Mpc::new(&plant.inner, &settings));
        Ok(Self {
            inner: inner.map_err(of_setting)?,
        })
    }

    fn step<'py>(
        &mut self,
        py: Python<'py>,
        x: Vector<'py>,
        known: Option<Known<'py>>,
    ) -> PyResult<PlanTuple<'py>> {
        let x = entries(&x);
        let preview = match known {
            Some(known) => known.build()?,
            None => Preview::default(),
        };
        let inner = &mut self.inner;
        let plan = py.detach(|| inner.step(&x, &preview));
        Ok(fields(py, plan.map_err(of_setting)?))
    }

    fn set_estimator(&mut self, settings: Option<Estimator>) -> PyResult<()> {
        let settings = settings.map(EstimatorSettings::from);
        self.inner
            .set_estimator(settings.as_ref())
            .map_err(of_setting)
    }

    fn observe(&mut self, t: f64, readings: Vec<Option<f64>>) -> PyResult<Vec<&'static str>> {
        let verdicts = self.inner.observe(t, &readings).map_err(of_setting)?;
        Ok(verdicts.into_iter().map(verdict).collect())
    }

    fn decide<'py>(&mut self, py: Python<'py>, known: Known<'py>) -> PyResult<PlanTuple<'py>> {
        let preview = known.build()?;
        let inner = &mut self.inner;
        let plan = py.detach(|| inner.decide(&preview));
        Ok(fields(py, plan.map_err(of_setting)?))
    }

    /// State and disturbances.
    #[getter]
    fn estimate(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let estimate = self.inner.estimate()?;
        Some((estimate.x, estimate.disturbances))
    }

    fn set(&mut self, settings: Settings<'_>, estimator: Option<Estimator>) -> PyResult<()> {
        let settings = settings.build(self.inner.plant())?;
        let estimator = estimator.map(EstimatorSettings::from);
        self.inner
            .set(&settings, estimator.as_ref())
            .map_err(of_setting)
    }

    fn set_parameters(&mut self, values: Vec<(String, f64)>) -> PyResult<()> {
        let values = values.iter().map(|(name, value)| (name.as_str(), *value));
        self.inner.set_parameters(values).map_err(of_setting)
    }

    fn set_last_input(&mut self, u: Vec<f64>) -> PyResult<()> {
        self.inner.set_last_input(&u).map_err(of_setting)
    }

    fn reset(&mut self) {
        self.inner.reset();
    }
}
