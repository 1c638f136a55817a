//! Faults: meshes that are split along a named surface inside the body.

use super::{
    Boundary, GlobalMesh,
    shape::{centroid, facet_normal, facet_of},
    tags::place,
};
use crate::error::{Error, Result};
use crate::job::number_of_group;
use crate::linear_algebra::tensor::{Vector, add_scaled, norm};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The name of the boundary on the other side of a fault.
pub fn other_side(fault: &str) -> String {
    format!("other side of {fault}")
}

/// A fault along which a mesh has been split.
#[derive(Debug)]
pub struct FoundFault {
    /// That its facets are inside the body, and between which cells.
    pub words: String,
    /// Number of the facets of its name on the surface, which are left out.
    pub outer: usize,
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

/// One side of a facet: the number of the facet, and 0 or 1.
type Side = [usize; 2];

/// A surface along which a mesh is split.
struct Fault<'a, const D: usize> {
    name: &'a str,
    facets: Vec<Sorted<D>>,
    /// The numbers of the facets.
    numbers: HashMap<Sorted<D>, usize>,
    /// The cells on the sides of each facet, and the position of their node opposite to it.
    cells: Vec<Vec<(usize, usize)>>,
    /// The nodes that become two, and the cells around each on the one side and on the other.
    split: BTreeMap<u32, Vec<Vec<usize>>>,
    /// The sides of facets: those that meet on the same side of a node that becomes two are in the same group.
    sides: Groups,
}

impl<'a, const D: usize> Fault<'a, D> {
    /// The fault with this name and these facets; refused where it can't open.
    fn new(mesh: &GlobalMesh<D>, name: &'a str, facets: Vec<Sorted<D>>) -> Result<Self> {
        let numbers = facets.iter().copied().zip(0..).collect();
        let (cells, sides) = (vec![Vec::new(); facets.len()], Groups::new(2 * facets.len()));
        let mut fault = Self { name, facets, numbers, cells, split: BTreeMap::new(), sides };
        let around = fault.find_cells(mesh);
        if let Some(facet) = fault.cells.iter().position(|cells| cells.len() != 2) {
            return Err(fault.refusal(mesh, "is on the surface of the body", facet));
        }
        fault.split_nodes(mesh, &around)?;
        if fault.split.is_empty() {
            let words = "has no node away from its edge, so that it cannot open; refine the mesh";
            return Err(fault.refusal(mesh, words, 0));
        }
        let one_sided = |facet: usize| fault.group([facet, 0]) == fault.group([facet, 1]);
        match (0..fault.facets.len()).find(|facet| fault.opens(*facet) && one_sided(*facet)) {
            Some(facet) => Err(fault.refusal(mesh, "has one side only", facet)),
            None => Ok(fault),
        }
    }

    fn refusal(&self, mesh: &GlobalMesh<D>, words: &str, facet: usize) -> Error {
        let corners = self.facets[facet].map(|node| mesh.nodes[node as usize]);
        Error::Refused(format!("the fault \"{}\" {words} around {}", self.name, place(&centroid(&corners))))
    }

    /// Finds the cells of each facet, and gives those around each node.
    fn find_cells(&mut self, mesh: &GlobalMesh<D>) -> BTreeMap<u32, Vec<usize>> {
        let on_fault: BTreeSet<u32> = self.facets.iter().flatten().copied().collect();
        let mut around: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (cell, nodes) in mesh.cells.chunks_exact(D + 1).enumerate() {
            nodes.iter().filter(|node| on_fault.contains(node)).for_each(|node| {
                around.entry(*node).or_default().push(cell);
            });
            for opposite in 0..=D {
                if let Some(&facet) = self.numbers.get(&sorted(facet_of::<D>(nodes, opposite))) {
                    self.cells[facet].push((cell, opposite));
                }
            }
        }
        around
    }

    /// Finds the nodes that become two, and the sides of facets that belong together.
    fn split_nodes(&mut self, mesh: &GlobalMesh<D>, around: &BTreeMap<u32, Vec<usize>>) -> Result<()> {
        for (&node, cells) in around {
            let parts = mesh.parts_around(node, cells, &self.numbers);
            match parts.len() {
                1 => continue,
                2 => {}
                _ => {
                    let facet = self.facets.iter().position(|facet| facet.contains(&node)).unwrap_or(0);
                    return Err(self.refusal(mesh, "branches, which a fault can't do,", facet));
                }
            }
            for part in &parts {
                let here: Vec<Side> =
                    self.sides_at(node).filter(|side| part.contains(&self.cell(*side))).collect();
                here.windows(2).for_each(|pair| {
                    let [one, other] = [pair[0], pair[1]].map(|[facet, side]| 2 * facet + side);
                    self.sides.join(one, other);
                });
            }
            self.split.insert(node, parts);
        }
        Ok(())
    }

