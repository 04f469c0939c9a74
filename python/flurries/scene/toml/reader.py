"""From a TOML file to a scene: strict, and every refusal says where."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from flurries._contract import PathLike, naming, suggestion
from flurries.camera.importers import load as load_camera
from flurries.camera.lens import Camera
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath
from flurries.effects.kinds import class_of
from flurries.effects.notes import Body, Where
from flurries.io.files import file_of, read_text
from flurries.light.lamp import Lamp, Sun
from flurries.light.shot import Light
from flurries.motion.keys import Keys
from flurries.motion.wind import Wind
from flurries.scene.arguments import MOST_EFFECTS, require_few
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import Foreground
from flurries.scene.output import Output
from flurries.scene.scene import DEFAULT_FOCAL, Scene

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FORMAT = 3  # The number that files say, raised where an older file would mean something else.

SCENE = tuple(inspect.signature(Scene).parameters)
# Tables that are objects, by their keys.
PARTS: dict[str, Any] = {"sun": Sun, "light": Light, "lens": Lens, "output": Output}
DEPTH = tuple(f.name for f in fields(DepthMap))
LENS = tuple(f.name for f in fields(Camera))
WAY = ("position", "velocity", "orientation")

MOST_BYTES = 1 << 20

# The parser's time and memory grow with the square of a key's parts.
MOST_DOTS = 32
_LONG_KEY = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{MOST_DOTS + 1}}}"""
)


def load(path: PathLike) -> Scene:
    """Return the scene of a TOML file of at most 1 MiB; the message of an error names the line."""
    file = Path(path)
    text = read_text(file, MOST_BYTES, "TOML scene file")
    if long := _LONG_KEY.search(text):
        line = text.count("\n", 0, long.start()) + 1
        many = f"a key has at most {MOST_DOTS} dots, got {MOST_DOTS + 1} or more"
        raise ValueError(f"{file}, line {line}: {many}")
    # Also numbers of thousands of digits, and brackets nested as deep.
    with naming(f"{file}: not a TOML file", ValueError, RecursionError, then=ValueError):
        values = tomllib.loads(text)
    scene = SceneText(file, text)
    # A key that is no scene's is told first: it may be a mistyped "format".
    if "format" not in values and "colour" not in values:
        scene.table(values, (*SCENE, "format"), "the scene")
    version = values.pop("format", None)
    if type(version) is int and version == FORMAT:
        return _scene(scene, values)
    given = "none" if version is None else repr(version)[:60]
    raise ValueError(
        f"{scene.where('format')}: format must be {FORMAT}, got {given}: write format = {FORMAT} "
        "at the top, and in a file that had no format (version 0.1) the kinds tent_snow and "
        "tent_rain for snow and rain, and color for colour"
    )


def _scene(text: SceneText, values: dict[str, Any]) -> Scene:
    arguments = text.table(values, SCENE, "the scene")
    background = arguments.get("background")
    if isinstance(background, str) and not background.startswith("#"):
        arguments["background"] = text.file(background)
    if isinstance(arguments.get("foreground"), str):
        arguments["foreground"] = text.file(arguments["foreground"])
    elif "foreground" in arguments:
        arguments["foreground"] = [
            _part(text, {"source": one} if isinstance(one, str) else one, Foreground, "foreground",
                  "foreground", index, source=text.file, depth=partial(_depth, text))
            for index, one in enumerate(_tables(text, arguments["foreground"], "foreground"))
        ]  # fmt: skip
    if "depth" in arguments:
        arguments["depth"] = _depth(text, arguments["depth"], "depth")
    if arguments.get("lens") == "none":
        arguments["lens"] = None
    for name, kind in PARTS.items():
        given = arguments.get(name)
        if given is not None and not (name == "lens" and given == "usual"):
            arguments[name] = _part(text, given, kind, name, name)
    arguments["lights"] = [
        _part(text, one, Lamp, "a light", "lights", index)
        for index, one in enumerate(_tables(text, arguments.get("lights", []), "lights"))
    ]
    camera = arguments.pop("camera", None)
    listed = _tables(text, arguments.pop("effects", []), "effects")
    with text.errors(("effects",)):
        require_few("effects", listed, MOST_EFFECTS)
    effects = [_effect(text, table, index) for index, table in enumerate(listed)]
    with text.errors(SCENE):
        scene = Scene(**arguments, effects=effects)
    return scene if camera is None else scene.replace(camera=_camera(text, camera, scene))


