//! The place of a mesh from a file.

use crate::error::{Error, Result};

/// How a mesh is moved after it has been read: scaled, then rotated, then translated.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Factor of all coordinates, positive.
    pub scale: f64,
    /// A rotation about the origin.
    pub rotation: Option<Rotation>,
    /// Added to the coordinates (m), one number an axis; empty for none.
    pub translation: Vec<f64>,
}

/// A rotation about an axis through the origin, by the right-hand rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// In degrees.
    pub angle: f64,
    /// Direction of the axis, of any length but 0; `None`: the z axis.
    pub axis: Option<[f64; 3]>,
}

impl Default for Placement {
    fn default() -> Self {
        Self { scale: 1.0, rotation: None, translation: Vec::new() }
    }
}

impl Placement {
    /// Moves the points of a mesh of this dimension.
    pub(super) fn apply(&self, dimension: usize, points: &mut [[f64; 3]]) -> Result<()> {
        if *self == Self::default() {
            return Ok(());
        }
        let length = self.translation.len();
        if length != 0 && length != dimension {
            return Err(Error::Refused(format!(
                "[mesh] translate has {length} numbers, but the mesh has {dimension} dimensions: give {dimension}"
            )));
        }
        if dimension == 2 && self.rotation.is_some_and(|rotation| rotation.axis.is_some()) {
            return Err(Error::Refused(
                "[mesh] rotate has an axis, but the mesh lies in the plane: give the angle alone".into(),
            ));
        }
        let matrix = self.rotation.map(|rotation| rotation.matrix());
        for point in points {
            let scaled = point.map(|x| self.scale * x);
            let turned = match &matrix {
                None => scaled,
                Some(rows) => rows.map(|row| (0..3).map(|i| row[i] * scaled[i]).sum()),
            };
            *point = std::array::from_fn(|i| turned[i] + self.translation.get(i).unwrap_or(&0.0));
        }
        Ok(())
    }
}

impl Rotation {
    /// The rows of the matrix (Rodrigues' formula). Right angles are exact.
    fn matrix(self) -> [[f64; 3]; 3] {
        let axis = self.axis.unwrap_or([0.0, 0.0, 1.0]);
        let largest = axis.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let axis = axis.map(|x| x / largest);
        let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let n = axis.map(|x| x / length);
        let (sine, cosine) = match self.angle.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            angle => angle.to_radians().sin_cos(),
        };
        let cross = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let identity = if i == j { cosine } else { 0.0 };
                identity + sine * cross[i][j] + (1.0 - cosine) * n[i] * n[j]
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(placement: &Placement, dimension: usize, point: [f64; 3]) -> [f64; 3] {
        let mut points = [point];
        placement.apply(dimension, &mut points).expect("a placement");
        points[0]
    }

    #[test]
    fn a_mesh_is_scaled_then_rotated_then_translated() {
        let rotation = Some(Rotation { angle: 90.0, axis: None });
        let placement = Placement { scale: 0.5, rotation, translation: vec![10.0, 20.0] };
        assert_eq!(moved(&placement, 2, [2.0, 4.0, 0.0]), [8.0, 21.0, 0.0]);
        let rotation = Some(Rotation { angle: 90.0, axis: Some([3.0, 0.0, 0.0]) });
        let placement = Placement { scale: 1e-3, rotation, translation: vec![0.0, 0.0, 1.0] };
        assert_eq!(moved(&placement, 3, [1e3, 2e3, 3e3]), [1.0, -3.0, 3.0]);
        let third = Placement {
            rotation: Some(Rotation { angle: 120.0, axis: Some([1.0; 3]) }),
            ..Placement::default()
        };
        let found = moved(&third, 3, [1.0, 2.0, 3.0]);
        assert!(found.iter().zip([3.0, 1.0, 2.0]).all(|(x, y)| (x - y).abs() < 1e-14), "{found:?}");
    }

    #[test]
    fn a_placement_of_another_dimension_is_refused() {
        let of = |placement: Placement, dimension| {
            placement.apply(dimension, &mut [[0.0; 3]]).expect_err("refused").to_string()
        };
        let translation = vec![1.0, 2.0];
        let words = of(Placement { translation, ..Placement::default() }, 3);
        assert!(words.contains("translate has 2 numbers") && words.contains("give 3"), "{words}");
        let rotation = Some(Rotation { angle: 1.0, axis: Some([0.0, 0.0, 1.0]) });
        assert!(of(Placement { rotation, ..Placement::default() }, 2).contains("the angle alone"));
    }
}
