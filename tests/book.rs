//! The book: the pages as HTML with formulas in MathML, in `target/book`. `make book` is these tests.

use mdbook_driver::{MDBook, config::Config};
use pulldown_cmark::{CodeBlockKind, Event, LinkType, Options, Parser, Tag, TagEnd};
use pulldown_latex::config::{DisplayMode, RenderConfig};
use std::fmt::Write;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex};
use tracing::{Event as Message, Level, Metadata, Subscriber, span};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The folder of the book.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("book")
}

/// What the converter of formulas writes, and what is right: spaces by name, a space between attributes, mu instead of micro, no space
/// around bars and slashes, one line.
const CORRECTIONS: [(&str, &str); 6] = [
    ("&amp;nbsp;", "&#160;"),
    ("\"minsize", "\" minsize"),
    ("\u{b5}", "\u{3bc}"),
    (">|</mo>", " lspace=\"0\" rspace=\"0\">|</mo>"),
    (">/</mo>", " lspace=\"0\" rspace=\"0\">/</mo>"),
    ("\n", " "),
];

/// A formula in MathML, or why it is none.
fn mathml(tex: &str, display_mode: DisplayMode) -> Result<String, String> {
    let storage = pulldown_latex::Storage::new();
    let parts: Result<Vec<_>, _> = pulldown_latex::Parser::new(tex, &storage).collect();
    let parts = parts.map_err(|error| error.to_string())?;
    let mut text = String::new();
    let parts = parts.into_iter().map(Ok::<_, std::fmt::Error>);
    pulldown_latex::push_mathml(&mut text, parts, RenderConfig { display_mode, ..Default::default() })
        .map_err(|error| error.to_string())?;
    for (written, meant) in CORRECTIONS {
        text = text.replace(written, meant);
    }
    let text = without_marks(&text);
    Ok(match display_mode {
        DisplayMode::Inline => text,
        DisplayMode::Block => format!("<span class=\"formula\">{text}</span>"),
    })
}

/// HTML in which no character between tags is a mark of Markdown.
fn without_marks(html: &str) -> String {
    let mut text = String::new();
    let mut in_tag = false;
    for c in html.chars() {
        in_tag = c == '<' || (in_tag && c != '>');
        if !in_tag && r"\|*_~`[]$".contains(c) {
            write!(text, "&#{};", c as u32).expect("text");
        } else {
            text.push(c);
        }
    }
    text
}

/// A path without `..`, relative to the root of the repository and of the book alike.
fn resolved(page: &Path, target: &str) -> PathBuf {
    let mut path = page.parent().expect("a folder").to_owned();
    for part in Path::new(target).components() {
        match part {
            Component::ParentDir => assert!(path.pop(), "{}: {target} is outside", page.display()),
            part => path.push(part),
        }
    }
    path
}

/// Whether a link leads to another place than a file of the repository or of the book.
fn is_elsewhere(target: &str) -> bool {
    target.contains(':')
}

/// Whether a link leads to what the book shows beside each page, the table of contents, or lacks, a folder.
fn is_no_page(file: &Path) -> bool {
    file == Path::new("docs/SUMMARY.md") || root().join(file).is_dir()
}

