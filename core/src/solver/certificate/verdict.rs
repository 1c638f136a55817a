//! The consequences of the certificates for a run.

use super::Certificates;
use crate::{job::Accept, laws::digits::Digits};

/// The outcome.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Verdict {
    /// One for each certificate: its value, its meaning, and possible changes.
    pub details: Vec<Statement>,
    /// What of this a run tells: whether steps have one solution and are stable.
    pub brief: Vec<Statement>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Reasons for a refusal of the run: message and advice.
    pub refusals: Vec<(String, String)>,
}

/// What certificates say of the steps of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statement {
    /// Whether it is a guarantee.
    pub is_certified: bool,
    /// A clause.
    pub words: String,
}

impl Statement {
    fn certain(words: String) -> Self {
        Self { is_certified: true, words }
    }

    fn uncertain(words: String) -> Self {
        Self { is_certified: false, words }
    }

    /// As a line of the log.
    pub fn line(&self) -> String {
        let title = if self.is_certified { "certified" } else { "uncertain" };
        format!("{title}  {}", self.words)
    }
}

/// The share of the coefficient of friction that it may lose in a step of `lagged_euler`: half of the least at which errors were measured in
/// the problems of docs/user-guide.md, many of which bear a hundred times as much. And the share of the stability bound up to which steps
/// are short enough for any.
const LAGGING_FALL: f64 = 2e-3;
const LAGGING_STEP: f64 = 0.02;
/// The share of a step below which the stability bound is a rounding error of 0.
const NOTHING: f64 = 1e-9;
/// What to do where several solutions are not excluded.
const SEARCH: &str = "[solver] guesses = 10 searches each step for others";
/// Why a supremum is infinite.
const RIGID: &str = "(the supports do not prevent a rigid motion against the contact)";

impl Certificates {
    /// Evaluates the certificates for a fixed step of this length. `unique_step` is the largest step for which `theta_step` is
    /// below 1 by the margin, if it is known; `accepted` lists the limits that the job may exceed.
    pub fn verdict(&self, step: f64, unique_step: Option<f64>, accepted: &[Accept]) -> Verdict {
        let mut verdict = Verdict::default();
        let not_covered = self.not_covered.iter().map(|words| format!("not covered: {words}"));
        verdict.details.extend(not_covered.map(Statement::uncertain));
        if !self.not_covered.is_empty() && self.theta_step.is_some() {
            let search = format!("where several solutions are not excluded, {SEARCH}");
            verdict.details.push(Statement::uncertain(search));
        }
        // Laws that neither decrease nor are bounded have nothing to tell.
        let decreases = |fall: &f64| *fall > 0.0 || self.growth_constants.is_some();
        if let Some(fall) = self.monotonicity_constant.filter(decreases) {
            let words = format!("m_j = {} Pa s/m, {}", Digits(fall), self.growth());
            verdict.details.push(Statement::certain(words));
        }
        let covered = if self.not_covered.is_empty() { "" } else { ", except for what is not covered" };
        if let Some(theta) = self.theta {
            let size =
                if theta == f64::INFINITY { format!("infinite {RIGID}") } else { Digits(theta).to_string() };
            let meaning = if theta < 1.0 {
                "below 1: the continuous problem has one solution"
            } else {
                verdict.warnings.push(format!(
                    "theta = {size} is not below 1: the continuous problem may have several solutions; to \
                     exclude this, {} or use a contact law that decreases less steeply",
                    if theta == f64::INFINITY { "add supports" } else { "increase the viscosity" }
                ));
                "not below 1: the continuous problem may have several solutions"
            };
            let words = format!("theta = {size}, {meaning}{covered}");
            verdict.details.push(Statement { is_certified: theta < 1.0, words });
        }
        let fall = self.monotonicity_constant.filter(decreases);
        let fall = fall.filter(|_| self.decrease_with_displacement.is_none());
        if let (Some(modulus), Some(fall)) = (self.viscosity_modulus, fall) {
            let product = match self.trace_norm_squared {
                Some(trace) => fall * trace,
                None if fall > 0.0 => f64::INFINITY,
                None => 0.0,
            };
            let is_certified = modulus > product;
            let (sign, meaning) = if is_certified { (">", "holds") } else { ("<=", "does not hold") };
            let size = if product < f64::INFINITY {
                format!("{} Pa s", Digits(product))
            } else {
                format!("infinite {RIGID}")
            };
            let words = format!(
                "m_A = {} Pa s {sign} m_j |gamma|^2 = {size}: condition (13) of Wang and Cheng (2022) {meaning}",
                Digits(modulus)
            );
            verdict.details.push(Statement { is_certified, words });
        }
        if let Some(theta) = self.theta_step {
            if self.steps_are_unique() {
                let steps = self.steps_in_words();
                verdict.brief.push(self.unique_steps(&steps));
                verdict.details.push(Statement::certain(format!(
                    "theta of a step = {}, below 1: each step{steps} has one solution{covered}",
                    Digits(theta)
                )));
            } else {
                let steps = self.step_range.unwrap_or([step; 2]);
                verdict.uniqueness(theta, steps, unique_step, accepted.contains(&Accept::Uniqueness));
            }
        }
        if let Some(bound) = self.explicit_step_bound {
            verdict.stability(self, bound, step, accepted.contains(&Accept::ExplicitStability));
            if let Some(flowing) = self.flowing_step_bound.filter(|flowing| (*flowing..bound).contains(&step))
            {
                verdict.warnings.push(format!(
                    "the step of {1} s exceeds {0} s: errors may grow where most of the body flows; a step below \
                     {0} s or an implicit scheme prevents this",
                    Digits(flowing),
                    Digits(step)
                ));
            }
        }
        verdict
    }

