"""The page on the command line: what `--help` says of every command."""

from __future__ import annotations

from pathlib import Path

import click

from flurries.cli.main import COMMANDS, commands

HEAD = """# Commands

`flurries --help` lists the commands and `flurries COMMAND --help` says what stands here. Words go to stderr, names of files and
other data to stdout. `-q` says nothing but warnings and errors, `-v` says more. Completion for a shell:
`eval "$(flurries completion bash)"`.

Exit codes: 0; 2 for a mistake or a file that cannot be used; 3 where frames were skipped or differ from their journal;
130 after Ctrl-C; 1 for a defect of flurries.
"""


def write(folder: Path) -> None:
    """Write the page."""
    root = click.Context(commands, info_name="flurries")
    parts = [HEAD]
    for name in COMMANDS:
        command = commands.get_command(root, name)
        assert command is not None
        context = click.Context(command, info_name=name, parent=root, **command.context_settings)
        context.terminal_width = 96
        parts.append(f"## flurries {name}\n\n```text\n{command.get_help(context)}\n```\n")
    (folder / "commands.md").write_text("\n".join(parts), encoding="utf-8")
    (folder / "variables.md").write_text(VARIABLES, encoding="utf-8")


VARIABLES = """# Variables

Variables of the environment, read when `flurries` is imported or when they are first needed.

| variable | what | usual |
| --- | --- | --- |
| `FLURRIES_NUM_THREADS` | threads of a frame, 1 to 256; `fl.set_threads` and `--threads` come before it | all cores |
| `FLURRIES_REPRODUCIBLE` | `1`: the same bits on every processor, as `fl.settings(reproducible=True)` and `--reproducible` | `0` |
| `FLURRIES_SIMD` | the vector instructions that kernels use at most: `avx512`, `avx2`, `portable` | what the processor has |
| `FLURRIES_MAX_PIXELS` | how many pixels a picture that is read may have | see `fl.io.Budget` |
| `FLURRIES_MAX_BYTES` | how much memory it may take | see `fl.io.Budget` |
"""
