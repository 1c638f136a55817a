#!/bin/sh
# Shows how a browser draws the page of `solver report`: one PNG of a wide and one of a narrow screen.
#
#   scripts/look-at-report.sh OUTPUT_FOLDER
#
# OUTPUT_FOLDER is that of a run; the report is made first. Writes OUTPUT_FOLDER/report/screen-1280.png and screen-400.png.
# Needs Chromium (on Debian: apt-get install --no-install-recommends chromium, about 300 MB), which `make test` uses as
# well where it is there and does without where it is not. SOLVER and BROWSER name other programs.
# Exit codes: 0 done; 1 no browser, or it failed; 2 wrong arguments.
set -euf

fail() { printf '%s\n' "look-at-report: $1" >&2; exit "${2:-1}"; }

[ $# -eq 1 ] || fail "one argument: the output folder of a run" 2
solver=${SOLVER:-$(dirname "$0")/../target/release/solver}
"$solver" report "$1" || exit $?
folder=$(cd "$1/report" && pwd)
for name in ${BROWSER:-chromium chromium-browser google-chrome}; do
    if command -v "$name" >/dev/null 2>&1; then
        browser=$name
        break
    fi
done
[ -n "${browser:-}" ] || fail "no browser; install Chromium (apt-get install --no-install-recommends chromium)"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for width in 1280 400; do
    # A window has a least width, a frame has none.
    height=$((width == 400 ? 13000 : 7000))
    printf '<body style="margin:0"><iframe src="file://%s/index.html" style="border:0;width:%spx;height:%spx"></iframe>' \
        "$folder" "$width" "$height" >"$work/frame.html"
    "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --allow-file-access-from-files \
        --user-data-dir="$work/profile" --window-size="$((width < 600 ? 600 : width)),$height" \
        --screenshot="$folder/screen-$width.png" "file://$work/frame.html" >"$work/said" 2>&1 ||
        fail "the browser failed: $(tail -n 3 "$work/said")"
    printf '%s\n' "$folder/screen-$width.png"
done