    /// The sides of all facets with this node.
    fn sides_at(&self, node: u32) -> impl Iterator<Item = Side> {
        let facets = (0..self.facets.len()).filter(move |facet| self.facets[*facet].contains(&node));
        facets.flat_map(|facet| [[facet, 0], [facet, 1]])
    }

    /// The cell on this side.
    fn cell(&self, [facet, side]: Side) -> usize {
        self.cells[facet][side].0
    }

    /// The group of this side.
    fn group(&self, [facet, side]: Side) -> usize {
        self.sides.of(2 * facet + side)
    }

    /// Whether some node of a facet becomes two.
    fn opens(&self, facet: usize) -> bool {
        self.facets[facet].iter().any(|node| self.split.contains_key(node))
    }

    /// For each group of sides, whether it carries the law: in each connected part, the side below the other one does. That of the first
    /// facet does where neither is.
    fn carriers(&self, mesh: &GlobalMesh<D>) -> HashMap<usize, bool> {
        // The two groups of each part, that of its first facet first, and the sum of the outward normals of its facets.
        let mut parts: Vec<([usize; 2], Vector<D>)> = Vec::new();
        for facet in 0..self.facets.len() {
            let [first, second] = [0, 1].map(|side| self.group([facet, side]));
            let normal = facet_normal(&mesh.corners_of(self.cells[facet][0]));
            match parts.iter_mut().find(|(groups, _)| groups.contains(&first) || groups.contains(&second)) {
                Some((groups, sum)) => {
                    let sign = if groups[0] == first || groups[1] == second { 1.0 } else { -1.0 };
                    *sum = add_scaled(sum, sign, &normal);
                }
                None => parts.push(([first, second], normal)),
            }
        }
        let sides = parts.into_iter().flat_map(|([first, second], normal)| {
            let first_carries = !points_down(&normal);
            [(first, first_carries), (second, !first_carries)]
        });
        sides.collect()
    }
}

/// Whether the last component of a normal that is not rounding is negative.
fn points_down<const D: usize>(normal: &Vector<D>) -> bool {
    let rounding = 1e-9 * norm(normal);
    normal.iter().rev().find(|component| component.abs() > rounding).is_some_and(|component| *component < 0.0)
}

impl<const D: usize> GlobalMesh<D> {
    /// The corners of the facet of a cell opposite to one of its nodes.
    fn corners_of(&self, (cell, opposite): (usize, usize)) -> [Vector<D>; D] {
        facet_of::<D>(self.cell(cell), opposite).map(|node| self.nodes[node as usize])
    }

    /// Splits the mesh along the facets inside the body that have this name: their nodes become two, except on the edge of the surface
    /// inside the body, where cells stay joined. The sides become two boundaries: that below the surface, left of a vertical one, has this
    /// name, the other one that of [`other_side`]. Refused where the surface branches, meets another fault, has one side only, or has no
    /// node that can become two. `None` if there are no facets of this name inside the body.
    pub fn split_along(&mut self, name: &str) -> Result<Option<FoundFault>> {
        let named = |name: &str| self.inner_groups.iter().position(|group| group.name == name);
        let Some(at) = named(name).or_else(|| named(number_of_group(name)?)) else { return Ok(None) };
        let facets = self.inner_facets[at].clone();
        if facets.is_empty() {
            let place = &self.inner_groups[at].place;
            return Err(Error::Refused(format!("the fault \"{name}\", around {place}, meets another fault")));
        }
        let fault = Fault::new(self, name, facets)?;
        let (words, outer) = (self.words_of(&fault), self.inner_groups[at].outer);
        let carriers = fault.carriers(self);
        let carries = |side: Side| carriers[&fault.group(side)];
        self.double_nodes(&fault, carries);
        self.add_sides(&fault, carries);
        self.inner_groups.remove(at);
        self.inner_facets.remove(at);
        // Facets of faults that meet this one would have nodes of one side or the other.
        let meets =
            |facets: &Vec<Sorted<D>>| facets.iter().flatten().any(|node| fault.split.contains_key(node));
        self.inner_facets.iter_mut().filter(|facets| meets(facets)).for_each(Vec::clear);
        Ok(Some(FoundFault { words, outer }))
    }

    /// That facets of this name are inside the body, and between which cells.
    fn words_of(&self, fault: &Fault<'_, D>) -> String {
        let corners = fault.facets[0].map(|node| self.nodes[node as usize]);
        let regions: BTreeSet<&str> = fault.cells[0]
            .iter()
            .map(|(cell, _)| &*self.regions[usize::from(self.cell_regions[*cell])])
            .collect();
        let parted: Vec<String> = regions.into_iter().map(|region| format!("\"{region}\"")).collect();
        let parted = match &*parted {
            [one] => format!("two cells of region {one}"),
            several => format!("cells of the regions {}", several.join(" and ")),
        };
        format!(
            "\"{}\" lies inside the body: {} of its facets have a cell on both sides, for example {parted} around {}; the mesh is split there into two \
             sides that touch each other",
            fault.name,
            fault.facets.len(),
            place(&centroid(&corners))
        )
    }

