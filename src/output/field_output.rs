//! Which fields go into `fields.vtkhdf`.

use super::{
    field_snapshot::has_field,
    fields::{Field, FieldFile, FieldMesh, Place, Shape},
    log::Log,
};
use crate::{
    agreement::Agreed,
    body::Body,
    effect::History,
    error::{Error, Result},
    job::Output,
    session::Session,
    state::State,
    tensor::{Mandel, von_mises},
};
use hdf5::filters::deflate_available;
use std::path::Path;

/// Name of the field that the job asks for.
pub const ERROR_INDICATOR: &str = "error_indicator";

/// The field file of a run.
pub struct FieldOutput<const D: usize>(FieldFile<D>);

impl<const D: usize> FieldOutput<D> {
    /// Creates the files with the mesh, or goes on with them behind this time; files that
    /// can't be read are put aside. Refused where they hold the error indicator and it is not wanted, or the other way
    /// round, and where HDF5 can't compress though it is to. Collective.
    pub fn open<const S: usize>(
        session: &Session,
        folder: &Path,
        body: &Body<D, S>,
        goes_on_after: Option<f64>,
        output: &Output,
        log: &mut Log,
    ) -> Result<Self> {
        let (mesh, compression) = (&body.mesh, output.compression);
        if compression > 0 && !deflate_available() {
            let words = "output.compression: the HDF5 library here was built without zlib; leave the key out";
            return Err(Error::Refused(words.into()));
        }
        let wide = |ids: &[u32]| ids.iter().map(|&id| u64::from(id)).collect::<Vec<_>>();
        let (point_ids, cell_ids) = (wide(&mesh.node_ids[..mesh.owned]), wide(&mesh.cell_ids));
        let cells: Vec<u64> = mesh.cells.iter().map(|&node| u64::from(mesh.global_node(node))).collect();
        let parts = FieldMesh {
            points: &mesh.nodes[..mesh.owned],
            point_ids: &point_ids,
            cells: &cells,
            cell_ids: &cell_ids,
        };
        let file = folder.join("fields.vtkhdf");
        let exists = session.largest([f64::from(u8::from(session.is_first() && file.exists()))])[0] > 0.0;
        let (Some(time), true) = (goes_on_after, exists) else {
            return Ok(Self(FieldFile::create(folder, session.world(), parts, compression)?));
        };
        let holds = if session.is_first() { has_field(&file, ERROR_INDICATOR) } else { None };
        let fits = holds.is_none_or(|holds| holds == output.error_indicator);
        session.agree(fits.then_some(()).ok_or_else(|| other_fields(&file, output.error_indicator)))?;
        match FieldFile::resume(folder, session.world(), parts, time, compression) {
            Ok(resumed) => Ok(Self(resumed)),
            Err(error) => {
                let aside = folder.join("fields.damaged.vtkhdf");
                log.warning(format!("{error}; it is kept as {}, a new one is begun", aside.display()));
                let moved = if session.is_first() { std::fs::rename(&file, &aside) } else { Ok(()) };
                session.agree(moved.map_err(|e| Error::unwritable(&aside, e)))?;
                Ok(Self(FieldFile::create(folder, session.world(), parts, compression)?))
            }
        }
    }

    /// Whether writing failed before, so that no step can follow.
    pub fn is_broken(&self) -> bool {
        self.0.is_broken()
    }

    /// The last time written, if any.
    pub fn last_time(&self) -> Option<f64> {
        self.0.times().last().copied()
    }

    /// Appends the state, whose total stress is given one a cell, as is the error indicator if it is wanted. Collective.
    pub fn write<const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        stress: &[Mandel<S>],
        indicator: Option<&[f64]>,
    ) -> Result<()> {
        let (displacement, velocity) = (state.displacement.owned()?, state.velocity.owned()?);
        let norms: Vec<f64> = stress.iter().map(von_mises).collect();
        let mut fields = vec![
            Field { name: "displacement", place: Place::Node, shape: Shape::Vector, values: &displacement },
            Field { name: "velocity", place: Place::Node, shape: Shape::Vector, values: &velocity },
            Field { name: "stress", place: Place::Cell, shape: Shape::Tensor, values: stress.as_flattened() },
            Field { name: "von_mises", place: Place::Cell, shape: Shape::Scalar, values: &norms },
        ];
        if let Some(values) = indicator {
            fields.push(Field { name: ERROR_INDICATOR, place: Place::Cell, shape: Shape::Scalar, values });
        }
        let traction = state.contact_traction.as_ref().map(|traction| traction.owned()).transpose()?;
        if let Some(values) = traction.as_deref() {
            fields.push(Field { name: "contact_traction", place: Place::Node, shape: Shape::Vector, values });
        }
        let of_cells: Vec<History> = body.effects.iter().flat_map(|e| e.histories()).collect();
        for history in &of_cells {
            let shape = if history.width == S { Shape::Tensor } else { Shape::Scalar };
            fields.push(Field { name: history.name, place: Place::Cell, shape, values: &history.values });
        }
        let of_nodes: Vec<History> = body.surface_effects.iter().flat_map(|e| e.histories()).collect();
        for history in &of_nodes {
            let shape = if history.width == D { Shape::Vector } else { Shape::Scalar };
            fields.push(Field { name: history.name, place: Place::Node, shape, values: &history.values });
        }
        Ok(self.0.write_step(state.time, &fields)?)
    }

    /// Closes the files. Collective.
    pub fn close(self) -> Result<(), Agreed> {
        self.0.close()
    }
}

fn other_fields(file: &Path, wants_indicator: bool) -> Error {
    let (word, there) = if wants_indicator { ("does not hold", "false") } else { ("holds", "true") };
    Error::Refused(format!(
        "{} {word} {ERROR_INDICATOR}, and all its times have the same fields: go on with output.{ERROR_INDICATOR} = {there}, or \
         in another output.folder from a named checkpoint (--restart FILE.h5)",
        file.display()
    ))
}
