//! Values of parameters between TOML, which they come from, and JSON, in which journals and batches keep them.
//!
//! JSON has no infinity: it stands as the text that TOML writes for it, which no other value of a scenario is.

use serde_json::Value as Json;
use toml::Value;

/// As JSON, in their order.
pub(crate) fn to_json(values: &[Value]) -> Vec<Json> {
    values.iter().map(json).collect()
}

/// As they stood in TOML, in their order.
pub(crate) fn from_json(values: &[Json]) -> Vec<Value> {
    values.iter().filter_map(value).collect()
}

fn json(value: &Value) -> Json {
    match value {
        Value::Float(number) if number.is_infinite() => Json::String(number.to_string()),
        Value::Array(entries) => Json::Array(to_json(entries)),
        Value::Table(table) => Json::Object(
            table
                .iter()
                .map(|(key, entry)| (key.clone(), json(entry)))
                .collect(),
        ),
        _ => serde_json::to_value(value).unwrap_or_default(),
    }
}

/// `None` for null, which no value of TOML becomes.
fn value(json: &Json) -> Option<Value> {
    match json {
        Json::String(text) if matches!(text.as_str(), "inf" | "-inf") => {
            text.parse().ok().map(Value::Float)
        }
        Json::Array(entries) => Some(Value::Array(from_json(entries))),
        Json::Object(entries) => {
            let entry = |(key, entry): (&String, &Json)| Some((key.clone(), value(entry)?));
            Some(Value::Table(entries.iter().filter_map(entry).collect()))
        }
        _ => Value::try_from(json).ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An infinite one was left out, and those after it were taken for other parameters.
    #[test]
    fn what_came_from_toml_goes_back_into_it() {
        let table: toml::Table = "values = [3.0, inf, 5, [-inf, inf], true, 'text', \
             { lower = -inf, upper = 1.5, most = [1, inf] }]"
            .parse()
            .unwrap();
        let values = table["values"].as_array().unwrap();
        let text = serde_json::to_string(&to_json(values)).unwrap();
        let back: Vec<Json> = serde_json::from_str(&text).unwrap();
        assert_eq!(&from_json(&back), values);
    }
}
