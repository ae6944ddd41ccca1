"""`slip-vic report --video`: the runs side by side as an MP4 file, drawn by MuJoCo, encoded by ffmpeg."""

from __future__ import annotations

import importlib
import importlib.util
import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_core.files.plain_yaml import read_yaml
from slip_core.params import build, flat_names, is_name
from slip_sim_bridge.params import BridgeParams
from slip_vic.page.runs import duration_s, read_run

SIZE: Final = (640, 720)
"""Of one run [pixels]."""
FRAMES_PER_S: Final = 30
LOOK_AT: Final = (0.3, 0.0, 0.4)
"""[m] {w}"""


def write_video(path: Path, bags: Mapping[str, Path]) -> int:
    """Write the video and return its number of frames.

    Raises:
        InputError: no ffmpeg, no OpenGL, a bag without parameters, or a file that cannot be written.
    """
    encoder = _ffmpeg()
    os.environ.setdefault("MUJOCO_GL", "egl")
    from slip_sim_bridge.plant.picture import Picture

    times = np.arange(0.0, duration_s(list(bags.values())), 1.0 / FRAMES_PER_S)
    runs = [read_run(bag, label, times) for label, bag in bags.items()]
    pictures = [
        Picture(_bridge(bag), run.arms[0].urdf, SIZE, np.array(LOOK_AT))
        for run, bag in zip(runs, bags.values(), strict=True)
    ]
    width = SIZE[0] * len(runs)
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{SIZE[1]}", "-r", str(FRAMES_PER_S), "-i", "-"]
    out = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", str(path)]
    process = subprocess.Popen([encoder, "-y", "-loglevel", "error", *raw, *out], stdin=subprocess.PIPE)
    assert process.stdin is not None
    try:
        for frame in range(len(times)):
            row = [
                picture.draw(run.arms[0].joints[frame], None if run.object_pose is None else run.object_pose[frame])
                for picture, run in zip(pictures, runs, strict=True)
            ]
            process.stdin.write(np.hstack(row).tobytes())
    except BrokenPipeError:
        pass  # ffmpeg has said why
    finally:
        process.stdin.close()
        for picture in pictures:
            picture.close()
    if process.wait():
        raise InputError(f"--video {path}", got="ffmpeg failed, see above", expected="a file that can be written")
    return len(times)


def _ffmpeg() -> str:
    found = shutil.which("ffmpeg")
    if found is None and importlib.util.find_spec("imageio_ffmpeg") is not None:
        found = str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())  # the extra `video`
    if found is None:
        raise InputError(
            "--video", got="no ffmpeg", expected="ffmpeg", fix="apt install ffmpeg, or pip install imageio-ffmpeg"
        )
    return found


def _bridge(path: Path) -> BridgeParams:
    with Bag(path) as bag:
        if "bridge.params.yaml" not in bag.attachments:
            raise InputError(f"bag {path}", got="no bridge.params.yaml", expected="a bag of `slip-vic run --record`")
        (node,) = read_yaml(bag.attachments["bridge.params.yaml"].decode()).values()
    values = flat_names(node["ros__parameters"])
    values = {name: value for name, value in values.items() if is_name(BridgeParams, name)}  # of an older version
    return build(BridgeParams, values, f"bridge.params.yaml of {path}")
