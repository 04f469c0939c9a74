"""Options that commands share, and how each says what it does, its default and an example."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import click

from flurries._contract import suggestion
from flurries._threads import settings
from flurries.cli.words import Words

Function = TypeVar("Function", bound=Callable[..., Any])


# Options by what they are about, where a command has more than a few; the others come first.
_FEW = 20
GROUPS = {title: frozenset(f"--{name}" for name in names.split()) for title, names in {
    "More on the weather": "amount color density loop method near rate shutter",
    "Camera and picture": "camera center colorspace down extend eyes fly foreground lens linear "
    "camera-scale start",
    "Files": "alone bits codec compression damaged deep layers motion no-sound output-colorspace "
    "quality",
    "Work": "dask dask-patience quiet reproducible threads verbose",
}.items()}  # fmt: skip


class OneOf(click.Choice):  # type: ignore[type-arg]  # not generic in click 8.1
    """A word out of some; the refusal of another one suggests the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            text = error.message.rstrip(".") + suggestion(str(value), self.choices)
            raise click.BadParameter(text, ctx, param) from None


class Command(click.Command):
    """A command with examples, some of whose options may stand without their value."""

    def __init__(self, *args: Any, examples: Sequence[str] = (), **more: Any) -> None:
        super().__init__(*args, **more)
        self.examples = tuple(examples)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Part an option that stands without its value from a word that is none."""
        bare = {one.opts[0]: one.pattern for one in self.params if isinstance(one, Bare)}
        for name in bare:
            if sum(word.partition("=")[0] == name for word in args) > 1:
                twice = f"{name} is given twice, and one would replace the other"
                raise click.UsageError(twice, ctx)
        joined = [
            f"{word}=" if word in bare and not bare[word].fullmatch(after) else word
            for word, after in zip(args, [*args, ""][1:], strict=True)
        ]
        return super().parse_args(ctx, joined)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write what most people use first, and the rest by what it is about."""
        rows = {one.opts[-1]: one.get_help_record(ctx) for one in self.get_params(ctx)}
        first = (
            set(rows) if len(rows) < _FEW else set(rows) - {n for g in GROUPS.values() for n in g}
        )
        groups = {"Options": first, **({} if len(rows) < _FEW else GROUPS)}
        for title, names in groups.items():
            if said := [row for name, row in rows.items() if row and name in names]:
                with formatter.section(title):
                    formatter.write_dl(said)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Examples"):
            for line in self.examples:
                formatter.write(f"{'':{formatter.current_indent}}{line}\n")


def command(*examples: str) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a command of a function; its docstring is the help."""
    settings = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
    return click.command(cls=Command, examples=examples, context_settings=settings)


def option(
    *names: str, help: str, example: str | None = None, unset: str | None = None, **more: Any
) -> Callable[[Function], Function]:
    notes = []
    usual = unset if unset is not None else more.get("default")
    if usual is not None:
        notes.append(f"default: {usual}")
    if example is not None:
        notes.append(f"such as {names[0]} {shlex.quote(example)}")
    return click.option(*names, help=f"{help} [{'; '.join(notes)}]" if notes else help, **more)


def offer(words: Iterable[str]) -> Callable[[Any, Any, str], list[str]]:
    """Return a function that completes the start of one of some words in a shell."""
    return lambda context, option, start: [word for word in words if word.startswith(start)]


class Bare(click.Option):
    """An option that may stand without its value; a word that is not like one belongs to others."""

    def __init__(
        self, *args: Any, pattern: str, words: Sequence[str] = (), metavar: str, **more: Any
    ) -> None:
        super().__init__(*args, metavar=f"[{metavar}]", shell_complete=offer(words), **more)
        self.pattern = re.compile(pattern)


def numbers(length: int) -> Callable[[str], tuple[float, ...]]:
    """Return a reader of several numbers with commas: "1,0,0"."""

    def read(text: str) -> tuple[float, ...]:
        try:
            found = tuple(float(part) for part in text.split(","))
        except ValueError:
            found = ()
        if len(found) != length:
            wanted = ",".join("100"[:length])
            raise click.BadParameter(f"wants {length} numbers like {wanted}, got {text!r}")
        return found

    return read


FILE = click.Path()


def weather_options(presets: Mapping[str, Sequence[str]]) -> Iterator[Callable[[Any], Any]]:
    """Yield an option for each kind of weather."""
    for name, known in presets.items():
        yield option(
            f"--{name}", cls=Bare, pattern=r"\w[\w -]*", words=known, metavar="PRESET",
            unset="none", example=known[-1], help=f"{name}: {', '.join(known)}; "
            "alone the usual look, or that of --severity or --rate",
        )  # fmt: skip


def join(*options: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Return one decorator of several, which the help has in this order."""

    def add(function: Function) -> Function:
        for each in reversed(options):
            function = each(function)
        return function

    return add


FRAMES = option(
    "--frames", metavar="RANGE", example="1-100x2",
    help="numbers of the frames to make",
    unset="all of a film or sequence; else 3 s, which is 1-90 at 30 a second; of a still the first",
)  # fmt: skip

OVERWRITE = option(
    "--overwrite", is_flag=True,
    help="replace files that are there; without it what is there and is the same stays, and "
    "another file is never replaced",
)  # fmt: skip


def dask(unset: str) -> Callable[[Function], Function]:
    return option(
        "--dask", cls=Bare, pattern=r"\w+://.*|[\w.-]+:\d+", metavar="ADDRESS", unset=unset,
        help="work on a Dask cluster: the scheduler at an address, or without one a cluster made "
        "on this machine", example="tcp://host:8786",
    )  # fmt: skip


def _apply(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    """Set what holds for all work, and for the workers that it may start."""
    if param.name == "threads" and value is not None:
        settings(threads=value)
    elif param.name == "reproducible" and value:
        os.environ["FLURRIES_REPRODUCIBLE"] = "1"
        settings(reproducible=True)


THREADS = option(
    "--threads", type=int, metavar="N", expose_value=False, callback=_apply,
    unset="all cores, or FLURRIES_NUM_THREADS", example="2", help="threads of a frame; the same "
    "pixels come out whatever their number",
)  # fmt: skip

REPRODUCIBLE = option(
    "--reproducible", is_flag=True, expose_value=False, callback=_apply,
    help="the same bits on every processor, at some cost of time",
)  # fmt: skip


WORK = join(THREADS, REPRODUCIBLE)


def voice(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --quiet and --verbose, and give the function `words`."""

    def run(*, quiet: bool, verbose: bool, **given: Any) -> Any:
        return function(words=Words(quiet, verbose), **given)

    run.__doc__, run.__name__ = function.__doc__, function.__name__
    run.__dict__.update(function.__dict__)
    return join(
        option("-q", "--quiet", is_flag=True, help="no progress, only warnings and errors"),
        option("-v", "--verbose", is_flag=True,
               help="also what a frame costs, and where in the code an error is"),
    )(run)  # fmt: skip
