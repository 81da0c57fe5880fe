# What a maintainer runs now and then. Users need none of it: `pip install .` builds the core.

PYTHON ?= python3
WHEELS = manylinux2014_x86_64 manylinux2014_aarch64 win_amd64 macosx_11_0_x86_64 macosx_11_0_arm64

.PHONY: core wheels

# The core for this machine, beside its sources.
core:
	$(PYTHON) texbake/core/compile_core.py

# One wheel a platform, all from this machine, into dist/.
wheels:
	for tag in $(WHEELS); do \
	  rm -rf build && TEXBAKE_TARGET=$$tag $(PYTHON) -m pip wheel --no-deps -w dist . || exit 1; \
	done
	rm -rf build
