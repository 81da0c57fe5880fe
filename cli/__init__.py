"""The command line: parse, call the public API, print."""


def run() -> None:
    """Run the command line; from here on signals end it with one line, also while it imports."""
    from .signals import end_cleanly_on_signals

    end_cleanly_on_signals()
    from .main import main

    main()
