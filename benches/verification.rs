//! The cases of the verification manual, docs/verification: `cargo bench --bench verification -- [--write] [PAGE]..`.
//!
//! A case is a job of jobs/verification whose `[check]` table holds reference values only. Its page shows the values that are found on
//! several meshes, and a chart of their errors. The first page lists all cases on the meshes of their jobs. `--write` puts tables and
//! charts into the pages, those of the named ones only if there are names (`hertz`).

#[path = "../tests/checked.rs"]
mod checked;
#[path = "../tests/cores.rs"]
mod cores;
#[path = "table/mod.rs"]
mod table;

use clarke::{
    job::{Expected, Job},
    postprocessing::{
        drawing::chart::{Axis, Chart, Look, Series},
        study::quantity,
    },
};
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

const COMMAND: &str = "make verification ARGS=--write";
const PAGES: &str = "docs/verification";

/// A column of a table: a job with changed keys on some ranks.
struct Run {
    label: &'static str,
    ranks: usize,
    changes: &'static [&'static str],
}

const fn with(label: &'static str, changes: &'static [&'static str]) -> Run {
    Run { label, ranks: 1, changes }
}

const fn on_ranks(label: &'static str, ranks: usize, changes: &'static [&'static str]) -> Run {
    Run { label, ranks, changes }
}

/// What the columns of a table are.
#[derive(Clone, Copy, PartialEq)]
enum Columns {
    /// Meshes whose cells are halved from column to column: the errors have an order.
    Meshes,
    /// Variants of the job, each with the error against the same reference.
    Variants,
    /// Ways to solve the same equations: the table shows how much the results differ.
    Agreement,
}

/// A table of a page.
struct Table {
    page: &'static str,
    name: &'static str,
    /// Relative to jobs/, without extension.
    job: &'static str,
    columns: Columns,
    /// Whether the page shows the deformed body on the first mesh, as `solver report` draws it.
    pictured: bool,
    runs: &'static [Run],
}

/// To add a mesh, an order of elements or a case, add a line here, a mark in the page and, for a case, a job.
const TABLES: &[Table] = &[
    Table {
        page: "elastic-bar",
        name: "bdf2",
        job: "verification/elastic_bar_hits_a_wall",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("80", &["mesh.rectangle.cells=[80, 1]", "time.step=5e-7"]),
            with("160", &[]),
            with("320", &["mesh.rectangle.cells=[320, 1]", "time.step=1.25e-7"]),
        ],
    },
    Table {
        page: "elastic-bar",
        name: "schemes",
        job: "verification/elastic_bar_hits_a_wall",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("lagged_euler", &["time.scheme=lagged_euler", "time.step=1.25e-7"]),
            with("implicit_euler", &["time.scheme=implicit_euler", "time.step=1.25e-7"]),
            with("bdf2", &["time.step=1.25e-7"]),
        ],
    },
    Table {
        page: "raous-plate",
        name: "meshes",
        job: "verification/raous_plate",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("16 x 16", &["mesh.rectangle.cells=[16, 16]"]),
            with("32 x 32", &[]),
            with("64 x 64", &["mesh.rectangle.cells=[64, 64]"]),
        ],
    },
    Table {
        page: "double-cantilever",
        name: "strengths",
        job: "verification/double_cantilever",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("57 MPa, 1 mm", &[]),
            with("57 MPa, 0.5 mm", &["mesh.rectangle.cells=[200, 3]"]),
            with("57 MPa, 0.5 mm, 200 steps", &["mesh.rectangle.cells=[200, 3]", "time.step=0.005"]),
            with("1.7 MPa, 1 mm", &["contact.0.adhesion.strength=1.7e6"]),
        ],
    },
    Table {
        page: "coulomb-limit",
        name: "sticking",
        job: "verification/coulomb_limit",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("8 x 4", &["mesh.rectangle.cells=[8, 4]"]),
            with("16 x 8", &[]),
            with("32 x 16", &["mesh.rectangle.cells=[32, 16]"]),
        ],
    },
    Table {
        page: "coulomb-limit",
        name: "sliding",
        job: "verification/coulomb_slip",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("8 x 4", &["mesh.rectangle.cells=[8, 4]"]),
            with("16 x 8", &[]),
            with("32 x 16", &["mesh.rectangle.cells=[32, 16]"]),
        ],
    },
    Table {
        page: "sliding-wedge",
        name: "friction",
        job: "verification/sliding_wedge",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with(
                "0, 1194 N/m",
                &["contact.0.friction.coulomb.coefficient=0", "contact.1.normal.compliance.stiffness=2985.5"],
            ),
            with("0.1, 882.2 N/m", &[]),
            with(
                "0.2, 563.9 N/m",
                &[
                    "contact.0.friction.coulomb.coefficient=0.2",
                    "contact.1.normal.compliance.stiffness=1409.6938775510205",
                ],
            ),
        ],
    },
    Table {
        page: "hertz",
        name: "line",
        job: "verification/hertz_line",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("16 x 16", &["mesh.rectangle.cells=[16, 16]"]),
            with("32 x 32", &[]),
            with("64 x 64", &["mesh.rectangle.cells=[64, 64]"]),
        ],
    },
    Table {
        page: "hertz",
        name: "point",
        job: "verification/hertz_point",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("6^3", &["mesh.box.cells=[6, 6, 6]"]),
            with("12^3", &[]),
            with("24^3", &["mesh.box.cells=[24, 24, 24]"]),
        ],
    },
    Table {
        page: "hertz-sphere",
        name: "meshes",
        job: "verification/hertz_sphere",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 mm", &["mesh.file=../../meshes/sphere_coarse.msh"]),
            with("2 mm", &[]),
            with("1 mm", &["mesh.file=../../meshes/sphere_fine.msh"]),
        ],
    },
    Table {
        page: "cattaneo",
        name: "meshes",
        job: "verification/cattaneo",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 mm", &["mesh.file=../../meshes/half_plane_coarse.msh"]),
            with("2 mm", &[]),
            with("1 mm", &["mesh.file=../../meshes/half_plane_fine.msh"]),
        ],
    },
    Table {
        page: "flat-punch",
        name: "meshes",
        job: "verification/flat_punch",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("32 x 32", &["mesh.rectangle.cells=[32, 32]"]),
            with("64 x 64", &[]),
            with("128 x 128", &["mesh.rectangle.cells=[128, 128]"]),
        ],
    },
    Table {
        page: "prandtl-punch",
        name: "crossed",
        job: "verification/prandtl_punch",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("10 x 10", &["mesh.rectangle.cells=[10, 10]"]),
            with("20 x 20", &[]),
            with("40 x 40", &["mesh.rectangle.cells=[40, 40]"]),
        ],
    },
    Table {
        page: "prandtl-punch",
        name: "alternating",
        job: "verification/prandtl_punch",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("20 x 20", &["mesh.rectangle.diagonal=alternating"]),
            with("40 x 40", &["mesh.rectangle.diagonal=alternating", "mesh.rectangle.cells=[40, 40]"]),
            with("80 x 80", &["mesh.rectangle.diagonal=alternating", "mesh.rectangle.cells=[80, 80]"]),
        ],
    },
    Table {
        page: "prandtl-punch",
        name: "right",
        job: "verification/prandtl_punch",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("20 x 20", &["mesh.rectangle.diagonal=right"]),
            with("40 x 40", &["mesh.rectangle.diagonal=right", "mesh.rectangle.cells=[40, 40]"]),
            with("80 x 80", &["mesh.rectangle.diagonal=right", "mesh.rectangle.cells=[80, 80]"]),
        ],
    },
    Table {
        page: "timoshenko-beam",
        name: "meshes",
        job: "verification/timoshenko_beam",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("32 x 8", &["mesh.rectangle.cells=[32, 8]"]),
            with("64 x 16", &[]),
            with("128 x 32", &["mesh.rectangle.cells=[128, 32]"]),
        ],
    },
    Table {
        page: "ring",
        name: "elastic",
        job: "verification/lame_ring",
        columns: Columns::Meshes,
        pictured: true,
        runs: RINGS,
    },
    Table {
        page: "ring",
        name: "creep",
        job: "verification/norton_ring",
        columns: Columns::Meshes,
        pictured: false,
        runs: RINGS,
    },
    Table {
        page: "friction-pad",
        name: "steps",
        job: "verification/friction_pad",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("0.4 ms", &["time.step=4e-4"]),
            with("0.2 ms", &[]),
            with("0.1 ms", &["time.step=1e-4"]),
            with("bdf2, 0.2 ms", &["time.scheme=bdf2", "contact.0.redistribute_mass=false"]),
        ],
    },
    Table {
        page: "capstan",
        name: "meshes",
        job: "verification/capstan",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("24", &["mesh.file=../../meshes/belt_coarse.msh"]),
            with("48", &[]),
            with("96", &["mesh.file=../../meshes/belt_fine.msh"]),
        ],
    },
    Table {
        page: "vibrating-plane",
        name: "steps",
        job: "verification/vibrating_plane",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[with("10 ms", &["time.step=1e-2"]), with("5 ms", &[]), with("2.5 ms", &["time.step=2.5e-3"])],
    },
    Table {
        page: "restitution",
        name: "steps",
        job: "verification/restitution",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("0.4 ms", &["time.step=4e-4"]),
            with("0.2 ms", &[]),
            with("0.1 ms", &["time.step=1e-4"]),
        ],
    },
    Table {
        page: "colliding-bars",
        name: "meshes",
        job: "verification/colliding_bars",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with(
                "2 x 40",
                &["mesh.rectangle.0.cells=[40, 1]", "mesh.rectangle.1.cells=[40, 1]", "time.step=5e-7"],
            ),
            with("2 x 80", &[]),
            with(
                "2 x 160",
                &["mesh.rectangle.0.cells=[160, 1]", "mesh.rectangle.1.cells=[160, 1]", "time.step=1.25e-7"],
            ),
        ],
    },
    Table {
        page: "layered-bar",
        name: "meshes",
        job: "verification/layered_bar",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("100", &["mesh.rectangle.cells=[100, 1]", "time.step=1e-4"]),
            with("200", &[]),
            with("400", &["mesh.rectangle.cells=[400, 1]", "time.step=2.5e-5"]),
        ],
    },
    Table {
        page: "spring-slider",
        name: "tolerances",
        job: "verification/spring_slider",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("1e-2", &[]),
            with("1e-3", &["time.adaptive.tolerance=1e-3"]),
            with("1e-4", &["time.adaptive.tolerance=1e-4"]),
        ],
    },
    Table {
        page: "fault-rupture",
        name: "meshes",
        job: "verification/fault_rupture",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[with("750 m", &["parameters.n=2"]), with("375 m", &[]), with("188 m", &["parameters.n=8"])],
    },
    Table {
        page: "fault-rupture",
        name: "schemes",
        job: "verification/fault_rupture",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with(
                "bdf2, linear cells of half the size",
                &["parameters.n=8", "mesh.order=1", "time.step=0.02"],
            ),
            with("implicit_euler", &["time.scheme=implicit_euler"]),
        ],
    },
    Table {
        page: "rupture-in-space",
        name: "meshes",
        job: "verification/rupture_in_space",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[with("750 m", &[]), on_ranks("375 m", 2, &["parameters.n=4"])],
    },
    Table {
        page: "rate-and-state-rupture",
        name: "meshes",
        job: "verification/rate_and_state_rupture",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[with("750 m", &["parameters.n=1"]), with("375 m", &[]), with("188 m", &["parameters.n=4"])],
    },
    Table {
        page: "two-cylinders",
        name: "meshes",
        job: "verification/two_cylinders",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("16 x 8", &["mesh.rectangle.0.cells=[16, 8]", "mesh.rectangle.1.cells=[18, 9]"]),
            with("32 x 16", &[]),
            with("64 x 32", &["mesh.rectangle.0.cells=[64, 32]", "mesh.rectangle.1.cells=[72, 36]"]),
        ],
    },
    Table {
        page: "contact-patch",
        name: "meshes",
        job: "verification/contact_patch",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("7 on 5", &[]),
            with("3 on 5", &["mesh.rectangle.1.cells=[3, 2]"]),
            with("20 on 5", &["mesh.rectangle.1.cells=[20, 20]"]),
            with("7 on 5, graded", &["mesh.rectangle.0.grading.x=2"]),
            with("7 on 5, quadratic", &["mesh.order=2"]),
        ],
    },
    Table {
        page: "cone",
        name: "meshes",
        job: "verification/cone",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("20 x 15", &["mesh.rectangle.cells=[20, 15]"]),
            with("40 x 30", &[]),
            with("80 x 60", &["mesh.rectangle.cells=[80, 60]"]),
        ],
    },
    Table {
        page: "cone",
        name: "sizes",
        job: "verification/cone",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with(
                "4 m",
                &[
                    "mesh.rectangle.cells=[80, 60]",
                    "mesh.rectangle.size=[4, 4]",
                    "contact.0.obstacle.plane.point=[0, 4]",
                    "mesh.rectangle.grading.x=3",
                    "mesh.rectangle.grading.y=3",
                ],
            ),
            with("8 m", &["mesh.rectangle.cells=[80, 60]"]),
            with(
                "16 m",
                &[
                    "mesh.rectangle.cells=[80, 60]",
                    "mesh.rectangle.size=[16, 16]",
                    "contact.0.obstacle.plane.point=[0, 16]",
                    "mesh.rectangle.grading.x=4",
                    "mesh.rectangle.grading.y=4",
                ],
            ),
        ],
    },
    Table {
        page: "viscoelastic-sphere",
        name: "meshes",
        job: "verification/viscoelastic_sphere",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("12 x 8, 0.2 s", &["mesh.rectangle.cells=[12, 8]", "time.step=0.2"]),
            with("24 x 15, 0.1 s", &[]),
            with("48 x 30, 0.05 s", &["mesh.rectangle.cells=[48, 30]", "time.step=0.05"]),
        ],
    },
    Table {
        page: "shrink-fit",
        name: "meshes",
        job: "verification/shrink_fit",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("5 + 8", &["mesh.rectangle.0.cells=[5, 2]", "mesh.rectangle.1.cells=[8, 2]"]),
            with("10 + 16", &[]),
            with("20 + 32", &["mesh.rectangle.0.cells=[20, 8]", "mesh.rectangle.1.cells=[32, 6]"]),
        ],
    },
    Table {
        page: "rotating-disc",
        name: "meshes",
        job: "verification/rotating_disc",
        columns: Columns::Meshes,
        pictured: true,
        runs: RINGS,
    },
    Table {
        page: "plastic-sphere",
        name: "meshes",
        job: "verification/plastic_sphere",
        columns: Columns::Meshes,
        pictured: true,
        runs: RINGS,
    },
    Table {
        page: "plastic-tube",
        name: "meshes",
        job: "verification/plastic_tube",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("5 x 1", &["mesh.rectangle.cells=[5, 1]"]),
            with("10 x 2", &[]),
            with("20 x 4", &["mesh.rectangle.cells=[20, 4]"]),
        ],
    },
    Table {
        page: "creeping-tube",
        name: "meshes",
        job: "verification/creeping_tube",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("5 x 1, 0.1 s", &["mesh.rectangle.cells=[5, 1]", "time.step=0.1"]),
            with("10 x 2, 0.05 s", &[]),
            with("20 x 4, 0.025 s", &["mesh.rectangle.cells=[20, 4]", "time.step=0.025"]),
        ],
    },
    Table {
        page: "nafems-creep",
        name: "relaxation",
        job: "verification/nafems_relaxation",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("1e-2", &["time.adaptive.tolerance=1e-2"]),
            with("1e-3", &[]),
            with("1e-4", &["time.adaptive.tolerance=1e-4"]),
            with("bdf2, 1e-4", &["time.adaptive.tolerance=1e-4", "time.scheme=bdf2"]),
        ],
    },
    Table {
        page: "nafems-creep",
        name: "triaxial",
        job: "verification/nafems_triaxial_creep",
        columns: Columns::Variants,
        pictured: false,
        runs: &[with("50 h", &[]), with("25 h", &["time.step=25"]), with("12.5 h", &["time.step=12.5"])],
    },
    Table {
        page: "nafems-plasticity",
        name: "steps",
        job: "verification/nafems_plasticity",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("80 steps", &["time.step=0.1"]),
            with("160 steps", &["time.step=0.05"]),
            with("320 steps", &[]),
        ],
    },
    Table {
        page: "triaxial",
        name: "relaxations",
        job: "verification/triaxial",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("1 kPa s", &[]),
            with("100 Pa s", &["material.viscoplasticity.drucker_prager.relaxation=1e2"]),
            with("10 Pa s", &["material.viscoplasticity.drucker_prager.relaxation=10"]),
        ],
    },
    Table {
        page: "off-axis-strip",
        name: "meshes",
        job: "orthotropic_strip",
        columns: Columns::Variants,
        pictured: true,
        runs: &[
            with("8 x 2", &[]),
            with("32 x 8", &["mesh.rectangle.cells=[32, 8]"]),
            with("8 x 2, crossed", &["mesh.rectangle.diagonal=crossed"]),
            with("8 x 2, quadratic", &["mesh.order=2"]),
        ],
    },
    Table {
        page: "strip-footing",
        name: "meshes",
        job: "verification/strip_footing",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("10 x 5", &["mesh.rectangle.cells=[10, 5]"]),
            with("20 x 10", &[]),
            with("40 x 20", &["mesh.rectangle.cells=[40, 20]"]),
        ],
    },
    Table {
        page: "elliptic-membrane",
        name: "meshes",
        job: "verification/elliptic_membrane",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 x 6", &["mesh.file=../../meshes/membrane_coarse.msh"]),
            with("8 x 12", &[]),
            with("16 x 24", &["mesh.file=../../meshes/membrane_fine.msh"]),
        ],
    },
    Table {
        page: "thick-plate",
        name: "meshes",
        job: "verification/thick_plate",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("2 x 2 x 2", &["mesh.file=../../meshes/thick_plate_coarse.msh"]),
            with("4 x 4 x 4", &[]),
            with("8 x 8 x 8", &["mesh.file=../../meshes/thick_plate_fine.msh"]),
        ],
    },
    Table {
        page: "strip-with-hole",
        name: "meshes",
        job: "verification/strip_with_hole",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 x 8", &["mesh.file=../../meshes/strip_coarse.msh"]),
            with("8 x 16", &[]),
            with("16 x 32", &["mesh.file=../../meshes/strip_fine.msh"]),
        ],
    },
    Table {
        page: "cook-panel",
        name: "meshes",
        job: "verification/cook_panel",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 x 4", &["mesh.file=../../meshes/panel_coarse.msh"]),
            with("8 x 8", &[]),
            with("16 x 16", &["mesh.file=../../meshes/panel_fine.msh"]),
        ],
    },
    Table {
        page: "cook-panel",
        name: "linear",
        job: "verification/cook_panel",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("4 x 4", &["mesh.order=1", "mesh.file=../../meshes/panel_coarse.msh"]),
            with("8 x 8", &["mesh.order=1"]),
            with("16 x 16", &["mesh.order=1", "mesh.file=../../meshes/panel_fine.msh"]),
        ],
    },
    Table {
        page: "roller",
        name: "meshes",
        job: "verification/roller",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("12 x 10", &["mesh.file=../../meshes/roller_coarse.msh"]),
            with("24 x 20", &[]),
            with("48 x 40", &["mesh.file=../../meshes/roller_fine.msh"]),
        ],
    },
    Table {
        page: "roller",
        name: "linear",
        job: "verification/roller",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("12 x 10", &["mesh.order=1", "mesh.file=../../meshes/roller_coarse.msh"]),
            with("24 x 20", &["mesh.order=1"]),
            with("48 x 40", &["mesh.order=1", "mesh.file=../../meshes/roller_fine.msh"]),
        ],
    },
    Table {
        page: "wedge",
        name: "meshes",
        job: "verification/wedge",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("16 x 16", &["mesh.rectangle.cells=[16, 16]"]),
            with("32 x 32", &[]),
            with("64 x 64", &["mesh.rectangle.cells=[64, 64]"]),
        ],
    },
    Table {
        page: "adhesive-sphere",
        name: "meshes",
        job: "verification/adhesive_sphere",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("10 x 4", &["mesh.rectangle.cells=[10, 4]"]),
            with("20 x 4", &[]),
            with("40 x 4", &["mesh.rectangle.cells=[40, 4]"]),
        ],
    },
    Table {
        page: "elastic-foundation",
        name: "meshes",
        job: "verification/elastic_foundation",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("80 x 1", &["mesh.rectangle.cells=[80, 1]"]),
            with("160 x 2", &[]),
            with("320 x 4", &["mesh.rectangle.cells=[320, 4]"]),
        ],
    },
    Table {
        page: "lifted-beam",
        name: "meshes",
        job: "verification/lifted_beam",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("50 x 1", &["mesh.rectangle.cells=[50, 1]"]),
            with("100 x 2", &[]),
            with("200 x 4", &["mesh.rectangle.cells=[200, 4]"]),
        ],
    },
    Table {
        page: "lap-joint",
        name: "meshes",
        job: "verification/lap_joint",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("25 x 2", &["mesh.rectangle.0.cells=[25, 2]", "mesh.rectangle.1.cells=[25, 2]"]),
            with("50 x 4", &[]),
            with("100 x 8", &["mesh.rectangle.0.cells=[100, 8]", "mesh.rectangle.1.cells=[100, 8]"]),
        ],
    },
    Table {
        page: "debonding",
        name: "meshes",
        job: "verification/debonding",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("100 x 1", &["mesh.rectangle.cells=[100, 1]"]),
            with("200 x 2", &[]),
            with("400 x 4", &["mesh.rectangle.cells=[400, 4]"]),
        ],
    },
    Table {
        page: "debonding",
        name: "laws",
        job: "verification/debonding",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("energy", &[]),
            with("bilinear, 20 MPa", &["contact.0.adhesion.strength=2e7"]),
            with("energy, 100 steps", &["time.step=0.005"]),
        ],
    },
    Table {
        page: "sliding-cylinder",
        name: "meshes",
        job: "verification/sliding_cylinder",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("4 mm", &["mesh.file=../../meshes/half_plane_coarse.msh"]),
            with("2 mm", &[]),
            with("1 mm", &["mesh.file=../../meshes/half_plane_fine.msh"]),
        ],
    },
    Table {
        page: "spherical-cavity",
        name: "meshes",
        job: "verification/spherical_cavity",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("12 x 4", &["mesh.file=../../meshes/cavity_coarse.msh", "time.step=1e-4"]),
            with("24 x 8", &[]),
            with("48 x 16", &["mesh.file=../../meshes/cavity_fine.msh", "time.step=2.5e-5"]),
        ],
    },
    Table {
        page: "spherical-cavity",
        name: "schemes",
        job: "verification/spherical_cavity",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("bdf2", &[]),
            with("midpoint", &["time.scheme=midpoint"]),
            with("implicit_euler", &["time.scheme=implicit_euler"]),
        ],
    },
    Table {
        page: "hertz-impact",
        name: "meshes",
        job: "verification/hertz_impact",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("20 x 15, T/50", &["mesh.rectangle.cells=[20, 15]", "time.step=3.057505e-4"]),
            with("40 x 30, T/100", &[]),
            with("80 x 60, T/200", &["mesh.rectangle.cells=[80, 60]", "time.step=7.6437625e-5"]),
        ],
    },
    Table {
        page: "wavy-surface",
        name: "meshes",
        job: "verification/wavy_surface",
        columns: Columns::Meshes,
        pictured: true,
        runs: &[
            with("16 x 16", &["mesh.rectangle.cells=[16, 16]"]),
            with("32 x 32", &[]),
            with("64 x 64", &["mesh.rectangle.cells=[64, 64]"]),
        ],
    },
    Table {
        page: "worn-groove",
        name: "meshes",
        job: "verification/worn_groove",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("40 x 10, 50 steps", &["mesh.rectangle.cells=[40, 10]", "time.step=0.16666666666666666"]),
            with("80 x 20, 100 steps", &[]),
            with(
                "160 x 40, 200 steps",
                &["mesh.rectangle.cells=[160, 40]", "time.step=0.041666666666666664"],
            ),
        ],
    },
    Table {
        page: "hertz-slides",
        name: "meshes",
        job: "verification/hertz_slides",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("40, 35", &["mesh.rectangle.0.cells=[40, 10]", "mesh.rectangle.1.cells=[35, 10]"]),
            with("80, 70", &[]),
            with("160, 140", &["mesh.rectangle.0.cells=[160, 40]", "mesh.rectangle.1.cells=[140, 40]"]),
        ],
    },
    Table {
        page: "elliptic-contact",
        name: "meshes",
        job: "verification/elliptic_contact",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("6^3", &["mesh.box.cells=[6, 6, 6]"]),
            with("12^3", &[]),
            with("24^3", &["mesh.box.cells=[24, 24, 24]"]),
        ],
    },
    Table {
        page: "elliptic-contact",
        name: "quadratic",
        job: "verification/elliptic_contact",
        columns: Columns::Variants,
        pictured: false,
        runs: &[with("6^3", &["mesh.order=2", "mesh.box.cells=[6, 6, 6]"]), with("12^3", &["mesh.order=2"])],
    },
    Table {
        page: "mindlin-sphere",
        name: "meshes",
        job: "verification/mindlin_sphere",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("12", &["mesh.box.0.cells=[12, 4, 4]", "mesh.box.1.cells=[12, 4, 4]"]),
            with("24", &[]),
            with("48", &["mesh.box.0.cells=[48, 16, 16]", "mesh.box.1.cells=[48, 16, 16]"]),
        ],
    },
    Table {
        page: "mindlin-sphere",
        name: "quadratic",
        job: "verification/mindlin_sphere",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("12", &["mesh.order=2", "mesh.box.0.cells=[12, 4, 4]", "mesh.box.1.cells=[12, 4, 4]"]),
            with("24", &["mesh.order=2"]),
        ],
    },
    Table {
        page: "spence",
        name: "meshes",
        job: "verification/spence",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("16 x 8", &["mesh.rectangle.cells=[16, 8]"]),
            with("32 x 16", &[]),
            with("64 x 32", &["mesh.rectangle.cells=[64, 32]"]),
        ],
    },
    Table {
        page: "nafems-punch",
        name: "meshes",
        job: "verification/nafems_punch",
        columns: Columns::Variants,
        pictured: true,
        runs: &[
            with("coarse", &["mesh.file=../../meshes/punch_coarse.msh"]),
            with("medium", &[]),
            with("fine", &["mesh.file=../../meshes/punch_fine.msh"]),
        ],
    },
    Table {
        page: "nafems-punch",
        name: "linear",
        job: "verification/nafems_punch",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("medium", &["mesh.order=1"]),
            with("fine", &["mesh.order=1", "mesh.file=../../meshes/punch_fine.msh"]),
        ],
    },
    Table {
        page: "towed-block",
        name: "steps",
        job: "verification/towed_block",
        columns: Columns::Variants,
        pictured: false,
        runs: &[
            with("1 ms", &["time.step=1e-3"]),
            with("0.5 ms", &[]),
            with("0.25 ms", &["time.step=2.5e-4"]),
        ],
    },
    Table {
        page: "rolling",
        name: "meshes",
        job: "verification/rolling",
        columns: Columns::Meshes,
        pictured: false,
        runs: &[
            with("0.2 mm", &["mesh.file=../../meshes/rolling_coarse.msh", "time.step=2e-4"]),
            with("0.1 mm", &[]),
            with("0.05 mm", &["mesh.file=../../meshes/rolling_fine.msh", "time.step=5e-5"]),
        ],
    },
    Table {
        page: "agreement",
        name: "schemes",
        job: "papers/wang_cheng_2022",
        columns: Columns::Agreement,
        pictured: false,
        runs: &[
            with("lagged_euler", &["mesh.rectangle.cells=[16, 16]", "time.step=0.00048828125"]),
            with(
                "implicit_euler",
                &["mesh.rectangle.cells=[16, 16]", "time.step=0.00048828125", "time.scheme=implicit_euler"],
            ),
            with("bdf2", &["mesh.rectangle.cells=[16, 16]", "time.step=0.00048828125", "time.scheme=bdf2"]),
        ],
    },
    Table {
        page: "agreement",
        name: "preconditioners",
        job: "papers/wang_cheng_2022",
        columns: Columns::Agreement,
        pictured: false,
        runs: &[
            with("cholesky", &["solver.preconditioner=cholesky", "solver.factor_precision=double"]),
            with("cholesky, single", &["solver.preconditioner=cholesky", "solver.factor_precision=single"]),
            with("gamg", &["solver.preconditioner=gamg"]),
            with("boomeramg", &["solver.preconditioner=boomeramg"]),
        ],
    },
    Table {
        page: "agreement",
        name: "ranks",
        job: "papers/wang_cheng_2022",
        columns: Columns::Agreement,
        pictured: false,
        runs: &[
            on_ranks("1", 1, &[]),
            on_ranks("2", 2, &[]),
            on_ranks("3", 3, &[]),
            on_ranks("4", 4, &[]),
            on_ranks("4, gamg", 4, &["solver.preconditioner=gamg"]),
        ],
    },
    Table {
        page: "agreement",
        name: "friction",
        job: "verification/raous_plate",
        columns: Columns::Agreement,
        pictured: false,
        runs: &[
            on_ranks("newton, 1", 1, &[]),
            on_ranks("newton, 3", 3, &[]),
            on_ranks("fixed_point, 1", 1, &["solver.friction=fixed_point"]),
        ],
    },
];

