//! The keywords of a file.

use super::elements::{Kind, Meaning, Part, meaning};
use super::lines::{Keyword, Lines, refuse, short};
use super::sets::{Name, Scope, Sets};
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::mesh::file::document::Shape;
use std::collections::HashSet;

/// Keywords that cannot be ignored, with the reason.
const REFUSED: [(&str, &str); 8] = [
    (
        "INCLUDE",
        "other files are not read: put the contents of the file in place of this line, or name the file with the mesh as mesh file",
    ),
    ("NGEN", GENERATED),
    ("NFILL", GENERATED),
    ("ELGEN", GENERATED),
    ("NCOPY", GENERATED),
    ("ELCOPY", GENERATED),
    ("NMAP", GENERATED),
    ("SYSTEM", "coordinates have to be those of the global system: write the mesh flattened"),
];
const GENERATED: &str = "the nodes and elements have to be in the file: write the mesh out (CalculiX style)";

/// Keywords that say nothing about the body, its loads or its steps.
const SILENT: [&str; 9] = [
    "HEADING",
    "PREPRINT",
    "PART",
    "END PART",
    "ASSEMBLY",
    "END ASSEMBLY",
    "INSTANCE",
    "END INSTANCE",
    "END STEP",
];

/// The note about a body of revolution, for runs that do not know that it is one.
pub const REVOLVED: &str =
    "a body of revolution (CAX): state [material] hypothesis = \"axisymmetric\" in the job";

/// Most keywords that a note names.
const NAMED: usize = 6;

/// The elements of one keyword `*ELEMENT`.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) kind: Kind,
    /// The name of their set.
    pub(super) set: Option<String>,
    pub(super) tags: Vec<u64>,
    pub(super) nodes: Vec<u64>,
}

impl Run {
    /// The tag and the node tags of each element.
    pub(super) fn elements(&self) -> impl Iterator<Item = (u64, &[u64])> {
        self.tags.iter().copied().zip(self.nodes.chunks_exact(self.kind.nodes))
    }
}

/// What is read of a file.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) node_tags: Vec<u64>,
    pub(super) points: Vec<[f64; 3]>,
    pub(super) runs: Vec<Run>,
    pub(super) node_sets: Sets,
    pub(super) element_sets: Sets,
    pub(super) surfaces: Vec<Surface>,
    /// The sets of `*SOLID SECTION`.
    pub(super) sections: Vec<Name>,
    /// Numbers of elements whose type has no shape.
    ignored_elements: Vec<u64>,
    ignored_types: Vec<String>,
    /// Whether elements are those of a body of revolution.
    is_revolved: bool,
    /// Whether membranes are its cells.
    has_membranes: bool,
    ignored_keywords: Vec<String>,
    place: Place,
}

/// Where in the file the reader is.
#[derive(Debug, Default)]
struct Place {
    is_in_assembly: bool,
    is_in_instance: bool,
    instances: usize,
    /// Parts and instances so far that have nodes of their own.
    parts_with_nodes: usize,
    is_new_part: bool,
}

/// All tags, ascending.
pub(super) struct Tags {
    pub(super) nodes: Vec<u64>,
    pub(super) elements: Vec<u64>,
}

impl Model {
    pub(super) fn read(bytes: &[u8]) -> Result<Self> {
        let mut model = Self::default();
        let mut lines = Lines::new(bytes);
        while let Some(keyword) = lines.keyword() {
            if let Some((_, why)) = REFUSED.iter().find(|(name, _)| *name == keyword.name) {
                return Err(refuse(keyword.line, format_args!("*{}: {why}", keyword.name)));
            }
            if keyword.parameter("INPUT").is_some_and(|_| READ.contains(&&*keyword.name)) {
                let words = format!(
                    "*{} with INPUT: other files are not read: put the contents of the file behind this line",
                    keyword.name
                );
                return Err(refuse(keyword.line, words));
            }
            model.keyword(&keyword, &mut lines)?;
        }
        if model.node_tags.is_empty() {
            return Err(Error::Refused("the file has no *NODE with nodes: it contains no mesh".into()));
        }
        model.sort_lines();
        model.accept_membranes();
        Ok(model)
    }

    /// Puts the node between the ends of each line of three nodes last: Abaqus has it in the middle, Gmsh writes it at the end. The ends are
    /// corners of other elements.
    fn sort_lines(&mut self) {
        let is_curved = |kind: &Kind| (kind.shape, kind.nodes) == (Shape::Line, 3);
        if !self.runs.iter().any(|run| is_curved(&run.kind)) {
            return;
        }
        let others = self.runs.iter().filter(|run| run.kind.shape.dimension() > 1);
        let corners: HashSet<u64> = others
            .flat_map(|run| run.elements().flat_map(|(_, nodes)| &nodes[..run.kind.shape.corners()]))
            .copied()
            .collect();
        for run in self.runs.iter_mut().filter(|run| is_curved(&run.kind)) {
            for line in run.nodes.chunks_exact_mut(3) {
                let between = line.iter().position(|node| !corners.contains(node)).unwrap_or(1);
                line.swap(between, 2);
            }
        }
    }

