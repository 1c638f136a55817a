//! Charts: lines and points with axes, drawn by plotters. The SVG requires no font; legend and axis names are placed above the
//! axes, where they cover no data and remain legible on a small screen.

use super::{
    colour::{Colour, INK, LINES},
    scale::{Scale, extent},
    svg::{LETTERS, WIDTH, text_width},
};
use crate::error::{Error, Result};
use plotters::coord::{
    Shift,
    ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter},
};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const HEIGHT: f64 = 380.0;
/// Plotters rounds to whole pixels; this many pixels per unit of the drawing make the rounding invisible.
const FINE: i32 = 4;
/// Number of points above which a line is thinned; more than twice the pixels of any screen.
const ENOUGH: usize = 3000;
/// Values whose relative difference is below this share are constant.
const STEADY: f64 = 0.02;
/// Room between the values and the ends of an axis, as a share of their range: plotters cuts off what is beyond the axes, and so the
/// marker of a point at their ends would be.
const ROOM: f64 = 0.03;
/// Number of markers along a line that distinguish it from others without colour.
const MARKS: usize = 9;

/// Style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// A line with a few markers.
    Line,
    /// A line with a dot at each point.
    Dotted,
    /// Dots only.
    Dots,
}

/// Points with a name and a style.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend; not shown if it is empty.
    pub label: String,
    /// The points, unscaled.
    pub points: Vec<[f64; 2]>,
    /// Their style.
    pub look: Look,
    /// Their colour.
    pub colour: Colour,
    /// Index among similar series, which determines the shape of the markers.
    pub place: usize,
}

impl Series {
    /// A series in the colour of its index among similar series.
    pub fn new(place: usize, label: impl Into<String>, look: Look, points: Vec<[f64; 2]>) -> Self {
        Self { label: label.into(), points, look, colour: LINES[place % LINES.len()], place }
    }
}

/// A quantity along an axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    /// Description.
    pub quantity: String,
    /// Its unit, empty for dimensionless numbers.
    pub unit: String,
}

impl Axis {
    /// The axis of a quantity with its unit.
    pub fn new(quantity: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { quantity: quantity.into(), unit: unit.into() }
    }

    /// The axis of time.
    pub fn time() -> Self {
        Self::new("t", "s")
    }
}

/// A part of the horizontal axis with a background.
#[derive(Debug, Clone)]
pub struct Band {
    /// Start and end, unscaled.
    pub span: [f64; 2],
    /// Background colour.
    pub colour: Colour,
    /// Text at the top.
    pub label: String,
}

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Whether y is logarithmic.
    pub logarithmic: bool,
    /// Whether x is logarithmic.
    pub logarithmic_x: bool,
    /// Whether the vertical axis starts at zero.
    pub from_zero: bool,
    /// Points that the axes also reach, although they are not drawn: those of a chart beside this one.
    pub reach: Vec<[f64; 2]>,
    /// The series.
    pub series: Vec<Series>,
    /// Bands in the background.
    pub bands: Vec<Band>,
    /// Horizontal lines with their names.
    pub levels: Vec<(f64, String)>,
    /// Orders `p` whose decrease `y ~ x^-p` triangles in the lower left corner show; for logarithmic axes.
    pub orders: &'static [u8],
}

type Axes = Cartesian2d<Marked, Marked>;
type Area<'a, C> = DrawingArea<SVGBackend<'a>, C>;

/// An axis whose ticks are those of its scale.
#[derive(Clone)]
struct Marked {
    scale: Scale,
    room: f64,
}

impl Ranged for Marked {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let range = self.range();
        let share = (value - range.start) / (range.end - range.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.scale.ticks.iter().map(|tick| tick.0).collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.scale.low - self.room..self.scale.high + self.room
    }
}

impl ValueFormatter<f64> for Marked {
    fn format_ext(&self, value: &f64) -> String {
        let tick = self.scale.ticks.iter().find(|tick| tick.0 == *value);
        tick.map(|tick| tick.1.clone()).unwrap_or_default()
    }
}

impl Chart {
    /// A chart of these series with linear axes.
    pub fn new(x: Axis, y: Axis, series: Vec<Series>) -> Self {
        Self {
            x,
            y,
            logarithmic: false,
            logarithmic_x: false,
            from_zero: false,
            reach: vec![],
            series,
            bands: vec![],
            levels: vec![],
            orders: &[],
        }
    }

