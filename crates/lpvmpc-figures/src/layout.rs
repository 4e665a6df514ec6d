//! From a figure to a scene: where title, legend and panels stand.

use super::axis::Axes;
use super::figure::{Figure, FigureError, Panel, Style};
use super::font::Font;
use super::legend::Legend;
use super::panel::{LABEL_SIZE, Placed, TICK_GAP, TICK_SIZE, widest};
use super::scene::{Anchor, Rect, Scene, Turn};
use super::ticks::{Ticks, common_power};
use std::cmp::Ordering;

const TITLE_SIZE: f64 = 16.0;
/// Around everything.
const MARGIN: f64 = 10.0;
/// Between the rows of panels, and between their columns.
const GAP: f64 = 8.0;
/// Below the frame, for the labels of the ticks.
const TICK_ROOM: f64 = TICK_GAP + 1.3 * TICK_SIZE;
/// Below that, for the label of the axis.
const LABEL_ROOM: f64 = 1.6 * LABEL_SIZE;
/// Right of the frame, for half a label.
const RIGHT_ROOM: f64 = 16.0;
/// Smallest inside of a frame.
const SMALLEST: (f64, f64) = (80.0, 60.0);

/// The figure as lines and texts.
pub(super) fn scene(figure: &Figure) -> Result<Scene, FigureError> {
    check(figure)?;
    let font = Font::load()?;
    let panels = figure
        .panels
        .iter()
        .map(|panel| Ok((panel, Axes::of(panel)?)))
        .collect::<Result<Vec<_>, FigureError>>()?;
    let mut scene = Scene {
        width: figure.width,
        height: figure.height,
        shapes: Vec::new(),
    };
    let top = draw_heading(figure, &panels, &font, &mut scene);
    for panel in placed(figure, &panels, &font, top)? {
        panel.draw(&font, &mut scene);
    }
    Ok(scene)
}

/// Title and legend; returns where they end.
fn draw_heading(figure: &Figure, panels: &[(&Panel, Axes)], font: &Font, scene: &mut Scene) -> f64 {
    let middle = figure.width / 2.0;
    let mut top = MARGIN;
    if !figure.title.is_empty() {
        // A long title is set smaller rather than cut off.
        let room = (figure.width - 2.0 * MARGIN) / font.width(&figure.title, TITLE_SIZE);
        let size = TITLE_SIZE * room.min(1.0);
        let at = (middle, top + TITLE_SIZE);
        scene.text(&figure.title, at, size, Anchor::Middle, Turn::Upright);
        top += 1.6 * TITLE_SIZE;
    }
    let legend = Legend::of(panels, font, figure.width - 2.0 * MARGIN);
    legend.draw(middle, top, scene);
    top + legend.height()
}

/// The panels in their places: one height for all frames, and one width but in a last row that is not
/// full, whose panels share the whole width.
fn placed<'a>(
    figure: &Figure,
    panels: &[(&'a Panel, Axes)],
    font: &Font,
    top: f64,
) -> Result<Vec<Placed<'a>>, FigureError> {
    let columns = figure.columns.min(panels.len());
    let rows: Vec<RowRoom> = panels
        .chunks(columns)
        .enumerate()
        .map(|(row, chunk)| RowRoom::of(chunk, panels, row * columns + columns))
        .collect();
    let taken: f64 = rows.iter().map(|row| row.above + row.below).sum();
    let gaps = (rows.len() - 1) as f64 * GAP;
    let height = (figure.height - top - MARGIN - gaps - taken) / rows.len() as f64;

    let count = (height / 26.0).clamp(2.0, 8.0) as usize;
    let y_ticks: Vec<Ticks> = panels
        .iter()
        .map(|(_, axes)| Ticks::of(&axes.y, count, false))
        .collect();
    let label_distance = |ticks: &Ticks| TICK_GAP + widest(font, ticks) + 0.5 * LABEL_SIZE + 7.0;
    // The same room on the left in every column, so that all frames are as wide.
    let left_room = y_ticks.iter().map(label_distance).fold(0.0, f64::max) + 0.5 * LABEL_SIZE;
    let pitch = |columns: usize| (figure.width - 2.0 * MARGIN + GAP) / columns as f64;
    let frame_width = |columns: usize| pitch(columns) - GAP - left_room - RIGHT_ROOM;
    if !(frame_width(columns) >= SMALLEST.0 && height >= SMALLEST.1) {
        return Err(FigureError::Size {
            width: figure.width,
            height: figure.height,
            rows: rows.len(),
            columns,
        });
    }

    let mut frame_top = top;
    let mut placed = Vec::new();
    let mut ticks = y_ticks.into_iter();
    for (room, chunk) in rows.iter().zip(panels.chunks(columns)) {
        frame_top += room.above;
        for (column, ((panel, axes), y_ticks)) in chunk.iter().zip(&mut ticks).enumerate() {
            let left = MARGIN + column as f64 * pitch(chunk.len()) + left_room;
            let frame = Rect {
                left,
                top: frame_top,
                width: frame_width(chunk.len()),
                height,
            };
            let area = if panel.equal_aspect {
                with_equal_units(frame, axes)
            } else {
                frame
            };
            let has_x_label = room.labelled[column];
            placed.push(Placed {
                panel,
                axes: *axes,
                label_distance: label_distance(&y_ticks),
                y_ticks,
                area,
                letter: letter(placed.len(), panels.len()),
                letter_distance: left_room,
                has_x_label,
            });
        }
        frame_top += height + room.below + GAP;
    }
    Ok(placed)
}

