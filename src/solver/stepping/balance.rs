//! The velocities at which several functions vanish that are the derivatives of a convex function, or nearly so. Evaluations are
//! expensive.

use super::root::IncreasingRoot;

/// A search along a line ends where the derivative is this share of the one at its start.
const FLAT: f64 = 0.1;
/// The most evaluations along a line.
const ALONG_A_LINE: u32 = 25;

/// A search for these velocities: for one of them by secants inside an interval, for several by such searches along lines, which the
/// method of Broyden, Fletcher, Goldfarb and Shanno chooses. Along a line the derivative increases. It keeps its memory for the next
/// search.
#[derive(Debug, Default)]
pub(super) struct Balance {
    /// The present velocities.
    pub velocities: Vec<f64>,
    /// The functions at these velocities.
    pub values: Vec<f64>,
    /// Positive estimates of their slopes, for the first step.
    pub slopes: Vec<f64>,
    /// The sizes of the terms of each function so far.
    pub scales: Vec<f64>,
    /// The velocities before the present ones, and the functions there.
    pub before: Vec<[f64; 2]>,
    /// The search for one velocity, or along the present line.
    root: IncreasingRoot,
    /// An estimate of the inverse of the matrix of slopes, by rows.
    inverse: Vec<f64>,
    /// The start of the line, the functions there, and its direction.
    line: Vec<[f64; 3]>,
    /// The position on the line, and the number of evaluations there; `None` before the first line.
    position: Option<(f64, u32)>,
    /// For each velocity: the way along the line, the change of its function, and this change times the estimate.
    changes: Vec<[f64; 3]>,
}

impl Balance {
    /// Begins a search for this number of velocities.
    pub(super) fn start(&mut self, count: usize) {
        for list in [&mut self.velocities, &mut self.values, &mut self.slopes, &mut self.scales] {
            list.clear();
            list.resize(count, 0.0);
        }
        self.before.clear();
        (self.root, self.position) = (IncreasingRoot::default(), None);
    }

    /// Replaces the velocities by the next ones, for which the functions are to be evaluated; false if the search ends.
    pub(super) fn advance(&mut self) -> bool {
        let pairs = self.velocities.iter().zip(&self.values).map(|(velocity, value)| [*velocity, *value]);
        self.before.clear();
        self.before.extend(pairs);
        if self.velocities.len() == 1 {
            let next = self.root.next(self.velocities[0], self.values[0], self.slopes[0]);
            self.velocities[0] = next.unwrap_or(f64::NAN);
        } else {
            self.along_a_line();
        }
        self.velocities.iter().all(|velocity| velocity.is_finite())
    }

    fn along_a_line(&mut self) {
        let count = self.velocities.len();
        if let Some((position, evaluations)) = self.position {
            let first: f64 = self.line.iter().map(|[_, value, along]| value * along).sum();
            let here =
                self.values.iter().zip(&self.line).map(|(value, [_, _, along])| value * along).sum::<f64>();
            let is_steep = here.abs() > FLAT * first.abs() && evaluations < ALONG_A_LINE;
            if is_steep && let Some(next) = self.root.next(position, here, -first) {
                return self.move_to(next, evaluations + 1);
            }
            self.update();
        } else {
            self.inverse.clear();
            self.inverse.resize(count * count, 0.0);
            (0..count).for_each(|i| self.inverse[i * count + i] = 1.0 / self.slopes[i]);
        }
        self.line.clear();
        for (row, i) in self.inverse.chunks_exact(count).zip(0..) {
            let along: f64 = row.iter().zip(&self.values).map(|(entry, value)| -entry * value).sum();
            self.line.push([self.velocities[i], self.values[i], along]);
        }
        let first: f64 = self.line.iter().map(|[_, value, along]| value * along).sum();
        self.root = IncreasingRoot::default();
        let position = self.root.next(0.0, first, -first).unwrap_or(f64::NAN);
        self.move_to(position, 0);
    }

    /// Sets the velocities to those at this position on the line.
    fn move_to(&mut self, position: f64, evaluations: u32) {
        self.position = Some((position, evaluations));
        for (velocity, [start, _, along]) in self.velocities.iter_mut().zip(&self.line) {
            *velocity = start + position * along;
        }
    }

