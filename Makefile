# Each target sets up .venv if needed and then does its work. PYTHON=python3.12 names another Python.
PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3.13,$(shell command -v $(name))) python3)
BIN := .venv/bin
LIGHT := .venv-light/bin
TORCH := .venv/.torch
INSTALLED := .venv/.installed
READY := .venv/.ready-to-develop
AUDITOR := .venv-audit/bin/pip-audit
# Torch's builds without CUDA, some 200 MB instead of gigabytes; offline, pip goes on without them.
# What torch needs comes with the rest: that index is asked for one package.
TORCH_INDEX := --no-deps --retries 2 --extra-index-url https://download.pytorch.org/whl/cpu

.PHONY: install demo demo-deepracer docs test suite test-slow test-light check lint types bench audit

install: $(INSTALLED)
	@echo "repaint is in .venv; in each new terminal: . .venv/bin/activate"

$(TORCH): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt $(TORCH_INDEX) torch
	touch $@

$(INSTALLED): $(TORCH)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[mujoco]'
	touch $@

# All of it at once: what users have, and what the checks need.
$(READY): $(TORCH)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[mujoco,sc2,dev,docs]'
	touch $(INSTALLED) $@

demo: $(INSTALLED)
	PATH="$(CURDIR)/$(BIN):$$PATH" sh tools/demo.sh

demo-deepracer: $(INSTALLED)
	PATH="$(CURDIR)/$(BIN):$$PATH" sh tools/demo-deepracer.sh

# The pages in docs/ as a site: open build/docs/index.html.
docs: $(READY)
	$(BIN)/python -m mkdocs build --clean

check: lint types

lint: $(READY)
	$(BIN)/ruff format --check
	$(BIN)/ruff check

types: $(READY)
	$(BIN)/mypy

# mypy has one core and takes most of a minute on a clean clone: it runs beside the tests.
test: lint
	$(MAKE) --no-print-directory --jobs 2 types suite

# On two cores, since half of the tests are processes that are started or killed; their bytecode is
# kept, whatever the environment says, or each would compile all of it anew.
suite: $(READY)
	PYTHONDONTWRITEBYTECODE= $(BIN)/pytest --numprocesses 2 --dist worksteal

test-slow: $(READY)
	$(BIN)/pytest -m slow

# What needs no torch, on another Python: make test-light PYTHON=python3.13
test-light:
	$(PYTHON) -m venv --clear .venv-light
	$(LIGHT)/python tools/without_torch.py | xargs $(LIGHT)/python -m pip install --quiet -c constraints.txt
	$(LIGHT)/python -m pip install --quiet --no-deps -e .
	$(LIGHT)/ruff check
	$(LIGHT)/pytest

# Side-by-side speed measurements, an hour and a half in all; let nothing else run meanwhile.
BENCHMARKS := training_mujoco training_racer training_starcraft startup scaling simulators starcraft pieces records crowded
bench: $(READY)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[bench]'
	for name in $(BENCHMARKS); do $(BIN)/python benchmarks/$$name.py || exit 1; done

# Is all pinned that is installed, and is a known vulnerability among it? Offline it says so.
audit: $(READY)
	test -x $(AUDITOR) || { $(PYTHON) -m venv .venv-audit && \
		.venv-audit/bin/python -m pip install --quiet -c constraints.txt pip-audit; } || true
	$(BIN)/python tools/audit.py $(AUDITOR)
