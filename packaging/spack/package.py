# Clarke for Spack: build a checkout with the libraries of a site.
#
#   spack repo create clarke-repo && mkdir -p clarke-repo/packages/clarke && cp packaging/spack/package.py clarke-repo/packages/clarke
#   spack repo add clarke-repo
#   spack dev-build --source-path PATH_OF_THE_CHECKOUT clarke@main

from spack.package import *


class Clarke(Package):
    """Batch solver for dynamic contact of viscoplastic bodies with nonmonotone contact laws, under MPI, with certificates."""

    license("MIT OR Apache-2.0")
    version("main")

    depends_on("rust@1.89:", type="build")
    depends_on("llvm+clang", type="build")  # libclang, which reads the headers of MPI
    depends_on("pkgconfig", type="build")
    depends_on("mpi")
    depends_on("petsc@3.18: +mpi+double~complex+suite-sparse+mumps")
    depends_on("hdf5@1.10: +mpi")
    depends_on("metis@5:")
    depends_on("suite-sparse")
    depends_on("blas")

    def setup_build_environment(self, env):
        env.set("PETSC_DIR", self.spec["petsc"].prefix)
        env.set("HDF5_DIR", self.spec["hdf5"].prefix)
        env.set("MPICC", self.spec["mpi"].mpicc)
        env.set("CLARKE_GIT_ID", "spack")

    def install(self, spec, prefix):
        which("cargo")("build", "--release", "--locked")
        make("install", "DEPS=no", f"PREFIX={prefix}")

    @run_after("install")
    def check_install(self):
        Executable(self.prefix.bin.solver)("--version")
