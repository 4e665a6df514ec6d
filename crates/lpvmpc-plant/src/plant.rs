//! A plant that was checked and made ready for evaluation.

use crate::check::check;
use crate::data::{Equilibrium, PlantData};
use crate::error::PlantError;
use crate::prepared::{Fixed, Prepared};
use crate::tangent::TangentCode;
use crate::{claims, equilibrium, file, source};
use lpvmpc::Number;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// A plant from a file: its formulas, checked, and the values of its parameters.
///
/// Its sizes are known at run time. A controller takes it as a [`SizedPlant`](crate::SizedPlant) or
/// [`SizedEmbedding`](crate::SizedEmbedding).
#[derive(Debug, Clone)]
pub struct Plant {
    formulas: Arc<Formulas>,
    values: Arc<Values>,
}

impl PartialEq for Plant {
    /// The same formulas with the same parameters.
    fn eq(&self, other: &Self) -> bool {
        self.present_data() == other.present_data()
    }
}

/// What does not change while a program runs.
#[derive(Debug)]
pub(crate) struct Formulas {
    data: PlantData,
    /// f, or F of a plant in discrete time.
    pub motion: Prepared,
    pub output: Prepared,
    pub embedding: Option<EmbeddingCode>,
    /// Made when it is first asked for, since it takes longer than all else.
    tangent: OnceLock<Option<TangentCode>>,
    embedded: OnceLock<Option<TangentCode>>,
}

#[derive(Debug)]
pub(crate) struct EmbeddingCode {
    pub scheduling: Prepared,
    /// A by rows, then B by rows.
    pub matrices: Prepared,
    pub offset: Option<Prepared>,
}

/// Parameters, and what follows from them.
#[derive(Debug, Clone)]
pub(crate) struct Values {
    parameters: Vec<f64>,
    pub motion: Fixed,
    pub output: Fixed,
    pub embedding: Option<EmbeddingValues>,
    /// Worked out when it is first asked for: a step of a controller that is told parameters does without.
    equilibrium: OnceLock<Option<Equilibrium>>,
}

/// The same of an embedding.
#[derive(Debug, Clone)]
pub(crate) struct EmbeddingValues {
    pub scheduling: Fixed,
    pub matrices: Fixed,
    pub offset: Option<Fixed>,
}

impl Formulas {
    fn new(data: PlantData) -> Self {
        let code = |results: &[usize]| Prepared::new(&data.operations, results);
        let embedding = data.embedding.as_ref().map(|embedding| {
            let entries: Vec<usize> = { embedding.a.iter().chain(&embedding.b) }
                .flatten()
                .copied()
                .collect();
            EmbeddingCode {
                scheduling: code(&embedding.scheduling),
                matrices: code(&entries),
                offset: embedding.c.as_ref().map(|c| code(c)),
            }
        });
        Self {
            motion: code(data.motion()),
            output: code(&data.output),
            embedding,
            tangent: OnceLock::new(),
            embedded: OnceLock::new(),
            data,
        }
    }

    fn values(&self, parameters: Vec<f64>) -> Values {
        let embedding = self.embedding.as_ref().map(|code| EmbeddingValues {
            scheduling: code.scheduling.fixed(&parameters),
            matrices: code.matrices.fixed(&parameters),
            offset: { code.offset.as_ref() }.map(|offset| offset.fixed(&parameters)),
        });
        Values {
            motion: self.motion.fixed(&parameters),
            output: self.output.fixed(&parameters),
            embedding,
            equilibrium: OnceLock::new(),
            parameters,
        }
    }

    /// f with its derivatives as one code; `None` where that would be longer than dual numbers take.
    pub fn tangent(&self) -> Option<&TangentCode> {
        let made = { &self.tangent }
            .get_or_init(|| TangentCode::of_derivatives(&self.data, self.motion.length()));
        made.as_ref()
    }

    /// f with A(s) and B(s) as one code; `None` without an embedding, or where it would be too long.
    pub fn embedded(&self) -> Option<&TangentCode> {
        let made = self
            .embedded
            .get_or_init(|| TangentCode::of_embedding(&self.data, self.data.embedding.as_ref()?));
        made.as_ref()
    }
}

impl Plant {
    /// The plant of these data.
    ///
    /// # Errors
    /// The data make no sense, with the place of the first thing that is wrong: a list of a wrong
    /// length, a reference forward, a name that is there twice, an equilibrium that is none, an embedding that is not f.
    pub fn new(data: PlantData) -> Result<Self, PlantError> {
        check(&data)?;
        let parameters = data.parameters.iter().map(|p| p.value).collect();
        let formulas = Formulas::new(data);
        let plant = Self {
            values: Arc::new(formulas.values(parameters)),
            formulas: Arc::new(formulas),
        };
        claims::check(&plant)?;
        Ok(plant)
    }

