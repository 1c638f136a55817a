//! The triad `a = b + s c`, whose traffic is counted without what the cache fetches before it writes.

use std::{hint::black_box, time::Instant};

/// Numbers of an array: three of them are far larger than any cache.
const NUMBERS: usize = 1 << 24;
/// Bytes that go through memory.
pub const BYTES: usize = 3 * NUMBERS * size_of::<f64>();
/// Repetitions of which the fastest counts.
const REPETITIONS: usize = 9;

/// Its arrays.
pub struct Triad {
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
}

impl Triad {
    pub fn new() -> Self {
        Self { a: vec![0.0; NUMBERS], b: vec![1.0; NUMBERS], c: vec![2.0; NUMBERS] }
    }

    pub fn run(&mut self) {
        let s = black_box(3.0);
        self.a.iter_mut().zip(&self.b).zip(&self.c).for_each(|((a, b), c)| *a = b + s * c);
        black_box(&self.a);
    }
}

/// Seconds of the fastest of some repetitions.
pub fn fastest(run: &mut dyn FnMut()) -> f64 {
    let seconds = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    (0..REPETITIONS).map(seconds).fold(f64::INFINITY, f64::min)
}