/// A page with its formulas in MathML; faults are added to the list. Links to what is no page of the book become plain text.
fn with_formulas(page: &Path, text: &str, faults: &mut Vec<String>) -> String {
    let options = Options::ENABLE_TABLES | Options::ENABLE_MATH;
    let mut shown = String::new();
    let mut done = 0;
    let mut events = Parser::new_ext(text, options).into_offset_iter();
    let mut formula = |tex: &str, mode| {
        mathml(tex, mode).unwrap_or_else(|error| {
            faults.push(format!("{}: {}\n{error}", page.display(), tex.trim()));
            String::new()
        })
    };
    while let Some((event, place)) = events.next() {
        let html = match event {
            _ if place.start < done => continue,
            Event::InlineMath(tex) => formula(&tex, DisplayMode::Inline),
            Event::DisplayMath(tex) => formula(&tex, DisplayMode::Block),
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) if &*language == "math" => {
                let lines = events.by_ref().take_while(|(event, _)| *event != Event::End(TagEnd::CodeBlock));
                let tex: String = lines.map(|(_, line)| &text[line]).collect();
                formula(&tex, DisplayMode::Block)
            }
            Event::Start(Tag::Link { link_type: LinkType::Inline, dest_url, .. })
                if !is_elsewhere(&dest_url) && is_no_page(&resolved(page, &dest_url)) =>
            {
                let (name, _) = text[place.clone()].rsplit_once("](").expect("a link");
                name[1..].to_owned()
            }
            _ => continue,
        };
        shown += &text[done..place.start];
        shown += &html;
        done = place.end;
    }
    shown + &text[done..]
}

/// The warnings and errors of mdBook.
#[derive(Clone, Default)]
struct Warnings(Arc<Mutex<Vec<String>>>);

impl Subscriber for Warnings {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::WARN
    }

    fn event(&self, message: &Message<'_>) {
        let mut text = String::new();
        message.record(&mut |_: &tracing::field::Field, value: &dyn std::fmt::Debug| {
            write!(text, "{value:?} ").expect("text");
        });
        self.0.lock().expect("warnings").push(text);
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}
    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}
    fn enter(&self, _: &span::Id) {}
    fn exit(&self, _: &span::Id) {}
}

/// The files below a folder, relative to it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(&inner).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.push(path.strip_prefix(folder).expect("inside").to_owned());
            }
        }
    }
    found
}

/// The values of an attribute in a page of HTML.
fn values<'a>(html: &'a str, attribute: &str) -> Vec<&'a str> {
    let start = format!(" {attribute}=\"");
    let tags = html.split('<').map(|tag| tag.split_once('>').map_or(tag, |(tag, _)| tag));
    tags.filter_map(|tag| tag.split_once(&start)?.1.split_once('"')).map(|(value, _)| value).collect()
}

/// The pages of the book, relative to its folder, with their HTML.
fn pages() -> Vec<(PathBuf, String)> {
    let is_page = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "html");
    let found = files(&folder()).into_iter().filter(is_page);
    found.map(|path| (path.clone(), fs::read_to_string(folder().join(path)).expect("text"))).collect()
}

/// Where the links and pictures of a page lead within the book, and to which id there.
fn targets<'a>(page: &'a Path, html: &'a str) -> impl Iterator<Item = (PathBuf, &'a str)> {
    let links = ["href", "src"].into_iter().flat_map(move |attribute| values(html, attribute));
    links.filter(|target| !is_elsewhere(target)).map(move |target| {
        let (file, id) = target.split_once('#').unwrap_or((target, ""));
        (if file.is_empty() { page.to_owned() } else { resolved(page, file) }, id)
    })
}

/// The links and pictures of a page that lead nowhere in the book.
fn broken_links(page: &Path, html: &str) -> Vec<String> {
    let is_broken = |(file, id): &(PathBuf, &str)| {
        let has_id = |html: String| values(&html, "id").contains(id);
        let file = folder().join(file);
        !file.is_file() || !(id.is_empty() || fs::read_to_string(file).is_ok_and(has_id))
    };
    let broken = targets(page, html).filter(is_broken);
    broken.map(|(file, id)| format!("{}: {} {id}", page.display(), file.display())).collect()
}

struct Faults {
    formulas: Vec<String>,
    warnings: Vec<String>,
}

