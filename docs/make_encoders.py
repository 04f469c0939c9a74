"""Measure the encoders of films on snow, rain and mist, and write docs/internals/encoders.md.

python docs/make_encoders.py

Sixteen frames of 1920 x 1080 px are encoded by every setting that ships, and by others of the same
library, in one thread. Crops of one frame lie side by side in docs/images/encoders.jpg.
"""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
from skimage.metrics import structural_similarity

import flurries as fl
from flurries.io.films.codecs import CODECS, QUALITIES, encoder_for

DOCS = Path(__file__).parent
SIZE, FRAMES = (1920, 1080), 16
CROP = np.s_[300:420, 900:1010]
SUFFIXES = {"h264": ".mp4", "h265": ".mp4", "vp9": ".webm"}
FILMS = {
    "snow": [fl.Snow("heavy")], "rain": [fl.Rain("downpour")],
    "mist": [fl.Mist("fog"), fl.Snow("light")],
}  # fmt: skip

# What else was tried, over snow.
OTHERS = [
    ("h264", {"preset": "fast", "crf": "16"}),
    ("h264", {"preset": "veryfast", "crf": "15"}),
    ("h264", {"preset": "superfast", "crf": "18"}),
    ("h264", {"preset": "fast", "crf": "21"}),
    ("h264", {"preset": "ultrafast", "crf": "17"}),
    ("h265", {"preset": "medium", "crf": "18"}),
    ("h265", {"preset": "medium", "crf": "24"}),
    ("vp9", {"deadline": "good", "cpu-used": "2", "crf": "18"}),
    ("vp9", {"deadline": "realtime", "cpu-used": "6", "crf": "17"}),
    ("vp9", {"deadline": "good", "cpu-used": "4", "crf": "28"}),
    ("vp9", {"deadline": "good", "cpu-used": "6", "crf": "38"}),
]

HEAD = """# Encoders of films: size, time and quality

`python docs/make_encoders.py` writes this page: 16 frames of {} x {} px, one thread. ms is the
processor's time for a frame, of this machine under whatever load it had: compare rows. PSNR and
SSIM are of the luminance.

![A frame as it is, then by each setting, three times enlarged](../images/encoders.jpg)

Snow, rain, mist; from the left: the frame, then H.264, H.265 and VP9, each high, medium, draft.
"""


def encoded(frames: list[Any], library: str, options: dict[str, str], file: str) -> tuple[Any, ...]:
    """Return kilobytes and ms a frame, PSNR, SSIM, and the frame that is shown."""
    stored, planes = io.BytesIO(), [f.reformat(format="yuv420p") for f in frames]
    with av.open(stored, "w", format=file) as out:
        stream = out.add_stream(library, rate=30, options=options)
        stream.width, stream.height = SIZE
        stream.pix_fmt, stream.codec_context.thread_count = "yuv420p", 1
        began = time.process_time()
        packets = [packet for number, plane in enumerate(planes)
                   for packet in stream.encode(_numbered(plane, number))]  # fmt: skip
        packets += stream.encode()
        spent = time.process_time() - began
        for packet in packets:
            out.mux(packet)
    with av.open(io.BytesIO(stored.getvalue())) as again:
        seen = list(again.decode(video=0))
    pairs = [[p.to_ndarray()[: SIZE[1]].astype(float) for p in pair]
             for pair in zip(seen, planes, strict=True)]  # fmt: skip
    error = np.mean([((a - b) ** 2).mean() for a, b in pairs])
    middle = FRAMES // 2
    return (
        len(stored.getvalue()) / FRAMES / 1e3, 1e3 * spent / FRAMES,
        10 * np.log10(255.0**2 / error), structural_similarity(*pairs[middle], data_range=255),
        seen[middle].to_ndarray(format="rgb24"),
    )  # fmt: skip


def _numbered(plane: Any, number: int) -> Any:
    plane.pts = number
    return plane


def settings() -> Iterator[tuple[str, str, dict[str, str], str]]:
    """Yield each setting that ships: its name, its library, its options and its kind of file."""
    for codec, suffix in SUFFIXES.items():
        for quality in QUALITIES:
            options = encoder_for(suffix, quality, SIZE, codec).options
            yield f"{codec}, {quality}", CODECS[codec].library, options, suffix[1:]


def row(name: str, options: dict[str, str], found: tuple[Any, ...]) -> str:
    kilobytes, spent, ratio, alike, _ = found
    shown = options.get("preset") or f"{options['deadline']}, cpu-used {options['cpu-used']}"
    return (
        f"| {name} | {shown}, crf {options['crf']} | {kilobytes:.0f} | {spent:.0f} | "
        f"{ratio:.1f} | {alike:.3f} |"
    )


def main() -> None:
    """Write the page and its picture."""
    plate, lines, strips = fl.io.photograph("rocket", size=SIZE), [HEAD.format(*SIZE)], []
    for kind, effects in FILMS.items():
        scene = fl.Scene(plate, effects=effects, fps=30)
        pictures = [scene.render(t) for t in range(FRAMES)]
        frames = [av.VideoFrame.from_ndarray(picture, format="rgb24") for picture in pictures]
        crops = [pictures[FRAMES // 2][CROP]]
        titles = "| | preset | KB a frame | ms a frame | PSNR, dB | SSIM |"
        lines += [f"## {kind.capitalize()}", titles, "| --- | --- | --- | --- | --- | --- |"]
        for name, library, options, file in settings():
            found = encoded(frames, library, options, file)
            lines.append(row(name, options, found))
            crops.append(found[-1][CROP])
        for codec, given in OTHERS if kind == "snow" else ():
            options, library = CODECS[codec].options | given, CODECS[codec].library
            found = encoded(frames, library, options, SUFFIXES[codec][1:])
            lines.append(row(f"{codec}, tried", options, found))
        lines.append("")
        strips.append(np.hstack([np.kron(crop, np.ones((3, 3, 1), np.uint8)) for crop in crops]))
        print(kind, flush=True)
    fl.io.write_picture(DOCS / "images" / "encoders.jpg", np.vstack(strips), quality=92)
    page = DOCS / "internals" / "encoders.md"
    page.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
