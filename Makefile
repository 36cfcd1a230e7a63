# Every command here sets up what it needs first. Tests and lint are what CI runs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# The default.
all: setup

# numba's caches do not notice a change in a callee in another file: drop them all when any source has changed.
KERNELS := $(VENV)/.kernels
$(KERNELS): $(STAMP) $(shell find services drivers -name '*.py')
	find services drivers -name '*.nb[ic]' -delete
	touch $(KERNELS)

.PHONY: all setup lock messages demo test test-all lint fuzz bench experiments goldens pictures clean

setup: $(STAMP) $(KERNELS)

$(STAMP): requirements.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "uv==0.13.9"
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip sync --quiet --require-hashes requirements.lock
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --no-deps --no-build-isolation --editable .
	touch $(STAMP)

# Names, versions and hashes only: where packages come from is the machine's own affair.
lock:
	$(BIN)/uv pip compile pyproject.toml --group dev --generate-hashes --no-header --no-annotate --upgrade --quiet -o requirements.lock

messages: setup
	$(BIN)/python -m grpc_tools.protoc -I . --python_out=. --pyi_out=. runtime/messages/*.proto

# Pictures are drawn by Rerun on a software Vulkan; the script installs it where it may, or says what is missing.
demo: setup
	deploy/system-packages
	rm -rf demo && mkdir demo
	$(BIN)/pushlane sim --seed 1 -o demo/session.mcap
	$(BIN)/pushlane replay demo/session.mcap
	$(BIN)/pushlane inspect demo/session.mcap --save demo/session.rrd --screenshot demo/session.png

test: setup
	deploy/system-packages
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow"

test-all: setup
	deploy/system-packages
	$(BIN)/python -m pytest

lint: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# A million inputs to each parser of a base's wire.
fuzz: setup
	$(BIN)/python -m experiments.fuzz

bench: setup
	$(BIN)/python -m experiments.bench

# Hours; goes on where it was stopped. Results in out/experiments.
experiments: setup
	$(BIN)/pushlane experiment all --trials 200 --jobs 2

goldens: setup
	$(BIN)/pushlane goldens --record

pictures: setup
	$(BIN)/python -m experiments.pictures

clean:
	rm -rf $(VENV) demo out .mypy_cache .ruff_cache .pytest_cache .hypothesis
