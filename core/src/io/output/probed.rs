//! Further quantities of probes: fields and histories at their points.

use super::{
    columns::PROBES,
    contact_points::{fill_corners, fill_faced},
    field::{Place, Shape, plain_components},
    field_list::{FIELDS, Position, computations},
    output_field::Converged,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Friction, History},
        resultants::BalancedMotion,
        space::omits_corners,
    },
    job::{FurtherField, Output, ProbedQuantity},
    mesh::Mesh,
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};

/// Number of the quantities.
const COUNT: usize = 15;

/// The equivalent viscoplastic strain, and what a body needs to have it.
const FLOWED: &str = "equivalent_viscoplastic_strain";
const FLOW: &str = "[material.viscoplasticity]";

/// What a body needs to have a slip distance.
const FRICTION: &str = "a contact with friction, whose coefficient may be 0";

/// The quantities, in the order of their columns in `probes.csv`, each with what it is made of.
const QUANTITIES: [(ProbedQuantity, &[Source]); COUNT] = [
    (ProbedQuantity::Stress, &[Source::Field(Position::STRESS)]),
    (ProbedQuantity::VonMises, &[Source::Field(Position::VON_MISES)]),
    (
        ProbedQuantity::PrincipalStress,
        &[
            Source::Field(Position::PRINCIPAL_STRESS_1),
            Source::Field(Position::PRINCIPAL_STRESS_2),
            Source::Field(Position::PRINCIPAL_STRESS_3),
        ],
    ),
    (ProbedQuantity::Pressure, &[Source::Field(Position::PRESSURE)]),
    (ProbedQuantity::Strain, &[Source::Field(Position::STRAIN)]),
    (ProbedQuantity::Acceleration, &[Source::Acceleration]),
    (ProbedQuantity::EquivalentViscoplasticStrain, &[Source::OfCells(FLOWED, FLOW)]),
    (ProbedQuantity::Damage, &[Source::OfCells("damage", "[material.damage]")]),
    (ProbedQuantity::ContactPressure, &[Source::Field(Position::CONTACT_PRESSURE)]),
    (ProbedQuantity::ContactTraction, &[Source::Field(Position::CONTACT_TRACTION)]),
    (ProbedQuantity::Gap, &[Source::Field(Position::GAP)]),
    (ProbedQuantity::SlidingVelocity, &[Source::Field(Position::SLIDING_VELOCITY)]),
    (ProbedQuantity::Slip, &[Source::OfNodes("slip", FRICTION)]),
    (ProbedQuantity::Wear, &[Source::OfNodes("wear", "[contact.wear]")]),
    (ProbedQuantity::Temperature, &[Source::Field(Position::TEMPERATURE)]),
];

/// What a quantity is made of.
#[derive(Debug, Clone, Copy)]
enum Source {
    /// An output field.
    Field(Position),
    /// A scalar history of nodes of this name, and what a job needs to have it.
    OfNodes(&'static str, &'static str),
    /// A scalar history of cells, likewise.
    OfCells(&'static str, &'static str),
    /// The change of the velocity in the equations of the step.
    Acceleration,
}

/// The groups of columns of `probes.csv` that a job with these quantities has.
pub(super) fn groups(wanted: &[ProbedQuantity]) -> Vec<bool> {
    let of_quantities = QUANTITIES.iter().map(|(quantity, _)| wanted.contains(quantity));
    std::iter::once(true).chain(of_quantities).collect()
}

/// The quantity that has this column of `probes.csv`, as a job names it.
pub(super) fn quantity_of(column: &str, dimension: usize) -> Option<String> {
    let has_column = |quantity: ProbedQuantity| {
        let with = groups(&[quantity]).into_iter().skip(1);
        let with: Vec<bool> = std::iter::once(false).chain(with).collect();
        PROBES.columns_of_groups(dimension, &with).iter().any(|name| name == column)
    };
    let quantity = QUANTITIES.iter().map(|(quantity, _)| *quantity).find(|quantity| has_column(*quantity))?;
    serde_json::to_string(&quantity).ok()
}

/// What these quantities are made of.
fn sources(wanted: &[ProbedQuantity]) -> impl Iterator<Item = Source> {
    QUANTITIES
        .iter()
        .filter(|(quantity, _)| wanted.contains(quantity))
        .flat_map(|(_, sources)| *sources)
        .copied()
}

