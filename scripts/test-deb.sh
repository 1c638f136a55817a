#!/bin/bash
# Installs a Debian package in a copy of this system, runs a job with it as an ordinary user on two ranks, and removes it again.
#
#   sudo scripts/test-deb.sh PACKAGE.deb
#
# The copy is an overlay in memory: this system is not changed. It needs root, and the libraries on which the package depends.
set -euo pipefail
package=$(realpath "$1")
# Containers may leave out manual pages when they install a package.
dpkg-deb --contents "$package" | grep man/man1/solver-run.1.gz >/dev/null
[ "$(id -u)" -eq 0 ] || { echo 'test-deb: overlays need root' >&2; exit 2; }
if [ "${2:-}" != inside ]; then
    exec unshare --mount "$0" "$package" inside
fi
work=$(mktemp -d)
mount -t tmpfs tmpfs "$work"
mkdir "$work"/{upper,work,root}
mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/work" "$work/root"
mount --bind /proc "$work/root/proc"
mount --rbind /sys "$work/root/sys"
mount --rbind /dev "$work/root/dev"
# MPI cannot open files on an overlay.
mount -t tmpfs tmpfs "$work/root/tmp"
mount -t tmpfs tmpfs "$work/root/home"
cp "$package" "$work/root/tmp/package.deb"
chroot "$work/root" /bin/bash -euo pipefail <<'INSIDE'
cd /
! command -v solver >/dev/null || { echo 'test-deb: a solver is installed already' >&2; exit 2; }
dpkg --install /tmp/package.deb
useradd --create-home tester
su tester --shell /bin/bash --command '
    set -euo pipefail
    cp -r /usr/share/clarke ~/clarke
    cd ~/clarke
    solver --version
    solver check jobs/papers/wang_cheng_2022.toml >/dev/null
    export OMPI_MCA_rmaps_base_oversubscribe=1 OMP_NUM_THREADS=1
    mpirun -n 2 solver run jobs/papers/wang_cheng_2022.toml --quiet
    grep -q "\"status\": \"completed\"" jobs/papers/out/*/summary.json
' </dev/null
dpkg --purge clarke
[ ! -e /usr/bin/solver ]
[ ! -e /usr/share/clarke ]
echo 'test-deb: installed, run and removed'
INSIDE