const RINGS: &[Run] = &[
    with("4 x 8", &["mesh.file=../../meshes/ring_coarse.msh"]),
    with("8 x 16", &[]),
    with("16 x 32", &["mesh.file=../../meshes/ring_fine.msh"]),
];

/// Pages that show tables of a study: page, study, and what a heading or a row of its tables contains.
const STUDIES: [(&str, &str, &str); 2] =
    [("table-1", "wang_cheng_table_1", "published"), ("corners", "graded_corners", "_sum]")];

/// Closed forms in other jobs, relative to jobs/: those numbers of their `[check]` tables that are references.
const ELSEWHERE: &[(&str, &[&str])] = &[
    (
        "block_in_a_corner",
        &[
            "profile.right.max.contact_pressure",
            "profile.bottom.max.contact_pressure",
            "profile.bottom.max.normal_displacement",
            "probe.left.displacement_x",
        ],
    ),
    (
        "compliant_foundation",
        &["probe.bottom.displacement_y", "profile.bottom.max.contact_pressure", "history.contact_energy"],
    ),
    (
        "conveyor_belt",
        &["probe.centre.displacement_x", "history.external_work", "history.contact_dissipation"],
    ),
    ("creep_rupture", &["probe.end.displacement_x", "history.damage_dissipation"]),
    ("dilatant_shear", &["final_von_mises"]),
    ("hardening_bar", &["probe.tip.displacement_x"]),
    ("oblique_sliding", &["probe.centre.velocity_x", "probe.centre.velocity_y"]),
    (
        "one_way_guide",
        &[
            "profile.bottom.max.normal_displacement",
            "profile.bottom.max.contact_pressure",
            "probe.top.velocity_y",
        ],
    ),
    (
        "orthotropic_strip",
        &["probe.far.displacement_x", "probe.far.displacement_y", "probe.above.displacement_y"],
    ),
    ("permanent_set", &["probe.tip.displacement_x", "history.viscoplastic_dissipation"]),
    ("power_law_creep", &["probe.tip.velocity_x"]),
    ("remembering_foundation", &["probe.foot.displacement_y", "history.contact_dissipation"]),
    ("sinking_block", &["probe.corner.velocity_y", "profile.bottom.max.contact_pressure"]),
    ("sliding_block", &["probe.centre.displacement_x"]),
    ("velocity_weakening_block", &["probe.centre.velocity_x"]),
    ("stick_on_a_jump", &["profile.bottom.max.normal_velocity"]),
    ("strain_hardening_creep", &["probe.tip.displacement_x", "history.viscoplastic_dissipation"]),
    ("stress_relaxation", &["final_von_mises"]),
    ("stuck_beam", &["history.elastic_energy"]),
    ("torn_off", &["probe.middle.velocity_y", "history.adhesion_dissipation"]),
    ("hard/graded_by_a_million", &["probe.corner.displacement_x", "probe.corner.displacement_y"]),
    ("hard/nearly_incompressible", &["probe.top.displacement_y"]),
    ("hard/nearly_perfect_plasticity_in_space", &["probe.end.displacement_x", "final_von_mises"]),
    ("hard/slivers_in_space", &["probe.corner.displacement_x", "probe.corner.displacement_z"]),
    ("hard/three_solutions", &["probe.bottom.velocity_y"]),
    ("hard/twentieth_power_of_the_overstress", &["probe.end.displacement_x"]),
];

