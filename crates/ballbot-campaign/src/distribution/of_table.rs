//! From the table of an input to its distribution, with what makes no sense in it.

use super::{Distribution, standard, tidy};
use crate::error::CampaignError;
use crate::file::{NormalTable, RangeTable, VaryTable};
use statrs::distribution::ContinuousCDF;
use toml::Value;

/// Values of a list or a grid, at most; more are a distribution.
const MOST_VALUES: usize = 100_000;

impl Distribution {
    /// The one distribution of the table at `place`.
    pub fn new(place: &str, table: &VaryTable) -> Result<Self, CampaignError> {
        let given = [
            table.uniform.map(|ends| uniform(place, ends)),
            table.log_uniform.map(|ends| log_uniform(place, ends)),
            table.normal.map(|normal| truncated(place, &normal)),
            table.integers.map(|ends| integers(place, ends)),
            table
                .list
                .as_ref()
                .map(|values| Ok(Self::List(several(place, "list", values)?))),
            table
                .grid
                .as_ref()
                .map(|values| Ok(Self::Grid(several(place, "grid", values)?))),
            table.range.map(|ends| range(place, &ends)),
            table
                .seeds
                .filter(|wanted| *wanted)
                .map(|_| Ok(Self::Seeds)),
        ];
        let mut given: Vec<_> = given.into_iter().flatten().collect();
        match (given.pop(), given.len()) {
            (Some(only), 0) => only,
            (_, others) => Err(CampaignError::value(
                place,
                if others == 0 {
                    "(no distribution)"
                } else {
                    "(several distributions)"
                },
                "an input needs exactly one of uniform, log_uniform, normal, integers, list, grid, \
                 range and seeds = true",
            )),
        }
    }
}

fn refused<T>(place: &str, name: &str, value: String, expected: &str) -> Result<T, CampaignError> {
    Err(CampaignError::value(
        format!("{place}.{name}"),
        value,
        expected,
    ))
}

/// Two finite ends in their order.
fn ordered(place: &str, name: &str, [from, to]: [f64; 2]) -> Result<(f64, f64), CampaignError> {
    let finite = from.is_finite() && to.is_finite() && (to - from).is_finite();
    if finite && from < to {
        return Ok((from, to));
    }
    let expected =
        "it needs two finite numbers, the smaller one first; `set` gives a key one value";
    refused(place, name, format!("[{from:?}, {to:?}]"), expected)
}

fn uniform(place: &str, ends: [f64; 2]) -> Result<Distribution, CampaignError> {
    let (from, to) = ordered(place, "uniform", ends)?;
    Ok(Distribution::Uniform { from, to })
}

fn log_uniform(place: &str, ends: [f64; 2]) -> Result<Distribution, CampaignError> {
    let (from, to) = ordered(place, "log_uniform", ends)?;
    if from > 0.0 {
        return Ok(Distribution::LogUniform { from, to });
    }
    let expected = "both ends must be positive; the logarithm of others is no number";
    refused(
        place,
        "log_uniform",
        format!("[{from:?}, {to:?}]"),
        expected,
    )
}

fn truncated(place: &str, table: &NormalTable) -> Result<Distribution, CampaignError> {
    let NormalTable {
        mean,
        deviation,
        lower,
        upper,
    } = *table;
    if !mean.is_finite() {
        return refused(
            place,
            "normal.mean",
            format!("{mean:?}"),
            "it must be a finite number",
        );
    }
    if !(deviation > 0.0 && deviation.is_finite()) {
        let expected = "it must be positive and finite; `set` gives a key one value";
        return refused(
            place,
            "normal.deviation",
            format!("{deviation:?}"),
            expected,
        );
    }
    let share = |bound: f64| standard().cdf((bound - mean) / deviation);
    let below = lower.map_or(0.0, share);
    let above = upper.map_or(1.0, share);
    // Less than that is left by bounds that are the wrong way round, too, and by NaN.
    if above - below > 1e-6 {
        return Ok(Distribution::Normal {
            mean,
            deviation,
            bounds: (
                lower.unwrap_or(f64::NEG_INFINITY),
                upper.unwrap_or(f64::INFINITY),
            ),
            shares: (below, above),
        });
    }
    let text = |bound: Option<f64>| bound.map_or("none".to_owned(), |bound| format!("{bound:?}"));
    let expected = "lower must be below upper, with more than a millionth of the distribution \
                    between them";
    let value = format!("lower {}, upper {}", text(lower), text(upper));
    refused(place, "normal", value, expected)
}

fn integers(place: &str, [from, to]: [i64; 2]) -> Result<Distribution, CampaignError> {
    // Beyond, an f64 does not hold each of them.
    let few = to.checked_sub(from).is_some_and(|span| span < 1 << 52);
    if from < to && few {
        return Ok(Distribution::Integers { from, to });
    }
    let expected = "it needs two whole numbers, the smaller one first, at most 2^52 apart";
    refused(place, "integers", format!("[{from}, {to}]"), expected)
}

fn several(place: &str, name: &str, values: &[Value]) -> Result<Vec<Value>, CampaignError> {
    let repeated = values
        .iter()
        .enumerate()
        .any(|(i, value)| values[..i].contains(value));
    if (1..=MOST_VALUES).contains(&values.len()) && !(name == "grid" && repeated) {
        return Ok(values.to_vec());
    }
    let expected = format!("it needs 1 to {MOST_VALUES} values; a grid's must differ");
    refused(place, name, format!("({} values)", values.len()), &expected)
}

fn range(place: &str, table: &RangeTable) -> Result<Distribution, CampaignError> {
    let RangeTable { from, to, points } = *table;
    let (from, to) = ordered(place, "range", [from, to])?;
    if !(2..=MOST_VALUES as u32).contains(&points) {
        let expected = format!("a grid has 2 to {MOST_VALUES} points");
        return refused(place, "range.points", points.to_string(), &expected);
    }
    let step = (to - from) / f64::from(points - 1);
    let values = (0..points).map(|i| match i {
        _ if i == points - 1 => to,
        _ => tidy(from + f64::from(i) * step),
    });
    Ok(Distribution::Grid(values.map(Value::Float).collect()))
}

/// How the value of an input is rounded.
pub(crate) fn rounding(
    place: &str,
    step: Option<f64>,
    distribution: &Distribution,
) -> Result<Option<f64>, CampaignError> {
    match step {
        Some(step) if !(step > 0.0 && step.is_finite() && distribution.is_continuous()) => refused(
            place,
            "round_to",
            format!("{step:?}"),
            "it must be positive, and goes with uniform, log_uniform and normal only",
        ),
        Some(step) => {
            let (from, to) = distribution.steps(step);
            let refused = |why| refused(place, "round_to", format!("{step:?}"), why);
            match to - from {
                1.0.. => Ok(Some(step)),
                0.0 => refused(
                    "a single multiple of it is in the range, so nothing varies; it must be smaller",
                ),
                _ => refused("no multiple of it is in the range"),
            }
        }
        None => Ok(None),
    }
}
