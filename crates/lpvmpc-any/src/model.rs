//! The linear models of a plant in places that were compiled.

use crate::error::MpcError;
use crate::linear_model::LinearModel;
use crate::settings::LinearModels;
use lpvmpc::{
    AlongMotion, AlongRay, Dynamics, Embedding, GaussLegendre, LpvModel, Number, Scalar, Tangent,
};
use lpvmpc_plant::{Plant, SizedEmbedding, SizedPlant};
use nalgebra::{SMatrix, SVector};

/// A plant in more places than it has states. What stands in those left over decays, x_dot = -x or x+ = 0, so
/// that it stays zero and a steady state of all is one of the plant.
#[derive(Debug, Clone)]
pub(crate) struct Filled<P> {
    plant: P,
    states: usize,
}

impl<P> Filled<P> {
    /// The first of `places` that decays as x_dot = -x: in discrete time none, where what
    /// nothing moves is zero after a period.
    #[inline(always)]
    fn first_decaying(&self, places: usize, period: impl FnOnce() -> Option<f64>) -> usize {
        if self.states >= places || period().is_some() {
            return places;
        }
        self.states
    }
}

impl<const NX: usize, const NU: usize> Dynamics<NX, NU> for Filled<SizedPlant<NX, NU>> {
    fn period(&self) -> Option<f64> {
        Dynamics::period(&self.plant)
    }

    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let from = self.first_decaying(NX, || self.period());
        decaying(self.plant.f(x, u), x, from)
    }

    const TOGETHER: bool = true;

    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let there = Dynamics::tangent_each(&self.plant, x, u, tangents);
        fill(tangents, x, self.first_decaying(NX, || self.period()));
        there
    }
}

/// What decays, from this state on.
fn fill<T: Scalar, const NX: usize, const NU: usize>(
    tangents: &mut [Tangent<T, NX, NU>],
    x: &[SVector<T, NX>],
    from: usize,
) {
    for ((rate, a, _), x) in tangents.iter_mut().zip(x) {
        for i in from..NX {
            rate[i] = -x[i];
            a[(i, i)] = -T::one();
        }
    }
}

fn decaying<N: Number, const NX: usize>(
    mut rate: SVector<N, NX>,
    x: &SVector<N, NX>,
    from: usize,
) -> SVector<N, NX> {
    for i in from..NX {
        rate[i] = -x[i];
    }
    rate
}

impl<const NX: usize, const NU: usize, const NS: usize> Embedding<NX, NU, NS>
    for Filled<SizedEmbedding<NX, NU, NS>>
{
    fn period(&self) -> Option<f64> {
        Embedding::period(&self.plant)
    }

    fn scheduling<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NS> {
        Embedding::scheduling(&self.plant, x, u)
    }

    fn matrices<N: Number>(
        &self,
        scheduling: &SVector<N, NS>,
    ) -> (SMatrix<N, NX, NX>, SMatrix<N, NX, NU>) {
        let (mut a, b) = Embedding::matrices(&self.plant, scheduling);
        for i in self.first_decaying(NX, || Embedding::period(self))..NX {
            a[(i, i)] = N::constant(-1.0);
        }
        (a, b)
    }

    fn offset<N: Number>(&self, scheduling: &SVector<N, NS>) -> Option<SVector<N, NX>> {
        Embedding::offset(&self.plant, scheduling)
    }

    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let from = self.first_decaying(NX, || Embedding::period(self));
        decaying(Embedding::f(&self.plant, x, u), x, from)
    }

    fn tangent<T: Scalar + Number>(
        &self,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> Tangent<T, NX, NU> {
        let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros())];
        Embedding::tangent_each(self, &[*x], &[*u], &mut tangents);
        let [tangent] = tangents;
        tangent
    }

    const TOGETHER: bool = true;

    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        Embedding::tangent_each(&self.plant, x, u, tangents);
        fill(
            tangents,
            x,
            self.first_decaying(NX, || Embedding::period(self)),
        );
    }

    fn embedded_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let there = Embedding::embedded_each(&self.plant, x, u, tangents);
        fill(
            tangents,
            x,
            self.first_decaying(NX, || Embedding::period(self)),
        );
        there
    }
}

