//! The field file of a run.

use super::{
    contact_points::{fill_corners, fill_faced},
    field_list::{COUNT, ERROR_INDICATOR, FIELDS, computations},
    fields::{Field, FieldFile, FieldMesh, Place, Shape},
    log::Log,
    output_field::{Computed, Converged, OutputField},
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::History, space::omits_corners},
    job::Job,
    parallel::{agreement::Agreed, session::Session},
};
use hdf5::filters::deflate_available;
use std::{collections::BTreeMap, path::Path};

/// The field file of a run.
pub(crate) struct FieldOutput<const D: usize> {
    file: FieldFile<D>,
    /// Whether the job requests each of [`FIELDS`].
    is_wanted: [bool; COUNT],
}

impl<const D: usize> FieldOutput<D> {
    /// Creates the files in the output folder of the job with the mesh, or continues them after this time. Unreadable files are
    /// renamed and kept. Refused if existing files and the job differ in a requested field, or if compression is requested and HDF5
    /// does not support it. Collective.
    pub(crate) fn open<const S: usize>(
        session: &Session,
        job: &Job,
        body: &Body<D, S>,
        goes_on_after: Option<f64>,
        log: &mut Log,
    ) -> Result<Self> {
        let (folder, mesh, compression) = (job.output_folder(), &body.mesh, job.output.compression);
        if compression > 0 && !deflate_available() {
            let words = "output.compression: the HDF5 library here was built without zlib; leave the key out";
            return Err(Error::Refused(words.into()));
        }
        let is_wanted = FIELDS.each_ref().map(|field| field.is_wanted(&job.output));
        let wide = |ids: &[u32]| ids.iter().map(|&id| u64::from(id)).collect::<Vec<_>>();
        let (point_ids, cell_ids) = (wide(&mesh.node_ids[..mesh.owned]), wide(&mesh.cell_ids));
        let nodes = (0..mesh.cell_count()).flat_map(|cell| mesh.cell_nodes(cell));
        let cells: Vec<u64> = nodes.map(|node| u64::from(mesh.global_node(node))).collect();
        let parts = FieldMesh {
            points: &mesh.nodes[..mesh.owned],
            point_ids: &point_ids,
            nodes_per_cell: mesh.nodes_per_cell(),
            cells: &cells,
            cell_ids: &cell_ids,
        };
        let create = || FieldFile::create(folder, session.world(), parts, compression);
        let path = folder.join("fields.vtkhdf");
        let exists = session.largest([f64::from(u8::from(session.is_first() && path.exists()))])[0] > 0.0;
        let (Some(time), true) = (goes_on_after, exists) else {
            return Ok(Self { file: create()?, is_wanted });
        };
        session.on_first(|| refuse_other_fields(&path, is_wanted))?;
        let file = match FieldFile::resume(folder, session.world(), parts, time, compression) {
            Ok(resumed) => resumed,
            Err(error) => {
                let aside = folder.join("fields.damaged.vtkhdf");
                log.warning(format!(
                    "{error}; the file is kept as {}, and a new one is started",
                    aside.display()
                ));
                let moved = || std::fs::rename(&path, &aside).map_err(|e| Error::unwritable(&aside, e));
                session.on_first(moved)?;
                create()?
            }
        };
        Ok(Self { file, is_wanted })
    }

    /// Whether writing has failed, so that no further step can be written.
    pub(crate) fn write_failed(&self) -> bool {
        self.file.write_failed()
    }

    /// The last time appended, if any.
    pub(crate) fn last_time(&self) -> Option<f64> {
        self.file.times().last().copied()
    }

