"""One module a command, of the name of the command."""
