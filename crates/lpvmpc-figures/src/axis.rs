//! The views of a panel: what part of each axis is shown.

use super::figure::{Band, FigureError, Panel, Scale, Style};

/// A bound within this part of the data's span is brought into view.
const NEAR: f64 = 0.75;
/// Room between the data and the frame, as part of the span.
const ROOM: f64 = 0.05;

/// Where one unit is as long on both axes, the shorter span is at least this part of the longer one: what is flatter would
/// be a line without room for its ticks.
const LEAST_SHARE: f64 = 1.0 / 3.0;

/// Largest size of a value in view, and inverse of the smallest span: beyond it the arithmetic of
/// the ticks would overflow.
const LARGEST: f64 = 1e290;

/// One axis: its scale and its view in the unit of the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub scale: Scale,
    pub lower: f64,
    pub upper: f64,
}

/// Both axes of a panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    pub x: Axis,
    pub y: Axis,
}

impl Axis {
    /// Where `value` lies in the view: 0 at the lower end, 1 at the upper. Not finite for a value
    /// that the axis cannot show.
    pub fn fraction(&self, value: f64) -> f64 {
        let [value, lower, upper] = [value, self.lower, self.upper].map(|v| self.transformed(v));
        (value - lower) / (upper - lower)
    }

    pub fn contains(&self, value: f64) -> bool {
        (self.lower..=self.upper).contains(&value)
    }

    fn transformed(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Log => value.log10(),
        }
    }

    fn span(&self) -> f64 {
        self.upper - self.lower
    }

    /// Widened about its middle to `span`, where it is shorter.
    fn at_least(self, span: f64) -> Self {
        let missing = (span - self.span()).max(0.0) / 2.0;
        Self {
            lower: self.lower - missing,
            upper: self.upper + missing,
            ..self
        }
    }

    fn is_view(&self) -> bool {
        let span = self.transformed(self.upper) - self.transformed(self.lower);
        let smallest = match self.scale {
            Scale::Linear => span,
            Scale::Log => self.lower,
        };
        let fits = |size: f64| (1.0 / LARGEST..LARGEST).contains(&size);
        span > 0.0 && fits(smallest) && fits(self.upper.abs().max(self.lower.abs()))
    }
}

impl Axes {
    /// The views of `panel`, from its ranges or else from its data.
    pub fn of(panel: &Panel) -> Result<Self, FigureError> {
        let shown = |value: f64| match panel.y_scale {
            Scale::Linear => value.is_finite(),
            Scale::Log => value.is_finite() && value > 0.0,
        };
        let points = || {
            let all = panel.series.iter().flat_map(|series| series.points());
            all.filter(|(x, y)| x.is_finite() && shown(*y))
        };
        let no_data = || FigureError::NoData {
            panel: panel.y_label.clone(),
        };

        let x_of_data = extent(points().map(|(x, _)| x)).ok_or_else(no_data)?;
        let x = Axis::linear(
            panel
                .x_range
                .unwrap_or_else(|| horizontal(panel, x_of_data)),
        );
        let in_view = points().filter(|(at, _)| x.contains(*at)).map(|(_, y)| y);
        let y_of_data = extent(in_view).ok_or_else(no_data)?;
        let (lower, upper) = panel.y_range.unwrap_or_else(|| vertical(panel, y_of_data));
        let y = Axis {
            scale: panel.y_scale,
            lower,
            upper,
        };
        let (x, y) = match (panel.equal_aspect, panel.y_scale) {
            (true, Scale::Linear) => (
                x.at_least(LEAST_SHARE * y.span()),
                y.at_least(LEAST_SHARE * x.span()),
            ),
            _ => (x, y),
        };

        for (axis, name) in [(x, "horizontal"), (y, "vertical")] {
            if !axis.is_view() {
                return Err(FigureError::View {
                    panel: panel.y_label.clone(),
                    axis: name,
                    lower: axis.lower,
                    upper: axis.upper,
                });
            }
        }
        Ok(Self { x, y })
    }
}

impl Axis {
    fn linear((lower, upper): (f64, f64)) -> Self {
        Self {
            scale: Scale::Linear,
            lower,
            upper,
        }
    }
}

/// Gives all panels the horizontal view that shows the data of every one.
pub(super) fn share_horizontal_view(panels: &mut [Panel]) {
    let all = panels
        .iter()
        .flat_map(|panel| &panel.series)
        .flat_map(|series| &series.x);
    let view = extent(all.copied().filter(|x| x.is_finite())).map(widened);
    for panel in panels {
        panel.x_range = view;
    }
}

fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |extent, value| {
        let (lower, upper) = extent.unwrap_or((value, value));
        Some((value.min(lower), value.max(upper)))
    })
}

/// Curves reach from side to side; discs and paths keep away from the frame.
fn horizontal(panel: &Panel, data: (f64, f64)) -> (f64, f64) {
    let has_discs = |style| matches!(style, Style::Markers | Style::MarkedLine(_));
    let (lower, upper) = widened(data);
    if panel.equal_aspect || panel.series.iter().any(|series| has_discs(series.style)) {
        with_room((lower, upper))
    } else {
        (lower, upper)
    }
}

fn vertical(panel: &Panel, data: (f64, f64)) -> (f64, f64) {
    match panel.y_scale {
        Scale::Linear => with_room(with_near_bounds(widened(data), panel.band)),
        Scale::Log => {
            let (lower, upper) = (data.0.log10(), data.1.log10());
            // At least a factor of two, so that there is something to read.
            let middle = f64::midpoint(lower, upper);
            let half = ((upper - lower) / 2.0).max(2.0_f64.log10() / 2.0);
            let (lower, upper) = with_room((middle - half, middle + half));
            (10.0_f64.powf(lower), 10.0_f64.powf(upper))
        }
    }
}

/// A range whose ends differ by more than rounding.
fn widened((lower, upper): (f64, f64)) -> (f64, f64) {
    let size = lower.abs().max(upper.abs());
    if upper - lower > 1e-9 * size {
        (lower, upper)
    } else {
        let half = if size > 0.0 { 0.1 * size } else { 1.0 };
        (lower - half, upper + half)
    }
}

fn with_near_bounds((lower, upper): (f64, f64), band: Option<Band>) -> (f64, f64) {
    let reach = NEAR * (upper - lower);
    let near = |bound: f64| (lower - reach..=upper + reach).contains(&bound);
    let bounds = band
        .map(|band| [band.lower, band.upper])
        .unwrap_or_default();
    let shown = bounds
        .into_iter()
        .filter(|bound| band.is_some() && near(*bound));
    shown.fold((lower, upper), |(lower, upper), bound| {
        (lower.min(bound), upper.max(bound))
    })
}

fn with_room((lower, upper): (f64, f64)) -> (f64, f64) {
    let room = ROOM * (upper - lower);
    (lower - room, upper + room)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Dash, Role, Series};

    fn panel(y: &[f64]) -> Panel {
        let x: Vec<f64> = (0..y.len()).map(|k| k as f64).collect();
        Panel::new(
            "t [s]",
            "v",
            vec![Series::new("", &x, y, Style::Line(Dash::Solid), Role::Lpv)],
        )
    }

    #[test]
    fn a_near_bound_comes_into_view_and_a_far_one_does_not() {
        let mut panel = panel(&[-0.5, 0.5]);
        panel.band = Some(Band {
            lower: -40.0,
            upper: 1.0,
        });
        let y = Axes::of(&panel).unwrap().y;
        assert!(y.contains(1.0) && y.upper > 1.0);
        assert!(y.lower > -1.0);
    }

    #[test]
    fn infinite_bounds_leave_the_view_alone() {
        let mut bounded = panel(&[-0.5, 0.5]);
        let free = Axes::of(&bounded).unwrap();
        bounded.band = Some(Band {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        });
        assert_eq!(Axes::of(&bounded).unwrap(), free);
    }

    #[test]
    fn constant_data_gets_a_view_around_it() {
        for value in [0.0, 3.0, -1e-12, 1e12] {
            let y = Axes::of(&panel(&[value, value])).unwrap().y;
            assert!(y.lower < value && value < y.upper, "{value}: {y:?}");
        }
    }

    #[test]
    fn the_logarithmic_view_passes_over_zeros() {
        let mut panel = panel(&[0.0, 1e-12, 1e-9, -1.0]);
        panel.y_scale = Scale::Log;
        let y = Axes::of(&panel).unwrap().y;
        assert!(y.lower > 1e-13 && y.upper < 1e-8, "{y:?}");
        assert!((y.fraction(1e-12_f64.max(y.lower)) - 0.045).abs() < 0.01);
    }

    #[test]
    fn data_that_overflow_the_view_are_refused() {
        assert!(matches!(
            Axes::of(&panel(&[-1e308, 1e308])),
            Err(FigureError::View { .. })
        ));
    }
}
