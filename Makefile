# make demo   set up, then run everything on the built-in virtual cell
# make test   set up, then lint, types and the whole test suite
# make bench  compare with other packages (they get an environment of their own)
# make slow   the statistical studies
# make pictures  takes the pictures of the README anew

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready

.PHONY: demo test lint format bench slow pictures browser clean

demo: $(READY)
	$(BIN)/truepath demo

test: lint browser
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY) .venv-peers/.ready
	$(BIN)/python workflows/benchmark.py

pictures: $(READY) browser
	$(BIN)/python docs/images/take.py

slow: $(READY)
	$(BIN)/python workflows/coverage_study.py
	$(BIN)/python workflows/hidden_effects.py
	$(BIN)/python workflows/path_accuracy.py
	$(BIN)/python workflows/fuzz_programs.py --count 5000
	$(BIN)/python workflows/plan_study.py --seeds 50
	$(BIN)/python workflows/record_faults.py --runs 200
	$(BIN)/pytest -m slow

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 10), "Python 3.10 or newer is needed"'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --constraint constraints.txt --editable ".[dev]"
	touch $@

# A browser for the preview test. Installed where that needs no question; else the test says that it was skipped.
browser:
	@command -v chromium chromium-browser google-chrome >/dev/null 2>&1 || \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq chromium >/dev/null; \
	  else echo "no Chromium found: the preview is not opened in a browser"; fi

.venv-peers/.ready: workflows/peers/requirements.txt
	test -x .venv-peers/bin/python || $(PYTHON) -m venv .venv-peers
	.venv-peers/bin/pip install --quiet --requirement workflows/peers/requirements.txt
	touch $@

clean:
	rm -rf $(VENV) .venv-peers truepath-demo
