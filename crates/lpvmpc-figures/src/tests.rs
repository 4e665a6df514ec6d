//! What a figure promises, checked on its output.

use super::*;
use proptest::prelude::*;
use roxmltree::{Document, Node};

const LINE: Style = Style::Line(Dash::Solid);

fn panel(x: &[f64], y: &[f64], style: Style) -> Panel {
    Panel::new(
        "t [s]",
        "v [m/s]",
        vec![Series::new("run", x, y, style, Role::Lpv)],
    )
}

fn figure(panels: Vec<Panel>) -> Figure {
    Figure {
        title: "A figure".to_owned(),
        panels,
        columns: 2,
        width: 800.0,
        height: 600.0,
    }
}

fn ramp(count: u32) -> Vec<f64> {
    (0..count).map(f64::from).collect()
}

fn attribute(node: Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).unwrap().parse().unwrap()
}

/// Position of the text with this content.
fn text_at(document: &Document<'_>, content: &str) -> (f64, f64) {
    let texts = document
        .descendants()
        .filter(|node| node.has_tag_name("text"));
    let mut texts = texts.filter(|node| node.text() == Some(content));
    let node = texts.next().unwrap();
    assert!(texts.next().is_none(), "{content} stands twice");
    (attribute(node, "x"), attribute(node, "y"))
}

/// Points of every line with the colour of the role.
fn lines(document: &Document<'_>, color: &str) -> Vec<Vec<(f64, f64)>> {
    let paths = document
        .descendants()
        .filter(|node| node.attribute("stroke") == Some(color));
    paths
        .filter_map(|path| path.attribute("d"))
        .map(|d| {
            d[1..]
                .split('L')
                .map(|point| point.split_once(' ').unwrap())
                .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
                .collect()
        })
        .collect()
}

const LPV: &str = "#0072b2";

#[test]
fn every_maker_gives_a_self_contained_document_and_the_same_one_again() {
    let time = ramp(5);
    let states = [[0.1, 0.2, -3.0, 0.5]; 5];
    let run = PlaneRun {
        label: "LPV",
        role: Role::Lpv,
        time: &time,
        states: &states,
        torque: &time[..4],
        cost: &time[..4],
    };
    let reference = Reference {
        time: &time,
        phi: &time,
        held: true,
    };
    let bounds = Band {
        lower: -1.0,
        upper: 1.0,
    };
    let limits = Limits {
        states: [bounds; 4],
        torque: bounds,
    };
    let model_runs = ModelRuns {
        time: &time,
        linearised: &states,
        nonlinear: &states,
        lpv: &[[0.1, 0.2, -3.0, 0.6]; 5],
        sampled_time: &time[..2],
        runge_kutta: &states[..2],
        torque_time: &time,
        torque: &time,
        torque_held: false,
    };
    let path = PathRun {
        label: "LPV",
        role: Role::Lpv,
        x: &time,
        y: &time,
    };
    let figures = [
        closed_loop("run", &[run, run], Some(reference), Some(limits)),
        two_planes("planes", [run, run], Some([reference; 2]), Some(limits)),
        path_in_plane("path", &[path], Some((&time, &time))),
        motor_torques("motors", &time, [&time[..4]; 3], Some(bounds)),
        models("models", &model_runs),
        convergence("refinement", &[30.0, 1.0, 0.433], 0.433),
    ];
    for figure in figures {
        let svg = figure.svg().unwrap();
        let document = Document::parse(&svg).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "svg");
        for node in document.descendants().filter(|node| node.is_element()) {
            for foreign in ["id", "class", "href", "style", "clip-path"] {
                assert_eq!(node.attribute(foreign), None, "{}: {foreign}", figure.title);
            }
            assert!(["svg", "rect", "path", "circle", "text"].contains(&node.tag_name().name()));
        }
        assert_eq!(svg, figure.svg().unwrap());
        assert_eq!(figure.png(1.0).unwrap(), figure.png(1.0).unwrap());
    }
}

