# The verbs of the project. `make demo` and `make test` set all up first; both can be run again.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BUILD := build
SECONDS := 60
JOBS ?= auto

# what the installed package is made of
SOURCES := CMakeLists.txt pyproject.toml README.md \
           $(wildcard campaigns/*.toml) \
           $(shell find core bindings cmake python include -type f \
             \( -name '*.[ch]pp' -o -name '*.[ch]' -o -name '*.in' -o -name '*.map' -o -name '*.py' \
                -o -name '*.js' -o -name '*.css' -o -name '*.html' -o -name '*.json' -o -name '*.hdf5' \
                -o -name py.typed \))
CXX_SOURCES := $(shell find core bindings include tests examples -name '*.[ch]pp' -o -name '*.[ch]')

.PHONY: setup demo test docs fuzz lint tidy format man sdist wheel deb clean help

help:
	@echo "make setup   install what is missing, build, install fclib into $(VENV)"
	@echo "make demo    set up, then simulate, store, solve and judge a falling stack of boxes"
	@echo "make test    set up, then run all tests on all cores (JOBS=2: on two)"
	@echo "make docs    set up, then build the documentation into $(BUILD)/site"
	@echo "make fuzz    feed the readers with damaged files for SECONDS=60 (needs clang)"
	@echo "make lint    check style and types (ruff, mypy, clang-format)"
	@echo "make tidy    clang-tidy over the C++ sources, which takes minutes"
	@echo "make format  put the sources into the style that lint checks"
	@echo "make man     man pages of the command line, into man/"
	@echo "make sdist   the source distribution, into dist/"
	@echo "make wheel   a wheel of it with an HDF5 of its own, installed and tried (HDF5_SOURCE=FOLDER:"
	@echo "             sources of HDF5, which are downloaded otherwise)"
	@echo "make deb     the C library as Debian packages, into dist/"
	@echo "make clean   remove what was built (not $(VENV))"

setup: $(VENV)/.installed

demo: setup
	$(BIN)/fclib demo

test: setup $(VENV)/.test-tools $(VENV)/.docs-tools $(VENV)/.test-system
	cmake --build $(BUILD) --target fclib_tests fclib
	ctest --test-dir $(BUILD) --output-on-failure
	FCLIB_BUILD=$(CURDIR)/$(BUILD) $(BIN)/python -m pytest -n $(JOBS) --dist loadfile

docs: setup $(VENV)/.docs-tools
	$(BIN)/python scripts/site/build.py $(BUILD)/site

fuzz:
	@sh tests/fuzz/run.sh $(BUILD)/fuzz $(SECONDS)

lint: setup $(VENV)/.lint-tools $(VENV)/.test-tools $(VENV)/.docs-tools
	$(BIN)/ruff check python tests benchmarks examples scripts
	$(BIN)/ruff format --check python tests benchmarks examples scripts
	$(BIN)/clang-format --dry-run --Werror $(CXX_SOURCES)
	$(BIN)/mypy --package fclib
	$(BIN)/mypy tests benchmarks examples/python scripts/*.py
	$(BIN)/mypy scripts/site

format: $(VENV)/.lint-tools
	$(BIN)/ruff check --fix python tests benchmarks examples scripts
	$(BIN)/ruff format python tests benchmarks examples scripts
	$(BIN)/clang-format -i $(CXX_SOURCES)

tidy: setup $(VENV)/.lint-tools
	$(BIN)/python scripts/tidy.py $(BUILD)

man: setup
	$(BIN)/python scripts/man_pages.py man

# the man pages go into the sdist, and so into wheels
sdist: man $(VENV)/.package-tools
	rm -f dist/*.tar.gz
	$(BIN)/python -m build --sdist --outdir dist

wheel: sdist
	HDF5_SOURCE="$(HDF5_SOURCE)" sh scripts/wheel-libraries.sh $(BUILD)/bundled
	rm -rf $(BUILD)/wheel dist/*.whl
	$(BIN)/pip wheel --no-deps --wheel-dir $(BUILD)/wheel \
	  --config-settings=cmake.define.FCLIB_BUNDLED=$(abspath $(BUILD)/bundled) dist/fclib-*.tar.gz
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/auditwheel repair --wheel-dir dist $(BUILD)/wheel/*.whl
	$(BIN)/python scripts/check_wheel.py dist/*.whl

deb:
	cmake -S . -B $(BUILD)/deb -G Ninja -DFCLIB_PYTHON=OFF -DCMAKE_INSTALL_PREFIX=/usr
	cmake --build $(BUILD)/deb
	rm -rf dist/*.deb $(BUILD)/deb/unpacked
	cpack --config $(BUILD)/deb/CPackConfig.cmake -B $(BUILD)/deb/packages
	mkdir -p dist && cp $(BUILD)/deb/packages/*.deb dist
	for package in dist/*.deb; do dpkg-deb -x $$package $(BUILD)/deb/unpacked; done
	sh scripts/check_c_library.sh $(BUILD)/deb/unpacked/usr

clean:
	rm -rf $(BUILD) demo dist man $(VENV)/.installed

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
	@echo "== building and installing fclib into $(VENV) (eight minutes of CPU time the first time)"
	@$(BIN)/pip install --no-build-isolation \
	  --config-settings=build-dir=$(BUILD) --config-settings=cmake.define.FCLIB_TESTS=ON \
	  '.[analysis,collection,bench,report,solvers]'
	@touch $@

$(VENV)/.%-tools: $(VENV)/.installed pyproject.toml
	@echo "== installing the tools of make $*"
	@$(BIN)/python scripts/requirements.py $* | tr '\n' '\0' | xargs -0 $(BIN)/pip install --quiet
	@touch $@
