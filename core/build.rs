//! Finds the system's PETSc through pkg-config, with the CHOLMOD and the BLAS that it uses, and generates the raw bindings of what `src/linear_algebra/petsc` and `src/linear_algebra/sparse` call.

use bindgen::callbacks::{IntKind, ParseCallbacks};
use std::{
    env,
    path::{Path, PathBuf},
};

/// Everything the safe layer calls, and nothing else: the generated file stays small.
const FUNCTIONS: &[&str] = &[
    "Petsc(InitializeNoPointers|Finalize|PushErrorHandler|ErrorMessage|GetVersionNumber)",
    "PetscOptions(SetValue|HasName|ClearValue)",
    "PetscLog(DefaultBegin|StageGetId|StageRegister|StagePush|StagePop)",
    "Vec(CreateGhostBlock|Duplicate|GetLocalSize|GetArray|RestoreArray|GetArrayRead|RestoreArrayRead)",
    "VecGhost(GetLocalForm|RestoreLocalForm|UpdateBegin|UpdateEnd)",
    "Vec(Copy|Scale|Set|AXPY|Norm|Dot|CreateSeq)",
    "VecScatter(Create|Begin|End)",
    "ISCreateGeneral",
    "VecCreateMPIWithArray",
    "Mat(Create|SetSizes|SetBlockSize|SetType|SetOption|Mult|GetInfo|SetNearNullSpace|SetNullSpace)",
    "Mat(Norm|Duplicate|Copy|GetRow|RestoreRow|SetValues|AssemblyBegin|AssemblyEnd|GetOwnershipRange)",
    "(VecEqual|PetscObject(Reference|Destroy|TypeCompare))",
    "Mat(GetBlockSize|GetBlockSizes|SetBlockSizes|GetLocalSize|GetRowIJ|RestoreRowIJ|MPIAIJGetSeqAIJ|SeqAIJGetArrayRead|SeqAIJRestoreArrayRead)",
    "PCMG(SetLevels|GetCoarseSolve|GetLevels|(Get|Set)Interpolation|SetRestriction|GetSmoother|SetResidual|ResidualDefault)",
    "Mat(PtAP|GetSize|GetDiagonal)",
    "Mat(MPIAIJ|SeqAIJ)SetPreallocationCSR",
    "Mat(CreateShell|ShellSetContext|ShellGetContext|ShellSetOperation)",
    "MatNullSpace(Create|CreateRigidBody|SetFunction)",
    "KSP(Create|SetOperators|GetOperators|SetType|SetTolerances|SetNormType|GetPC|SetFromOptions|SetUp|Solve)",
    "KSP(GetConvergedReason|GetIterationNumber|GetResidualNorm|SetInitialGuessNonzero)",
    "KSP(SetOptionsPrefix|GetType|SetPC|ConvergedDefaultSetUIRNorm|GetTolerances)",
    "PCShell(SetApply|SetContext|GetContext)",
    "PC(Apply|GetOperators|SetType|SetUseAmat|GetType|FactorSetMatSolverType|FactorGetMatrix)",
    "SNES(Create|SetType|SetFunction|SetJacobian|SetTolerances|GetKSP|GetLineSearch|SetFromOptions)",
    "SNES(Solve|GetConvergedReason|GetIterationNumber|GetFunctionNorm|SetOptionsPrefix)",
    "SNESLineSearchSetType",
    "SNESVISetVariableBounds",
    "SNESSetDivergenceTolerance",
    "Mat(CreateSeqDense|CholeskyFactor|LUFactor|MatTransposeMult|Solve|CreateVecs)",
    "MatDense(Get|Restore)Array(Read)?",
    "(madvise|dlsym)",
    "cholmod_(l_)?(start|finish|amd|metis|analyze_p|free_factor)",
    "(cblas_[sd](gemm|syrk|trsm)|[sd]potrf_)",
];

/// What a build of PETSc may have or not, by its macro, and the cfg that says so.
const PARTS: [(&str, &str); 3] = [
    ("PETSC_USE_64BIT_INDICES", "petsc_64bit"),
    ("PETSC_HAVE_HYPRE", "petsc_hypre"),
    ("PETSC_HAVE_MUMPS", "petsc_mumps"),
];

/// Gives macros that stand for counts the type of counts.
#[derive(Debug)]
struct Counts;

impl ParseCallbacks for Counts {
    fn int_macro(&self, name: &str, _value: i64) -> Option<IntKind> {
        (name == "PETSC_DETERMINE").then_some(IntKind::Custom { name: "PetscInt", is_signed: true })
    }
}

