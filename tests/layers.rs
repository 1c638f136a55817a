//! Rules of the source: modules use only modules above them, the files of a module have no circular imports, functions have few
//! parameters, few of them lie between a step and PETSc, `unsafe` occurs in few files only, and the licences of all packages are allowed.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    process::Command,
};

/// Files and folders in which `unsafe` is allowed; folders end with a slash.
const UNSAFE: [&str; 6] = [
    "core/src/linear_algebra/sparse/",
    "core/src/linear_algebra/petsc/",
    "core/src/io/output/hyperslab.rs",
    "core/src/io/output/identifier.rs",
    "core/src/io/output/stacked_view.rs",
    "core/build.rs",
];

/// Keywords before the name in a definition.
const DEFINITIONS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];

/// Longest chain of imports that is followed to find a definition.
const LONGEST_CHAIN: usize = 8;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The Rust files of both packages, relative to the root.
fn sources() -> Vec<(String, String)> {
    let mut found = ["build.rs", "core/build.rs"].map(|file| root().join(file)).to_vec();
    let mut folders = ["src", "core/src"].map(|folder| root().join(folder)).to_vec();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    let relative =
        |path: &Path| path.strip_prefix(root()).expect("inside").to_str().expect("text").to_owned();
    let read = |path: &PathBuf| (relative(path), std::fs::read_to_string(path).expect("text"));
    found.iter().map(read).collect()
}

fn tokens(text: &str) -> TokenStream {
    text.parse().expect("Rust")
}

fn is(token: &TokenTree, punctuation: char) -> bool {
    matches!(token, TokenTree::Punct(found) if found.as_char() == punctuation)
}

fn is_word(token: &TokenTree, word: &str) -> bool {
    matches!(token, TokenTree::Ident(found) if found == word)
}

fn is_block(token: &TokenTree) -> bool {
    matches!(token, TokenTree::Group(group) if group.delimiter() == Delimiter::Brace)
}

/// Whether the tokens at this position are `::`.
fn is_separator(tokens: &[TokenTree], at: usize) -> bool {
    let first = matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == ':' && p.spacing() == Spacing::Joint);
    first && tokens.get(at + 1).is_some_and(|token| is(token, ':'))
}

fn line(token: &TokenTree) -> usize {
    token.span().start().line
}

/// The tokens of one level without attributes, and without code for tests unless requested.
fn plain(stream: TokenStream, with_tests: bool) -> Vec<TokenTree> {
    let mut plain = Vec::new();
    let mut tokens = stream.into_iter().peekable();
    while let Some(token) = tokens.next() {
        if !is(&token, '#') {
            plain.push(token);
            continue;
        }
        tokens.next_if(|token| is(token, '!'));
        let Some(TokenTree::Group(attribute)) = tokens.next() else { continue };
        if !with_tests && attribute.stream().to_string().replace(' ', "") == "cfg(test)" {
            for skipped in tokens.by_ref() {
                if is(&skipped, ';') || is_block(&skipped) {
                    break;
                }
            }
        }
    }
    plain
}

/// A path in the source.
#[derive(Debug, Clone, PartialEq)]
struct Reference {
    path: Vec<String>,
    line: usize,
}

/// One name of a `use` declaration; `*` stands for all names of a module.
#[derive(Debug)]
struct Import {
    name: String,
    is_public: bool,
    from: Reference,
}

/// What a file defines, imports and mentions.
#[derive(Debug, Default)]
struct Module {
    file: String,
    children: BTreeSet<String>,
    defined: BTreeSet<String>,
    imports: Vec<Import>,
    mentioned: Vec<Reference>,
}

impl Module {
    fn read(file: &str, text: &str, with_tests: bool) -> Self {
        let mut module = Self { file: file.to_owned(), ..Self::default() };
        module.scan(tokens(text), with_tests, true);
        module
    }

