PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo studies browser-test test shaped types slow docs bench lint format clean

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

demo: $(STAMP)
	$(BIN)/tissuejax demo --out out/demo

studies: $(STAMP)
	$(BIN)/tissuejax study fits/*

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/basedpyright --pythonpath $(BIN)/python

# A thread a worker: small matrices on two threads each, twice over, wait for one another. A file stays with one
# worker, which compiles what its tests share once. Most of the time is compiling: tests run on code that XLA makes in
# half the time and that runs half as fast, in some folders (tests/conftest.py) with no optimization at all;
# `make test QUICK=` and `make slow` compile as users do.
QUICK ?= --xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=2

# Tests of the lower floors, whose shapes and types are checked while they run (tests/conftest.py).
SHAPED := tests/contracts/test_energies.py tests/contracts/test_energies_orders.py tests/contracts/test_elements.py \
    tests/contracts/test_cohesion.py tests/analytic/test_tensors.py tests/estimation/test_level.py \
    tests/estimation/test_noise.py tests/estimation/test_series.py tests/estimation/test_descent.py \
    tests/contracts/test_recordings_ground.py tests/contracts/test_recordings_hdf5.py \
    tests/contracts/test_recordings_tables.py tests/contracts/test_effects.py tests/analytic/test_delayed.py
# slipcover rewrites a line's counter away once it ran: 4 % more CPU, where coverage.py's tracer (before Python 3.12) took
# 32 %. The longest files come first (tests/conftest.py).
# What one of a run's processes has compiled the others take from a folder, by the content of each program.
PROGRAMS := JAX_COMPILATION_CACHE_DIR=$(abspath out/programs) JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0
PYTEST = OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 XLA_FLAGS="$(QUICK)" $(PROGRAMS) $(BIN)/python -m slipcover --json
WORKERS := -m pytest -n 2 --dist loadfile --no-loadscope-reorder -q

# What takes one core goes beside what takes two.
test: $(STAMP)
	rm -rf out/programs
	mkdir -p out
	mkdir -m 700 out/programs
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target shaped lint types docs
	$(PYTEST) --source tissuejax --out out/suite.coverage.json $(WORKERS) --durations=15 $(SHAPED:%=--ignore=%)
	$(BIN)/python tests/coverage_table.py out/suite.coverage.json out/shaped.coverage.json

shaped: $(STAMP)
	mkdir -p out
	TISSUEJAX_SHAPES=on $(PYTEST) --source tissuejax/energies,tissuejax/elements,tissuejax/cohesion,tissuejax/recordings,tissuejax/estimation,tissuejax/effects \
	    --out out/shaped.coverage.json $(WORKERS) $(SHAPED)

# What it said is kept in tests/slow.json, with date and commit.
slow: $(STAMP)
	mkdir -p out
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile -q -m slow \
	    --junitxml=out/slow.xml; status=$$?; $(BIN)/python tests/slow_record.py out/slow.xml; exit $$status

docs: $(STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --site-dir out/docs

browser-test: $(STAMP)
	command -v chromium > /dev/null || (apt-get update -qq && apt-get install -y -qq chromium)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[browser]'
	$(BIN)/python -m pytest -q -m slow tests/play/test_browser.py

bench: $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	for f in tests/bench/bench_*.py; do $(BIN)/python $$f; done

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) out
