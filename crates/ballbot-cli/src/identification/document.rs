//! An identification as JSON, for other programs.

use crate::json;
use ballbot_identification::{Identification, IdentifiedRobot, OUTPUTS, Parameter, Status, Weight};
use serde_json::{Map, Value, json};

/// Parameters with their intervals, poles, residuals, verdicts. What is each plane's own of two is in
/// `planes`, under the name of the plane.
pub fn document(robot: &IdentifiedRobot) -> Value {
    let first = robot.first();
    let (fitted, held_back) = first.times;
    let findings = robot.findings().into_iter().map(|(log, findings)| {
        let findings: Vec<String> = findings.iter().map(ToString::to_string).collect();
        json!({ "log": log, "findings": findings })
    });
    let shared = Parameter::ALL.into_iter();
    let shared = shared.filter(|parameter| !robot.variables.is_own(*parameter));
    let mut document = json!({
        "logs": findings.collect::<Value>(),
        "fitted_s": fitted,
        "held_back_s": held_back,
        "segments": robot.estimate().fit.initial.len(),
        "values": robot.estimate().fit.values,
        "physical": first.physical,
        "centre_of_mass_m": first.geometry.centre_of_mass,
        "ball_radius_m": first.geometry.ball_radius,
        "wheel_radius_m": first.geometry.wheel_radius,
        "gravity_m_s2": first.geometry.gravity,
        "parameters": parameters(first, shared),
    });
    let mut planes = Map::new();
    for (place, plane) in robot.planes.iter().enumerate() {
        let shown = shown(plane);
        match robot.plane_name(place) {
            None => {
                for (key, value) in shown {
                    document[key] = value;
                }
            }
            Some(name) => {
                let own = Parameter::ALL.into_iter();
                let own = own.filter(|parameter| robot.variables.is_own(*parameter));
                let mut shown = shown;
                shown.push(("parameters", parameters(plane, own)));
                let shown = shown
                    .into_iter()
                    .map(|(key, value)| (key.to_owned(), value));
                planes.insert(name.to_owned(), Value::Object(shown.collect()));
            }
        }
    }
    if !planes.is_empty() {
        document["planes"] = Value::Object(planes);
    }
    let verdicts = robot.verdicts();
    let verdicts = verdicts.iter().map(|(plane, verdict)| {
        let mut told = json!({ "weight": weight(verdict.weight()), "text": verdict.to_string() });
        if let Some(name) = plane.and_then(|plane| robot.plane_name(plane)) {
            told["plane"] = json!(name);
        }
        told
    });
    document["verdicts"] = verdicts.collect();
    document
}

/// What a plane shows beside its parameters.
fn shown(plane: &Identification) -> Vec<(&'static str, Value)> {
    let poles = plane.poles.iter().map(|pole| {
        let mut value = json::pole(pole.value);
        value["standard_deviation_re"] = json!(pole.standard_deviation.0);
        value["standard_deviation_im"] = json!(pole.standard_deviation.1);
        value
    });
    let residuals = OUTPUTS.iter().zip(&plane.residuals);
    let residuals = residuals.map(|(output, residual)| {
        json!({
            "output": output,
            "rms": residual.spread,
            "noise": residual.floor,
            "white": residual.is_white(),
        })
    });
    let validation = plane.validation.as_ref();
    let validation = validation.and_then(|validation| validation.as_ref().ok());
    let chi_square = validation.map(|validation| validation.chi_square);
    vec![
        ("poles_1_s", poles.collect()),
        ("residuals", residuals.collect()),
        ("held_back_chi_square", json!(chi_square)),
    ]
}

fn parameters(plane: &Identification, of: impl Iterator<Item = Parameter>) -> Value {
    let all = of.map(|one| (one.key().to_owned(), parameter(plane, one)));
    Value::Object(all.collect())
}

fn parameter(identification: &Identification, parameter: Parameter) -> Value {
    let status = identification.estimate.status[parameter];
    let mut document = json!({
        "value": identification.estimate.values[parameter],
        "unit": parameter.unit(),
        "status": match status {
            Status::Held => "held",
            Status::Found => "found",
            Status::AtBound => "at its bound",
        },
    });
    if status == Status::Found {
        let (least, most) = identification.interval(parameter);
        document["standard_deviation"] = json!(identification.standard_deviation(parameter));
        document["interval_95"] = json!([least, most]);
    }
    document
}

fn weight(weight: Weight) -> &'static str {
    match weight {
        Weight::Good => "good",
        Weight::Note => "note",
        Weight::Warning => "warning",
        Weight::Refusal => "no result",
    }
}
