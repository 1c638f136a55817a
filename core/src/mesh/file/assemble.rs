//! Assembles a mesh from the contents of a file.

use super::document::{Block, Document};
use super::node_sets::name_node_sets;
use super::points::name_points;
use crate::error::{Error, Result};
use crate::linear_algebra::tensor::{Vector, add_scaled, norm};
use crate::mesh::shape::edges_of_cell;
use crate::mesh::surface::{Topology, sorted};
use crate::mesh::tags::{Tags, place};
use crate::mesh::{Boundary, GlobalMesh, InnerGroup, check, midpoint, shape};
use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

/// Marker, in place of an id, of a node without a cell.
const UNUSED: u32 = u32::MAX;

/// An edge is straight if the distance of its node from its midpoint is below this multiple of its length.
const STRAIGHT: f64 = 1e-9;

/// Largest number of physical groups of an entity; each copies the facets of the entity in memory.
const MOST_GROUPS: usize = 64;

/// The mesh of the document's simplices of dimension `D`, validated; adds notes to those of the document.
pub(super) fn assemble<const D: usize>(document: &mut Document) -> Result<GlobalMesh<D>> {
    let positions = Positions::new(&document.node_tags)?;
    let mut mesh = GlobalMesh::<D>::default();
    let mut tags = Tags::default();
    let mut ids = vec![UNUSED; document.points.len()];
    let mut midsides = Vec::new();
    for block in blocks(document, D) {
        for (element, nodes) in block.elements() {
            for &tag in &nodes[..=D] {
                let position = positions.find(tag, element)?;
                mesh.cells.push(position);
                ids[position as usize] = 0;
            }
            for &tag in &nodes[D + 1..] {
                midsides.push(positions.find(tag, element)?);
            }
        }
        tags.cells.extend(&block.tags);
    }
    mesh.is_second_order = !midsides.is_empty();
    if mesh.is_second_order && midsides.len() != mesh.cell_count() * edges_of_cell::<D>().len() {
        return Err(Error::Refused(
            "the file has cells of first and of second order: mesh the whole body with the same Mesh.ElementOrder".into(),
        ));
    }
    for (position, id) in ids.iter_mut().enumerate().filter(|(_, id)| **id != UNUSED) {
        *id = mesh.nodes.len() as u32;
        mesh.nodes.push(std::array::from_fn(|i| document.points[position][i]));
        tags.nodes.push(document.node_tags[position]);
    }
    if D == 2 {
        let corners = (0..ids.len()).filter(|&position| ids[position] != UNUSED);
        let used = corners.chain(midsides.iter().map(|&position| position as usize));
        flat(used.map(|position| (document.node_tags[position], &document.points[position])))?;
    }
    mesh.cells.iter_mut().for_each(|node| *node = ids[*node as usize]);
    name_regions(&mut mesh, document)?;
    let reversed = reorient(&mut mesh, document);
    check::cells(&mesh, &tags)?;
    if mesh.is_second_order {
        curve(&mut mesh, document, midsides, &reversed, &tags)?;
    }
    let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &tags)?;
    (mesh.facets, mesh.facet_cells) = topology.outer_facets(&mesh.cells);
    drop(topology);
    let id = |tag, element| Ok(ids[positions.find(tag, element)? as usize]);
    name_boundaries(&mut mesh, document, id)?;
    name_points(
        &mut mesh,
        document,
        |tag, element| Ok(Some(id(tag, element)?).filter(|&id| id != UNUSED)),
        |tag, element, ends| Ok(side(ends, &document.points[positions.find(tag, element)? as usize]).0),
    )?;
    let corner = |tag| Ok(Some(id(tag, 0)?).filter(|&id| id != UNUSED));
    let notes = name_node_sets(&mut mesh, document, corner)?;
    document.notes.extend(notes);
    if mesh.boundaries.is_empty() {
        document.notes.push(name_surface(&mut mesh));
    }
    check::nodes(&mesh, &tags)?;
    Ok(mesh)
}

