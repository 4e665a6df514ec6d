//! Runs whose first moments would set the scale of all that comes after them.

use super::axis::{Axes, share_horizontal_view};
use super::figure::{Panel, Series};

/// As much of a run is its beginning.
const BEGINNING: f64 = 0.02;
/// A beginning that needs more than this many times the scale of the rest gets panels of its own.
const DOMINATES: f64 = 2.0;

/// Panels over time, one below the other, on one axis of time. Where the beginning dominates the
/// scale of one of them they stand in two columns: the beginning, and the whole run at the scale of
/// what comes after it. Also returns the number of columns.
pub(super) fn with_beginning(mut panels: Vec<Panel>) -> (Vec<Panel>, usize) {
    share_horizontal_view(&mut panels);
    let Some((start, end)) = panels.first().and_then(|panel| panel.x_range) else {
        return (panels, 1);
    };
    let begun = start + BEGINNING * (end - start);
    // A panel without data is for the layout to refuse.
    let span = |panel: &Panel| Axes::of(panel).map(|axes| (axes.y.lower, axes.y.upper));
    let after: Vec<_> = panels
        .iter()
        .map(|panel| span(&from(panel, begun)))
        .collect();
    let dominates = panels.iter().zip(&after).any(|(panel, after)| {
        let size = |(lower, upper): (f64, f64)| upper - lower;
        match (span(panel), after) {
            (Ok(whole), Ok(after)) => size(whole) > DOMINATES * size(*after),
            _ => false,
        }
    });
    if !dominates {
        return (panels, 1);
    }
    let mut both = Vec::with_capacity(2 * panels.len());
    for (panel, after) in panels.into_iter().zip(after) {
        both.push(Panel {
            x_range: Some((start, begun)),
            ..panel.clone()
        });
        both.push(Panel {
            y_range: after.ok(),
            ..panel
        });
    }
    both[0].title = "the beginning".to_owned();
    both[1].title = "the whole run, at the scale of what follows".to_owned();
    (both, 2)
}

/// The panel with what is drawn from the time `begun` on.
fn from(panel: &Panel, begun: f64) -> Panel {
    let later = |series: &Series| {
        let first = series.x.partition_point(|x| *x < begun);
        let y = series.y.get(first..).unwrap_or_default();
        Series {
            x: series.x[first..].to_vec(),
            y: y.to_vec(),
            ..series.clone()
        }
    };
    Panel {
        series: panel.series.iter().map(later).collect(),
        ..panel.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{Dash, Role, Style};

    fn panel(first: f64) -> Panel {
        let x: Vec<f64> = (0..=700).map(|k| f64::from(k) * 0.1).collect();
        let y: Vec<f64> = x
            .iter()
            .map(|t| if *t < 0.3 { first } else { t.sin() })
            .collect();
        let line = Style::Line(Dash::Solid);
        Panel::new("t [s]", "v", vec![Series::new("", &x, &y, line, Role::Lpv)])
    }

    #[test]
    fn a_beginning_that_dominates_gets_a_panel_of_its_own() {
        let (panels, columns) = with_beginning(vec![panel(1.0), panel(40.0)]);
        assert_eq!((panels.len(), columns), (4, 2));
        let views: Vec<Axes> = panels
            .iter()
            .map(|panel| Axes::of(panel).unwrap())
            .collect();
        let end = views[2].x.upper;
        assert!(
            (end - 1.4).abs() < 1e-9 && views[2].y.contains(40.0),
            "{end}"
        );
        assert!(views[3].x.contains(70.0) && !views[3].y.contains(2.0));
    }

    #[test]
    fn others_stay_as_they_are() {
        let (panels, columns) = with_beginning(vec![panel(1.0), panel(0.5)]);
        assert_eq!((panels.len(), columns), (2, 1));
        assert_eq!(panels[0].y_range, None);
    }
}
