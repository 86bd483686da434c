# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a data set of pairs: what lies where, what is complete, and the tables over all frames.

A frame is complete once the file of its labels is there, which is written last and also holds what the manifest tells
of the frame. The manifest and the labels of all frames are made of these files, so several machines may fill one
folder.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mathutils import Matrix

from ..output.coco import united, write_content
from ..output.kitti import kitti_lines
from ..solver.scene import SceneError
from ..solver.system.files import check_writable, replacing

ABOUT, MANIFEST, LABELS = "pairs.json", "manifest.csv", "labels.json"
_FOLDERS = "rgb", "thermal", "labels"
_KITTI = "kitti"
_POSE = "camera_x", "camera_y", "camera_z", "camera_qw", "camera_qx", "camera_qy", "camera_qz"
FACTS = (
    "seed", "coldest", "hottest", "beyond_scale", "offset", "step", "noise", "passes", "seconds_rgb", "seconds_thermal"
)  # fmt: skip
COLUMNS = "frame", "rgb", "thermal_exr", "thermal_png", "labels", *_POSE, *FACTS


class FrameFiles(NamedTuple):
    """The files of a frame."""

    rgb: Path
    exr: Path
    png: Path
    labels: Path


class Folder:
    """A folder of pairs."""

    def __init__(self, path: Path):
        self.path = path

    def files(self, frame: int) -> FrameFiles:
        """The files of a frame, whether they are there or not."""
        stem = f"frame_{frame:04d}"
        thermal = self.path / "thermal" / stem
        return FrameFiles(
            self.path / "rgb" / f"{stem}.png",
            thermal.with_suffix(".exr"),
            thermal.with_suffix(".png"),
            self.path / "labels" / f"{stem}.json",
        )

    def prepare(self, about: Mapping[str, object]) -> None:
        """Make the folders, and the file that says what pairs they hold; about: all that pairs depend on, by name.

        Raises SceneError, naming what differs, if the folder holds anything else, OSError if it cannot be written.
        """
        known = self.path / ABOUT
        if known.exists():
            self._compare(_read_about(known), about)
        elif self.path.is_dir() and any(self.path.iterdir()):
            raise SceneError(f"'{self.path}' holds files, but no pairs: give an empty folder, or a new one")
        self.path.mkdir(parents=True, exist_ok=True)
        check_writable(known, "the pairs")
        if not known.exists():  # the first of all: without it, a folder that is not empty is refused
            write_text(known, json.dumps(about, indent=1))
        for name in _FOLDERS:
            (self.path / name).mkdir(exist_ok=True)

    def _compare(self, stored: Mapping, about: Mapping) -> None:
        now = json.loads(json.dumps(about))
        different = sorted(name for name in {*stored, *now} if stored.get(name) != now.get(name))
        if different:
            told = ", ".join(f"{name} ({_short(stored.get(name))}, now {_short(now.get(name))})" for name in different)
            raise SceneError(f"'{self.path}' holds pairs that were made otherwise: {told}. Give another folder")

    def is_complete(self, frame: int) -> bool:
        """Whether all files of a frame are there."""
        return all(path.is_file() for path in self.files(frame))

    def finish(self, kitti: bool) -> int:
        """Write the manifest and the labels of all complete frames, and KITTI's text if asked; returns how many there
        are. Raises OSError, and SceneError if the labels of a frame are damaged."""
        contents, rows, lines = {}, [], {}
        for frame in self._complete_frames():
            contents[frame], row, lines[frame] = self._read_frame(frame)
            rows.append(row)
        write_content(self.path / LABELS, united(contents.values()))
        table = io.StringIO(newline="")
        writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(self.path / MANIFEST, table.getvalue())
        if kitti:
            (self.path / _KITTI).mkdir(exist_ok=True)
            for frame, text in lines.items():
                write_text(self.path / _KITTI / f"{self.files(frame).labels.stem}.txt", text)
        return len(contents)

    def _complete_frames(self) -> list[int]:
        """In order. Files of other names are passed over: programs that synchronise folders make copies of labels."""
        names = (re.fullmatch(r"frame_(-?\d+)\.json", path.name) for path in (self.path / "labels").iterdir())
        return sorted(filter(self.is_complete, {int(name[1]) for name in names if name}))

    def _read_frame(self, frame: int) -> tuple[dict, dict[str, object], str]:
        """The labels of a complete frame, its row of the manifest, and KITTI's text. Raises SceneError if its file does
        not hold them."""
        path = self.files(frame).labels
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            (image,) = content["images"]
            if image["frame"] != frame:
                raise ValueError(f"it is of frame {image['frame']}")
            return content, self._row(image), "".join(f"{line}\n" for line in kitti_lines(content))
        except (ValueError, LookupError, TypeError) as error:
            reason = f"it has no {error}" if isinstance(error, KeyError) else error
            raise SceneError(
                f"'{path}' is damaged: {reason}. Delete it, and a run with --frames {frame} renders its frame again"
            ) from None

    def _row(self, image: Mapping) -> dict[str, object]:
        """What the manifest tells of a frame, from the labels' image."""
        names = (path.relative_to(self.path).as_posix() for path in self.files(image["frame"]))
        pose = camera_pose(np.array(image["camera"]["camera_to_world"]))
        first = dict(zip(COLUMNS, (image["frame"], *names, *(f"{each:.9g}" for each in pose)), strict=False))
        return first | {name: image[name] for name in FACTS}


def camera_pose(matrix: np.ndarray) -> tuple[float, ...]:
    """Place, and turn as a quaternion w, x, y, z with w >= 0, of a camera with this matrix (4, 4) to the world."""
    turn = Matrix(matrix[:3, :3].tolist()).to_quaternion()
    sign = -1.0 if turn.w < 0.0 else 1.0
    return *matrix[:3, 3].tolist(), *(sign * each for each in turn)


def write_text(path: Path, text: str) -> None:
    """Write a text to a file; an older one is replaced once the new one is complete. Raises OSError."""
    with replacing(path, "the pairs") as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def _read_about(path: Path) -> dict:
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(stored, dict):
            raise ValueError("it holds no names with values")
        return stored
    except ValueError as error:
        raise SceneError(
            f"'{path}' is damaged: {error}. Give another folder, or copy this file from one that the same command "
            "begins"
        ) from None


def _short(value) -> str:
    text = str(value)
    return text if len(text) <= 24 else text[:21] + "..."
