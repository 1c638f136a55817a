use super::{BlockRows, DistributedVector, Matrix, check, index, reference::Reference, sys};
use crate::error::{Error, Result};
use std::{
    collections::{BTreeSet, HashMap},
    ptr,
};

/// `P K P + k (I - P)`: a constant matrix on a subspace, with a factor `k` of the magnitude of `K` on the complement.
///
/// `P` acts on each node separately. The pattern of stored entries is that of `K`, so that an ordering that was set up for
/// one of the matrices is valid for the other.
#[derive(Debug)]
pub(super) struct ReducedMatrix {
    pub raw: Reference<sys::_p_Mat>,
    /// Components of each node.
    block: usize,
    /// Positions of ghost nodes after the owned ones, by their global numbers.
    ghosts: HashMap<usize, usize>,
    /// `P e_i` for each component `i`.
    columns: Vec<DistributedVector>,
    /// All components of all nodes.
    directions: f64,
    /// The same for the projection for which the matrix was computed.
    projection: Vec<DistributedVector>,
}

impl ReducedMatrix {
    /// Starts with `P = I`, for vectors with the layout of `like`. Collective.
    pub(super) fn new(constant: &Matrix, like: &DistributedVector, block: usize) -> Result<Self> {
        let owned = like.owned()?.len() / block;
        let first = first_node(constant, block)?;
        let mut others = BTreeSet::new();
        for node in 0..owned {
            let (columns, _) = block_row(constant.raw.get(), first + node, block)?;
            others.extend(columns.into_iter().filter(|node| !(first..first + owned).contains(node)));
        }
        // A row extends beyond the cells of this rank: the ghosts here are all nodes in the columns of the rows.
        let list: Vec<u32> = others.iter().map(|&node| node as u32).collect();
        let unit = |i| {
            let mut column = DistributedVector::ghosted(block, owned, &list)?;
            write_unit(&mut column, i, block)?;
            Ok(column)
        };
        let columns = (0..block).map(unit).collect::<Result<_>>()?;
        let projection: Vec<DistributedVector> = (0..block).map(unit).collect::<Result<_>>()?;
        let mut directions = 0.0;
        for column in &projection {
            directions += column.norm()?.powi(2);
        }
        let ghosts = others.into_iter().enumerate().map(|(at, node)| (node, owned + at)).collect();
        // SAFETY: live matrices.
        let raw = unsafe {
            let copy =
                Reference::new(|raw| sys::MatDuplicate(constant.raw.get(), sys::MAT_COPY_VALUES, raw))?;
            check(sys::MatSetOption(copy.get(), sys::MAT_SYMMETRIC, 1))?;
            check(sys::MatSetOption(copy.get(), sys::MAT_SPD, 1))?;
            copy
        };
        Ok(Self { raw, block, ghosts, columns, directions: directions.round(), projection })
    }

    /// Reads the current projection; returns whether the matrix was computed for another one. Collective.
    pub(super) fn update_projection(
        &mut self,
        mut project: impl FnMut(&mut DistributedVector) -> Result<()>,
    ) -> Result<bool> {
        let mut changed = false;
        for (i, column) in self.columns.iter_mut().enumerate() {
            write_unit(column, i, self.block)?;
            project(column)?;
            changed |= !column.equals(&self.projection[i])?;
        }
        Ok(changed)
    }

    /// Resets the projection for which the matrix was computed to the identity.
    pub(super) fn reset_projection(&mut self) -> Result<()> {
        for (i, made) in self.projection.iter_mut().enumerate() {
            write_unit(made, i, self.block)?;
        }
        Ok(())
    }

    /// Dimension of the complement of the projection that was last read. Collective.
    pub(super) fn removed(&self) -> Result<f64> {
        let mut left = 0.0;
        for column in &self.columns {
            left += column.norm()?.powi(2);
        }
        Ok((self.directions - left).round())
    }

    /// Computes the matrix for the projection that was last read. Collective.
    pub(super) fn make(&mut self, constant: &Matrix) -> Result<()> {
        for (made, column) in self.projection.iter_mut().zip(&self.columns) {
            made.copy_from(column)?;
        }
        // SAFETY: live matrices of one pattern.
        check(unsafe { sys::MatCopy(constant.raw.get(), self.raw.get(), sys::SAME_NONZERO_PATTERN) })?;
        for column in &mut self.columns {
            column.update_ghosts()?;
        }
        let locals = self.columns.iter().map(DistributedVector::local).collect::<Result<Vec<_>>>()?;
        let (block, square) = (self.block, self.block * self.block);
        let projection = |node: usize| -> Vec<f64> {
            locals.iter().flat_map(|column| column[node * block..][..block].iter().copied()).collect()
        };
        let identity: Vec<f64> = (0..square).map(|k| if k % (block + 1) == 0 { 1.0 } else { 0.0 }).collect();
        let first = first_node(constant, block)?;
        let owned = self.columns[0].owned()?.len() / block;
        for node in 0..owned {
            let mine = projection(node);
            if mine == identity {
                continue;
            }
            let (columns, rows) = block_row(constant.raw.get(), first + node, block)?;
            for (at, &global) in columns.iter().enumerate() {
                let other = if (first..first + owned).contains(&global) {
                    global - first
                } else {
                    *self.ghosts.get(&global).ok_or_else(|| {
                        Error::Internal(format!("node {global} of a matrix row is no ghost of this rank"))
                    })?
                };
                let theirs = projection(other);
                let stored: Vec<f64> = (0..square).map(|k| rows[k / block][at * block + k % block]).collect();
                let mut values = times(&times(&mine, &stored, block), &theirs, block);
                if global == first + node {
                    let size = (0..block).map(|i| stored[i * block + i]).sum::<f64>() / block as f64;
                    values
                        .iter_mut()
                        .enumerate()
                        .for_each(|(k, value)| *value += size * (identity[k] - mine[k]));
                }
                self.insert(first + node, global, &values)?;
                // Rows of nodes with the identity projection are not visited, so their block is written here.
                if theirs == identity {
                    let across: Vec<f64> =
                        (0..square).map(|k| values[(k % block) * block + k / block]).collect();
                    self.insert(global, first + node, &across)?;
                }
            }
        }
        // SAFETY: live matrix.
        unsafe {
            check(sys::MatAssemblyBegin(self.raw.get(), sys::MAT_FINAL_ASSEMBLY))?;
            check(sys::MatAssemblyEnd(self.raw.get(), sys::MAT_FINAL_ASSEMBLY))
        }
    }

