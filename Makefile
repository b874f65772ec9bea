# make run    set up everything and run stages.yaml on the bundled flight
# make test   set up everything and run the tests (the campaigns have their own commands)
# make docs   build the documentation site into site/
# make lint   style, and types
# Needs python3.11 (or newer: PYTHON=python3.12) and make; everything else goes into .venv.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin

# waiting OpenMP threads sleep instead of spinning: on two shared cores that is several times faster
export OMP_WAIT_POLICY := passive
# and BLAS works in one thread: segments already run in parallel
export OPENBLAS_NUM_THREADS := 1

.PHONY: run test docs lint

run: $(VENV)/.stamp-run
	$(BIN)/awes run --stages stages.yaml

test: export OMP_NUM_THREADS := 1
test: $(VENV)/.stamp-test
	$(BIN)/python -m pytest -q -m "not campaign" -n auto --maxprocesses 4 --dist worksteal

docs: $(VENV)/.stamp-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

lint: $(VENV)/.stamp-test
	$(BIN)/ruff check .
	$(BIN)/pyright --pythonpath $(BIN)/python

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

# stamps: set up again only when the dependencies have changed
$(VENV)/.stamp-run: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

$(VENV)/.stamp-test: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $@ $(VENV)/.stamp-run $(VENV)/.stamp-docs

$(VENV)/.stamp-docs: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	touch $@ $(VENV)/.stamp-run
