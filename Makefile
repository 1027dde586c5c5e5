# Tandem: set-up, run, checks. `make help` lists the targets.
#
# Set-up lives in .venv and is redone only where its inputs changed (stamp files in .venv).
# torch comes first and apart: on Linux x86-64 an ordinary index answers "torch" with several
# GB of CUDA packages, so its CPU build is installed before anything that asks for torch, and
# the lock files leave it out. The order of places: what pip is configured for (a folder of
# wheels, an index of your own), then PyTorch's CPU index, then the default index.

SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c

PYTHON ?= $(shell for p in python3.11 python3.12 python3; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null \
	&& echo $$p && break; done)
TORCH ?= 2.13.0
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu

VENV := .venv
PY := $(VENV)/bin/python
INSTALL := $(PY) tools/install.py
# Exact versions with the hashes of every file of each, for all platforms and Pythons; what
# torch's CUDA build asks for stays out together with torch.
RESOLVE = $(VENV)/bin/uv pip compile --quiet --no-config --universal --python-version 3.11 \
	--fork-strategy fewest --generate-hashes --no-annotate --custom-compile-command "make lock" \
	$(addprefix --no-emit-package ,torch $(CUDA_PACKAGES)) $(UPGRADE)
CUDA_PACKAGES := triton cuda-bindings cuda-pathfinder cuda-toolkit \
	$(addprefix nvidia-,cublas cuda-cupti cuda-nvrtc cuda-runtime cudnn-cu13 cufft cufile curand cusolver cusparse cusparselt-cu13 nccl-cu13 nvjitlink nvshmem-cu13 nvtx)

# Test files side by side, at most four: each process holds torch and the kernels. One more than
# cores, because tests of jobs wait for other processes. Files of a folder follow each other and
# share its fixtures.
SIDE_BY_SIDE = --numprocesses $$((1 + $$(getconf _NPROCESSORS_ONLN))) --maxprocesses 4 \
	--dist loadfile --no-loadscope-reorder

# $(call INSTALL_LOCK,file): installs exactly what the file lists, with progress on a terminal.
INSTALL_LOCK = $(INSTALL) $$(test -t 2 || echo --quiet) --require-hashes --no-deps -r $(1)

SAY := @printf '==> %s\n'

export PYTHONUNBUFFERED = 1

.PHONY: help run setup test test-ci test-browser test-postgres test-ray test-slow check format bench tables world docs client lock clean

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' Makefile | sed -E 's/:.*## /\t/' | expand -t 16

run: $(VENV)/setup.stamp ## set up what is missing, start the server, print its address
	@$(PY) -m app serve

setup: $(VENV)/setup.stamp ## set up without starting

test: $(VENV)/dev.stamp $(VENV)/setup.stamp ## the default tests: no network, no browser, no long training
	@$(PY) -m pytest $(SIDE_BY_SIDE) --durations 15

test-ci: $(VENV)/dev.stamp $(VENV)/setup.stamp ## tests of test, test-postgres and test-ray in one run
	@$(PY) -m pytest -m 'not slow and not bench and not browser' $(SIDE_BY_SIDE) --durations 15

test-browser: $(VENV)/dev.stamp $(VENV)/setup.stamp ## the page in a real Chromium
	@$(PY) -m pytest tests/browser -m browser --numprocesses 3 --dist loadfile --no-loadscope-reorder --durations 15

test-postgres: $(VENV)/dev.stamp ## store and supervisor on a PostgreSQL server of the tests
	@$(PY) -m pytest -m 'postgres and not slow' $(SIDE_BY_SIDE) tests/store tests/jobs

test-ray: $(VENV)/dev.stamp $(VENV)/setup.stamp ## jobs on a Ray cluster of two nodes on this machine
	@$(PY) -m pytest -m ray tests/jobs

test-slow: $(VENV)/dev.stamp ## tests that train
	@$(PY) -m pytest -m slow

check: $(VENV)/dev.stamp ## format, lint, types, layers
	@$(PY) -m ruff format --check .
	@$(PY) -m ruff check .
	@$(PY) -m mypy
	@PYTHONPATH=. $(VENV)/bin/lint-imports

