//! Warnings about bonds for which the cells are too large.

use crate::{
    fem::body::Body,
    job::Job,
    laws::material::Hypothesis,
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::session::Session,
};

/// Number of cells that the zone in which bonds give way needs.
const CELLS: f64 = 3.0;

/// Warnings about bonds, whose strength may follow from energy and stiffness. With `G` the energy of both sides of a crack, twice that of an obstacle, the zone in which they
/// give way is `E' G / strength^2` long in a thick body and `(E' G / strength^2)^(1/4) h^(3/4)` in a layer of the thickness `h` (A. Turon,
/// C. Davila, P. Camanho, J. Costa, An engineering solution for mesh size effects in the simulation of delamination using cohesive zone
/// models, Engrg. Fracture Mech. 74 (2007), 1665-1682; Q. Yang, B. Cox, Int. J. Fracture 133 (2005), 107-137). Collective, with the
/// same warnings on all ranks.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &Body<D, S>,
) -> Vec<String> {
    let mesh = &body.mesh;
    let mut out = Vec::new();
    for (number, (contact, table)) in body.contacts.iter().zip(&job.contact).enumerate() {
        let Some(law) = table.adhesion.as_ref().filter(|law| law.length.is_none()) else { continue };
        let (strength, key) = match law.strength {
            Some(strength) => (strength, "strength"),
            None => ((law.stiffness * law.energy).sqrt(), "stiffness"),
        };
        let thickness = thickness(session, mesh, &contact.facets);
        let (mut longest, mut shortest) = (0.0, f64::INFINITY);
        for &facet in &contact.facets {
            let Some(modulus) = modulus_behind(job, mesh, facet) else { continue };
            let thick = 2.0 * modulus * law.energy / (strength * strength);
            shortest = f64::min(shortest, thick.min(thick.powf(0.25) * thickness.powf(0.75)));
            longest = larger(longest, longest_edge(&mesh.facet_corners(facet)) / mesh.order() as f64);
        }
        let [longest, shortest] = session.largest([longest, -shortest]);
        let wanted = -shortest / CELLS;
        if longest > wanted {
            let on = table.on.join(", ");
            out.push(format!(
                "contact.{number}: nodes on the boundary {on} are up to {longest:.1e} m apart, but the zone in which its bonds give way is \
                 only {:.1e} m long: they break one node at a time, with jumps of the force; use cells of at most {wanted:.1e} m, or \
                 lower `{key}`, which changes little while that zone is short compared with the crack",
                CELLS * wanted
            ));
        }
    }
    out
}

/// The extent of the body along the mean normal of these facets in m; infinite for a closed surface. Collective.
fn thickness<const D: usize>(session: &Session, mesh: &Mesh<D>, facets: &[u32]) -> f64 {
    let normals = facets.iter().map(|&facet| facet_normal(&mesh.facet_corners(facet)));
    let sum = session.sum(normals.fold([0.0; D], |sum, normal| add_scaled(&sum, 1.0, &normal)));
    let length = norm(&sum);
    if length == 0.0 || !length.is_finite() {
        return f64::INFINITY;
    }
    let ends = mesh.nodes.iter().fold([f64::NEG_INFINITY; 2], |[most, least], node| {
        let along = dot(node, &sum) / length;
        [larger(most, along), larger(least, -along)]
    });
    session.largest(ends).iter().sum()
}

fn longest_edge<const D: usize>(corners: &[Vector<D>; D]) -> f64 {
    let length = |a: usize, b: usize| norm(&add_scaled(&corners[a], -1.0, &corners[b]));
    (1..D).flat_map(|a| (0..a).map(move |b| length(a, b))).fold(0.0, larger)
}

/// `E'` in Pa of the cell behind a facet: Young's modulus, in plane strain and space divided by `1 - nu^2`. `None` without elasticity.
fn modulus_behind<const D: usize>(job: &Job, mesh: &Mesh<D>, facet: u32) -> Option<f64> {
    let cell = mesh.facet_cells[facet as usize] as usize;
    let name = &mesh.regions[usize::from(mesh.cell_regions[cell])];
    let law = job.material_of(name).elasticity.as_ref()?;
    let modulus = law.youngs_modulus.evaluate(0.0, &mesh.facet_corners(facet)[0]);
    let is_plane_stress = job.material.hypothesis == Some(Hypothesis::PlaneStress);
    Some(if is_plane_stress { modulus } else { modulus / (1.0 - law.poisson_ratio * law.poisson_ratio) })
}