/// Relative uncertainties of references: 0 for those that are exact for the problem of the job, others where they hold for another problem,
/// such as a half space, or have errors of their own. Job, end of the name of the quantity, uncertainty; the first that fits counts. The
/// pages say where the numbers come from.
const UNCERTAIN: &[(&str, &str, f64)] = &[
    ("verification/cattaneo", "sticking_area", 1e-2),
    ("verification/cattaneo", "", 2e-3),
    ("verification/colliding_bars", "", 0.0),
    ("verification/contact_patch", "", 0.0),
    ("verification/coulomb_limit", "", 0.0),
    ("verification/coulomb_slip", "", 0.0),
    ("verification/creeping_tube", "", 0.0),
    ("verification/double_cantilever", "", 2e-3),
    ("verification/elastic_bar_hits_a_wall", "", 0.0),
    ("verification/flat_punch", "force_y", 0.0),
    ("verification/flat_punch", "", 1e-2),
    ("verification/hertz_line", "force_y", 0.0),
    ("verification/hertz_line", "", 3e-3),
    ("verification/hertz_point", "force_z", 0.0),
    ("verification/hertz_point", "", 1e-2),
    ("verification/hertz_sphere", "touching_area", 0.08),
    ("verification/lame_ring", "", 0.0),
    ("verification/layered_bar", "", 0.0),
    ("verification/nafems_relaxation", "", 0.0),
    ("verification/nafems_triaxial_creep", "", 0.0),
    ("verification/norton_ring", "", 1e-5),
    ("verification/plastic_sphere", "", 0.0),
    ("verification/plastic_tube", "", 0.0),
    ("verification/prandtl_punch", "", 1e-3),
    ("verification/raous_plate", "", 1e-4),
    ("verification/rotating_disc", "", 0.0),
    ("verification/shrink_fit", "", 0.0),
    ("verification/sliding_wedge", "", 0.0),
    ("verification/strip_footing", "", 5e-3),
    ("verification/timoshenko_beam", "", 0.0),
    ("verification/triaxial", "", 0.0),
    ("verification/two_cylinders", "force_y", 0.0),
    ("verification/fault_rupture", "arrival.sliding_velocity_x", 1e-3),
    ("verification/fault_rupture", "max.sliding_velocity_x", 1.5e-2),
    ("verification/fault_rupture", "", 1e-3),
    ("verification/rupture_in_space", "arrival.sliding_velocity_x", 2e-3),
    ("verification/rupture_in_space", "centre.max.sliding_velocity_x", 3e-3),
    ("verification/rupture_in_space", "max.sliding_velocity_x", 2.5e-2),
    ("verification/rupture_in_space", "", 3e-3),
    ("verification/rate_and_state_rupture", "at_3_km.max.sliding_velocity_x", 1e-2),
    ("verification/rate_and_state_rupture", "max.sliding_velocity_x", 5e-3),
    ("verification/rate_and_state_rupture", "", 1e-3),
    ("verification/vibrating_plane", "dissipation", 6e-5),
    ("verification/vibrating_plane", "", 6e-4),
    ("verification/hertz_sphere", "force_z", 0.13),
    ("verification/hertz_sphere", "largest_pressure", 0.05),
    ("verification/friction_pad", "displacement_x", 3e-3),
    ("verification/friction_pad", "dissipation", 4e-5),
    ("verification/restitution", "", 4e-5),
    ("verification/spring_slider", "", 1e-6),
    ("verification/capstan", "", 1e-3),
    ("verification/cone", "obstacle_displacement", 4e-3),
    ("verification/cone", "touching_area", 4e-3),
    ("verification/two_cylinders", "largest_pressure", 1e-3),
    ("verification/two_cylinders", "touching_area", 1e-3),
    ("verification/viscoelastic_sphere", "obstacle_displacement", 1.3e-2),
    ("verification/viscoelastic_sphere", "", 5e-3),
    ("verification/nafems_plasticity", "", 1e-5),
    ("verification/sliding_cylinder", "force_x", 0.0),
    ("verification/sliding_cylinder", "sticking_area", 0.0),
    ("verification/sliding_cylinder", "moment_z", 7e-2),
    ("verification/sliding_cylinder", "", 2e-3),
    ("verification/spherical_cavity", "", 0.0),
    ("verification/hertz_impact", "obstacle_velocity", 0.0),
    ("verification/hertz_impact", "obstacle_displacement", 1e-2),
    ("verification/hertz_impact", "", 4e-3),
    ("verification/wavy_surface", "", 1e-4),
    ("verification/worn_groove", "force_x", 0.0),
    ("verification/worn_groove", "", 1e-3),
    ("verification/hertz_slides", "force_x", 0.0),
    ("verification/hertz_slides", "force_y", 0.0),
    ("verification/hertz_slides", "", 1e-2),
    ("verification/elliptic_contact", "force_z", 0.0),
    ("verification/elliptic_contact", "", 1.4e-2),
    ("verification/mindlin_sphere", "", 1e-3),
    ("verification/spence", "force_y", 0.0),
    ("verification/spence", "", 1e-3),
    ("verification/nafems_punch", "force_y", 0.0),
    ("verification/nafems_punch", "normal_displacement", 1.7e-2),
    ("verification/nafems_punch", "contact_pressure", 7e-2),
    ("verification/towed_block", "", 5e-4),
    ("verification/rolling", "force_x", 0.0),
    ("verification/rolling", "velocity_x", 5e-3),
    ("verification/rolling", "sticking_area", 5e-3),
    ("verification/rolling", "", 1e-3),
    ("orthotropic_strip", "", 0.0),
    ("verification/elliptic_membrane", "", 1e-6),
    ("verification/thick_plate", "", 1e-2),
    ("verification/strip_with_hole", "", 1e-8),
    ("verification/cook_panel", "", 3e-3),
    ("verification/roller", "", 2e-2),
    ("verification/wedge", "", 1e-3),
    ("verification/adhesive_sphere", "", 1e-3),
    ("verification/elastic_foundation", "", 2e-4),
    ("verification/lifted_beam", "force_y", 1e-3),
    ("verification/lifted_beam", "open_area", 3e-2),
    ("verification/lap_joint", "adhesion_energy", 1e-2),
    ("verification/lap_joint", "", 4e-3),
    ("verification/debonding", "", 1e-6),
];

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// The numbers of the `[check]` table of a job.
fn expected(job: &str) -> Vec<(String, Expected)> {
    let job =
        Job::load(&folder("jobs").join(format!("{job}.toml")), &[]).expect("a job of the repository").job;
    job.check.into_iter().collect()
}

