//! Numbers on the screen: aligned columns, seven significant digits.

use nalgebra::{Complex, DMatrix};
use std::fmt;

/// A table whose columns of numbers are right-aligned, and others left-aligned. The first column is
/// one of names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with a line of headers, with units where there are any.
    pub fn new<S: Into<String>>(headers: impl IntoIterator<Item = S>) -> Self {
        let mut table = Self::default();
        table.row(headers);
        table
    }

    /// One more line.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// The rows of a matrix, named by `names`, below `headers`.
    pub fn of_matrix<const C: usize>(
        headers: [&str; C],
        names: &[&str],
        matrix: &DMatrix<f64>,
    ) -> Self {
        let mut table = Self::new(std::iter::once("").chain(headers));
        for (name, row) in names.iter().zip(matrix.row_iter()) {
            let numbers = row.iter().map(|value| number(*value));
            table.row(std::iter::once((*name).to_owned()).chain(numbers));
        }
        table
    }

    /// Whether a cell of this column below its header is a number, with a relation or a per cent
    /// sign perhaps; or all are empty.
    fn has_numbers(&self, column: usize) -> bool {
        let is_number = |cell: &str| {
            let bare = cell.trim_start_matches(['<', '>', '=', '\u{b1}', ' ']);
            bare.trim_end_matches([' ', '%']).parse::<f64>().is_ok()
        };
        let below = self.rows.iter().skip(1);
        let mut cells = below
            .filter_map(|row| row.get(column))
            .filter(|cell| !cell.is_empty())
            .peekable();
        cells.peek().is_none() || cells.any(|cell| is_number(cell))
    }

    fn width(&self, column: usize) -> usize {
        let cells = self.rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for row in &self.rows {
            let mut line = String::new();
            for (column, cell) in row.iter().enumerate() {
                let width = self.width(column);
                if column == 0 || !self.has_numbers(column) {
                    line.push_str(&format!("  {cell:<width$}"));
                } else {
                    line.push_str(&format!("  {cell:>width$}"));
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// A number with seven significant digits; with a power of ten where it is very large or small.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if (1e-4..1e6).contains(&size) {
        let decimals = (6 - size.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.6e}")
    }
}

/// The same without zeros at its end: for a number that somebody gave, and for the middle of a
/// sentence.
pub fn short(value: f64) -> String {
    let text = number(value);
    let (digits, power) = match text.split_once('e') {
        Some((digits, power)) => (digits, format!("e{power}")),
        None => (text.as_str(), String::new()),
    };
    let digits = match digits.contains('.') {
        true => digits.trim_end_matches('0').trim_end_matches('.'),
        false => digits,
    };
    format!("{digits}{power}")
}

/// A complex number.
pub fn complex(value: Complex<f64>) -> String {
    if value.im == 0.0 {
        return number(value.re);
    }
    let sign = if value.im < 0.0 { '-' } else { '+' };
    format!("{} {sign} {} i", number(value.re), number(value.im.abs()))
}

/// Poles, one after the other.
pub fn poles(poles: &[Complex<f64>]) -> String {
    let poles: Vec<String> = poles.iter().map(|pole| complex(*pole)).collect();
    poles.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_seven_significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (0.447_213_595, "0.4472136"),
            (-6.195_773_12, "-6.195773"),
            (0.002_483_22, "0.002483220"),
            (40_698.667, "40698.67"),
            (999_999.0, "999999.0"),
            (1e6, "1.000000e6"),
            (-1.5e-9, "-1.500000e-9"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(complex(Complex::new(-1.0, 0.0)), "-1.000000");
        assert_eq!(complex(Complex::new(-1.0, -2.0)), "-1.000000 - 2.000000 i");
    }

    #[test]
    fn given_numbers_are_as_they_were_given() {
        for (value, text) in [
            (0.0, "0"),
            (200.0, "200"),
            (0.1 + 0.2, "0.3"),
            (1e6, "1e6"),
            (-1e200, "-1e200"),
            (2.5e-9, "2.5e-9"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn words_begin_where_their_header_does() {
        let mut table = Table::new(["name", "title", "limit", "off by"]);
        table.row(["a", "A long title", "<= 5", "2.0 %"]);
        table.row(["b", "Short", ">= 10", ""]);
        assert_eq!(
            table.to_string(),
            "  name  title         limit  off by\n  a     A long title   <= 5   2.0 %\n  \
             b     Short         >= 10\n"
        );
    }

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::new(["", "a [m]", "b"]);
        table.row(["row", "1", "-22"]);
        assert_eq!(table.to_string(), "       a [m]    b\n  row      1  -22\n");
    }
}