    /// With axes that also reach the series of another chart of the same quantities.
    pub fn beside(&self, other: &Self) -> Self {
        let mut chart = self.clone();
        let kind = |chart: &Self| (chart.logarithmic, chart.logarithmic_x);
        if (&self.x, &self.y, kind(self)) == (&other.x, &other.y, kind(other)) {
            chart.reach.extend(other.series.iter().flat_map(|series| &series.points));
        }
        chart
    }

    /// The drawing as an `svg` element.
    pub fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        let size = [WIDTH, HEIGHT].map(|size| (size * f64::from(FINE)) as u32);
        let area = SVGBackend::with_string(&mut svg, size.into()).into_drawing_area();
        let drawn = self.draw(&area);
        drop(area);
        drawn.map_err(|words| {
            Error::Internal(format!("a chart of {} cannot be drawn: {words}", self.y.quantity))
        })?;
        let fine = format!("<svg width=\"{}\" height=\"{}\"", size[0], size[1]);
        Ok(svg.replacen(&fine, &format!("<svg width=\"{WIDTH}\" height=\"{HEIGHT}\""), 1))
    }

    fn scales(&self) -> (Scale, Scale) {
        let points = || self.series.iter().flat_map(|series| &series.points).chain(&self.reach);
        let coordinate = |axis: usize| points().map(move |point| point[axis]);
        let levels = self.levels.iter().map(|level| level.0);
        let (low, high) = extent(coordinate(1)).unwrap_or((0.0, 0.0));
        // For almost constant values the axis includes zero, so that their variation is not magnified.
        let steady = high - low < STEADY * low.abs().max(high.abs());
        let y = coordinate(1).chain(levels).chain((self.from_zero || steady).then_some(0.0));
        let y = if self.logarithmic { Scale::logarithmic(y) } else { Scale::linear(y, true) };
        let x = coordinate(0);
        (if self.logarithmic_x { Scale::logarithmic(x) } else { Scale::linear(x, false) }, y)
    }

    fn draw(&self, area: &Area<Shift>) -> std::result::Result<(), String> {
        let (x, y) = self.scales();
        area.fill(&WHITE).map_err(words)?;
        let top = self.draw_legend(area, &y)?;
        let (_, below) = area.split_vertically(top);
        let room = |scale: &Scale| ROOM * (scale.high - scale.low);
        let [across, up] = [&x, &y].map(|scale| Marked { scale: scale.clone(), room: room(scale) });
        let mut chart = ChartBuilder::on(&below)
            .margin_right(18 * FINE)
            .margin_top(8 * FINE)
            .x_label_area_size(48 * FINE)
            .y_label_area_size(76 * FINE)
            .build_cartesian_2d(across, up)
            .map_err(words)?;
        let plane = chart.plotting_area().clone();
        self.draw_bands(&plane, &x, &y)?;
        let mut mesh = chart.configure_mesh();
        if !self.logarithmic_x {
            mesh.disable_x_mesh();
        }
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(rgb([0xd9; 3]).stroke_width(FINE as u32))
            .axis_style(rgb([0x55; 3]).stroke_width(FINE as u32))
            .label_style(letters())
            .x_desc(x.words(&self.x.quantity, &self.x.unit))
            .set_all_tick_mark_size(5 * FINE)
            .axis_desc_style(letters())
            .draw()
            .map_err(words)?;
        self.draw_levels(&plane, &x, &y)?;
        self.draw_orders(&plane, &x, &y)?;
        for series in &self.series {
            draw_series(&plane, series, &x, &y)?;
        }
        area.present().map_err(words)
    }

    /// The name of the vertical axis, and below it the names of the series; returns the height that they occupy.
    fn draw_legend(&self, area: &Area<Shift>, y: &Scale) -> std::result::Result<i32, String> {
        let row = 1.4 * LETTERS;
        let mut line = 4.0;
        area.draw_text(&y.words(&self.y.quantity, &self.y.unit), &letters(), fine(6.0, line))
            .map_err(words)?;
        line += row;
        let named: Vec<&Series> = self.series.iter().filter(|series| !series.label.is_empty()).collect();
        let mut across = 8.0;
        for series in &named {
            let width = 44.0 + text_width(&series.label);
            if across > 8.0 && across + width > WIDTH {
                (across, line) = (8.0, line + row);
            }
            let middle = line + 0.55 * LETTERS;
            if series.look != Look::Dots {
                let stroke = vec![fine(across, middle), fine(across + 28.0, middle)];
                area.draw(&PathElement::new(stroke, rgb(series.colour).stroke_width(2 * FINE as u32)))
                    .map_err(words)?;
            }
            mark(area, fine(across + 14.0, middle), series)?;
            area.draw_text(&series.label, &letters(), fine(across + 34.0, line)).map_err(words)?;
            across += width;
        }
        Ok(fine(0.0, line + if named.is_empty() { 0.0 } else { row }).1)
    }

    fn draw_bands(&self, plane: &Area<Axes>, x: &Scale, y: &Scale) -> std::result::Result<(), String> {
        for band in &self.bands {
            let (Some(from), Some(to)) = (x.place(band.span[0]), x.place(band.span[1])) else { continue };
            let room = ROOM * (y.high - y.low);
            let area = Rectangle::new([(from, y.low - room), (to, y.high + room)], rgb(band.colour).filled());
            plane.draw(&area).map_err(words)?;
            let width = plane.map_coordinate(&(to, y.high)).0 - plane.map_coordinate(&(from, y.high)).0;
            if f64::from(width) > f64::from(FINE) * text_width(&band.label) {
                let style = letters().pos(Pos::new(HPos::Center, VPos::Top));
                let place = (0.5 * (from + to), y.high);
                plane
                    .draw(&(EmptyElement::at(place) + Text::new(band.label.clone(), (0, 4 * FINE), style)))
                    .map_err(words)?;
            }
        }
        Ok(())
    }

    fn draw_levels(&self, plane: &Area<Axes>, x: &Scale, y: &Scale) -> std::result::Result<(), String> {
        for (level, name) in &self.levels {
            let Some(height) = y.place(*level) else { continue };
            let room = ROOM * (x.high - x.low);
            let stroke = vec![(x.low - room, height), (x.high + room, height)];
            plane.draw(&PathElement::new(stroke, rgb([0x55; 3]).stroke_width(FINE as u32))).map_err(words)?;
            let place = (x.low, height);
            plane
                .draw(&(EmptyElement::at(place) + Text::new(name.clone(), fine(4.0, 3.0), letters())))
                .map_err(words)?;
        }
        Ok(())
    }

    /// Triangles over the same horizontal leg, each with its order beside its upper end.
    fn draw_orders(&self, plane: &Area<Axes>, x: &Scale, y: &Scale) -> std::result::Result<(), String> {
        let Some(&steepest) = self.orders.iter().max() else { return Ok(()) };
        // As wide as a fifth of the chart, or as the steepest triangle fits into a third of its height.
        let width = (0.2 * (x.high - x.low)).min((y.high - y.low) / 3.0 / f64::from(steepest));
        let foot = (x.low + 0.05 * (x.high - x.low), y.low + 0.04 * (y.high - y.low));
        let grey = rgb([0x55; 3]).stroke_width(FINE as u32);
        for order in self.orders {
            let top = (foot.0, foot.1 + f64::from(*order) * width);
            let corners = vec![foot, (foot.0 + width, foot.1), top, foot];
            plane.draw(&PathElement::new(corners, grey)).map_err(words)?;
            let style = letters().pos(Pos::new(HPos::Right, VPos::Center));
            let name = Text::new(order.to_string(), fine(-4.0, 0.0), style);
            plane.draw(&(EmptyElement::at(top) + name)).map_err(words)?;
        }
        Ok(())
    }
}