/// Nodes along a ray where none are asked for: of a cart-pole's closed loops from 200 random starts
/// fewest were dearer than the best known (`cargo run --release -p lpvmpc-any --example
/// linear_models`).
pub const USUAL_NODES: usize = 2;

/// A plant with its linear models.
#[derive(Debug, Clone)]
pub(crate) enum Model<const NX: usize, const NU: usize, const NS: usize> {
    Motion(AlongMotion<Filled<SizedPlant<NX, NU>>, NS>),
    Ray(Box<AlongRay<Filled<SizedPlant<NX, NU>>, f64, NX, NU, NS>>),
    Own(Filled<SizedEmbedding<NX, NU, NS>>),
    Given(Box<LinearModel<NX, NU>>),
}

impl<const NX: usize, const NU: usize, const NS: usize> Model<NX, NU, NS> {
    /// `plant` with the linear models that are wanted; rays begin at (`x`, `u`).
    pub fn new(
        plant: &Plant,
        models: LinearModels,
        (x, u): (SVector<f64, NX>, SVector<f64, NU>),
    ) -> Result<Self, MpcError> {
        let states = plant.data().states.len();
        let filled = || -> Result<_, MpcError> {
            let plant = SizedPlant::new(plant.clone())?;
            Ok(Filled { plant, states })
        };
        Ok(match models {
            LinearModels::Own if plant.data().embedding.is_some() => Self::Own(Filled {
                plant: SizedEmbedding::new(plant.clone())?,
                states,
            }),
            LinearModels::AlongMotion => Self::Motion(AlongMotion(filled()?)),
            LinearModels::Own | LinearModels::AlongRay { .. } => {
                let nodes = match models {
                    LinearModels::AlongRay { nodes } => nodes,
                    _ => USUAL_NODES,
                };
                if nodes == 0 || nodes > GaussLegendre::MOST {
                    let fault =
                        format!("{nodes} nodes; there must be 1 to {}", GaussLegendre::MOST);
                    return Err(MpcError::new("linear_models", fault));
                }
                Self::Ray(Box::new(AlongRay {
                    plant: filled()?,
                    x,
                    u,
                    nodes: GaussLegendre::with_nodes(nodes),
                }))
            }
        })
    }
}

/// The same expression for whichever model it is.
macro_rules! whichever {
    ($model:expr, $is:ident => $answer:expr) => {
        match $model {
            Model::Motion($is) => $answer,
            Model::Ray($is) => {
                let $is = &**$is;
                $answer
            }
            Model::Own($is) => $answer,
            Model::Given($is) => {
                let $is = &**$is;
                $answer
            }
        }
    };
}

impl<const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NU, NS>
    for Model<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::period(model))
    }

    fn scheduling(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NS> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::scheduling(model, x, u))
    }

    fn matrices(
        &self,
        scheduling: &SVector<f64, NS>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::matrices(model, scheduling))
    }

    fn offset(&self, scheduling: &SVector<f64, NS>) -> Option<SVector<f64, NX>> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::offset(model, scheduling))
    }

    fn embedded(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::embedded(model, x, u))
    }

    #[inline(always)]
    fn derivative(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::derivative(model, x, u))
    }

    fn jacobian(
        &self,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::jacobian(model, x, u))
    }

    fn tangent(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> Tangent<f64, NX, NU> {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::tangent(model, x, u))
    }

    const TOGETHER: bool = true;

    fn embedded_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::embedded_each(model, x, u, tangents));
    }

    fn tangent_each<const POINTS: usize>(
        &self,
        x: &[SVector<f64, NX>; POINTS],
        u: &[SVector<f64, NU>; POINTS],
        tangents: &mut [Tangent<f64, NX, NU>; POINTS],
    ) {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::tangent_each(model, x, u, tangents));
    }

    fn has_offset(&self) -> bool {
        whichever!(self, model => LpvModel::<f64, NX, NU, NS>::has_offset(model))
    }
}