    /// A warning about friction that fell by this share of its coefficient in a step of `lagged_euler`, in steps up to this length in s: the
    /// stress of such a step is that at its start, which drives what weakens too far.
    pub fn lagging_friction(&self, fall: Option<f64>, longest: f64) -> Option<String> {
        let fall = fall.filter(|fall| *fall > LAGGING_FALL)?;
        let bound = self.explicit_step_bound.filter(|bound| longest > LAGGING_STEP * bound)?;
        Some(format!(
            "friction lost up to {} % of its coefficient in one step: lagged_euler takes the stress at the start of the step, so that slip \
             which weakens friction goes too far, in ruptures that spread on their own by up to tens of times this share, although steps \
             are stable up to {} s; use [time] scheme = \"bdf2\" or \"implicit_euler\"",
            Digits(100.0 * fall),
            Digits(bound)
        ))
    }

    /// In one line, whether steps of these lengths have one solution, where theta of a step is below 1.
    fn unique_steps(&self, steps: &str) -> Statement {
        let bound = self.slip_pressure_bound.filter(|bound| *bound > 0.0);
        let covered = bound.map_or_else(String::new, |bound| {
            format!(" for given contact pressures up to {} Pa", Digits(bound))
        });
        let reasons = self.not_covered.iter().filter_map(|words| words.split([':', ',', ';']).next());
        let reasons: Vec<&str> =
            reasons.filter(|words| bound.is_none() || !words.contains("friction")).collect();
        let is_certified = reasons.is_empty() || bound.is_some();
        let words = match reasons.as_slice() {
            [] => format!("each step{steps} has one solution{covered}"),
            _ if bound.is_none() => {
                format!("several solutions of a step are not excluded: {}; {SEARCH}", reasons.join("; "))
            }
            _ => format!(
                "each step{steps} has one solution{covered}, which does not cover: {}; {SEARCH}",
                reasons.join("; ")
            ),
        };
        Statement { is_certified, words }
    }

    /// The verdict on the growth of contact pressures with the velocity.
    fn growth(&self) -> String {
        match (self.growth_constants, &self.unbounded_growth) {
            (Some([rest, slope]), _) => format!(
                "|dj(r)| <= {} Pa + {} Pa s/m |r|: the contact pressure grows at most linearly with the velocity r, as hypothesis H(j) of Wang and Cheng (2022) requires",
                Digits(rest),
                Digits(slope)
            ),
            (None, Some(why)) => format!("{why}: hypothesis H(j) does not apply"),
            (None, None) => "growth constant unknown".into(),
        }
    }
}

