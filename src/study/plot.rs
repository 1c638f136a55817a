//! Work against precision: a picture for each norm, error against wall time and against unknowns times steps.
//!
//! A mark is a run. A line joins the runs of a scheme that no cheaper one of the scheme beats. Colours are those of
//! Okabe and Ito, which readers with any kind of colour vision tell apart; marks differ too.

use super::results::Results;
use crate::error::{Error, Result};
use plotters::prelude::*;
use std::path::Path;

const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const SIZE: (u32, u32) = (1200, 540);

/// Cost and error of a run.
type Point = (f64, f64);

/// The runs of a scheme.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    name: String,
    points: Vec<Point>,
}

/// Writes a picture for each norm of which two runs are known; gives file names and captions.
pub fn all(folder: &Path, results: &Results) -> Result<Vec<(String, String)>> {
    let mut written = Vec::new();
    for (at, norm) in results.norms.iter().enumerate() {
        let by_time = curves(results, at, |run| run.seconds.map(|s| s.computing));
        let by_work = curves(results, at, |run| Some((run.unknowns * run.steps) as f64));
        if by_time.iter().map(|curve| curve.points.len()).sum::<usize>() < 2 {
            continue;
        }
        let picture = draw(&norm.meaning, &by_time, &by_work).map_err(|error| {
            Error::Failed(format!("the picture of {} can't be drawn: {error}", norm.name))
        })?;
        let file = format!("work-precision-{}.svg", norm.name);
        let path = folder.join(&file);
        std::fs::write(&path, picture).map_err(|error| Error::unwritable(&path, error))?;
        written.push((file, format!("Work and precision: {}", norm.meaning)));
    }
    Ok(written)
}

fn curves(
    results: &Results,
    norm: usize,
    cost: impl Fn(&super::results::RunResult) -> Option<f64>,
) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for run in &results.runs {
        let error = run.errors.get(norm).and_then(|error| error.as_ref()).map(|error| error.error);
        let Some(point) = cost(run).zip(error).filter(|(x, y)| *x > 0.0 && *y > 0.0) else { continue };
        match curves.iter_mut().find(|curve| curve.name == run.scheme) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name: run.scheme.clone(), points: vec![point] }),
        }
    }
    curves
}

/// The points that no cheaper one beats, by cost.
fn front(points: &[Point]) -> Vec<Point> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut best = f64::INFINITY;
    sorted.retain(|(_, error)| {
        let better = *error < best;
        best = best.min(*error);
        better
    });
    sorted
}

fn draw(
    meaning: &str,
    by_time: &[Curve],
    by_work: &[Curve],
) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let panels = root.titled(meaning, ("sans-serif", 24))?.split_evenly((1, 2));
        for (panel, curves, axis) in
            [(&panels[0], by_time, "computing time in s"), (&panels[1], by_work, "unknowns x steps")]
        {
            let (x, y) = (range(curves, |p| p.0), range(curves, |p| p.1));
            let mut chart = ChartBuilder::on(panel)
                .margin(16)
                .margin_right(28)
                .x_label_area_size(52)
                .y_label_area_size(84)
                .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
            chart
                .configure_mesh()
                .x_desc(axis)
                .y_desc("error")
                .axis_desc_style(("sans-serif", 18))
                .label_style(("sans-serif", 15))
                .x_label_formatter(&label)
                .y_label_formatter(&label)
                .light_line_style(BLACK.mix(0.06))
                .bold_line_style(BLACK.mix(0.15))
                .draw()?;
            for (at, curve) in curves.iter().enumerate() {
                let colour = COLOURS[at % COLOURS.len()];
                let style = colour.stroke_width(2);
                let line = chart.draw_series(LineSeries::new(front(&curve.points), style))?;
                line.label(&curve.name)
                    .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 24, y)], style));
                let marks = curve.points.iter().copied();
                match at % 3 {
                    0 => chart.draw_series(marks.map(|point| Circle::new(point, 5, colour.filled())))?,
                    1 => chart
                        .draw_series(marks.map(|point| TriangleMarker::new(point, 7, colour.filled())))?,
                    _ => chart.draw_series(marks.map(|point| Cross::new(point, 6, style)))?,
                };
            }
            chart
                .configure_series_labels()
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.3))
                .label_font(("sans-serif", 16))
                .draw()?;
        }
        root.present()?;
    }
    Ok(text)
}

/// The tick's number, at 1, 2 and 5 times powers of ten only.
fn label(value: &f64) -> String {
    let text = format!("{value:.2e}");
    let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
    match mantissa {
        "1.00" => format!("1e{power}"),
        "2.00" => format!("2e{power}"),
        "5.00" => format!("5e{power}"),
        _ => String::new(),
    }
}

/// Whole decades around all points.
fn range(curves: &[Curve], pick: impl Fn(&Point) -> f64) -> (f64, f64) {
    let values = || curves.iter().flat_map(|curve| &curve.points).map(&pick);
    let low = values().fold(f64::INFINITY, f64::min).log10().floor();
    let high = values().fold(0.0, f64::max).log10().ceil();
    (10f64.powf(low), 10f64.powf(high.max(low + 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_joins_runs_that_no_cheaper_one_beats() {
        let points = [(4.0, 0.1), (1.0, 0.5), (2.0, 0.6), (3.0, 0.2), (3.0, 0.3)];
        assert_eq!(front(&points), [(1.0, 0.5), (3.0, 0.2), (4.0, 0.1)]);
    }

    #[test]
    fn ticks_are_named_at_one_two_and_five() {
        let named = [1.0, 0.2, 30.0, 5e-7].map(|value| label(&value));
        assert_eq!(named, ["1e0", "2e-1", "", "5e-7"]);
    }

    #[test]
    fn axes_end_at_whole_decades() {
        let curves = [Curve { name: "a".into(), points: vec![(0.02, 3.0), (0.7, 40.0)] }];
        let (x, y) = (range(&curves, |p| p.0), range(&curves, |p| p.1));
        assert!((x.0 - 0.01).abs() < 1e-15 && (x.1 - 1.0).abs() < 1e-15, "{x:?}");
        assert!((y.0 - 1.0).abs() < 1e-15 && (y.1 - 100.0).abs() < 1e-12, "{y:?}");
    }

    #[test]
    fn a_picture_names_schemes_and_axes() {
        let curves = [
            Curve { name: "lagged_euler".into(), points: vec![(0.02, 0.3), (0.7, 0.04)] },
            Curve { name: "bdf2".into(), points: vec![(0.03, 0.1)] },
        ];
        let text = draw("max ||v||_H", &curves, &curves).expect("picture");
        for words in
            ["<svg", "lagged_euler", "bdf2", "computing time in s", "unknowns x steps", "max ||v||_H"]
        {
            assert!(text.contains(words), "{words}");
        }
    }
}
