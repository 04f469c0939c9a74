"""Weather in Nuke: the layers of `flurries render --layers` over the plate, with depth and motion.

    flurries render plate.####.exr --snow heavy --depth depth.####.exr --layers -o snow.####.exr

In Nuke's script editor, or in a `menu.py`:

    import nuke_layers  # this file, in a folder on the path of Nuke
    nuke_layers.over("/shots/010/snow.####.exr", plate=nuke.selectedNode())
    nuke_layers.deep("/shots/010/deep.####.exr")

`flurries render` with `--motion y-up` writes motion as Nuke counts it.
"""

from __future__ import annotations

from typing import Any

import nuke


def read(pattern: str, kind: str = "Read") -> Any:
    """Return a node that reads a sequence; the range is that of the files."""
    node = getattr(nuke.nodes, kind)()
    folder, _, name = pattern.rpartition("/")
    found = [one for one in nuke.getFileNameList(folder) if one.split(" ")[0] == name]
    if not found:
        raise ValueError(f"no files {pattern}")
    node["file"].fromUserText(f"{folder}/{found[0]}")
    return node


def names_in(node: Any) -> list[str]:
    """Return the names of the weather's layers, back to front, as the EXR's header has them."""
    said = node.metadata("exr/flurries:layers")
    if not said:
        raise ValueError("the files have no layers: flurries render --layers")
    return [name for name in said.split(", ") if name not in ("background", "foreground")]


def over(pattern: str, plate: Any, blur: bool = False) -> Any:
    """Lay each effect of the weather over a plate; with `blur`, along its own motion.

    Lay a foreground of the scene over what this returns: `--plate` writes it, too.
    """
    layers, behind = read(pattern), plate
    for name in names_in(layers):
        # Nuke writes a point in the name of a layer as "_".
        layer = name.replace(".", "_")
        weather = nuke.nodes.Shuffle(inputs=[layers], label=name)
        weather["in"].setValue(layer)
        if blur:
            motion = nuke.nodes.Copy(inputs=[weather, layers])
            for number, axis in enumerate(("u", "v")):
                motion[f"from{number}"].setValue(f"{layer}_forward.{axis}")
                motion[f"to{number}"].setValue(f"forward.{axis}")
            weather = nuke.nodes.VectorBlur2(inputs=[motion])
            weather["uv"].setValue("forward")
        behind = nuke.nodes.Merge2(inputs=[behind, weather], operation="over", label=name)
    return behind


def deep(pattern: str) -> Any:
    """Return a node with the weather as deep samples, for a DeepMerge with a deep render."""
    return read(pattern, "DeepRead")
