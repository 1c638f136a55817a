#!/bin/sh
# Installs what Clarke needs from the distribution: Debian 12 or later, Ubuntu 24.04 or later.
#
#   scripts/install-deps.sh [--build | --test | --test64 | --runtime]
#
#   --build     to compile the solver and run it from the source tree (default)
#   --test      to run the tests and the checks as well: Python for the readers of result files
#   --test64    as --test, and a PETSc with 64-bit indices beside the other
#   --runtime   to run a compiled solver: libraries and mpirun, no compiler, no headers
#
# Nothing is touched, and no network asked, when everything is already there.
# Exit codes: 0 everything is there; 1 something is missing and could not be installed; 2 wrong arguments.
set -euf

build_packages="libpetsc-real-dev libhdf5-openmpi-dev libopenmpi-dev openmpi-bin libmetis-dev libsuitesparse-dev libopenblas0-pthread
libclang-dev pkg-config gcc libc6-dev make git ca-certificates"
# The tests read result files with VTK and meshio, which pip puts into a virtual environment.
test_packages="python3 python3-venv"
wide_packages="libpetsc64-real-dev"
# The runtime libraries carry their version in their name, so they are named by pattern.
runtime_libraries="libpetsc-real[0-9.]+(t64)? libhdf5-openmpi-[0-9]+(-[0-9]+)?(t64)? libmetis[0-9]+(t64)?"
runtime_packages="openmpi-bin libopenblas0-pthread"
oldest_petsc=3.18

say() { printf '%s\n' "install-deps: $*"; }
fail() { printf '%s\n' "install-deps: $*" >&2; exit 1; }

installed() { dpkg-query -W -f '${db:Status-Status}\n' "$1" 2>/dev/null | grep -qx installed; }

# The installed packages whose whole name matches $1.
installed_like() {
    dpkg-query -W -f '${db:Status-Status} ${Package}\n' 2>/dev/null | sed -n 's/^installed //p' | grep -Ex "$1"
}

missing_of() {
    for package in "$@"; do
        installed "$package" || printf '%s ' "$package"
    done
}

# The runtime libraries that this release's development packages depend on, chosen by pattern.
runtime_library_names() {
    closure=$(apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces \
        --no-enhances libpetsc-real-dev libmetis-dev) || return 1
    for pattern in $runtime_libraries; do
        printf '%s\n' "$closure" | grep -Ex "$pattern" | sort -u | grep . ||
            { say "this release has no package named like $pattern" >&2; return 1; }
    done
}

runtime_is_complete() {
    # shellcheck disable=SC2086 # a list of package names
    [ -z "$(missing_of $runtime_packages)" ] || return 1
    for pattern in $runtime_libraries; do
        installed_like "$pattern" >/dev/null || return 1
    done
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null 2>&1; then
        sudo "$@"
    else
        fail "root is needed and sudo is not there; run this script as root"
    fi
}

refresh_lists() {
    say "reading the package lists"
    as_root apt-get update -qq || say "the package lists could not all be read; continuing with the available ones" >&2
}

install_packages() {
    say "installing: $*"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@" ||
        fail "apt-get could not install them; its message stands above"
}

# PETSc's version is the one that an older release would fail on, minutes into the build.
require_petsc() {
    version=$(apt-cache show --no-all-versions libpetsc-real-dev 2>/dev/null | sed -n 's/^Version: //p')
    [ -n "$version" ] || fail "this release has no package libpetsc-real-dev (on Ubuntu, enable the 'universe' component)"
    dpkg --compare-versions "$version" ge "$oldest_petsc" ||
        fail "this release has PETSc $version, Clarke needs $oldest_petsc: use Debian 12 or later, or Ubuntu 24.04 or later"
}

install_development() {
    # shellcheck disable=SC2086 # lists of package names
    missing=$(missing_of "$@")
    if [ -z "$missing" ]; then
        say "every package is there"
        return
    fi
    say "missing: $missing"
    refresh_lists
    require_petsc
    # shellcheck disable=SC2086 # a list of package names
    install_packages $missing
}

install_runtime() {
    if runtime_is_complete; then
        say "every package is there"
        return
    fi
    say "missing: some of $runtime_packages and the libraries of PETSc, HDF5 and METIS"
    refresh_lists
    require_petsc
    libraries=$(runtime_library_names) || fail "the runtime libraries could not be worked out from libpetsc-real-dev"
    # shellcheck disable=SC2046,SC2086 # lists of package names
    install_packages $(missing_of $libraries $runtime_packages)
}

require_rust() {
    how="install it from https://rustup.rs (curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh), then open a new shell"
    manifest=$(dirname "$0")/../Cargo.toml
    needed=$(sed -n 's/^rust-version *= *"\(.*\)".*/\1/p' "$manifest" 2>/dev/null)
    for tool in cargo rustc; do
        command -v "$tool" >/dev/null 2>&1 || fail "$tool is not there; Clarke needs Rust ${needed:-}: $how"
    done
    found=$(rustc --version | sed 's/^rustc \([0-9.]*\).*/\1/')
    [ -n "$found" ] || fail "'rustc --version' gave no version; $how"
    [ -z "$needed" ] || dpkg --compare-versions "$found" ge "$needed" ||
        fail "Rust $found is too old, Clarke needs $needed: run 'rustup update', or $how"
    say "Rust $found is there"
}

what=${1---build}
[ $# -le 1 ] || { say "one option at most: --build, --test, --test64 or --runtime" >&2; exit 2; }
case $what in
    --build | --test | --test64 | --runtime) ;;
    -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0"; exit 0 ;;
    *) say "unknown option $what: --build, --test, --test64 or --runtime" >&2; exit 2 ;;
esac

if ! command -v apt-get >/dev/null 2>&1 || ! command -v dpkg-query >/dev/null 2>&1; then
    if [ "$what" = --runtime ]; then
        fail "this is not Debian or Ubuntu. Install by hand: PETSc $oldest_petsc or later (real, double precision)," \
            "its MPI, HDF5 built for that MPI, METIS 5"
    fi
    fail "this is not Debian or Ubuntu. Install by hand, with headers: PETSc $oldest_petsc or later (real, double" \
        "precision), its MPI with mpicc and mpirun, HDF5 built for that MPI, METIS 5, libclang, pkg-config, a C compiler;" \
        "make pkg-config find PETSc and HDF5; then 'make build'"
fi

if [ "$what" = --runtime ]; then
    install_runtime
else
    [ "$what" = --build ] && test_packages=
    [ "$what" = --test64 ] || wide_packages=
    # shellcheck disable=SC2086 # lists of package names
    install_development $build_packages $test_packages $wide_packages
    require_rust
fi