/// Keeps the nodes on edges, given by their positions in the file, cell by cell in the order of a block, if edges are curved. `reversed` are the
/// cells whose last two corners were swapped. Refuses cells that are folded or that have different nodes on an edge.
fn curve<const D: usize>(
    mesh: &mut GlobalMesh<D>,
    document: &Document,
    mut midsides: Vec<u32>,
    reversed: &[Range<usize>],
    tags: &Tags,
) -> Result<()> {
    let edges = edges_of_cell::<D>();
    for nodes in midsides.chunks_exact_mut(edges.len()).filter(|_| D == 3) {
        // In a block: edges 01, 12, 20, 03, 23, 13.
        nodes.swap(4, 5);
    }
    for cell in reversed.iter().cloned().flatten() {
        let nodes = &mut midsides[cell * edges.len()..(cell + 1) * edges.len()];
        // Triangles: corners 1 and 2 and thus edges 01 and 20; tetrahedra: corners 2 and 3, edges 12 and 13, 20 and 03.
        let swaps: &[(usize, usize)] = if D == 2 { &[(0, 2)] } else { &[(1, 4), (2, 3)] };
        swaps.iter().for_each(|&(a, b)| nodes.swap(a, b));
    }
    let mut of_edges: Vec<([u32; 2], u32, u32)> = Vec::with_capacity(midsides.len());
    let mut is_curved = false;
    mesh.curved.reserve_exact(midsides.len());
    for (cell, nodes) in midsides.chunks_exact(edges.len()).enumerate() {
        for (&[a, b], &node) in edges.iter().zip(nodes) {
            let [a, b] = [a, b].map(|corner| mesh.cell(cell)[corner]);
            of_edges.push(([a.min(b), a.max(b)], node, cell as u32));
            let [a, b] = [a, b].map(|corner| &mesh.nodes[corner as usize]);
            let (place, is_straight) = side([a, b], &document.points[node as usize]);
            is_curved |= !is_straight;
            mesh.curved.push(place);
        }
    }
    of_edges.sort_unstable();
    let differ = |pair: &&[([u32; 2], u32, u32)]| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1;
    if let Some(pair) = of_edges.windows(2).find(differ) {
        let cells = [pair[0].2, pair[1].2];
        return Err(Error::Refused(format!(
            "{} and {} share an edge but have different nodes on it: make the elements of second order together \
             (Gmsh: Mesh.ElementOrder = 2, or Set order 2)",
            tags.cell(cells[0].min(cells[1]) as usize),
            tags.cell(cells[0].max(cells[1]) as usize)
        )));
    }
    if !is_curved {
        mesh.curved = Vec::new();
        return Ok(());
    }
    check::curved_cells(mesh, tags)
}

/// The place of the node on an edge between these ends, and whether the edge is straight: then it is the midpoint.
fn side<const D: usize>([a, b]: [&Vector<D>; 2], at: &[f64; 3]) -> (Vector<D>, bool) {
    let (at, straight): (Vector<D>, _) = (std::array::from_fn(|i| at[i]), midpoint(a, b));
    let size = straight.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
    let allowed = STRAIGHT * norm(&add_scaled(b, -1.0, a)) + 8.0 * f64::EPSILON * size;
    let is_straight = norm(&add_scaled(&at, -1.0, &straight)) <= allowed;
    (if is_straight { straight } else { at }, is_straight)
}

fn blocks(document: &Document, dimension: usize) -> impl Iterator<Item = &Block> {
    document.blocks.iter().filter(move |block| block.shape.dimension() == dimension)
}

/// The index of the node with a tag in the file.
enum Positions {
    /// Array over all tags from the smallest one, for tags without large gaps.
    Dense { smallest: u64, positions: Vec<u32> },
    /// In ascending order of tags.
    Sparse(Vec<(u64, u32)>),
}

impl Positions {
    fn new(tags: &[u64]) -> Result<Self> {
        if tags.len() > i32::MAX as usize {
            return Err(Error::Refused(format!(
                "{} nodes: ids are 32-bit, at most {} fit",
                tags.len(),
                i32::MAX
            )));
        }
        let twice = |tag| Err(Error::Refused(format!("two nodes have the tag {tag}")));
        let smallest = tags.iter().copied().min().unwrap_or(0);
        let span = tags.iter().copied().max().unwrap_or(0) - smallest;
        if span < 4 * tags.len() as u64 + 1024 {
            let mut positions = vec![UNUSED; span as usize + 1];
            for (position, &tag) in tags.iter().enumerate() {
                if std::mem::replace(&mut positions[(tag - smallest) as usize], position as u32) != UNUSED {
                    return twice(tag);
                }
            }
            return Ok(Self::Dense { smallest, positions });
        }
        let mut sparse: Vec<(u64, u32)> = tags.iter().copied().zip(0..).collect();
        sparse.sort_unstable();
        match sparse.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => twice(pair[0].0),
            None => Ok(Self::Sparse(sparse)),
        }
    }

    #[inline]
    fn find(&self, tag: u64, element: u64) -> Result<u32> {
        let found = match self {
            Self::Dense { smallest, positions } => tag
                .checked_sub(*smallest)
                .and_then(|offset| positions.get(usize::try_from(offset).ok()?).copied())
                .filter(|&position| position != UNUSED),
            Self::Sparse(sparse) => {
                sparse.binary_search_by_key(&tag, |entry| entry.0).ok().map(|at| sparse[at].1)
            }
        };
        found.ok_or_else(|| {
            Error::Refused(format!("element {element} has the node {tag}, which the file does not contain"))
        })
    }
}