    fn scan(&mut self, stream: TokenStream, with_tests: bool, at_top: bool) {
        let tokens = plain(stream, with_tests);
        let mut at = 0;
        while at < tokens.len() {
            let word = match &tokens[at] {
                TokenTree::Ident(word) => word.to_string(),
                TokenTree::Group(group) => {
                    self.scan(group.stream(), with_tests, false);
                    at += 1;
                    continue;
                }
                _ => {
                    at += 1;
                    continue;
                }
            };
            if word == "use" {
                let end = (at..tokens.len()).find(|&i| is(&tokens[i], ';')).unwrap_or(tokens.len());
                let is_public = (at.saturating_sub(2)..at).any(|i| is_word(&tokens[i], "pub"));
                self.import(&tokens[at + 1..end], &[], is_public);
                at = end;
                continue;
            }
            if at_top {
                let is_macro = word == "macro_rules";
                let name = tokens.get(if is_macro { at + 2 } else { at + 1 });
                if let Some(TokenTree::Ident(name)) = name {
                    if is_macro || DEFINITIONS.contains(&word.as_str()) {
                        self.defined.insert(name.to_string());
                    } else if word == "mod" {
                        self.children.insert(name.to_string());
                        at += 2;
                        continue;
                    }
                }
            }
            let mut path = vec![word];
            let mut next = at + 1;
            while is_separator(&tokens, next)
                && let Some(TokenTree::Ident(word)) = tokens.get(next + 2)
            {
                path.push(word.to_string());
                next += 3;
            }
            let is_range = at > 1 && is(&tokens[at - 2], '.');
            let is_member = at > 0 && is(&tokens[at - 1], '.') && !is_range;
            let follows_separator = at > 1 && is_separator(&tokens, at - 2);
            if !(is_member || follows_separator) {
                self.mentioned.push(Reference { path, line: line(&tokens[at]) });
            }
            at = next;
        }
    }

    /// Adds the names of a tree of imports below a path.
    fn import(&mut self, tree: &[TokenTree], above: &[String], is_public: bool) {
        let mut path = above.to_vec();
        let mut name = None;
        for (at, token) in tree.iter().enumerate() {
            match token {
                TokenTree::Group(group) => {
                    let branches: Vec<TokenTree> = group.stream().into_iter().collect();
                    for branch in branches.split(|token| is(token, ',')).filter(|branch| !branch.is_empty()) {
                        self.import(branch, &path, is_public);
                    }
                    return;
                }
                TokenTree::Ident(word) if word == "as" => {
                    name = tree.get(at + 1).map(ToString::to_string);
                    break;
                }
                TokenTree::Ident(word) => path.push(word.to_string()),
                token if is(token, '*') => name = Some("*".to_owned()),
                _ => {}
            }
        }
        path.pop_if(|last| last == "self");
        let Some(name) = name.or_else(|| path.last().cloned()) else { return };
        let from = Reference { path, line: tree.first().map_or(0, line) };
        self.imports.push(Import { name, is_public, from });
    }

    /// All paths, of imports and others.
    fn references(&self) -> impl Iterator<Item = &Reference> {
        self.imports.iter().map(|import| &import.from).chain(&self.mentioned)
    }
}

/// The path of a file below `src` of its package.
fn in_package(file: &str) -> Option<&str> {
    file.strip_prefix("core/").unwrap_or(file).strip_prefix("src/")
}

/// The modules of both packages by their paths, without those for tests: the program has those of the solver as its own.
struct Modules(BTreeMap<Vec<String>, Module>);

/// For each module, the modules whose names it uses, and these names.
type Graph = BTreeMap<Vec<String>, BTreeMap<Vec<String>, BTreeSet<String>>>;

impl Modules {
    fn of(sources: &[(String, String)]) -> Self {
        let mut found: BTreeMap<Vec<String>, Module> = BTreeMap::new();
        let mut all: Vec<(Vec<String>, &String, &String)> = Vec::new();
        for (file, text) in sources {
            let Some(path) = in_package(file).and_then(|path| path.strip_suffix(".rs")) else {
                continue;
            };
            let mut path: Vec<String> = path.split('/').map(str::to_owned).collect();
            path.pop_if(|last| last == "mod");
            all.push((path, file, text));
        }
        all.sort();
        for (path, file, text) in all {
            let (name, above) = path.split_last().expect("a name");
            let is_root = above.is_empty() && ["lib", "main"].contains(&name.as_str());
            let is_declared =
                above.is_empty() || found.get(above).is_some_and(|parent| parent.children.contains(name));
            if !is_root && is_declared {
                found.insert(path, Module::read(file, text, false));
            }
        }
        Self(found)
    }