/// These quantities as a run of the job leaves them in this folder, and the wall time of the run in s.
fn found(job: &str, run: &Run, quantities: &[&str], output: &Path) -> (Vec<f64>, f64) {
    let file = folder("jobs").join(format!("{job}.toml"));
    let start = Instant::now();
    if let Err(words) = checked::run(&file, run.ranks, output, run.changes) {
        panic!("{job}, {}: {words}", run.label);
    }
    let seconds = start.elapsed().as_secs_f64();
    let number = |name: &&str| quantity(output, name).unwrap_or_else(|| panic!("{job} left no {name}"));
    (quantities.iter().map(number).collect(), seconds)
}

/// The error, relative to the reference unless that is zero.
fn error(found: f64, reference: f64) -> f64 {
    let scale = if reference == 0.0 { 1.0 } else { reference.abs() };
    (found - reference).abs() / scale
}

/// A number as the tables show it.
fn number(value: f64) -> String {
    if value == 0.0 { "0".into() } else { format!("{value:.5e}") }
}

fn short(value: f64) -> String {
    if value == 0.0 { "0".into() } else { format!("{value:.1e}") }
}

/// Errors of an exact result are rounding errors and have no order.
const ROUNDING: f64 = 1e-7;

/// The order of the last of these errors on meshes that are halved.
fn order(errors: &[f64]) -> String {
    match errors {
        [.., before, last] if *last > ROUNDING => format!("{:.2}", (before / last).log2()),
        _ => "-".into(),
    }
}