def _tables(text: SceneText, value: Any, name: str) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError(f"{text.where(name)}: {name} must be [[{name}]] tables")
    return value


def _part(
    text: SceneText, table: Any, kind: Any, name: str, *at: str | int, more: Sequence[str] = (),
    **readers: Callable[..., Any],
) -> Any:  # fmt: skip
    """Return the object whose fields a table holds; `readers` of those that are files."""
    known = (*(f.name for f in fields(kind) if f.init), *more)
    given = text.table(table, tuple(one for one in known if one != "field"), name, *at)
    for f in fields(kind):
        if f.init and f.default is f.default_factory is MISSING and f.name not in given:
            raise ValueError(f"{text.where(*at)}: {name} needs {f.name}")
    read = {key: readers.get(key, partial(_value, text)) for key in given}
    values = {key: read[key](value, *at, key) for key, value in given.items()}
    with text.errors(given, *at):
        return kind(**values)


def _effect(text: SceneText, table: Any, index: int) -> Any:
    at = ("effects", index)
    if not isinstance(table, dict):
        raise TypeError(f"{text.where(*at)}: effects must be [[effects]] tables")
    kind = table.get("kind")
    with text.errors(("kind",), *at):
        effect = class_of(kind)
    given = {key: value for key, value in table.items() if key != "kind"}
    more = [*getattr(effect, "KNOBS", ()), *(["preset"] if hasattr(effect, "PRESETS") else [])]
    readers = {"where": partial(_where, text), "wakes": partial(_wakes, text)}
    readers["holdout"] = readers["where"]
    return _part(text, given, effect, f"effect {kind!r}", *at, more=more, **readers)


def _wakes(text: SceneText, value: Any, *at: str | int) -> list[Body]:
    return [_part(text, one, Body, "a wake", *at) for one in _tables(text, value, "wakes")]


def _where(text: SceneText, value: Any, *at: str | int) -> Any:
    if isinstance(value, str):
        return text.file(value)
    if isinstance(value, dict) and "keys" not in value:
        return _part(text, value, Where, "where", *at, source=partial(_where, text))
    return _value(text, value, *at)


def _depth(text: SceneText, value: Any, *at: str | int) -> Any:
    if isinstance(value, str):
        return text.file(value)
    if not isinstance(value, dict):
        return value
    return _part(text, value, DepthMap, "depth", *at, source=text.file)


def _camera(text: SceneText, table: Any, scene: Scene) -> CameraPath:
    if isinstance(table, str):
        table = {"path": table}
    given = text.table(table, (*LENS, "path", "down", "scale", *WAY, "extend"), "camera", "camera")
    values = {key: _value(text, value, "camera", key) for key, value in given.items()}
    _, _, width, height = scene._display
    lens: dict[str, Any] = {"focal": DEFAULT_FOCAL * width, "aspect": scene._backdrop.aspect}
    lens |= {key: values.pop(key) for key in LENS if key in values}
    if isinstance(lens["focal"], (Keys, tuple)):
        values["focal"], lens["focal"] = lens["focal"], 1.0
    if "path" not in values:
        for key in {"down", "scale"} & set(values):
            raise ValueError(f"{text.where('camera', key)}: {key} is for a path from a file")
        with text.errors(table, "camera"):
            return CameraPath(Camera(**lens), **values)
    name = values.pop("path")
    if not isinstance(name, str) or set(WAY) & set(values):
        raise ValueError(
            f"{text.where('camera', 'path')}: path must be a file, and stand without "
            + ", ".join(WAY)
        )
    of_file = {key: values.pop(key) for key in ("down", "scale") if key in values}
    with file_of("camera: path"), text.errors(table, "camera"):
        file = text.path.parent / name
        way = load_camera(file, (height, width), camera=Camera(**lens), **of_file)
        return replace(way, **values)