    /// The module to which a path in `from` refers, and whether the path refers to an item of the module rather than to the module
    /// itself; `None` if the path begins with a name that no file of the crate defines.
    fn resolve(&self, from: &[String], path: &[String], chain: usize) -> Option<(Vec<String>, bool)> {
        let mut here = from.to_vec();
        let mut rest = path;
        while let [first, more @ ..] = rest {
            match first.as_str() {
                "crate" => here.clear(),
                "super" => {
                    here.pop();
                }
                "self" => {}
                _ => break,
            }
            rest = more;
        }
        let mut is_known = rest.len() < path.len();
        while let [name, more @ ..] = rest {
            let child = [&here[..], std::slice::from_ref(name)].concat();
            if self.0.contains_key(&child) {
                here = child;
            } else {
                if self.0.get(&here)?.defined.contains(name) {
                    return Some((here, true));
                }
                let Some((module, is_name)) = self.imported(&here, name, chain) else {
                    return is_known.then_some((here, true));
                };
                if is_name {
                    return Some((module, true));
                }
                here = module;
            }
            (rest, is_known) = (more, true);
        }
        Some((here, false))
    }

    /// The definition to which an imported name of a module refers.
    fn imported(&self, module: &[String], name: &String, chain: usize) -> Option<(Vec<String>, bool)> {
        let chain = chain.checked_sub(1)?;
        let imports = &self.0[module].imports;
        if let Some(import) = imports.iter().find(|import| import.name == *name) {
            return self.resolve(module, &import.from.path, chain);
        }
        imports.iter().filter(|import| import.name == "*").find_map(|import| {
            match self.resolve(module, &import.from.path, chain)? {
                (all_of, false) => self.resolve(&all_of, std::slice::from_ref(name), chain),
                _ => None,
            }
        })
    }

    /// Whether a module below this one takes the name from it.
    fn hands_down(&self, module: &[String], name: &str) -> bool {
        let children =
            self.0.iter().filter(|(path, _)| path.split_last().is_some_and(|(_, above)| above == module));
        let mut references = children.flat_map(|(_, child)| child.references());
        references.any(|found| found.path.len() > 1 && found.path[0] == "super" && found.path[1] == name)
    }

    /// The dependences among the files of each top-level module. A name that a file only re-exports is not counted there.
    fn graph(&self) -> Graph {
        let mut graph = Graph::new();
        for (from, module) in &self.0 {
            let used: BTreeSet<&String> = module.mentioned.iter().map(|found| &found.path[0]).collect();
            let is_needed = |import: &&Import| {
                let is_handed_on = import.is_public || self.hands_down(from, &import.name);
                import.name != "*" && (used.contains(&import.name) || !is_handed_on)
            };
            let imports = module.imports.iter().filter(is_needed).map(|import| &import.from.path);
            let takes_all = module.imports.iter().any(|import| import.name == "*");
            let mentioned = module.mentioned.iter().map(|found| &found.path);
            for path in imports.chain(mentioned.filter(|path| path.len() > 1 || takes_all)) {
                if let Some((to, true)) = self.resolve(from, path, LONGEST_CHAIN)
                    && to != *from
                    && to.first() == from.first()
                {
                    let names = graph.entry(from.clone()).or_default().entry(to).or_default();
                    names.insert(path.last().expect("a name").clone());
                }
            }
        }
        graph
    }

    /// Descriptions of all imports that are part of a cycle.
    fn circles(&self) -> Vec<String> {
        let graph = self.graph();
        let mut circles = Vec::new();
        for (from, imports) in &graph {
            for (to, names) in imports.iter().filter(|(to, _)| reaches(&graph, to, from)) {
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                circles.push(format!(
                    "{} needs {} of {}",
                    self.0[from].file,
                    names.join(", "),
                    self.0[to].file
                ));
            }
        }
        circles
    }
}