fn main() {
    println!("cargo::rerun-if-changed=src/linear_algebra/petsc/wrapper.h");
    println!("cargo::rerun-if-changed=build.rs");
    for name in ["PETSC_DIR", "PETSC_ARCH", "PKG_CONFIG_PATH"] {
        println!("cargo::rerun-if-env-changed={name}");
    }

    let petsc = find_petsc();
    check_configuration(&petsc.include_paths);
    for library in ["cholmod", "lapack", "blas"] {
        println!("cargo::rustc-link-lib={library}");
    }
    let mpi = build_probe_mpi::probe()
        .unwrap_or_else(|e| panic!("no MPI found (Debian: apt-get install libopenmpi-dev): {e:?}"));
    let includes = petsc.include_paths.iter().chain(&mpi.include_paths);
    bindgen::builder()
        .header("src/linear_algebra/petsc/wrapper.h")
        .parse_callbacks(Box::new(Counts))
        .clang_args(includes.map(|d| format!("-I{}", d.display())))
        .rust_edition(bindgen::RustEdition::Edition2024)
        .default_enum_style(bindgen::EnumVariation::Consts)
        .prepend_enum_name(false)
        .generate_cstr(true)
        .allowlist_function(format!("({})", FUNCTIONS.join("|")))
        .allowlist_type("(PetscInt|PetscErrorType|MatOperation|MatOption|InsertMode|ScatterMode|NormType|MatInfo.*|MatDuplicateOption|MatStructure|PetscBool)")
        .allowlist_var("(PETSC_(COMM_WORLD|COPY_VALUES|DETERMINE|DEFAULT|ERR_USER|ERROR_INITIAL)|MAT_.*|MATOP_.*|INSERT_VALUES|ADD_VALUES|SCATTER_.*|NORM_.*|CHOLMOD_.*|KSP_NORM_.*|SAME_NONZERO_PATTERN|MADV_HUGEPAGE|Cblas.*)")
        .blocklist_type("(MPI_.*|ompi_.*|_IO_.*|FILE)")
        .raw_line("pub use mpi_sys::{MPI_Comm, RSMPI_COMM_SELF};")
        .layout_tests(false)
        .generate_comments(false)
        .generate()
        .expect("bindgen reads PETSc's headers")
        .write_to_file(Path::new(&env::var("OUT_DIR").expect("cargo sets OUT_DIR")).join("petsc.rs"))
        .expect("the bindings are written to OUT_DIR");
}

/// An explicit `PETSC_DIR[/PETSC_ARCH]` wins over the system's own `PETSc.pc`.
fn find_petsc() -> pkg_config::Library {
    if let Some(dir) = env::var_os("PETSC_DIR") {
        let dir = PathBuf::from(dir).join(env::var_os("PETSC_ARCH").unwrap_or_default());
        let searched = env::var("PKG_CONFIG_PATH").unwrap_or_default();
        let path = format!("{}:{searched}", dir.join("lib/pkgconfig").display());
        // SAFETY: the build script has one thread.
        #[allow(unsafe_code)]
        unsafe {
            env::set_var("PKG_CONFIG_PATH", path)
        };
    }
    let probe = |name| pkg_config::Config::new().atleast_version("3.18").probe(name);
    probe("PETSc").or_else(|_| probe("petsc")).unwrap_or_else(|e| {
        panic!("PETSc 3.18 or newer not found (run scripts/install-deps.sh, or set PETSC_DIR): {e}")
    })
}

/// Refuses a PETSc that can't be used and tells the crate what the others have.
fn check_configuration(include_paths: &[PathBuf]) {
    let file = include_paths
        .iter()
        .map(|d| d.join("petscconf.h"))
        .find(|p| p.is_file())
        .expect("petscconf.h stands beside petsc.h");
    let text = std::fs::read_to_string(&file).expect("petscconf.h is readable");
    let has = |name: &str| text.lines().any(|l| l.starts_with(&format!("#define {name} ")));
    assert!(
        !has("PETSC_USE_COMPLEX") && has("PETSC_USE_REAL_DOUBLE"),
        "{}: this PETSc is complex or not double precision; a real, double build is needed (Debian: libpetsc-real-dev)",
        file.display()
    );
    for (name, cfg) in PARTS {
        println!("cargo::rustc-check-cfg=cfg({cfg})");
        if has(name) {
            println!("cargo::rustc-cfg={cfg}");
        }
    }
}
