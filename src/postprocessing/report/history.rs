//! Pictures of quantities over time: probes, energies, steps.

use super::{
    chart::{Axis, Chart, Look, Series},
    markup::capital,
    page::Pictures,
    picture::Picture,
    scale::{extent, number},
    support_motion::SupportMotion,
    table::Table,
};
use crate::{
    error::Result,
    fem::effect::{ENERGIES, Role},
    io::output::columns::{HISTORY, PROBES, RESULTANTS},
};

/// Number of probes in one chart above which lines cannot be distinguished.
const MOST_PROBES: usize = 7;

/// Each quantity of the probes over time, with a line for each probe.
pub(super) fn probes(table: &Table) -> Result<Pictures> {
    let names = table.names();
    let tables: Vec<Table> = names.iter().take(MOST_PROBES).map(|name| table.of(name)).collect();
    let mut out = Pictures::default();
    for column in table.header().iter().filter(|name| !PROBES.is_key(name)) {
        let curves: Vec<Vec<[f64; 2]>> = tables.iter().map(|table| table.curve("time", column)).collect();
        let quantity = column.replace('_', " ");
        let unit = PROBES.unit(column, 3);
        let last = |curve: &[[f64; 2]]| curve.last().map_or(0.0, |point| point[1]);
        let range = |curve: &Vec<[f64; 2]>| extent(curve.iter().map(|point| point[1]));
        if curves.iter().filter_map(range).all(is_constant) {
            let pairs = names.iter().zip(&curves);
            let named =
                pairs.map(|(name, curve)| format!("{quantity} of {name}: {} {unit}", number(last(curve))));
            out.constant.extend(named);
            continue;
        }
        let ends =
            names.iter().zip(&curves).map(|(name, curve)| format!("{name} {} {unit}", number(last(curve))));
        let ends = ends.collect::<Vec<_>>().join(", ");
        let left_out = if names.len() > MOST_PROBES {
            format!(" The first {MOST_PROBES} of {} probes.", names.len())
        } else {
            String::new()
        };
        let series = names.iter().zip(curves).enumerate();
        let series = series.map(|(place, (name, curve))| Series::new(place, name.clone(), Look::Line, curve));
        let chart = Chart::new(Axis::time(), Axis::new(quantity.clone(), unit), series.collect());
        out.pictures.push(Picture::of_chart(
            chart,
            &format!("probes_{column}"),
            format!("Chart of {quantity} of the probes over time; at the end {ends}"),
            format!("{} of the probes. At the end: {ends}.{left_out}", capital(&quantity)),
        )?);
    }
    Ok(out)
}

/// Columns of a table that share a chart.
struct ChartColumns<'a> {
    /// Name of the picture.
    name: &'a str,
    /// Its subject in the caption.
    what: &'a str,
    /// The source of the rows; empty if there is only one.
    source: &'a str,
    quantity: &'a str,
    unit: &'a str,
    columns: &'a [&'a str],
    /// The column along the other axis.
    over: &'a str,
}