impl Verdict {
    /// The verdict on a `theta` of a step that is not below 1 by the margin.
    fn uniqueness(
        &mut self,
        theta: f64,
        [shortest, longest]: [f64; 2],
        unique_step: Option<f64>,
        accepted: bool,
    ) {
        let steps = if shortest == longest {
            format!("a step of {} s", Digits(longest))
        } else {
            format!("a step between {} and {} s", Digits(shortest), Digits(longest))
        };
        let found = format!(
            "theta of a step = {} is not below {}: {steps} may have several solutions",
            Digits(theta),
            if theta < 1.0 { 1.0 - Certificates::MARGIN } else { 1.0 }
        );
        self.doubt(&found);
        let largest = unique_step.map_or_else(
            || {
                let longer = if shortest < longest {
                    "; where a law decreases with the velocity, longer steps are safer, and [time] end, land_on, output times or \
                     smallest_step allow the shortest"
                } else {
                    ""
                };
                format!(
                    "no step is short enough: contact boundaries have no mass, because [material] density is absent or because of \
                     redistribute_mass{longer}"
                )
            },
            |largest| format!("the largest step with one solution is {} s", Digits(largest)),
        );
        self.judge(
            found,
            format!("{largest}; or accept it with [solver] accept = [\"uniqueness\"]"),
            accepted,
        );
    }

    fn stability(&mut self, known: &Certificates, bound: f64, step: f64, accepted: bool) {
        let least_bound = Digits(bound);
        let (is_least, follows_stress) = (known.explicit_bound_is_least, known.explicit_bound_follows_stress);
        if step < bound {
            let least = if is_least { "at least " } else { "" };
            let power = if follows_stress {
                "; for power laws this bound holds only while the overstress is at most the yield stress; each step checks the bound at the current stress"
            } else {
                ""
            };
            let stable = format!("steps are stable up to {least}{least_bound} s");
            self.details.push(Statement::certain(format!(
                "{stable} (elastic and viscoplastic stress, adhesion and contact memory are explicit){power}"
            )));
            self.brief.push(Statement::certain(stable));
            return;
        }
        let accepts = "or accept it with [solver] accept = [\"explicit_stability\"]";
        let (found, remedy) = if bound < NOTHING * step {
            (
                "no step is stable: lagged_euler takes forces of springs and stresses at the start of the step, and nothing viscous and no mass \
                 resists a motion that only they hold, such as a rigid motion of a body on springs, or flow relaxes stresses within far less"
                    .to_owned(),
                format!(
                    "give supports with `stiffness` also `damping`, the material a `density` or flow a longer `relaxation`, use [time] scheme = \
                     \"implicit_euler\" or \"bdf2\", {accepts}"
                ),
            )
        } else {
            (
                format!(
                    "the step of {} s exceeds {least_bound} s, above which explicit stresses amplify errors",
                    Digits(step)
                ),
                format!("use a step below {least_bound} s, [time] scheme = \"implicit_euler\", {accepts}"),
            )
        };
        self.doubt(&found);
        self.judge(found, remedy, accepted);
    }

    /// States in full and in brief what is not certified.
    fn doubt(&mut self, found: &str) {
        for statements in [&mut self.details, &mut self.brief] {
            statements.push(Statement::uncertain(found.to_owned()));
        }
    }

