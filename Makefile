# Everything sets itself up: python3 and a package index are all that is needed.
PYTHON ?= python3
BIN := .venv/bin
SHELL := /bin/sh
# What is compiled is kept, whatever the environment says: the tests start some hundred programs.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help explore test check static quick bench bench-explore reliability figures keep fuzz docs site pages clean

help:
	@echo "make explore   a simulated robot maps the built-in office; prints where the map is"
	@echo "make test      the whole test suite"
	@echo "make check     format, lint, types, import rules, tests"
	@echo "make quick     the tests that take under a second each"
	@echo "make bench     time the inner loops and the drivers, targets beside: docs/benchmarks.md"
	@echo "make figures   repeat the paper's experiments: docs/figures.md"
	@echo "make keep RESULTS=FILE   quote a table of explorations in README and docs"
	@echo "make reliability   a thousand robots with faults from every layer, and what must not happen to them"
	@echo "make docs      this documentation as a site in site/; make pages renews its generated pages"
	@echo "make fuzz      throw mutated bytes at the parsers for a minute each"

explore: .venv/core
	@$(BIN)/gvgbot explore $(ARGS)

# A file's tests stay together, since they share what is slow to make. Those of whole processes wait a lot: one worker
# more than there are cores. The files are taken as they are listed, so that the last ones are short.
test: .venv/dev
	@$(BIN)/pytest --numprocesses $$(($$(getconf _NPROCESSORS_ONLN) + 1)) --dist loadfile --no-loadscope-reorder $(ARGS)

quick: .venv/dev
	@$(BIN)/pytest -m "not slow and not hardware and not bench" $(ARGS)

static: .venv/dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check: static test

bench: .venv/dev
	@OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.run_benches $(ARGS)
	@$(BIN)/python -m docs.make_benchmarks

figures: .venv/docs
	@OMP_NUM_THREADS=1 $(BIN)/python -m benchmarks.figures $(ARGS)
	@$(BIN)/python -m docs.make_figures

SEEDS ?= 1000
reliability: .venv/dev
	@nice -n 10 $(BIN)/python -m benchmarks.reliability --seeds $(SEEDS) $(ARGS)

PLANS ?= 100
bench-explore: .venv/dev
	@nice -n 10 $(BIN)/python -m benchmarks.explore_table --plans $(PLANS) --lasers UTM-30LX URG-04LX $(ARGS)

keep: .venv/dev
	@$(BIN)/python -m benchmarks.keep_results $(RESULTS)
	@$(BIN)/python -m docs.make_tables
	@$(BIN)/python -m docs.make_benchmarks

FUZZ_SECONDS ?= 60
fuzz: .venv/fuzz
	@for file in tests/fuzz/fuzz_*.py; do \
		$(BIN)/python -m "tests.fuzz.$$(basename "$$file" .py)" -max_total_time=$(FUZZ_SECONDS) -rss_limit_mb=1024 -timeout=10 || exit 1; done

docs: .venv/docs
	@$(BIN)/pytest -q tests/unit/test_reference_pages.py tests/unit/test_quotes.py
	@$(MAKE) --no-print-directory site

site: .venv/docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "site: site/index.html"

pages: .venv/dev
	@for page in docs/make_*.py; do $(BIN)/python -m "docs.$$(basename "$$page" .py)" || exit 1; done

clean:
	rm -rf .venv site .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

# The stamps: what is installed for running, and for developing. A changed pyproject.toml renews them. For developing, what is
# never imported need not be compiled: that is a third of the time.
.venv/core: pyproject.toml
	@$(call make_venv)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[tui,web,record]'
	@touch $@

.venv/dev: pyproject.toml
	@$(call make_venv)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[dev]'
	@touch .venv/core $@

.venv/fuzz: .venv/dev
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[fuzz]'
	@touch $@

.venv/docs: .venv/dev
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[docs]'
	@touch $@

define make_venv
command -v $(PYTHON) >/dev/null || { \
	echo "gvgbot needs Python 3.11 or newer, and there is no $(PYTHON): install it, or make PYTHON=/path/to/python" >&2; exit 1; }; \
$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("gvgbot needs Python 3.11 or newer, and $(PYTHON) is %d.%d: install one, or make PYTHON=/path/to/python" % sys.version_info[:2])' || exit 1; \
$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	echo "$(PYTHON) cannot make virtual environments: install its venv module (Debian: apt install python3-venv)" >&2; exit 1; }; \
echo "setting up .venv (once)"; \
$(BIN)/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || $(PYTHON) -m venv --clear .venv
endef
