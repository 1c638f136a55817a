//! The order of the nodes along a boundary.

/// Above this number of nodes the order of the file is kept.
const MANY: usize = 5000;
/// Distances between nodes longer than this multiple of the usual distance are gaps.
const GAP: f64 = 6.0;

/// The order of points along a curve, and the length of the curve up to each point; the pieces of a curve with gaps are
/// appended to each other.
pub(super) fn along_curve(points: &[[f64; 3]]) -> (Vec<usize>, Vec<f64>) {
    let order = if points.len() > MANY { (0..points.len()).collect() } else { chain(points) };
    let steps: Vec<f64> = order.windows(2).map(|pair| distance(points[pair[0]], points[pair[1]])).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let mut length = 0.0;
    let mut lengths = vec![0.0; order.len().min(1)];
    for step in steps {
        length += if step > GAP * usual { usual } else { step };
        lengths.push(length);
    }
    (order, lengths)
}

/// Extends a chain at both ends, always by the nearest remaining point; the result starts at the end with the smaller
/// coordinates.
fn chain(points: &[[f64; 3]]) -> Vec<usize> {
    let mut chain = std::collections::VecDeque::new();
    let mut left: Vec<usize> = (0..points.len()).collect();
    if let Some(first) = left.pop() {
        chain.push_back(first);
    }
    while let (Some(&front), Some(&back)) = (chain.front(), chain.back()) {
        let near = |end: usize| {
            let distances = left.iter().enumerate().map(|(at, n)| (at, distance(points[*n], points[end])));
            distances.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (Some(before), Some(behind)) = (near(front), near(back)) else { break };
        if before.1 < behind.1 {
            chain.push_front(left.swap_remove(before.0));
        } else {
            chain.push_back(left.swap_remove(behind.0));
        }
    }
    let mut chain = Vec::from(chain);
    if let (Some(&first), Some(&last)) = (chain.first(), chain.last()) {
        let differs =
            points[first].iter().zip(&points[last]).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
        if differs == Some(std::cmp::Ordering::Greater) {
            chain.reverse();
        }
    }
    chain
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_nodes_of_an_arc_are_followed_from_one_end_to_the_other() {
        let count = 41;
        let angle = |n: usize| std::f64::consts::PI * n as f64 / (count - 1) as f64;
        let shuffled: Vec<usize> = (0..count).map(|n| n * 17 % count).collect();
        let points: Vec<[f64; 3]> =
            shuffled.iter().map(|n| [-angle(*n).cos(), -angle(*n).sin(), 0.0]).collect();
        let (order, lengths) = along_curve(&points);
        let followed: Vec<usize> = order.iter().map(|at| shuffled[*at]).collect();
        assert_eq!(followed, (0..count).collect::<Vec<_>>());
        assert!((lengths[count - 1] - std::f64::consts::PI).abs() < 2e-3);
    }

    #[test]
    fn a_gap_does_not_count_and_no_or_one_node_is_no_fault() {
        let points: Vec<[f64; 3]> =
            (0..20).map(|n| [f64::from(n + if n < 10 { 0 } else { 100 }), 0.0, 0.0]).collect();
        assert_eq!(along_curve(&points).1[19], 19.0);
        assert_eq!(along_curve(&[]), (vec![], vec![]));
        assert_eq!(along_curve(&[[1.0; 3]]), (vec![0], vec![0.0]));
    }
}
