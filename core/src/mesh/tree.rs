//! A tree of axis-aligned boxes that finds the ones around a point.

use crate::linear_algebra::tensor::Vector;

/// Boxes in a binary tree, split at medians; building is `O(n log n)`.
#[derive(Debug, Clone)]
pub struct BoxTree<const D: usize> {
    branches: Vec<Branch<D>>,
    items: Vec<u32>,
    boxes: Vec<Bounds<D>>,
}

/// Low and high corner.
type Bounds<const D: usize> = (Vector<D>, Vector<D>);

#[derive(Debug, Clone)]
struct Branch<const D: usize> {
    low: Vector<D>,
    high: Vector<D>,
    /// The branch to go on with when the point is outside this one: branches lie in preorder.
    after: u32,
    /// The range of items below a leaf; empty for an inner branch.
    items: (u32, u32),
}

const LEAF: usize = 4;

impl<const D: usize> BoxTree<D> {
    /// The tree of boxes `(low, high)`, known by their positions.
    pub fn new(boxes: Vec<(Vector<D>, Vector<D>)>) -> Self {
        let mut items: Vec<u32> = (0..boxes.len() as u32).collect();
        let mut branches = Vec::with_capacity(boxes.len());
        if !items.is_empty() {
            grow(&boxes, &mut items, 0, &mut branches);
        }
        Self { branches, items, boxes }
    }

    /// Calls `found` with every box around the point, until it returns true; whether it did.
    pub fn around(&self, point: &Vector<D>, found: impl FnMut(u32) -> bool) -> bool {
        self.meeting(&(*point, *point), found)
    }

    /// Calls `found` with every box that has a point in common with the box `(low, high)`, until it returns true;
    /// whether it did.
    pub fn meeting(&self, wanted: &(Vector<D>, Vector<D>), mut found: impl FnMut(u32) -> bool) -> bool {
        let mut at = 0;
        while let Some(branch) = self.branches.get(at) {
            if !meet(&(branch.low, branch.high), wanted) {
                at = branch.after as usize;
                continue;
            }
            let (first, last) = branch.items;
            if self.items[first as usize..last as usize]
                .iter()
                .any(|&item| meet(&self.boxes[item as usize], wanted) && found(item))
            {
                return true;
            }
            at += 1;
        }
        false
    }
}

fn meet<const D: usize>((low, high): &Bounds<D>, other: &Bounds<D>) -> bool {
    (0..D).all(|i| low[i] <= other.1[i] && other.0[i] <= high[i])
}

/// Appends the branch over `items`, which lie from position `first` on in the tree's items.
fn grow<const D: usize>(boxes: &[Bounds<D>], items: &mut [u32], first: u32, branches: &mut Vec<Branch<D>>) {
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for &item in items.iter() {
        let (item_low, item_high) = &boxes[item as usize];
        for i in 0..D {
            low[i] = low[i].min(item_low[i]);
            high[i] = high[i].max(item_high[i]);
        }
    }
    let at = branches.len();
    branches.push(Branch { low, high, after: 0, items: (0, 0) });
    if items.len() <= LEAF {
        branches[at].items = (first, first + items.len() as u32);
    } else {
        let mut axis = 0;
        for i in 1..D {
            if high[i] - low[i] > high[axis] - low[axis] {
                axis = i;
            }
        }
        let middle = |item: &u32| boxes[*item as usize].0[axis] + boxes[*item as usize].1[axis];
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
        let (left, right) = items.split_at_mut(half);
        grow(boxes, left, first, branches);
        grow(boxes, right, first + half as u32, branches);
    }
    branches[at].after = branches.len() as u32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_tree_finds_what_a_plain_search_finds(
            corners in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(0.0..0.4f64)), 0..60),
            points in prop::collection::vec(prop::array::uniform3(-1.2..1.5f64), 20),
        ) {
            let boxes: Vec<_> = corners
                .iter()
                .map(|(low, size)| (*low, std::array::from_fn(|i| low[i] + size[i])))
                .collect();
            let tree = BoxTree::<3>::new(boxes.clone());
            for point in &points {
                let mut found = Vec::new();
                tree.around(point, |item| { found.push(item); false });
                found.sort_unstable();
                let plain: Vec<u32> = (0..boxes.len() as u32)
                    .filter(|&b| {
                        let (low, high) = &boxes[b as usize];
                        (0..3).all(|i| low[i] <= point[i] && point[i] <= high[i])
                    })
                    .collect();
                prop_assert_eq!(found, plain);
            }
        }
    }
}
