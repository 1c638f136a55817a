//! Loads against the steps that sample them: fixed steps see a load at one time in each step, adaptive ones end at kinks of tables no nearer
//! to each other than the shortest step.

use super::steps::{Kind, shortest_step, time_dependent};
use crate::{
    job::Job,
    laws::{
        chord::course,
        digits::Digits,
        quadrature::rule,
        step::{Blend, Step},
    },
    linear_algebra::tensor::{Vector, larger},
    solver::stepping::Landings,
};
use std::cell::LazyCell;

/// Share of its largest value that a load must reach at times at which steps see it.
const LEAST_SEEN: f64 = 0.5;
/// A change of a load of this share of its largest magnitude is worth seeing.
const WORTH_SEEING: f64 = 0.1;
/// Share of the largest impulse by which that over the steps may differ after the load has ended; and of the largest way of a support.
const WRONG_IMPULSE: f64 = 0.1;
/// A load has ended where it is below this share of its largest magnitude.
const FADED: f64 = 1e-3;
/// Values at a place below this share of those at others are rounding errors, and the times at which they are compared.
const ROUNDING: f64 = 1e-9;
const TIMES: u32 = 64;
/// Share of all its change by which the place of an obstacle or a friction coefficient may be off a straight line within a step, the share of
/// a step behind its start at which it counts as that at the start, and the parts of a step in which it is seen.
const BENT: f64 = 0.05;
const BESIDE: f64 = 1e-6;
const PARTS: u32 = 16;
/// Runs of more fixed steps are not examined.
const MOST_STEPS: u64 = 20_000;
/// Steps between the kinks of a load that resolve it.
const STEPS_A_PIECE: f64 = 5.0;

/// Warnings about loads and motions of a job of which steps that end at these times see too little or too much, as they are at these places.
pub(super) fn warnings<const D: usize>(job: &Job, landings: &Landings, places: &[Vector<D>]) -> Vec<String> {
    let steps = LazyCell::new(|| fixed_steps(landings));
    let has_mass = job.materials().any(|(_, material)| material.density.is_some());
    let mut found = Vec::new();
    for load in time_dependent(job) {
        let breakpoints = load.value.breakpoints();
        let kinks = breakpoints.within(landings.end);
        let words = |place: &[f64]| {
            let value = |time: f64| load.value.evaluate(time, place);
            if job.time.adaptive.is_some() {
                // Steps end at every jump, and follow obstacles and friction coefficients within their tolerance.
                let is_resolved = !breakpoints.switches.is_empty() || load.kind == Kind::Followed;
                passed_over(value, &kinks, shortest_step(job)).filter(|_| !is_resolved)
            } else if load.kind == Kind::Followed {
                bent(value, &steps)
            } else {
                let sampled = Sampled::by(value, job.time.scheme.formula(), &steps, &kinks);
                sampled
                    .missed(&kinks)
                    .or_else(|| sampled.wrong_integral(load.kind, &kinks).filter(|_| has_mass))
            }
        };
        let words = if load.value.depends_on_position() {
            let few = if job.time.adaptive.is_some() {
                places.len()
            } else {
                (MOST_STEPS as usize / steps.len().max(1)).max(1)
            };
            let size = |place: &Vector<D>| {
                let times = (0..=TIMES).map(|at| landings.end * f64::from(at) / f64::from(TIMES));
                times.map(|time| load.value.evaluate(time, place).abs()).fold(0.0, f64::max)
            };
            let least = ROUNDING * places.iter().map(size).fold(0.0, f64::max);
            places
                .iter()
                .filter(|place| size(place) > least)
                .take(few)
                .find_map(|place| words(place).map(|words| format!("at {place:?} m {words}")))
        } else {
            words(&[])
        };
        found.extend(words.map(|words| format!("{}: {words}", load.key)));
    }
    found.dedup();
    found
}

