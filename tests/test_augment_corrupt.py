"""Sets of corrupted pictures: one set however it is made, gone on from, and never half made."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from skimage import data

import flurries as fl
from flurries.augment.corrupt import corrupt
from flurries.cli import main
from flurries.io import linear_to_srgb, read_picture, srgb_to_linear, write_picture
from flurries.io.stores import Store
from flurries.output.journal import NAME, Journal, check
from test_nothing_wrong import contents as everything


def pictures(folder: Path, count: int = 5, size: int = 96) -> Path:
    (folder / "below").mkdir(parents=True)
    for number in range(count):
        part = data.astronaut()[number * 20 :][:size, :size]
        write_picture(folder / f"{number}.png", part)
    write_picture(folder / "below" / "photo.jpg", data.coffee()[:size, :size])
    write_picture(folder / "below" / "light.exr", data.coffee()[:size, :size] / np.float32(255))
    (folder / "notes.txt").write_text("no picture")
    return folder


CARD = ("README.md", "metadata.jsonl")


def contents(folder: Path) -> dict[str, bytes]:
    return {name: data for name, data in everything(folder).items() if name not in CARD}


def lines(folder: Path) -> dict[str, Any]:
    return Journal(Store(), folder).last()


@pytest.fixture
def source(tmp_path: Path) -> Path:
    return pictures(tmp_path / "in")


def test_what_is_made(source: Path, tmp_path: Path):
    before = contents(source)
    out = tmp_path / "out"
    made = corrupt(source, out, weather=["snow", "fog"], severity=(1, 4), seed=3, workers=1)
    assert len(made.written) == 7 * 2 * 2 and made.kept == [] and made.failed == {}
    assert contents(source) == before
    names = {path.relative_to(out).as_posix() for path in made.written}
    assert {"snow/1/0.png", "fog/4/below/photo.jpg", "snow/4/below/light.exr"} <= names
    copies = {path.relative_to(out).as_posix() for path in made.copied}
    assert copies == {f"{kind}/{level}/notes.txt" for kind in ("snow", "fog") for level in (1, 4)}
    assert all((out / name).read_text() == "no picture" for name in copies)
    assert set(lines(out)) == names | copies and check(out)[1] == []
    # What the journal says of a picture is what it is.
    entry = lines(out)["snow/4/2.png"]
    want = fl.augment.replay(entry["record"])(read_picture(source / "2.png").pixels)
    assert np.array_equal(read_picture(out / "snow/4/2.png").pixels, want)
    assert (entry["severity"], entry["source"], entry["record"]["amount"]) == (4, "2.png", 0.8)
    assert entry["sha256"] == hashlib.sha256(contents(out)["snow/4/2.png"]).hexdigest()
    # Linear light went through display values and back.
    light = read_picture(out / "fog/4/below/light.exr").pixels
    assert light.dtype == np.float32 and 0.0 < light.mean() < 1.0


def test_one_set_whatever_the_workers(source: Path, tmp_path: Path):
    sets = {}
    for name, arguments in {
        "1": {"workers": 1}, "3": {"workers": 3}, "dask": {"workers": 1, "dask": ""},
    }.items():  # fmt: skip
        made = corrupt(source, tmp_path / name, severity="2-3", seed=1, **arguments)
        assert len(made.written) == 14
        sets[name] = contents(tmp_path / name)
    assert sets["1"] == sets["3"] == sets["dask"]
    # No duplicates: each picture its own weather.
    said = [entry for entry in lines(tmp_path / "1").values() if "record" in entry]
    assert len({entry["record"]["weather_seed"] for entry in said}) == 14
    assert [path.name for path in (tmp_path / "3").glob("flurries*")] == [NAME]


def test_a_picture_is_the_same_in_another_folder(source: Path, tmp_path: Path):
    corrupt(source, tmp_path / "all", severity=2, workers=1)
    for name in ("0.png", "3.png"):
        (source / name).unlink()
    corrupt(source, tmp_path / "less", severity=2, workers=1)
    less, whole = contents(tmp_path / "less"), contents(tmp_path / "all")
    assert less.items() <= whole.items()


def test_it_goes_on(source: Path, tmp_path: Path):
    out = tmp_path / "out"
    corrupt(source, out, severity=(1, 2), workers=1)
    want = contents(out)
    for name in ("snow/1/1.png", "snow/2/2.png"):
        (out / name).unlink()
    made = corrupt(source, out, severity=(1, 2, 3), workers=1)
    assert {p.relative_to(out).as_posix() for p in made.written} == {
        "snow/1/1.png", "snow/2/2.png",
        *(f"snow/3/{n}" for n in ("0.png", "1.png", "2.png", "3.png", "4.png",
                                  "below/photo.jpg", "below/light.exr")),
    }  # fmt: skip
    found = contents(out)
    assert found["snow/1/1.png"] == want["snow/1/1.png"]
    assert found["snow/2/2.png"] == want["snow/2/2.png"]
    assert corrupt(source, out, severity=(1, 2, 3), workers=1).written == []
    # The card and the table are of all runs; a card of somebody's own stays.
    table = [json.loads(line) for line in (out / "metadata.jsonl").read_text().splitlines()]
    assert {row["file_name"] for row in table} == {name for name in found if "notes" not in name}
    assert all(row["severity"] == int(row["file_name"].split("/")[1]) for row in table)
    card = (out / "README.md").read_text()
    assert "| `snow/3` | snow | 3 | natural | 2.5 mm/h, 278.6 per" in card
    (out / "README.md").write_text("mine")
    write_picture(source / "3.png", data.coffee()[:96, :96])
    with pytest.raises(ValueError, match=r"snow/1/3\.png .* was made over other pictures"):
        corrupt(source, out, severity=(1, 2, 3), workers=1)
    assert contents(out) == found
    assert len(corrupt(source, out, severity=1, workers=1, overwrite=True).written) == 7
    assert (out / "README.md").read_text() == "mine"


def test_bad_folders_are_refused(source: Path, tmp_path: Path):
    with pytest.raises(ValueError, match="out must not be inside"):
        corrupt(source, source / "out", workers=1)
    with pytest.raises(ValueError, match="severity"):
        corrupt(source, tmp_path / "never", severity=0)
    assert not (tmp_path / "never").exists()
    with pytest.raises(NotADirectoryError):
        corrupt(source / "0.png", tmp_path / "out", workers=1)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="no pictures"):
        corrupt(tmp_path / "empty", tmp_path / "out", workers=1)
    corrupt(source, tmp_path / "out", severity=1, seed=1, workers=1)
    for other in ({"seed": 2}, {"seed": 1, "profile": "hard"}):
        with pytest.raises(ValueError, match=r"is of another scene.*; overwrite"):
            corrupt(source, tmp_path / "out", severity=1, workers=1, **other)  # type: ignore[arg-type]
    (tmp_path / "out" / NAME).write_text("[1, 2]")
    with pytest.raises(ValueError, match="no journal"):
        corrupt(source, tmp_path / "out", severity=1, seed=1, workers=1)


def test_the_command(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "out"
    line = ["corrupt", str(source), str(out), "--weather", "rain", "--severity", "2"]
    assert main([*line, "--workers", "1"]) == 0
    words = capsys.readouterr()
    assert words.out.strip() == str(out / NAME) and "7 pictures written" in words.err
    assert main([*line, "--workers", "1"]) == 0
    assert "7 were there already" in capsys.readouterr().err
    assert main([*line, "--dry-run", "--depths", "in:depth"]) == 0
    assert "1 file: .jpg in weather" in capsys.readouterr().err
    assert main([*line, "--severity", "9"]) == 2
    assert "severity" in capsys.readouterr().err
    (source / "bad.png").write_bytes(b"nonsense")
    assert main([*line, "--workers", "1"]) == 2
    assert "bad.png" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.exr"])
def test_16_7_alpha_is_kept_and_weather_falls_on_the_color(name: str, tmp_path: Path):
    random = np.random.default_rng(4)
    light = random.random((40, 60, 4)).astype(np.float32)
    light[:, :20, 3], light[:, 20:30, 3] = 1.0, 0.0
    if name == "a.exr":
        light[..., :3] *= light[..., 3:]
        plate = light
    else:
        plate = np.rint(255.0 * light).astype(np.uint8)
    (tmp_path / "in").mkdir()
    write_picture(tmp_path / "in" / name, plate, half=False)
    corrupt(tmp_path / "in", tmp_path / "out", weather="fog", severity=5, workers=1)
    found = read_picture(tmp_path / "out" / "fog" / "5" / name)
    before = read_picture(tmp_path / "in" / name)
    assert found.alpha is not None and before.alpha is not None
    # A set's EXR is half.
    kept = before.alpha.astype(np.float16) if name == "a.exr" else before.alpha
    assert np.array_equal(found.alpha, kept)
    assert found.premultiplied == before.premultiplied == (name == "a.exr")
    # The judge: fog of an opaque picture of the same straight colors, which depend on no alpha.
    fog = fl.augment.replay(lines(tmp_path / "out")[f"fog/5/{name}"]["record"])
    if before.premultiplied:
        cover = before.alpha[..., None]
        bare = np.divide(before.pixels, cover, out=np.zeros_like(before.pixels), where=cover > 0)
        wanted = cover * srgb_to_linear(fog(linear_to_srgb(bare)))
        np.testing.assert_allclose(found.pixels, wanted, rtol=2e-3, atol=1e-6)
    else:
        assert np.array_equal(found.pixels, fog(before.pixels))
    assert not np.array_equal(found.pixels, before.pixels)


def test_webp_bmp_and_gif_are_read_and_what_is_left_out_is_counted(tmp_path: Path):
    """Palettes, alpha and grey come through; what moves, or is no picture, is counted with why."""
    source = tmp_path / "in"
    source.mkdir()
    picture = Image.fromarray(data.astronaut()[:48, :64])
    clear = picture.copy()
    clear.putalpha(Image.fromarray(np.arange(48 * 64, dtype=np.uint16).reshape(48, 64) // 12 % 256)
                   .convert("L"))  # fmt: skip
    clear.save(source / "a.webp", lossless=True, exact=True)
    picture.save(source / "b.bmp")
    picture.convert("P").save(source / "c.gif")
    picture.convert("P").save(source / "palette.png")
    Image.fromarray(np.full((48, 64), 2000, np.uint16)).save(source / "depth.png")
    frames = [picture.convert("P"), picture.rotate(90).convert("P")]
    frames[0].save(source / "film.gif", save_all=True, append_images=frames[1:])
    picture.save(source / "b.png")
    (source / "list.csv").write_text("")
    (source / ".hidden.png").write_text("")
    (source / "broken.webp").write_bytes(b"no picture")
    made = corrupt(source, tmp_path / "out", severity="2,4", workers=1)
    names = {path.relative_to(tmp_path / "out").as_posix() for path in made.written}
    assert names == {f"snow/{s}/{n}.png" for s in (2, 4) for n in ("a", "b", "c")}
    assert made.skipped == {"hidden": 1} and made.layout == "plain"
    assert made.found == {
        ".gif in weather": 1, ".png in weather": 1, ".webp in weather": 2,
        ".csv: copied": 1, ".gif that moves: render it as a film: copied": 1,
        "another picture has its name: copied": 1,
        ".png of numbers, such as a mask or a depth: copied": 2,
    }  # fmt: skip
    assert set(made.failed) == {"broken.webp"}
    files = lines(tmp_path / "out")
    for name, given in {"a": clear, "c": picture.convert("P")}.items():
        entry = files[f"snow/4/{name}.png"]
        pixels = np.asarray(given.convert("RGBA"))
        seen = np.asarray(Image.open(tmp_path / "out" / "snow" / "4" / f"{name}.png"))
        want = fl.augment.replay(entry["record"])(np.ascontiguousarray(pixels[..., :3]))
        assert np.array_equal(seen[..., :3], want)
        if name == "a":
            assert np.array_equal(seen[..., 3], pixels[..., 3])
    again = corrupt(source, tmp_path / "out", severity="2,4", workers=1)
    assert again.written == [] and len(again.kept) == 6
