"""The pictures of docs/langer2004.md, by the code that stands on the page.

python docs/make_langer2004.py
"""

import os
import re
from pathlib import Path

import matplotlib

PAGE = Path(__file__).with_name("langer2004.md")


def main() -> None:
    """Run the page's blocks in the folder of its pictures."""
    matplotlib.use("Agg")
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    os.chdir(PAGE.with_name("images"))
    exec("".join(blocks), {"__name__": "page"})


if __name__ == "__main__":
    main()
