//! The page of `solver report` in a browser; skipped if Chromium is not installed.

use std::{path::Path, process::Command};

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

fn browser() -> Option<&'static str> {
    let starts =
        |name: &&&str| Command::new(name).arg("--version").output().is_ok_and(|said| said.status.success());
    BROWSERS.iter().find(starts).copied()
}

/// The messages of the browser, and the document after loading this file.
fn load(browser: &str, profile: &Path, page: &Path) -> (String, String) {
    let said = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
        ])
        .args(["--virtual-time-budget=5000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("browser");
    (String::from_utf8_lossy(&said.stderr).into_owned(), String::from_utf8_lossy(&said.stdout).into_owned())
}

/// The page fits wide and narrow screens, all pictures are drawn, the viewer too, if there is one, and the console has no messages. `folder` is for temporary files.
#[track_caller]
pub fn assert_fits(page: &Path, folder: &Path) {
    let Some(browser) = browser() else {
        eprintln!(
            "skipped: none of {BROWSERS:?} is installed; scripts/look-at-report.sh says how to get one"
        );
        return;
    };
    for width in [1280, 400] {
        let frame = folder.join(format!("frame_{width}.html"));
        let text = format!(
            "<body><iframe id='page' src='file://{}' style='border:0;width:{width}px;height:900px'></iframe><script>
            document.getElementById('page').onload = event => {{
              const page = event.target.contentDocument, root = page.documentElement;
              const wide = [...page.querySelectorAll('svg, img, canvas, select, button, h1, p, figcaption, .wide, pre')]
                .filter(each => each.getBoundingClientRect().right > root.clientWidth + 1);
              const letters = [...page.querySelectorAll('svg text')].map(each => each.getBoundingClientRect().height);
              const images = [...page.querySelectorAll('figure img')].filter(each => each.naturalWidth > 0);
              const shrunk = images.filter(each => each.getBoundingClientRect().width < each.naturalWidth / 2);
              const drawn = [...page.querySelectorAll('figure > svg'), ...images]
                .filter(each => each.getBoundingClientRect().height > 50);
              const viewer = page.querySelector('.viewer canvas');
              const turned = !viewer || (viewer.dataset.drawn > 1000 && viewer.getBoundingClientRect().height > 50);
              document.body.innerHTML = `<p>client ${{root.clientWidth}} scroll ${{root.scrollWidth}} beyond ${{wide.length}} ` +
                `drawn ${{drawn.length}} legible ${{Math.min(...letters) >= 8 && shrunk.length === 0}} viewer ${{turned}}</p>`;
            }};</script></body>",
            page.display()
        );
        std::fs::write(&frame, text).expect("written");
        let (console, document) = load(browser, &folder.join("profile"), &frame);
        let faults: Vec<&str> = console.lines().filter(|line| line.contains("CONSOLE")).collect();
        assert!(faults.is_empty(), "{faults:?}");
        let pictures = std::fs::read_to_string(page).expect("page").matches("<figure").count();
        let found =
            document.split("<p>").nth(1).and_then(|rest| rest.split("</p>").next()).unwrap_or(&document);
        let fits = (width - 20..=width).any(|client| {
            found
                == format!(
                    "client {client} scroll {client} beyond 0 drawn {pictures} legible true viewer true"
                )
        });
        assert!(fits, "{width} pixels: {found}");
    }
}
