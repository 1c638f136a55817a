//! Faults: meshes that are split along a named surface inside the body.

use super::{
    Boundary, GlobalMesh,
    shape::{centroid, facet_of},
    tags::place,
};
use crate::error::{Error, Result};
use crate::job::number_of_group;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The name of the boundary on the other side of a fault.
pub fn other_side(fault: &str) -> String {
    format!("other side of {fault}")
}

/// The sorted nodes of a facet.
type Sorted<const D: usize> = [u32; D];

/// Sets of elements that belong together.
struct Groups(Vec<usize>);

impl Groups {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn of(&self, mut element: usize) -> usize {
        while self.0[element] != element {
            element = self.0[element];
        }
        element
    }

    fn join(&mut self, a: usize, b: usize) {
        let [a, b] = [self.of(a), self.of(b)];
        self.0[a.max(b)] = a.min(b);
    }
}

impl<const D: usize> GlobalMesh<D> {
    /// Splits the mesh along the facets inside the body that have this name: their nodes become two, except on the edge of the surface
    /// inside the body, where cells stay joined. The sides become two boundaries: one with this name, and [`other_side`]. Refused where
    /// the surface branches, meets another fault, has one side only, or has no node that can become two.
    pub fn split_along(&mut self, name: &str) -> Result<()> {
        let named = |name: &str| self.inner_groups.iter().position(|group| group.name == name);
        let Some(at) = named(name).or_else(|| named(number_of_group(name)?)) else { return Ok(()) };
        let facets = self.inner_facets[at].clone();
        if facets.is_empty() {
            let place = &self.inner_groups[at].place;
            return Err(Error::Refused(format!("the fault \"{name}\", around {place}, meets another fault")));
        }
        let refused = |words: &str, facet: &Sorted<D>| {
            let corners = facet.map(|node| self.nodes[node as usize]);
            Err(Error::Refused(format!("the fault \"{name}\" {words} around {}", place(&centroid(&corners)))))
        };
        let numbers: HashMap<Sorted<D>, usize> = facets.iter().copied().zip(0..).collect();
        let on_fault: BTreeSet<u32> = facets.iter().flatten().copied().collect();
        // The two cells of each facet, and the cells around each node.
        let mut sides = vec![Vec::new(); facets.len()];
        let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (cell, nodes) in self.cells.chunks_exact(D + 1).enumerate() {
            nodes.iter().filter(|node| on_fault.contains(node)).for_each(|node| {
                around.entry(*node).or_default().push(cell);
            });
            for opposite in 0..=D {
                if let Some(&facet) = numbers.get(&sorted(facet_of::<D>(nodes, opposite))) {
                    sides[facet].push((cell, opposite));
                }
            }
        }
        if let Some(facet) = sides.iter().position(|cells| cells.len() != 2) {
            return refused("is on the surface of the body", &facets[facet]);
        }
        // The sides of facets at a common node that becomes two are in the same group.
        let mut groups = Groups::new(2 * facets.len());
        let mut split: BTreeMap<u32, Vec<Vec<usize>>> = BTreeMap::new();
        for (&node, cells) in &around {
            let parts = self.parts_around(node, cells, &numbers);
            match parts.len() {
                1 => continue,
                2 => {}
                _ => {
                    let facet = facets.iter().find(|facet| facet.contains(&node)).unwrap_or(&facets[0]);
                    return refused("branches, which a fault can't do,", facet);
                }
            }
            for part in &parts {
                let at_node = (0..facets.len()).filter(|number| facets[*number].contains(&node));
                let both = at_node.flat_map(|number| [(number, 0), (number, 1)]);
                let here = both.filter(|(number, side)| part.contains(&sides[*number][*side].0));
                let mut of_part = here.map(|(number, side)| 2 * number + side);
                if let Some(first) = of_part.next() {
                    of_part.for_each(|other| groups.join(first, other));
                }
            }
            split.insert(node, parts);
        }
        let opens = |facet: &Sorted<D>| facet.iter().any(|node| split.contains_key(node));
        if split.is_empty() {
            return refused(
                "has no node away from its edge, so that it cannot open; refine the mesh",
                &facets[0],
            );
        }
        let one_sided = |number: usize| groups.of(2 * number) == groups.of(2 * number + 1);
        if let Some(facet) = (0..facets.len()).find(|number| opens(&facets[*number]) && one_sided(*number)) {
            return refused("has one side only", &facets[facet]);
        }
        // Of each connected part, the side of the first facet carries the law.
        let mut carries: HashMap<usize, bool> = HashMap::new();
        for number in 0..facets.len() {
            let [first, second] = [0, 1].map(|side| groups.of(2 * number + side));
            let known = carries.get(&first).copied().or_else(|| carries.get(&second).map(|carries| !carries));
            let first_carries = known.unwrap_or(true);
            carries.insert(first, first_carries);
            carries.insert(second, !first_carries);
        }
        let carries = |number: usize, side: usize| carries[&groups.of(2 * number + side)];
        let mut moved: HashMap<(usize, u32), u32> = HashMap::new();
        for (&node, parts) in &split {
            let at_node = (0..facets.len()).filter(|number| facets[*number].contains(&node));
            let Some((number, side)) =
                at_node.flat_map(|number| [(number, 0), (number, 1)]).find(|(n, side)| carries(*n, *side))
            else {
                continue;
            };
            let cell = sides[number][side].0;
            let twin = self.nodes.len() as u32;
            self.nodes.push(self.nodes[node as usize]);
            let part = parts.iter().find(|part| part.contains(&cell)).into_iter().flatten();
            part.for_each(|&cell| {
                moved.insert((cell, node), twin);
            });
        }
        for (cell, nodes) in self.cells.chunks_exact_mut(D + 1).enumerate() {
            nodes.iter_mut().for_each(|node| *node = moved.get(&(cell, *node)).copied().unwrap_or(*node));
        }
        for (facet, &cell) in self.facets.iter_mut().zip(&self.facet_cells) {
            let key = |node| (cell as usize, node);
            facet.iter_mut().for_each(|node| *node = moved.get(&key(*node)).copied().unwrap_or(*node));
        }
        let mut named = [Vec::new(), Vec::new()];
        for number in (0..facets.len()).filter(|number| opens(&facets[*number])) {
            for (side, &(cell, opposite)) in sides[number].iter().enumerate() {
                named[usize::from(!carries(number, side))].push(self.facets.len() as u32);
                self.facets.push(facet_of::<D>(&self.cells[cell * (D + 1)..(cell + 1) * (D + 1)], opposite));
                self.facet_cells.push(cell as u32);
            }
        }
        let [own, other] = named;
        self.boundaries.push(Boundary { name: name.into(), facets: own });
        self.boundaries.push(Boundary { name: other_side(name), facets: other });
        self.inner_groups.remove(at);
        self.inner_facets.remove(at);
        // Facets of faults that meet this one would have nodes of one side or the other.
        let meets = |facets: &Vec<Sorted<D>>| facets.iter().flatten().any(|node| split.contains_key(node));
        self.inner_facets.iter_mut().filter(|facets| meets(facets)).for_each(Vec::clear);
        Ok(())
    }

