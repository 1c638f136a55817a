//! Numbers of result files, ordered by the global ids of nodes and cells, so that runs on different numbers of ranks can be
//! compared.

use std::path::Path;

/// A result file.
pub struct NumberFile(hdf5::File);

impl NumberFile {
    pub fn open(path: &Path) -> Self {
        Self(hdf5::File::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
    }

    /// Names in a group, sorted.
    pub fn names(&self, group: &str) -> Vec<String> {
        let mut names = self.0.group(group).expect(group).member_names().expect(group);
        names.sort();
        names
    }

    /// The rows of a table in the order of the ids of another.
    pub fn by_id(&self, table: &str, ids: &str) -> Vec<f64> {
        let ids = self.0.dataset(ids).expect(ids).read_raw::<i64>().expect("ids");
        let values = self.0.dataset(table).expect(table).read_raw::<f64>().expect(table);
        let width = values.len() / ids.len();
        let mut order: Vec<usize> = (0..ids.len()).collect();
        order.sort_by_key(|row| ids[*row]);
        order.into_iter().flat_map(|row| values[row * width..][..width].iter().copied()).collect()
    }

    /// A field of a field file at a step of the file.
    pub fn field(&self, name: &str, step: usize) -> Vec<f64> {
        let at_nodes = [
            "displacement",
            "displacement_origin",
            "velocity",
            "contact_traction",
            "bonding",
            "memory_pressure",
            "contact_pressure",
            "gap",
            "contact_status",
            "branch",
            "sliding_velocity",
            "slip",
            "friction_state",
            "wear",
        ]
        .contains(&name);
        let ids = if at_nodes { "VTKHDF/PointData/node" } else { "VTKHDF/CellData/cell" };
        self.by_id(&format!("Fields/{name}/{step}"), ids)
    }

    /// Times of the steps of a field file.
    pub fn times(&self) -> Vec<f64> {
        self.0.dataset("VTKHDF/Steps/Values").expect("times").read_raw().expect("times")
    }

    /// All tables of a checkpoint by name.
    pub fn checkpoint_tables(&self) -> Vec<(String, Vec<f64>)> {
        let sets = self.names("tables").into_iter().flat_map(|set| {
            let names = self.names(&format!("tables/{set}"));
            names.into_iter().map(move |name| (set.clone(), name))
        });
        sets.map(|(set, name)| {
            let values = self.by_id(&format!("tables/{set}/{name}"), &format!("ids/{set}"));
            (name, values)
        })
        .collect()
    }
}
