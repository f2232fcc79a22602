# Detent. On a fresh machine with Python 3.11 or later, make and git:
#   make run       the main job: the drilling cell of the GS-C200 datasheet, run and drawn
#   make test      every check that a change must pass (a few minutes)
#   make test-all  the slow tests too
#   make bench     the benchmarks, each with its baseline measured in the same run
#   make fuzz      units, cells and everything that reads under 10^7 generated frames, an hour at most
#   make chaos     kills, failing calls, power failures, full disks, stopped processes, bad lines
#   make soak      a day of virtual time, twice, and an hour of real time, under noise
#   make pythons   other versions of Python that are here, to be tested for equal recordings

SHELL := /bin/bash
UV := $(shell command -v uv || echo .uv/bin/uv)
PYTHON := .venv/bin/python
STAMP := .venv/.installed
SYSTEM_PACKAGES := sigrok-cli chromium npm zsh fish
AXE := axe-core@4.14.1
TSC := typescript@5.9.3

# Compiled test files are kept between runs, also where the environment says that Python shall write none.
PYTEST := PYTHONDONTWRITEBYTECODE= $(PYTHON) -m pytest
# On two processors four workers have something to do where those with a browser or a line in real time wait.
WORKERS := -n 4 --dist loadgroup -rs

.PHONY: setup system axe tsc run test test-all check types collected bench fuzz chaos soak pythons lock docs clean

setup: $(STAMP)

run: $(STAMP)
	@.venv/bin/detent demo

test: system axe tsc pythons
	@$(MAKE) --no-print-directory -j 2 check collected
	$(PYTEST) $(WORKERS)

test-all: system axe tsc pythons
	@$(MAKE) --no-print-directory -j 2 check collected
	$(PYTEST) $(WORKERS) -m "slow or not slow"

check: types $(STAMP)
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/lint-imports

types: $(STAMP)
	.venv/bin/mypy

# Beside the checks the test files are compiled once; each worker would compile all of them for itself.
collected: $(STAMP)
	@$(PYTEST) --collect-only -qq > /dev/null

bench: $(STAMP)
	$(PYTHON) -m bench

# Their short forms are among the slow tests.
fuzz chaos soak: $(STAMP)
	$(PYTHON) -m tests.proofs $@

# What a cell needs to run, in the versions of the lock, for every other Python that is installed. Those of pyenv are
# named to uv: the shims that pyenv has on the path refuse a version that is not chosen.
pythons: $(STAMP)
	@PATH="$$(printf '%s:' "$${PYENV_ROOT:-$$HOME/.pyenv}"/versions/*/bin)$$PATH"; for version in 3.12 3.13; do \
	    $(UV) python find --quiet $$version > /dev/null 2>&1 || { echo "no Python $$version here"; continue; }; \
	    $(UV) venv --quiet --allow-existing --python $$version .venv/python$$version \
	        && $(UV) pip install --quiet --python .venv/python$$version --constraint requirements.lock pydantic numpy \
	        && echo "Python $$version is ready" || echo "could not make Python $$version ready: its tests are skipped"; \
	done

# What the reference pages take from the tables, and the pages as a site.
docs: $(STAMP)
	$(PYTHON) docs/generate.py
	$(PYTHON) -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "The documentation is in docs/_build/html/index.html"

lock: $(UV)
	$(UV) pip compile --universal --generate-hashes --all-extras --python-version 3.11 --no-header --quiet \
	    pyproject.toml -o requirements.lock

$(STAMP): requirements.lock pyproject.toml | $(UV)
	@echo "Setting up .venv ..."
	@$(UV) venv --quiet --allow-existing --python '>=3.11' .venv
	@$(UV) pip sync --quiet --compile-bytecode --python $(PYTHON) --require-hashes requirements.lock
	@$(UV) pip install --quiet --python $(PYTHON) --no-deps --no-build-isolation --editable .
	@$(PYTHON) -m compileall -q src  # some machines never write it by themselves, and then every start is slow
	@touch $(STAMP)

.uv/bin/uv:
	@echo "Fetching uv ..."
	@python3 -m venv .uv
	@.uv/bin/pip install --quiet --disable-pip-version-check uv

# Programs that some tests use as a witness; a test that misses its program says so and is skipped.
system:
	@for package in $(SYSTEM_PACKAGES); do \
	    command -v $$package > /dev/null && continue; \
	    if [ "$$(id -u)" = 0 ] && command -v apt-get > /dev/null; then \
	        echo "Installing $$package ..."; \
	        { apt-get install -qq -y $$package || { apt-get update -qq && apt-get install -qq -y $$package; }; } \
	            > /dev/null 2>&1 || echo "could not install $$package: its tests are skipped"; \
	    else \
	        echo "$$package is not installed: its tests are skipped"; \
	    fi; \
	done

# What looks at the pages of the workbench for everybody who cannot see them, or not well.
axe: $(STAMP)
	@[ -f .venv/axe/node_modules/axe-core/axe.min.js ] || { echo "Fetching $(AXE) ..."; \
	    mkdir -p .venv/axe && npm install --silent --no-save --no-audit --no-fund --prefix .venv/axe $(AXE) > /dev/null 2>&1; } \
	    || echo "could not fetch $(AXE) with npm: its tests are skipped"

# What looks at the types of the scripts of the workbench.
tsc: $(STAMP)
	@[ -x .venv/tsc/node_modules/.bin/tsc ] || { echo "Fetching $(TSC) ..."; \
	    mkdir -p .venv/tsc && npm install --silent --no-save --no-audit --no-fund --prefix .venv/tsc $(TSC) > /dev/null 2>&1; } \
	    || echo "could not fetch $(TSC) with npm: its tests are skipped"

clean:
	rm -rf .venv .uv detent-demo .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