/// What a text calls the panel `index` of `count`: a, b, c and so on, where there are several.
fn letter(index: usize, count: usize) -> Option<char> {
    let letter = u8::try_from(index).ok().and_then(|i| b'a'.checked_add(i))?;
    (count > 1 && letter.is_ascii_lowercase()).then(|| char::from(letter))
}

/// What a row of panels needs above and below its frames.
struct RowRoom {
    above: f64,
    below: f64,
    /// Which of its panels show the label of the horizontal axis.
    labelled: Vec<bool>,
}

impl RowRoom {
    /// `chunk` is the row; `next` is the index in `panels` of the panel below its first.
    fn of(chunk: &[(&Panel, Axes)], panels: &[(&Panel, Axes)], next: usize) -> Self {
        let titled = chunk.iter().any(|(panel, _)| !panel.title.is_empty());
        let powers = |axis| common_power(axis).is_some();
        let lettered = panels.len() > 1;
        let raised = titled || lettered || chunk.iter().any(|(_, axes)| powers(&axes.y));
        // A label stands once below panels with the same axis that stand below each other.
        let aligned = panels.len() >= next + chunk.len();
        let repeated = |column: usize, (panel, axes): &(&Panel, Axes)| {
            let below = panels.get(next + column).filter(|_| aligned);
            below.is_some_and(|(other, its)| other.x_label == panel.x_label && its.x == axes.x)
        };
        let labelled: Vec<bool> = chunk
            .iter()
            .enumerate()
            .map(|(column, panel)| !repeated(column, panel))
            .collect();
        let lowered = labelled.contains(&true) || chunk.iter().any(|(_, axes)| powers(&axes.x));
        Self {
            above: if raised {
                1.8 * LABEL_SIZE
            } else {
                0.5 * LABEL_SIZE
            },
            below: TICK_ROOM + if lowered { LABEL_ROOM } else { 0.0 },
            labelled,
        }
    }
}

/// The largest area in the middle of `frame` where one unit is as long on both axes.
fn with_equal_units(frame: Rect, axes: &Axes) -> Rect {
    let spans = (axes.x.upper - axes.x.lower, axes.y.upper - axes.y.lower);
    let unit = (frame.width / spans.0).min(frame.height / spans.1);
    let (width, height) = (spans.0 * unit, spans.1 * unit);
    let left = frame.left + (frame.width - width) / 2.0;
    let top = frame.top + (frame.height - height) / 2.0;
    Rect {
        left,
        top,
        width,
        height,
    }
}

fn check(figure: &Figure) -> Result<(), FigureError> {
    if figure.panels.is_empty() || figure.columns == 0 {
        return Err(FigureError::Empty {
            title: figure.title.clone(),
            panels: figure.panels.len(),
            columns: figure.columns,
        });
    }
    figure.panels.iter().try_for_each(check_panel)
}

fn check_panel(panel: &Panel) -> Result<(), FigureError> {
    for series in &panel.series {
        let (x, y) = (series.x.len(), series.y.len());
        let held = matches!(series.style, Style::Steps(_)) && x == y + 1;
        if x != y && !held {
            return Err(FigureError::Lengths {
                panel: panel.y_label.clone(),
                series: series.label.clone(),
                x,
                y,
            });
        }
    }
    match panel.band {
        // NaN has no order, and is refused, too.
        Some(band)
            if band
                .lower
                .partial_cmp(&band.upper)
                .is_none_or(Ordering::is_gt) =>
        {
            Err(FigureError::Band {
                panel: panel.y_label.clone(),
                lower: band.lower,
                upper: band.upper,
            })
        }
        _ => Ok(()),
    }
}
