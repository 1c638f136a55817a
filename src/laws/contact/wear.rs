//! Wear: the surface of the body recedes where it slides under pressure (Archard, J. Appl. Phys. 24, 1953, 981-988).
//!
//! The depth of wear grows with the pressure `p` of the normal law and the sliding velocity `v` relative to the obstacle, and adds to the
//! gap:
//!
//! ```text
//! w' = coefficient max(p, 0) |v|
//! ```
//!
//! In a step the gap contains the depth at its start; afterwards the depth grows by `coefficient max(p_n, 0) |v_n| k`. The pressure
//! therefore follows the wear with an error of first order in the step.

use super::interface::Interface;
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Wear of the body's surface. With every time scheme, the depth of wear has an error of first order in the step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// Specific wear rate: worn volume per normal force and slip distance, or Archard's coefficient divided by the hardness.
    #[schemars(range(min = 0), extend("unit" = "1/Pa"), example = 1e-13)]
    pub coefficient: f64,
}

impl Wear {
    /// What is missing beside it, and what it cannot be combined with; keys are those of the table of the contact.
    pub(super) fn faults(interface: &Interface, has_histories: bool) -> Vec<LawFault> {
        let fault = |message: &str, help: &str| LawFault::at_key("wear", message, help);
        let normal = interface.normal.as_ref();
        let without_gap = normal.is_some_and(|law| !law.has_gap()).then(|| {
            fault(
                "the normal law has no gap that wear could widen",
                "use normal.unilateral or normal.compliance",
            )
        });
        let without_friction = interface.friction.is_none().then(|| {
            let help = "add friction.coulomb, with coefficient = 0 if the surface is smooth";
            fault("wear needs a friction law, whose sliding velocity it uses", help)
        });
        let beside_histories = has_histories.then(|| {
            fault(
                "wear cannot be combined with adhesion or memory, which depend on the displacement alone",
                "delete one of them",
            )
        });
        without_gap.into_iter().chain(without_friction).chain(beside_histories).collect()
    }

    /// Depth in m that is worn off at this pressure in Pa on a way of this length in m.
    pub fn depth(&self, pressure: f64, way: f64) -> f64 {
        self.coefficient * pressure.max(0.0) * way
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wear_is_proportional_to_pressure_and_way() {
        let steel = Wear { coefficient: 2e-13 };
        assert_eq!(steel.depth(1e6, 3.0), 2e-13 * 1e6 * 3.0);
        assert_eq!(steel.depth(-1e6, 3.0), 0.0, "pulling wears nothing off");
    }
}
