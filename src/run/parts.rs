//! Parts of boundaries.

use crate::{
    error::{Error, Result},
    fem::space::facets,
    job::Scalar,
    linear_algebra::tensor::Vector,
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};

/// The facets of the boundaries of a table on this rank at whose centre the expression is not 0. Collective.
pub(super) fn part_of<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (table, on): (&str, &[String]),
    part: Option<&Scalar>,
) -> Result<Vec<u32>, Agreed> {
    let mut facets = facets(mesh, on);
    let Some(part) = part else { return Ok(facets) };
    let refused = |words: String| {
        let on = on.join(", ");
        Err(Error::Refused(format!("{table} on {on}: `where` {words}; correct the expression")))
    };
    let value = |facet: u32| part.evaluate(0.0, &centre_of(mesh, facet));
    let wrong = facets.iter().find(|facet| value(**facet).is_nan());
    let words = |facet: &u32| refused(format!("is not a number at {:?} m", centre_of(mesh, *facet)));
    session.agree(wrong.map_or(Ok(()), words))?;
    facets.retain(|&facet| value(facet) != 0.0);
    let is_empty = session.total(facets.len()) == 0;
    session.agree(if is_empty { refused("holds at no facet of these boundaries".into()) } else { Ok(()) })?;
    Ok(facets)
}

pub(super) fn centre_of<const D: usize>(mesh: &Mesh<D>, facet: u32) -> Vector<D> {
    let corners = mesh.facet_corners(facet);
    std::array::from_fn(|i| corners.iter().map(|corner| corner[i]).sum::<f64>() / D as f64)
}