#[test]
fn labels_are_text_and_never_markup() {
    let mut figure = figure(vec![panel(&[0.0, 1.0], &[0.0, 1.0], LINE)]);
    figure.title = "a < b & \"c\" \u{7} </svg>".to_owned();
    figure.panels[0].series[0].label = "<script>".to_owned();
    let svg = figure.svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    text_at(&document, "a < b & \"c\"  </svg>");
    text_at(&document, "<script>");
}

#[test]
fn the_png_has_the_size_asked_for() {
    let figure = figure(vec![panel(&[0.0, 1.0], &[0.0, 1.0], LINE)]);
    for (scale, size) in [(1.0, [800, 600]), (2.0, [1600, 1200]), (0.5, [400, 300])] {
        let png = figure.png(scale).unwrap();
        assert_eq!(&png[1..4], b"PNG");
        // Width and height stand first in the header chunk (PNG specification, 11.2.2).
        let side = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        assert_eq!([side(16), side(20)], size);
    }
    for scale in [0.0, -1.0, 1e6, f64::NAN] {
        assert!(
            matches!(figure.png(scale), Err(FigureError::PngSize { .. })),
            "{scale}"
        );
    }
}

#[test]
fn points_stand_where_the_ticks_say() {
    let points = panel(&[0.0, 1.0, 3.0, 4.0], &[-0.5, 1.0, 0.25, 2.0], LINE);
    let mut figure = figure(vec![points]);
    figure.columns = 1;
    let svg = figure.svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let (x0, x1) = (text_at(&document, "0").0, text_at(&document, "1").0);
    let (y0, y1) = (text_at(&document, "0.0").1, text_at(&document, "0.5").1);
    let drawn = &lines(&document, LPV);
    // The first such line is the sample in the legend.
    let drawn = &drawn[1];
    // Between labels and lines there is the constant shift of the labels' baseline.
    let slopes = (x1 - x0, 2.0 * (y1 - y0));
    for (pair, (dx, dy)) in drawn
        .windows(2)
        .zip([(1.0, 1.5), (2.0, -0.75), (1.0, 1.75)])
    {
        assert!((pair[1].0 - pair[0].0 - dx * slopes.0).abs() < 0.05);
        assert!((pair[1].1 - pair[0].1 - dy * slopes.1).abs() < 0.05);
    }
}

/// A figure of five panels had an empty place for a sixth.
#[test]
fn a_last_row_that_is_not_full_takes_the_whole_width() {
    let one = || panel(&ramp(3), &[0.0, 1.0, 0.5], LINE);
    let widths = |count: usize| {
        let svg = figure((0..count).map(|_| one()).collect()).svg().unwrap();
        let drawn = lines(&Document::parse(&svg).unwrap(), LPV);
        // The first such line is the sample in the legend.
        let width = |line: &Vec<(f64, f64)>| (line[0].0, line[2].0);
        drawn[1..].iter().map(width).collect::<Vec<_>>()
    };
    let (full, short) = (widths(4), widths(3));
    assert_eq!(short[..2], full[..2]);
    assert_eq!(short[2].0, full[0].0);
    assert_eq!(short[2].1, full[1].1);
    // Panels that do not stand below each other have their own label of the axis.
    let svg = figure((0..3).map(|_| one()).collect()).svg().unwrap();
    assert_eq!(svg.matches("t [s]").count(), 3);
}

#[test]
fn the_logarithmic_axis_puts_decades_at_equal_distances() {
    let mut panel = panel(&ramp(4), &[1e-3, 0.1, 1e-5, 10.0], LINE);
    panel.y_scale = Scale::Log;
    let mut figure = figure(vec![panel]);
    figure.columns = 1;
    let svg = figure.svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let decade = text_at(&document, "10⁰").1 - text_at(&document, "10¹").1;
    let drawn = &lines(&document, LPV)[1];
    for (pair, decades) in drawn.windows(2).zip([2.0, -4.0, 6.0]) {
        assert!((pair[0].1 - pair[1].1 - decades * decade).abs() < 0.05);
    }
}

