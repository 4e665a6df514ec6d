//! Ticks: round values in a view, and their labels.

use super::axis::Axis;
use super::figure::Scale;

/// The ticks of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ticks {
    /// Values with their labels, from below.
    pub labelled: Vec<(f64, String)>,
    /// Values between them on a logarithmic axis.
    pub minor: Vec<f64>,
}

/// The power of ten that the labels of an axis leave out, when they would be long otherwise.
pub(super) fn common_power(axis: &Axis) -> Option<i32> {
    let size = axis.lower.abs().max(axis.upper.abs());
    let long = !(1e-2..1e5).contains(&size);
    (axis.scale == Scale::Linear && long).then(|| size.log10().floor() as i32)
}

/// `×10` with its exponent.
pub(super) fn power_label(power: i32) -> String {
    format!("×10{}", superscript(power))
}

impl Ticks {
    /// About `count` ticks; only whole numbers when `whole`.
    pub fn of(axis: &Axis, count: usize, whole: bool) -> Self {
        let count = count.max(2);
        match axis.scale {
            Scale::Linear => Self::linear(axis, count, whole),
            Scale::Log => Self::logarithmic(axis, count),
        }
    }

    fn linear(axis: &Axis, count: usize, whole: bool) -> Self {
        let step = round_step((axis.upper - axis.lower) / count as f64);
        let step = if whole { step.max(1.0) } else { step };
        let power = common_power(axis).unwrap_or(0);
        let unit = 10.0_f64.powi(power);
        // A step of 0.2 needs one decimal, one of 20 none.
        let decimals = (-(step / unit * 1.000_001).log10().floor()).max(0.0) as usize;
        let labelled = multiples(axis, step)
            .map(|value| (value, decimal(value / unit, decimals)))
            .collect();
        Self {
            labelled,
            minor: Vec::new(),
        }
    }

    fn logarithmic(axis: &Axis, count: usize) -> Self {
        let first = axis.lower.log10().ceil() as i32;
        let last = axis.upper.log10().floor() as i32;
        let decades = (last - first + 1).max(0) as usize;
        let in_decades = |factors: &'static [f64]| {
            let all = (first - 1..=last)
                .flat_map(move |decade| factors.iter().map(move |f| f * 10.0_f64.powi(decade)));
            all.filter(|value| axis.contains(*value))
                .collect::<Vec<f64>>()
        };
        let parts = in_decades(&[1.0, 2.0, 5.0]);
        if decades > 2 || (decades == 2 && parts.len() > count) {
            let stride = decades.div_ceil(count);
            let labelled = (first..=last)
                .step_by(stride)
                .map(|decade| (10.0_f64.powi(decade), format!("10{}", superscript(decade))))
                .collect();
            let minor = match stride {
                1 => in_decades(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]),
                _ => in_decades(&[1.0]),
            };
            Self { labelled, minor }
        } else if parts.len() >= 2 {
            let labelled = parts
                .into_iter()
                .map(|value| (value, short(value)))
                .collect();
            Self {
                labelled,
                minor: in_decades(&[3.0, 4.0, 6.0, 7.0, 8.0, 9.0]),
            }
        } else {
            let step = round_step((axis.upper - axis.lower) / count as f64);
            let labelled = multiples(axis, step)
                .map(|value| (value, short(value)))
                .collect();
            Self {
                labelled,
                minor: Vec::new(),
            }
        }
    }
}

/// The smallest of 1, 2, 5, 10 times a power of ten that is not below `least`.
fn round_step(least: f64) -> f64 {
    let decade = 10.0_f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|factor| factor * decade >= least * 0.999_999);
    factor.unwrap_or(10.0) * decade
}

fn multiples(axis: &Axis, step: f64) -> impl Iterator<Item = f64> {
    // A multiple that rounding puts just outside is still at the end of the axis.
    let first = (axis.lower / step - 1e-6).ceil() as i64;
    let last = (axis.upper / step + 1e-6).floor() as i64;
    (first..=last).map(move |index| index as f64 * step)
}

fn decimal(value: f64, decimals: usize) -> String {
    let label = format!("{value:.decimals$}");
    if value < 0.0 {
        label.replacen('-', "−", 1)
    } else {
        label
    }
}

/// A positive value in the fewest digits: `0.5`, `20`, `2·10⁻⁷`.
fn short(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        // Twelve digits hide the rounding of a multiple of the step.
        let label = format!("{value:.12}");
        label.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        let power = value.log10().floor() as i32;
        format!(
            "{}·10{}",
            short(value / 10.0_f64.powi(power)),
            superscript(power)
        )
    }
}

fn superscript(number: i32) -> String {
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |character: char| match character.to_digit(10) {
        Some(digit) => digits[digit as usize],
        None => '⁻',
    };
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, lower: f64, upper: f64, count: usize) -> Vec<String> {
        let ticks = Ticks::of(
            &Axis {
                scale,
                lower,
                upper,
            },
            count,
            false,
        );
        ticks.labelled.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn linear_ticks_are_round() {
        assert_eq!(
            labels(Scale::Linear, 0.0, 4.0, 8),
            [
                "0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0", "3.5", "4.0"
            ]
        );
        assert_eq!(
            labels(Scale::Linear, -0.11, 0.11, 4),
            ["−0.1", "0.0", "0.1"]
        );
        assert_eq!(
            labels(Scale::Linear, 0.0, 26000.0, 3),
            ["0", "10000", "20000"]
        );
    }

    #[test]
    fn long_labels_leave_out_a_power() {
        let axis = Axis {
            scale: Scale::Linear,
            lower: 0.0,
            upper: 3.1e6,
        };
        assert_eq!(common_power(&axis), Some(6));
        assert_eq!(power_label(6), "×10⁶");
        assert_eq!(labels(Scale::Linear, 0.0, 3.1e6, 3), ["0", "2"]);
        assert_eq!(
            labels(Scale::Linear, -2e-13, 2e-13, 4),
            ["−2", "−1", "0", "1", "2"]
        );
    }

    #[test]
    fn logarithmic_ticks_are_decades_or_their_parts() {
        assert_eq!(
            labels(Scale::Log, 0.5e-3, 20.0, 6),
            ["10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹"]
        );
        assert_eq!(
            labels(Scale::Log, 1e-17, 1e-11, 3),
            ["10⁻¹⁷", "10⁻¹⁴", "10⁻¹¹"]
        );
        assert_eq!(labels(Scale::Log, 0.3, 30.0, 4), ["10⁰", "10¹"]);
        assert_eq!(
            labels(Scale::Log, 0.3, 30.0, 6),
            ["0.5", "1", "2", "5", "10", "20"]
        );
        assert_eq!(labels(Scale::Log, 0.3, 7.0, 6), ["0.5", "1", "2", "5"]);
        assert_eq!(labels(Scale::Log, 2.2e-7, 4.1e-7, 2), ["3·10⁻⁷", "4·10⁻⁷"]);
    }

    #[test]
    fn whole_numbers_stay_whole() {
        let axis = Axis {
            scale: Scale::Linear,
            lower: -0.2,
            upper: 4.2,
        };
        let ticks = Ticks::of(&axis, 12, true);
        assert_eq!(ticks.labelled.len(), 5);
        assert_eq!(ticks.labelled[3].1, "3");
    }
}
