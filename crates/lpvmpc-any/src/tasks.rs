//! What outputs and changes of the input are to do over a horizon.

use crate::settings::Limits;
use crate::stage_lists::held;
use lpvmpc::{Dual, OutputGoal, Outputs, Penalty, VisitTangent};
use lpvmpc_plant::{Operation, Plant, PlantData};
use nalgebra::{DMatrix, DVector, SVector};

/// What a bound of the controller's outputs is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum About {
    /// The plant's output of this index.
    Output(usize),
    /// The change of the input of this index.
    Change(usize),
}

/// The outputs of a plant in places that were compiled, and the changes of its inputs; lists by stage, whose last
/// entries hold on.
///
/// What is weighted is F y with F'F = Q_y, and the same of the changes, so that each entry is an
/// output with a weight of its own.
#[derive(Debug)]
pub(crate) struct Tasks<const NX: usize, const NU: usize, const NS: usize> {
    /// The plant, with the parameters of each stage.
    pub plants: Vec<Plant>,
    /// Where the last input stands among the states.
    pub last_input: Option<usize>,
    /// The bounds, first those of outputs.
    pub bounded: Vec<About>,
    /// Which outputs depend on the input.
    pub of_input: Vec<bool>,
    pub y_bounds: Vec<Limits>,
    /// Prices of the bounds of outputs.
    pub y_prices: Vec<Option<Penalty<f64>>>,
    pub du_bounds: Vec<Limits>,
    /// F of the outputs; none without weights.
    pub y_factors: Vec<DMatrix<f64>>,
    pub y_ref: Vec<DVector<f64>>,
    /// F of the changes.
    pub du_factors: Vec<DMatrix<f64>>,
}

