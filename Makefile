# Everything is built into .venv; nothing outside this folder is touched.
# A first `make demo` or `make test` sets the environment up; later ones redo only what changed.

PYTHON ?= python3

VENV := .venv
BIN := $(VENV)/bin
NATIVE := python/twinloop/_core.abi3.so
RUST_SOURCES := Cargo.toml $(wildcard Cargo.lock rust-toolchain.toml .cargo/config.toml) \
    $(shell find crates -name '*.rs' -o -name Cargo.toml)

# One interpreter for make, maturin, PyO3 and the tests, whatever environment the caller has activated.
export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python
unexport CONDA_PREFIX PYTHONHOME PYTHONPATH
# Tests and examples start hundreds of processes; each would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE
export PIP_QUIET := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1

# The build backend is the one that pyproject.toml asks for.
MATURIN := $(shell sed -n 's/^requires = \["\(maturin.*\)"\]/\1/p' pyproject.toml)
MATURIN_DEVELOP := $(BIN)/maturin develop --release

# Benchmarks need no annotations; that they call what is there is checked all the same.
UNANNOTATED := --allow-untyped-defs --allow-incomplete-defs --allow-untyped-calls --allow-any-generics --no-warn-return-any

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL: # stages share one environment; cargo uses every core by itself
.PHONY: help demo test check bench docs build wheel format clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/make \1|\2/p' Makefile | awk -F'|' '{ printf "%-12s  %s\n", $$1, $$2 }'

demo: $(NATIVE) ## identify the built-in quadrotor from four flights
	$(BIN)/twinloop run quadrotor --experiments 4 --noise 0.001 --seed 0

test: $(VENV)/.installed-test $(VENV)/.installed-others $(NATIVE) ## all tests, and the benchmarks in smoke mode
	cargo test --package twinloop-core
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist worksteal
	$(BIN)/python benchmarks/speed.py --smoke
	$(BIN)/python benchmarks/long_campaign.py --smoke
	$(BIN)/python benchmarks/report.py --smoke
	$(BIN)/python benchmarks/laws.py --smoke
	$(BIN)/twinloop bench --smoke
	$(BIN)/twinloop bench zoo --smoke --plants heater --ablation backtracking

check: $(VENV)/.installed-check $(NATIVE) ## formatting, lints, types, layers
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mypy $(UNANNOTATED) benchmarks
	$(BIN)/lint-imports
	$(BIN)/python -m mypy.stubtest --mypy-config-file pyproject.toml twinloop._core

bench: $(VENV)/.installed-bench $(NATIVE) ## speed beside the packages we compare with
	$(BIN)/python benchmarks/speed.py

docs: $(VENV)/.installed-docs ## the documentation, into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

build: $(NATIVE) ## the environment and the native module

# A linker from a package, so that the wheel runs on Linux systems older than the one that builds it.
wheel: $(VENV)/.created ## a wheel that needs no Rust, into dist/, tried in an environment of its own
	$(BIN)/python -m pip install 'ziglang>=0.13'
	rm -rf dist
	PATH="$(CURDIR)/$(BIN):$$PATH" maturin build --release --zig --compatibility manylinux_2_17 --out dist
	sh scripts/try_wheel.sh $(PYTHON) dist/*.whl

format: $(VENV)/.installed-check ## rewrite the code in the house format
	cargo fmt --all
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean: ## remove the environment and all that was built
	rm -rf $(VENV) target site dist python/twinloop/_core*.so .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find python tests benchmarks examples -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

$(VENV)/.created: | scripts/preflight.sh
	@sh scripts/preflight.sh $(PYTHON)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install '$(MATURIN)'
	@echo '$(CURDIR)/studies' > "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/twinloop_studies.pth"
	@touch $@

$(NATIVE): $(VENV)/.created pyproject.toml $(RUST_SOURCES)
	@sh scripts/preflight.sh $(BIN)/python
	$(MATURIN_DEVELOP)
	@touch $@

# The extras of pyproject.toml, on top of the package itself: cargo finds nothing to do here.
# What we are compared with. Where a package has no build for a machine, its tests skip and say so.
# RotorPy names a dependency of another licence, which the vehicles do not import.
$(VENV)/.installed-others: $(VENV)/.installed-test
	-$(MATURIN_DEVELOP) --extras exam
	-$(BIN)/python -m pip install --no-deps "rotorpy>=3,<4"
	@touch $@

$(VENV)/.installed-%: $(VENV)/.created pyproject.toml | $(NATIVE)
	$(MATURIN_DEVELOP) --extras $*
	@touch $@