/// The file of a picture that belongs to a table.
fn picture(table: &Table, shows: &str) -> PathBuf {
    let name = format!("{}_{}_{shows}.svg", table.page.replace('-', "_"), table.name);
    folder(PAGES).join("pictures").join(name)
}

/// Writes the picture of the deformed body that `solver report` draws of the run in the folder.
fn draw_body(output: &Path, file: &Path) {
    let report = Command::new(env!("CARGO_BIN_EXE_solver")).arg("report").arg(output).output();
    let report = report.expect("started");
    assert!(report.status.success(), "{}", String::from_utf8_lossy(&report.stderr));
    fs::copy(output.join("report/von_mises.svg"), file).expect("the picture of the body");
}

/// The table with the seconds of each run in its last row, and the relative errors of each quantity.
fn rows(table: &Table, writes: bool) -> (String, Vec<(String, Vec<f64>)>) {
    let kept = |name: &str| match table.columns {
        Columns::Agreement => ["probe.", "history.", "profile.", "resultant.", "final_"]
            .iter()
            .any(|start| name.starts_with(start)),
        _ => name != "max_energy_imbalance",
    };
    let expected: Vec<_> = expected(table.job).into_iter().filter(|(name, _)| kept(name)).collect();
    let names: Vec<&str> = expected.iter().map(|(name, _)| name.as_str()).collect();
    let columns = table.runs.iter().enumerate().map(|(column, run)| {
        let output = tempfile::tempdir().expect("folder");
        let values = found(table.job, run, &names, output.path());
        if let (true, true, 0) = (table.pictured, writes, column) {
            draw_body(output.path(), &picture(table, "body"));
        }
        values
    });
    let (columns, seconds): (Vec<Vec<f64>>, Vec<f64>) = columns.unzip();
    let labels: Vec<&str> = table.runs.iter().map(|run| run.label).collect();
    let last = match table.columns {
        Columns::Meshes => "error of the last | order",
        Columns::Variants => "largest error",
        Columns::Agreement => "largest difference",
    };
    let reference = if table.columns == Columns::Agreement { "" } else { "reference | " };
    let mut text = format!("| quantity | {reference}{} | {last} |\n", labels.join(" | "));
    text += &format!("|:--|{}\n", "--:|".repeat(text.matches(" | ").count()));
    let mut all = vec![];
    for (row, (name, expected)) in expected.iter().enumerate() {
        let values: Vec<f64> = columns.iter().map(|column| column[row]).collect();
        let against = if table.columns == Columns::Agreement { values[0] } else { expected.value };
        let errors: Vec<f64> = values.iter().map(|value| error(*value, against)).collect();
        let largest = errors.iter().copied().fold(0.0, f64::max);
        let tail = match table.columns {
            Columns::Meshes => format!("{} | {}", short(errors[errors.len() - 1]), order(&errors)),
            _ => short(largest),
        };
        let shown = values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" | ");
        let reference =
            if table.columns == Columns::Agreement { String::new() } else { number(expected.value) + " | " };
        text += &format!("| `{name}` | {reference}{shown} | {tail} |\n");
        if expected.value != 0.0 {
            all.push((name.clone(), errors));
        }
    }
    let seconds = seconds.iter().map(|seconds| format!("{seconds:.1}")).collect::<Vec<_>>().join(" | ");
    let before = if table.columns == Columns::Agreement { "" } else { " | " };
    let after = if table.columns == Columns::Meshes { " | |" } else { " |" };
    text += &format!("| seconds | {before}{seconds} |{after}\n");
    (text, all)
}

