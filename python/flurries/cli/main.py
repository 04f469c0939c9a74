"""The entry: finds the command, runs it, and turns what goes wrong into one sentence."""

import atexit
import gc
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

import click
from click.shell_completion import get_completion_class, shell_complete

from flurries import __version__
from flurries._contract import suggestion
from flurries.cli.options import OneOf, command
from flurries.cli.words import plain_warnings, say

DEFECT, MISTAKE, INTERRUPTED, CLOSED_PIPE = 1, 2, 130, 141

# Each command is a function of its name, whose file is imported when it is asked for.
COMMANDS = {
    "render": "weather over a picture, a film or a scene, to files",
    "plan": "what rendering takes: steps, times, memory, and what is left out",
    "light": "the light of a shot, to print and to save in its scene file",
    "match": "a scene out of falling snow in a film",
    "view": "a scene in the browser, with sliders",
    "demo": "snow on a photograph: films, stills, an EXR",
    "texture": "snow that repeats in x, y and time, for a game engine",
    "corrupt": "a folder of pictures in weather, for a data set",
    "benchmark": "a data set in all weathers, and a model's scores on it",
    "check": "compare frames with their folder's flurries.jsonl",
    "completion": "the shell's completion: bash, zsh or fish",
}

# The files of those that have none of their name.
FILES = {"plan": "look", "light": "look", "view": "look", "benchmark": "corrupt",
         "completion": "main", "check": "render", "texture": "render"}  # fmt: skip

COMPLETE = "_FLURRIES_COMPLETE"  # Where a shell leaves the line that it wants completed.


class Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        file = importlib.import_module(f"flurries.cli.{FILES.get(name, name)}")
        found: click.Command = getattr(file, name)
        return found

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not ctx.resilient_parsing and (not args or args[0] == "help"):
            # `flurries`, `flurries help` and `flurries help render`.
            args = [*args[1:], "--help"]
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            found = f"got {args[0]!r}{suggestion(args[0], COMMANDS)}"
            raise click.UsageError(f"COMMAND must be one of {', '.join(COMMANDS)}, {found}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=Commands,
    no_args_is_help=False,
    subcommand_metavar="COMMAND [OPTIONS]",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="`flurries COMMAND --help` has examples. Exit codes: 0; 2 for a mistake or a file that "
    "cannot be used; 3 where frames were skipped or differ from their journal; 130 after Ctrl-C; "
    "1 for a defect of flurries.",
)
@click.version_option(__version__, "-V", "--version", message="flurries %(version)s")
def commands() -> None:
    """Falling snow, rain and mist for pictures and film."""


@command(
    'eval "$(flurries completion bash)"    # in ~/.bashrc',
    'eval "$(flurries completion zsh)"     # in ~/.zshrc',
    "flurries completion fish > ~/.config/fish/completions/flurries.fish",
)
@click.argument("shell", type=OneOf(("bash", "zsh", "fish")))
def completion(shell: str) -> None:
    """Print the script that teaches a shell to complete flurries."""
    kind = get_completion_class(shell)
    assert kind is not None
    print(kind(commands, {}, "flurries", COMPLETE).source())


def program() -> None:
    """Run the command line and end its process: the system frees memory faster than Python."""
    # What is imported stays: looking through it for garbage takes a tenth of a first picture.
    gc.set_threshold(100_000)
    code = main()
    try:
        sys.stdout.flush()
    except OSError:
        code = code or 1
    atexit._run_exitfuncs()
    os._exit(code)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, of some words in place of sys.argv[1:], and return its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        # As Ctrl-C does: what is half done is removed. Under nohup a hangup is no end.
        for number in {signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}:
            if signal.getsignal(number) == signal.SIG_DFL:
                signal.signal(number, lambda number, _: sys.exit(128 + number))
    try:
        if arguments is None and COMPLETE in os.environ:
            return shell_complete(commands, {}, "flurries", COMPLETE, os.environ[COMPLETE])
        with plain_warnings(), commands.make_context("flurries", given) as context:
            code: int = commands.invoke(context) or 0
        # What cannot be written is to fail here, and not when Python ends.
        sys.stdout.flush()
        return code
    except click.exceptions.Exit as done:
        return done.exit_code
    except BrokenPipeError:
        # Let Python end in peace where the reader of stdout has gone, as `head` does.
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        return CLOSED_PIPE
    except KeyboardInterrupt:
        goes_on = given[:1] in (["render"], ["corrupt"], ["benchmark"])
        say("stopped; what is finished stays, run again to go on" if goes_on else "stopped")
        return INTERRUPTED
    except Exception as error:
        if {"-v", "--verbose"} & set(given):
            traceback.print_exc()
        return explain(error)


def explain(error: Exception) -> int:
    """Say an error in one sentence, and return the exit code."""
    # The library's own refusals are sentences that name the argument or the file.
    words, name, code = str(error), type(error).__name__, MISTAKE
    if isinstance(error, click.UsageError):
        context = error.ctx.command_path if error.ctx else "flurries"
        words = f"{error.format_message().rstrip('.')} (see {context} --help)"
    elif isinstance(error, OSError) and error.filename is not None and error.strerror:
        words = f"{error.filename}: {error.strerror}"
    elif not isinstance(error, (ValueError, TypeError, OSError, MemoryError, ImportError)):
        words, code = f"{name}: {error} (a defect of flurries; --verbose says where)", DEFECT
    say(words or name)
    return code