/// The fixed steps of a run; none if they are too many.
fn fixed_steps(landings: &Landings) -> Vec<Step> {
    if landings.steps_after(0.0, landings.length) > MOST_STEPS {
        return Vec::new();
    }
    let (mut steps, mut at) = (Vec::new(), [0.0; 2]);
    while at[0] < landings.end {
        let step = landings.fixed_step(at, landings.next(at));
        steps.push(step);
        at = [step.time, step.length];
    }
    steps
}

/// The largest distance of a value from another one.
#[derive(Debug, Clone, Copy)]
struct Peak {
    from: f64,
    /// In the run, with the time.
    largest: [f64; 2],
    /// At times at which steps see the value.
    seen: f64,
}

impl Peak {
    fn away_from(from: f64) -> Self {
        Self { from, largest: [0.0; 2], seen: 0.0 }
    }

    fn meet(&mut self, value: f64, time: f64) {
        let distance = (value - self.from).abs();
        if distance > self.largest[0] {
            self.largest = [distance, time];
        }
    }

    fn see(&mut self, value: f64) {
        self.seen = larger(self.seen, (value - self.from).abs());
    }

    fn is_missed(&self) -> bool {
        self.seen < LEAST_SEEN * self.largest[0]
    }
}

/// What the fixed steps of a run see of a value.
struct Sampled {
    /// Its magnitude, and its change since the start of the run.
    magnitude: Peak,
    change: Peak,
    /// The largest impulse up to the end of a step, that at the end of the run, and that over the steps.
    impulses: [f64; 3],
    /// The value at the end of the run, the longest step, and the last time before which the value is not zero.
    last: f64,
    longest: f64,
    ended: f64,
}

impl Sampled {
    fn by(value: impl Fn(f64) -> f64, formula: fn(Step) -> Blend, steps: &[Step], kinks: &[f64]) -> Self {
        let mut found = Self {
            magnitude: Peak::away_from(0.0),
            change: Peak::away_from(value(0.0)),
            impulses: [0.0; 3],
            last: 0.0,
            longest: 0.0,
            ended: 0.0,
        };
        let mut speeds = [0.0; 2];
        let mut impulse = 0.0;
        let mut kinks = kinks.iter().copied().peekable();
        for step in steps {
            let mut from = step.time - step.length;
            let mut pieces = vec![];
            while let Some(kink) = kinks.next_if(|kink| *kink <= step.time) {
                pieces.push(kink);
            }
            pieces.push(step.time);
            for to in pieces {
                for [time, weight] in rule([from, to]) {
                    let size = value(time);
                    impulse += weight * size;
                    found.meet(size, [time, to]);
                }
                found.meet(value(to), [to; 2]);
                from = to;
            }
            let blend = formula(*step);
            let at_balance = value(blend.balanced(*step).time);
            found.magnitude.see(at_balance);
            found.change.see(at_balance);
            let solved = blend.of(speeds[0], speeds[1]) + blend.length * at_balance;
            speeds = [blend.end(speeds[0], solved), speeds[0]];
            found.impulses = [larger(found.impulses[0], impulse.abs()), impulse, speeds[0]];
            found.last = value(step.time);
            found.longest = larger(found.longest, step.length);
        }
        found
    }

    /// Takes a value at a time in a piece that ends at another one.
    fn meet(&mut self, value: f64, [time, end]: [f64; 2]) {
        self.magnitude.meet(value, time);
        self.change.meet(value, time);
        if value != 0.0 {
            self.ended = larger(self.ended, end);
        }
    }

    /// Words where steps miss most of its largest values.
    fn missed(&self, kinks: &[f64]) -> Option<String> {
        let Self { magnitude, change, .. } = self;
        let changes = change.largest[0] > WORTH_SEEING * magnitude.largest[0];
        let (peak, name) = if magnitude.is_missed() {
            (magnitude, "magnitude")
        } else if changes && change.is_missed() {
            (change, "change since the start")
        } else {
            return None;
        };
        let [largest, time] = peak.largest;
        Some(format!(
            "of its largest {name} {largest:.3e}, at t = {time:.6e} s, steps see at most {:.3e}: choose a time.step of at most {:.1e} s, or \
             [time.adaptive]",
            peak.seen,
            resolving(kinks, self.longest)
        ))
    }