fn reaches(graph: &Graph, from: &Vec<String>, to: &Vec<String>) -> bool {
    let mut seen = BTreeSet::from([from]);
    let mut open = vec![from];
    while let Some(module) = open.pop() {
        if module == to {
            return true;
        }
        open.extend(
            graph
                .get(module)
                .into_iter()
                .flat_map(|imports| imports.keys())
                .filter(|next| seen.insert(*next)),
        );
    }
    false
}

fn layers() -> Vec<String> {
    let text = |file: &str| std::fs::read_to_string(root().join(file)).expect("lib.rs");
    let text = text("core/src/lib.rs") + &text("src/lib.rs");
    let names = text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}

/// The module of a file, `None` for lib.rs, main.rs and build.rs.
fn module(path: &str) -> Option<&str> {
    let name = in_package(path)?.split(['/', '.']).next()?;
    (!["lib", "main"].contains(&name)).then_some(name)
}

#[test]
fn modules_use_only_modules_above_them() {
    let layers = layers();
    assert!(layers.len() > 10, "{layers:?}");
    let depth = |name: &str| layers.iter().position(|layer| layer == name);
    let mut faults = Vec::new();
    let mut seen = 0;
    for (path, text) in sources() {
        let Some(own) = module(&path) else { continue };
        let Some(place) = depth(own) else {
            faults.push(format!("{path}: lib.rs has no module {own}"));
            continue;
        };
        for Reference { path: names, line } in Module::read(&path, &text, true).references() {
            let [first, name, ..] = &names[..] else { continue };
            if first != "crate" {
                continue;
            }
            seen += 1;
            match depth(name) {
                Some(other) if other <= place => {}
                Some(_) => {
                    faults.push(format!("{path}:{line}: {own} stands above {name} in lib.rs, and uses it"))
                }
                None => faults.push(format!("{path}:{line}: no module {name} in lib.rs")),
            }
        }
    }
    assert!(seen > 500, "only {seen} paths from the root of the crate were seen");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn files_of_a_module_import_no_names_in_circles() {
    let modules = Modules::of(&sources());
    let edges: usize = modules.graph().values().map(BTreeMap::len).sum();
    assert!(edges > 300, "only {edges} imports between files were seen");
    let circles = modules.circles();
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

#[test]
fn the_reader_of_imports_sees_groups_and_paths() {
    let text = "use crate::{a::{b, c}, d as e, // x,\n f::*};\nfn g() { let y = crate::h::i(\"crate::x\"); } // crate::x";
    let module = Module::read("", text, true);
    let names: Vec<(String, usize)> = module
        .references()
        .filter(|found| found.path[0] == "crate")
        .map(|f| (f.path.join("::"), f.line))
        .collect();
    let expected =
        [("crate::a::b", 1), ("crate::a::c", 1), ("crate::d", 1), ("crate::f", 2), ("crate::h::i", 3)];
    assert_eq!(names, expected.map(|(path, line)| (path.to_owned(), line)));
    let imported: Vec<&str> = module.imports.iter().map(|import| import.name.as_str()).collect();
    assert_eq!(imported, ["b", "c", "e", "*"]);
    assert!(module.defined.contains("g"));
}

/// Circles among files given as text.
fn circles_of(sources: &[(&str, &str)]) -> Vec<String> {
    let owned: Vec<_> = sources.iter().map(|(file, text)| (file.to_string(), text.to_string())).collect();
    Modules::of(&owned).circles()
}

#[test]
fn a_circle_is_seen_whichever_way_names_are_reached() {
    let parent = "mod b; mod c; pub use b::B; pub struct A(c::C);";
    let (b, c) = ("use super::A; pub struct B;", "pub struct C; fn f() -> crate::a::B { super::B }");
    let found = circles_of(&[("src/a/mod.rs", parent), ("src/a/b.rs", b), ("src/a/c.rs", c)]);
    let expected = [
        "src/a/mod.rs needs C of src/a/c.rs",
        "src/a/b.rs needs A of src/a/mod.rs",
        "src/a/c.rs needs B of src/a/b.rs",
    ];
    assert_eq!(found, expected);
    // Through a glob, an import that the parent re-exports, and a file next to its folder.
    let parent = "mod b; mod c; use b::*; use c::C; fn f(_: B) {}";
    let found = circles_of(&[
        ("src/a.rs", parent),
        ("src/a/b.rs", "use super::C; pub struct B;"),
        ("src/a/c.rs", "pub struct C; use super::b;  fn f(_: b::B) {}"),
    ]);
    assert_eq!(found, ["src/a/b.rs needs C of src/a/c.rs", "src/a/c.rs needs B of src/a/b.rs"]);
}

#[test]
fn names_handed_on_and_names_in_tests_make_no_circle() {
    let parent = "mod b; mod c; #[cfg(test)] mod tests; pub use b::B; pub use c::C;";
    let b = "use super::C; pub struct B(C); #[cfg(test)] mod tests { use super::super::B; }";
    let c = "pub struct C; #[cfg(test)] mod tests { use super::super::B; }";
    let tests = "use super::{B, C}; pub struct T;";
    let files = [("src/a/mod.rs", parent), ("src/a/b.rs", b), ("src/a/c.rs", c), ("src/a/tests.rs", tests)];
    assert_eq!(circles_of(&files), [""; 0]);
}

/// Largest number of parameters of a function besides `self`.
const MAX_PARAMETERS: usize = 5;
/// Functions with more parameters that traits of other crates prescribe.
const OF_OTHER_CRATES: [&str; 1] = ["curve_to"];

/// The parts of a list between its commas.
fn parts(list: &[TokenTree]) -> impl Iterator<Item = &[TokenTree]> {
    let (mut depth, mut is_arrow) = (0, false);
    list.split(move |token| {
        depth += i32::from(is(token, '<')) - i32::from(is(token, '>') && !is_arrow);
        is_arrow = is(token, '-');
        depth == 0 && is(token, ',')
    })
}

/// The number of values in a parameter: those of a tuple count one by one.
fn values(parameter: &[TokenTree]) -> usize {
    match parameter {
        [.., before, TokenTree::Group(tuple)]
            if tuple.delimiter() == Delimiter::Parenthesis && (is(before, ':') || is(before, '&')) =>
        {
            let list: Vec<TokenTree> = tuple.stream().into_iter().collect();
            parts(&list).filter(|part| !part.is_empty()).count().max(1)
        }
        _ => 1,
    }
}

/// The functions with their numbers of parameters besides `self`, without functions that C calls.
fn parameters(stream: TokenStream, found: &mut Vec<(String, usize)>) {
    let tokens: Vec<TokenTree> = stream.into_iter().collect();
    for (at, token) in tokens.iter().enumerate() {
        if let TokenTree::Group(group) = token {
            parameters(group.stream(), found);
        }
        let is_called_by_c = at > 1 && is_word(&tokens[at - 2], "extern");
        let Some(TokenTree::Ident(name)) = tokens.get(at + 1) else { continue };
        if !is_word(token, "fn") || is_called_by_c {
            continue;
        }
        // The list after the generic parameters, whose bounds may have parentheses.
        let mut depth = 0;
        let list = tokens[at + 2..].iter().enumerate().find_map(|(next, token)| match token {
            TokenTree::Punct(p) if p.as_char() == '<' => {
                depth += 1;
                None
            }
            TokenTree::Punct(p) if p.as_char() == '>' && !is(&tokens[at + 1 + next], '-') => {
                depth -= 1;
                None
            }
            TokenTree::Group(list) if depth == 0 => Some(list.stream()),
            _ => None,
        });
        let list: Vec<TokenTree> = list.into_iter().flatten().collect();
        let parts = parts(&list);
        let is_parameter = |part: &&[TokenTree]| {
            !part.is_empty() && !part.iter().take(5).any(|token| is_word(token, "self"))
        };
        found.push((name.to_string(), parts.filter(is_parameter).map(values).sum()));
    }
}

#[test]
fn functions_have_few_parameters() {
    let (mut seen, mut faults) = (0, Vec::new());
    for (path, text) in sources() {
        let mut found = Vec::new();
        parameters(tokens(&text), &mut found);
        seen += found.len();
        let many = found
            .into_iter()
            .filter(|(name, count)| *count > MAX_PARAMETERS && !OF_OTHER_CRATES.contains(&&**name));
        faults.extend(many.map(|(name, count)| format!("{path}: {name} has {count} parameters")));
    }
    assert!(seen > 2000, "only {seen} functions were seen");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let mut found = Vec::new();
    let text = "fn f<T: Fn(u8, u8) -> u8>(&'a mut self, a: [u8; 2], b: A<C, D>, c: impl Fn(u8, u8), (d, e): (u8, A<C, D>)) {}";
    parameters(tokens(text), &mut found);
    assert_eq!(found, [("f".to_owned(), 5)]);
}

/// The largest number of functions from the solution of a step to the call of PETSc or of the descent, both with their own.
const MOST_FRAMES: usize = 7;

/// The functions in which a step is solved, with their text, by the type that they belong to (a file, with those in its folder) and name.
fn functions_of_steps() -> BTreeMap<(String, String), String> {
    let mut functions = BTreeMap::new();
    for (path, text) in sources() {
        let Some(inside) = path.strip_prefix("core/src/solver/stepping/") else { continue };
        let owner = inside.split(['/', '.']).next().expect("a name").to_owned();
        let text = text.split("#[cfg(test)]").next().expect("a part");
        let mut current = None;
        for line in text.lines() {
            let code = line.trim_start();
            let is_outer = line.len() - code.len() <= 4 && !code.starts_with("//");
            if let Some((_, rest)) = format!(" {code}").split_once(" fn ").filter(|_| is_outer) {
                let name = rest.split(['(', '<']).next().expect("a name");
                current = Some((owner.clone(), name.to_owned()));
            }
            if let Some(key) = &current {
                *functions.entry(key.clone()).or_insert_with(String::new) += &format!("{line}\n");
            }
        }
    }
    functions
}

/// The length of the longest way from a function to one that calls PETSc; 0 where there is none.
fn frames(functions: &BTreeMap<(String, String), String>, from: &(String, String)) -> usize {
    let Some(text) = functions.get(from) else { return 0 };
    let receivers = [("self", &*from.0), ("newton", "newton"), ("flowing", "flow_corrections")];
    let deeper = functions.keys().filter(|key| *key != from).map(|key| {
        let (owner, name) = key;
        let called = |receiver: &str| text.contains(&format!("{receiver}.{name}("));
        let is_called = receivers.iter().any(|(receiver, of)| of == owner && called(receiver))
            || (owner == "corrections" && text.contains(&format!(" {name}(newton")));
        if is_called { frames(functions, key) } else { 0 }
    });
    let calls_petsc = ["snes.solve(", "descent.solve("].iter().any(|call| text.contains(call));
    match (deeper.max().unwrap_or(0), calls_petsc) {
        (0, calls) => usize::from(calls),
        (deeper, _) => deeper + 1,
    }
}

#[test]
fn few_functions_lie_between_a_step_and_petsc() {
    let functions = functions_of_steps();
    let of = |owner: &str, name: &str| frames(&functions, &(owner.to_owned(), name.to_owned()));
    assert_eq!(of("newton", "search"), 1, "it calls PETSc");
    assert!(of("newton", "solve") > 2 && of("flow_corrections", "solve_whole") > of("newton", "solve"));
    let found = of("step_solver", "solve");
    assert!(found <= MOST_FRAMES, "{found} functions from StepSolver::solve to PETSc");
}

/// The lines with the word `unsafe`, and whether the word starts a block.
fn unsafe_words(stream: TokenStream, found: &mut Vec<(usize, bool)>) {
    let tokens: Vec<TokenTree> = stream.into_iter().collect();
    for (at, token) in tokens.iter().enumerate() {
        if let TokenTree::Group(group) = token {
            unsafe_words(group.stream(), found);
        } else if is_word(token, "unsafe") {
            found.push((line(token), tokens.get(at + 1).is_some_and(is_block)));
        }
    }
}

#[test]
fn unsafe_code_stays_where_it_belongs_and_says_why_it_is_sound() {
    let mut faults = Vec::new();
    let mut blocks = 0;
    for (path, text) in sources() {
        let lines: Vec<&str> = text.lines().collect();
        let mut words = Vec::new();
        unsafe_words(tokens(&text), &mut words);
        let is_allowed =
            UNSAFE.iter().any(|place| path == *place || (place.ends_with('/') && path.starts_with(place)));
        for (line, is_block) in words {
            if !is_allowed {
                faults.push(format!("{path}:{line}: unsafe outside {UNSAFE:?}"));
            }
            if is_block {
                blocks += 1;
                if !says_why(&lines, line - 1) {
                    faults.push(format!("{path}:{line}: no SAFETY comment before this block"));
                }
            }
        }
    }
    assert!(blocks > 30, "only {blocks} unsafe blocks were seen");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Whether the comment directly above the statement with this line contains SAFETY.
fn says_why(lines: &[&str], number: usize) -> bool {
    let mut above = number;
    while above > 0 && !lines[above - 1].trim_start().starts_with("//") {
        above -= 1;
        if lines[above].trim_end().ends_with([';', '}']) {
            return false;
        }
    }
    let comment = lines[..above].iter().rev().take_while(|line| line.trim_start().starts_with("//"));
    comment.into_iter().any(|line| line.contains("SAFETY:"))
}

/// The packages in a lock file.
fn locked(path: &str) -> Vec<toml::Value> {
    let text = std::fs::read_to_string(root().join(path)).expect("a lock file");
    let file: toml::Table = text.parse().expect("tables");
    file["package"].as_array().expect("packages").clone()
}

#[test]
fn the_fuzz_targets_are_built_with_the_packages_of_the_solver() {
    let (solver, fuzz) = (locked("Cargo.lock"), locked("fuzz/Cargo.lock"));
    let needed = |packages: &[toml::Value]| -> BTreeSet<String> {
        let core = packages.iter().find(|package| package["name"].as_str() == Some("clarke-core"));
        let needed = core.expect("the solver")["dependencies"].as_array().expect("a list");
        needed.iter().map(|name| name.as_str().expect("a name").to_owned()).collect()
    };
    let lacking: Vec<String> = needed(&solver).difference(&needed(&fuzz)).cloned().collect();
    assert_eq!(
        lacking,
        ["proptest", "tempfile"],
        "fuzz/Cargo.lock lacks others than those of tests: run `cargo tree` in fuzz"
    );
    for package in fuzz {
        let versions: Vec<&toml::Value> = solver
            .iter()
            .filter(|other| other["name"] == package["name"])
            .map(|other| &other["version"])
            .collect();
        assert!(
            versions.is_empty() || versions.contains(&&package["version"]),
            "{} is {} in fuzz/Cargo.lock and {versions:?} in Cargo.lock: run `cargo update .. --precise ..` in fuzz",
            package["name"],
            package["version"]
        );
    }
}

/// Whether a licence in the notation of Cargo.toml can be fulfilled with these.
fn is_licensed(expression: &str, allowed: &[&str]) -> bool {
    let words = expression.replace('/', " OR ").replace(['(', ')'], " ");
    // A package with two licences at the same time names them by AND; its alternatives by OR bind more tightly in all packages.
    words.split(" AND ").all(|part| part.split(" OR ").any(|licence| allowed.contains(&licence.trim())))
}

#[test]
fn alternatives_of_licences_are_read() {
    let allowed = ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"];
    for expression in
        ["MIT", "GPL-3.0/MIT", "(MIT OR GPL-3.0) AND Zlib", "Apache-2.0 WITH LLVM-exception OR Apache-2.0"]
    {
        assert!(is_licensed(expression, &allowed), "{expression}");
    }
    for expression in ["GPL-3.0", "Apache-2.0", "(MIT OR Zlib) AND GPL-3.0", ""] {
        assert!(!is_licensed(expression, &allowed), "{expression}");
    }
}

/// The list of deny.toml, also without `make deny`, which needs a network.
#[test]
fn the_licences_of_all_packages_are_allowed() {
    let text = std::fs::read_to_string(root().join("deny.toml")).expect("deny.toml");
    let rules: toml::Table = text.parse().expect("tables");
    let list = |value: &toml::Value| -> Vec<String> {
        value.as_array().expect("a list").iter().map(|one| one.as_str().expect("a name").to_owned()).collect()
    };
    let licences = &rules["licenses"];
    let exceptions = licences["exceptions"].as_array().expect("a list");
    let version = Command::new("rustc").arg("-vV").output().expect("rustc");
    let version = String::from_utf8(version.stdout).expect("text");
    let host = version.lines().find_map(|line| line.strip_prefix("host: ")).expect("a host");
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", host])
        .current_dir(root())
        .output()
        .expect("cargo");
    assert!(metadata.status.success(), "{}", String::from_utf8_lossy(&metadata.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&metadata.stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    assert!(packages.len() > 100, "only {} packages were seen", packages.len());
    let mut faults = Vec::new();
    for package in packages {
        let (name, licence) = (&package["name"], package["license"].as_str().unwrap_or_default());
        let mut allowed = list(&licences["allow"]);
        let own = exceptions.iter().filter(|exception| exception["crate"].as_str() == name.as_str());
        own.for_each(|exception| allowed.extend(list(&exception["allow"])));
        if !is_licensed(licence, &allowed.iter().map(String::as_str).collect::<Vec<_>>()) {
            faults.push(format!("{name} has the licence {licence:?}, which deny.toml does not allow"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The crates that a command of cargo compiles, with their features.
fn compiled_crates(command: &[&str]) -> BTreeSet<String> {
    // Of what cargo tells, only the graph of its units has all features; it is an unstable format.
    let graph = Command::new(env!("CARGO"))
        .args(command)
        .args(["--release", "--locked", "--offline", "--unit-graph", "-Zunstable-options"])
        .env("RUSTC_BOOTSTRAP", "1")
        .current_dir(root())
        .output()
        .expect("cargo");
    assert!(graph.status.success(), "{}", String::from_utf8_lossy(&graph.stderr));
    let graph: serde_json::Value = serde_json::from_slice(&graph.stdout).expect("JSON");
    let units = graph["units"].as_array().expect("units");
    units.iter().map(|unit| format!("{} {}", unit["pkg_id"], unit["features"])).collect()
}

#[test]
fn what_make_run_has_compiled_serves_the_tests_too() {
    let of_core = ["test", "--lib", "--package", "clarke-core"];
    let [solver, tests, of_core] = [&["build"][..], &["test"], &of_core].map(compiled_crates);
    assert!(solver.len() > 100, "only {} crates were seen", solver.len());
    let again: Vec<&String> = solver.difference(&tests).collect();
    assert!(again.is_empty(), "the crates of the tests ask these for more features: {again:#?}");
    let names = |crates: &BTreeSet<String>| -> BTreeSet<String> {
        crates.iter().filter_map(|one| one.split(' ').next()).map(str::to_owned).collect()
    };
    let known = names(&solver);
    let is_known = |one: &&String| one.split(' ').next().is_some_and(|name| known.contains(name));
    let again: Vec<&String> = of_core.difference(&solver).filter(is_known).collect();
    assert!(again.is_empty(), "the tests of the library ask these for other features: {again:#?}");
}

#[test]
fn what_the_tests_have_compiled_serves_the_random_input_too() {
    let [solver, random_input] = ["Cargo.toml", "fuzz/Cargo.toml"].map(|file| {
        let text = std::fs::read_to_string(root().join(file)).expect("a manifest");
        let mut profile = text.parse::<toml::Table>().expect("tables")["profile"]["release"].clone();
        profile.as_table_mut().expect("a table").remove("package");
        profile
    });
    assert_eq!(solver, random_input, "otherwise every crate is compiled again");
}