    /// Overwrites a stored block.
    fn insert(&self, row: usize, column: usize, values: &[f64]) -> Result<()> {
        let scalars = |node: usize| -> Result<Vec<sys::PetscInt>> {
            (0..self.block).map(|i| index(node * self.block + i, "global unknown")).collect()
        };
        let (rows, columns) = (scalars(row)?, scalars(column)?);
        let size = index(self.block, "block size")?;
        // SAFETY: live matrix; as many indices and values as announced, which PETSc copies.
        check(unsafe {
            sys::MatSetValues(
                self.raw.get(),
                size,
                rows.as_ptr(),
                size,
                columns.as_ptr(),
                values.as_ptr(),
                sys::INSERT_VALUES,
            )
        })
    }
}

/// The first node whose row this rank owns.
fn first_node(matrix: &Matrix, block: usize) -> Result<usize> {
    let (mut first, mut end) = (0, 0);
    // SAFETY: live matrix, live integers.
    check(unsafe { sys::MatGetOwnershipRange(matrix.raw.get(), &mut first, &mut end) })?;
    Ok(usize::try_from(first).unwrap_or(0) / block)
}

/// Writes `e_i` at each node.
fn write_unit(column: &mut DistributedVector, i: usize, block: usize) -> Result<()> {
    column.owned_mut()?.chunks_exact_mut(block).for_each(|node| {
        node.fill(0.0);
        node[i] = 1.0;
    });
    Ok(())
}

/// The product of two square matrices of `size` rows.
fn times(a: &[f64], b: &[f64], size: usize) -> Vec<f64> {
    let entry = |k: usize| (0..size).map(|l| a[k / size * size + l] * b[l * size + k % size]).sum();
    (0..size * size).map(entry).collect()
}

/// The rows of a matrix on this rank.
pub(super) fn block_rows(matrix: sys::Mat) -> Result<BlockRows> {
    let (mut size, mut first, mut end) = (1, 0, 0);
    // SAFETY: live matrix, live integers.
    unsafe {
        check(sys::MatGetBlockSize(matrix, &mut size))?;
        check(sys::MatGetOwnershipRange(matrix, &mut first, &mut end))?;
    }
    let count = |number: sys::PetscInt| usize::try_from(number).unwrap_or(0);
    let block = count(size).max(1);
    let mut out = BlockRows { offsets: vec![0], ..BlockRows::default() };
    for node in count(first) / block..count(end) / block {
        let (columns, rows) = block_row(matrix, node, block)?;
        for (at, &column) in columns.iter().enumerate() {
            out.columns.push(column as u32);
            rows.iter().for_each(|row| out.values.extend_from_slice(&row[at * block..][..block]));
        }
        out.offsets.push(out.columns.len());
    }
    Ok(out)
}

/// Global block columns and the scalar rows of an owned block row.
fn block_row(matrix: sys::Mat, node: usize, block: usize) -> Result<(Vec<usize>, Vec<Vec<f64>>)> {
    let mut blocks = Vec::new();
    let mut rows = Vec::new();
    for i in 0..block {
        let row = index(node * block + i, "global unknown")?;
        let (mut count, mut columns, mut values) = (0, ptr::null(), ptr::null());
        // SAFETY: a live matrix, whose rows PETSc refuses to show on other ranks; its arrays hold `length` numbers and are
        // read before the row is given back.
        unsafe {
            check(sys::MatGetRow(matrix, row, &mut count, &mut columns, &mut values))?;
            let length = usize::try_from(count).unwrap_or(0);
            // PETSc shows no arrays of a row without entries.
            let (of, found) = match length {
                0 => (&[][..], &[][..]),
                _ => {
                    (std::slice::from_raw_parts(columns, length), std::slice::from_raw_parts(values, length))
                }
            };
            if i == 0 {
                let firsts = of.iter().step_by(block);
                blocks = firsts.map(|&column| usize::try_from(column).unwrap_or(0) / block).collect();
            }
            rows.push(found.to_vec());
            check(sys::MatRestoreRow(matrix, row, &mut count, &mut columns, &mut values))?;
        }
    }
    Ok((blocks, rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_multiply_as_by_hand() {
        assert_eq!(times(&[1.0, 2.0, 3.0, 4.0], &[5.0, 6.0, 7.0, 8.0], 2), [19.0, 22.0, 43.0, 50.0]);
    }
}
