#!/bin/sh
# Packs the built solver with manual pages, completion, jobs, meshes and schemas as a Debian package.
#
#   scripts/make-deb.sh BINARY FOLDER      writes FOLDER/clarke_VERSION_ARCHITECTURE.deb
#
# The package depends on the libraries with which the binary was linked, so that it fits the release on which it was built.
set -eu
cd "$(dirname "$0")/.."
[ $# -eq 2 ] && [ -x "$1" ] || { echo 'usage: scripts/make-deb.sh BINARY FOLDER, after "make build"' >&2; exit 2; }
binary=$1
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
architecture=$(dpkg --print-architecture)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$work/root
chmod 755 "$work"

make --no-print-directory install PREFIX=/usr DESTDIR="$root" binary="$binary" >/dev/null
strip --strip-unneeded "$root/usr/bin/solver"
find "$root/usr/share/man" -type f -exec gzip -9n {} +
documents=$root/usr/share/doc/clarke
mkdir -p "$documents" "$root/DEBIAN" "$work/debian"
cat LICENSE-MIT LICENSE-APACHE >"$documents/copyright"
gzip -9nc CHANGELOG.md >"$documents/changelog.gz"
cp -R README.md docs "$documents"
find "$root/usr" -type d -exec chmod 755 {} +

# dpkg-shlibdeps reads the name of the source package from debian/control.
printf 'Source: clarke\n' >"$work/debian/control"
libraries=$(cd "$work" && dpkg-shlibdeps -O -e"$root/usr/bin/solver" | sed -n 's/^shlibs:Depends=//p')
cat >"$root/DEBIAN/control" <<CONTROL
Package: clarke
Version: $version
Architecture: $architecture
Maintainer: The Clarke developers <clarke@localhost>
Installed-Size: $(du -sk "$root/usr" | cut -f 1)
Depends: $libraries, openmpi-bin
Section: science
Priority: optional
Description: dynamic contact of viscoplastic bodies, in parallel
 A batch solver for bodies that creep, yield and touch, with contact laws that
 may decrease (hemivariational inequalities), under MPI, with certificates of
 uniqueness and stability. Jobs are TOML files; results are HDF5 and CSV.
CONTROL
mkdir -p "$2"
package=$2/clarke_${version}_$architecture.deb
dpkg-deb --root-owner-group --build "$root" "$package" >/dev/null
echo "$package"
