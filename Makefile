# The verbs of the project. `make demo` and `make test` set all up first; both can be run again.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BUILD := build
SECONDS := 60
BUDGET ?= 10min
CAMPAIGNS ?= rt444 scaling
# processes of tests: one more than cores, since some tests wait
JOBS ?= $(shell echo $$(( $$(nproc 2>/dev/null || getconf _NPROCESSORS_ONLN) + 1 )))

# the sanitizer of threads of some compilers wants its shadow memory where Linux may have put others'
NO_RANDOM_ADDRESSES := $(shell command -v setarch >/dev/null && echo setarch -R)
CXX_SOURCES := $(shell find core bindings browser include tests examples workshop -name '*.[ch]pp' -o -name '*.[ch]')

JS_SOURCES := $(shell find browser tests workshop scripts python/fclib/report -name '*.js' -o -name '*.mjs')
CSS_SOURCES := python/fclib/report/assets/style.css
# Prettier and ESLint, of the versions in scripts/javascript; the configuration lies beside them,
# since it imports what npm installs
JS := $(BUILD)/javascript
PRETTIER = $(JS)/node_modules/.bin/prettier --config $(JS)/package.json --log-level warn
ESLINT = $(JS)/node_modules/.bin/eslint --config $(JS)/eslint.config.mjs
HAS_NPM := $(shell command -v npm)
NO_NPM := @echo "== there is no npm: JavaScript is not checked (apt-get install npm)"

.PHONY: setup demo test test-long wasm docs fuzz asan tsan coverage build-cost lint tidy format layers man sdist wheel wheels \
        collection-wheel results-wheel published-site campaigns deb release clean help

help:
	@echo "make setup   install what is missing, build, make $(VENV) import fclib from here"
	@echo "make demo    set up, then simulate, store, solve and judge a falling stack of boxes"
	@echo "make test    set up, then run all tests on all cores (JOBS=2: in two processes)"
	@echo "make test-long  the tests of a minute or more, which make test leaves out"
	@echo "make wasm    the core as a module for browsers, into $(BUILD)/wasm/fclib (needs Emscripten)"
	@echo "make docs    set up, then build the documentation into $(BUILD)/site (REPORT=ADDRESS: links to a report;"
	@echo "             VERSIONS=1.0.0,1.1.0: links to the sites of these versions, in folders beside it)"
	@echo "make fuzz    feed the readers with damaged files for SECONDS=60 (needs clang)"
	@echo "make asan    the C++ tests under the sanitizers of addresses and of undefined behaviour"
	@echo "make tsan    the C++ tests under the sanitizer of threads"
	@echo "make coverage  all tests once more, and the lines of C++ and Python that they do not run"
	@echo "make build-cost  CPU seconds of a whole build, and of touching each header"
	@echo "make lint    check style and types (ruff, mypy, clang-format; Prettier and ESLint if there is npm)"
	@echo "make tidy    clang-tidy over the C++ sources, which takes minutes"
	@echo "make format  put the sources into the style that lint checks"
	@echo "make layers  fclib.torch, fclib.jax and the recipes, tested in an environment of their own, which is large"
	@echo "make man     man pages of the command line, into man/"
	@echo "make sdist   the source distribution, into dist/"
	@echo "make wheel   a wheel of it with HDF5 and METIS inside, installed and tried (HDF5_SOURCE=FOLDER,"
	@echo "             METIS_SOURCE=FOLDER: their sources, which are downloaded otherwise)"
	@echo "make wheels  wheels for each Python from 3.10 to 3.14 that is found, each tried there"
	@echo "make results-wheel     the published runs, as a wheel, into dist/results"
	@echo "make published-site    a site of the published runs, into $(BUILD)/published-site"
	@echo "make collection-wheel  the stored states of the collection, as a wheel, into dist/collection"
	@echo "make campaigns  run the published campaigns, BUDGET=10min each, and pack stores and tables"
	@echo "make deb     the C library as Debian packages, into dist/"
	@echo "make release  check all, build and try all that is released, into dist/, with checksums and SBOM"
	@echo "make clean   remove what was built (not $(VENV))"

# ninja knows what was edited; Python is imported from where it lies
setup: $(VENV)/.installed
	@cmake --build $(BUILD)

demo: setup
	$(BIN)/fclib demo