/// What is wrong with quantities of probes and further fields that the body does not have: key, message and advice.
pub(crate) fn fault<const D: usize, const S: usize>(
    output: &Output,
    body: &Body<D, S>,
) -> Option<(&'static str, [String; 2])> {
    let of_probes = fault_of_probes(&output.probe_also, body).map(|fault| ("output.probe_also", fault));
    let is_kept = body.contacts.iter().flat_map(|contact| &contact.friction).any(Friction::keeps_slip);
    let of_fields = (output.also.contains(&FurtherField::Slip) && !is_kept)
        .then(|| ("output.also", words_of_missing(["slip", FRICTION])));
    let flows = || body.cell_histories().any(|history| history.name() == FLOWED);
    let of_flow = (output.also.contains(&FurtherField::EquivalentViscoplasticStrain) && !flows())
        .then(|| ("output.also", words_of_missing([FLOWED, FLOW])));
    of_probes.or(of_fields).or(of_flow)
}

fn words_of_missing([name, needed]: [&str; 2]) -> [String; 2] {
    [format!("the body has no {name}"), format!("it needs {needed}; or delete \"{name}\" from the list")]
}

fn fault_of_probes<const D: usize, const S: usize>(
    wanted: &[ProbedQuantity],
    body: &Body<D, S>,
) -> Option<[String; 2]> {
    for source in sources(wanted) {
        let (name, needed, is_there) = match source {
            Source::OfNodes(name, needed) => {
                (name, needed, body.node_histories().any(|history| history.name() == name))
            }
            Source::OfCells(name, needed) => {
                (name, needed, body.cell_histories().any(|history| history.name() == name))
            }
            Source::Field(Position::CONTACT_TRACTION) => {
                let is_there = body.contacts.iter().any(|contact| !contact.normal.needs_ghosts);
                ("contact_traction", "a contact", is_there)
            }
            Source::Field(Position::TEMPERATURE) => ("temperature", "[material.heat]", body.heat.is_some()),
            Source::Field(_) | Source::Acceleration => continue,
        };
        if !is_there {
            return Some(words_of_missing([name, needed]));
        }
    }
    None
}

/// The point of a probe, as far as this rank knows it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ProbePlace {
    /// The cell around it, on the rank that evaluates.
    pub cell: Option<usize>,
    /// The nodes owned here of this cell, with the values of their shape functions.
    pub owned: Vec<(u32, f64)>,
}

/// A cell of this rank around a point, and its local nodes with the values of their shape functions there.
pub(super) type ProbedCell = (usize, Vec<(u32, f64)>);

/// The places of probes, given the cell and its local nodes with their shares on the ranks that evaluate. Collective.
pub(super) fn places<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    found: &[Option<ProbedCell>],
) -> Result<Vec<ProbePlace>, Agreed> {
    let mut records = Vec::new();
    for (number, place) in found.iter().enumerate() {
        for (node, share) in place.iter().flat_map(|(_, shares)| shares) {
            records.extend([number as f64, f64::from(mesh.global_node(*node)), *share]);
        }
    }
    let cell = |place: &Option<ProbedCell>| place.as_ref().map(|(cell, _)| *cell);
    let mut places: Vec<ProbePlace> =
        found.iter().map(|place| ProbePlace { cell: cell(place), owned: Vec::new() }).collect();
    for record in gather(session.world(), &records)?.chunks_exact(3) {
        let node = record[1] as u32;
        if mesh.owner(node) == session.rank() {
            places[record[0] as usize].owned.push((mesh.owned_node(node) as u32, record[2]));
        }
    }
    Ok(places)
}

/// Further quantities of the probes of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Probed {
    sources: Vec<Source>,
}

