"""Options that commands share, and how each says what it does, its default and an example."""

import functools
import os
import re
import shlex
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from flurries._contract import suggestion
from flurries._threads import settings
from flurries.cli.words import Words

Function = TypeVar("Function", bound=Callable[..., Any])

# Options by what they are about, where a command has more than a few; the others come first.
_FEW = 20
GROUPS = {title: frozenset(f"--{name}" for name in names.split()) for title, names in {
    "More on the weather": "amount color density hide holdout loop method near place rate shutter "
    "split time wakes where",
    "Camera and picture": "camera center colorspace down extend eyes fly foreground lens linear "
    "camera-scale start",
    "Files": "alone bits codec compression damaged deep layers motion no-sound output-colorspace "
    "plate quality",
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
        groups = {} if len(rows) < _FEW else GROUPS
        first = set(rows).difference(*groups.values())
        for title, names in {"Options": first, **groups}.items():
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


def numbers(length: int, kind: type = float) -> Callable[[str], tuple[Any, ...]]:
    """Return a reader of so many numbers with commas, "1,0,0"; of any number of them with 0."""

    def read(text: str) -> tuple[Any, ...]:
        try:
            found = tuple(map(kind, text.split(",")))
        except ValueError:
            found = ()
        if not found or len(found) != (length or len(found)):
            like = f"{length} numbers like {','.join('10000'[:length])}"
            wanted = like if length else f"{'whole ' * (kind is int)}numbers like 3,12"
            raise click.BadParameter(f"wants {wanted}, got {text!r}")
        return found

    return read


def option(
    names: str, kind: Any, metavar: str | None, example: str | None, unset: str | None, help: str,
    **more: Any,
) -> Callable[[Function], Function]:  # fmt: skip
    """Return an option whose help says default and example."""
    # Of a type, one of a tuple of words, or so many numbers.
    usual = unset or more.get("default")
    notes = [] if usual is None else [f"default: {usual}"]
    notes += [] if example is None else [f"such as {names.split()[0]} {shlex.quote(example)}"]
    words = f"{help} [{'; '.join(notes)}]" if notes else help
    if isinstance(kind, (tuple, int)):
        kind = OneOf(kind) if isinstance(kind, tuple) else numbers(kind)
    return click.option(*names.split(), type=kind, metavar=metavar, help=words, **more)


def switch(names: str, help: str, **more: Any) -> Callable[[Function], Function]:
    return click.option(*names.split(), is_flag=True, help=help, **more)


class Bare(click.Option):
    """An option that may stand without its value; a word that is not like one belongs to others."""

    def __init__(
        self, *args: Any, pattern: str, words: Sequence[str] = (), metavar: str, **more: Any
    ) -> None:
        super().__init__(*args, metavar=f"[{metavar}]", **more)
        self.pattern, self.words = re.compile(pattern), words

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        return [CompletionItem(word) for word in self.words if word.startswith(incomplete)]


FILE = click.Path()


def join(*options: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Return one decorator of several, which the help has in this order."""

    def add(function: Function) -> Function:
        for each in reversed(options):
            function = each(function)
        return function

    return add


FRAMES = option(
    "--frames", str, "RANGE", "1-100x2", "all of a film or sequence; else 3 s, which is 1-90 at "
    "30 a second; of a still the first", "numbers of the frames to make",
)  # fmt: skip

OVERWRITE = switch(
    "--overwrite",
    "replace files that are there; without it what is the same stays, and another file is never "
    "replaced",
)


def dask(unset: str) -> Callable[[Function], Function]:
    return option("--dask", str, "ADDRESS", "tcp://host:8786", unset, "work on a Dask cluster: the "
                  "scheduler at an address, or without one a cluster made on this machine",
                  cls=Bare, pattern=r"\w+://.*|[\w.-]+:\d+")  # fmt: skip


def _set_threads(_: click.Context, __: click.Parameter, value: int | None) -> None:
    if value is not None:
        settings(threads=value)


def _set_mode(_: click.Context, __: click.Parameter, value: bool) -> None:
    if value:
        # Also of the workers that it may start.
        os.environ["FLURRIES_REPRODUCIBLE"] = "1"
        settings(reproducible=True)


THREADS = option("--threads", int, "N", "2", "all cores, or FLURRIES_NUM_THREADS",
                 "threads of a frame; the same pixels come out whatever their number",
                 expose_value=False, callback=_set_threads)  # fmt: skip

WORK = join(THREADS, switch("--reproducible", "the same bits on every processor, at some cost of "
                            "time", expose_value=False, callback=_set_mode))  # fmt: skip


def voice(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add --quiet and --verbose, and give the function `words`."""

    @functools.wraps(function)
    def run(*, quiet: bool, verbose: bool, **given: Any) -> Any:
        return function(words=Words(quiet, verbose), **given)

    return join(
        switch("-q --quiet", "no progress, only warnings and errors"),
        switch("-v --verbose", "also what a frame costs, and where in the code an error is"),
    )(run)
