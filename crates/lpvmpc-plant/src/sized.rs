//! Plants with states and inputs that are counted at compile time.

use crate::error::PlantError;
use crate::plant::Plant;
use crate::prepared::Fixed;
use lpvmpc::{Bounds, Dual, Dynamics, Embedding, Number, Scalar, Tangent};
use nalgebra::{SMatrix, SVector};

/// A [`Plant`] in the places of `NX` states and `NU` inputs, of which it may need fewer: what is left over has the
/// derivative zero (is zero one period later, in discrete time), and nothing depends on it.
///
/// It is a plant known by its f: [`AlongMotion`](lpvmpc::AlongMotion) makes the model of a controller of it.
#[derive(Debug, Clone, PartialEq)]
pub struct SizedPlant<const NX: usize, const NU: usize> {
    plant: Plant,
    /// What the code of f with its derivatives has of the parameters; `None` without such a code.
    tangent: Option<Fixed>,
}

impl<const NX: usize, const NU: usize> SizedPlant<NX, NU> {
    /// `plant` in the places of `NX` states and `NU` inputs.
    ///
    /// # Errors
    /// It has more.
    pub fn new(plant: Plant) -> Result<Self, PlantError> {
        let data = plant.data();
        for (place, count, places) in [
            ("states", data.states.len(), NX),
            ("inputs", data.inputs.len(), NU),
        ] {
            if count > places {
                let fault = format!("there are {count}, and places for {places}");
                return Err(PlantError::new(place, fault));
            }
        }
        let code = plant.formulas().tangent();
        let tangent = code.map(|code| code.fixed(plant.parameters()));
        Ok(Self { plant, tangent })
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// See [`Plant::set_parameter`].
    ///
    /// # Errors
    /// There is no such parameter, or the value is not finite.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), PlantError> {
        self.plant.set_parameter(name, value)?;
        let code = self.plant.formulas().tangent();
        self.tangent = code.map(|code| code.fixed(self.plant.parameters()));
        Ok(())
    }

    /// y = g(x, u), in the units of the outputs, in `NY` places: zero in those that are left over.
    ///
    /// # Errors
    /// The plant has more outputs.
    pub fn output<N: Number, const NY: usize>(
        &self,
        x: &SVector<N, NX>,
        u: &SVector<N, NU>,
    ) -> Result<SVector<N, NY>, PlantError> {
        let outputs = self.plant.data().outputs.len();
        if outputs > NY {
            let fault = format!("there are {outputs}, and places for {NY}");
            return Err(PlantError::new("outputs", fault));
        }
        let mut y = SVector::repeat(N::constant(0.0));
        self.plant
            .evaluate_output((x.as_slice(), u.as_slice()), |i, value| y[i] = value);
        Ok(y)
    }

    /// The bounds of the states; none where the file has none.
    pub fn x_bounds(&self) -> Bounds<f64, NX> {
        bounds(&self.plant.data().states)
    }

    /// The bounds of the inputs; none where the file has none.
    pub fn u_bounds(&self) -> Bounds<f64, NU> {
        bounds(&self.plant.data().inputs)
    }

    /// The steady state (x, u), zero in places that are left over: see [`Plant::equilibrium`].
    pub fn equilibrium(&self) -> Option<(SVector<f64, NX>, SVector<f64, NU>)> {
        let equilibrium = self.plant.equilibrium()?;
        Some((filled(&equilibrium.x), filled(&equilibrium.u)))
    }
}

fn filled<const K: usize>(values: &[f64]) -> SVector<f64, K> {
    SVector::from_fn(|i, _| values.get(i).copied().unwrap_or(0.0))
}

fn bounds<const K: usize>(signals: &[crate::Signal]) -> Bounds<f64, K> {
    let mut bounds = Bounds::none();
    for (i, signal) in signals.iter().enumerate() {
        if let Some(lower) = signal.lower {
            bounds.lower[i] = lower;
        }
        if let Some(upper) = signal.upper {
            bounds.upper[i] = upper;
        }
    }
    bounds
}

impl<const NX: usize, const NU: usize> Dynamics<NX, NU> for SizedPlant<NX, NU> {
    fn period(&self) -> Option<f64> {
        self.plant.period()
    }

    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        let mut rate = SVector::repeat(N::constant(0.0));
        self.plant
            .evaluate_motion((x.as_slice(), u.as_slice()), |i, value| rate[i] = value);
        rate
    }

    const TOGETHER: bool = true;

    /// By formulas of their own, unless these would take longer than dual numbers.
    fn tangent_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let (Some(code), Some(fixed)) = (self.plant.formulas().tangent(), &self.tangent) else {
            return false;
        };
        code.evaluate_each(fixed, x, u, tangents);
        true
    }
}

