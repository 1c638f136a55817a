#!/usr/bin/env bash
# Executes the Dockerfile without a container engine: each stage becomes a chroot, each instruction is carried out in it.
#
#   sudo scripts/prove-dockerfile.sh WORK_FOLDER [JOB]
#
# JOB is a job file inside the finished image, run there on two ranks as the image's user
# (default /opt/clarke/jobs/papers/wang_cheng_2022.toml; "none" leaves this last check out).
#
# Proves: the instructions work in this order on a bare Debian of that release; nothing outside the committed tree is
# needed; the runtime stage has every shared library; the ordinary user can start the solver, alone and under mpirun.
# Does not prove: that the base images can be pulled, layer caching, or anything about a container's isolation
# (seccomp, cgroups, /dev/shm size). The Rust image is stood in for by a bare Debian with this machine's toolchain, so
# the build stage gets fewer packages than the real one has.
#
# Needs root, debootstrap, git and a Rust toolchain. From the environment:
#   MIRROR         Debian mirror, required
#   APT_CONFIG     folder of apt.conf.d fragments to copy into the chroots, where the network needs special settings
#   RUST_SYSROOT   the toolchain (default: what `rustc --print sysroot` says)
#   CRATES         folder with a cargo registry (default $CARGO_HOME/registry); a copy is used, so crates already
#                  downloaded are not fetched again
#
# WORK_FOLDER keeps the bare systems (base-*) and the finished stages (stage-*); a re-run reuses the former only.
set -euo pipefail

fail() { echo "prove-dockerfile: $*" >&2; exit 1; }
say() { printf '\n== %s\n' "$*"; }