#[test]
fn what_lies_beyond_a_bound_is_shaded() {
    let mut panel = panel(&ramp(3), &[-1.0, 1.0, -1.0], LINE);
    panel.band = Some(Band {
        lower: f64::NEG_INFINITY,
        upper: 1.5,
    });
    let svg = figure(vec![panel]).svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let shaded: Vec<_> = document
        .descendants()
        .filter(|node| node.attribute("fill") == Some("#dcdcdc"))
        .filter(|node| attribute(*node, "width") > 100.0)
        .collect();
    assert_eq!(shaded.len(), 1);
    let bottom = attribute(shaded[0], "y") + attribute(shaded[0], "height");
    let line = &lines(&document, LPV)[1];
    // The bound is a quarter of the data's span above its peak.
    let (low, high) = (line[0].1, line[1].1);
    assert!((bottom - (high + 0.25 * (high - low))).abs() < 0.05);
    text_at(&document, "outside the bounds");
}

/// A view of 2 x 2 tiles: each fills its quarter, and the darker, the larger its share.
#[test]
fn tiles_fill_their_parts_of_the_view() {
    let style = Style::Tiles {
        columns: 2,
        rows: 2,
    };
    let tile =
        |x: f64, y: f64, percent: u8| Series::new("", &[x], &[y], style, Role::Share(percent));
    let mut panel = Panel::new("x", "y", vec![tile(0.5, 0.5, 0), tile(1.5, 1.5, 100)]);
    (panel.x_range, panel.y_range) = (Some((0.0, 2.0)), Some((0.0, 2.0)));
    let svg = figure(vec![panel]).svg().unwrap();
    let document = Document::parse(&svg).unwrap();
    let filled = |color: &str| {
        let rects = document
            .descendants()
            .filter(|node| node.has_tag_name("rect"));
        let mut rects = rects.filter(|node| node.attribute("fill") == Some(color));
        let rect = rects.next().unwrap();
        ["x", "y", "width", "height"].map(|name| attribute(rect, name))
    };
    let (pale, dark) = (filled("#e8f2fa"), filled("#5a0014"));
    assert!(
        (pale[0] + pale[2] - dark[0]).abs() < 1.0,
        "{pale:?} {dark:?}"
    );
    assert!(
        (dark[1] + dark[3] - pale[1]).abs() < 1.0,
        "{pale:?} {dark:?}"
    );
    assert!((pale[2] - dark[2]).abs() < 1.0 && pale[2] > 100.0);
}