fn draw_series(plane: &Area<Axes>, series: &Series, x: &Scale, y: &Scale) -> std::result::Result<(), String> {
    let shown = series.points.iter().filter_map(|p| Some((x.place(p[0])?, y.place(p[1])?)));
    let shown = thinned(shown.collect());
    if series.look != Look::Dots && shown.len() > 1 {
        plane
            .draw(&PathElement::new(shown.clone(), rgb(series.colour).stroke_width(2 * FINE as u32)))
            .map_err(words)?;
    }
    let every = match series.look {
        Look::Line if series.label.is_empty() && shown.len() > 1 => usize::MAX,
        Look::Line => shown.len().div_ceil(MARKS).max(1),
        Look::Dotted | Look::Dots => 1,
    };
    let first = if every == usize::MAX {
        usize::MAX
    } else {
        (series.place * every / LINES.len()).min(shown.len() / 2)
    };
    let (across, down) = plane.get_pixel_range();
    let (pixels, corner) = (plane.strip_coord_spec(), (across.start, down.start));
    for at in (first..shown.len()).step_by(every) {
        let pixel = plane.map_coordinate(&shown[at]);
        mark(&pixels, (pixel.0 - corner.0, pixel.1 - corner.1), series)?;
    }
    Ok(())
}

/// A marker whose shape distinguishes series without colour.
fn mark(area: &Area<Shift>, at: (i32, i32), series: &Series) -> std::result::Result<(), String> {
    let style = rgb(series.colour).filled();
    let corners = |around: &[(i32, i32)]| {
        around.iter().map(|c| (at.0 + FINE * c.0, at.1 + FINE * c.1)).collect::<Vec<_>>()
    };
    let drawn = match series.place % 4 {
        0 => area.draw(&Circle::new(at, 4 * FINE, style)),
        1 => area.draw(&Polygon::new(corners(&[(-4, -4), (4, -4), (4, 4), (-4, 4)]), style)),
        2 => area.draw(&TriangleMarker::new(at, 6 * FINE, style)),
        _ => area.draw(&Polygon::new(corners(&[(-6, 0), (0, -6), (6, 0), (0, 6)]), style)),
    };
    drawn.map_err(words)
}