    fn judge(&mut self, found: String, remedy: String, accepted: bool) {
        if accepted {
            self.warnings.push(format!("{found}; accepted by the job"));
        } else {
            self.refusals.push((found, remedy));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper() -> Certificates {
        Certificates {
            theta: Some(0.3855),
            theta_step: Some(0.2),
            step_range: None,
            range: None,
            covers_steps: true,
            viscosity_modulus: Some(50.0),
            monotonicity_constant: Some(10.0),
            growth_constants: Some([0.0, 10.0]),
            unbounded_growth: None,
            trace_norm_squared: Some(2.24),
            slip_pressure_bound: None,
            explicit_step_bound: Some(0.12),
            explicit_bound_is_least: false,
            explicit_bound_follows_stress: false,
            flowing_step_bound: Some(0.08),
            decrease_with_displacement: None,
            not_covered: Vec::new(),
        }
    }

    #[test]
    fn a_sound_problem_is_neither_refused_nor_warned_of() {
        let verdict = paper().verdict(1.0 / 64.0, None, &[]);
        assert!(verdict.refusals.is_empty() && verdict.warnings.is_empty());
        assert!(verdict.details[2].words.contains("> m_j |gamma|^2 = 22.4"));
        assert!(verdict.details.iter().all(|one| one.is_certified), "{:?}", verdict.details);
    }

    #[test]
    fn details_say_which_of_them_are_certain() {
        let weakens = vec!["the friction traction decreases".into()];
        let doubtful = Certificates {
            not_covered: weakens,
            theta: Some(1.5),
            theta_step: Some(1.5),
            monotonicity_constant: Some(1e9),
            explicit_step_bound: Some(1e-9),
            ..paper()
        };
        let details = doubtful.verdict(1.0 / 64.0, None, &[]).details;
        let certain: Vec<_> = details.iter().filter(|one| one.is_certified).collect();
        assert!(
            details.len() == 7 && matches!(certain[..], [one] if one.words.starts_with("m_j = ")),
            "{details:?}"
        );
    }

    #[test]
    fn a_run_tells_whether_steps_have_one_solution_and_why_not() {
        let brief = |known: Certificates| {
            let brief = known.verdict(1.0 / 64.0, None, &[]).brief;
            brief.iter().map(Statement::line).collect::<Vec<_>>()
        };
        let stable = "certified  steps are stable up to 0.12 s";
        assert_eq!(brief(paper()), ["certified  each step has one solution", stable]);
        let weakens = || vec!["the friction traction decreases: theta does not cover this".into()];
        let known = Certificates { not_covered: weakens(), slip_pressure_bound: Some(1.8e5), ..paper() };
        assert_eq!(
            brief(known)[0],
            "certified  each step has one solution for given contact pressures up to 180000 Pa"
        );
        let mut both = weakens();
        both.push("damage may soften the body: theta does not take it into account".into());
        let known = Certificates { not_covered: both, slip_pressure_bound: Some(0.0), ..paper() };
        assert_eq!(
            brief(known)[0],
            "uncertain  several solutions of a step are not excluded: the friction traction decreases; damage may soften the body; [solver] guesses = 10 searches \
             each step for others"
        );
        let known = Certificates { theta_step: Some(1.5), ..paper() };
        assert!(brief(known)[0].contains("may have several solutions"));
    }

    #[test]
    fn growth_stands_beside_the_monotonicity_constant() {
        let first = |known: Certificates| known.verdict(1.0 / 64.0, None, &[]).details[0].words.clone();
        assert_eq!(
            first(paper()),
            "m_j = 10 Pa s/m, |dj(r)| <= 0 Pa + 10 Pa s/m |r|: the contact pressure grows at most linearly with the velocity r, as hypothesis H(j) of Wang and Cheng (2022) requires"
        );
        let why = Some("the growth constant is infinite".into());
        let wall = first(Certificates { growth_constants: None, unbounded_growth: why, ..paper() });
        assert!(
            wall.ends_with("Pa s/m, the growth constant is infinite: hypothesis H(j) does not apply"),
            "{wall}"
        );
    }

    #[test]
    fn a_rigid_motion_against_the_contact_leaves_the_condition_to_laws_that_never_fall() {
        let words = |fall: f64| {
            let known =
                Certificates { trace_norm_squared: None, monotonicity_constant: Some(fall), ..paper() };
            known.verdict(1.0 / 64.0, None, &[]).details[2].words.clone()
        };
        assert_eq!(
            words(0.0),
            "m_A = 50 Pa s > m_j |gamma|^2 = 0 Pa s: condition (13) of Wang and Cheng (2022) holds"
        );
        assert!(words(0.1).contains("<= m_j |gamma|^2 = infinite") && words(0.1).contains("does not hold"));
    }

    #[test]
    fn laws_that_neither_decrease_nor_are_bounded_are_not_spoken_of() {
        let rigid = Certificates { monotonicity_constant: Some(0.0), growth_constants: None, ..paper() };
        let details = rigid.verdict(1.0 / 64.0, None, &[]).details;
        assert!(details.len() > 1 && !details.iter().any(|one| one.words.contains("m_j")), "{details:?}");
    }

    #[test]
    fn theta_beyond_one_alone_warns() {
        for (theta, size) in
            [(1.5, "theta = 1.5 is not"), (f64::INFINITY, "theta = infinite (the supports do not")]
        {
            let known = Certificates { theta: Some(theta), ..paper() };
            let verdict = known.verdict(1.0 / 64.0, None, &[]);
            assert!(verdict.refusals.is_empty() && verdict.warnings.len() == 1);
            assert!(verdict.warnings[0].starts_with(size), "{:?}", verdict.warnings);
        }
    }

    #[test]
    fn a_bound_that_is_only_the_least_is_said_to_be_that() {
        let known = Certificates { explicit_bound_is_least: true, ..paper() };
        let details = known.verdict(0.01, None, &[]).details;
        assert!(details.iter().any(|one| one.words.starts_with("steps are stable up to at least 0.12 s")));
    }

    #[test]
    fn suprema_found_from_below_keep_a_margin_to_one() {
        let verdict =
            |theta| Certificates { theta_step: Some(theta), ..paper() }.verdict(0.01, Some(0.05), &[]);
        assert!(verdict(0.998).refusals.is_empty());
        for theta in [0.9995, f64::NAN] {
            assert_eq!(verdict(theta).refusals.len(), 1, "{theta}");
        }
        assert!(verdict(0.9995).refusals[0].0.contains("theta of a step = 0.9995 is not below 0.999: "));
    }

    #[test]
    fn the_bound_of_power_laws_says_where_it_holds() {
        let known = Certificates { explicit_bound_follows_stress: true, ..paper() };
        let details = known.verdict(0.01, None, &[]).details;
        assert!(
            details.iter().any(|one| one.words.contains("each step checks the bound at the current stress"))
        );
    }

    #[test]
    fn a_step_that_is_stable_while_little_flows_is_warned_of() {
        let verdict = paper().verdict(0.1, None, &[]);
        assert!(verdict.refusals.is_empty() && verdict.warnings[0].contains("exceeds 0.08 s"));
        assert!(paper().verdict(0.079, None, &[]).warnings.is_empty());
    }

    #[test]
    fn a_step_beyond_a_bound_is_refused_unless_accepted_and_the_largest_step_is_named() {
        let known = Certificates { theta_step: Some(1.2), ..paper() };
        let refused = known.verdict(0.125, Some(0.05), &[]);
        assert_eq!(refused.refusals.len(), 2);
        assert!(refused.refusals[0].1.contains("0.05 s") && refused.refusals[1].1.contains("0.12 s"));
        assert!(refused.refusals[1].1.contains("scheme = \"implicit_euler\""), "{:?}", refused.refusals[1]);
        let all = [Accept::Uniqueness, Accept::ExplicitStability];
        let accepted = known.verdict(0.125, Some(0.05), &all);
        assert!(accepted.refusals.is_empty() && accepted.warnings.len() == 2);
    }

    #[test]
    fn a_bound_that_is_a_rounding_error_is_no_remedy() {
        let known = Certificates { explicit_step_bound: Some(1.78543e-20), ..paper() };
        let (found, remedy) = known.verdict(0.04, None, &[]).refusals.remove(0);
        assert!(found.contains("no step is stable") && !found.contains("e-20"), "{found}");
        assert!(
            remedy.contains("`damping`") && remedy.contains("bdf2") && !remedy.contains("e-20"),
            "{remedy}"
        );
    }

    #[test]
    fn friction_that_falls_in_steps_of_the_size_of_the_bound_lags() {
        let known = Certificates { explicit_step_bound: Some(0.02), ..paper() };
        let says = known.lagging_friction(Some(0.037), 0.01).expect("a warning");
        assert!(says.contains("3.7 %") && says.contains("0.02 s") && says.contains("bdf2"), "{says}");
        assert_eq!(known.lagging_friction(Some(1e-3), 0.01), None);
        assert_eq!(known.lagging_friction(Some(0.037), 1e-4), None);
        assert_eq!(known.lagging_friction(None, 0.01), None);
        let without = Certificates { explicit_step_bound: None, ..paper() };
        assert_eq!(without.lagging_friction(Some(0.037), 0.01), None, "no stress lags");
    }
}