    /// The cells around a node, in parts that are connected through facets at the node that are not on the fault.
    fn parts_around(&self, node: u32, cells: &[usize], fault: &HashMap<Sorted<D>, usize>) -> Vec<Vec<usize>> {
        let mut groups = Groups::new(cells.len());
        let mut known: HashMap<Sorted<D>, usize> = HashMap::new();
        for (number, &cell) in cells.iter().enumerate() {
            let nodes = &self.cells[cell * (D + 1)..(cell + 1) * (D + 1)];
            for opposite in (0..=D).filter(|at| nodes[*at] != node) {
                let facet = sorted(facet_of::<D>(nodes, opposite));
                if fault.contains_key(&facet) {
                    continue;
                }
                if let Some(other) = known.insert(facet, number) {
                    groups.join(number, other);
                }
            }
        }
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        cells
            .iter()
            .enumerate()
            .for_each(|(number, &cell)| parts.entry(groups.of(number)).or_default().push(cell));
        parts.into_values().collect()
    }
}

fn sorted<const D: usize>(mut facet: [u32; D]) -> Sorted<D> {
    facet.sort_unstable();
    facet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        InnerGroup, Tags,
        check::validate,
        generate::{Diagonal, box_mesh, rectangle},
        surface::Topology,
    };

    /// Makes the facets between cells whose nodes all satisfy this the group `fault`.
    fn with_fault<const D: usize>(
        mut mesh: GlobalMesh<D>,
        on_it: impl Fn(&[f64; D]) -> bool,
    ) -> GlobalMesh<D> {
        let outer: BTreeSet<_> = mesh.facets.iter().map(|facet| sorted(*facet)).collect();
        let cells = mesh.cells.chunks_exact(D + 1);
        let all =
            cells.flat_map(|cell| (0..=D).map(|at| sorted(facet_of::<D>(cell, at))).collect::<Vec<_>>());
        let is_on = |facet: &[u32; D]| facet.iter().all(|node| on_it(&mesh.nodes[*node as usize]));
        let facets: BTreeSet<_> = all.filter(|facet| is_on(facet) && !outer.contains(facet)).collect();
        let group = InnerGroup { name: "fault".into(), facets: facets.len(), place: String::new() };
        mesh.inner_groups.push(group);
        mesh.inner_facets.push(facets.into_iter().collect());
        mesh
    }

    /// Splits the mesh; gives the number of new nodes and of facets on each side, which must be at the same places and opposite.
    fn split<const D: usize>(mut mesh: GlobalMesh<D>) -> [usize; 3] {
        let (nodes, cells) = (mesh.nodes.len(), mesh.cells.len());
        mesh.split_along("fault").unwrap();
        validate(&mesh, &Tags::default()).unwrap();
        let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap();
        assert_eq!(topology.facets_without_neighbour(), mesh.facets.len(), "the surface is complete");
        assert_eq!(mesh.cells.len(), cells);
        let places = |name: &str| -> Vec<[u64; D]> {
            let boundary = mesh.boundaries.iter().find(|boundary| boundary.name == name).unwrap();
            let corners = boundary.facets.iter().map(|facet| mesh.facet_corners(*facet as usize));
            let mut all: Vec<[u64; D]> =
                corners.map(|corners| centroid(&corners).map(|x| (x * 1e9).round() as u64)).collect();
            all.sort_unstable();
            all
        };
        let [own, other] = [places("fault"), places(&other_side("fault"))];
        assert_eq!(own, other);
        [mesh.nodes.len() - nodes, own.len(), other.len()]
    }

    #[test]
    fn a_fault_through_a_body_makes_two_and_one_inside_keeps_its_ends() {
        let square = || rectangle([1.0, 1.0], [4, 4], Diagonal::Alternating, [1.0; 2]).unwrap();
        assert_eq!(split(with_fault(square(), |x| x[1] == 0.5)), [5, 4, 4]);
        let inside = |x: &[f64; 2]| x[1] == 0.5 && (0.25..=0.75).contains(&x[0]);
        assert_eq!(split(with_fault(square(), inside)), [1, 2, 2]);
        assert_eq!(split(with_fault(square(), |x| x[1] == 0.5 && x[0] <= 0.5)), [2, 2, 2]);
        let cube = || box_mesh([1.0; 3], [2, 2, 2], [1.0; 3]).unwrap();
        assert_eq!(split(with_fault(cube(), |x| x[2] == 0.5)), [9, 8, 8]);
        // One half of the plane: its edge inside the body stays whole.
        assert_eq!(split(with_fault(cube(), |x| x[2] == 0.5 && x[0] <= 0.5)), [3, 4, 4]);
    }

    #[test]
    fn faults_that_branch_or_cannot_open_are_refused() {
        let square = rectangle([1.0, 1.0], [4, 4], Diagonal::Alternating, [1.0; 2]).unwrap();
        let mut branched = with_fault(square.clone(), |x| x[1] == 0.5 || (x[0] == 0.5 && x[1] >= 0.5));
        let error = branched.split_along("fault").unwrap_err().to_string();
        assert!(error.contains("branches"), "{error}");
        let mut short = with_fault(square, |x| x[1] == 0.5 && (0.25..=0.5).contains(&x[0]));
        let error = short.split_along("fault").unwrap_err().to_string();
        assert!(error.contains("has no node away from its edge"), "{error}");
    }

    #[test]
    fn a_fault_that_meets_another_is_refused() {
        let square = rectangle([1.0, 1.0], [4, 4], Diagonal::Alternating, [1.0; 2]).unwrap();
        let mut first = with_fault(square, |x| x[1] == 0.5);
        first.inner_groups[0].name = "other".into();
        let mut both = with_fault(first, |x| x[0] == 0.5);
        both.split_along("other").unwrap();
        let error = both.split_along("fault").unwrap_err().to_string();
        assert!(error.contains("meets another fault"), "{error}");
    }
}
