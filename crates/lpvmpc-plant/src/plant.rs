//! A plant that was checked and made ready for evaluation.

use crate::check::check;
use crate::code::{Code, Given};
use crate::data::PlantData;
use crate::error::PlantError;
use crate::{claims, file, source};
use lpvmpc::Number;
use std::path::Path;
use std::sync::Arc;

/// A plant from a file: its formulas, checked, and the values of its parameters.
///
/// Its sizes are known at run time. A controller takes it as a [`SizedPlant`](crate::SizedPlant) or
/// [`SizedEmbedding`](crate::SizedEmbedding).
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    formulas: Arc<Formulas>,
    parameters: Vec<f64>,
}

/// What does not change while a program runs.
#[derive(Debug, PartialEq)]
pub(crate) struct Formulas {
    data: PlantData,
    /// f, or F of a plant in discrete time.
    pub motion: Code,
    pub output: Code,
    pub embedding: Option<EmbeddingCode>,
}

#[derive(Debug, PartialEq)]
pub(crate) struct EmbeddingCode {
    pub scheduling: Code,
    /// A by rows, then B by rows.
    pub matrices: Code,
    pub offset: Option<Code>,
}

impl Plant {
    /// The plant of these data.
    ///
    /// # Errors
    /// The data make no sense, with the place of the first thing that is wrong: a list of a wrong
    /// length, a reference forward, a name that is there twice, an equilibrium that is none, an embedding that is not f.
    pub fn new(data: PlantData) -> Result<Self, PlantError> {
        check(&data)?;
        let code = |results: &[usize]| Code::new(&data.operations, results);
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
        let plant = Self {
            parameters: data.parameters.iter().map(|p| p.value).collect(),
            formulas: Arc::new(Formulas {
                motion: code(data.motion()),
                output: code(&data.output),
                embedding,
                data,
            }),
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

    /// The text of its file, which is read as the same plant to the last bit. Its parameters are those
    /// of [`Self::data`].
    pub fn to_json(&self) -> String {
        file::write(self.data())
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

    /// What stands in its file: names, units, bounds, formulas.
    pub fn data(&self) -> &PlantData {
        &self.formulas.data
    }

    pub(crate) fn formulas(&self) -> &Formulas {
        &self.formulas
    }

    /// The values of the parameters, in the order of [`PlantData::parameters`].
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
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
        if !value.is_finite() {
            let fault = format!("{value} is not finite");
            return Err(PlantError::new(format!("parameter {name:?}"), fault));
        }
        self.parameters[i] = value;
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
        Ok(self.values(&self.formulas.motion, (x, u), &[]))
    }

    /// y = g(x, u), in the units of the outputs.
    ///
    /// # Errors
    /// `x` or `u` has not as many components as the plant has states or inputs.
    pub fn output<N: Number>(&self, x: &[N], u: &[N]) -> Result<Vec<N>, PlantError> {
        self.check_sizes(x.len(), u.len())?;
        Ok(self.values(&self.formulas.output, (x, u), &[]))
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

    /// The results of a code of this plant.
    pub(crate) fn values<N: Number>(&self, code: &Code, motion: (&[N], &[N]), s: &[N]) -> Vec<N> {
        let mut values = Vec::with_capacity(code.results.len());
        self.evaluate(code, motion, s, |_, value| values.push(value));
        values
    }

    /// f, or F of a plant in discrete time.
    #[inline(always)]
    pub(crate) fn evaluate_motion<N: Number>(
        &self,
        motion: (&[N], &[N]),
        result: impl FnMut(usize, N),
    ) {
        self.evaluate(&self.formulas.motion, motion, &[], result);
    }

    /// g.
    #[inline(always)]
    pub(crate) fn evaluate_output<N: Number>(
        &self,
        motion: (&[N], &[N]),
        result: impl FnMut(usize, N),
    ) {
        self.evaluate(&self.formulas.output, motion, &[], result);
    }

    /// The results of a code of this plant at a state, an input and a scheduling of at least its sizes.
    #[inline(always)]
    pub(crate) fn evaluate<N: Number>(
        &self,
        code: &Code,
        (x, u): (&[N], &[N]),
        s: &[N],
        result: impl FnMut(usize, N),
    ) {
        let given = Given {
            parameters: &self.parameters,
            x,
            u,
            s,
        };
        code.evaluate(given, result);
    }

    /// The first operation of which no proof can be had, since it has a kink or jumps, with its index; `None` where all
    /// that f and the embedding need is smooth.
    pub fn first_not_smooth(&self) -> Option<(usize, &'static str)> {
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
                if !operation.is_smooth() {
                    first = Some((index, operation.name()));
                }
            }
        }
        first
    }
}