/// Refuses nodes that do not lie in one plane of constant z.
fn flat<'a>(points: impl Iterator<Item = (u64, &'a [f64; 3])>) -> Result<()> {
    let mut extent = 0f64;
    let mut lowest: Option<(f64, u64)> = None;
    let mut highest: Option<(f64, u64)> = None;
    for (tag, point) in points {
        extent = extent.max(point[0].abs()).max(point[1].abs());
        if lowest.is_none_or(|(z, _)| point[2] < z) {
            lowest = Some((point[2], tag));
        }
        if highest.is_none_or(|(z, _)| point[2] > z) {
            highest = Some((point[2], tag));
        }
    }
    match (lowest, highest) {
        (Some((low, a)), Some((high, b))) if high - low > 1e-12 * extent || !(high - low).is_finite() => {
            Err(Error::Refused(format!(
                "a mesh of triangles must lie in a plane of constant z, but node {a} has z = {low} and node {b} has \
                 z = {high}. Mesh the volume, or flatten the surface"
            )))
        }
        _ => Ok(()),
    }
}

/// The name of a physical group, or its number if it has no name.
fn name(document: &Document, dimension: usize, group: u32) -> String {
    document.names.get(&(dimension, group)).cloned().unwrap_or_else(|| group.to_string())
}

/// The distinct names of an entity's groups.
fn group_names(document: &Document, dimension: usize, entity: i32) -> Vec<String> {
    let groups = document.groups.get(&(dimension, entity)).map_or(&[][..], Vec::as_slice);
    let mut names: Vec<String> = groups.iter().map(|&group| name(document, dimension, group)).collect();
    names.sort();
    names.dedup();
    names
}

fn name_regions<const D: usize>(mesh: &mut GlobalMesh<D>, document: &Document) -> Result<()> {
    let entity_kind = if D == 2 { "surface" } else { "volume" };
    let blocks: Vec<&Block> = blocks(document, D).filter(|block| !block.tags.is_empty()).collect();
    let mut used: Vec<(u32, i32)> = Vec::new();
    for block in &blocks {
        let groups = document.groups.get(&(D, block.entity)).into_iter().flatten();
        used.extend(groups.map(|&group| (group, block.entity)));
    }
    if used.is_empty() {
        mesh.regions = vec!["body".into()];
        mesh.cell_regions = vec![0; mesh.cell_count()];
        return Ok(());
    }
    used.sort_unstable();
    let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
    for (group, _) in used {
        let name = name(document, D, group);
        if !numbers.contains_key(&name) {
            numbers.insert(name.clone(), mesh.regions.len());
            mesh.regions.push(name);
        }
    }
    if mesh.regions.len() > u16::MAX as usize {
        return Err(Error::Refused(format!(
            "{} regions: at most {} are possible",
            mesh.regions.len(),
            u16::MAX
        )));
    }
    for block in blocks {
        let names = group_names(document, D, block.entity);
        let [name] = &names[..] else {
            return Err(Error::Refused(match names.len() {
                0 => format!(
                    "{entity_kind} {} has cells but no physical group, while others have one: put it into a physical \
                     group, so that it gets a material",
                    block.entity
                ),
                _ => format!(
                    "{entity_kind} {} belongs to the regions {}: a cell has one material, keep one of these physical \
                     groups",
                    block.entity,
                    names.join(" and ")
                ),
            }));
        };
        let region = numbers[name] as u16;
        mesh.cell_regions.extend(std::iter::repeat_n(region, block.tags.len()));
    }
    Ok(())
}

/// Reverses the orientation of the cells of an entity if all of them are negatively oriented, because its normal points in the
/// opposite direction. Gives the cells whose last two corners were swapped.
fn reorient<const D: usize>(mesh: &mut GlobalMesh<D>, document: &Document) -> Vec<Range<usize>> {
    let (mut first, mut reversed) = (0, Vec::new());
    for block in blocks(document, D) {
        let cells = first..first + block.tags.len();
        first = cells.end;
        if cells.clone().all(|cell| mesh.measure(cell) < 0.0) {
            mesh.cells[cells.start * (D + 1)..cells.end * (D + 1)]
                .chunks_exact_mut(D + 1)
                .for_each(|cell| cell.swap(D - 1, D));
            reversed.push(cells);
        }
    }
    reversed
}