    /// The plant in the text of a file.
    ///
    /// # Errors
    /// It is no plant, with the place.
    pub fn from_json(text: &str) -> Result<Self, PlantError> {
        Self::new(file::read(text)?)
    }

    /// The plant in the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or is no plant.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, PlantError> {
        Self::from_json(&file::text(path.as_ref())?)
    }

    /// The text of its file, which is read as the same plant to the last bit, with the parameters as they are now and the
    /// [equilibrium](Self::equilibrium) under these.
    pub fn to_json(&self) -> String {
        file::write(&self.present_data())
    }

    /// [`Self::data`] with parameters and equilibrium as they are now.
    fn present_data(&self) -> PlantData {
        let mut data = self.data().clone();
        data.equilibrium = self.equilibrium().cloned();
        for (parameter, value) in data.parameters.iter_mut().zip(self.parameters()) {
            parameter.value = *value;
        }
        data
    }

    /// Writes its file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PlantError> {
        let path = path.as_ref();
        std::fs::write(path, self.to_json())
            .map_err(|error| PlantError::new(path.display().to_string(), error.to_string()))
    }

    /// The plant as Rust source with its parameters as they are now: a module with a type that is a
    /// [`Dynamics`](lpvmpc::Dynamics), or an [`Embedding`](lpvmpc::Embedding) if the file has one, of exactly the
    /// plant's sizes, without std or heap. On every kind of number it has the same values as this plant, to the last bit.
    ///
    /// It needs `lpvmpc` and `nalgebra`, and nothing of this crate.
    pub fn to_rust(&self) -> String {
        source::print(self)
    }

    /// What it was made from: names, units, bounds, formulas, and the values that parameters and equilibrium had then.
    pub fn data(&self) -> &PlantData {
        &self.formulas.data
    }

    pub(crate) fn formulas(&self) -> &Formulas {
        &self.formulas
    }

    /// The values of the parameters, in the order of [`PlantData::parameters`].
    pub fn parameters(&self) -> &[f64] {
        &self.values.parameters
    }

    /// The steady state. It is the one that was given, where the plant stands there with its parameters as they are now. With
    /// others it is the same state under the nearest input that holds it, or the state and input near both where none does;
    /// `None` where no such one is found within the bounds.
    pub fn equilibrium(&self) -> Option<&Equilibrium> {
        let found = { &self.values.equilibrium }.get_or_init(|| equilibrium::present(self));
        found.as_ref()
    }

    /// State and input of the equilibrium; zeros where there is none.
    pub fn operating_point(&self) -> (Vec<f64>, Vec<f64>) {
        match self.equilibrium() {
            Some(at) => (at.x.clone(), at.u.clone()),
            None => {
                let data = self.data();
                (vec![0.0; data.states.len()], vec![0.0; data.inputs.len()])
            }
        }
    }

    /// From now on the parameter `name` has this `value`, in its unit.
    ///
    /// # Errors
    /// There is no such parameter, or the value is not finite.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), PlantError> {
        let known = &self.formulas.data.parameters;
        let Some(i) = known.iter().position(|parameter| parameter.name == name) else {
            let names: Vec<&str> = known
                .iter()
                .map(|parameter| parameter.name.as_str())
                .collect();
            let fault = match names.is_empty() {
                true => "this plant has none".to_owned(),
                false => format!("there are {}", names.join(", ")),
            };
            return Err(PlantError::new(format!("parameter {name:?}"), fault));
        };
        let mut parameters = self.values.parameters.clone();
        parameters[i] = value;
        self.set_parameters(&parameters)
    }

    /// From now on the parameters have these `values`, in their order and units. That takes less time than one
    /// after the other.
    ///
    /// # Errors
    /// There are not as many values as parameters, or one is not finite.
    pub fn set_parameters(&mut self, values: &[f64]) -> Result<(), PlantError> {
        let known = &self.formulas.data.parameters;
        if values.len() != known.len() {
            let fault = format!("{} values for {}", values.len(), known.len());
            return Err(PlantError::new("parameters", fault));
        }
        for (parameter, value) in known.iter().zip(values) {
            if !value.is_finite() {
                let fault = format!("{value} is not finite");
                return Err(PlantError::new(
                    format!("parameter {:?}", parameter.name),
                    fault,
                ));
            }
        }
        self.values = Arc::new(self.formulas.values(values.to_vec()));
        Ok(())
    }

    /// The period of a plant in discrete time, s; `None` of one in continuous time.
    pub fn period(&self) -> Option<f64> {
        self.data().period
    }

    /// x_dot = f(x, u), in state units per second.
    ///
    /// # Errors
    /// `x` or `u` has not as many components as the plant has states or inputs; or it is in discrete time.
    pub fn derivative<N: Number>(&self, x: &[N], u: &[N]) -> Result<Vec<N>, PlantError> {
        if self.period().is_some() {
            let fault = "this plant is in discrete time, and has none: see `next`";
            return Err(PlantError::new("derivative", fault));
        }
        self.motion(x, u)
    }

    /// x+ = F(x, u), the state one period later, in state units.
    ///
    /// # Errors
    /// `x` or `u` has not as many components as the plant has states or inputs; or it is in continuous time.
    pub fn next<N: Number>(&self, x: &[N], u: &[N]) -> Result<Vec<N>, PlantError> {
        if self.period().is_none() {
            let fault = "this plant is in continuous time, and has no period: see `derivative`";
            return Err(PlantError::new("next", fault));
        }
        self.motion(x, u)
    }

    /// f, or F of a plant in discrete time.
    pub(crate) fn motion<N: Number>(&self, x: &[N], u: &[N]) -> Result<Vec<N>, PlantError> {
        self.check_sizes(x.len(), u.len())?;
        let mut rates = Vec::with_capacity(x.len());
        self.evaluate_motion((x, u), |_, rate| rates.push(rate));
        Ok(rates)
    }

    /// y = g(x, u), in the units of the outputs.
    ///
    /// # Errors
    /// `x` or `u` has not as many components as the plant has states or inputs.
    pub fn output<N: Number>(&self, x: &[N], u: &[N]) -> Result<Vec<N>, PlantError> {
        self.check_sizes(x.len(), u.len())?;
        let mut outputs = Vec::with_capacity(self.data().outputs.len());
        self.evaluate_output((x, u), |_, output| outputs.push(output));
        Ok(outputs)
    }

    fn check_sizes(&self, x: usize, u: usize) -> Result<(), PlantError> {
        let data = self.data();
        for (name, found, count, of) in [
            ("x", x, data.states.len(), "states"),
            ("u", u, data.inputs.len(), "inputs"),
        ] {
            if found != count {
                let fault = format!("{found} components for {count} {of}");
                return Err(PlantError::new(name, fault));
            }
        }
        Ok(())
    }

    /// f, or F of a plant in discrete time.
    #[inline(always)]
    pub(crate) fn evaluate_motion<N: Number>(
        &self,
        motion: (&[N], &[N]),
        result: impl FnMut(usize, N),
    ) {
        let (code, fixed) = (&self.formulas.motion, &self.values.motion);
        code.evaluate(fixed, motion, &[], result);
    }

    /// g.
    #[inline(always)]
    pub(crate) fn evaluate_output<N: Number>(
        &self,
        motion: (&[N], &[N]),
        result: impl FnMut(usize, N),
    ) {
        let (code, fixed) = (&self.formulas.output, &self.values.output);
        code.evaluate(fixed, motion, &[], result);
    }

    /// sigma of the embedding; nothing without one.
    #[inline(always)]
    pub(crate) fn evaluate_scheduling<N: Number>(
        &self,
        motion: (&[N], &[N]),
        result: impl FnMut(usize, N),
    ) {
        if let (Some(code), Some(values)) = (&self.formulas.embedding, &self.values.embedding) {
            code.scheduling
                .evaluate(&values.scheduling, motion, &[], result);
        }
    }

    /// The embedding's A by rows, then B by rows; nothing without one.
    #[inline(always)]
    pub(crate) fn evaluate_matrices<N: Number>(&self, s: &[N], result: impl FnMut(usize, N)) {
        if let (Some(code), Some(values)) = (&self.formulas.embedding, &self.values.embedding) {
            code.matrices
                .evaluate(&values.matrices, (&[], &[]), s, result);
        }
    }

    /// The embedding's c. `None` where there is none.
    #[inline(always)]
    pub(crate) fn evaluate_offset<N: Number>(
        &self,
        s: &[N],
        result: impl FnMut(usize, N),
    ) -> Option<()> {
        let code = self.formulas.embedding.as_ref()?.offset.as_ref()?;
        let fixed = self.values.embedding.as_ref()?.offset.as_ref()?;
        code.evaluate(fixed, (&[], &[]), s, result);
        Some(())
    }

    /// The first operation of which no proof can be had, since it jumps, with its index; `None` where nothing that f and the
    /// embedding need does.
    pub fn first_jump(&self) -> Option<(usize, &'static str)> {
        let data = self.data();
        let mut needed = vec![false; data.operations.len()];
        let embedding = data.embedding.as_ref();
        let entries = embedding.into_iter().flat_map(|e| {
            let matrices = e.a.iter().chain(&e.b).flatten();
            matrices.chain(&e.scheduling).chain(e.c.iter().flatten())
        });
        for result in data.motion().iter().chain(entries) {
            needed[*result] = true;
        }
        let mut first = None;
        for (index, operation) in data.operations.iter().enumerate().rev() {
            if needed[index] {
                operation.arguments().for_each(|i| needed[i] = true);
                if operation.jumps() {
                    first = Some((index, operation.name()));
                }
            }
        }
        first
    }
}
