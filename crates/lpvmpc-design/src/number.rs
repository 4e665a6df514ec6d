//! Numbers in messages for people.

/// A number as a person would write it: at most twelve significant digits, which hides what rounding
/// adds, and a power of ten where it is very large or small.
pub fn number_text(value: f64) -> String {
    significant_text(value, 12)
}

/// A number with at most so many significant `digits` and the whole of its integer part, or with a power of ten where
/// it is below 1e-4 or at least 1e9.
pub fn significant_text(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    // How long it is, is seen in the text. To read it as a number again, much more code would be needed.
    let text = format!("{value:.*e}", digits.max(1) - 1);
    let Some((mantissa, exponent)) = text.split_once('e') else {
        // Infinite, or NaN.
        return text;
    };
    let mantissa = match mantissa.contains('.') {
        true => mantissa.trim_end_matches('0').trim_end_matches('.'),
        false => mantissa,
    };
    let decimals = mantissa
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    match exponent.parse::<i32>() {
        Ok(exponent @ -4..=8) => {
            let decimals = (decimals as i32 - exponent).max(0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{mantissa}e{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::{number_text, significant_text};

    #[test]
    fn numbers_are_as_a_person_writes_them() {
        for (value, written) in [
            (0.0, "0"),
            (-0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-60.0, "-60"),
            (1e6, "1000000"),
            (1e200, "1e200"),
            (-2.5e-300, "-2.5e-300"),
            (1e-5, "1e-5"),
            (9.999_999_999_999_99e-5, "0.0001"),
            (999_999_999.999_6, "1e9"),
            (999_999_999.999_4, "999999999.999"),
            (-123.000_000_000_000_1, "-123"),
            (0.000_123_456_789_012_345, "0.000123456789012"),
            (f64::INFINITY, "inf"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
            (std::f64::consts::PI, "3.14159265359"),
        ] {
            assert_eq!(number_text(value), written);
        }
    }
    #[test]
    fn fewer_digits_leave_the_integer_part_whole() {
        for (value, digits, written) in [
            (57.295_779_5, 4, "57.3"),
            (0.785_43, 4, "0.7854"),
            (123_456.7, 4, "123457"),
            (0.05, 1, "0.05"),
            (9.96, 2, "10"),
            (7e9, 1, "7e9"),
            (2.0, 0, "2"),
        ] {
            assert_eq!(significant_text(value, digits), written);
        }
    }

    /// The route taken before: round to twelve digits, read that as a number, and write the shortest text that reads
    /// as the same number.
    #[test]
    fn twelve_digits_are_those_of_the_rounded_number() {
        let mut random = fastrand::Rng::with_seed(5);
        for _ in 0..20_000 {
            let value = (random.f64() - 0.5) * 10f64.powi(random.i32(-300..300));
            let near = (random.f64() - 0.5) * 10f64.powi(random.i32(-6..11));
            let few = (near * 100.0).round() / 100.0;
            for value in [value, near, few] {
                let rounded: f64 = format!("{value:.11e}").parse().unwrap();
                let written = match rounded.abs() {
                    0.0 => "0".to_owned(),
                    size if (1e-4..1e9).contains(&size) => rounded.to_string(),
                    _ => format!("{rounded:e}"),
                };
                assert_eq!(number_text(value), written);
            }
        }
    }
}