[[ $# -ge 1 && $# -le 2 ]] || fail "usage: $0 WORK_FOLDER [JOB]"
[[ $EUID -eq 0 ]] || fail "chroot needs root"
for tool in debootstrap git unshare rustc; do
    command -v "$tool" >/dev/null || fail "$tool is not there"
done
# In a mount namespace of its own, every mount below disappears with this process.
if [[ -z ${PROVE_DOCKERFILE_INSIDE:-} ]]; then
    PROVE_DOCKERFILE_INSIDE=1 exec unshare --mount --propagation private "$0" "$@"
fi

mkdir -p "$1"
work=$(cd "$1" && pwd)
job=${2:-/opt/clarke/jobs/papers/wang_cheng_2022.toml}
source=$(git -C "$(dirname "$0")" rev-parse --show-toplevel)
mirror=${MIRROR:?set MIRROR to a Debian mirror}
sysroot=${RUST_SYSROOT:-$(cd "$source" && rustc --print sysroot)}
crates=${CRATES:-${CARGO_HOME:-$HOME/.cargo}/registry}

# What `docker build` would see: the committed tree without the files .dockerignore names.
make_context() {
    rm -rf "$work/context"
    git clone -q "$source" "$work/context"
    local pattern
    while read -r pattern; do
        case $pattern in
            '' | '#'*) ;;
            '!'* | /* | *..*) fail ".dockerignore: '$pattern' is more than this script understands" ;;
            *)
                # shellcheck disable=SC2086 # the pattern is to be expanded
                (cd "$work/context" && shopt -s globstar nullglob dotglob && rm -rf -- $pattern)
                ;;
        esac
    done <"$work/context/.dockerignore"
}

# One instruction a line, comments gone, continued lines joined.
instructions() { grep -vE '^[[:space:]]*(#|$)' "$source/Dockerfile" | sed -e ':a' -e '/\\$/{N;s/[[:space:]]*\\\n[[:space:]]*/ /;ba' -e '}'; }

bare_system() { # suite
    local base=$work/base-$1
    if [[ ! -e $base/etc/debian_version ]]; then
        say "debootstrap $1 from $mirror"
        rm -rf "$base"
        debootstrap --variant=minbase "$1" "$base.part" "$mirror" >"$work/debootstrap.log" || fail "see $work/debootstrap.log"
        mv "$base.part" "$base"
    fi
}

start_stage() { # image [AS name]
    local suite
    case $1 in
        *bookworm* | debian:12*) suite=bookworm ;;
        *trixie* | debian:13*) suite=trixie ;;
        *) fail "FROM $1: no bare system is known for this image" ;;
    esac
    name=${3:-final}
    root=$work/stage-$name
    user=root
    directory=/
    environment=(PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin)
    bare_system "$suite"
    rm -rf --one-file-system "$root"
    cp -a "$work/base-$suite" "$root"
    [[ -z ${APT_CONFIG:-} ]] || cp "$APT_CONFIG"/* "$root/etc/apt/apt.conf.d/"
    cp /etc/resolv.conf /etc/hosts "$root/etc/"
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    if [[ $1 == rust:* ]]; then
        mkdir -p "$root/usr/local/rust" "$root/usr/local/cargo/registry"
        mount --bind "$sysroot" "$root/usr/local/rust"
        [[ ! -d $crates ]] || cp -a "$crates/." "$root/usr/local/cargo/registry/"
        environment=(PATH="/usr/local/rust/bin:${environment[0]#PATH=}" CARGO_HOME=/usr/local/cargo)
    fi
}

inside() { # command and arguments, as the stage's user in the stage's directory
    local home
    home=$(awk -F: -v user="$user" '$1 == user { print $6 }' "$root/etc/passwd")
    # shellcheck disable=SC2016 # expanded inside
    env -i HOME="$home" "${environment[@]}" chroot --userspec="$user:" "$root" \
        /bin/sh -c 'cd "$1" && shift && exec "$@"' sh "$directory" "$@"
}

copy() { # [--from=stage] [--chown=owner] source... destination
    local from=$work/context owner=root:root
    while [[ $1 == --* ]]; do
        case $1 in
            --from=*) from=$work/stage-${1#--from=} ;;
            --chown=*) owner=${1#--chown=} ;;
            *) fail "COPY $1 is more than this script understands" ;;
        esac
        shift
    done
    local destination=${*: -1} sources=("${@:1:$#-1}") item
    [[ $destination == /* ]] || destination=$directory/$destination
    local staging=$root/.copy
    mkdir "$staging"
    for item in "${sources[@]}"; do
        [[ -e $from/$item ]] || fail "COPY: $item is not in the build context"
        if [[ -d $from/$item ]]; then
            cp -a "$from/$item/." "$staging/"
        else
            cp -a "$from/$item" "$staging/"
        fi
    done
    chroot "$root" chown -R "$owner" /.copy
    if [[ $destination == */ || $destination == */. || -d $from/${sources[0]} ]]; then
        mkdir -p "$root$destination"
        [[ $owner == root:root ]] || chroot "$root" chown "$owner" "$destination"
        (shopt -s dotglob && cp -a "$staging"/* "$root$destination/")
    else
        mkdir -p "$(dirname "$root$destination")"
        cp -a "$staging/$(basename "${sources[0]}")" "$root$destination"
    fi
    rm -r "$staging"
}

execute() { # one instruction
    local word=${1%% *} rest=${1#* }
    local words
    case $word in
        LABEL) ;;
        FROM) read -ra words <<<"$rest"; start_stage "${words[@]}" ;;
        RUN) inside /bin/sh -c "$rest" ;;
        COPY) read -ra words <<<"$rest"; copy "${words[@]}" ;;
        ENV) read -ra words <<<"$rest"; environment+=("${words[@]}") ;;
        WORKDIR) directory=$rest; mkdir -p "$root$directory" ;;
        USER) user=$rest ;;
        ENTRYPOINT) [[ $rest == '["solver"]' ]] || fail "ENTRYPOINT $rest: the checks below start solver" ;;
        CMD) [[ $rest == '["--help"]' ]] || fail "CMD $rest: the checks below ask for --help" ;;
        *) fail "$word is an instruction this script does not understand" ;;
    esac
}

make_context
git -C "$source" diff --quiet HEAD || say "note: uncommitted changes take no part, but for the Dockerfile itself"
mapfile -t script < <(instructions)
for instruction in "${script[@]}"; do
    say "$instruction"
    execute "$instruction"
done

say "shared libraries of the solver"
libraries=$(inside ldd /usr/local/bin/solver)
! grep 'not found' <<<"$libraries" || fail "shared libraries are missing in the runtime stage"
echo "$(wc -l <<<"$libraries") libraries, none missing; MPI, HDF5, METIS, BLAS, PETSc among them:"
grep -E 'lib(mpi|hdf5|metis|blas|petsc)[^ ]*\.so' <<<"$libraries" || true
say "docker run clarke --version, --help"
inside id
inside solver --version
inside solver --help
say "mpirun -n 2 solver --version"
inside mpirun -n 2 solver --version
if [[ $job != none ]]; then
    say "mpirun -n 2 solver $job"
    inside mpirun -n 2 solver "$job"
fi
say "proved; size of the runtime stage: $(du -sxh "$root" | cut -f1)"
