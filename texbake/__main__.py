"""`python -m texbake`: the command line, which the package itself does not know."""

import sys
from importlib import import_module, util
from pathlib import Path


def _use_command_line_of_checkout() -> None:
    """Make `texbake_cli` the folder `cli` of a checkout, not the installed package."""
    folder = Path(__file__).parents[1] / "cli"
    spec = util.spec_from_file_location("texbake_cli", folder / "__init__.py")
    assert spec and spec.loader
    sys.modules["texbake_cli"] = module = util.module_from_spec(spec)
    spec.loader.exec_module(module)


if __name__ == "__main__":
    if Path(__file__).with_name("core").joinpath("arena.c").exists():
        _use_command_line_of_checkout()
    import_module("texbake_cli").run()
