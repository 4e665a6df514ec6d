//! Numbers in sentences.

/// A number with at most four significant digits, without the zeros behind them; "unknown" where
/// there is none.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !value.is_finite() {
        "unknown".to_owned()
    } else if (1e-4..1e6).contains(&size) {
        let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{value:.1e}")
    }
}

/// A part in per cent; beyond a hundred the number says nothing any more.
pub(crate) fn percent(part: f64) -> String {
    if part <= 1.0 {
        format!("{:.0} %", 100.0 * part)
    } else {
        "more than 100 %".to_owned()
    }
}

/// How many times; a number that is so large says nothing any more.
pub(crate) fn times(ratio: f64) -> String {
    if ratio <= 1000.0 {
        format!("{ratio:.2}")
    } else {
        "more than 1000".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_never_nan() {
        for (value, text) in [
            (0.0, "0"),
            (0.005_000_000_000_000_2, "0.005"),
            (-3.137_94, "-3.138"),
            (2284.3, "2284"),
            (120.0, "120"),
            (1e-7, "1.0e-7"),
            (f64::NAN, "unknown"),
            (f64::INFINITY, "unknown"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(percent(f64::NAN), "more than 100 %");
        assert_eq!(percent(0.071), "7 %");
        assert_eq!(times(f64::INFINITY), "more than 1000");
        assert_eq!(times(1.301), "1.30");
    }
}
