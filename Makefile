# The README's commands. Each sets up first (a no-op when nothing changed).
PYTHON := .venv/bin/python
DEMO_OUT ?= demo-out
HOURS ?=
JOBS ?= 2
ifeq ($(shell expr 'x$(JOBS)' : 'x[1-9][0-9]*$$'),0)
$(error JOBS is "$(JOBS)"; it must be a number of processors, as in JOBS=4)
endif
# One worker more than jobs: flights by the clock, which all are one worker's, mostly wait. One file's tests stay with one
# worker and long files go first: see tests/conftest.py.
WORKERS := -n $(shell expr $(JOBS) + 1) --dist loadscope --no-loadscope-reorder
# BLAS threads only spin on matrices as small as ours; see goshawk/__init__.py.
export OPENBLAS_NUM_THREADS ?= 1
# Compiled modules are kept even where the environment says otherwise (as many containers do): without them each start of
# the command line compiles NumPy, SciPy and ours again, which is half of its CPU time.
export PYTHONDONTWRITEBYTECODE :=
.DEFAULT_GOAL := help
.PHONY: help setup demo test test-quick test-processors test-all mutate bench fuzz docs words pictures lint lock wheels clean

help:  ## what there is to make
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## */  make \1\t/' | expand -t 18

setup:  ## install what is missing into .venv and build
	@tools/setup.sh

demo: setup  ## map, plan, fly and learn on a rendered room; leaves the project in demo-out
	.venv/bin/goshawk demo --out $(DEMO_OUT)

test:  ## set up and run the tests, on JOBS=2 processors
	@tools/setup.sh browser
	$(PYTHON) -m pytest $(WORKERS)

PACKAGE ?= planner
test-quick: setup  ## a minute of one package's tests, those that took least before: make test-quick PACKAGE=planner
	$(PYTHON) -m pytest -q $(WORKERS) --quick tests/$(PACKAGE)

# NumPy's vector paths that this processor has.
NUMPY_FEATURES = from numpy._core._multiarray_umath import __cpu_dispatch__ as all, __cpu_features__ as has; \
  print(*[name for name in all if has[name]])
OTHER_PROCESSORS := tests/test_processors.py tests/test_front_page.py tests/planner/gate/test_gate.py \
  tests/planner/test_one_answer.py tests/planner/optimise/test_descents.py tests/vehicle/test_laws.py
test-processors: setup  ## the front page and a small set as on two other processors: BLAS kernel, vector units, C library
	OPENBLAS_CORETYPE=Sandybridge $(PYTHON) -m pytest -q $(WORKERS) $(OTHER_PROCESSORS)
	OPENBLAS_CORETYPE=Prescott GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F \
	  NPY_DISABLE_CPU_FEATURES="$$($(PYTHON) -c '$(NUMPY_FEATURES)')" $(PYTHON) -m pytest -q $(WORKERS) $(OTHER_PROCESSORS)

test-all: lint mutate  ## the slow tests too, lint and mutations; installs the compilers and tools they need
	@tools/setup.sh slow
	$(PYTHON) -m pytest $(WORKERS) -m "slow or not slow"

mutate: setup  ## put faults into the Python sources, one at a time: the tests must notice 90 % of them
	$(PYTHON) tools/mutate.py --jobs $(JOBS)

bench: setup  ## measure every package beside its peers; writes build/bench/*.json
	@mkdir -p build/bench
	@for script in $$(grep -lE '^    (report\.)?main\(rows' benchmarks/*.py); do \
	  echo "== $$script"; $(PYTHON) $$script --json build/bench/$$(basename $$script .py).json || exit 1; done

fuzz: setup  ## feed the link and the state machine 1e8 inputs each (hours); HOURS=0.1 for a taste
	@tools/setup.sh slow
	$(PYTHON) tools/assure.py fuzz $(HOURS)

docs: setup  ## the documentation, as HTML in docs/_build
	$(PYTHON) -m sphinx -W --keep-going -b html docs docs/_build

words: setup  ## words of README and docs beside their budgets
	$(PYTHON) tools/word_budget.py

pictures: setup  ## the pictures of the docs, from the demo in DEMO_OUT, the examples and benchmarks (half an hour)
	@tools/setup.sh browser
	[ -d $(DEMO_OUT) ] || .venv/bin/goshawk demo --out $(DEMO_OUT)
	$(PYTHON) -m tools.pictures $(DEMO_OUT)

lint: setup  ## ruff, clang-format, pyright; the slowest last
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/clang-format --dry-run -Werror $$(git ls-files '*.c' '*.h' '*.cpp' '*.hpp' | grep -v generated)
	.venv/bin/pyright --pythonpath $(PYTHON) --threads $(JOBS)

lock: setup  ## pin the newest allowed versions in requirements.lock
	.venv/bin/uv pip compile --quiet --universal --python-version 3.11 --no-emit-index-url --no-emit-find-links \
	  --custom-compile-command "make lock" --extra dev --extra docs pyproject.toml -o requirements.lock

wheels: setup  ## build the wheel for Python 3.11, 3.12 and 3.13, and try each in an environment of its own
	$(PYTHON) tools/wheels.py

clean:  ## remove what was built; .venv stays
	rm -rf build dist docs/_build
