"""Run every command over every mesh of the catalog, shifted, scaled, turned and reordered.

    python tests/hard_cases/invariance_table.py [COMMAND ...] [--mesh NAME] [--change KIND]
        [-o table.md]

Prints a row for each command and kind of change: cases, results with the same bits, results within
their bounds, those that depend on the change by their nature, commands that refuse alike, and the
largest difference that a bound allows for. Exits with 1 if anything differs by more. A full run
takes half an hour of processor time.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from catalog.cells import in_cells
from invariance.product import CHANGES, COMMANDS, KINDS, MESHES, Tally, run

HEAD = (
    "| command | change | cases | same bits | within bounds | undecided | refused alike "
    "| largest difference |"
)


def row(command: str, kind: str, tally: Tally) -> str:
    """Row of the table."""
    figures = (tally.cases, tally.same, tally.within, tally.undecided, tally.refused)
    numbers = " | ".join(map(str, figures))
    return f"| {command} | {kind} | {numbers} | {tally.largest:.2g} |"


def main() -> None:
    """Parse the command line, run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commands", nargs="*", help="beginnings of names of commands")
    parser.add_argument("--mesh", default="", help="part of the names of meshes")
    parser.add_argument("--change", default="", help="part of the names of kinds of changes")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    lines, n_faults = [HEAD, "|---" * 8 + "|"], 0
    print("\n".join(lines), flush=True)
    for command in COMMANDS:
        if options.commands and not command.startswith(tuple(options.commands)):
            continue
        meshes = [case for case in MESHES if options.mesh in case.name]
        changes = [change for change in CHANGES if options.change in change.kind]
        tallies = run(command, itertools.product(meshes, changes), in_cells)
        for kind in KINDS:
            if kind in tallies:
                lines.append(row(command, kind, tallies[kind]))
                print(lines[-1], flush=True)
                n_faults += len(tallies[kind].faults)
                for fault in tallies[kind].faults:
                    print(f"{command}: {fault}", file=sys.stderr, flush=True)
    if options.output:
        options.output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.exit(1 if n_faults else 0)


if __name__ == "__main__":
    main()