    /// Appends a state, which may be buffered and written later with others. Collective.
    pub(crate) fn write<const S: usize>(&mut self, at: Converged<D, S>) -> Result<()> {
        let computed = self.computed(at, |_| true)?;
        let mut fields = Vec::new();
        for (OutputField { name, place, shape, .. }, computed) in &computed {
            fields.push(Field { name, place: *place, shape: *shape, values: &computed.values });
        }
        let of_cells: Vec<History> = at.body.cell_histories().collect();
        for history in &of_cells {
            let shape = if history.width == S { Shape::Tensor } else { Shape::Scalar };
            fields.push(Field { name: history.name(), place: Place::Cell, shape, values: &history.values });
        }
        let mut of_nodes: Vec<History> = at.body.node_histories().collect();
        for history in of_nodes.iter_mut().filter(|history| history.width == 1) {
            if !at.body.pairs.is_empty() {
                fill_faced(at, history.values.to_mut())?;
            }
        }
        for history in of_nodes.iter_mut().filter(|_| omits_corners(&at.body.mesh)) {
            fill_corners(at, history.quantity, history.values.to_mut())?;
        }
        for history in &of_nodes {
            let shape = if history.width == D { Shape::Vector } else { Shape::Scalar };
            fields.push(Field { name: history.name(), place: Place::Node, shape, values: &history.values });
        }
        Ok(self.file.write_step(at.state.time, &fields)?)
    }

    /// The figures of the fields of a state, by their names. Collective.
    pub(crate) fn figures<const S: usize>(
        &self,
        at: Converged<D, S>,
    ) -> Result<BTreeMap<&'static str, f64>, Agreed> {
        let computed = self.computed(at, |field| field.figures.is_some())?;
        let named = |(field, computed): (&OutputField, Computed)| {
            field.figures.into_iter().flat_map(|f| f.members).map(|figure| figure.name).zip(computed.figures)
        };
        Ok(computed.into_iter().flat_map(named).collect())
    }

    /// The selected fields of a state among those that the run writes. Collective.
    fn computed<'a, const S: usize>(
        &self,
        at: Converged<'a, D, S>,
        is_chosen: impl Fn(&OutputField) -> bool,
    ) -> Result<Vec<(&'static OutputField, Computed<'a>)>, Agreed> {
        let mut found = Vec::new();
        for ((field, compute), is_wanted) in FIELDS.iter().zip(computations::<D, S>()).zip(self.is_wanted) {
            if is_wanted && is_chosen(field) {
                let computed = at.session.agree(compute(at))?;
                found.extend(computed.map(|computed| (field, computed)));
            }
        }
        Ok(found)
    }

    /// Writes the buffered states if the last write was at least a second ago. Collective.
    pub(crate) fn write_out_if_due(&mut self) -> Result<(), Agreed> {
        self.file.write_out_if_due()
    }

    /// Writes the buffered states. Collective.
    pub(crate) fn write_out(&mut self) -> Result<(), Agreed> {
        self.file.write_out()
    }

    /// Closes the files. Collective.
    pub(crate) fn close(self) -> Result<(), Agreed> {
        self.file.close()
    }
}

/// Refuses a file that contains a field that the run does not write, or lacks a field that the run writes. A file without times and
/// an unreadable file are accepted.
fn refuse_other_fields(path: &Path, is_wanted: [bool; COUNT]) -> Result<()> {
    let Ok(file) = hdf5::File::open(path) else { return Ok(()) };
    if !file.link_exists("VTKHDF/Steps") {
        return Ok(());
    }
    for (OutputField { name, .. }, is_wanted) in
        FIELDS.iter().zip(is_wanted).filter(|(field, _)| field.is_asked_for.is_some())
    {
        let holds = file.link_exists(&format!("Fields/{name}"));
        if holds != is_wanted {
            let word = if holds { "contains" } else { "does not contain" };
            let key = if *name == ERROR_INDICATOR.name {
                format!("output.{name} = {holds}")
            } else {
                "the output.also of the run that wrote it".to_owned()
            };
            return Err(Error::Refused(format!(
                "{} {word} {name}, but all times in one file must have the same fields: continue with {key}, or write to another \
                 output.folder and name the checkpoint (--restart FILE.h5)",
                path.display()
            )));
        }
    }
    Ok(())
}
