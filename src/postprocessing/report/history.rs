//! Pictures of quantities over time: probes, energies, steps.

use super::{
    boundary::capital,
    chart::{Axis, Chart, Look, Series},
    picture::Picture,
    scale::{extent, number, unit_by_name},
    table::Table,
};
use crate::{
    error::Result,
    fem::effect::{ENERGIES, Role},
};

const TIME: Axis = Axis { quantity: "t", unit: "s" };
/// Number of probes in one chart above which lines cannot be distinguished.
const MOST_PROBES: usize = 7;
/// A force below this share of the largest one of the run is a rounding error.
const ROUNDING: f64 = 1e-9;

/// Each quantity of the probes over time, with a line for each probe.
pub(super) fn probes(table: &Table) -> Result<Vec<Picture>> {
    let names = table.names();
    let tables: Vec<Table> = names.iter().take(MOST_PROBES).map(|name| table.of(name)).collect();
    let mut out = Vec::new();
    for column in table.header().iter().filter(|name| !["step", "time", "probe"].contains(&name.as_str())) {
        let series = names.iter().zip(&tables).enumerate().map(|(place, (name, table))| {
            Series::new(place, name.clone(), Look::Line, table.curve("time", column))
        });
        let (vector, axis) = column.rsplit_once('_').unwrap_or((column, ""));
        let quantity = format!("{} {axis}", vector.replace('_', " "));
        let unit = unit_by_name(column);
        let ends = names.iter().zip(&tables).map(|(name, table)| {
            let last = table.column(column).and_then(|values| values.last().copied()).unwrap_or(0.0);
            format!("{name} {} {unit}", number(last))
        });
        let ends = ends.collect::<Vec<_>>().join(", ");
        let left_out = if names.len() > MOST_PROBES {
            format!(" The first {MOST_PROBES} of {} probes.", names.len())
        } else {
            String::new()
        };
        let chart = Chart::new(TIME, Axis { quantity: quantity.trim_end(), unit }, series.collect());
        out.push(Picture::new(
            &format!("probes_{column}"),
            format!("Chart of {} of the probes over time; at the end {ends}", quantity.trim_end()),
            format!("{} of the probes. At the end: {ends}.{left_out}", capital(quantity.trim_end())),
            chart.svg()?,
        ));
    }
    Ok(out)
}

/// The components of the force of each source; of each contact the area by state, the pressure and the motion of its obstacle.
/// Forces that are zero but for rounding errors are named instead.
pub(super) fn resultants(table: &Table, dimension: usize) -> Result<(Vec<Picture>, Vec<String>)> {
    let of = |unit: [&'static str; 2]| unit[dimension - 2];
    let axes = ["x", "y", "z"];
    let forces: Vec<String> = axes[..dimension].iter().map(|axis| format!("force_{axis}")).collect();
    let forces: Vec<&str> = forces.iter().map(String::as_str).collect();
    let areas = ["touching_area", "open_area", "sticking_area", "slipping_area"];
    let columns = forces.iter().filter_map(|force| table.column(force));
    let largest = columns.flatten().fold(0.0, |most, force| f64::max(most, force.abs()));
    let (mut out, mut none) = (Vec::new(), Vec::new());
    for (number, source) in table.names().iter().enumerate() {
        let rows = table.of(source);
        let what = if source == "momentum" { "rate of momentum" } else { source };
        let quantity = if source == "momentum" { "rate of momentum" } else { "force" };
        let name = format!("force_{number}");
        let is_felt = |force: &&str| exceeds(&rows, force, ROUNDING * largest);
        let (felt, unfelt): (Vec<&str>, Vec<&str>) = forces.iter().copied().partition(is_felt);
        none.extend(unfelt.iter().map(|force| format!("{} of {what}", force.replace('_', " "))));
        out.extend(sums(&rows, &name, (what, quantity), of(["N/m", "N"]), &felt)?);
        if source.starts_with("contact") {
            let name = format!("area_{number}");
            out.extend(sums(&rows, &name, (source, "area"), of(["m", "m²"]), &areas)?);
            for (name, quantity, unit, columns) in [
                ("pressure", "contact pressure", "Pa", &["mean_pressure", "largest_pressure"][..]),
                (
                    "obstacle_displacement",
                    "displacement of the obstacle",
                    "m",
                    &["obstacle_displacement"][..],
                ),
                ("obstacle_rotation", "rotation of the obstacle", "rad", &["obstacle_rotation"][..]),
            ] {
                let words = format!("{source}, {quantity}");
                out.extend(sums(
                    &rows,
                    &format!("{name}_{number}"),
                    (words.as_str(), quantity),
                    unit,
                    columns,
                )?);
            }
        }
    }
    Ok((out, none))
}

/// Energies, dissipations with work, and the error of their balance. `unit` is the unit of energies.
pub(super) fn energies(table: &Table, unit: &str) -> Result<Vec<Picture>> {
    let columns = |roles: &[Role]| -> Vec<&str> {
        ENERGIES.iter().filter(|kind| roles.contains(&kind.role)).map(|kind| kind.column).collect()
    };
    let spent = [columns(&[Role::Work]), columns(&[Role::Dissipated, Role::Numerical])].concat();
    let mut out = Vec::new();
    for (name, quantity, columns) in [
        ("energies", "energy", columns(&[Role::Stored])),
        ("dissipation", "work and dissipation since t = 0", spent),
    ] {
        out.extend(sums(table, name, (quantity, quantity), unit, &columns)?);
    }
    out.extend(over_time(
        table,
        Curve {
            column: "energy_imbalance",
            quantity: "energy imbalance",
            unit: "",
            caption: "Energy imbalance of each step: error of its energy balance relative to the energy turned over",
            is_logarithmic: true,
            tolerance: None,
        },
    )?);
    Ok(out)
}

/// Whether a column has an entry whose size is larger than this.
fn exceeds(table: &Table, column: &str, size: f64) -> bool {
    table.column(column).is_some_and(|values| values.iter().any(|value| value.abs() > size))
}

/// A chart of several columns of one quantity over time; none if all of them are zero.
fn sums(
    table: &Table,
    name: &str,
    (what, quantity): (&str, &str),
    unit: &str,
    columns: &[&str],
) -> Result<Option<Picture>> {
    let mut series = Vec::new();
    let (mut ends, mut zero) = (Vec::new(), Vec::new());
    for column in columns {
        let Some(values) = table.column(column) else { continue };
        let words = column.replace('_', " ");
        if values.iter().all(|value| value.is_nan()) {
            continue;
        }
        if values.iter().all(|value| *value == 0.0 || value.is_nan()) {
            zero.push(words);
            continue;
        }
        ends.push(format!("{words} {} {unit}", number(values.last().copied().unwrap_or(0.0))));
        series.push(Series::new(series.len(), words, Look::Line, table.curve("time", column)));
    }
    if series.is_empty() {
        return Ok(None);
    }
    let ends = ends.join(", ");
    let zero =
        if zero.is_empty() { String::new() } else { format!(" Zero throughout: {}.", zero.join(", ")) };
    let svg = Chart::new(TIME, Axis { quantity, unit }, series).svg()?;
    let alt = format!("Chart of {what} over time; at the end {ends}");
    Ok(Some(Picture::new(name, alt, format!("{}. At the end: {ends}.{zero}", capital(what)), svg)))
}

/// Properties of the steps: Newton and linear iterations, length, changed branches, inclusion residual with its tolerance.
pub(super) fn steps(table: &Table, tolerance: Option<f64>) -> Result<Vec<Picture>> {
    let mut out = Vec::new();
    for (column, quantity, unit, caption) in [
        ("newton_iterations", "Newton iterations", "", "Newton iterations of each step"),
        ("linear_iterations", "linear iterations", "", "Iterations of the linear solver in each step"),
        ("dt", "step", "s", "Length of the steps"),
        ("active_changes", "nodes", "", "Contact points that changed their branch in each step"),
    ] {
        let curve = Curve { column, quantity, unit, caption, is_logarithmic: false, tolerance: None };
        out.extend(over_time(table, curve)?);
    }
    out.extend(over_time(
        table,
        Curve {
            column: "inclusion_residual",
            quantity: "inclusion residual",
            unit: "",
            caption: "Inclusion residual of each step: scaled distance of velocity and pressure to the contact law",
            is_logarithmic: true,
            tolerance,
        },
    )?);
    Ok(out)
}

/// A column of the history, and its style.
struct Curve<'a> {
    column: &'a str,
    quantity: &'a str,
    unit: &'a str,
    caption: &'a str,
    is_logarithmic: bool,
    /// A constant value that is drawn as a line.
    tolerance: Option<f64>,
}

