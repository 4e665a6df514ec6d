//! Plants as Rust source.

mod names;

use crate::code::{Code, Function};
use crate::operation::Unary;
use crate::plant::Plant;
use names::Names;
pub(crate) use names::{text, type_name};
use std::fmt::Write;

/// A writer into a string cannot fail.
macro_rules! line {
    ($out:expr, $($text:tt)*) => {
        let _ = writeln!($out, $($text)*);
    };
}

/// The source of `plant`: see [`Plant::to_rust`].
pub(crate) fn print(plant: &Plant) -> String {
    let data = plant.data();
    let name = type_name(&data.name);
    let parameters = Names::new(data.parameters.iter().map(|parameter| &*parameter.name));
    let printer = Printer { parameters };
    let (states, inputs) = (data.states.len(), data.inputs.len());
    let embedding = plant.formulas().embedding.as_ref();
    let mut out = String::new();
    line!(
        out,
        "//! {}: printed by `lpvmpc-plant` from its file; not to be edited.",
        text(&data.name)
    );
    line!(out, "//!");
    line!(out, "//! | | name | unit |\n//! |---|---|---|");
    for (symbol, signals) in [
        ("x", &data.states),
        ("u", &data.inputs),
        ("y", &data.outputs),
    ] {
        for (i, signal) in signals.iter().enumerate() {
            line!(
                out,
                "//! | {symbol}\\[{i}\\] | {} | {} |",
                text(&signal.name),
                text(&signal.unit)
            );
        }
    }
    line!(out, "");
    let traits = if embedding.is_some() {
        "Embedding"
    } else {
        "Dynamics"
    };
    line!(
        out,
        "#[allow(unused_imports, reason = \"which of them are needed depends on the plant\")]"
    );
    line!(
        out,
        "use lpvmpc::{{Bivariate, {traits}, Elementary, Number}};"
    );
    line!(
        out,
        "#[allow(unused_imports, reason = \"which of them are needed depends on the plant\")]"
    );
    line!(out, "use nalgebra::{{SMatrix, SVector}};\n");
    line!(
        out,
        "/// The plant {}, with the values of its parameters.",
        text(&data.name)
    );
    line!(out, "#[derive(Clone, Copy, Debug, PartialEq)]");
    line!(out, "pub struct {name} {{");
    for (i, parameter) in data.parameters.iter().enumerate() {
        line!(
            out,
            "    /// {}, {}",
            text(&parameter.name),
            text(&parameter.unit)
        );
        line!(out, "    pub {}: f64,", printer.parameters.at(i));
    }
    line!(out, "}}\n");
    line!(out, "impl Default for {name} {{");
    line!(out, "    fn default() -> Self {{\n        Self {{");
    for (i, value) in plant.parameters().iter().enumerate() {
        line!(out, "            {}: {value:?},", printer.parameters.at(i));
    }
    line!(out, "        }}\n    }}\n}}\n");
    let allow = "#[allow(\n    clippy::all,\n    dead_code,\n    unused_variables,\n    reason = \"printed from a straight-line program\"\n)]";
    line!(out, "{allow}");
    let motion = format!("&self, x: &SVector<N, {states}>, u: &SVector<N, {inputs}>");
    match embedding {
        None => {
            line!(out, "impl Dynamics<{states}, {inputs}> for {name} {{");
        }
        Some(embedding) => {
            let schedulings = embedding.scheduling.code.results.len();
            line!(
                out,
                "impl Embedding<{states}, {inputs}, {schedulings}> for {name} {{"
            );
            line!(
                out,
                "    fn scheduling<N: Number>({motion}) -> SVector<N, {schedulings}> {{"
            );
            printer.vector(&mut out, &embedding.scheduling.code, schedulings);
            let s = format!("&self, scheduling: &SVector<N, {schedulings}>");
            line!(
                out,
                "    fn matrices<N: Number>({s}) -> (SMatrix<N, {states}, {states}>, SMatrix<N, {states}, {inputs}>) {{"
            );
            let values = printer.body(&mut out, &embedding.matrices.code);
            let (a, b) = values.split_at(states * states);
            line!(out, "        (");
            for (entries, columns) in [(a, states), (b, inputs)] {
                // nalgebra stores matrices by columns.
                let by_columns = (0..states * columns)
                    .map(|k| &*entries[k % states * columns + k / states])
                    .collect::<Vec<&str>>()
                    .join(", ");
                line!(
                    out,
                    "            SMatrix::<N, {states}, {columns}>::from_iterator([{by_columns}]),"
                );
            }
            line!(out, "        )\n    }}\n");
            if let Some(offset) = &embedding.offset {
                line!(
                    out,
                    "    fn offset<N: Number>({s}) -> Option<SVector<N, {states}>> {{"
                );
                let values = printer.body(&mut out, &offset.code).join(", ");
                line!(
                    out,
                    "        Some(SVector::<N, {states}>::from([{values}]))\n    }}\n"
                );
            }
        }
    }
    line!(
        out,
        "    fn f<N: Number>({motion}) -> SVector<N, {states}> {{"
    );
    printer.vector(&mut out, &plant.formulas().derivative.code, states);
    let end = out.trim_end().len();
    out.truncate(end);
    line!(out, "\n}}");
    let outputs = data.outputs.len();
    if outputs > 0 {
        line!(out, "\n{allow}");
        line!(out, "impl {name} {{");
        line!(out, "    /// y = g(x, u), in the units of the outputs.");
        line!(
            out,
            "    pub fn output<N: Number>({motion}) -> SVector<N, {outputs}> {{"
        );
        printer.vector(&mut out, &plant.formulas().output.code, outputs);
        let end = out.trim_end().len();
        out.truncate(end);
        line!(out, "\n}}");
    }
    out
}