/// Finds the facets of each physical group of dimension `D - 1`: boundaries on the surface, and groups with facets inside the body. `id`
/// is a node's id by its tag.
fn name_boundaries<const D: usize>(
    mesh: &mut GlobalMesh<D>,
    document: &Document,
    id: impl Fn(u64, u64) -> Result<u32>,
) -> Result<()> {
    let mut surface: Vec<([u32; D], u32)> =
        mesh.facets.iter().zip(0..).map(|(&facet, position)| (sorted(facet).0, position)).collect();
    surface.sort_unstable();
    // Boundaries are in the order of the numbers of their groups.
    let mut groups_of_facets: BTreeMap<u32, Group<D>> = BTreeMap::new();
    for block in blocks(document, D - 1) {
        let groups = document.groups.get(&(D - 1, block.entity)).map_or(&[][..], Vec::as_slice);
        if groups.is_empty() {
            continue;
        }
        if groups.len() > MOST_GROUPS {
            return Err(Error::Refused(format!(
                "entity {} belongs to {} physical groups: at most {MOST_GROUPS} boundaries can share a facet",
                block.entity,
                groups.len()
            )));
        }
        let mut found = Group::default();
        for (element, nodes) in block.elements() {
            let mut facet = [0; D];
            for (node, &tag) in facet.iter_mut().zip(nodes) {
                *node = id(tag, element)?;
            }
            let facet = sorted(facet).0;
            match surface.binary_search_by_key(&facet, |entry| entry.0) {
                Ok(at) => found.outer.push(surface[at].1),
                Err(_) => found.inner.push((facet, element)),
            }
        }
        for &group in groups {
            let all = groups_of_facets.entry(group).or_default();
            all.outer.extend(&found.outer);
            all.inner.extend(&found.inner);
        }
    }
    let mut by_name: Vec<(String, Group<D>)> = Vec::new();
    for (group, found) in groups_of_facets {
        let name = name(document, D - 1, group);
        match by_name.iter_mut().find(|(other, _)| *other == name) {
            Some((_, all)) => {
                all.outer.extend(found.outer);
                all.inner.extend(found.inner);
            }
            None => by_name.push((name, found)),
        }
    }
    refuse_facets_of_no_cell(mesh, &by_name)?;
    for (name, Group { outer: mut facets, mut inner }) in by_name {
        inner.sort_unstable();
        inner.dedup_by_key(|(facet, _)| *facet);
        facets.sort_unstable();
        facets.dedup();
        if let Some((facet, _)) = inner.iter().min_by_key(|(_, element)| element) {
            let corners: Vec<Vector<D>> = facet.iter().map(|&node| mesh.nodes[node as usize]).collect();
            let at = place(&shape::centroid(&corners));
            mesh.inner_groups.push(InnerGroup { name, facets: inner.len(), place: at, outer: facets.len() });
            mesh.inner_facets.push(inner.iter().map(|(facet, _)| *facet).collect());
            continue;
        }
        mesh.boundaries.push(Boundary { name, facets });
    }
    Ok(())
}

/// Makes the whole surface a boundary, which `where` divides; gives what the user should know.
fn name_surface<const D: usize>(mesh: &mut GlobalMesh<D>) -> String {
    let points = mesh.point_sets.iter().map(|set| &set.name);
    let used: HashSet<&String> = points.chain(mesh.inner_groups.iter().map(|group| &group.name)).collect();
    let mut name = "surface".to_owned();
    while used.contains(&name) {
        name.insert_str(0, "whole ");
    }
    let note = format!(
        "the file names no part of the surface: all of it is the boundary `{name}`, of which supports, loads and contacts take parts \
         by `where`"
    );
    mesh.boundaries.push(Boundary { name, facets: (0..mesh.facets.len() as u32).collect() });
    note
}

/// The facets of a physical group.
struct Group<const D: usize> {
    /// Positions of those on the surface.
    outer: Vec<u32>,
    /// The sorted nodes of the others, with their elements.
    inner: Vec<([u32; D], u64)>,
}

impl<const D: usize> Default for Group<D> {
    fn default() -> Self {
        Self { outer: Vec::new(), inner: Vec::new() }
    }
}

/// Refuses facets that are not on the surface, unless they are facets of cells.
fn refuse_facets_of_no_cell<const D: usize>(
    mesh: &GlobalMesh<D>,
    groups: &[(String, Group<D>)],
) -> Result<()> {
    let all = || groups.iter().flat_map(|(name, group)| group.inner.iter().map(move |inner| (name, inner)));
    let mut left: HashSet<[u32; D]> = all().map(|(_, (facet, _))| *facet).collect();
    if left.is_empty() {
        return Ok(());
    }
    for cell in mesh.cells.chunks_exact(D + 1) {
        for without in 0..=D {
            left.remove(&sorted(std::array::from_fn(|i| cell[if i < without { i } else { i + 1 }])).0);
        }
    }
    match all().find(|(_, (facet, _))| left.contains(facet)) {
        None => Ok(()),
        Some((name, (facet, element))) => {
            let kind = if D == 2 { "line" } else { "triangle" };
            let fault = match facet.windows(2).any(|pair| pair[0] == pair[1]) {
                true => "has the same node twice: delete it",
                false => "is not a facet of any cell: mesh the body and its boundary together",
            };
            Err(Error::Refused(format!("element {element}, a {kind} of the boundary `{name}`, {fault}")))
        }
    }
}
