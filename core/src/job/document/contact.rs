//! Checks of `[[contact]]` against the time scheme and the mesh. Its keys are defined with the laws.

use super::boundary::check_on;
use crate::job::findings::{MeshNames, Table};
use crate::laws::contact::{Contact, Gap};
use crate::laws::schemes::Scheme;

pub(in crate::job) fn check_contact(contact: &Contact, table: &mut Table<'_>, scheme: Scheme) {
    table.refuse_repeats("on", "boundary");
    table.refuse_repeats("against", "boundary");
    if !table.is_unread("normal") && !table.is_unread("obstacle") {
        table.refuse(contact.faults());
    }
    for words in contact.warnings() {
        table.warn(table.path(&words));
    }
    // Stresses from the previous step would leave the velocity of a boundary without mass undetermined.
    if contact.redistribute_mass && !scheme.is_implicit() {
        let message = format!("scheme \"{}\" cannot solve for a boundary without mass", scheme.name());
        let help = "use [time] scheme = \"bdf2\" or \"implicit_euler\", or delete the key";
        table.fault("redistribute_mass", message, help);
    }
}

pub(in crate::job) fn check_names(contact: &Contact, table: &mut Table<'_>, mesh: MeshNames<'_>) {
    check_on(table, &contact.on, None, mesh);
    for (index, name) in contact.against.iter().enumerate() {
        table.check_place(&format!("against.{index}"), name, mesh, &[]);
    }
    table.check_flat("where", contact.part.as_ref(), mesh.dimension);
    table.check_flat(&format!("{}.gap", contact.normal.table()), contact.normal.gap(), mesh.dimension);
    if let Some(load) = &contact.obstacle_load {
        table.check_length("obstacle_load.direction", &load.direction, mesh.dimension);
    }
    let Some(obstacle) = &contact.obstacle else { return };
    for (key, vector) in obstacle.vectors() {
        table.check_vector(&key, vector, mesh.dimension);
    }
    if let Some((key, axis)) = obstacle.given_axis().filter(|_| mesh.dimension == 3) {
        table.check_length(&key, axis, mesh.dimension);
    }
    if let Gap::Shape(shape) = obstacle {
        table.check_flat("obstacle.shape.distance", shape.distance.as_ref(), mesh.dimension);
        if mesh.dimension == 2 && shape.surface.is_some() {
            let help = "give its distance as an expression of x and y: `distance`";
            let message = "a triangulated surface is an obstacle in 3D only";
            table.fault_at_key("obstacle.shape.surface", message, help);
        }
    }
    table.refuse(contact.fault_of_rotation(mesh.dimension));
}
