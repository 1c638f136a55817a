# Clarke in a container.
#
#   docker build -t clarke .
#   docker run --rm clarke --help
#
# Run a job of your own from the current folder; results land beside the job, owned by you:
#
#   docker run --rm -v "$PWD":/work --user "$(id -u):$(id -g)" clarke job.toml
#   docker run --rm -v "$PWD":/work --user "$(id -u):$(id -g)" --entrypoint mpirun clarke -n 2 solver job.toml
#
# The jobs of this repository are in /opt/clarke/jobs; `docker cp` or a volume gets their results out:
#
#   docker run --name paper --entrypoint mpirun clarke -n 2 solver /opt/clarke/jobs/papers/wang_cheng_2022.toml
#   docker cp paper:/opt/clarke/jobs/papers/out .
#
# Ranks on one machine talk through /dev/shm, of which Docker gives 64 MB: add --shm-size=1g from about 8 ranks on.
# `docker stop` ends mpirun with SIGTERM; for a checkpoint first: docker kill --signal=USR1 paper

FROM rust:1-bookworm AS build
WORKDIR /build
COPY Cargo.toml ./
COPY scripts/install-deps.sh scripts/
RUN scripts/install-deps.sh --build
COPY . .
RUN cargo build --release --locked

FROM debian:12-slim
LABEL org.opencontainers.image.title="Clarke" \
      org.opencontainers.image.description="Dynamic contact of viscoplastic bodies, in parallel" \
      org.opencontainers.image.licenses="MIT OR Apache-2.0"
COPY scripts/install-deps.sh /tmp/
RUN /tmp/install-deps.sh --runtime \
    && rm -rf /tmp/install-deps.sh /var/lib/apt/lists/*
RUN useradd --create-home --shell /bin/bash clarke \
    && install -d -o clarke -g clarke /opt/clarke /work
COPY --from=build /build/target/release/solver /usr/local/bin/solver
COPY --chown=clarke:clarke jobs /opt/clarke/jobs
COPY --chown=clarke:clarke meshes /opt/clarke/meshes
COPY --chown=clarke:clarke schema /opt/clarke/schema
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/clarke/
# One thread a rank. Shared-memory copies by plain memcpy: containers may forbid ranks to read each other's memory.
ENV OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1 \
    OMPI_MCA_rmaps_base_oversubscribe=1 \
    OMPI_MCA_btl_vader_single_copy_mechanism=none
USER clarke
WORKDIR /work
ENTRYPOINT ["solver"]
CMD ["--help"]
