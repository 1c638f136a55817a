use crate::material::Tangent;

/// What flow takes from the derivative of a cell's stress by its strain rate, in Pa s, for the cells that flow.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tangents {
    cells: Vec<u32>,
    values: Vec<f64>,
    skew: bool,
}

impl Tangents {
    /// Forgets all cells; there is room for as many, which takes no memory before it is written.
    pub fn restart<const S: usize>(&mut self, cells: usize) {
        self.skew = false;
        self.cells.clear();
        self.cells.reserve(cells);
        self.values.clear();
        self.values.reserve(cells * S * S);
    }

    /// Adds a cell by its local number; tells whether its matrix is as symmetric as that of
    /// [`has_symmetric_tangent`](super::Effect::has_symmetric_tangent).
    pub fn push<const S: usize>(&mut self, cell: usize, tangent: &Tangent<S>, symmetric: bool) {
        self.skew |= !symmetric;
        self.cells.push(cell as u32);
        self.values.extend_from_slice(tangent.as_flattened());
    }

    /// Whether those of all cells are.
    pub fn are_symmetric(&self) -> bool {
        !self.skew
    }

    /// Cells and their matrices, row by row.
    pub fn iter<const S: usize>(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.cells.iter().map(|&cell| cell as usize).zip(self.values.chunks_exact(S * S))
    }
}