test: setup $(VENV)/.test-tools $(VENV)/.docs-tools $(VENV)/.test-system
	cmake --build $(BUILD) --target fclib_tests fclib
	ctest --test-dir $(BUILD) --output-on-failure --parallel $(JOBS)
	@if command -v emcmake >/dev/null && command -v node >/dev/null; then $(MAKE) wasm; \
	  else echo "== there is no Emscripten: the tests of the module for browsers are skipped"; fi
	@# compiled tests are kept, where the environment forbids it too: each process would make them anew
	PYTHONDONTWRITEBYTECODE= FCLIB_BUILD=$(CURDIR)/$(BUILD) \
	  $(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m "not long"

test-long: setup $(VENV)/.test-tools $(VENV)/.test-system
	FCLIB_BUILD=$(CURDIR)/$(BUILD) $(BIN)/python -m pytest -n $(JOBS) -m long

wasm:
	@command -v emcmake >/dev/null && command -v node >/dev/null || { echo "make wasm needs Emscripten \
	and Node. Debian, Ubuntu: apt-get install emscripten; conda: conda install -c conda-forge emscripten"; exit 1; }
	emcmake cmake --preset wasm
	cmake --build --preset wasm
	@gzip -9 -c build/wasm/fclib/fclib-core.wasm | wc -c | \
	  awk '{ printf "build/wasm/fclib: fclib-core.wasm has %.2f MB, compressed\n", $$1 / 1e6 }'

docs: setup $(VENV)/.docs-tools
	$(BIN)/python scripts/site/build.py $(BUILD)/site $(if $(REPORT),--report $(REPORT)) $(if $(VERSIONS),--versions $(VERSIONS))

fuzz:
	@sh tests/fuzz/run.sh $(BUILD)/fuzz $(SECONDS)

asan tsan: $(VENV)/.system
	cmake --preset $@
	cmake --build --preset $@
	$(NO_RANDOM_ADDRESSES) ctest --preset $@ --parallel 2

coverage: setup $(VENV)/.test-tools $(VENV)/.docs-tools $(VENV)/.coverage-tools $(VENV)/.test-system
	cmake --preset coverage
	cmake --build --preset coverage
	$(BIN)/python scripts/coverage_report.py build/coverage

layers: setup $(VENV)/.test-tools
	FCLIB_BUILD=$(CURDIR)/$(BUILD) sh scripts/try_layers.sh $(BUILD)/layers

build-cost: setup
	$(BIN)/python scripts/build_cost.py

lint: setup $(VENV)/.lint-tools $(VENV)/.test-tools $(VENV)/.docs-tools $(if $(HAS_NPM),$(JS)/.installed)
	$(BIN)/ruff check python tests workshop examples scripts
	$(BIN)/ruff format --check python tests workshop examples scripts
	$(BIN)/clang-format --dry-run --Werror $(CXX_SOURCES)
	$(BIN)/mypy --package fclib
	@# for the oldest Python; what NumPy's types say there differs
	$(BIN)/mypy --python-version 3.10 --disable-error-code no-any-return --package fclib
	$(BIN)/mypy tests workshop examples/python scripts/*.py
	$(BIN)/mypy scripts/site
ifeq ($(HAS_NPM),)
	$(NO_NPM)
else
	$(PRETTIER) --check $(JS_SOURCES) $(CSS_SOURCES)
	$(ESLINT) $(JS_SOURCES)
endif

format: $(VENV)/.lint-tools $(if $(HAS_NPM),$(JS)/.installed)
	$(BIN)/ruff check --fix python tests workshop examples scripts
	$(BIN)/ruff format python tests workshop examples scripts
	$(BIN)/clang-format -i $(CXX_SOURCES)
ifeq ($(HAS_NPM),)
	$(NO_NPM)
else
	$(PRETTIER) --write $(JS_SOURCES) $(CSS_SOURCES)
endif

tidy: setup $(VENV)/.lint-tools
	$(BIN)/python scripts/tidy.py $(BUILD)

man: setup
	$(BIN)/python scripts/man_pages.py man

# the man pages go into the sdist, and so into wheels
sdist: man $(VENV)/.package-tools
	rm -f dist/*.tar.gz
	$(BIN)/python -m build --sdist --outdir dist

wheel: sdist
	HDF5_SOURCE="$(HDF5_SOURCE)" METIS_SOURCE="$(METIS_SOURCE)" sh scripts/wheel-libraries.sh $(BUILD)/bundled
	rm -rf $(BUILD)/wheel dist/*.whl
	$(BIN)/pip wheel --no-deps --wheel-dir $(BUILD)/wheel \
	  --config-settings=cmake.define.FCLIB_BUNDLED=$(abspath $(BUILD)/bundled) dist/fclib-*.tar.gz
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/auditwheel repair --wheel-dir dist $(BUILD)/wheel/*.whl
	$(BIN)/python scripts/check_wheel.py dist/*.whl

# for every Python there is from 3.10 to 3.14, and each tried; CHROOTS: folders of scripts/try_on.sh
wheels: sdist
	HDF5_SOURCE="$(HDF5_SOURCE)" METIS_SOURCE="$(METIS_SOURCE)" sh scripts/wheel-libraries.sh $(BUILD)/bundled
	$(BIN)/python scripts/try_wheels.py --build $(BUILD)/bundled $(CHROOTS:%=--chroot %)

# tried as it is installed: every stored trajectory is found in it and read
campaigns: setup
	set -e; for name in $(CAMPAIGNS); do \
	  $(BIN)/python -m workshop.tables.campaign $$name --budget $(BUDGET); done
	mkdir -p dist
	tar -czf dist/fclib-campaigns.tar.gz -C $(BUILD) campaigns -C .. docs/results
	@echo dist/fclib-campaigns.tar.gz

collection-wheel: setup $(VENV)/.package-tools
	rm -rf dist/collection
	$(BIN)/python -m build --wheel --outdir dist/collection collection
	$(BIN)/python scripts/check_collection.py dist/collection/*.whl

# from the packages alone: nothing is built or run
published-site: setup
	$(BIN)/fclib report --with published --catalog tiny --with-files \
	  --title "Published runs" --out $(BUILD)/published-site

results-wheel: setup $(VENV)/.package-tools
	$(BIN)/fclib results verify --in results/fclib_results/runs
	rm -rf dist/results
	$(BIN)/python -m build --wheel --outdir dist/results results

deb:
	cmake -S . -B $(BUILD)/deb -G Ninja -DFCLIB_PYTHON=OFF -DCMAKE_INSTALL_PREFIX=/usr
	cmake --build $(BUILD)/deb
	rm -rf dist/*.deb $(BUILD)/deb/unpacked
	cpack --config $(BUILD)/deb/CPackConfig.cmake -B $(BUILD)/deb/packages
	mkdir -p dist && cp $(BUILD)/deb/packages/*.deb dist
	for package in dist/*.deb; do dpkg-deb -x $$package $(BUILD)/deb/unpacked; done
	sh scripts/check_c_library.sh $(BUILD)/deb/unpacked/usr

# everything from an empty dist/; the tag is set by hand, on the commit that this has passed on
release: $(VENV)/.package-tools
	$(BIN)/python scripts/release.py check
	rm -rf dist
	$(MAKE) lint test test-long docs
	$(MAKE) wheels collection-wheel results-wheel deb
	$(BIN)/python scripts/release.py finish dist

clean:
	rm -rf $(BUILD) demo dist man $(VENV)/.installed python/fclib/_core.*

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

# --no-build-isolation keeps one build folder, so that only what changed is compiled again. The package
# is imported from python/ (cmake/inplace.cmake): only what its metadata is made of installs it anew,
# or a build folder that is gone.
$(VENV)/.installed: $(VENV)/.build-tools CMakeLists.txt pyproject.toml $(if $(wildcard $(BUILD)/build.ninja),,no-build)
	@echo "== building fclib and installing it into $(VENV) (minutes of CPU time the first time)"
	@$(BIN)/pip install --no-build-isolation \
	  --config-settings=build-dir=$(BUILD) --config-settings=cmake.define.FCLIB_TESTS=ON \
	  --editable '.[simulate,analysis,collection,bench,report,solvers]'
	@touch $@

no-build:

$(JS)/.installed: $(wildcard scripts/javascript/*)
	@echo "== installing Prettier and ESLint into $(JS)"
	@mkdir -p $(JS)
	@cp scripts/javascript/* $(JS)
	@npm ci --prefix $(JS) --ignore-scripts --no-audit --no-fund --loglevel=error
	@touch $@

$(VENV)/.%-tools: $(VENV)/.installed pyproject.toml
	@echo "== installing the tools of make $*"
	@$(BIN)/python scripts/requirements.py $* | tr '\n' '\0' | xargs -0 $(BIN)/pip install --quiet
	@touch $@
