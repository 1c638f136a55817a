//! Linear orthotropic elasticity: three planes of symmetry, as in wood and in composites of fibres (S. G. Lekhnitskii, Theory of
//! Elasticity of an Anisotropic Body, 1981).
//!
//! Along the axes 1, 2, 3 of the material the strains are `e_1 = s_1 / E_1 - nu_12 s_2 / E_1 - nu_13 s_3 / E_1` and so on, with `nu_21 =
//! nu_12 E_2 / E_1`, and `e_12 = s_12 / (2 G_12)`.

use super::{
    anisotropic::{Anisotropic, Matrix},
    elasticity::Hypothesis,
};
use crate::{
    laws::law::LawFault,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Orthotropic linear elasticity. A material with the same properties in all directions across axis 1 (transversely isotropic) has E2 =
/// E3, nu12 = nu13, G12 = G13 and G23 = E2 / (2 (1 + nu23)).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Orthotropic {
    /// Young's moduli E1, E2, E3 along the axes of the material, above 0.
    #[schemars(extend("unit" = "Pa"), example = [12e9, 0.8e9, 0.5e9])]
    pub youngs_moduli: [f64; 3],
    /// Poisson's ratios nu12, nu23, nu13: nuij is the contraction along axis j for an extension along axis i, under stress along axis i.
    /// They must leave the elastic energy of every strain positive.
    #[schemars(example = [0.4, 0.4, 0.4])]
    pub poisson_ratios: [f64; 3],
    /// Shear moduli G12, G23, G13, above 0.
    #[schemars(extend("unit" = "Pa"), example = [0.7e9, 0.05e9, 0.6e9])]
    pub shear_moduli: [f64; 3],
    /// In 2D the angle from the x axis to axis 1, toward the y axis; axis 3 is z, in bodies of revolution the direction around
    /// their axis. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "degrees"), example = 30.0)]
    pub angle: Option<f64>,
    /// In 3D two vectors of any length: along axis 1, and in the plane of axes 1 and 2, on the side of axis 2. Absent: x and y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])]
    pub axes: Option<[[f64; 3]; 2]>,
}

/// Sine of the angle between the given axes below which they are parallel.
const PARALLEL: f64 = 1e-6;

impl Orthotropic {
    /// The message where a law requires isotropic elasticity.
    pub const NOT_ISOTROPIC: &'static str = "this is for isotropic elasticity only";

    /// The stress-strain relation under this hypothesis; the parameters are free of [`faults`](Self::faults).
    pub fn tensor(&self, hypothesis: Hypothesis) -> Anisotropic {
        let [g12, g23, g13] = self.shear_moduli;
        let mut matrix: Matrix = [[0.0; 6]; 6];
        let normal = self.normal_stiffness();
        for i in 0..3 {
            matrix[i][..3].copy_from_slice(&normal[i]);
        }
        for (c, modulus) in [(3, g23), (4, g13), (5, g12)] {
            matrix[c][c] = 2.0 * modulus;
        }
        Anisotropic::along(&self.unit_axes(), &matrix, hypothesis)
    }

    /// `nu_21 = nu_12 E_2 / E_1`, `nu_32` and `nu_31`.
    fn other_ratios(&self) -> [f64; 3] {
        let ([e1, e2, e3], [nu12, nu23, nu13]) = (self.youngs_moduli, self.poisson_ratios);
        [nu12 * e2 / e1, nu23 * e3 / e2, nu13 * e3 / e1]
    }

    /// `1 - nu_12 nu_21 - nu_23 nu_32 - nu_13 nu_31 - 2 nu_21 nu_32 nu_13`, which must be positive.
    fn determinant(&self) -> f64 {
        let ([nu12, nu23, nu13], [nu21, nu32, nu31]) = (self.poisson_ratios, self.other_ratios());
        1.0 - nu12 * nu21 - nu23 * nu32 - nu13 * nu31 - 2.0 * nu21 * nu32 * nu13
    }

    /// The stiffness of extensions along the axes.
    fn normal_stiffness(&self) -> [[f64; 3]; 3] {
        let ([nu12, nu23, nu13], [nu21, nu32, nu31]) = (self.poisson_ratios, self.other_ratios());
        let [e1, e2, e3] = self.youngs_moduli.map(|modulus| modulus / self.determinant());
        let (c12, c13) = (e1 * (nu21 + nu31 * nu23), e1 * (nu31 + nu21 * nu32));
        let c23 = e2 * (nu32 + nu12 * nu31);
        [
            [e1 * (1.0 - nu23 * nu32), c12, c13],
            [c12, e2 * (1.0 - nu13 * nu31), c23],
            [c13, c23, e3 * (1.0 - nu12 * nu21)],
        ]
    }