/// F with F'F = W, of a symmetric positive semidefinite W.
pub(crate) fn factor(w: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = w.clone().symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// Which outputs of a plant depend on its input.
pub(crate) fn outputs_of_input(data: &PlantData) -> Vec<bool> {
    let mut depends: Vec<bool> = Vec::with_capacity(data.operations.len());
    for operation in &data.operations {
        let own = match *operation {
            Operation::Input(_) => true,
            Operation::Unary(_, x) => depends[x],
            Operation::Binary(_, x, y) => depends[x] || depends[y],
            _ => false,
        };
        depends.push(own);
    }
    data.output.iter().map(|result| depends[*result]).collect()
}

/// Outputs and changes with their derivatives at a point.
struct Point<const NX: usize, const NU: usize> {
    y: Vec<(f64, SVector<f64, NX>, SVector<f64, NU>)>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Tasks<NX, NU, NS> {
    fn weighted_outputs(&self) -> usize {
        self.y_factors.first().map_or(0, DMatrix::nrows)
    }

    fn weighted_changes(&self) -> usize {
        self.du_factors.first().map_or(0, DMatrix::nrows)
    }

    fn plant(&self, i: usize) -> Option<&Plant> {
        held(&self.plants, i)
    }

    /// The plant's outputs; not a number where they have none.
    fn outputs(&self, i: usize, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Vec<f64> {
        let (n, m) = self.sizes();
        let plant = self.plant(i);
        let y = plant.and_then(|plant| plant.output(&x.as_slice()[..n], &u.as_slice()[..m]).ok());
        y.unwrap_or_else(|| vec![f64::NAN; self.of_input.len()])
    }

    fn sizes(&self) -> (usize, usize) {
        let plant = self.plants.first();
        plant.map_or((0, 0), |plant| {
            let data = plant.data();
            (data.states.len(), data.inputs.len())
        })
    }

    fn point(&self, i: usize, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Point<NX, NU> {
        let (n, m) = self.sizes();
        let variable = |value: f64, place: usize| {
            let mut variable = Dual::<f64, NS>::fixed(value);
            variable.slopes[place] = 1.0;
            variable
        };
        let states: Vec<_> = (0..n).map(|k| variable(x[k], k)).collect();
        let inputs: Vec<_> = (0..m).map(|k| variable(u[k], NX + k)).collect();
        let plant = self.plant(i);
        let y = plant.and_then(|plant| plant.output(&states, &inputs).ok());
        let y = y.unwrap_or_default().into_iter().map(|y| {
            let by_x = SVector::from_fn(|k, _| y.slopes[k]);
            (y.value, by_x, SVector::from_fn(|k, _| y.slopes[NX + k]))
        });
        Point { y: y.collect() }
    }

    /// u_j - v_j with its derivatives.
    fn change(
        &self,
        j: usize,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (f64, SVector<f64, NX>, SVector<f64, NU>) {
        let (mut by_x, mut by_u) = (SVector::zeros(), SVector::zeros());
        by_u[j] = 1.0;
        let Some(at) = self.last_input else {
            return (0.0, by_x, by_u);
        };
        by_x[at + j] = -1.0;
        (u[j] - x[at + j], by_x, by_u)
    }

    fn has_outputs(&self) -> bool {
        let of_output = |about: &About| matches!(about, About::Output(_));
        self.weighted_outputs() > 0 || self.bounded.iter().any(of_output)
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> Outputs<f64, NX, NU> for Tasks<NX, NU, NS> {
    fn count(&self) -> usize {
        self.bounded.len() + self.weighted_outputs() + self.weighted_changes()
    }

    fn bounded(&self) -> usize {
        self.bounded.len()
    }

    fn depends_on_input(&self, j: usize) -> bool {
        match self.bounded.get(j) {
            Some(About::Output(k)) => self.of_input[*k],
            _ => true,
        }
    }

    fn goal(&self, i: usize, j: usize) -> OutputGoal<f64> {
        let none = OutputGoal::none();
        let within = |bounds: Option<&Limits>, k: usize| match bounds {
            Some(bounds) => (bounds.lower[k], bounds.upper[k]),
            None => (none.lower, none.upper),
        };
        match self.bounded.get(j) {
            Some(About::Output(k)) => {
                let (lower, upper) = within(held(&self.y_bounds, i), *k);
                let soft = self.y_prices[*k];
                OutputGoal {
                    lower,
                    upper,
                    soft,
                    ..none
                }
            }
            // That of stage 0 is a bound of the input itself.
            Some(About::Change(_)) if i == 0 => none,
            Some(About::Change(k)) => {
                let (lower, upper) = within(held(&self.du_bounds, i), *k);
                OutputGoal {
                    lower,
                    upper,
                    ..none
                }
            }
            None => {
                let k = j - self.bounded.len();
                let reference = match (held(&self.y_factors, i), held(&self.y_ref, i)) {
                    (Some(factor), Some(y_ref)) if k < factor.nrows() => {
                        factor.row(k).transpose().dot(y_ref)
                    }
                    _ => 0.0,
                };
                OutputGoal {
                    weight: 1.0,
                    reference,
                    ..none
                }
            }
        }
    }

    fn values(
        &self,
        i: usize,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        let y = if self.has_outputs() {
            self.outputs(i, x, u)
        } else {
            Vec::new()
        };
        for (j, about) in self.bounded.iter().enumerate() {
            visit(
                j,
                match about {
                    About::Output(k) => y[*k],
                    About::Change(k) => self.change(*k, x, u).0,
                },
            );
        }
        let mut j = self.bounded.len();
        for row in held(&self.y_factors, i)
            .iter()
            .flat_map(|factor| factor.row_iter())
        {
            visit(j, { row.iter().zip(&y) }.map(|(f, y)| f * y).sum());
            j += 1;
        }
        for row in held(&self.du_factors, i)
            .iter()
            .flat_map(|factor| factor.row_iter())
        {
            let terms = row.iter().enumerate();
            visit(j, terms.map(|(k, f)| f * self.change(k, x, u).0).sum());
            j += 1;
        }
    }

    fn tangents(
        &self,
        i: usize,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
        visit: &mut VisitTangent<'_, f64, NX, NU>,
    ) {
        let y = if self.has_outputs() {
            self.point(i, x, u).y
        } else {
            Vec::new()
        };
        let none = (f64::NAN, SVector::zeros(), SVector::zeros());
        for (j, about) in self.bounded.iter().enumerate() {
            let (value, by_x, by_u) = match about {
                About::Output(k) => *y.get(*k).unwrap_or(&none),
                About::Change(k) => self.change(*k, x, u),
            };
            visit(j, value, &by_x, &by_u);
        }
        let mut j = self.bounded.len();
        let mut combine =
            |row: &[f64], of: &dyn Fn(usize) -> (f64, SVector<f64, NX>, SVector<f64, NU>)| {
                let begin = (0.0, SVector::zeros(), SVector::zeros());
                let terms = row.iter().enumerate();
                let (value, by_x, by_u) = terms.fold(begin, |(value, by_x, by_u), (k, f)| {
                    let (v, x, u) = of(k);
                    (value + v * *f, by_x + x * *f, by_u + u * *f)
                });
                visit(j, value, &by_x, &by_u);
                j += 1;
            };
        for row in held(&self.y_factors, i)
            .iter()
            .flat_map(|factor| factor.row_iter())
        {
            let row: Vec<f64> = row.iter().copied().collect();
            combine(&row, &|k| *y.get(k).unwrap_or(&none));
        }
        for row in held(&self.du_factors, i)
            .iter()
            .flat_map(|factor| factor.row_iter())
        {
            let row: Vec<f64> = row.iter().copied().collect();
            combine(&row, &|k| self.change(k, x, u));
        }
    }
}