/// A column over time; none if it is constant.
fn over_time(table: &Table, curve: Curve<'_>) -> Result<Option<Picture>> {
    let Curve { column, quantity, unit, caption, is_logarithmic, tolerance } = curve;
    let points = table.curve("time", column);
    let Some((low, high)) = extent(points.iter().map(|p| p[1])) else { return Ok(None) };
    // No picture of what is constant, such as the length of the steps of most runs.
    if low == high || (!is_logarithmic && number(low) == number(high)) {
        return Ok(None);
    }
    let unseen = points.iter().filter(|p| is_logarithmic && p[1] <= 0.0).count();
    let look = if points.len() <= 200 { Look::Dotted } else { Look::Line };
    let series = Series::new(0, "", look, points);
    let levels =
        tolerance.map(|level| vec![(level, format!("tolerance {}", number(level)))]).unwrap_or_default();
    let chart = Chart {
        logarithmic: is_logarithmic,
        from_zero: !is_logarithmic,
        levels,
        ..Chart::new(TIME, Axis { quantity, unit }, vec![series])
    };
    let space = if unit.is_empty() { "" } else { " " };
    let most = format!("at least {}, at most {}{space}{unit}", number(low), number(high));
    let unseen =
        if unseen > 0 { format!(" {unseen} steps with the value 0 are not shown.") } else { String::new() };
    let alt = format!("Chart over time. {caption}; {most}");
    Ok(Some(Picture::new(column, alt, format!("{caption}; {most}.{unseen}"), chart.svg()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forces_of_rounding_errors_are_named_and_the_motion_of_the_obstacle_is_drawn() {
        let text = "step,time,source,force_x,force_y,largest_pressure,obstacle_displacement\n1,0.1,contact top,1e-12,5,3,0.1\n\
                    2,0.2,contact top,2e-12,6,4,0.2\n1,0.1,support left,3e-13,0,,\n2,0.2,support left,0,0,,\n";
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("resultants.csv");
        std::fs::write(&path, text).expect("written");
        let table = Table::read(&path, "source").expect("table");
        let (pictures, none) = resultants(&table, 2).expect("drawn");
        let names: Vec<&str> = pictures.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["force_0", "pressure_0", "obstacle_displacement_0"]);
        assert_eq!(none, ["force x of contact top", "force x of support left", "force y of support left"]);
    }
}
