//! Numbers in messages for people.

/// A number as a person would write it: at most twelve significant digits, which hides what rounding
/// adds, and a power of ten where it is very large or small.
pub fn number_text(value: f64) -> String {
    let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e9).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::number_text;

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
            (f64::INFINITY, "inf"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
            (std::f64::consts::PI, "3.14159265359"),
        ] {
            assert_eq!(number_text(value), written);
        }
    }
}
