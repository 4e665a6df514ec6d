//! What makes no sense in a campaign's file, beside its inputs.

use crate::error::CampaignError;
use crate::file::{CampaignFile, LimitsTable, OnRefused};
use crate::inputs::{Inputs, is_within};
use crate::measure::Measure;
use toml::Value;

/// Nothing that is the same in all runs is in what varies.
pub(crate) fn check_fixed(fixed: &[(String, Value)], inputs: &Inputs) -> Result<(), CampaignError> {
    for (key, value) in fixed {
        let Some(other) = inputs.keys().find(|other| is_within(key, other)) else {
            continue;
        };
        let expected = match key == other {
            true => "it varies, too; leave one of them out".to_owned(),
            false => {
                format!("it stands in `{other}`, which varies as a whole; leave one of them out")
            }
        };
        let (place, value) = (format!("set.{key}"), value.to_string());
        return Err(CampaignError::value(place, value, expected));
    }
    Ok(())
}

/// What is measured.
pub(crate) fn measures(file: &CampaignFile) -> Result<Vec<Measure>, CampaignError> {
    let Some(named) = &file.measure else {
        let all = Measure::ALL.into_iter();
        return Ok(all.filter(|measure| !measure.is_time()).collect());
    };
    let repeated = named
        .iter()
        .enumerate()
        .find(|(i, measure)| named[..*i].contains(measure));
    match repeated {
        Some((_, measure)) => Err(CampaignError::value(
            "measure",
            measure.name(),
            "it is there twice",
        )),
        None => Ok(named.clone()),
    }
}

/// What the campaign is to end with.
pub(crate) fn check_goal(file: &CampaignFile, inputs: &Inputs) -> Result<(), CampaignError> {
    if let Some(stop) = &file.stop {
        stop.check()?;
    }
    let Some(rare) = &file.rare else {
        return Ok(());
    };
    rare.check()?;
    let refused = |value: &str, expected: &str| Err(CampaignError::value("rare", value, expected));
    if file.stop.is_some() || !file.success.is_empty() || file.runs.is_some() {
        let expected = "a rare failure has its own numbers; leave runs, [success] and [stop] out";
        return refused("(given)", expected);
    }
    if file.refused == OnRefused::Count {
        let expected = "of a rare failure no draw is left out; give the inputs bounds within which each \
                        draw makes a scenario";
        return Err(CampaignError::value("refused", "\"count\"", expected));
    }
    if inputs.grid_points > 1 || inputs.all.is_empty() {
        let expected = "its inputs need distributions, and a grid is none";
        return refused("(given)", expected);
    }
    Ok(())
}

/// What a run must keep to be a success.
pub(crate) fn check_success(
    file: &CampaignFile,
    measures: &[Measure],
) -> Result<(), CampaignError> {
    for (measure, limits) in &file.success {
        let LimitsTable { at_least, at_most } = *limits;
        let key = format!("success.{measure}");
        let finite = [at_least, at_most]
            .into_iter()
            .flatten()
            .all(f64::is_finite);
        let ordered = match (at_least, at_most) {
            (Some(least), Some(most)) => least <= most,
            (None, None) => false,
            _ => true,
        };
        if !(finite && ordered) {
            let sides = [("at_least", at_least), ("at_most", at_most)].into_iter();
            let given = sides.filter_map(|(name, limit)| Some(format!("{name} = {:?}", limit?)));
            let value = given.collect::<Vec<_>>().join(", ");
            let expected = "it needs at_least or at_most or both, finite and in this order";
            return Err(CampaignError::value(key, value, expected));
        }
        if measure.is_time() {
            let expected = "a time differs from run to run, so no run could be repeated by it";
            return Err(CampaignError::value(key, "(given)", expected));
        }
        if !measures.contains(measure) {
            let expected = "it must be in `measure`, too, so that the results say why a run failed";
            return Err(CampaignError::value(key, "(given)", expected));
        }
    }
    Ok(())
}