/// The components of the force of each source, over the displacement of those of the supports that move as a whole; of each contact the moment,
/// the area by state, the pressure, and the motion of its obstacle with the force and the moment over it.
/// Components are those of the first of these dimensions, units those of the second.
pub(super) fn resultants(
    table: &Table,
    supports: &[SupportMotion<'_>],
    [dimension, of_units]: [usize; 2],
) -> Result<Pictures> {
    let axes = ["x", "y", "z"];
    let forces: Vec<String> = axes[..dimension].iter().map(|axis| format!("force_{axis}")).collect();
    let forces: Vec<&str> = forces.iter().map(String::as_str).collect();
    let areas = ["touching_area", "open_area", "sticking_area", "slipping_area"];
    let moments = ["moment_x", "moment_y", "moment_z"];
    let mut out = Pictures::default();
    for (number, source) in table.names().iter().enumerate() {
        let rows = table.of(source);
        let (what, quantity) = match source.as_str() {
            "momentum" => ("rate of change of momentum", "rate of change of momentum"),
            source => (source, "force"),
        };
        let is_felt =
            |force: &&str| rows.column(force).is_some_and(|values| values.iter().any(|value| *value != 0.0));
        let (felt, unfelt): (Vec<&str>, Vec<&str>) = forces.iter().copied().partition(is_felt);
        let unit = RESULTANTS.unit("force_x", of_units);
        let none = unfelt.iter().map(|force| format!("{} of {what}: 0 {unit}", force.replace('_', " ")));
        out.constant.extend(none);
        let name = format!("force_{number}");
        let drawn =
            ChartColumns { name: &name, what, source: what, quantity, unit, columns: &felt, over: "time" };
        draw(&rows, &drawn, &mut out)?;
        for motion in supports.iter().filter(|motion| motion.source == *source) {
            let moved = rows.with_column(motion.column, motion.at(&rows.column("time").unwrap_or_default()));
            let name = format!("force_over_{}_{number}", motion.column);
            let what = format!("{source}, force");
            let drawn = ChartColumns {
                name: &name,
                what: &what,
                source,
                quantity,
                unit,
                columns: &felt,
                over: motion.column,
            };
            draw(&moved, &drawn, &mut out)?;
        }
        if source.starts_with("contact") {
            let [displacement, rotation] = ["obstacle_displacement", "obstacle_rotation"];
            for (name, quantity, columns, over) in [
                ("moment", "moment about the origin", &moments[..], "time"),
                ("area", "area", &areas[..], "time"),
                ("pressure", "contact pressure", &["mean_pressure", "largest_pressure"], "time"),
                (displacement, "displacement of the obstacle", &[displacement], "time"),
                ("force_over_displacement", "force", &felt, displacement),
                (rotation, "rotation of the obstacle", &[rotation], "time"),
                ("moment_over_rotation", "moment about the origin", &moments, rotation),
            ] {
                // In two dimensions there is a moment about z only.
                let Some(last) = columns.last() else { continue };
                let unit = RESULTANTS.unit(last, of_units);
                let name = format!("{name}_{number}");
                let what = format!("{source}, {quantity}");
                let drawn = ChartColumns { name: &name, what: &what, source, quantity, unit, columns, over };
                draw(&rows, &drawn, &mut out)?;
            }
        }
    }
    Ok(out)
}

/// Energies, dissipations with work, heat, and the error of their balance. `unit` is the unit of energies.
pub(super) fn energies(table: &Table, unit: &str) -> Result<Pictures> {
    let columns = |roles: &[Role]| -> Vec<&str> {
        ENERGIES.iter().filter(|kind| roles.contains(&kind.role)).map(|kind| kind.column).collect()
    };
    let spent = [columns(&[Role::Work]), columns(&[Role::Dissipated, Role::Numerical])].concat();
    let mut out = Pictures::default();
    for (name, what, columns) in [
        ("energies", "energy", columns(&[Role::Stored])),
        ("dissipation", "work and dissipation since t = 0", spent),
        ("heat", "heat since t = 0", columns(&[Role::HeatSpent, Role::Heat])),
    ] {
        draw(
            table,
            &ChartColumns { name, what, source: "", quantity: what, unit, columns: &columns, over: "time" },
            &mut out,
        )?;
    }
    out.pictures.extend(over_time(
        table,
        Curve {
            column: "energy_imbalance",
            quantity: "energy imbalance",
            caption: "Energy imbalance of each step: error of its energy balance relative to the largest energy exchanged so far",
            is_logarithmic: true,
            tolerance: None,
        },
    )?);
    Ok(out)
}

/// Whether values from `low` to `high` are the same in the digits that are shown.
fn is_constant((low, high): (f64, f64)) -> bool {
    number(low) == number(high)
}

/// Adds a chart of several columns over time, and names the columns that are constant: in the caption of the chart, or in the list if
/// all of them are. Over another column only if that changes, and without naming again what is constant.
fn draw(table: &Table, columns: &ChartColumns<'_>, out: &mut Pictures) -> Result<()> {
    let ChartColumns { name, what, source, quantity, unit, columns, over } = *columns;
    let is_over_time = over == "time";
    let passed = extent(table.curve("time", over).iter().map(|point| point[1]));
    if !is_over_time && passed.is_none_or(is_constant) {
        return Ok(());
    }
    let mut series = Vec::new();
    let (mut ends, mut constant) = (Vec::new(), Vec::new());
    for column in columns {
        let points = table.curve(over, column);
        let Some(range) = extent(points.iter().map(|point| point[1])) else { continue };
        let words = column.replace('_', " ");
        let last = points.last().map_or(0.0, |point| point[1]);
        if is_constant(range) {
            constant.push((words, last));
        } else {
            ends.push(format!("{words} {} {unit}", number(last)));
            series.push(Series::new(series.len(), words, Look::Line, points));
        }
    }
    if series.is_empty() {
        let of = if source.is_empty() { String::new() } else { format!(" of {source}") };
        let named = constant.iter().map(|(words, value)| format!("{words}{of}: {} {unit}", number(*value)));
        out.constant.extend(named.filter(|_| is_over_time));
        return Ok(());
    }
    let ends = ends.join(", ");
    let constant: Vec<String> =
        constant.iter().map(|(words, value)| format!("{words} {} {unit}", number(*value))).collect();
    let constant = match &constant[..] {
        [] => String::new(),
        all => format!(" Constant: {}.", all.join(", ")),
    };
    let (x, over) = if is_over_time {
        (Axis::time(), "time".into())
    } else {
        let words = over.replace('_', " ");
        let unit = if over.starts_with("support") { "m" } else { RESULTANTS.unit(over, 3) };
        (Axis::new(words.clone(), unit), words)
    };
    let chart = Chart::new(x, Axis::new(quantity, unit), series);
    let alt = format!("Chart of {what} over {over}; at the end {ends}");
    let subject = if is_over_time { capital(what) } else { format!("{} over {over}", capital(what)) };
    let caption = format!("{subject}. At the end: {ends}.{constant}");
    out.pictures.push(Picture::of_chart(chart, name, alt, caption)?);
    Ok(())
}

/// Properties of the steps: Newton and linear iterations, length, changed branches, inclusion residual with its tolerance.
pub(super) fn steps(table: &Table, tolerance: Option<f64>) -> Result<Vec<Picture>> {
    let mut out = Vec::new();
    for (column, quantity, caption) in [
        ("newton_iterations", "Newton iterations", "Newton iterations of each step"),
        ("linear_iterations", "linear iterations", "Iterations of the linear solver in each step"),
        ("dt", "step", "Length of the steps"),
        ("active_changes", "nodes", "Contact points that changed their branch in each step"),
    ] {
        let curve = Curve { column, quantity, caption, is_logarithmic: false, tolerance: None };
        out.extend(over_time(table, curve)?);
    }
    out.extend(over_time(
        table,
        Curve {
            column: "inclusion_residual",
            quantity: "inclusion residual",
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
    caption: &'a str,
    is_logarithmic: bool,
    /// A constant value that is drawn as a line.
    tolerance: Option<f64>,
}

/// A column over time; none if it is constant.
fn over_time(table: &Table, curve: Curve<'_>) -> Result<Option<Picture>> {
    let Curve { column, quantity, caption, is_logarithmic, tolerance } = curve;
    let unit = HISTORY.unit(column, 3);
    let points = table.curve("time", column);
    let Some((low, high)) = extent(points.iter().map(|p| p[1])) else { return Ok(None) };
    // No picture of what is constant, such as the length of the steps of most runs.
    if low == high || (!is_logarithmic && is_constant((low, high))) {
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
        ..Chart::new(Axis::time(), Axis::new(quantity, unit), vec![series])
    };
    let space = if unit.is_empty() { "" } else { " " };
    let most = format!("at least {}, at most {}{space}{unit}", number(low), number(high));
    let unseen =
        if unseen > 0 { format!(" {unseen} steps with the value 0 are not shown.") } else { String::new() };
    let alt = format!("Chart over time. {caption}; {most}");
    Picture::of_chart(chart, column, alt, format!("{caption}; {most}.{unseen}")).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_probes_that_are_rounding_errors_are_not_drawn() {
        let text = "step,time,probe,velocity_x,velocity_y\n1,0.1,tip,0.5,1e-12\n2,0.2,tip,1,-2e-12\n";
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("probes.csv");
        std::fs::write(&path, text).expect("written");
        let Pictures { pictures, constant } =
            probes(&Table::read(&path, "probe").expect("table").without_rounding()).expect("drawn");
        assert_eq!(
            pictures.iter().map(|picture| picture.name.as_str()).collect::<Vec<_>>(),
            ["probes_velocity_x"]
        );
        assert_eq!(constant, ["velocity y of tip: 0 m/s"]);
    }

    #[test]
    fn constant_quantities_and_rounding_errors_are_named_and_the_motion_of_the_obstacle_is_drawn() {
        let text = "step,time,source,force_x,force_y,largest_pressure,obstacle_displacement,touching_area\n1,0.1,contact top,1e-12,5,3,0.1,0.5\n\
                    2,0.2,contact top,2e-12,6,4,0.2,0.5000000001\n1,0.1,support left,3e-13,0,,,\n2,0.2,support left,0,0,,,\n";
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("resultants.csv");
        std::fs::write(&path, text).expect("written");
        let table = Table::read(&path, "source").expect("table").without_rounding();
        let Pictures { pictures, constant } = resultants(&table, &[], [2, 2]).expect("drawn");
        let names: Vec<&str> = pictures.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["force_0", "pressure_0", "obstacle_displacement_0", "force_over_displacement_0"]);
        assert!(pictures[3].caption.contains("force over obstacle displacement"), "{}", pictures[3].caption);
        assert_eq!(
            constant,
            [
                "force x of contact top: 0 N/m",
                "touching area of contact top: 0.5 m",
                "force x of support left: 0 N/m",
                "force y of support left: 0 N/m"
            ]
        );
    }
}