    /// Gives the cells on the side that carries the law, and their facets, new nodes in place of those that become two.
    fn double_nodes(&mut self, fault: &Fault<'_, D>, carries: impl Fn(Side) -> bool) {
        let mut twins: HashMap<(usize, u32), u32> = HashMap::new();
        for (&node, parts) in &fault.split {
            let Some(side) = fault.sides_at(node).find(|side| carries(*side)) else { continue };
            let twin = self.nodes.len() as u32;
            self.nodes.push(self.nodes[node as usize]);
            let part = parts.iter().find(|part| part.contains(&fault.cell(side))).into_iter().flatten();
            twins.extend(part.map(|&cell| ((cell, node), twin)));
        }
        let replace = |cell: usize, nodes: &mut [u32]| {
            nodes.iter_mut().for_each(|node| *node = twins.get(&(cell, *node)).copied().unwrap_or(*node));
        };
        self.cells.chunks_exact_mut(D + 1).enumerate().for_each(|(cell, nodes)| replace(cell, nodes));
        let facets = self.facets.iter_mut().zip(&self.facet_cells);
        facets.for_each(|(facet, &cell)| replace(cell as usize, facet));
    }

    /// Adds the facets of both sides as boundaries, that of the side that carries the law first.
    fn add_sides(&mut self, fault: &Fault<'_, D>, carries: impl Fn(Side) -> bool) {
        let mut sides = [Vec::new(), Vec::new()];
        for number in (0..fault.facets.len()).filter(|facet| fault.opens(*facet)) {
            for (side, &(cell, opposite)) in fault.cells[number].iter().enumerate() {
                sides[usize::from(!carries([number, side]))].push(self.facets.len() as u32);
                self.facets.push(facet_of::<D>(&self.cells[cell * (D + 1)..(cell + 1) * (D + 1)], opposite));
                self.facet_cells.push(cell as u32);
            }
        }
        let names = [fault.name.into(), other_side(fault.name)];
        let boundaries = names.into_iter().zip(sides).map(|(name, facets)| Boundary { name, facets });
        self.boundaries.extend(boundaries);
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
        let group = InnerGroup { name: "fault".into(), facets: facets.len(), ..InnerGroup::default() };
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

    /// The sum of the outward normals of the side that has the name of the fault, of a mesh and of that with its cells in reverse order.
    fn outward<const D: usize>(mesh: &GlobalMesh<D>) -> [Vector<D>; 2] {
        let mut reversed = mesh.clone();
        reversed.cells = mesh.cells.chunks_exact(D + 1).rev().flatten().copied().collect();
        let last = reversed.cells.len() / (D + 1) - 1;
        reversed.facet_cells.iter_mut().for_each(|cell| *cell = last as u32 - *cell);
        [mesh.clone(), reversed].map(|mut mesh| {
            mesh.split_along("fault").unwrap();
            let own = mesh.boundaries.iter().find(|boundary| boundary.name == "fault").unwrap();
            let normals = own.facets.iter().map(|facet| facet_normal(&mesh.facet_corners(*facet as usize)));
            normals.fold([0.0; D], |sum, normal| add_scaled(&sum, 1.0, &normal))
        })
    }

    #[test]
    fn the_side_below_or_left_of_a_fault_has_its_name_in_any_order_of_cells() {
        let square = rectangle([1.0, 1.0], [4, 4], Diagonal::Left, [1.0; 2]).unwrap();
        for (on_it, expected) in [
            ((|x| x[1] == 0.5) as fn(&[f64; 2]) -> bool, [0.0, 1.0]),
            (|x| x[0] == 0.5, [1.0, 0.0]),
            // A fault that falls to the right.
            (|x| x[0] + x[1] == 1.0, [1.0, 1.0]),
        ] {
            assert_eq!(outward(&with_fault(square.clone(), on_it)), [expected; 2]);
        }
        let cube = || box_mesh([1.0; 3], [2, 2, 2], [1.0; 3]).unwrap();
        assert_eq!(outward(&with_fault(cube(), |x| x[2] == 0.5)), [[0.0, 0.0, 1.0]; 2]);
        assert_eq!(outward(&with_fault(cube(), |x| x[1] == 0.5)), [[0.0, 1.0, 0.0]; 2]);
        // Two faults: each has its lower side.
        let two = with_fault(square, |x| x[1] == 0.25 || x[1] == 0.75);
        assert_eq!(outward(&two), [[0.0, 2.0]; 2]);
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