/// A chart of errors over the mesh, where they are not rounding errors.
fn chart(errors: &[(String, Vec<f64>)]) -> Option<String> {
    let wanted = errors.iter().filter(|(_, errors)| errors.iter().all(|error| *error > ROUNDING));
    let series: Vec<Series> = wanted
        .enumerate()
        .map(|(place, (name, errors))| {
            let points = errors.iter().enumerate().map(|(level, error)| [0.5_f64.powi(level as i32), *error]);
            Series::new(place, name.clone(), Look::Dotted, points.collect())
        })
        .collect();
    if series.is_empty() {
        return None;
    }
    let x = Axis::new("size of the cells, relative to the first mesh", "");
    let mut chart = Chart::new(x, Axis::new("relative error", ""), series);
    (chart.logarithmic, chart.logarithmic_x) = (true, true);
    Some(chart.svg().expect("a chart"))
}

/// The uncertainty of a reference, and the error divided by it, as the table of all cases shows them. Jobs with a page have one.
fn uncertainty(job: &str, quantity: &str, error: f64) -> [String; 2] {
    let known = UNCERTAIN.iter().find(|(of, ending, _)| *of == job && quantity.ends_with(ending));
    assert!(
        known.is_some() || !job.starts_with("verification/"),
        "{job}, {quantity}: how uncertain is the reference?"
    );
    let known = known.map(|(_, _, uncertainty)| *uncertainty);
    let ratio = match known {
        None | Some(0.0) => "-".into(),
        Some(uncertainty) if (0.1..100.0).contains(&(error / uncertainty)) => {
            format!("{:.1}", error / uncertainty)
        }
        Some(uncertainty) => short(error / uncertainty),
    };
    let shown = match known {
        None => "-".into(),
        Some(0.0) => "exact".into(),
        Some(uncertainty) => short(uncertainty),
    };
    [shown, ratio]
}

