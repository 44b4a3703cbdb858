# Every target sets up .venv first when it is missing, or older than what it is made from.
PYTHON ?= python3
JOBS ?= 3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.complete
INSTALL := $(BIN)/python -m pip install --quiet --quiet --disable-pip-version-check
RENDER := $(BIN)/jupyter-book build --warningiserror --keep-going

# Trials run side by side, one thread each: a second thread to each only makes them wait for one another.
export OMP_NUM_THREADS ?= 1

.PHONY: help setup book page notebooks headline figures explore test test-more lint bench golden planted crash portable clean
.DELETE_ON_ERROR:

help:
	@echo 'make book [PARAMS=params/smoke.yaml]             run copies of the notebooks and render the book: _build/html'
	@echo 'make page NAME=04-figure3 [PARAMS=...]           run one copy again and render what changed'
	@echo 'make notebooks                                   refresh the outputs in notebooks/ themselves'
	@echo "make headline                                    every number of the README and the first page, and what makes it"
	@echo "make figures                                     Figures 3 and 4 into _build/figures, and that of the README"
	@echo 'make explore                                     the suspension explorer as an app in your browser'
	@echo 'make test [JOBS=3]                               packages, notebooks and book: for every change'
	@echo 'make test-more [JOBS=3]                          the rest: every page, crashes, a cluster, other processors'
	@echo 'make lint                                        style and types'
	@echo 'make bench                                       the scripts of benchmarks/'
	@echo 'make golden                                      new golden figures, of kinds whose version was raised'
	@echo 'make planted                                     plant changes of the numbers: does a golden test see each?'
	@echo 'make crash                                       kill collecting and training at 20 random moments each'
	@echo 'make portable [LEGS=sse]                         numerical tests and notebooks, as other processors round'
	@echo 'make setup, make clean                           the environment in .venv alone; remove _build'

setup: $(STAMP)

# Twice --quiet leaves pip its errors and takes its warnings, one for each package that one of several indexes lacks.
# --no-build-isolation: setuptools comes pinned from requirements.txt instead of fresh from the index.
$(STAMP): requirements.txt constraints.txt pyproject.toml
	@$(PYTHON) requirements.py
	@$(PYTHON) -m venv $(VENV)
	@$(INSTALL) -r requirements.txt
	@$(INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

# The book is rendered from a copy of its sources in _build/book, where executed notebooks stand in for the committed
# ones: the table of contents, links and included code are the same in both. `jupyter-book build .` renders the committed.
book: $(STAMP)
	rm -rf _build/book
	mkdir -p _build/book
	cp -R _config.yml _toc.yml book sidm ownrobot companion examples params _build/book/
	mkdir -p _build/book/results _build/book/recordings
	cp -R results/benchmark.jsonl results/explorer _build/book/results/
	cp recordings/*.yaml _build/book/recordings/
	$(BIN)/python -m companion notebook all _build/book/notebooks $(if $(PARAMS),-f $(PARAMS))
	$(RENDER) --path-output . _build/book

page: $(STAMP)
	@test -d _build/book || { echo "make page renders into a built book: run 'make book' first"; exit 2; }
	$(BIN)/python -m companion notebook $(NAME) _build/book/notebooks/$(NAME).ipynb $(if $(PARAMS),-f $(PARAMS))
	$(RENDER) --path-output . _build/book

figures: $(STAMP)
	$(BIN)/python -m companion.pages.headline

headline: $(STAMP)
	$(BIN)/python -m companion.pages.headline --numbers

notebooks: $(STAMP)
	$(BIN)/python -m companion notebook all --in-place

explore: $(STAMP)
	$(BIN)/python -m companion.explorer.serve notebooks/17-explorer.ipynb $(VOILA)

# What every change needs: the packages, every notebook with its own parameters (nbval), the book built with warnings as
# errors, three of its pages in a browser. One call of pytest, so that one exit status and one closing line speak for
# all. `loadfile` keeps a notebook's cells, and the tests that share a browser, on one worker; tests/conftest.py orders
# them. One worker more than two cores have, since kernels and browsers let them wait.
PYTEST := $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder
test: $(STAMP)
	$(PYTEST) -m "not more" --nbval-lax --nbval-current-env --nbval-kernel-startup-timeout=600 notebooks tests

# The rest: every page in the browser, the app, notebooks with params/smoke.yaml, crashes, a cluster, the wheel, planted
# changes, more examples from Hypothesis; and the core of the tests, with the notebooks, as the smallest x86 processors round.
test-more: $(STAMP)
	$(PYTEST) -m "more or hypothesis" --hypothesis-profile=more tests
	$(BIN)/python -m tests.portable sse --core --jobs $(JOBS)

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(STAMP)
	@set -e; for script in $(wildcard benchmarks/*.py); do echo "== $$script"; $(BIN)/python $$script; done

# In one process: all write into one file.
golden: $(STAMP)
	SIDM_GOLDEN=1 $(BIN)/python -m pytest tests/sidm tests/ownrobot tests/companion -k "figures or diagnosed or stored"

planted: $(STAMP)
	$(BIN)/python -m pytest -v -m more tests/test_planted.py

crash: $(STAMP)
	SIDM_KILLS=20 $(BIN)/python -m pytest -s -m more tests/companion/test_crash.py

portable: $(STAMP)
	$(BIN)/python -m tests.portable --jobs $(JOBS) $(LEGS)

clean:
	rm -rf _build
