# What a maintainer runs now and then. Users need none of it: `pip install .` builds the core.

PYTHON ?= python3
WHEELS = $(shell cd texbake/core && $(PYTHON) -c \
  'import compile_core; print(*(target.wheel_tag for target in compile_core.TARGETS))')

.PHONY: core wheels extension release

# The core for this machine, beside its sources.
core:
	$(PYTHON) texbake/core/compile_core.py

# One wheel a platform, all from this machine, into dist/.
wheels:
	for tag in $(WHEELS); do \
	  rm -rf build && TEXBAKE_TARGET=$$tag $(PYTHON) -m pip wheel --no-deps -w dist . || exit 1; \
	done
	rm -rf build

# The extension for Blender, one zip file per platform, into dist/blender/.
extension: wheels
	$(PYTHON) integrations/blender/build.py dist/*.whl -o dist/blender

# What a release uploads: the wheels, the extension, and the sources from which pip builds where no
# wheel fits.
# Needs the package `build`.
release: extension
	$(PYTHON) -m build --sdist --outdir dist
