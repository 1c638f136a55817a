//! All steps with random contact laws and random loads are solved if they have one solution.

use super::run_on;
use super::scenes::{noise, simulation};
use crate::mpirun::scramble;
use clarke::{
    mesh::generate::{Diagonal, rectangle},
    parallel::session::Session,
};

/// Number of laws in a usual run, and the environment variable for another number.
const LAWS: usize = 50;
const NUMBER: &str = "CLARKE_RANDOM_LAWS";
/// Largest accepted number of Newton iterations of a step over all attempts; most steps take fewer than ten.
const ITERATIONS: usize = 2000;

/// A sequence of pseudorandom numbers.
struct Numbers(u64);

impl Numbers {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 += 1;
        low + (high - low) * 0.5 * (1.0 + noise(self.0))
    }

    fn power_of_ten(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.between(low, high))
    }

    fn below(&mut self, count: usize) -> usize {
        self.between(0.0, count as f64) as usize
    }
}

/// A graph and its steepest decrease, with velocities of about 1 m/s and pressures of about 1 Pa.
struct Law {
    points: Vec<[f64; 2]>,
    before: f64,
    after: f64,
}

impl Law {
    fn random(numbers: &mut Numbers) -> Self {
        let mut at = [numbers.between(-2.0, 0.5), numbers.between(-1.0, 1.0)];
        let mut points = vec![at];
        let mut jumped = false;
        for _ in 0..numbers.below(7) {
            jumped = !jumped && numbers.below(3) == 0;
            at = if jumped {
                [at[0], at[1] + numbers.power_of_ten(-2.0, 1.0)]
            } else {
                [at[0] + numbers.power_of_ten(-2.0, 0.5), at[1] + numbers.between(-1.5, 1.5)]
            };
            points.push(at);
        }
        Self { points, before: numbers.between(-0.5, 3.0), after: numbers.between(-0.5, 3.0) }
    }

    fn steepest_decrease(&self) -> f64 {
        let falls = self.points.windows(2).filter(|p| p[1][0] > p[0][0]);
        let falls = falls.map(|p| (p[0][1] - p[1][1]) / (p[1][0] - p[0][0]));
        falls.fold((-self.before).max(-self.after).max(0.0), f64::max)
    }

    /// The table of a job, velocities and pressures multiplied by these.
    fn table(&self, velocity: f64, pressure: f64) -> String {
        let points: Vec<String> =
            self.points.iter().map(|p| format!("[{:e}, {:e}]", p[0] * velocity, p[1] * pressure)).collect();
        let slopes = [self.before, self.after].map(|slope| slope * pressure / velocity);
        format!(
            "points = [{}]\nslope_before = {:e}\nslope_after = {:e}\n",
            points.join(", "),
            slopes[0],
            slopes[1]
        )
    }
}

const BODY: &str = "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n\
    [material]\nhypothesis = 'plane_strain'\ndensity = 1.0\n\
    [material.viscosity]\nvolumetric = 25.0\nshear = 50.0\n\
    [[support]]\non = ['left']\nfix = 'all'\n";

fn job(law: &str, load: [f64; 3], step: f64) -> String {
    format!(
        "{BODY}[[traction]]\non = ['top']\nvalue = ['{:e}', '{:e}*(1 + sin(9*x)*{:e})']\n\
         [[contact]]\non = ['bottom']\n[contact.normal.graph]\n{law}\
         [time]\nend = {:e}\nstep = {step:e}\n",
        load[0],
        load[1],
        load[2],
        3.0 * step
    )
}

fn solve(session: &Session) {
    let laws = std::env::var(NUMBER).ok().map_or(LAWS, |number| number.parse().expect("a number of laws"));
    let mesh = rectangle([1.0, 0.5], [12, 5], Diagonal::Alternating, [1.0, 1.3]).expect("mesh");
    let mut counts = Vec::new();
    let mut faults = Vec::new();
    for number in 0..laws {
        let mut numbers = Numbers(scramble(number as u64) >> 8);
        let law = Law::random(&mut numbers);
        let velocity = numbers.power_of_ten(-3.0, 1.0);
        let step = numbers.power_of_ten(-3.0, 0.0);
        let fall = law.steepest_decrease();
        // With a decrease of 8 Pa s/m, theta of a step is below 1 for this body at every step length.
        let slope = numbers.power_of_ten(-2.0, 0.9);
        let pressure = velocity * if fall > 0.0 { slope / fall } else { numbers.power_of_ten(-1.0, 2.0) };
        let size = pressure * numbers.power_of_ten(-1.5, 2.5);
        let load = [numbers.between(-1.0, 1.0) * size, -size, numbers.between(0.0, 3.0)];
        let text = job(&law.table(velocity, pressure), load, step);
        let mut simulation = simulation::<2, 4>(session, &text, &mesh);
        loop {
            match simulation.advance(session) {
                Ok(None) => break,
                Ok(Some(outcome)) => {
                    counts.push(outcome.newton_iterations);
                    if outcome.newton_iterations > ITERATIONS {
                        faults
                            .push(format!("law {number}: {} iterations\n{text}", outcome.newton_iterations));
                    }
                    assert!(outcome.inclusion_residual < 1e-6, "law {number}: {outcome:?}\n{text}");
                }
                Err(error) => {
                    faults.push(format!("law {number}: {error}\n{text}"));
                    break;
                }
            }
        }
    }
    counts.sort_unstable();
    let share = |part: usize| counts.get(counts.len() * part / 1000).copied().unwrap_or_default();
    println!(
        "{laws} random laws, {} steps: Newton iterations {} in the median, {} in 99 of 100, {} at most; {} faults",
        counts.len(),
        share(500),
        share(990),
        counts.last().copied().unwrap_or_default(),
        faults.len()
    );
    assert!(faults.is_empty(), "{} faults of {laws} laws:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn every_step_with_one_solution_is_solved_whatever_the_law_and_the_load() {
    run_on(&[1, 2], |world| solve(&world.session));
}