format: $(VENV)/dev.stamp ## format the sources as `check` requires
	@$(PY) -m ruff format .
	@$(PY) -m ruff check --fix .

bench: $(VENV)/dev.stamp ## every benchmark, as tables
	@for f in tests/benchmarks/bench_*.py; do \
		name=$$(basename $$f .py | sed 's/^bench_//; s/_/-/g'); $(PY) -m app bench $$name || exit 1; done

docs: $(VENV)/dev.stamp ## build the site of the documents in build/site, strictly
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --quiet --config-file tools/docs/mkdocs.yml

tables: $(VENV)/dev.stamp ## write the tables, figures and report of the documents from docs/results
	@$(PY) -m tools.docs.tables
	@$(PY) -m tools.docs.world.page --page
	@$(PY) -m tools.docs.pick_plots
	@$(PY) -m tools.docs.reach.plots
	@$(PY) -m tools.docs.reach.ssm_plots
	@$(PY) -m tools.docs.sorting.plots
	@$(PY) -m tools.docs.recipe_plots
	@$(PY) -m app report --quick

world: $(VENV)/dev.stamp ## measure, draw and write docs/world.md
	@$(PY) -m tools.docs.world.page

client: $(VENV)/dev.stamp ## write app/client/operations/ from the OpenAPI document
	@$(PY) -m tools.generate_client

lock: $(VENV)/created.stamp ## resolve the lock files (UPGRADE=--upgrade: newest versions)
	@$(INSTALL) --quiet --require-hashes --no-deps -r requirements-setup.lock
	@$(RESOLVE) --group setup -o requirements-setup.lock
	@$(RESOLVE) pyproject.toml --extra postgres -o requirements.lock
	@$(RESOLVE) pyproject.toml --extra postgres --extra ray --extra dev --extra docs --extra onnx --extra otel -c requirements.lock -o requirements-dev.lock

clean: ## remove the virtual environment and the caches
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

$(VENV)/created.stamp:
	@test -n "$(PYTHON)" || { echo "Tandem needs Python 3.11 or 3.12 with venv; none found. Debian, Ubuntu: apt-get install python3-venv; or name one: make PYTHON=/path/to/python3"; exit 1; }
	$(SAY) "virtual environment in $(VENV) ($$($(PYTHON) --version))"
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/torch.stamp: $(VENV)/created.stamp
	$(SAY) "PyTorch $(TORCH): its CPU build (about 200 MB), where one is to be had"
	@$(INSTALL) --quiet --only-binary torch "torch==$(TORCH)+cpu" 2>/dev/null \
		|| { test -n "$(TORCH_INDEX)" && UV_HTTP_TIMEOUT=15 PIP_TIMEOUT=15 PIP_RETRIES=1 $(INSTALL) --quiet --index-url $(TORCH_INDEX) "torch==$(TORCH)" 2>/dev/null; } \
		|| { echo "    no CPU build found: the default index it is (on Linux several GB of CUDA packages)"; \
			$(INSTALL) --quiet "torch==$(TORCH)"; }
	@$(PY) -W ignore -c 'import torch; print("    torch", torch.__version__, "(CUDA build)" if torch.version.cuda else "(CPU build)")'
	@touch $@

$(VENV)/runtime.stamp: $(VENV)/torch.stamp requirements.lock
	$(SAY) "what the service needs, from requirements.lock (about 500 MB)"
	@$(call INSTALL_LOCK,requirements.lock)
	@touch $@

$(VENV)/dev.stamp: $(VENV)/runtime.stamp requirements-dev.lock
	$(SAY) "what tests and checks need, from requirements-dev.lock"
	@$(call INSTALL_LOCK,requirements-dev.lock)
	@$(PY) -m pip check
	@touch $@

# The server does this too, at every start; done here, it starts in seconds.
$(VENV)/setup.stamp: $(VENV)/runtime.stamp $(wildcard app/sim/*/kernels/*.py app/sim/*/*/kernels/*.py app/sim/core/*.py app/sim/geometry/*.py app/policies/*/*.py app/store/migrations/versions/*.py)
	$(SAY) "database and compiled kernels"
	@$(PY) -m app setup
	@touch $@
