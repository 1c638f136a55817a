//! A contact pressure that is written in the job as a formula of the normal velocity or of the penetration.
//!
//! The paper's law (72) for any locally Lipschitz potential `j`: its derivative is the formula, and where the formula jumps upward the
//! graph is Clarke's subdifferential. What a certificate needs, the steepest decrease, is an enclosure and thus proven (see
//! [`Curve`]).

use crate::laws::contact::{
    curve::{Curve, StoringCurve},
    normal_law::{NodeContext, NormalParameters, Resolved, Response, response_calls},
    penetration_law::PenetrationLaw,
};
use crate::{
    error::{Error, Result},
    laws::{
        expression::{Formula, OfMotion, Scalar, Variable},
        law::{Derived, LawFault},
    },
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact pressure as a formula of the normal velocity v or of the penetration d.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureFormula {
    /// Pressure as a formula of the normal velocity v in m/s, positive toward the obstacle, or of the penetration d in m, negative where
    /// the gap is open. It may decrease, but not without bound, and jump upward, but not downward; a pressure of d vanishes where the
    /// gap is wide open.
    #[schemars(extend("unit" = "Pa"), example = &"if(v < 0, 0, 4e3*v*exp(-v/0.02))")]
    pub pressure: Formula<OfMotion>,
    /// Gap: distance from the undeformed boundary to the obstacle along the outward normal, as a number or an expression in the
    /// time t and the undeformed coordinates x, y, z; for a pressure of d. inf: no obstacle. Absent: 0, or the distance to
    /// [contact.obstacle] if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("infinite" = true, "unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
    #[serde(skip)]
    law: Derived<Result<FormulaLaw, [String; 2]>>,
}

/// The evaluation of a [`PressureFormula`].
#[derive(Debug, Clone, PartialEq)]
pub enum FormulaLaw {
    /// Of the normal velocity.
    Velocity(Box<Curve>),
    /// Of the penetration.
    Penetration(Box<PenetrationLaw<StoringCurve>>),
}

impl PressureFormula {
    fn is_of_penetration(&self) -> bool {
        self.pressure.uses(Variable::D)
    }

    /// With this formula.
    pub fn new(pressure: Formula<OfMotion>, gap: Option<Scalar>) -> Self {
        Self { pressure, gap, law: Derived::default() }
    }

    fn law(&self) -> Result<FormulaLaw, [String; 2]> {
        self.law.get(|| self.find_law()).clone()
    }

    fn find_law(&self) -> Result<FormulaLaw, [String; 2]> {
        match (self.pressure.uses(Variable::V), self.is_of_penetration()) {
            (true, true) => Err(["the pressure depends on v and on d".into(), "use one of them".into()]),
            (_, true) => {
                let curve = Curve::new(self.pressure.clone(), Variable::D)?;
                Ok(FormulaLaw::Penetration(Box::new(PenetrationLaw(StoringCurve::new(curve)?))))
            }
            (_, false) => {
                Curve::new(self.pressure.clone(), Variable::V).map(Box::new).map(FormulaLaw::Velocity)
            }
        }
    }
}

impl NormalParameters for PressureFormula {
    type Response = FormulaLaw;

    fn response(&self) -> Result<FormulaLaw> {
        self.law().map_err(|[message, help]| Error::Refused(format!("{message}: {help}")))
    }

    fn gap(&self) -> Option<&Scalar> {
        self.gap.as_ref()
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let mut faults = Vec::new();
        if let Err([message, help]) = self.law() {
            faults.push(LawFault::at_value("pressure", message, help));
        }
        if self.gap.is_some() && !self.is_of_penetration() {
            let help = "delete the gap, or write the pressure as a formula of the penetration d";
            faults.push(LawFault::at_key(
                "gap",
                "a pressure of the velocity does not depend on the gap",
                help,
            ));
        }
        faults
    }

    fn against_obstacle(&self, name: &str) -> Option<[String; 2]> {
        (!self.is_of_penetration()).then(|| {
            let help = "write the pressure as a formula of the penetration d, or delete the obstacle".into();
            [format!("the pressure of `{name}` does not depend on the distance to an obstacle"), help]
        })
    }
}

macro_rules! each_form {
    ($family:ident, $chosen:expr, $bound:ident => $what:expr) => {
        match $chosen {
            $family::Velocity(law) => {
                let $bound = &**law;
                $what
            }
            $family::Penetration(law) => {
                let $bound = &**law;
                $what
            }
        }
    };
}

impl Response for FormulaLaw {
    response_calls! { each_form FormulaLaw }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{
        DampedResponse, DisplacementGraph, ExponentialDamper, NormalLaw, NormalResponse, Symmetry,
    };
    use proptest::prelude::*;

    fn by_formula(text: &str) -> NormalResponse {
        NormalLaw::PressureFormula(PressureFormula::new(Formula::parse(text).unwrap(), None))
            .response()
            .unwrap()
    }

    /// Laws of the list, each with its formula.
    fn pairs() -> Vec<(NormalResponse, NormalResponse)> {
        let built_in = [
            NormalLaw::DampedResponse(DampedResponse {
                breakpoints: vec![0.003, 0.005],
                slopes: vec![10.0, -10.0, 10.0],
                symmetry: Symmetry::Even,
            }),
            NormalLaw::ExponentialDamper(ExponentialDamper { limit: 10.0, velocity: 0.02 }),
            NormalLaw::Graph(crate::laws::contact::Graph {
                points: vec![[0.0, 0.0], [0.002, 0.0], [0.002, 0.05], [0.004, 0.03]],
                slope_before: 1.0,
                slope_after: 2.0,
            }),
            NormalLaw::DisplacementGraph(DisplacementGraph {
                points: vec![[-4e-3, 0.0], [-1e-3, -2.0], [0.0, 0.0]],
                slope_after: 1e4,
                gap: None,
            }),
            NormalLaw::Compliance(crate::laws::contact::Compliance {
                stiffness: 300.0,
                exponent: 1.5,
                damping: 0.0,
                gap: None,
            }),
        ];
        let formulas = [
            "if(abs(v) < 0.003, 10*abs(v), if(abs(v) < 0.005, 0.06 - 10*abs(v), 10*abs(v) - 0.04))",
            "if(v <= 0, 0, 10*(1 - exp(-v/0.02)))",
            "if(v < 0, v, if(v < 0.002, 0, if(v < 0.004, 0.07 - 10*v, 2*v + 0.022)))",
            "if(d < -1e-3, min(0, -2/3*1e3*(d + 4e-3)), if(d < 0, 2e3*d, 1e4*d))",
            "300*max(d, 0)^1.5",
        ];
        built_in.map(|law| law.response().unwrap()).into_iter().zip(formulas.map(by_formula)).collect()
    }

    #[test]
    fn built_in_laws_written_as_formulas_have_their_numbers() {
        let node = NodeContext { penetration: -1e-3, step_length: 0.5, ..NodeContext::default() };
        let conserving = NodeContext { mean_from: Some(-0.7e-3), ..node };
        for (number, (law, written)) in pairs().into_iter().enumerate() {
            let c = 2.0 * law.monotonicity_constant(0.5) + 1.0;
            let [found, wanted] = [&written, &law].map(|law| law.monotonicity_constant(0.5));
            assert!(wanted <= found + 1e-12 && found <= 1.011 * wanted, "{number}: {found} for {wanted}");
            assert_eq!(law.has_vertical_parts(), written.has_vertical_parts());
            assert_eq!(law.is_zero(), written.is_zero());
            for node in [node, conserving] {
                if number < 3 && node.mean_from.is_some() {
                    continue;
                }
                for step in -40..=40 {
                    let s = c * 4e-4 * f64::from(step) + 1e-7;
                    let [a, b] = [&law, &written].map(|law| law.resolve(s, c, node));
                    let size = (s / c).abs().max(1e-3);
                    assert!((a.velocity - b.velocity).abs() < 1e-12 * size, "{number} {s}: {a:?} {b:?}");
                    assert!((a.pressure - b.pressure).abs() < 1e-10 * c * size, "{number} {s}: {a:?} {b:?}");
                    assert!((a.derivative - b.derivative).abs() < 1e-6 / c, "{number} {s}: {a:?} {b:?}");
                    let off = written.distance(a.velocity, a.pressure, node, [1e-3, 1e-2]);
                    assert!(off < 1e-9, "{number} {s}: {off}");
                }
            }
            for step in -50..50 {
                let d = 1.3e-4 * f64::from(step);
                match (law.energy(d), written.energy(d)) {
                    (Some(a), Some(b)) => {
                        assert!((a - b).abs() < 1e-12 * (1e-3 + a.abs()), "{number} {d}: {a} {b}")
                    }
                    (a, b) => assert_eq!(a, b),
                }
            }
            let far = [&law, &written].map(|law| law.energy(f64::NEG_INFINITY).unwrap_or(0.0));
            assert!((far[0] - far[1]).abs() < 1e-12, "{number}: {far:?}");
        }
    }

    #[test]
    fn formulas_that_have_no_certificate_are_refused_with_place_and_remedy() {
        for (text, message, help) in [
            ("if(v < 0.1, 3*v, 0.2)", "at v = 0.1 the pressure falls from 0.3 to 0.2", "theta of a step"),
            ("exp(-v)", "falls without bound near v = -", "max(min(v, 1), -1)"),
            ("v^2", "falls without bound near v = -", "max(min(v, 1), -1)"),
            ("-v^3", "falls without bound near v = ", "max(min(v, 1), -1)"),
            ("1/(v + 0.5)", "no value near v = -0.5", "denominators"),
            ("sqrt(v)", "no value near v = -", "sqrt(max(v, 0))"),
            ("floor(v)", "too many pieces", "1000"),
            ("1e4*max(d, 0) + 3*v", "depends on v and on d", "use one of them"),
            ("1e4*d", "far from the obstacle", "max(d, 0)"),
        ] {
            let faults = PressureFormula::new(Formula::parse(text).unwrap(), None).own_faults();
            assert!(faults.len() == 1 && faults[0].key == "pressure", "{text}: {faults:?}");
            assert!(
                faults[0].message.contains(message) && faults[0].help.contains(help),
                "{text}: {faults:?}"
            );
        }
        let pressure = Formula::parse("v").unwrap();
        let faults = PressureFormula::new(pressure, Some(Scalar::Number(1.0))).own_faults();
        assert!(faults.len() == 1 && faults[0].key == "gap" && faults[0].is_at_key, "{faults:?}");
    }

    #[test]
    fn bounds_by_hand() {
        let damper = by_formula("if(v < 0, 0, 4e3*v*exp(-v/0.02))");
        let wanted = 4e3 * (-2.0_f64).exp();
        let found = damper.monotonicity_constant(1.0);
        assert!(wanted <= found && found <= 1.011 * wanted, "{found}");
        let top = 4e3 * 0.02 * (-1.0_f64).exp();
        assert!(top <= damper.greatest_pressure() && damper.greatest_pressure() <= 1.011 * top);
        assert_eq!(by_formula("5*v").growth_constants(), Ok([0.0, 5.0]));
        assert_eq!(
            (by_formula("5*v").greatest_pressure(), by_formula("5*v").monotonicity_constant(1.0)),
            (f64::INFINITY, 0.0)
        );
        assert_eq!(by_formula("10*sign(v)").growth_constants(), Ok([10.0, 0.0]));
        let root = by_formula("20*sqrt(max(v, 0))");
        assert!(
            root.has_vertical_parts()
                && root.growth_constants().is_ok_and(|[c0, c1]| c0 <= 21.0 && c1 <= 11.0)
        );
        let slow = root.resolve(1e-9, 1.0, NodeContext::AT_THE_GAP);
        assert!((slow.velocity + slow.pressure - 1e-9).abs() < 1e-22, "{slow:?}");
        assert!(by_formula("v^3").growth_constants().is_err());
        assert!(by_formula("0*v").is_zero() && by_formula("0").is_zero() && !by_formula("3").is_zero());
        // Bonds that soften exponentially: nonzero everywhere, with an energy of 3 Pa times 1 mm.
        let bond = by_formula("if(d < 0, 3e3*d*exp(d/1e-3), 1e6*d)");
        assert!((bond.energy(f64::NEG_INFINITY).unwrap() - 3e-3).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn the_resolvent_finds_every_point_of_the_graph(number in 0_usize..6, s in -3.0f64..3.0, more in 1.05f64..5.0) {
            let texts = [
                "if(v < 0, 0, 4e3*v*exp(-v/0.02))", "sign(v)*(1 + 2/(1 + abs(v)))", "tanh(v/1e-3)", "v^3 + 0.1*sin(20*v)",
                "interpolate(v, -1, -1, -0.5, 3, 0, -2, 0.1, 4)", "if(v > 0.1, 3*sqrt(v - 0.1), 0)",
            ];
            let law = by_formula(texts[number]);
            let c = more * law.monotonicity_constant(1.0) + 0.5;
            let s = s * c;
            let node = NodeContext::AT_THE_GAP;
            let found = law.resolve(s, c, node);
            prop_assert!((c * found.velocity + found.pressure - s).abs() <= 1e-12 * s.abs().max(c), "{:?}", found);
            prop_assert!(law.distance(found.velocity, found.pressure, node, [1.0, 1.0]) < 1e-11);
            prop_assert!(found.derivative >= 0.0);
            let h = 1e-6 * c;
            let [above, below] = [law.resolve(s + h, c, node), law.resolve(s - h, c, node)];
            if above.branch == below.branch && (above.derivative / below.derivative - 1.0).abs() < 0.01 {
                let quotient = (above.velocity - below.velocity) / (2.0 * h);
                prop_assert!((quotient - found.derivative).abs() <= 0.02 * found.derivative + 1e-9 / c, "{} {:?}", quotient, found);
            }
        }
    }
}
