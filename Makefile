# `make demo` and `make test` install what they need on Debian 12 and Ubuntu 24.04; for other systems see README.md.

BIN := .venv/bin
# A process a core; a file's tests stay in one, which share what their fixtures have solved.
PYTEST = $(BIN)/python -m pytest -q -n auto --dist loadfile
# What failed then runs once more, by itself: jobs of three ranks beside other tests may miss their limits of time.
ALONE = $(BIN)/python -m pytest -q --last-failed --last-failed-no-failures none
READY := .venv/.ready

# Open MPI: root may start it (containers), and a test may start more ranks than there are cores (releases 4 and 5).
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
export OMPI_MCA_rmaps_base_oversubscribe := 1
export PRTE_MCA_rmaps_default_mapping_policy := :oversubscribe
# The ranks are the parallelism; threads inside each would only compete.
export OMP_NUM_THREADS := 1

.PHONY: help setup demo test coverage test-rounding test-petsc-new boundscheck mutations lint loops format charts pictures docs links man paper dist clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 16

setup: $(READY) ## install what is missing, nothing else

# With a fresh stamp a target starts at once: no apt, no pip, no network.
$(READY): pyproject.toml tools/setup.sh
	tools/setup.sh
	touch $@

demo: $(READY) ## solve problem 4 and draw it: problem4.png
	$(BIN)/lcp-lube solve problem4 --n 100 --plot problem4.png

test: $(READY) ## ruff, mypy, then all tests
	$(MAKE) --no-print-directory -j 2 lint loops
	$(PYTEST) || $(ALONE)

# Beside mypy, once for a clone: else two processes of tests compile the same at the same time.
loops: $(READY)
	for words in "solve obstacle_bratu" "solve problem4" "sensitivity journal" "coefficients journal"; do \
	  $(BIN)/lcp-lube $$words --method fas > /dev/null || exit; done

# Following every line takes half as long again as the tests.
coverage: $(READY) ## which lines the tests run
	$(PYTEST) --cov=lcp_lube --cov-report=term

test-rounding: $(READY) ## the tests that rounding may move, under the kernels of other processors
	for kernel in Haswell Prescott; do OPENBLAS_CORETYPE=$$kernel NUMBA_CPU_NAME=generic $(PYTEST) -m rounding || $(ALONE) -m rounding || exit; done

test-petsc-new: ## the tests with the newest PETSc of PyPI, without hypre; compiles it the first time
	tools/petsc_new.sh
	.venv-petsc-new/bin/python -m pytest -q

# Machine code that was compiled without the checks must not be taken from a cache.
boundscheck: $(READY) ## the tests with every index of the compiled loops checked
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/.numba_boundscheck_cache $(PYTEST)

mutations: $(READY) ## 2,000 damaged scenes, options and files; every recipe by method, system, sides and ranks
	LCP_LUBE_MUTATIONS=2000 $(BIN)/python -m pytest -q tests/whole/test_mutations.py tests/whole/test_combinations.py --timeout 3000

lint: $(READY) ## ruff and mypy
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(READY) ## let ruff rewrite the code
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

charts: $(READY) ## make the runs that benchmarks/results lacks, then draw all charts
	$(BIN)/python benchmarks/precision_peers.py
	for chart in precision stability scaling; do $(BIN)/lcp-lube chart $$chart --results benchmarks/results || exit; done
	$(BIN)/python tools/pictures.py

pictures: $(READY) ## draw the pictures of README.md, docs/ and benchmarks/ anew that are stale; ALL=1: all of them
	$(BIN)/python tools/pictures.py $(if $(ALL),--all)

# Tools of the documentation only; the package itself does not need them.
.venv/.docs: pyproject.toml $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@

docs: .venv/.docs ## the documentation site in build/site, strictly; its notebooks run
	$(BIN)/python -m sphinx -W --keep-going -q -b html -c docs . build/site
	$(BIN)/python tools/links.py build/site

links: .venv/.docs ## whether links to other sites lead somewhere; needs the network
	$(BIN)/python -m sphinx -q -b linkcheck -c docs . build/links

man: .venv/.docs ## a man page, build/lcp-lube.1
	mkdir -p build
	$(BIN)/argparse-manpage --module lcp_lube.cli.arguments --function parser_of_all --prog lcp-lube --project-name lcp_lube \
	  --description "cavitation in lubricated bearings as a complementarity problem" --output build/lcp-lube.1

paper: $(READY) ## the article, build/paper.pdf
	$(BIN)/python -m pip install --quiet --disable-pip-version-check pypandoc_binary typst
	$(BIN)/python tools/paper.py

dist: $(READY) ## a source archive and a wheel in dist/, and the wheel tried in an environment of its own
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dist]'
	rm -rf dist build/lib && $(BIN)/python -m build --outdir dist
	tools/try_wheel.sh dist/*.whl

clean: ## remove caches and build products; .venv stays
	rm -rf build dist *.egg-info .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache problem4.png
	find lcp_lube tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
