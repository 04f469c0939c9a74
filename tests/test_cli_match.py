"""`flurries match`: a scene out of a film of falling snow."""

from pathlib import Path

import flurries as fl
from films import snowfall
from test_cli import Run, here, run


def test_the_command_prints_what_it_found_and_saves_a_scene(run: Run, here: Path):
    with fl.io.VideoWriter("snow.mp4", (320, 180), 25) as film:
        for frame in snowfall():
            film.write(frame)
    words = "match", "snow.mp4", "--focal", "384", "-o", "fall.toml", "--report", "fit.png"
    code, out, err = run(*words)
    assert code == 0 and "density" in out and "flakes per m3" in out, err
    scene = fl.open("fall.toml")
    assert isinstance(scene.effects[0], fl.Snow) and Path("fall.plate.png").exists()
    assert scene.render(0).shape == (180, 320, 3) and Path("fit.png").exists()
    assert run(*words)[0] == 2