    /// Lets the estimate turn the change of the functions along the line into the way.
    fn update(&mut self) {
        let count = self.velocities.len();
        self.changes.clear();
        for (i, [start, first, _]) in self.line.iter().enumerate() {
            self.changes.push([self.velocities[i] - start, self.values[i] - first, 0.0]);
        }
        for (i, row) in self.inverse.chunks_exact(count).enumerate() {
            self.changes[i][2] =
                row.iter().zip(&self.changes).map(|(entry, [_, change, _])| entry * change).sum();
        }
        let work: f64 = self.changes.iter().map(|[way, change, _]| way * change).sum();
        if work.is_nan() || work <= 0.0 {
            return;
        }
        let spread: f64 = self.changes.iter().map(|[_, change, turned]| change * turned).sum();
        let factor = (1.0 + spread / work) / work;
        for (at, entry) in self.inverse.iter_mut().enumerate() {
            let ([way, _, turned], [other, _, other_turned]) =
                (self.changes[at / count], self.changes[at % count]);
            *entry += factor * way * other - (turned * other + way * other_turned) / work;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluations until all values are small, from 0.
    fn solve<const N: usize>(function: impl Fn([f64; N]) -> [f64; N], slopes: [f64; N]) -> ([f64; N], u32) {
        let mut balance = Balance::default();
        balance.start(N);
        let mut at = [0.0; N];
        let size = function(at).iter().fold(1.0, |most: f64, value| most.max(value.abs()));
        for count in 1..200 {
            let values = function(at);
            if values.iter().all(|value| value.abs() < 1e-10 * size) {
                return (at, count);
            }
            balance.values.copy_from_slice(&values);
            balance.slopes.copy_from_slice(&slopes);
            assert!(balance.advance(), "a next place");
            at.copy_from_slice(&balance.velocities);
        }
        panic!("no balance")
    }

    #[test]
    fn coupled_springs_are_balanced() {
        let (found, count) = solve(|[x, y]| [3.0 * x + y - 5.0, x + 2.0 * y - 5.0], [1.0, 1.0]);
        assert!(
            (found[0] - 1.0).abs() < 1e-9 && (found[1] - 2.0).abs() < 1e-9 && count < 20,
            "{found:?} {count}"
        );
        let (one, _) = solve(|[x]: [f64; 1]| [x.powi(3) - 8.0], [1.0]);
        assert!((one[0] - 2.0).abs() < 1e-10);
    }

    #[test]
    fn punches_that_touch_one_after_the_other_are_balanced() {
        // Hertz, each punch lifted by the dent of the other.
        let force = |depth: f64| depth.max(0.0).powf(1.5);
        for slopes in [[1.0; 2], [1e-2, 1e2], [100.0; 2]] {
            let two = |[x, y]: [f64; 2]| [force(x - 1.0 - 0.2 * y) - 4.0, force(y - 5.0 - 0.1 * x) - 9.0];
            let (found, count) = solve(two, slopes);
            assert!(count < 80, "{count} with {slopes:?}");
            assert!(two(found).iter().all(|value| value.abs() < 1e-9));
        }
    }

    #[test]
    fn a_disc_that_sticks_slides_or_rolls_is_balanced() {
        // Mass 10 and moment of inertia 0.05 over a step of 2 ms, friction of at most 700 N with a stiff slope where it sticks.
        for (force, stiffness) in [(300.0, 1e6), (300.0, 1e9), (3000.0, 1e8), (-300.0, 1e4)] {
            let friction = |slip: f64| 700.0 * (stiffness * slip / 700.0).clamp(-1.0, 1.0);
            let disc = |[w, omega]: [f64; 2]| {
                let q = friction(w + 0.1 * omega);
                [10.0 * w / 2e-3 + q - force, 0.05 * omega / 2e-3 + 0.1 * q]
            };
            let (found, count) = solve(disc, [5e3, 25.0]);
            assert!(count < 60, "{count} with {force} N and {stiffness}");
            let rolls = disc(found).iter().all(|value| value.abs() < 1e-9 * force.abs());
            assert!(rolls, "{found:?}");
        }
    }

    #[test]
    fn three_masses_with_kinks_are_balanced() {
        let kink = |x: f64| if x < 1.0 { 0.1 * (x - 1.0) } else { 50.0 * (x - 1.0) };
        let three = |[x, y, z]: [f64; 3]| {
            [2.0 * x + kink(x) - y, 2.0 * y - x - 1.0 + kink(y) - kink(z - y), z + kink(z - y) - 3.0]
        };
        let (found, count) = solve(three, [2.0, 2.0, 1.0]);
        assert!(count < 100 && three(found).iter().all(|value| value.abs() < 1e-9), "{found:?} {count}");
    }
}
