//! An identification as JSON, for other programs.

use crate::json;
use ballbot_identification::{Identification, OUTPUTS, Parameter, Status, Weight};
use serde_json::{Map, Value, json};

/// Parameters with their intervals, poles, residuals, verdicts.
pub fn document(identification: &Identification) -> Value {
    let (fitted, held_back) = identification.times;
    let parameters =
        Parameter::ALL.map(|one| (one.key().to_owned(), parameter(identification, one)));
    let poles = identification.poles.iter().map(|pole| {
        let mut value = json::pole(pole.value);
        value["standard_deviation_re"] = json!(pole.standard_deviation.0);
        value["standard_deviation_im"] = json!(pole.standard_deviation.1);
        value
    });
    let residuals = OUTPUTS.iter().zip(&identification.residuals);
    let residuals = residuals.map(|(output, residual)| {
        json!({
            "output": output,
            "rms": residual.spread,
            "noise": residual.floor,
            "white": residual.is_white(),
        })
    });
    let findings = identification.findings.iter().map(|(log, findings)| {
        let findings: Vec<String> = findings.iter().map(ToString::to_string).collect();
        json!({ "log": log, "findings": findings })
    });
    let verdicts = identification.verdicts();
    let verdicts = verdicts
        .iter()
        .map(|verdict| json!({ "weight": weight(verdict.weight()), "text": verdict.to_string() }));
    let validation = identification.validation.as_ref();
    let validation = validation.and_then(|validation| validation.as_ref().ok());
    json!({
        "logs": findings.collect::<Value>(),
        "fitted_s": fitted,
        "held_back_s": held_back,
        "segments": identification.simulated.len(),
        "values": identification.estimate.fit.values,
        "physical": identification.physical,
        "centre_of_mass_m": identification.geometry.centre_of_mass,
        "ball_radius_m": identification.geometry.ball_radius,
        "wheel_radius_m": identification.geometry.wheel_radius,
        "gravity_m_s2": identification.geometry.gravity,
        "parameters": parameters.into_iter().collect::<Map<_, _>>(),
        "poles_1_s": poles.collect::<Value>(),
        "residuals": residuals.collect::<Value>(),
        "held_back_chi_square": validation.map(|validation| validation.chi_square),
        "verdicts": verdicts.collect::<Value>(),
    })
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