    /// The axes of the material as orthogonal unit vectors.
    fn unit_axes(&self) -> [Vector<3>; 3] {
        let Some([first, second]) = self.axes else {
            let (sine, cosine) = self.angle.unwrap_or(0.0).to_radians().sin_cos();
            return [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        };
        let unit = |vector: Vector<3>| vector.map(|x| x / norm(&vector));
        let first = unit(first);
        let second = unit(add_scaled(&second, -dot(&second, &first), &first));
        let cross = |i: usize, j: usize| first[i] * second[j] - first[j] * second[i];
        [first, second, [cross(1, 2), cross(2, 0), cross(0, 1)]]
    }

    /// The faults of the parameters in this dimension; keys are those of its table.
    pub fn faults(&self, dimension: usize) -> Vec<LawFault> {
        let mut faults = Vec::new();
        let keys = [("youngs_moduli", self.youngs_moduli), ("shear_moduli", self.shear_moduli)];
        for (key, moduli) in keys {
            if let Some(at) = moduli.iter().position(|modulus| *modulus <= 0.0) {
                let message = format!("the modulus {} Pa is not positive", moduli[at]);
                faults.push(LawFault::at_value(format!("{key}.{at}"), message, "give a modulus above 0"));
            }
        }
        if faults.is_empty() {
            faults.extend(self.fault_of_ratios());
        }
        if dimension == 3 && self.angle.is_some() {
            let help = "give the directions of axes 1 and 2 as `axes`";
            faults.push(LawFault::at_key("angle", "an angle gives no axes in 3D", help));
        }
        if dimension == 2 && self.axes.is_some() {
            let help = "give the direction of axis 1 as `angle`; axis 3 is z";
            faults.push(LawFault::at_key("axes", "a body in the plane has no axes in space", help));
        }
        if let Some([first, second]) = self.axes {
            let length = norm(&first);
            let beside = add_scaled(&second, -dot(&second, &first) / (length * length), &first);
            // Also where a number is not one.
            let is_plane = length > 0.0 && norm(&beside) > PARALLEL * norm(&second);
            if !is_plane {
                let help = "give the direction of axis 1, and another one in the plane of axes 1 and 2";
                faults.push(LawFault::at_value("axes", "the two directions span no plane", help));
            }
        }
        faults
    }

    fn fault_of_ratios(&self) -> Option<LawFault> {
        let ([e1, e2, e3], [nu12, nu23, nu13]) = (self.youngs_moduli, self.poisson_ratios);
        let pairs = [("nu12", nu12, "E1/E2", e1 / e2), ("nu23", nu23, "E2/E3", e2 / e3)];
        for (at, (name, ratio, quotient, square)) in
            pairs.into_iter().chain([("nu13", nu13, "E1/E3", e1 / e3)]).enumerate()
        {
            let most = square.sqrt();
            if ratio.abs() >= most {
                return Some(LawFault::at_value(
                    format!("poisson_ratios.{at}"),
                    format!("the elastic energy of some strain is not positive: |{name}| is {}", ratio.abs()),
                    format!("|{name}| must be below sqrt({quotient}) = {most}"),
                ));
            }
        }
        let determinant = self.determinant();
        (determinant <= 0.0).then(|| {
            LawFault::at_value(
                "poisson_ratios",
                format!(
                    "the elastic energy of some strain is not positive: 1 - nu12 nu21 - nu23 nu32 - nu13 nu31 - 2 nu21 nu32 nu13 is \
                     {determinant}"
                ),
                "it must be positive, with nu21 = nu12 E2/E1, nu32 = nu23 E3/E2 and nu31 = nu13 E3/E1; take smaller ratios",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::material::LinearTensor;
    use crate::linear_algebra::tensor::Mandel;

    const WOOD: Orthotropic = Orthotropic {
        youngs_moduli: [12.0, 0.8, 0.5],
        poisson_ratios: [0.4, 0.3, 0.45],
        shear_moduli: [0.7, 0.05, 0.6],
        angle: None,
        axes: None,
    };

    #[test]
    fn stress_along_each_axis_gives_the_moduli_and_ratios() {
        let tensor = WOOD.tensor(Hypothesis::Space);
        let nu21 = 0.4 * 0.8 / 12.0;
        for (strain, at) in [
            ([1.0 / 12.0, -0.4 / 12.0, -0.45 / 12.0, 0.0, 0.0, 0.0], 0),
            ([-nu21 / 0.8, 1.0 / 0.8, -0.3 / 0.8, 0.0, 0.0, 0.0], 1),
            ([-0.45 / 12.0, -0.3 / 0.8, 1.0 / 0.5, 0.0, 0.0, 0.0], 2),
            ([0.0, 0.0, 0.0, 0.5 / 0.05, 0.0, 0.0], 3),
            ([0.0, 0.0, 0.0, 0.0, 0.5 / 0.6, 0.0], 4),
            ([0.0, 0.0, 0.0, 0.0, 0.0, 0.5 / 0.7], 5),
        ] {
            let stress: Mandel<6> = tensor.stress(&strain);
            for (c, stress) in stress.into_iter().enumerate() {
                let expected = f64::from(u8::from(c == at));
                assert!((stress - expected).abs() < 1e-13, "{at}: {stress}");
            }
        }
    }

    #[test]
    fn a_plate_turned_by_an_angle_has_the_off_axis_modulus() {
        for angle in [0.0f64, 25.0, 45.0, -70.0, 90.0] {
            let plate = Orthotropic { angle: Some(angle), ..WOOD }.tensor(Hypothesis::PlaneStress);
            let (s, c) = angle.to_radians().sin_cos();
            let of_x = c.powi(4) / 12.0 + (1.0 / 0.7 - 0.8 / 12.0) * (s * c).powi(2) + s.powi(4) / 0.8;
            // The compliance along x is the entry of the inverse: by Cramer's rule.
            let column =
                |k: usize| plate.stress(&std::array::from_fn::<f64, 3, _>(|i| f64::from(u8::from(i == k))));
            let [x, y, z] = [column(0), column(1), column(2)];
            let minor = y[1] * z[2] - y[2] * z[1];
            let determinant =
                x[0] * minor - y[0] * (x[1] * z[2] - x[2] * z[1]) + z[0] * (x[1] * y[2] - x[2] * y[1]);
            assert!((minor / determinant - of_x).abs() < 1e-13, "{angle}: {} {of_x}", minor / determinant);
        }
    }

    #[test]
    fn axes_in_space_turn_the_material() {
        let turned = Orthotropic { axes: Some([[0.0, 0.0, 3.0], [2.0, 0.0, 1.0]]), ..WOOD };
        let (found, own) = (turned.tensor(Hypothesis::Space), WOOD.tensor(Hypothesis::Space));
        // Axis 1 is z, 2 is x, 3 is y.
        let [xx, yy, zz, yz, xz, xy] = found.stress(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        let expected = own.stress(&[0.3, 0.1, 0.2, 0.6, 0.4, 0.5]);
        for (found, expected) in [zz, xx, yy, xy, yz, xz].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
    }

    #[test]
    fn energies_that_are_not_positive_are_refused_with_the_condition() {
        let fault = |law: Orthotropic, dimension: usize| {
            let faults = law.faults(dimension);
            assert!(faults.len() <= 1, "{faults:?}");
            faults.into_iter().next().map(|fault| format!("{}: {}; {}", fault.key, fault.message, fault.help))
        };
        assert_eq!((fault(WOOD, 2), fault(WOOD, 3)), (None, None));
        let of_ratios = |poisson_ratios| fault(Orthotropic { poisson_ratios, ..WOOD }, 3).expect("a fault");
        assert!(of_ratios([3.9, 0.3, 0.4]).ends_with("|nu12| must be below sqrt(E1/E2) = 3.872983346207417"));
        assert!(of_ratios([0.4, -1.3, 0.4]).starts_with("poisson_ratios.1: the elastic energy"));
        assert!(of_ratios([2.6, 0.8, 3.3]).contains("2 nu21 nu32 nu13 is -"));
        let moduli = Orthotropic { shear_moduli: [0.7, 0.0, 1.0], ..WOOD };
        assert!(fault(moduli, 2).expect("a fault").starts_with("shear_moduli.1: the modulus 0 Pa"));
        let axes = Some([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]]);
        assert!(fault(Orthotropic { axes, ..WOOD }, 3).expect("a fault").contains("span no plane"));
        assert!(fault(Orthotropic { angle: Some(3.0), ..WOOD }, 3).expect("a fault").starts_with("angle"));
        let axes = Some([[1.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
        assert!(fault(Orthotropic { axes, ..WOOD }, 2).expect("a fault").starts_with("axes: a body"));
    }
}
