# The service as an image: same lock as a checkout, CPU build of torch, kernels compiled.
#
#   docker build -t tandem .
#   export TANDEM_TOKEN="$(openssl rand -hex 16)"; echo "$TANDEM_TOKEN"  # the page asks for it
#   docker run --read-only --tmpfs /tmp --stop-timeout 45 -p 127.0.0.1:8000:8000 \
#       -e TANDEM_TOKEN -v tandem:/data tandem
#
# Inside a container the server must listen on all addresses to be reached, and there it
# refuses to start without TANDEM_TOKEN. Database, checkpoints and compiled kernels live in
# the volume /data.

ARG PYTHON=3.12
FROM python:${PYTHON}-slim AS build
ARG PYTHON
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends make \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /srv/tandem
COPY Makefile requirements.lock requirements-setup.lock ./
COPY tools/install.py tools/
ARG TORCH_INDEX=https://download.pytorch.org/whl/cpu
# Bytecode of all packages: a container cannot write it. uv (37 MB) has done its work.
RUN UV_COMPILE_BYTECODE=1 make .venv/runtime.stamp PYTHON=python${PYTHON} TORCH_INDEX=$TORCH_INDEX \
    && .venv/bin/python -m pip uninstall --quiet --yes uv

FROM python:${PYTHON}-slim
# Pinocchio is linked against GNU OpenMP, which slim images do not have.
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends libgomp1 \
    && rm -rf /var/lib/apt/lists/*
RUN useradd --uid 10001 --no-create-home --home-dir /data --shell /usr/sbin/nologin tandem \
    && install -d -o tandem -g tandem /data
WORKDIR /srv/tandem
COPY --from=build /srv/tandem/.venv .venv
COPY . .
ENV PATH=/srv/tandem/.venv/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    TANDEM_HOST=0.0.0.0 \
    TANDEM_PORT=8000 \
    TANDEM_DATA=/data
USER tandem
# Fills /data, and with it every new volume, with the empty database and the kernels.
RUN python -m app setup
VOLUME /data
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s --retries=3 \
    CMD python -c "import os, urllib.request as u; u.urlopen(f'http://127.0.0.1:{os.environ[\"TANDEM_PORT\"]}/healthz', timeout=2)"
CMD ["python", "-m", "app", "serve"]
