//! Smooth fields with all their derivatives, as numbers and as expressions for job files.

use std::f64::consts::FRAC_PI_2;

/// `sin(number s + phase)` of one variable `s`.
#[derive(Debug, Clone, Copy)]
pub struct Wave {
    pub number: f64,
    pub phase: f64,
}

impl Wave {
    /// The derivative of this order.
    pub fn value(&self, order: i32, s: f64) -> f64 {
        self.number.powi(order) * (self.number * s + self.phase + f64::from(order) * FRAC_PI_2).sin()
    }

    pub fn text(&self, order: i32, variable: &str) -> String {
        let phase = self.phase + f64::from(order) * FRAC_PI_2;
        format!("{}*sin({}*{variable}+{phase})", self.number.powi(order), self.number)
    }
}

/// `u_i = T(t) product over j of waves[i][j](x_j)`.
#[derive(Debug, Clone)]
pub struct Field<const D: usize> {
    pub time: Wave,
    pub waves: [[Wave; D]; D],
}

/// One derivative along each of these axes.
pub type Along<'a> = &'a [usize];

impl<const D: usize> Field<D> {
    fn orders(along: Along<'_>) -> [i32; D] {
        std::array::from_fn(|axis| along.iter().filter(|&&a| a == axis).count() as i32)
    }

    /// A derivative of the spatial factor of component `i`.
    pub fn value(&self, i: usize, along: Along<'_>, x: &[f64; D]) -> f64 {
        let orders = Self::orders(along);
        (0..D).map(|j| self.waves[i][j].value(orders[j], x[j])).product()
    }

    pub fn text(&self, i: usize, along: Along<'_>) -> String {
        let orders = Self::orders(along);
        (0..D).map(|j| self.waves[i][j].text(orders[j], ["x", "y", "z"][j])).collect::<Vec<_>>().join("*")
    }
}