    /// Words where a load that acts or has ended has not left its impulse, or a support has not gone the way of its velocity.
    fn wrong_integral(&self, kind: Kind, kinks: &[f64]) -> Option<String> {
        let [largest, exact, over_steps] = self.impulses;
        let error = (over_steps - exact).abs() / (WRONG_IMPULSE * largest);
        let [found, right] = [over_steps, exact].map(Digits);
        let step = resolving(kinks, self.longest);
        match kind {
            Kind::Force if error > 1.0 && self.last == 0.0 && self.ended > 0.0 => {
                Some(format!(
                    "its impulse over the steps is {found} for {right}, because they are too long while it acts: choose a time.step of at most {step:.1e} s, \
                     or let the time until t = {:.6e} s be a stage of its own with such steps",
                    self.ended
                ))
            }
            Kind::Force if error > 1.0 && self.last.abs() <= FADED * self.magnitude.largest[0] => Some(format!(
                "its impulse over the steps is {found} for {right}, because they are too long for its changes: choose a time.step of at most {step:.1e} s, or \
                 [time.adaptive]"
            )),
            Kind::Velocity => (error > 1.0).then(|| {
                let step = step.min(0.5 * self.longest / error);
                format!(
                    "over the steps the support moves by {found} m for {right} m, because they are too long for the scheme: choose scheme = \"bdf2\" or a \
                     time.step of at most {step:.1e} s"
                )
            }),
            Kind::Force | Kind::State | Kind::Followed => None,
        }
    }
}

/// Words where a value between the ends of a step is far from a linear function of time: a friction coefficient, or the place of an obstacle,
/// of whose motion to and fro, along its surface in particular, steps see little or another one.
fn bent(value: impl Fn(f64) -> f64, steps: &[Step]) -> Option<String> {
    let (mut range, mut most, mut longest) = ([value(0.0); 2], [0.0; 2], 0.0);
    for step in steps {
        // Beside a jump at the start of the step, the last digits of times matter.
        let of_step = course(&value, [step.start() + BESIDE * step.length, step.time], PARTS);
        if of_step.bend > most[0] {
            most = [of_step.bend, step.time];
        }
        range = [range[0].min(of_step.range[0]), larger(range[1], of_step.range[1])];
        longest = larger(longest, step.length);
    }
    let [bend, time] = most;
    let share = bend / (range[1] - range[0]);
    (share > BENT).then(|| {
        format!(
            "within the step to t = {time:.6e} s it is off the straight line between its values at the ends of the step by {:.0} % of all its change: choose a \
             time.step of at most {:.1e} s, or [time.adaptive]",
            100.0 * share,
            longest * (0.1 * BENT / share).sqrt()
        )
    })
}

/// The length in s of steps that resolve a value with these kinks, given the longest step.
fn resolving(kinks: &[f64], longest: f64) -> f64 {
    let gaps = kinks.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0);
    gaps.fold(longest, f64::min) / STEPS_A_PIECE
}

