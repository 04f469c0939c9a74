"""Weather in a shot of Blender: plate, depth and camera out of the .blend, snow back as layers.

    blender shot.blend --background --python examples/blender.py -- --snow heavy

Renders the frames of the scene as EXR with depth into `weather/` beside the .blend, writes the
camera as USD, calls `flurries render` with the words after `--`, and lays the weather over the
render in a compositor tree. Then it saves `shot_weather.blend`. `flurries` must be on the PATH.
Blender 5.0 or newer.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy

PLATE, CAMERA, LAYERS = "plate.####.exr", "camera.usdc", "weather.####.exr"


def render(scene: Any, folder: Path) -> None:
    """Render the frames with their depth: the plate."""
    bpy.context.view_layer.use_pass_z = True
    image = scene.render.image_settings
    image.media_type, image.file_format = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"
    scene.render.filepath = str(folder / PLATE)
    bpy.ops.render.render(animation=True)


def weather(scene: Any, folder: Path, words: list[str]) -> None:
    """Make the layers of the weather, before and behind what stands in the plate."""
    bpy.ops.wm.usd_export(filepath=str(folder / CAMERA), export_animation=True, export_meshes=False)
    plate = str(folder / PLATE)
    frames = f"{scene.frame_start}-{scene.frame_end}"
    rate = str(scene.render.fps / scene.render.fps_base)
    shot = [plate, "--depth", plate, "--camera", str(folder / CAMERA), "--frames", frames]
    files = ["--fps", rate, "--layers", "-o", str(folder / LAYERS)]
    done = subprocess.run(["flurries", "render", *shot, *words, *files], check=False)
    if done.returncode:
        sys.exit(done.returncode)


def compose(scene: Any, folder: Path) -> None:
    """Lay the layers over the render in the compositor, back to front."""
    tree = bpy.data.node_groups.new("Weather", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    first, last = scene.frame_start, scene.frame_end
    file = folder / LAYERS.replace("####", f"{first:04d}")
    picture = bpy.data.images.load(str(file))
    picture.source = "SEQUENCE"
    behind = tree.nodes.new("CompositorNodeRLayers").outputs["Image"]
    for name in names_in(file):
        layers = tree.nodes.new("CompositorNodeImage")
        layers.image = picture
        # Frame `frame_start` shows the file of `frame_offset` + 1.
        layers.frame_start, layers.frame_offset = first, first - 1
        layers.frame_duration = last - first + 1
        # "snow.veil" is the pass "veil" of the layer "snow".
        layer, _, part = name.rpartition(".")
        if layer:
            layers.layer = layer
        over = tree.nodes.new("CompositorNodeAlphaOver")
        tree.links.new(behind, over.inputs["Background"])
        tree.links.new(layers.outputs[part], over.inputs["Foreground"])
        behind = over.outputs["Image"]
    tree.links.new(behind, tree.nodes.new("NodeGroupOutput").inputs[0])


def names_in(file: Path) -> list[str]:
    """Return the names of the weather's layers, back to front: the header of the EXR has them."""
    head = file.read_bytes()[:65536]
    start = head.index(b"flurries:layers\0string\0") + 23
    length = int.from_bytes(head[start : start + 4], "little")
    names = head[start + 4 : start + 4 + length].decode().split(", ")
    return [name for name in names if name not in ("background", "foreground")]


def main() -> None:
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else ["--snow", "heavy"]
    scene, file = bpy.context.scene, Path(bpy.data.filepath or "shot.blend").resolve()
    folder = file.parent / "weather"
    folder.mkdir(exist_ok=True)
    render(scene, folder)
    weather(scene, folder, words)
    compose(scene, folder)
    bpy.ops.wm.save_as_mainfile(filepath=str(file.with_name(f"{file.stem}_weather.blend")))


if __name__ == "__main__":
    main()
