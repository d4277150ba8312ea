# Two commands on a machine with Python >= 3.11 and make; each sets everything up in .venv and works alone.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
TESTS := $(VENV)/.ready-test
DOCS := $(VENV)/.ready-docs
RELEASE := $(VENV)/.ready-release

# Python keeps what it compiled, whatever the machine is told: the tests start many processes.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test attack lint compiled pages docs picture bench release-check clean help

help:
	@echo "make demo           the main job on the built-in rig: files and pictures in demo/"
	@echo "make test           format, lint, types and the tests: of long statistics a part, of the examples four"
	@echo "make attack         what make test leaves out of the statistics, the random families and the slowest fits"
	@echo "make docs           every example, guide and reference as pages in build/docs/index.html, and their tests"
	@echo "make pages          the pages alone, without their tests"
	@echo "make picture        the pictures of the README and of the page on servo axes"
	@echo "make bench          every measured figure again, beside the peers that install: about half an hour"
	@echo "make release-check  build wheel and source distribution, look into them, try them in clean environments"
	@echo "make clean          remove what these made"

# What a job needs and no more: the packages, then what tests and documentation want besides.
INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	  || { echo "Python 3.11 or later is needed; choose one by: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) -e ".[full]"
	@touch $@

$(TESTS): $(READY)
	$(INSTALL) -e ".[test,docs]"
	@touch $@ $(DOCS)

$(DOCS): $(READY)
	$(INSTALL) -e ".[docs]"
	@touch $@

demo: $(READY)
	MPLBACKEND=Agg $(BIN)/python examples/01_identify_then_design.py --out demo

lint: $(TESTS)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

# What every process of the tests would compile, the kernels of the rigs and the tests themselves, on the core that the
# checkers leave free.
compiled: $(TESTS)
	@$(BIN)/python -m tests.support.compiled
	@$(BIN)/python -m pytest --collect-only -qq > /dev/null

# Two processes on two cores: threads of the linear algebra would only wait for one another.
test: $(TESTS)
	@$(MAKE) --no-print-directory -j 2 lint compiled
	MPLBACKEND=Agg OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

# The cases that `make test` leaves out, with the same tests: before a release.
attack: $(TESTS)
	MPLBACKEND=Agg OMP_NUM_THREADS=1 $(BIN)/python -m pytest --attack --hypothesis-profile=searching -n 2 --dist worksteal

# The examples run once: what they print and draw lies in build/examples, and the tests look at the same. A page that
# warns is a failure.
pages: $(DOCS)
	MPLBACKEND=Agg $(BIN)/python -m sphinx -W --keep-going -q -d build/doctrees docs build/docs
	@echo "wrote build/docs/index.html"

docs: $(TESTS)
	MPLBACKEND=Agg OMP_NUM_THREADS=1 $(BIN)/python -m pytest --docs -n 2 --dist worksteal tests/project
	@echo "wrote build/docs/index.html"

# The picture of the README, from what the first example measured, and that of the page on servo axes.
picture: $(READY)
	$(BIN)/python -m docs.picture

# The benchmarks have an environment of their own, beside the peers that install there (benchmarks/peers.txt); one of them
# needs Python 3.12, so of the interpreters found the first that has it: make bench PYTHON=python3.13 names another.
BENCH := .venv-bench
PEERS := $(BENCH)/.ready
HAS_PEERS = $(firstword $(shell for p in $(PYTHON) python3.12 python3.13 python3.14; do \
  $$p -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && echo $$p; done; true) $(PYTHON))

$(PEERS): pyproject.toml constraints.txt benchmarks/peers.txt
	$(HAS_PEERS) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[test]" -r benchmarks/peers.txt
	@touch $@

bench: $(PEERS)
	$(BENCH)/bin/python -m benchmarks

$(RELEASE): $(READY)
	$(INSTALL) -e ".[release]"
	@touch $@

release-check: $(RELEASE)
	$(BIN)/nox

clean:
	rm -rf .nox $(VENV) $(BENCH) demo build docs/generated dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
