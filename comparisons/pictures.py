"""The user's own pictures, as frames for a backend: read with care, for anybody may have made them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from perception.protocol import Frame
from worlds.errors import UserError

FORMATS: Final = ("PNG", "JPEG", "BMP", "WEBP")
"""What is read; Pillow's rarer readers stay shut."""
MOST_BYTES: Final = 64 << 20
"""A larger file is not opened."""
MOST_PIXELS: Final = 64_000_000
"""A picture with more pixels is not decoded: a small file may claim to hold any number."""
LEAST_SIDE: Final = 8
"""A picture with fewer rows or columns shows nothing."""
_DEPTHS: Final = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "YCbCr")  # modes of 8 bits a channel


def picture_paths(path: Path) -> list[Path]:
    """Return the file, or the files that lie in the folder, by name; hidden ones are left out.

    Raises
    ------
    UserError
        If there is nothing at the path, or no file in the folder.

    Examples
    --------
    >>> picture_paths(Path("nowhere.png"))
    Traceback (most recent call last):
        ...
    worlds.errors.UserError: nowhere.png: there is no such file or folder
    """
    try:
        if not path.is_dir():
            if not path.exists():
                raise UserError(f"{shown(path)}: there is no such file or folder")
            return [path]
        found = sorted(p for p in path.iterdir() if not p.is_dir() and not p.name.startswith("."))
    except (OSError, ValueError) as error:
        if isinstance(error, UserError):
            raise
        raise UserError(f"{shown(path)}: it cannot be looked into ({_why(error)})") from error
    if not found:
        raise UserError(f"{shown(path)}: the folder holds no file; name one with {', '.join(FORMATS)} files")
    return found


def read_picture(path: Path, pixels: int) -> Frame:
    """Return a picture as a frame: its middle square, in RGB, at the camera's size.

    A turned photograph is set upright by its EXIF tag; of an animation the first picture counts;
    transparency is ignored.

    Parameters
    ----------
    path
        A PNG, JPEG, BMP or WebP file.
    pixels
        Width and height of the frame.

    Returns
    -------
    NDArray[np.uint8]
        Shape (pixels, pixels, 3).

    Raises
    ------
    UserError
        If it is no such file, broken, huge or tiny; the message says which, in one line.
    """
    name = shown(path)
    try:
        _check_file(name, path)
        with warnings.catch_warnings(), Image.open(path, formats=FORMATS) as picture:
            warnings.simplefilter(
                "ignore"
            )  # our own limit stands below Pillow's, and broken EXIF is no matter
            return _frame(name, picture, pixels)
    except UserError:
        raise
    except UnidentifiedImageError:
        raise UserError(f"{name}: not a picture that can be read; give {', '.join(FORMATS)}") from None
    except Image.DecompressionBombError:  # Pillow's own limit, far above ours
        raise UserError(f"{name}: more than {MOST_PIXELS:,} pixels; make it smaller") from None
    except MemoryError:
        raise UserError(f"{name}: the picture does not fit in memory; make it smaller") from None
    except Exception as error:  # a decoder fed with a hostile file may raise anything
        raise UserError(f"{name}: the picture is broken ({_why(error)})") from error


def _check_file(name: str, path: Path) -> None:
    if not path.is_file():
        raise UserError(f"{name}: not a plain file")
    size = path.stat().st_size
    if not 0 < size <= MOST_BYTES:
        fault = "empty" if not size else f"{size >> 20} MiB large; at most {MOST_BYTES >> 20} are read"
        raise UserError(f"{name}: the file is {fault}")


def _frame(name: str, picture: Image.Image, pixels: int) -> Frame:
    width, height = picture.size
    if width * height > MOST_PIXELS:
        raise UserError(f"{name}: more than {MOST_PIXELS:,} pixels; make it smaller")
    if min(width, height) < LEAST_SIDE:
        raise UserError(
            f"{name}: {width} x {height} pixels show nothing; give at least {LEAST_SIDE} each way"
        )
    if picture.mode not in _DEPTHS:
        raise UserError(f"{name}: its pixels are {picture.mode}; convert it to 8 bits a channel")
    upright = ImageOps.exif_transpose(picture)
    square = ImageOps.fit(upright.convert("RGB"), (pixels, pixels), Image.Resampling.BOX)
    return np.array(square, dtype=np.uint8)


def shown(path: Path) -> str:
    r"""Return a path as one line of printable characters, whatever its name holds.

    Examples
    --------
    >>> shown(Path("a\nb.png"))
    "'a\\nb.png'"
    """
    text = str(path)
    return text if text.isprintable() else ascii(text)


def _why(error: Exception) -> str:
    words = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(words.split())[:120] or type(error).__name__


def numbered(names: list[str]) -> Iterator[str]:
    """Yield a file name for each picture's drawing; names that differ in case only stay apart.

    Examples
    --------
    >>> list(numbered(["a.png", "A.jpg", "b c.bmp"]))
    ['0001_a.png', '0002_A.png', '0003_b_c.png']
    """
    for i, name in enumerate(names, start=1):
        stem = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "_" for c in Path(name).stem)
        yield f"{i:04d}_{stem[:60]}.png"
