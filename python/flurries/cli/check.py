"""`flurries check`: compare frames with their folder's journal."""

import click

from flurries.cli.options import FILE, command, voice
from flurries.cli.words import Words, count, say
from flurries.output.journal import check as check_all

DIFFERENT = 3


@command("flurries check frames")
@click.argument("folder", metavar="FOLDER", type=FILE)
@voice
def check(words: Words, folder: str) -> int:
    """Compare the frames of a folder, or behind a url, with their journal, flurries.jsonl."""
    files, wrong = check_all(folder)
    for sentence in wrong:
        say(sentence)
    if wrong:
        return DIFFERENT
    words.say(f"{count(files, 'file')} {'is' if files == 1 else 'are'} what the journal says")
    return 0
