//! The nodes of a boundary on the graph of its friction law.

use super::{
    chart::{Axis, Chart, Look, Series},
    colour::{Colour, LINES},
    picture::Picture,
    scale::{extent, number},
};
use crate::{
    error::Result,
    laws::contact::{FrictionLaw, SlidingContext},
};

/// Number of points on a curved law that are joined by straight lines.
const SAMPLES: usize = 120;
/// A node that slides more slowly than this share of the fastest one sticks.
const STICKING: f64 = 1e-6;
const GREY: Colour = [0x55; 3];

/// Friction at a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SlidingNode {
    /// Sliding velocity in m/s, not negative.
    pub speed: f64,
    /// Friction traction in Pa, not negative.
    pub traction: f64,
    /// Contact pressure in Pa.
    pub pressure: f64,
}

/// The law as a function of the sliding velocity, and the nodes: their traction, or traction over pressure if the law depends on
/// pressure.
pub(super) fn picture(
    (name, place): (&str, &str),
    time: f64,
    law: &FrictionLaw,
    nodes: &[SlidingNode],
) -> Result<Option<Picture>> {
    let touching: Vec<&SlidingNode> =
        nodes.iter().filter(|node| !law.follows_pressure() || node.pressure > 0.0).collect();
    if touching.is_empty() || !law.is_same_everywhere() {
        return Ok(None);
    }
    let ordinate =
        |node: &SlidingNode| node.traction / if law.follows_pressure() { node.pressure } else { 1.0 };
    let fastest = extent(touching.iter().map(|node| node.speed)).map_or(0.0, |range| range.1);
    let (sticking, slipping): (Vec<&SlidingNode>, Vec<&SlidingNode>) =
        touching.iter().partition(|node| node.speed <= STICKING * fastest);
    let along = if fastest > 0.0 { 1.1 * fastest } else { 1.0 };
    let graph = (0..=SAMPLES).map(|n| along * n as f64 / SAMPLES as f64);
    let line = std::iter::once([0.0, 0.0])
        .chain(graph.map(|v| [v, law.bound(v, 1.0, SlidingContext::default())]))
        .collect();
    let mut series = vec![Series { colour: GREY, ..Series::new(0, "", Look::Line, line) }];
    let mut counts = Vec::new();
    for (at, words, group) in [(1, "stick", &sticking), (2, "slip", &slipping)] {
        if group.is_empty() {
            continue;
        }
        let count = if group.len() == 1 { "1 node".into() } else { format!("{} nodes", group.len()) };
        let label = format!("{words}: {count}");
        counts.push(label.clone());
        let points = group.iter().map(|node| [node.speed, ordinate(node)]).collect();
        series.push(Series { colour: LINES[at - 1], ..Series::new(at, label, Look::Dots, points) });
    }
    let apart = nodes.len() - touching.len();
    if apart > 0 {
        counts.push(format!("without pressure: {apart}"));
    }
    let (quantity, unit) =
        if law.follows_pressure() { ("friction over pressure", "") } else { ("friction traction", "Pa") };
    let chart = Chart {
        from_zero: true,
        ..Chart::new(Axis::new("sliding velocity", "m/s"), Axis::new(quantity, unit), series)
    };
    let counted = counts.join(", ");
    let when = number(time);
    let picture = Picture::of_chart(
        chart,
        &format!("{name}_on_friction"),
        format!("Nodes of {place} on the graph of the friction law at {when} s: {counted}"),
        format!("The friction law (grey) and the nodes of {place} at t = {when} s: {counted}."),
    )?;
    Ok(Some(picture))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{Coulomb, Tresca};

    fn node(speed: f64, traction: f64, pressure: f64) -> SlidingNode {
        SlidingNode { speed, traction, pressure }
    }

    #[test]
    fn nodes_stick_slip_or_bear_no_pressure() {
        let law = FrictionLaw::Coulomb(Coulomb { coefficient: 0.3 });
        let nodes = [node(0.0, 1.0, 10.0), node(0.1, 3.0, 10.0), node(0.2, 6.0, 20.0), node(0.5, 0.0, 0.0)];
        let drawn = picture(("bottom", "bottom"), 0.5, &law, &nodes).expect("drawn").expect("a picture");
        assert!(
            drawn.caption.contains("stick: 1 node, slip: 2 nodes, without pressure: 1"),
            "{}",
            drawn.caption
        );
        assert!(drawn.svg.contains("friction over pressure") && drawn.name == "bottom_on_friction");
    }

    #[test]
    fn nodes_that_all_rest_stick() {
        let law = FrictionLaw::Coulomb(Coulomb { coefficient: 0.3 });
        let drawn = picture(("bottom", "bottom"), 0.5, &law, &[node(0.0, 1.0, 10.0), node(0.0, 0.0, 3.0)]);
        let caption = drawn.expect("drawn").expect("a picture").caption;
        assert!(caption.contains("stick: 2 nodes") && !caption.contains("slip:"), "{caption}");
    }

    #[test]
    fn given_bounds_are_drawn_in_their_own_unit_and_a_boundary_in_the_air_not_at_all() {
        let given = FrictionLaw::Tresca(Tresca { bound: 2.0 });
        let drawn = picture(("left", "left"), 0.0, &given, &[node(0.1, 2.0, 0.0)])
            .expect("drawn")
            .expect("a picture");
        assert!(drawn.svg.contains("friction traction / Pa"));
        let law = FrictionLaw::Coulomb(Coulomb { coefficient: 0.3 });
        assert!(picture(("left", "left"), 0.0, &law, &[node(0.1, 0.0, 0.0)]).expect("drawn").is_none());
    }
}
