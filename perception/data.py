"""Data sets of frames that the robot labelled by pushing, on disk: made in pieces, resumed, checked.

A data set is a folder of shards, plain ``.npz`` files without pickled objects, and a manifest that says
what is in them. A shard is written whole or not at all, so a run that was killed goes on where it stood
and ends with the same bytes.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from perception.pushed import COLUMNS, PushedFrames, pushed_frames
from perception.variation import CLEAN, Variation
from worlds import UserError
from worlds.files import replace_file

__all__ = [
    "CLEAN",
    "SPLITS",
    "PushedFrames",
    "Variation",
    "load_data",
    "make_data",
    "pushed_frames",
    "split_of",
]

MANIFEST: Final = "manifest.json"
SHARD: Final = 250
"""Frames in a shard, unless said otherwise."""
_MOST_FRAMES: Final = 1_000_000
_MOST_MANIFEST: Final = 4_000_000  # bytes
SPLITS: Final[Mapping[str, range]] = MappingProxyType(
    {"training": range(100), "tuning": range(100, 200), "test": range(200, 300)}
)
"""The seeds of each part; no seed is in two."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Varies(_Strict):
    floor: bool
    walls: bool
    light: bool
    rotation: bool
    distractors: bool
    camouflage: int
    families: list[str]


class _Shard(_Strict):
    file: Annotated[str, Field(pattern=r"^shard-\d{6}\.npz$")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class _Manifest(_Strict):
    """What a data set's folder holds; `shards` grows while the set is made."""

    format: Literal["affordant-pushed-frames-1"] = "affordant-pushed-frames-1"
    seed: Annotated[int, Field(ge=0)]
    frames: Annotated[int, Field(ge=1, le=_MOST_FRAMES)]
    shard: Annotated[int, Field(ge=1, le=_MOST_FRAMES)]
    variation: _Varies
    shards: list[_Shard] = []

    def rows(self, number: int) -> range:
        """Return the frames that a shard holds."""
        return range(number * self.shard, min((number + 1) * self.shard, self.frames))

    @property
    def all_shards(self) -> int:
        """How many shards there are when all is made."""
        return -(-self.frames // self.shard)


def split_of(seed: int) -> str:
    """Return the part of the data that a seed belongs to.

    Examples
    --------
    >>> split_of(0), split_of(100), split_of(207)
    ('training', 'tuning', 'test')
    """
    for name, seeds in SPLITS.items():
        if seed in seeds:
            return name
    parts = ", ".join(f"{seeds.start} to {seeds.stop - 1} for {name}" for name, seeds in SPLITS.items())
    raise UserError(f"seed {seed} belongs to no part of the data; use {parts}")


def make_data(
    folder: str | Path,
    n: int,
    seed: int,
    variation: Variation | None = None,
    *,
    shard: int = SHARD,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Make a data set, or go on making it.

    Parameters
    ----------
    folder
        Where; made if it does not exist. If it holds part of the same data set, that part is kept.
    n
        Number of frames: a third with nothing in the way.
    seed
        Names the data set: 0 to 99 for training, 100 to 199 for tuning, 200 to 299 for tests (`SPLITS`).
    variation
        What varies; everything by default.
    shard
        Frames in a file. It changes nothing in the data.
    progress
        Called after each shard with the number of frames made so far.

    Raises
    ------
    UserError
        If a number is out of range, or the folder holds another data set.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     make_data(folder, 3, seed=100)
    ...     len(load_data(folder, "tuning"))
    3
    """
    folder = Path(folder)
    split_of(seed)
    if not 1 <= n <= _MOST_FRAMES or not 1 <= shard <= _MOST_FRAMES:
        raise UserError(
            f"a data set has 1 to {_MOST_FRAMES} frames in shards of at least 1, not {n} in {shard}"
        )
    variation = variation or Variation()
    varies = _Varies(**{**asdict(variation), "families": list(variation.families)})
    wanted = _Manifest(seed=seed, frames=n, shard=shard, variation=varies)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        done = _kept(folder, wanted)
        for number in range(len(done), wanted.all_shards):
            data = _packed(pushed_frames(wanted.rows(number), seed, variation))
            file = f"shard-{number:06d}.npz"
            replace_file(folder / file, data)
            done.append(_Shard(file=file, sha256=hashlib.sha256(data).hexdigest()))
            text = wanted.model_copy(update={"shards": done}).model_dump_json(indent=1)
            replace_file(folder / MANIFEST, text.encode())
            if progress is not None:
                progress(wanted.rows(number).stop)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror or error}; give a folder that can be written") from error


def load_data(folder: str | Path, split: str | None = None) -> PushedFrames:
    """Load a data set that `make_data` made, every shard checked against the manifest.

    Parameters
    ----------
    folder
        Where it is.
    split
        If given, "training", "tuning" or "test": refuse data of another part.

    Raises
    ------
    UserError
        If there is no data set, it is unfinished, damaged, or of another part.
    """
    folder = Path(folder)
    manifest = _read_manifest(folder)
    if split is not None and split_of(manifest.seed) != split:
        part = split_of(manifest.seed)
        raise UserError(
            f"{folder}: seed {manifest.seed} is of the {part} part; give data of the {split} part"
        )
    if len(manifest.shards) != manifest.all_shards:
        made = min(len(manifest.shards) * manifest.shard, manifest.frames)
        raise UserError(
            f"{folder}: {made} of {manifest.frames} frames are made; run make_data again to go on"
        )
    parts = [
        _read_shard(folder / shard.file, shard, len(manifest.rows(number)))
        for number, shard in enumerate(manifest.shards)
    ]
    return PushedFrames(**{name: np.concatenate([part[name] for part in parts]) for name in COLUMNS})


def _kept(folder: Path, wanted: _Manifest) -> list[_Shard]:
    """Return the shards that need not be made again: the first ones, as far as they are whole."""
    if not (folder / MANIFEST).exists():
        return []
    found = _read_manifest(folder)
    if found.model_copy(update={"shards": []}) != wanted:
        raise UserError(
            f"{folder} holds other data (seed {found.seed}, {found.frames} frames by {found.shard}, "
            "or of another variation); give an empty folder"
        )
    kept = []
    for shard in found.shards:
        path = folder / shard.file
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != shard.sha256:
            break
        kept.append(shard)
    return kept


def _read_manifest(folder: Path) -> _Manifest:
    path = folder / MANIFEST
    try:
        if path.stat().st_size > _MOST_MANIFEST:
            raise UserError(f"{path}: too large for a manifest; give a folder that make_data made")
        manifest = _Manifest.model_validate_json(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; give a folder that make_data made") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise UserError(f"{path}: {where}: {first['msg']}; make the data set again") from error
    if [shard.file for shard in manifest.shards] != [
        f"shard-{k:06d}.npz" for k in range(len(manifest.shards))
    ]:
        raise UserError(f"{path}: the shards are not numbered from 0; make the data set again")
    return manifest


def _packed(data: PushedFrames) -> bytes:
    buffer = io.BytesIO()  # numpy dates every member 1980, so the same data are the same bytes
    np.savez(buffer, allow_pickle=False, **{name: getattr(data, name) for name in COLUMNS})
    return buffer.getvalue()


def _read_shard(path: Path, shard: _Shard, rows: int) -> dict[str, NDArray[np.generic]]:
    broken = f"{path}: damaged; run make_data again, which makes it anew"
    most = sum(rows * np.dtype(t).itemsize * int(np.prod(s)) + 1000 for t, s in COLUMNS.values())
    try:
        # Sizes come first, so that a file blown up on purpose is never read.
        if path.stat().st_size > most + 1000 * len(COLUMNS):
            raise UserError(broken)
        data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != shard.sha256:
            raise UserError(broken)
        with zipfile.ZipFile(io.BytesIO(data)) as members:
            if sum(member.file_size for member in members.infolist()) > most:
                raise UserError(broken)
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            columns = {name: arrays[name] for name in COLUMNS}
    except (OSError, KeyError, EOFError, ValueError, zipfile.BadZipFile) as error:
        raise UserError(broken) from error
    for name, (dtype, shape) in COLUMNS.items():
        if columns[name].dtype != np.dtype(dtype) or columns[name].shape != (rows, *shape):
            raise UserError(broken)
    return columns