/// Words where adaptive steps of at least this length in s pass over kinks between which a value has most of its size.
fn passed_over(value: impl Fn(f64) -> f64, kinks: &[f64], shortest: f64) -> Option<String> {
    let size = |time: f64| value(time).abs();
    let (mut seen, mut largest, mut landed) = (0.0, [0.0; 2], 0.0);
    for &kink in kinks {
        if size(kink) > largest[0] {
            largest = [size(kink), kink];
        }
        if kink - landed >= shortest {
            landed = kink;
            // The next step ends no earlier.
            seen = larger(seen, larger(size(kink), size(kink + shortest)));
        }
    }
    let [largest, time] = largest;
    (seen < LEAST_SEEN * largest).then(|| {
        format!(
            "of its largest magnitude {largest:.3e}, at t = {time:.6e} s, steps see at most {seen:.3e}, because they end at kinks no nearer to each \
             other than [time.adaptive] smallest_step = {shortest} s: choose a smallest_step of at most {:.1e} s",
            resolving(kinks, shortest)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::{super::steps, *};
    use std::path::Path;

    /// Warnings about a traction with these values in a run of 2 s.
    fn warned(time: &str, value: &str, density: &str) -> Vec<String> {
        warned_of(&format!("[[traction]]\non = [\"right\"]\nvalue = [\"{value}\", 0.0]\n"), time, density)
    }

    /// The same about these tables.
    fn warned_of(tables: &str, time: &str, density: &str) -> Vec<String> {
        let text = format!(
            "[mesh.rectangle]\nsize = [1.0, 1.0]\ncells = [1, 1]\n[material]\nhypothesis = \"plane_strain\"\n{density}\n[material.elasticity]\nyoungs_modulus = 1.0\n\
             poisson_ratio = 0.0\n{tables}[time]\nend = 2.0\n{time}\n[[support]]\non = [\"left\"]\nfix = \"all\"\n"
        );
        let job =
            Job::from_text(&text, "job.toml", Path::new("."), &[]).unwrap_or_else(|e| panic!("{e}")).job;
        warnings(&job, &steps::landings(&job), &[[0.5, 0.5], [1.0, 1.0]])
    }

    fn triangle(start: f64, width: f64) -> String {
        format!("interpolate(t, 0, 0, {start}, 0, {start} + 0.5*{width}, 1, {start} + {width}, 0, 3, 0)")
    }

    fn fixed(scheme: &str) -> String {
        format!("scheme = \"{scheme}\"\nstep = 0.1")
    }

    const ADAPTIVE: &str = "scheme = \"bdf2\"\nstep = 0.1\nadaptive = { tolerance = 1e-3, smallest_step = 1e-4, largest_step = 0.1 }";

    #[track_caller]
    fn expect(warned: &[String], words: &str) {
        assert!(
            matches!(warned, [one] if one.starts_with("traction.0.value: ") && one.contains(words)),
            "{warned:?}"
        );
    }

    #[test]
    fn a_load_whose_largest_values_lie_between_ends_of_steps_is_warned_of() {
        let missed = warned(&fixed("implicit_euler"), &triangle(0.55, 1e-8), "");
        expect(&missed, "of its largest magnitude 1.000e0, at t = 5.500000e-1 s, steps see at most 0.000e0");
        expect(&warned(&fixed("bdf2"), "sin(10*pi*t)", ""), "steps see at most");
        expect(&warned(ADAPTIVE, &triangle(0.55, 1e-5), ""), "choose a smallest_step of at most 1.0e-6 s");
        let resolved = [triangle(0.55, 0.01), "sin(pi*t)".into(), "2*t".into(), "step(t - 0.513)".into()];
        for value in resolved {
            assert!(warned(&fixed("implicit_euler"), &value, "").is_empty(), "{value}");
            assert!(warned(ADAPTIVE, &value, "").is_empty(), "{value}");
        }
    }

    #[test]
    fn a_load_that_changes_between_ends_of_steps_is_warned_of_wherever_it_acts() {
        let dense = "density = 1.0";
        for scheme in ["implicit_euler", "bdf2"] {
            // Seen at its least values only, beside an offset.
            let offset = warned(&fixed(scheme), "1000 + 900*sin(10*pi*t)^2", dense);
            expect(&offset, "of its largest change since the start 8.5");
            // At one place of two.
            let there = warned(&fixed(scheme), "sin(10*pi*t)^2*(x > 0.7)", dense);
            expect(&there, "at [1.0, 1.0] m of its largest magnitude");
        }
        // A pulse whose tail is not zero at the end.
        let pulse = "1/(1 + ((t - 0.7)/0.02)^2)^2";
        let counted_for_a_step = warned(&fixed("implicit_euler"), pulse, dense);
        expect(&counted_for_a_step, "because they are too long for its changes");
        for resolved in [
            "1000 + 50*sin(10*pi*t)^2",
            "1 + t",
            "sin(pi*t)*x",
            "5*step(t - 0.513)",
            "1 + 1000*t",
            "(1 + 1000*t)*cos(pi*x)",
            "exp(-((t - 0.7)/0.3)^2)",
            "2*exp(-t)",
        ] {
            assert_eq!(warned(&fixed("implicit_euler"), resolved, dense), [""; 0], "{resolved}");
        }
    }

    #[test]
    fn obstacles_and_friction_that_steps_do_not_resolve_are_warned_of() {
        let on_a_belt = |way: &str, coefficient: &str, step: f64| {
            let contact = format!(
                "[[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.expression.coefficient = \"{coefficient}\"\n\
                 obstacle.plane = {{ point = [\"{way}\", 0], normal = [0, 1] }}\n"
            );
            warned_of(&contact, &fixed("implicit_euler").replace("0.1", &step.to_string()), "density = 1.0")
        };
        for step in [0.1, 0.04, 0.02] {
            let found = on_a_belt("0.01*sin(20*pi*t)", "0.3", step);
            assert!(
                matches!(&found[..], [one] if one.starts_with("contact.0.obstacle: within the step")),
                "{step}: {found:?}"
            );
            let found = on_a_belt("t", "0.3 + 0.1*sin(20*pi*t)", step);
            assert!(
                matches!(&found[..], [one] if one.contains("friction") && one.contains("time.step of at most")),
                "{step}: {found:?}"
            );
        }
        for resolved in [
            "0.01*sin(2*pi*t)",
            "0.1*t",
            "t^2",
            "step(t - 0.55)",
            "max(0, t - 0.537)",
            "1e-4 + 1e-20*sin(20*t)",
        ] {
            assert_eq!(on_a_belt(resolved, "0.3", 0.1), [""; 0], "{resolved}");
        }
    }

    #[test]
    fn a_support_that_does_not_go_the_way_of_its_velocity_is_warned_of() {
        let moved = |scheme: &str, density: &str| {
            let support =
                "[[support]]\non = [\"right\"]\nfix = \"all\"\nvelocity = [\"max(0, t - 1)\", 0.0]\n";
            warned_of(support, &fixed(scheme).replace("0.1", "0.2"), density)
        };
        let found = moved("implicit_euler", "density = 1.0");
        assert!(
            matches!(&found[..], [one] if one.starts_with("support.0.velocity: over the steps the support moves by 0.6 m for 0.5 m")
                && one.ends_with("a time.step of at most 4.0e-2 s")),
            "{found:?}"
        );
        assert!(moved("bdf2", "density = 1.0").is_empty(), "second order");
        assert!(moved("implicit_euler", "").is_empty(), "it moves by the integral");
    }

    #[test]
    fn a_load_that_ends_without_having_left_its_impulse_is_warned_of() {
        let (short, dense) = (triangle(0.5, 2e-4), "density = 1.0");
        expect(&warned(&fixed("bdf2"), &short, dense), "its impulse over the steps is 0.0001332 for 0.0001");
        assert!(warned(&fixed("bdf2"), &short, "").is_empty(), "no inertia");
        // A sum of the values at the ends of equal steps.
        assert!(warned(&fixed("implicit_euler"), &short, dense).is_empty());
        let counted_for_a_step = warned(&fixed("implicit_euler"), &triangle(0.5, 1e-8), dense);
        assert_eq!(counted_for_a_step.len(), 1, "{counted_for_a_step:?}");
        for value in [triangle(0.5, 1.0), "step(t - 0.5)".into(), "pulse(t, 0.3, 0.9)".into()] {
            assert!(warned(&fixed("bdf2"), &value, dense).is_empty(), "{value}");
        }
    }
}
