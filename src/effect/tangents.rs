use crate::material::Tangent;

/// What flow takes from the derivative of a cell's stress by its strain rate, in Pa s, for the cells that flow.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tangents {
    cells: Vec<u32>,
    values: Vec<f64>,
}

impl Tangents {
    /// Forgets all cells; there is room for as many, which takes no memory before it is written.
    pub fn restart<const S: usize>(&mut self, cells: usize) {
        self.cells.clear();
        self.cells.reserve(cells);
        self.values.clear();
        self.values.reserve(cells * S * S);
    }

    /// Adds a cell by its local number.
    pub fn push<const S: usize>(&mut self, cell: usize, tangent: &Tangent<S>) {
        self.cells.push(cell as u32);
        self.values.extend_from_slice(tangent.as_flattened());
    }

    /// Cells and their matrices, row by row.
    pub fn iter<const S: usize>(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.cells.iter().map(|&cell| cell as usize).zip(self.values.chunks_exact(S * S))
    }
}