/// Thins a line without a visible difference: of each group the first, the lowest, the highest and the last point remain.
fn thinned(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= ENOUGH {
        return points;
    }
    let group = (4 * points.len()).div_ceil(ENOUGH);
    let mut kept = Vec::with_capacity(ENOUGH + 4);
    for group in points.chunks(group) {
        let by = |sign: f64| {
            let ranked = group.iter().enumerate().map(|(at, p)| (at, sign * p.1));
            ranked.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |found| found.0)
        };
        let mut places = [0, by(-1.0), by(1.0), group.len() - 1];
        places.sort_unstable();
        kept.extend(
            places
                .iter()
                .enumerate()
                .filter(|(n, at)| *n == 0 || places[n - 1] != **at)
                .map(|(_, at)| group[*at]),
        );
    }
    kept
}

/// A point of the drawing in plotters' pixels.
fn fine(x: f64, y: f64) -> (i32, i32) {
    let pixel = |along: f64| (along * f64::from(FINE)).round() as i32;
    (pixel(x), pixel(y))
}

fn rgb(colour: Colour) -> RGBColor {
    RGBColor(colour[0], colour[1], colour[2])
}

/// Plotters draws a text of size s with letters of size s / 1.24.
fn letters() -> TextStyle<'static> {
    ("sans-serif", 1.24 * LETTERS * f64::from(FINE)).into_font().color(&rgb(INK))
}

fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_of_points_at_the_ends_of_the_axes_are_whole() {
        for (place, [width, height]) in [(1, [8, 8]), (3, [12, 12])] {
            for logarithmic in [false, true] {
                let points = vec![[0.0, 1.0], [0.0, 10.0], [1.0, 1.0], [1.0, 10.0]];
                let series = Series::new(place, "", Look::Dots, points);
                let chart = Chart::new(Axis::time(), Axis::new("size", ""), vec![series]);
                let svg = Chart { logarithmic, ..chart }.svg().expect("drawn");
                let markers: Vec<&str> =
                    svg.split("<polygon").skip(1).filter_map(|tag| tag.split("points=\"").nth(1)).collect();
                assert_eq!(markers.len(), 4, "{svg}");
                for marker in markers {
                    let numbers = marker.split('"').next().unwrap_or_default().split([' ', ',']);
                    let numbers: Vec<i32> = numbers.filter_map(|word| word.parse().ok()).collect();
                    let size = |axis: usize| {
                        let along = || numbers.iter().skip(axis).step_by(2);
                        along().max().zip(along().min()).map(|(most, least)| most - least)
                    };
                    let expected = [width, height].map(|size| Some(FINE * size));
                    assert_eq!([size(0), size(1)], expected, "{place} {logarithmic}: {marker}");
                }
            }
        }
    }
}