    /// Takes membranes in a plane for the cells of a body that has no others.
    fn accept_membranes(&mut self) {
        let is = |part: Part| move |run: &&mut Run| run.kind.part == part && !run.tags.is_empty();
        let is_plane = self.points.iter().all(|point| point[2] == self.points[0][2]);
        if !is_plane || self.runs.iter_mut().any(|run| is(Part::Cells)(&run)) {
            return;
        }
        for run in self.runs.iter_mut().filter(is(Part::Membrane)) {
            run.kind.part = Part::Cells;
            self.has_membranes = true;
        }
    }

    fn keyword(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        match &*keyword.name {
            "PART" => self.place.is_new_part = true,
            "ASSEMBLY" => self.place.is_in_assembly = true,
            "END ASSEMBLY" => self.place.is_in_assembly = false,
            "INSTANCE" => self.instance(keyword, lines)?,
            "END INSTANCE" => self.place.is_in_instance = false,
            "NODE" => self.nodes(keyword, lines)?,
            "ELEMENT" => self.elements(keyword, lines)?,
            "NSET" | "ELSET" => self.set(keyword, lines)?,
            "SURFACE" => self.surface(keyword, lines)?,
            "SOLID SECTION" | "SOLIDSECTION" => {
                let name = self.name(keyword.required("ELSET")?, keyword.line);
                self.sections.push(name);
                self.ignore(keyword);
            }
            _ => self.ignore(keyword),
        }
        Ok(())
    }

    fn ignore(&mut self, keyword: &Keyword) {
        let known = self.ignored_keywords.contains(&keyword.name) || SILENT.contains(&&*keyword.name);
        if !known && !keyword.name.is_empty() {
            self.ignored_keywords.push(keyword.name.clone());
        }
    }

    fn scope(&self) -> Scope {
        if self.place.is_in_assembly && !self.place.is_in_instance { Scope::Assembly } else { Scope::Part }
    }

    fn name(&self, text: &str, line: usize) -> Name {
        Name { text: text.to_owned(), scope: self.scope(), line }
    }

    fn instance(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        self.place.is_in_instance = true;
        self.place.is_new_part = true;
        self.place.instances += 1;
        if self.place.instances > 1 {
            let words = "a second *INSTANCE: only files with one instance are read. Write the mesh flattened (CalculiX style), without \
                         parts and instances";
            return Err(refuse(keyword.line, words));
        }
        while let Some(data) = lines.data() {
            let is_moved = (0..data.words.len()).any(|at| data.coordinate(at).ok() != Some(0.0));
            if is_moved {
                let words = "the instance is moved: write the mesh flattened (CalculiX style), or place the part in [mesh] by rotate and \
                             translate and delete this line";
                return Err(refuse(data.line, words));
            }
        }
        Ok(())
    }

    fn nodes(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        if self.scope() == Scope::Assembly {
            // Reference points.
            return Ok(());
        }
        if keyword.parameter("SYSTEM").is_some_and(|system| !system.eq_ignore_ascii_case("R")) {
            return Err(refuse(
                keyword.line,
                "only rectangular coordinates are read: write the mesh out with SYSTEM=R",
            ));
        }
        let before = self.node_tags.len();
        while let Some(data) = lines.data() {
            self.node_tags.push(data.number(0, "the number of a node")?);
            self.points.push([data.coordinate(1)?, data.coordinate(2)?, data.coordinate(3)?]);
        }
        if self.node_tags.len() > before && std::mem::take(&mut self.place.is_new_part) {
            self.place.parts_with_nodes += 1;
            if self.place.parts_with_nodes > 1 {
                let words = "a second part has nodes: only files with one part are read. Write the mesh flattened (CalculiX style)";
                return Err(refuse(keyword.line, words));
            }
        }
        if let Some(set) = keyword.parameter("NSET").filter(|set| !set.is_empty()) {
            let name = self.name(set, keyword.line);
            self.node_sets.add(name, self.node_tags[before..].iter().copied());
        }
        Ok(())
    }

    fn elements(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        let name = keyword.required("TYPE")?;
        let set = keyword.parameter("ELSET").filter(|set| !set.is_empty()).map(str::to_owned);
        self.is_revolved |= name.get(..3).is_some_and(|family| family.eq_ignore_ascii_case("CAX"));
        let tags = match meaning(name).map_err(|words| refuse(keyword.line, words))? {
            Meaning::Ignored => {
                let name = name.to_ascii_uppercase();
                if !self.ignored_types.contains(&name) {
                    self.ignored_types.push(name);
                }
                let mut tags = Vec::new();
                while let Some(data) = lines.data() {
                    tags.push(data.number(0, "the number of an element")?);
                }
                self.ignored_elements.extend(&tags);
                tags
            }
            Meaning::Read(kind) => {
                let mut run = Run { kind, set: set.clone(), tags: Vec::new(), nodes: Vec::new() };
                while read_element(&mut run, lines)? {}
                let tags = run.tags.clone();
                self.runs.push(run);
                tags
            }
        };
        if let Some(set) = set {
            let name = self.name(&set, keyword.line);
            self.element_sets.add(name, tags);
        }
        Ok(())
    }

