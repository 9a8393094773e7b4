#!/bin/sh
# Tests fclib.torch and fclib.jax, and the recipes of docs/recipes.md, in an environment of its own on
# top of the one that is there.
#
#   scripts/try_layers.sh build/layers [torch] [jax]
#
# Without names both are tried. They are large, torch with what it has for GPUs above all: nothing else
# of the project needs them. PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu takes one without.
set -eu
there=${1:?"usage: scripts/try_layers.sh FOLDER [torch] [jax]"}
shift
test $# -gt 0 || set -- torch jax
base=.venv/bin/python
test -x "$base" || { echo "there is no $base: make setup makes it" >&2; exit 1; }

"$base" -m venv "$there"
own=$("$there/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
"$base" -c 'import sysconfig; print("import site; site.addsitedir(%r)" % sysconfig.get_path("purelib"))' \
  > "$own/base.pth"
for package in "$@"; do
  "$there/bin/python" -m pip install --quiet "$package"
  "$there/bin/python" -c "import $package, fclib.$package; print('$package', $package.__version__)"
  "$there/bin/python" -m pytest -q -p no:cacheprovider tests/python/test_layer.py -k "$package"
done
"$there/bin/python" -m pip install --quiet cvxpy
"$there/bin/python" -m pytest -q -rs -p no:cacheprovider tests/python/test_docs_code.py -k recipes