#[test]
fn values_that_are_not_numbers_leave_gaps() {
    let y = [0.0, 1.0, f64::NAN, 1.0, 2.0, f64::INFINITY, 3.0];
    let svg = figure(vec![panel(&ramp(7), &y, LINE)]).svg().unwrap();
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    let document = Document::parse(&svg).unwrap();
    let pieces = lines(&document, LPV);
    assert_eq!(pieces.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
    // The last value has no neighbour, and is a dot.
    assert_eq!(
        document
            .descendants()
            .filter(|node| node.has_tag_name("circle"))
            .count(),
        1
    );
}

#[test]
fn the_last_step_lasts_until_the_last_instant() {
    let steps = panel(&ramp(4), &[0.0, 2.0, 1.0], Style::Steps(Dash::Solid));
    let svg = figure(vec![steps]).svg().unwrap();
    let line = &lines(&Document::parse(&svg).unwrap(), LPV)[1];
    assert_eq!(line.len(), 6);
    assert_eq!(line[4].1, line[5].1);
    assert!(line[5].0 > line[4].0);
}

#[test]
fn what_cannot_be_drawn_is_an_error_that_names_the_panel() {
    let fails = |panel: Panel| {
        let error = figure(vec![panel]).svg().unwrap_err();
        assert!(error.to_string().contains("v [m/s]"), "{error}");
        error
    };
    let good = panel(&[0.0, 1.0], &[0.0, 1.0], LINE);
    assert!(matches!(
        fails(panel(&[], &[], LINE)),
        FigureError::NoData { .. }
    ));
    assert!(matches!(
        fails(panel(&[0.0], &[f64::NAN], LINE)),
        FigureError::NoData { .. }
    ));
    assert!(matches!(
        fails(panel(&[0.0, 1.0], &[0.0], LINE)),
        FigureError::Lengths { .. }
    ));
    let negative = Panel {
        y_scale: Scale::Log,
        ..panel(&[0.0, 1.0], &[0.0, -1.0], LINE)
    };
    assert!(matches!(fails(negative), FigureError::NoData { .. }));
    let reversed = Panel {
        y_range: Some((1.0, -1.0)),
        ..good.clone()
    };
    assert!(matches!(fails(reversed), FigureError::View { .. }));
    let bounded = |lower, upper| Panel {
        band: Some(Band { lower, upper }),
        ..good.clone()
    };
    for (lower, upper) in [(f64::NAN, 1.0), (1.0, 0.0)] {
        assert!(matches!(
            fails(bounded(lower, upper)),
            FigureError::Band { .. }
        ));
    }
    // One value alone is a range: of an input that is switched off.
    figure(vec![bounded(0.5, 0.5)]).svg().unwrap();

    assert!(matches!(
        figure(vec![]).svg(),
        Err(FigureError::Empty { .. })
    ));
    let small = Figure {
        width: 100.0,
        ..figure(vec![good.clone(), good])
    };
    assert!(matches!(small.svg(), Err(FigureError::Size { .. })));
}

fn any_value() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -1e3..1e3, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(0.0)]
}

proptest! {
    /// Whatever the data: an error, or a sound document with every line inside the picture.
    #[test]
    fn no_data_break_the_picture(
        points in prop::collection::vec((any_value(), any_value()), 0..12),
        logarithmic in any::<bool>(),
        style in prop::sample::select(vec![
            LINE,
            Style::Steps(Dash::Dashed),
            Style::Markers,
            Style::MarkedLine(Dash::Dotted),
        ]),
        bounds in prop::option::of((any_value(), any_value())),
        equal_aspect in any::<bool>(),
    ) {
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let mut panel = panel(&x, &y, style);
        panel.y_scale = if logarithmic { Scale::Log } else { Scale::Linear };
        panel.band = bounds.map(|(lower, upper)| Band { lower, upper });
        panel.equal_aspect = equal_aspect;
        let figure = figure(vec![panel]);
        if let Ok(svg) = figure.svg() {
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
            let document = Document::parse(&svg).unwrap();
            for (x, y) in lines(&document, LPV).into_iter().flatten() {
                prop_assert!((0.0..=figure.width).contains(&x), "x = {x}");
                prop_assert!((0.0..=figure.height).contains(&y), "y = {y}");
            }
            prop_assert!(figure.png(0.25).is_ok());
        }
    }
}

/// A path that is a thousand times as long as wide was drawn as a line, its ticks over each other.
#[test]
fn a_flat_path_has_room_for_its_ticks() {
    for (x, y) in [
        ([0.0, 1.0, 2.0], [0.0, 1e-3, 0.0]),
        ([0.0, 1e-3, 0.0], [0.0, 1.0, 2.0]),
    ] {
        let mut panel = panel(&x, &y, LINE);
        panel.equal_aspect = true;
        let axes = axis::Axes::of(&panel).unwrap();
        let spans = [axes.x, axes.y].map(|axis| axis.upper - axis.lower);
        let [short, long] = [spans[0].min(spans[1]), spans[0].max(spans[1])];
        assert!((short / long - 1.0 / 3.0).abs() < 1e-12, "{spans:?}");
        assert!(x.iter().all(|x| axes.x.contains(*x)) && y.iter().all(|y| axes.y.contains(*y)));
    }
}
