"""`python -m texbake`: the command line, which the package itself does not know."""

from importlib import import_module

if __name__ == "__main__":
    import_module("texbake_cli").run()
