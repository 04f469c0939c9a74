"""`flurries completion`: what a shell needs to complete commands, options, presets and files."""

import click
from click.shell_completion import get_completion_class

from flurries.cli.main import COMPLETE, commands
from flurries.cli.options import OneOf, command


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