struct Printer {
    parameters: Names,
}

impl Printer {
    /// The rest of a function that returns the results of `code` as a vector.
    fn vector(&self, out: &mut String, code: &Code, count: usize) {
        let values = self.body(out, code).join(", ");
        line!(
            out,
            "        SVector::<N, {count}>::from([{values}])\n    }}\n"
        );
    }

    /// Works the results of `code` out, and returns what they are called.
    fn body(&self, out: &mut String, code: &Code) -> Vec<String> {
        let leaves = &code.leaves;
        let indexed = |symbol: &'static str, list: &[usize]| -> Vec<String> {
            list.iter().map(|i| format!("{symbol}[{i}]")).collect()
        };
        let mut registers: Vec<String> = { leaves.constants.iter() }
            .map(|value| format!("N::constant({value:?})"))
            .collect();
        for i in &leaves.parameters {
            registers.push(format!("N::constant(self.{})", self.parameters.at(*i)));
        }
        registers.extend(indexed("x", &leaves.states));
        registers.extend(indexed("u", &leaves.inputs));
        registers.extend(indexed("scheduling", &leaves.scheduling));
        for (k, value) in registers.iter_mut().enumerate() {
            line!(out, "        let g{k} = {value};");
            *value = format!("g{k}");
        }
        registers.resize(code.registers, String::new());
        for (k, instruction) in code.instructions.iter().enumerate() {
            let [x, y, z, w] = instruction
                .sources
                .map(|source| &registers[source as usize]);
            let value = match instruction.function {
                Function::SinCos => {
                    line!(out, "        let (v{k}, w{k}) = {x}.sin_cos();");
                    registers[instruction.sources[1] as usize] = format!("w{k}");
                    registers[instruction.target as usize] = format!("v{k}");
                    continue;
                }
                Function::Add => format!("{x} + {y}"),
                Function::Subtract => format!("{x} - {y}"),
                Function::Multiply => format!("{x} * {y}"),
                Function::Divide => format!("{x} / {y}"),
                Function::Negative => format!("-{x}"),
                Function::Square => format!("{x} * {x}"),
                Function::MultiplyAdd => format!("{x} * {y} + {z}"),
                Function::MultiplySubtract => format!("{x} * {y} - {z}"),
                Function::SubtractProduct => format!("{z} - {x} * {y}"),
                Function::AddProducts => format!("{x} * {y} + {z} * {w}"),
                Function::SubtractProducts => format!("{x} * {y} - {z} * {w}"),
                Function::Whole(exponent) => format!("{x}.powi({exponent})"),
                Function::Unary(function) => unary(function, x),
                Function::Bivariate(function) => {
                    format!("{x}.bivariate({y}, Bivariate::{function:?})")
                }
            };
            line!(out, "        let v{k} = {value};");
            registers[instruction.target as usize] = format!("v{k}");
        }
        let results = code.results.iter();
        results
            .map(|result| registers[*result as usize].clone())
            .collect()
    }
}

fn unary(function: Unary, x: &str) -> String {
    match function {
        Unary::Negative => format!("-{x}"),
        Unary::Square => format!("{x} * {x}"),
        Unary::Inverse => format!("N::constant(1.0) / {x}"),
        Unary::Tan => format!("{x}.tan()"),
        Unary::Elementary(function) => format!("{x}.elementary(Elementary::{function:?})"),
    }
}