/// A [`Plant`] with its own embedding in the places of `NX` states, `NU` inputs and `NS` scheduling parameters, of
/// which it may need fewer.
#[derive(Debug, Clone, PartialEq)]
pub struct SizedEmbedding<const NX: usize, const NU: usize, const NS: usize> {
    plant: SizedPlant<NX, NU>,
    /// What the code of f with A(s) and B(s) has of the parameters; `None` without such a code.
    embedded: Option<Fixed>,
}

impl<const NX: usize, const NU: usize, const NS: usize> SizedEmbedding<NX, NU, NS> {
    /// `plant` in the places of `NX` states, `NU` inputs and `NS` scheduling parameters.
    ///
    /// # Errors
    /// It has more, or no embedding.
    pub fn new(plant: Plant) -> Result<Self, PlantError> {
        let Some(embedding) = &plant.data().embedding else {
            let fault = "this plant has none of its own";
            return Err(PlantError::new("embedding", fault));
        };
        let count = embedding.scheduling.len();
        if count > NS {
            let fault = format!("there are {count}, and places for {NS}");
            return Err(PlantError::new("embedding.scheduling", fault));
        }
        let plant = SizedPlant::new(plant)?;
        Ok(Self {
            embedded: embedded(&plant.plant),
            plant,
        })
    }

    /// The plant by its f.
    pub fn plant(&self) -> &SizedPlant<NX, NU> {
        &self.plant
    }

    /// See [`Plant::set_parameter`].
    ///
    /// # Errors
    /// There is no such parameter, or the value is not finite.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), PlantError> {
        self.plant.set_parameter(name, value)?;
        self.embedded = embedded(&self.plant.plant);
        Ok(())
    }
}

fn embedded(plant: &Plant) -> Option<Fixed> {
    let code = plant.formulas().embedded()?;
    Some(code.fixed(plant.parameters()))
}

impl<const NX: usize, const NU: usize, const NS: usize> Embedding<NX, NU, NS>
    for SizedEmbedding<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        self.plant.plant.period()
    }

    fn scheduling<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NS> {
        let mut s = SVector::repeat(N::constant(0.0));
        let plant = &self.plant.plant;
        plant.evaluate_scheduling((x.as_slice(), u.as_slice()), |i, value| s[i] = value);
        s
    }

    fn matrices<N: Number>(
        &self,
        scheduling: &SVector<N, NS>,
    ) -> (SMatrix<N, NX, NX>, SMatrix<N, NX, NU>) {
        let zero = N::constant(0.0);
        let (mut a, mut b) = (SMatrix::repeat(zero), SMatrix::repeat(zero));
        let plant = &self.plant.plant;
        let (states, inputs) = (plant.data().states.len(), plant.data().inputs.len());
        plant.evaluate_matrices(scheduling.as_slice(), |i, value| {
            match i.checked_sub(states * states) {
                None => a[(i / states, i % states)] = value,
                Some(i) => b[(i / inputs, i % inputs)] = value,
            }
        });
        (a, b)
    }

    fn offset<N: Number>(&self, scheduling: &SVector<N, NS>) -> Option<SVector<N, NX>> {
        let plant = &self.plant.plant;
        let mut c = SVector::repeat(N::constant(0.0));
        plant.evaluate_offset(scheduling.as_slice(), |i, value| c[i] = value)?;
        Some(c)
    }

    fn f<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NX> {
        self.plant.f(x, u)
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
        if !Dynamics::tangent_each(&self.plant, x, u, tangents) {
            for (i, tangent) in tangents.iter_mut().enumerate() {
                *tangent = lpvmpc::tangent_by_duals(
                    &x[i],
                    &u[i],
                    |x: &SVector<Dual<T, NX>, NX>, u| self.plant.f(x, u),
                    |x, u| self.plant.f(x, u),
                );
            }
        }
    }

    /// By formulas of their own, without the products with what is always zero.
    fn embedded_each<T: Scalar + Number, const POINTS: usize>(
        &self,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) -> bool {
        let code = self.plant.plant.formulas().embedded();
        let (Some(code), Some(fixed)) = (code, &self.embedded) else {
            return false;
        };
        code.evaluate_each(fixed, x, u, tangents);
        true
    }
}
