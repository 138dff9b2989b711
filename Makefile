# Each target sets up .venv if needed and then does its work.
PYTHON ?= python3.11
BIN := .venv/bin
LIGHT := .venv-light/bin
STAMP := .venv/.installed
AUDITOR := .venv-audit/bin/pip-audit

.PHONY: demo test test-slow test-light check bench audit

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt torch
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[mujoco,dev]'
	touch $(STAMP)

demo: $(STAMP)
	PATH="$(CURDIR)/$(BIN):$$PATH" sh tools/demo.sh

check: $(STAMP)
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

# On two cores, since half of the tests are processes that are started or killed.
test: check
	$(BIN)/pytest --numprocesses 2 --dist worksteal

test-slow: $(STAMP)
	$(BIN)/pytest -m slow

# What needs no torch, on another Python: make test-light PYTHON=python3.13
test-light:
	$(PYTHON) -m venv --clear .venv-light
	$(LIGHT)/python tools/without_torch.py | xargs $(LIGHT)/python -m pip install --quiet -c constraints.txt
	$(LIGHT)/python -m pip install --quiet --no-deps -e .
	$(LIGHT)/ruff check
	$(LIGHT)/pytest

# Side-by-side speed measurements, an hour in all; let nothing else run meanwhile.
BENCHMARKS := training_mujoco training_racer startup scaling simulators pieces records
bench: $(STAMP)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[bench]'
	for name in $(BENCHMARKS); do $(BIN)/python benchmarks/$$name.py || exit 1; done

# Is all pinned that is installed, and is a known vulnerability among it? Offline it says so.
audit: $(STAMP)
	test -x $(AUDITOR) || { $(PYTHON) -m venv .venv-audit && \
		.venv-audit/bin/python -m pip install --quiet -c constraints.txt pip-audit; } || true
	$(BIN)/python tools/audit.py $(AUDITOR)
