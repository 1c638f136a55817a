# `make` alone lists the targets.

PREFIX ?= /usr/local
JOB ?= jobs/papers/wang_cheng_2022.toml
RANKS ?= 2
ARGS ?=
DEPS ?= yes
PYTHON ?= python3
# A PETSc with 64-bit indices, where Debian and Ubuntu put it.
PETSC64_DIR ?= /usr/lib/petscdir/petsc64-real
TARGET64 ?= target/petsc64

binary := $(or $(CARGO_TARGET_DIR),target)/release/solver
msrv := $(shell sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
share := $(DESTDIR)$(PREFIX)/share/clarke
completions := bash-completion/completions zsh/site-functions fish/vendor_completions.d

# One thread a rank: threaded BLAS and OpenMP slow the solvers down when every core has a rank.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# More ranks than cores is slow, but no reason to refuse.
export OMPI_MCA_rmaps_base_oversubscribe ?= 1

# Open MPI refuses to start as root unless it is told twice, as in a container or a CI job.
ifeq ($(shell id -u),0)
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
endif

.PHONY: help deps deps64 build run reference test test64 test64-lib hard bench bench-runs bench-accuracy bench-errors bench-effects bench-estimates bench-space verification python lint deny msrv book gallery deb install clean
.DEFAULT_GOAL := help

help:
	@echo 'make deps      install the system packages (Debian, Ubuntu); nothing to do when they are there'
	@echo 'make build     compile the solver: $(binary)'
	@echo 'make run       deps, build, then: mpirun -n $(RANKS) $(binary) $(JOB) $(ARGS)'
	@echo '               other job: JOB=file.toml   ranks: RANKS=4   options: ARGS="--set time.step=0.01"'
	@echo 'make reference  build, then write what is generated from the types of the keys: schema/ and docs/reference-*.md'
	@echo 'make test      deps, then every test, and random input for each reader of files; ARGS=--write puts the slowest into docs'
	@echo 'make test64    the same source against a PETSc with 64-bit indices: tests of the library, every job on two ranks'
	@echo 'make test64-lib  only the tests of the library there, but for those of laws, which know no index'
	@echo 'make bench     kernels of a step against the memory bandwidth; what files cost; ARGS=--write puts the tables into docs'
	@echo 'make bench-runs  whole runs against the memory bandwidth, by phase (docs/speed.md); ARGS=--quick takes a minute'
	@echo 'make bench-accuracy  the studies of docs/what-accuracy-costs.md; ARGS=--write puts their tables into it'
	@echo 'make book      docs/ as a book in target/book, with its links and formulas checked'
	@echo 'make gallery   run the jobs with pictures in README.md, and write the pictures'
	@echo 'make bench-errors  estimated errors of all jobs against true ones; ARGS=--write puts the table into docs/what-accuracy-costs.md'
	@echo 'make bench-effects  what effects and formulas cost (docs/speed.md); ARGS=--write puts the tables into it'
	@echo 'make bench-estimates  estimated and measured times of all jobs (docs/speed.md); ARGS=--write puts the table into it'
	@echo 'make bench-space  errors in space against seconds and memory (docs/space.md); ARGS=--write puts the tables into it'
	@echo 'make verification  the cases of the verification manual, a minute; ARGS=--write puts their tables and pictures into docs/verification'
	@echo 'make python    the tests of the Python package, 15 s; part of make test. PYTHON=venv/bin/python, with pandas and pyvista, tests more'
	@echo 'make hard      what make test samples of hard cases and faults, whole; random input; a Slurm of its own (1.5 h; docs/stability.md)'
	@echo 'make lint      deps, then format, clippy and documentation, warnings refused'
	@echo 'make deny      licences of the crates, and known faults in them (cargo-deny; asks the network)'
	@echo 'make msrv      whether the oldest supported Rust compiles the solver (rustup)'
	@echo 'make deb       build, then a Debian package in target/; as root, scripts/test-deb.sh tries it in a copy of the system'
	@echo 'make install   the built solver with manual pages and shell completion, jobs, meshes and schemas to PREFIX=$(PREFIX)'
	@echo 'make clean     remove everything that was compiled'
	@echo 'DEPS=no skips the packages, for systems where PETSc, MPI, HDF5 and METIS come from elsewhere.'

deps:
ifneq ($(DEPS),no)
	@scripts/install-deps.sh --test
endif

deps64:
ifneq ($(DEPS),no)
	@scripts/install-deps.sh --test64
endif

build:
	cargo build --release --locked

run: deps
	cargo build --release --locked
	mpirun -n $(RANKS) $(binary) $(JOB) $(ARGS)

# The schemas that editors use, and the pages of all keys; tests/documents.rs compares them with the source.
reference: build
	@mkdir -p schema
	$(binary) describe --json > schema/job.schema.json
	$(binary) describe study --json > schema/study.schema.json
	$(binary) describe --markdown > docs/reference-keys.md
	$(binary) describe study --markdown > docs/reference-study-keys.md
	$(binary) describe outputs --json > schema/outputs.json
	$(binary) describe outputs --markdown > docs/reference-outputs.md

# ARGS=--write puts the slowest tests into docs/tests.md.
test: deps
	scripts/test.sh $(ARGS)

# Everything compiled for these indices stays in a folder of its own.
test64: test64-lib
	PETSC_DIR=$(PETSC64_DIR) cargo test --release --locked --target-dir $(TARGET64) --test all jobs::every_job_gives_its_numbers_on_two_ranks

test64-lib: deps64
	PETSC_DIR=$(PETSC64_DIR) cargo test --config scripts/unit-tests.toml --release --locked --target-dir $(TARGET64) --lib --package clarke-core -- --skip laws::

# Random contact laws; random jobs; families of hard cases; kills, full disks, damaged files, restarts; bytes for the readers; Slurm, where root has one to start.
hard: deps
	CLARKE_RANDOM_LAWS=1000 cargo test --release --locked --test all random_laws
	CLARKE_RANDOM_SCENES=5000 cargo test --release --locked --test all random_scenes
	CLARKE_HARD=1 cargo test --release --locked --test all -- hard:: faults:: --test-threads 1 --nocapture
	fuzz/run.sh
	cargo build --release --locked
	tests/slurm/run.sh $(binary)

# Kernels against the memory bandwidth of this machine (ARGS=--write puts the tables into docs); checkpoints and field files by parts, on one rank and on two.
bench: deps
	cargo bench --locked --bench kernels -- $(ARGS)
	cargo bench --locked --bench output -- $(ARGS)
	cargo --config "target.'cfg(all())'.runner='mpirun -n 2'" bench --locked --bench output -- $(ARGS)

# Whole runs against the memory bandwidth of this machine; ARGS='--peer "COMMAND"' compares them with another program,
# '--ranks 2' with two processes; --write puts the tables into docs/speed.md and docs/scaling.md.
bench-runs: deps
	cargo bench --locked --bench whole_runs -- $(ARGS)

# The studies behind docs/what-accuracy-costs.md, some ten minutes; ARGS=--write puts their tables into it.
bench-accuracy: deps
	cargo bench --locked --bench accuracy -- $(ARGS)

# Estimated errors of runs against true ones.
bench-errors: deps
	cargo bench --locked --bench errors -- $(ARGS)

# What effects cost, a few minutes.
bench-effects: deps
	cargo bench --locked --bench effects -- $(ARGS)

# The estimates of solver check against the time of the runs of all jobs, some minutes; ARGS=--write puts the table into docs/speed.md.
bench-estimates: deps
	cargo bench --locked --bench estimates -- $(ARGS)

# Errors in space against seconds and memory, by order of the cells.
bench-space: deps
	cargo bench --locked --bench space -- $(ARGS)

# The cases of docs/verification on three meshes each, under every scheme and preconditioner and on several ranks; ARGS=--write puts tables and pictures
# into the pages; words in ARGS that begin the names of pages select them.
verification: deps
	cargo bench --locked --bench verification -- $(ARGS)

# Tests that need optional packages are skipped where these are missing, with a line that names them.
python: build
	CLARKE_SOLVER=$(abspath $(binary)) $(PYTHON) -m unittest discover -b -v -s python/tests -t python

# With the profile of the build, whose generated code and macros serve here, too.
lint: deps
	cargo fmt --all --check
	cargo clippy --release --all-targets --locked -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --release --no-deps --locked

# The crate advisories change without a change here: no part of `make lint`.
deny:
	@cargo deny --version >/dev/null 2>&1 || cargo install --locked cargo-deny
	cargo deny check

# docs/ as a book in HTML; the tests that make test runs, too, write it and check its links and formulas.
book: deps
	cargo test --release --locked --test all book::
	@echo '$(or $(CARGO_TARGET_DIR),target)/book/index.html'

# The pictures of jobs in README.md.
gallery: build
	scripts/gallery.sh $(binary)

msrv: deps
	rustup toolchain install $(msrv) --profile minimal
	cargo +$(msrv) check --locked --target-dir target/msrv

deb: build
	scripts/make-deb.sh $(binary) target

# Does not compile, so that `sudo make install` needs no Rust for root.
install:
	@test -x $(binary) || { echo '$(binary) is not there: run "make build" first' >&2; exit 1; }
	install -D -m 755 $(binary) $(DESTDIR)$(PREFIX)/bin/solver
	$(binary) man $(DESTDIR)$(PREFIX)/share/man/man1
	install -d $(completions:%=$(DESTDIR)$(PREFIX)/share/%)
	$(binary) completion bash > $(DESTDIR)$(PREFIX)/share/bash-completion/completions/solver
	$(binary) completion zsh > $(DESTDIR)$(PREFIX)/share/zsh/site-functions/_solver
	$(binary) completion fish > $(DESTDIR)$(PREFIX)/share/fish/vendor_completions.d/solver.fish
	find $(wildcard jobs meshes schema) -type f -not -path '*/out/*' -exec install -D -m 644 {} $(share)/{} \;
	@echo 'Jobs and meshes: $(share). A job writes beside itself: copy it to a folder of your own before a run.'

clean:
	cargo clean