def _value(text: SceneText, value: Any, *keys: str | int) -> Any:
    if not isinstance(value, dict):
        return tuple(value) if isinstance(value, list) else value
    if keys[-1] == "wind" and "keys" not in value:
        return _part(text, value, Wind, "wind", *keys)
    if set(value) != {"keys"}:
        wanted = "a value or {keys = [[frame, value], ...]}"
        raise ValueError(f"{text.where(*keys)}: {keys[-1]} must be {wanted}")
    with text.errors((), *keys):
        return Keys(value["keys"])


# Where something stands, for the line in an error -----------------------------------------------


class SceneText:
    """The text of a scene file. Places in it are given by the keys that lead there from the top."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self._lines = _key_lines(text)

    def where(self, *keys: str | int) -> str:
        """Return the file, and the line of the last of the keys that has one."""
        for end in range(len(keys), 0, -1):
            line = self._lines.get(keys[:end])
            if line is not None:
                return f"{self.path}, line {line}"
        return str(self.path)

    def file(self, name: Any, *keys: str | int) -> str:
        """Return the path of a file that is named from the scene file's folder, or refuse it."""
        if not isinstance(name, str):
            raise TypeError(f"{self.where(*keys)}: source must be a file, got {name!r}")
        return str(self.path.parent / name)

    def table(
        self, value: Any, known: tuple[str, ...], name: str, *keys: str | int
    ) -> dict[str, Any]:
        """Return a copy of a table whose keys are all known, or refuse it."""
        if not isinstance(value, dict):
            raise TypeError(f"{self.where(*keys)}: {keys[0]} must be a table")
        for key in value:
            if key not in known:
                hint = suggestion(key, known) or f"; known are {', '.join(known)}"
                place = self.where(*keys, key)
                raise ValueError(f"{place}: unknown key {key[:60]!r} in {name}{hint}")
        return dict(value)

    @contextmanager
    def errors(self, known: Iterable[str], *keys: str | int) -> Iterator[None]:
        """Give an argument's error the line of the argument that its message names."""
        try:
            yield
        except (ValueError, TypeError) as error:
            text = str(error)
            if text.startswith(str(self.path)) or type(error) not in (ValueError, TypeError):
                raise
            named = [key for key in known if re.search(rf"\b{re.escape(key)}\b", text)]
            # The first word that is a key of this table: messages begin with the argument's name.
            named.sort(key=text.find)
            raise type(error)(f"{self.where(*keys, *named[:1])}: {text}") from None


_HEADER = re.compile(r"\s*\[(\[)?([^\]]+)\]")
_KEY = re.compile(r"\s*(?:\"([^\"]*)\"|'([^']*)'|([A-Za-z0-9_-]+))\s*(?=[=.])")


def _key_lines(text: str) -> dict[tuple[str | int, ...], int]:
    """Return the lines of keys and tables of a scene file by their way from the top."""
    lines: dict[tuple[str | int, ...], int] = {}
    table: tuple[str | int, ...] = ()
    counts: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            name = header[2].strip().strip("\"'")
            table = (name,)
            if header[1]:
                counts[name] = counts.get(name, -1) + 1
                table = (name, counts[name])
            lines.setdefault((name,), number)
            lines[table] = number
        elif key := _KEY.match(line):
            lines.setdefault((*table, key[1] or key[2] or key[3]), number)
    return lines
