# The verbs of the project. `make demo` and `make test` set all up first; both can be run again.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BUILD := build
SECONDS := 60

# what the installed package is made of
SOURCES := CMakeLists.txt pyproject.toml README.md \
           $(wildcard campaigns/*.toml) \
           $(shell find core bindings cmake python include -type f \
             \( -name '*.[ch]pp' -o -name '*.[ch]' -o -name '*.in' -o -name '*.map' -o -name '*.py' \
                -o -name '*.js' -o -name '*.css' -o -name '*.html' -o -name '*.json' -o -name '*.hdf5' \
                -o -name py.typed \))
CXX_SOURCES := $(shell find core bindings include tests examples -name '*.[ch]pp' -o -name '*.[ch]')

.PHONY: setup demo test docs fuzz lint format clean help

help:
	@echo "make setup   install what is missing, build, install fclib into $(VENV)"
	@echo "make demo    set up, then simulate, store, solve and judge a falling stack of boxes"
	@echo "make test    set up, then run all tests"
	@echo "make docs    set up, then build the documentation into $(BUILD)/site"
	@echo "make fuzz    feed the readers with damaged files for SECONDS=60 (needs clang)"
	@echo "make lint    check style and types (ruff, mypy, clang-format)"
	@echo "make format  put the sources into the style that lint checks"
	@echo "make clean   remove what was built (not $(VENV))"

setup: $(VENV)/.installed

demo: setup
	$(BIN)/fclib demo

test: setup $(VENV)/.test-tools $(VENV)/.docs-tools $(VENV)/.test-system
	cmake --build $(BUILD) --target fclib_tests fclib
	ctest --test-dir $(BUILD) --output-on-failure
	FCLIB_BUILD=$(CURDIR)/$(BUILD) $(BIN)/python -m pytest

docs: setup $(VENV)/.docs-tools
	$(BIN)/python scripts/site/build.py $(BUILD)/site

fuzz:
	@sh tests/fuzz/run.sh $(BUILD)/fuzz $(SECONDS)

lint: setup $(VENV)/.lint-tools $(VENV)/.test-tools $(VENV)/.docs-tools
	$(BIN)/ruff check python tests benchmarks examples scripts
	$(BIN)/ruff format --check python tests benchmarks examples scripts
	$(BIN)/clang-format --dry-run --Werror $(CXX_SOURCES)
	$(BIN)/mypy --package fclib
	$(BIN)/mypy tests benchmarks examples/python
	$(BIN)/mypy scripts/site

format: $(VENV)/.lint-tools
	$(BIN)/ruff check --fix python tests benchmarks examples scripts
	$(BIN)/ruff format python tests benchmarks examples scripts
	$(BIN)/clang-format -i $(CXX_SOURCES)

clean:
	rm -rf $(BUILD) demo $(VENV)/.installed

$(VENV)/.system: scripts/system-packages.sh
	@PYTHON=$(PYTHON) sh scripts/system-packages.sh
	@test -x $(BIN)/python || { echo "== making $(VENV)"; $(PYTHON) -m venv $(VENV); }
	@touch $@

$(VENV)/.test-system: scripts/system-packages.sh
	@PYTHON=$(PYTHON) sh scripts/system-packages.sh test
	@touch $@

$(VENV)/.build-tools: $(VENV)/.system pyproject.toml
	@echo "== installing the build tools into $(VENV)"
	@$(BIN)/python scripts/requirements.py build-system | xargs $(BIN)/pip install --quiet
	@touch $@

# --no-build-isolation keeps one build folder, so that only what changed is compiled again
$(VENV)/.installed: $(VENV)/.build-tools $(SOURCES)
	@echo "== building and installing fclib into $(VENV) (two minutes the first time)"
	@$(BIN)/pip install --no-build-isolation \
	  --config-settings=build-dir=$(BUILD) --config-settings=cmake.define.FCLIB_TESTS=ON \
	  '.[analysis,collection,bench,report,solvers]'
	@touch $@

$(VENV)/.%-tools: $(VENV)/.installed pyproject.toml
	@echo "== installing the tools of make $*"
	@$(BIN)/python scripts/requirements.py $* | tr '\n' '\0' | xargs -0 $(BIN)/pip install --quiet
	@touch $@