/// The table of all cases: every job of jobs/verification and the closed forms elsewhere, on the meshes of the jobs.
fn overview() -> String {
    let jobs = fs::read_dir(folder("jobs/verification")).expect("folder").filter_map(|entry| {
        let path = entry.expect("entry").path();
        let stem = path.file_stem()?.to_str()?.to_owned();
        path.extension().is_some_and(|word| word == "toml").then(|| format!("verification/{stem}"))
    });
    let mut jobs: Vec<String> = jobs.collect();
    jobs.sort();
    let elsewhere = ELSEWHERE.iter().map(|(job, names)| (job.to_string(), Some(*names)));
    let mut text =
        "| job | quantity | reference | uncertainty | found | error | error / uncertainty | accepted |\n|:--|:--|--:|--:|--:|--:|--:|--:|\n"
            .to_owned();
    let link = |job: &str| {
        let page = TABLES.iter().find(|table| table.job == job).map(|table| table.page);
        assert!(page.is_some() || !job.starts_with("verification/"), "{job} is on no page");
        page.map_or_else(|| format!("`{job}`"), |page| format!("[{job}]({page}.md)"))
    };
    for (job, wanted) in jobs.into_iter().map(|job| (job, None)).chain(elsewhere) {
        let mut expected = expected(&job);
        expected.retain(|(name, _)| match wanted {
            Some(wanted) => wanted.contains(&name.as_str()),
            None => name != "max_energy_imbalance",
        });
        let names: Vec<&str> = expected.iter().map(|(name, _)| name.as_str()).collect();
        assert!(
            wanted.is_none_or(|wanted| wanted.len() == names.len()),
            "{job} does not check all of {wanted:?}"
        );
        let output = tempfile::tempdir().expect("folder");
        let (values, _) = found(&job, &with("", &[]), &names, output.path());
        for ((name, expected), value) in expected.iter().zip(values) {
            let accepted = expected.relative.or(expected.absolute).unwrap_or(f64::NAN);
            let error = error(value, expected.value);
            let [uncertainty, ratio] = uncertainty(&job, name, error);
            let (reference, found) = (number(expected.value), number(value));
            let (error, accepted) = (short(error), short(accepted));
            text += &format!(
                "| {} | `{name}` | {reference} | {uncertainty} | {found} | {error} | {ratio} | {accepted} |\n",
                link(&job)
            );
        }
    }
    text
}

