"""The command line: parse, call the public API, print."""


def run() -> None:
    """Run the command line; from here on signals end it with one line, also while it imports."""
    from .signals import end_cleanly_on_signals
    from .streams import open_closed_streams

    open_closed_streams()  # before pipes could take their numbers
    end_cleanly_on_signals()
    from .main import main

    main()
