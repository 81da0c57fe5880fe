# What a maintainer runs now and then. Users need none of it: `pip install .` builds the core.

PYTHON ?= python3
WHEELS = $(shell cd texbake/core && $(PYTHON) -c \
  'import compile_core; print(*(target.wheel_tag for target in compile_core.TARGETS))')

.PHONY: core wheels release

# The core for this machine, beside its sources.
core:
	$(PYTHON) texbake/core/compile_core.py

# One wheel a platform, all from this machine, into dist/.
wheels:
	for tag in $(WHEELS); do \
	  rm -rf build && TEXBAKE_TARGET=$$tag $(PYTHON) -m pip wheel --no-deps -w dist . || exit 1; \
	done
	rm -rf build

# What a release uploads: the wheels, and the sources from which pip builds where no wheel fits.
# Needs the package `build`.
release: wheels
	$(PYTHON) -m build --sdist --outdir dist
