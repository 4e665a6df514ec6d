//! Bounds in the plant's names.

use lpvmpc::{ActiveSet, BoundId, Side, Status};

/// What bounds are called and where they are.
pub(crate) struct Bounded<'a> {
    /// Name, unit and bounds of a quantity at a stage; `None` where there is none.
    pub of: &'a dyn Fn(BoundId) -> Option<Named>,
}

/// A quantity with its bounds.
pub(crate) struct Named {
    pub name: String,
    pub unit: String,
    pub lower: f64,
    pub upper: f64,
}

impl Bounded<'_> {
    /// "force >= -10 N".
    pub fn words(&self, bound: BoundId) -> String {
        let Some(named) = (self.of)(bound) else {
            return bound.to_string();
        };
        let (sign, limit) = match bound.side {
            Side::Lower => (">=", named.lower),
            Side::Upper => ("<=", named.upper),
            Side::Equality => return format!("{} at the end = its reference", named.name),
        };
        let unit = match named.unit.is_empty() {
            true => String::new(),
            false => format!(" {}", named.unit),
        };
        format!("{} {sign} {limit}{unit}", named.name)
    }

    /// A status with the bounds that it is about.
    pub fn status(&self, status: &Status<f64>, active: &ActiveSet<f64>) -> String {
        match status {
            Status::Infeasible(bound) => {
                let first = format!("{} at stage {}", self.words(*bound), bound.stage);
                let against = active.iter().filter(|row| row.bound != *bound);
                let mut against: Vec<(String, usize)> = against
                    .map(|row| (self.words(row.bound), row.bound.stage))
                    .collect();
                against.sort_by_key(|(_, stage)| *stage);
                let against = stages(against.into_iter());
                match against.is_empty() {
                    true => format!("infeasible: {first}"),
                    false => format!("infeasible: {first} against {}", against.join(", ")),
                }
            }
            Status::Exceeded(bound) => format!(
                "exceeded: no plan was found that keeps {} at stage {}",
                self.words(*bound),
                bound.stage
            ),
            Status::Inaccurate(bound) => format!(
                "inaccurate: rounding keeps {} at stage {} from being met",
                self.words(*bound),
                bound.stage
            ),
            other => other.to_string(),
        }
    }
}

/// Each text once, with the stages at which it stands: "force >= -10 N at stages 0 to 6".
pub(crate) fn stages(pairs: impl Iterator<Item = (String, usize)>) -> Vec<String> {
    let mut texts: Vec<(String, Vec<usize>)> = Vec::new();
    for (text, stage) in pairs {
        match texts.iter_mut().find(|(known, _)| *known == text) {
            Some((_, stages)) => stages.push(stage),
            None => texts.push((text, vec![stage])),
        }
    }
    let texts = texts.into_iter();
    texts
        .map(|(text, mut stages)| {
            stages.sort_unstable();
            stages.dedup();
            format!("{text} at {}", ranges(&stages))
        })
        .collect()
}

/// "stages 0 to 6 and 9", of sorted stages.
fn ranges(stages: &[usize]) -> String {
    let mut parts: Vec<(usize, usize)> = Vec::new();
    for &stage in stages {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == stage => *last = stage,
            _ => parts.push((stage, stage)),
        }
    }
    let words = parts.iter().map(|(first, last)| match first == last {
        true => first.to_string(),
        false => format!("{first} to {last}"),
    });
    let words: Vec<String> = words.collect();
    let noun = if stages.len() == 1 { "stage" } else { "stages" };
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => {
            format!("{noun} {} and {last}", rest.join(", "))
        }
        _ => format!("{noun} {}", words.concat()),
    }
}
