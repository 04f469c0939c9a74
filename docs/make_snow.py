"""Pack the README's film, docs/images/snow.webp, from frames that `flurries render` has made.

python examples/street.py
flurries render examples/street.toml --frames 0-47 -o street/%04d.png
python docs/make_snow.py street
"""

import sys
from pathlib import Path

from PIL import Image

FILE = Path(__file__).parent / "images" / "snow.webp"


def main(folder: Path) -> None:
    pages = [Image.open(file) for file in sorted(folder.glob("*.png"))]
    rest = {"save_all": True, "append_images": pages[1:], "duration": 1000 // 24, "loop": 0}
    pages[0].save(FILE, quality=80, method=4, **rest)
    print(FILE, FILE.stat().st_size)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