/// The tables of a study whose headings or rows contain this word.
fn study(name: &str, word: &str) -> String {
    let output = tempfile::tempdir().expect("folder");
    let study = Command::new(env!("CARGO_BIN_EXE_solver"))
        .arg("study")
        .arg(folder("jobs/studies").join(name).with_extension("toml"))
        .args(["--set", &format!("output.folder={:?}", output.path())])
        .status()
        .expect("started");
    assert!(study.success(), "{name}: {study}");
    let document = fs::read_to_string(output.path().join("study.md")).expect("its tables");
    let parts = document.split("\n## ").skip(1).filter(|part| part.contains(word));
    // Digits per second depend on the load of the machine.
    let line = |line: &str| match line.rsplit_once(" | ") {
        Some((numbers, _)) if line.starts_with('|') => format!("{numbers} |"),
        _ => line.to_owned(),
    };
    let parts = parts.map(|part| part.trim().lines().map(line).collect::<Vec<_>>().join("\n"));
    let parts: Vec<String> = parts.collect();
    assert!(!parts.is_empty(), "{name} has no table with {word}");
    format!("### {}", parts.join("\n\n### "))
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let writes = words.iter().any(|word| word == "--write");
    let pages: Vec<&String> = words.iter().filter(|word| !word.starts_with("--")).collect();
    let wanted = |page: &str| pages.is_empty() || pages.iter().any(|name| page == name.as_str());
    let put = |page: &str, name: &str, body: &str| {
        println!("{page}: {name}\n\n{body}\n");
        if writes {
            table::write(&format!("{PAGES}/{page}.md"), name, COMMAND, None, body);
        }
    };
    for table in TABLES.iter().filter(|table| wanted(table.page)) {
        let (text, errors) = rows(table, writes);
        put(table.page, table.name, &text);
        let drawn = (table.columns == Columns::Meshes).then(|| chart(&errors)).flatten();
        if let (true, Some(svg)) = (writes, drawn) {
            fs::write(picture(table, "errors"), svg).expect("written");
        }
    }
    for (page, name, word) in STUDIES {
        if wanted(page) {
            put(page, "errors", &study(name, word));
        }
    }
    if wanted("overview") {
        put("overview", "cases", &overview());
    }
}