    fn set(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        let is_of_nodes = keyword.name == "NSET";
        let name = self.name(keyword.required(&keyword.name)?, keyword.line);
        if is_of_nodes && keyword.parameter("ELSET").is_some() {
            return Err(refuse(keyword.line, "*NSET with ELSET is not read: list the numbers of the nodes"));
        }
        let is_foreign = self.scope() == Scope::Assembly && keyword.parameter("INSTANCE").is_none();
        let sets = if is_of_nodes { &mut self.node_sets } else { &mut self.element_sets };
        sets.read(keyword, name, is_foreign, || lines.data())
    }

    fn surface(&mut self, keyword: &Keyword, lines: &mut Lines) -> Result<()> {
        let kind = keyword.parameter("TYPE").unwrap_or("ELEMENT").to_ascii_uppercase();
        let name = self.name(keyword.required("NAME")?, keyword.line);
        if keyword.parameter("COMBINE").is_some() {
            return Err(refuse(keyword.line, "*SURFACE with COMBINE is not read: list the facets"));
        }
        match &*kind {
            "NODE" => self.node_sets.read(keyword, name, false, || lines.data()),
            "ELEMENT" => {
                let surface = Surface::read(name, || lines.data())?;
                self.surfaces.push(surface);
                Ok(())
            }
            _ => {
                self.ignore(keyword);
                Ok(())
            }
        }
    }

    /// The dimension of the cells.
    pub(super) fn dimension(&self) -> Result<usize> {
        let cells = self.runs.iter().filter(|run| run.kind.part == Part::Cells && !run.tags.is_empty());
        cells.map(|run| run.kind.shape.dimension()).max().ok_or_else(|| {
            Error::Refused(
                "the file has no cells: *ELEMENT with TYPE=C3D4, C3D8 and the like in space, or CPS3, CPE4, CAX4 and the like in the \
                 plane; shells are none, nor are membranes that do not lie in a plane z = constant"
                    .into(),
            )
        })
    }

    /// All tags; refused if two elements have the same.
    pub(super) fn sorted_tags(&self) -> Result<Tags> {
        let mut nodes = self.node_tags.clone();
        nodes.sort_unstable();
        let all = self.runs.iter().flat_map(|run| &run.tags).chain(&self.ignored_elements);
        let mut elements: Vec<u64> = all.copied().collect();
        elements.sort_unstable();
        match elements.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(Error::Refused(format!("two elements have the number {}", pair[0]))),
            None => Ok(Tags { nodes, elements }),
        }
    }

    /// What was ignored, in words.
    pub(super) fn notes(&self) -> Vec<String> {
        let list = |words: &[String], before: &str| {
            let named: Vec<String> =
                words.iter().take(NAMED).map(|word| format!("{before}{}", short(word))).collect();
            let more = words.len() - named.len();
            if more == 0 { named.join(", ") } else { format!("{} and {more} more", named.join(", ")) }
        };
        let mut notes = Vec::new();
        if self.is_revolved {
            notes.push(REVOLVED.into());
        }
        if self.has_membranes {
            notes.push("membranes (M3D) in a plane are the cells: the file has no others".into());
        }
        if !self.ignored_types.is_empty() {
            notes.push(format!("elements of these types are ignored: {}", list(&self.ignored_types, "")));
        }
        if !self.ignored_keywords.is_empty() {
            let names = list(&self.ignored_keywords, "*");
            notes.push(format!("only the mesh is read, not {names}: materials, supports, loads and steps are those of the job"));
        }
        notes
    }
}

/// Keywords whose data are read.
const READ: [&str; 5] = ["NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"];

/// Reads an element, which may continue on further lines; false if there are no more.
fn read_element(run: &mut Run, lines: &mut Lines) -> Result<bool> {
    let Some(mut data) = lines.data() else { return Ok(false) };
    run.tags.push(data.number(0, "the number of an element")?);
    let (mut at, before) = (1, run.nodes.len());
    while run.nodes.len() - before < run.kind.nodes {
        if at == data.words.len() || (at + 1 == data.words.len() && data.words[at].is_empty()) {
            let line = data.line;
            let Some(more) = lines.data() else {
                let (found, all) = (run.nodes.len() - before, run.kind.nodes);
                return Err(refuse(line, format_args!("the element has {found} nodes, {all} are expected")));
            };
            (data, at) = (more, 0);
            continue;
        }
        run.nodes.push(data.number(at, "the number of a node")?);
        at += 1;
    }
    if data.words[at..].iter().any(|word| !word.is_empty()) {
        return Err(refuse(
            data.line,
            format_args!("more than the {} nodes of an element of this type", run.kind.nodes),
        ));
    }
    run.kind.sort(&mut run.nodes[before..]);
    Ok(true)
}
