"""Take new hashes of the frames that must not change unnoticed: `make hashes`.

A scene whose frames have changed gets the next number, and the changelog needs a line for it.
"""

import json
from pathlib import Path

import flurries as fl
from same_bits import of_scenes

FILE = Path(__file__).parent / "frames" / "hashes.json"


def main() -> None:
    fl.settings(reproducible=True)
    kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    for name, found in of_scenes().items():
        before = kept.get(name, {"sha256": found, "number": 1})
        if before["sha256"] != found:
            before = {"sha256": found, "number": before["number"] + 1}
            print(f"CHANGELOG.md wants: Frames of `{name}` change ({before['number']}): why.")
        kept[name] = before
    FILE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