/// Builds the book, once. The table of contents names the pages; other files to which they link are copied beside them.
static BOOK: LazyLock<Faults> = LazyLock::new(|| {
    let sources = tempfile::tempdir().expect("a folder");
    let write = |file: &str, text: &str| {
        let path = sources.path().join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
    };
    let read = |file: &str| fs::read_to_string(root().join(file)).expect(file);
    // Paths from the root, so that also the pages outside docs are inside the book.
    let contents = read("docs/SUMMARY.md").replace("](", "](docs/").replace("](docs/../", "](");
    write("SUMMARY.md", &contents);
    write("book.css", &read("docs/book.css"));
    let mut formulas = Vec::new();
    for page in contents.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0)) {
        write(page, &with_formulas(Path::new(page), &read(page), &mut formulas));
    }
    let mut config = Config::from_disk(root().join("docs/book.toml")).expect("docs/book.toml");
    config.build.build_dir = folder();
    config.build.create_missing = false;
    config.build.use_default_preprocessors = false;
    let warnings = Warnings::default();
    tracing::subscriber::with_default(warnings.clone(), || {
        MDBook::load_with_config(sources.path(), config).and_then(|book| book.build()).expect("a book");
    });
    for (page, html) in pages() {
        for (file, _) in targets(&page, &html) {
            let (from, to) = (root().join(&file), folder().join(&file));
            if from.is_file() && !to.exists() {
                fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
                fs::copy(from, to).expect("a copy");
            }
        }
    }
    Faults { formulas, warnings: warnings.0.lock().expect("warnings").clone() }
});

#[test]
fn the_book_is_built_without_warnings() {
    assert!(BOOK.warnings.is_empty(), "{}", BOOK.warnings.join("\n"));
}

#[test]
fn every_link_of_the_book_leads_somewhere() {
    LazyLock::force(&BOOK);
    let faults: Vec<String> = pages().iter().flat_map(|(page, html)| broken_links(page, html)).collect();
    assert!(faults.is_empty(), "links to nothing:\n{}", faults.join("\n"));
    let html = r##"<a href="nothing.html">a</a> <a href="scope.html">b</a> <a href="#no-such-heading">c</a>
        <a href="conventions.html#laws">d</a> <img src="pictures/nothing.png"> <img src="pictures/wang_cheng_2022.png">"##;
    let faults = [
        "docs/theory.html: docs/nothing.html ",
        "docs/theory.html: docs/theory.html no-such-heading",
        "docs/theory.html: docs/pictures/nothing.png ",
    ];
    assert_eq!(broken_links(Path::new("docs/theory.html"), html), faults);
}

#[test]
fn every_formula_of_the_book_is_shown_as_a_formula() {
    assert!(BOOK.formulas.is_empty(), "formulas that cannot be shown:\n{}", BOOK.formulas.join("\n"));
    for (page, html) in pages() {
        // What is left without scripts and code.
        let without = |html: &str, element: &str| -> String {
            let end = format!("</{element}>");
            html.split(&format!("<{element}"))
                .map(|part| part.split_once(&end).map_or(part, |(_, rest)| rest))
                .collect()
        };
        let text = without(&without(&html, "script"), "code");
        let source = text.lines().find(|line| line.contains('$'));
        assert_eq!(source, None, "{}: a formula is left as source", page.display());
        assert!(!html.contains("language-math"), "{}: a formula is left as code", page.display());
    }
}

#[test]
fn a_formula_becomes_mathml_and_a_wrong_one_is_named_with_its_page() {
    let mut faults = Vec::new();
    let page = Path::new("docs/theory.md");
    let shown = with_formulas(page, "a $x_1$, `$x$`, [jobs](../jobs), [scope](scope.md)", &mut faults);
    let formula = "<math display=\"inline\"><msub><mi>x</mi><mn>1</mn></msub></math>";
    assert_eq!(shown, format!("a {formula}, `$x$`, jobs, [scope](scope.md)"));
    assert!(with_formulas(page, "```math\n|x|\n```\n", &mut faults).contains("&#124;"));
    assert!(faults.is_empty());
    with_formulas(page, "$$\\nothing{x}$$", &mut faults);
    assert!(faults[0].starts_with("docs/theory.md: \\nothing{x}\n"), "{faults:?}");
}
