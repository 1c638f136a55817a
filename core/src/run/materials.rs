//! The materials of the cells of a body.

use crate::{
    error::Error,
    job::{self, Job},
    laws::material::{Hypothesis, Material},
    mesh::{Mesh, shape::centroid},
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::HashMap;

/// The materials of a body. Properties that vary with place are constant in each cell: the values at the mean of its corners. Cells of
/// one table with the same values share a material.
#[derive(Debug)]
pub(super) struct Materials {
    /// First one for each table of the job that a cell of the body has, on all ranks alike: that of its numbers, or, where properties
    /// vary, that of their largest values in the body. Then those of the cells of this rank.
    pub all: Vec<Material<f64>>,
    /// For each material the number of its table; empty if no property varies.
    pub tables: Vec<usize>,
    /// The number of tables that cells of the body have.
    pub table_count: usize,
    /// Their keys in the job.
    keys: Vec<String>,
    /// For each region of the mesh the number of its table.
    of_region: Vec<usize>,
    /// The material of each cell of this rank; empty if no property varies.
    of_cells: Vec<u32>,
}

/// The speed in m/s of compression waves in a material, if it has density and elasticity.
pub(super) fn wave_speed(material: &Material<f64>, hypothesis: Option<Hypothesis>) -> Option<f64> {
    let (density, elasticity) = (material.density?, material.elasticity.as_ref()?);
    let tensor = elasticity.tensor(hypothesis.unwrap_or(Hypothesis::Space));
    // A formula of the shear modulus leaves the bulk modulus as it is.
    let factor = elasticity.expression.as_ref().map_or(1.0, |formula| formula.at_rest());
    let modulus = tensor.volumetric + tensor.shear + (factor - 1.0) * tensor.shear * 2.0 / 3.0;
    (density > 0.0).then(|| (modulus / density).sqrt())
}

impl Materials {
    /// The materials of a job. Collective.
    pub(super) fn new<const D: usize>(session: &Session, job: &Job, mesh: &Mesh<D>) -> Result<Self, Agreed> {
        let given: Vec<(String, &job::Material)> = job.materials().collect();
        let of_name = |name: &String| job.region.iter().position(|r| r.name == *name).map_or(0, |at| at + 1);
        let named: Vec<usize> = mesh.regions.iter().map(of_name).collect();
        let mut counts = vec![0; given.len()];
        mesh.cell_regions.iter().for_each(|&region| counts[named[usize::from(region)]] += 1);
        let used: Vec<usize> = (0..given.len()).filter(|&at| session.total(counts[at]) > 0).collect();
        let of_region = named.iter().map(|at| used.iter().position(|u| u == at).unwrap_or(0)).collect();
        let mut found = Self {
            all: Vec::new(),
            tables: Vec::new(),
            table_count: used.len(),
            keys: used.iter().map(|&at| given[at].0.clone()).collect(),
            of_region,
            of_cells: Vec::new(),
        };
        let tables: Vec<(String, &job::Material)> = used.iter().map(|&at| given[at].clone()).collect();
        let cells = found.add_cells(mesh, &tables);
        let cells = session.agree(cells)?;
        let of_tables = tables.iter().enumerate().map(|(table, (_, material))| {
            if !material.has_expressions() {
                return material.with(material.numbers_at(&[]));
            }
            let mine = cells.iter().filter(|(of, _)| *of == table).map(|(_, there)| there.numbers());
            let most = mine.fold([f64::NEG_INFINITY; _], |most, numbers| {
                std::array::from_fn(|k| numbers[k].map_or(most[k], |number| most[k].max(number)))
            });
            material.with(session.largest(most).map(Some))
        });
        found.all = of_tables.collect();
        if !found.of_cells.is_empty() {
            found.tables = (0..tables.len()).collect();
        }
        for (table, material) in cells {
            found.tables.push(table);
            found.all.push(material);
        }
        Ok(found)
    }

    /// A warning of cells without mass beside others with mass.
    pub(super) fn warning_of_mass(&self) -> Option<String> {
        let with_mass = |has: bool| -> Vec<&str> {
            let tables = self.all[..self.table_count].iter().zip(&self.keys);
            tables.filter(|(of, _)| of.density.is_some() == has).map(|(_, key)| &**key).collect()
        };
        let (with, without) = (with_mass(true), with_mass(false));
        (!with.is_empty() && !without.is_empty()).then(|| {
            format!(
                "{} without density: its cells have neither inertia nor weight, as those of {} have; a region takes nothing from [material]: \
                 give the density again, or none to both",
                without.join(", "),
                with.join(", ")
            )
        })
    }

    /// The materials of the cells of tables with expressions, each with its table; notes them in the cells.
    fn add_cells<const D: usize>(
        &mut self,
        mesh: &Mesh<D>,
        tables: &[(String, &job::Material)],
    ) -> Result<Vec<(usize, Material<f64>)>, Error> {
        let mut found: Vec<(usize, Material<f64>)> = Vec::new();
        if !tables.iter().any(|(_, material)| material.has_expressions()) {
            return Ok(found);
        }
        let mut numbers = HashMap::new();
        for cell in 0..mesh.cell_count() {
            let table = self.table_of_cell(mesh, cell);
            let (path, material) = &tables[table];
            if !material.has_expressions() {
                self.of_cells.push(table as u32);
                continue;
            }
            let centre = centroid(&mesh.corners(cell)[..=D]);
            let there = material.at(&centre, if mesh.is_revolved { 3 } else { D }).map_err(|fault| {
                Error::Refused(format!(
                    "{path}.{}: {} at {centre:?} m, the centre of cell {}; {}",
                    fault.key, fault.message, mesh.cell_ids[cell], fault.help
                ))
            })?;
            let bits = there.numbers().map(|number| number.map(f64::to_bits));
            let number = *numbers.entry((table, bits)).or_insert_with(|| {
                found.push((table, there));
                (tables.len() + found.len() - 1) as u32
            });
            self.of_cells.push(number);
        }
        Ok(found)
    }

    /// The number of a cell's material, given the cell's local number.
    pub(super) fn of_cell<const D: usize>(&self, mesh: &Mesh<D>, cell: usize) -> usize {
        match self.of_cells.get(cell) {
            Some(&material) => material as usize,
            None => self.table_of_cell(mesh, cell),
        }
    }

    /// The number of the table of a cell's material, given the cell's local number.
    pub(super) fn table_of_cell<const D: usize>(&self, mesh: &Mesh<D>, cell: usize) -> usize {
        self.of_region[usize::from(mesh.cell_regions[cell])]
    }
}
