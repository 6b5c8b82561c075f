# hedgebed: `make run` and `make test` set themselves up; `make help` lists the rest.

SHELL := /bin/bash
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
WHAT ?= bed
WORKERS ?= 2
FUZZED ?= fuzzed.jsonl
KILLED ?= killed.jsonl

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help run flagship test fast long slow fuzz torture tiers cover docs validate experiments bench gpu doctor format clean distclean

help:  ## what there is
	@grep -E '^[a-z]+:.*##' $(firstword $(MAKEFILE_LIST)) | sed -E 's/^([a-z]+):.*## */  make \1\t/' | expand -t 18

run: $(VENV)/.installed  ## a first answer in 2 to 3 minutes: a spike in sand, into a fresh folder under runs/ (ARGS="--option value ...")
	$(BIN)/hedgebed penetrate penetrate-first $(ARGS)

flagship: $(VENV)/.installed  ## the same spike extrapolated to real grains, with three errors; some 3 hours of one core
	$(BIN)/hedgebed converge docs/results/converge-flagship/run.toml $(ARGS)

# A file of tests stays with one worker: its fixtures and kernels are made once; tests/conftest.py has the longest files
# begin. WORKERS=0 tests in one process.
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed-test  ## ruff, mypy and the tests, these in WORKERS=2 processes
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(PYTEST) $(ARGS)

fast: $(VENV)/.installed-test  ## the inner loop: ruff, and the tests whose files take a few seconds at most
	$(BIN)/ruff check .
	$(PYTEST) -m "not heavy and not long and not slow" $(ARGS)

long: $(VENV)/.installed-test  ## whole diagnoses and the tests of some 5 s and more, which CI runs after those of `make test`
	$(PYTEST) -m long $(ARGS)

slow: $(VENV)/.installed-test  ## the tests that take minutes: physics against closed forms, kill and resume
	$(PYTEST) -m slow $(ARGS)

fuzz: $(VENV)/.installed-test  ## settings and campaigns drawn at random, 10,000 and 500, and 1,000 computed, what FUZZED=fuzzed.jsonl has left out
	HEDGEBED_FUZZ=10000 HEDGEBED_FUZZ_KEPT=$(abspath $(FUZZED)) $(PYTEST) -m "long or not long" tests/faults/test_fuzz.py tests/faults/test_fuzz_computed.py $(ARGS)

torture: $(VENV)/.installed-test  ## files damaged, 4,400 in all, disks filled, a cache taken away, experiments killed 50 times: resumed to the same bits
	HEDGEBED_DAMAGES=200 $(PYTEST) -m "long or slow or not long" tests/faults/test_damage.py tests/faults/test_damaged_folders.py tests/faults/test_damaged_checkpoints.py tests/faults/test_disk.py $(ARGS)
	HEDGEBED_KILLS=50 HEDGEBED_KILLED_KEPT=$(abspath $(KILLED)) $(PYTEST) -m "long or slow" tests/faults/test_killed.py $(ARGS)

tiers: $(VENV)/.installed-test  ## measure again how long each file of tests takes (tests/durations.toml; ARGS="FILE ..." for new ones)
	$(PYTEST) --write-durations $(ARGS)

cover: $(VENV)/.installed-test  ## the tests of `make test`, counting the lines they reach: several times as long
	$(PYTEST) --cov --cov-report=term $(ARGS)

docs: $(VENV)/.installed-docs  ## the documentation as a site in build/site; a broken link fails
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet $(ARGS)
	@echo "wrote build/site/index.html"

validate: $(VENV)/.installed  ## the bed against closed forms, published figures and other codes; writes docs/validation.md
	$(BIN)/hedgebed validate $(ARGS)

experiments: $(VENV)/.installed  ## the platform's experiments on grains that have no result yet (ARGS="CASE ..."); hours
	$(BIN)/hedgebed experiments run $(ARGS)

bench: $(VENV)/.installed  ## race the bed against LIGGGHTS and LAMMPS, as far as they are installed (WHAT=bed)
	$(BIN)/hedgebed bench $(WHAT) $(ARGS)

gpu: $(VENV)/.installed-test  ## on a machine with an NVIDIA GPU: the tests of beds there, and grain-steps per second; 10 minutes at most
	$(BIN)/python -m benchmarks.gpu $(ARGS)

doctor: $(VENV)/.installed  ## what this machine has, and what to install where something lacks
	$(BIN)/hedgebed doctor

format: $(VENV)/.installed-test  ## put imports and lines in order
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:  ## remove what building and testing left; keep the environment and the runs
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis .coverage htmlcov
	find . -path ./$(VENV) -prune -o -name __pycache__ -type d -exec rm -rf {} +

distclean: clean  ## clean, and remove the environment too (never the runs)
	rm -rf $(VENV)

# The environment. Taichi has wheels for Python 3.11 to 3.13: take the first of these that is there and is one
# (PYTHON=/path/to/python chooses another).
$(VENV)/bin/python:
	@found=""; \
	for python in $(or $(PYTHON),python3 python3.11 python3.12 python3.13); do \
	    version=$$($$python -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue; \
	    case $$version in 3.11|3.12|3.13) chosen=$$python; break;; *) found="$$found $$python=$$version";; esac; \
	done; \
	if [ -z "$$chosen" ]; then \
	    echo "hedgebed needs Python 3.11, 3.12 or 3.13 (Taichi has wheels for these); found:$${found:- none}." >&2; \
	    echo "Debian 12 and 13 have one: apt install python3 python3-venv. Elsewhere: make ... PYTHON=/path/to/python" >&2; \
	    exit 1; \
	fi; \
	echo "making $(VENV) with $$chosen (Python $$version)"; \
	if ! $$chosen -m venv $(VENV); then \
	    rm -rf $(VENV); \
	    echo "" >&2; \
	    echo "Python could not make a virtual environment. On Debian: apt install python3-venv" >&2; \
	    exit 1; \
	fi

# Taichi's library is linked with that of X11, which a bare Debian lacks, even where nothing is ever shown.
define WITH_X11
@if ! $(BIN)/python -c 'import ctypes; ctypes.CDLL("libX11.so.6")' 2>/dev/null && [ "$$(uname -s)" = Linux ]; then \
    if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
        echo "installing libx11-6, which Taichi wants"; \
        { apt-get -q update && DEBIAN_FRONTEND=noninteractive apt-get -qy install --no-install-recommends libx11-6; } \
            >/dev/null 2>&1 || { echo "libX11.so.6 is missing and could not be installed: apt install libx11-6" >&2; exit 1; }; \
    else \
        echo "Taichi needs libX11.so.6, which this machine lacks. On Debian: apt install libx11-6" >&2; exit 1; \
    fi; \
fi
endef

# Stamps: installed again only when pyproject.toml has changed. The package itself is installed in place (-e).
$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	@echo "installing hedgebed and what it needs into $(VENV) (the first time about 1.4 GB)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[quadrants]'
	$(WITH_X11)
	@touch $@

$(VENV)/.installed-docs: pyproject.toml | $(VENV)/bin/python
	@echo "installing hedgebed, what it needs and what makes its site into $(VENV) (the first time about 1.4 GB)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[quadrants,docs]'
	$(WITH_X11)
	@touch $(VENV)/.installed $@

$(VENV)/.installed-test: pyproject.toml | $(VENV)/bin/python
	@echo "installing hedgebed, what it needs and what tests it into $(VENV) (the first time about 1.8 GB)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[quadrants,test]'
	$(WITH_X11)
	@touch $(VENV)/.installed $@
