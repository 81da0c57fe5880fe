"""Parameter types: how the values of options are written on the command line."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from texbake.limits import whole_number


class Size(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes none
    """`1024` or `1024x512`, in pixels; an int or (width, height)."""

    name = "size"

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Show both forms."""
        return "PX|WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | tuple[int, int]:
        """Parse a size; the option class checks its range."""
        if not isinstance(value, str):
            return value  # type: ignore[no-any-return]  # a default
        try:
            sides = [int(side) for side in value.lower().split("x")]
        except ValueError:
            sides = []
        if len(sides) not in (1, 2):
            self.fail(f"{value!r} is not a size such as 1024 or 1024x512", param, ctx)
        return sides[0] if len(sides) == 1 else (sides[0], sides[1])


class Numbers(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes none
    """Numbers separated by commas, or one of a few words."""

    name = "numbers"

    def __init__(self, form: str, words: Sequence[str] = ()) -> None:
        self.words = tuple(words)
        self._metavar = "|".join((*self.words, form))
        most = form.count(",") + 1
        self._counts = range(form.split("[")[0].count(",") + 1, most + 1)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Show the words and the form."""
        return self._metavar

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | float | tuple[float, ...]:
        """Parse; one number becomes a float, several a tuple."""
        if not isinstance(value, str) or value in self.words:
            return value  # type: ignore[no-any-return]  # a default, or a word
        try:
            numbers = tuple(float(number) for number in value.split(","))
        except ValueError:
            numbers = ()
        if len(numbers) not in self._counts:
            self.fail(f"{value!r} is not of the form {self._metavar}")
        return numbers[0] if len(numbers) == 1 else numbers


class WholeNumbers(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes none
    """Whole numbers separated by commas."""

    name = "numbers"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        """Split; the option class checks the range."""
        if not isinstance(value, str):
            return tuple(value)  # a default
        numbers = [whole_number(part) for part in value.split(",")]
        if None in numbers:
            self.fail(f"{value!r} is not a list of whole numbers such as 250,60", param, ctx)
        return tuple(number for number in numbers if number is not None)


class ViewParam(Numbers):
    """`az,el` or `az,el,dist`, in degrees and model units, or `turntable:N`, an int."""

    name = "view"

    def __init__(self) -> None:
        super().__init__("AZ,EL[,DIST]")

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Show the forms."""
        return f"{self._metavar}|turntable:N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse into two or three numbers, or the number of views of a turntable."""
        word, colon, count = str(value).partition(":")
        if not colon or word != "turntable":
            return super().convert(value, param, ctx)
        n_views = whole_number(count)
        if not n_views:
            self.fail(f"{value!r} has no number of views, as turntable:36 does", param, ctx)
        return n_views


class NameAndStrength(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes none
    """`twirl` or `twirl:120`: one of a few names, with or without a number."""

    name = "name"

    def __init__(self, known: Sequence[str]) -> None:
        self.known = tuple(known)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Show the names."""
        return f"{'|'.join(self.known)}[:STRENGTH]"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | tuple[str, float]:
        """Split at the colon; the option class checks the name."""
        name, colon, strength = str(value).partition(":")
        if not colon:
            return name
        try:
            return name, float(strength)
        except ValueError:
            self.fail(f"{value!r} has no number after the colon", param, ctx)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the name."""
        return [CompletionItem(name) for name in self.known if name.startswith(incomplete)]


class Names(click.ParamType):  # type: ignore[type-arg]  # click 8.1 takes none
    """Known names separated by commas."""

    name = "names"

    def __init__(self, known: Sequence[str]) -> None:
        self.known = tuple(known)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Show the form."""
        return "NAME,..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Split, and check each name."""
        if not isinstance(value, str):
            return tuple(value)
        names = tuple(dict.fromkeys(name.strip() for name in value.split(",") if name.strip()))
        unknown = [name for name in names if name not in self.known]
        if unknown or not names:
            wrong = ", ".join(unknown) or "nothing"
            self.fail(f"{wrong} is not one of {', '.join(self.known)}", param, ctx)
        return names

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the name after the last comma."""
        before, comma, start = incomplete.rpartition(",")
        names_before = before.split(",")
        return [
            CompletionItem(f"{before}{comma}{name}")
            for name in self.known
            if name.startswith(start) and name not in names_before
        ]


class FileOf(click.Path):
    """A file with one of some suffixes; the function that reads it reports a missing one."""

    def __init__(self, suffixes: Sequence[str]) -> None:
        super().__init__(path_type=Path)
        self.suffixes = tuple(suffixes)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete with files of these suffixes, and with folders."""
        folder, start = os.path.split(incomplete)
        try:
            with os.scandir(Path(folder or ".").expanduser()) as entries:
                found = [entry for entry in entries if entry.name.startswith(start)]
        except OSError:
            return []
        files = [entry.name for entry in found if entry.name.lower().endswith(self.suffixes)]
        if not files:
            return [CompletionItem(incomplete, type="file")]  # the shell completes folders
        folders = [entry.name + os.sep for entry in found if entry.is_dir()]
        hidden = () if start.startswith(".") else (".",)
        return [
            CompletionItem(str(Path(folder) / name) + name[len(name.rstrip(os.sep)) :])
            for name in sorted(files + folders)
            if not name.startswith(tuple(hidden))
        ]