impl Probed {
    /// These quantities.
    pub(super) fn new(wanted: &[ProbedQuantity]) -> Self {
        Self { sources: sources(wanted).collect() }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Numbers of a probe.
    pub(super) fn width(&self, dimension: usize) -> usize {
        self.sources.iter().map(|source| source.width(dimension)).sum()
    }

    /// Adds the part of this rank to the values of the probes, after displacement and velocity. Collective.
    pub(super) fn add<const D: usize, const S: usize>(
        &self,
        (at, motion): (Converged<D, S>, BalancedMotion<'_>),
        places: &[ProbePlace],
        values: &mut [f64],
    ) -> Result<(), Agreed> {
        let (mut column, stride) = (2 * D, 2 * D + self.width(D));
        for source in &self.sources {
            let width = source.width(D);
            let mut visit = |place: Place, shape: Shape, field: &[f64]| {
                for (probe, values) in places.iter().zip(values.chunks_exact_mut(stride)) {
                    add_value::<D, S>(probe, (place, shape), field, &mut values[column..][..width]);
                }
            };
            match *source {
                Source::Field(field) => {
                    let computed = at.session.agree(computations::<D, S>()[field as usize](at))?;
                    if let Some(computed) = computed {
                        let field = &FIELDS[field as usize];
                        visit(field.place, field.shape, &computed.values);
                    }
                }
                Source::OfNodes(name, _) => {
                    let found = at.body.node_histories().find(|history| history.name() == name);
                    if let Some(History { quantity, mut values, .. }) = found {
                        if !at.body.pairs.is_empty() {
                            at.session.agree(fill_faced(at, values.to_mut()))?;
                        }
                        if omits_corners(&at.body.mesh) {
                            at.session.agree(fill_corners(at, quantity, values.to_mut()))?;
                        }
                        visit(Place::Node, Shape::Scalar, &values);
                    }
                }
                Source::OfCells(name, _) => {
                    if let Some(history) = at.body.cell_histories().find(|history| history.name() == name) {
                        visit(Place::Cell, Shape::Scalar, &history.values);
                    }
                }
                Source::Acceleration => {
                    let acceleration = at.session.agree(acceleration(motion))?;
                    visit(Place::Node, Shape::Vector, &acceleration);
                }
            }
            column += width;
        }
        Ok(())
    }
}

impl Source {
    fn width(self, dimension: usize) -> usize {
        let shape = match self {
            Self::Field(field) => FIELDS[field as usize].shape,
            Self::Acceleration => Shape::Vector,
            Self::OfNodes(..) | Self::OfCells(..) => Shape::Scalar,
        };
        match shape {
            Shape::Vector => dimension,
            Shape::Tensor => [4, 6][dimension - 2],
            Shape::Scalar => 1,
        }
    }
}

/// At the nodes owned here.
fn acceleration(motion: BalancedMotion<'_>) -> Result<Vec<f64>> {
    let (now, before) = (motion.velocity.owned()?, motion.before.owned()?);
    Ok(now.iter().zip(&*before).map(|(now, before)| (now - before) / motion.length).collect())
}

/// Adds the value of a field at a probe, as far as this rank has it.
fn add_value<const D: usize, const S: usize>(
    probe: &ProbePlace,
    (place, shape): (Place, Shape),
    field: &[f64],
    value: &mut [f64],
) {
    let own = if shape == Shape::Tensor { S } else { value.len() };
    match place {
        Place::Node => {
            for (node, share) in &probe.owned {
                let of_node = &field[*node as usize * own..][..own];
                value.iter_mut().zip(of_node).for_each(|(sum, value)| *sum += share * value);
            }
        }
        Place::Cell => {
            let Some(of_cell) = probe.cell.map(|cell| &field[cell * own..][..own]) else { return };
            if shape == Shape::Tensor {
                let [xx, xy, xz, yy, yz, zz] = plain_components::<S>(of_cell);
                value.iter_mut().zip([xx, yy, zz, xy, yz, xz]).for_each(|(sum, value)| *sum += value);
            } else {
                value.iter_mut().zip(of_cell).for_each(|(sum, value)| *sum += value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quantity_has_its_columns() {
        for dimension in [2, 3] {
            for (quantity, _) in &QUANTITIES {
                let with = groups(std::slice::from_ref(quantity));
                let columns = PROBES.header(dimension, &with).split(',').count() - 3 - 2 * dimension;
                assert_eq!(columns, Probed::new(&[*quantity]).width(dimension), "{quantity:?}");
            }
            let all: Vec<ProbedQuantity> = QUANTITIES.iter().map(|(quantity, _)| *quantity).collect();
            let header = PROBES.header(dimension, &groups(&all));
            let expected = ["pressure", "stress_zz", "principal_stress_2", "slip", "contact_traction_y"];
            expected.iter().for_each(|name| assert!(header.split(',').any(|n| n == *name), "{header}"));
        }
    }
}
