"""The conformance kit for perception backends: what they see, what they refuse, what they keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from comparisons.conformance_parts import ConformanceError, hold
from perception.percepts import Percepts
from perception.protocol import LABELS, Backend, Detection, FrameBackend, Frames, View
from worlds import UserError
from worlds.camera import Camera

_CLOSE: Final = 1e-5  # batches of another size may be added up in another order


def check_backend(
    backend: Backend, views: Sequence[View], fit: Callable[[int], FrameBackend] | None = None
) -> None:
    """Check a perception backend on some views of the kind that it is made for.

    It gives one sound detection a view, in order, its label the likeliest unless it abstains; the same
    view the same detection, alone or in a batch, before and after others; and it does not change the
    frames. If it goes by frames alone (`perceive`), frames get what views get, and what is no batch of
    frames is refused by a `UserError`. If it can be saved and loaded, what is loaded sees the same.

    Parameters
    ----------
    backend
        The backend.
    views
        Two or more different ones.
    fit
        Returns a backend fitted anew with a seed, on few frames, if it learns: the same seed must see
        exactly the same twice, whatever was fitted in between.

    Raises
    ------
    ConformanceError
        If not; the message names the view.

    Examples
    --------
    >>> from perception import NOTHING, Truth
    >>> check_backend(Truth(), [View(None, NOTHING), View(None, Detection("cube", 1.0, 2))])
    """
    hold(
        isinstance(backend, Backend),
        f"{type(backend).__name__} has no name, needs_frames or detect; add them",
    )
    frames = [None if view.frame is None else view.frame.copy() for view in views]
    batch = backend.detect(views)
    hold(len(batch) == len(views), f"{len(views)} views got {len(batch)} detections")
    for i, (view, frame, found) in enumerate(zip(views, frames, batch, strict=True)):
        hold(isinstance(found, Detection) and found.label in LABELS, f"view {i} got {found!r}, no detection")
        _sound(i, found)
        alone = backend.detect([view])
        hold(
            len(alone) == 1 and _alike(alone[0], found),
            f"view {i} got another detection alone than in the batch",
        )
        if frame is not None and view.frame is not None:
            hold(bool((frame == view.frame).all()), f"the frame of view {i} was changed")
    for i, (again, found) in enumerate(zip(reversed(backend.detect(views[::-1])), batch, strict=True)):
        hold(_alike(again, found), f"view {i} got another detection after others; keep nothing between calls")
    hold(backend.detect([]) == [], "no views must give no detections")
    seen = [frame for frame in frames if frame is not None]
    if isinstance(backend, FrameBackend) and seen:
        _check_frames(
            backend, np.stack(seen), [d for d, frame in zip(batch, frames, strict=True) if frame is not None]
        )
        _check_saving(backend, np.stack(seen))
        if fit is not None:
            _check_fit(fit, np.stack(seen))


def _sound(i: int, found: Detection) -> None:
    """Refuse probabilities that do not sum to 1, and a label that they do not bear out."""
    chances = found.chances
    hold(abs(sum(chances) - 1) < _CLOSE, f"the probabilities of view {i} sum to {sum(chances):.6g}, not 1")
    likeliest = chances[LABELS.index(found.label)] >= max(chances) - _CLOSE
    hold(likeliest or found.abstains, f"view {i} is called {found.label!r} with probabilities {chances}")


def _alike(one: Detection, other: Detection) -> bool:
    told = [(d.label, d.distance, d.abstains) for d in (one, other)]
    return told[0] == told[1] and bool(np.allclose(one.chances, other.chances, rtol=0, atol=_CLOSE))


def _check_frames(backend: FrameBackend, frames: Frames, told: Sequence[Detection]) -> None:
    """Refuse percepts that differ from the detections, and frames that should have been refused."""
    kept = frames.copy()
    found = backend.perceive(frames)
    hold(isinstance(found, Percepts), f"perceive gave {type(found).__name__}, no Percepts")
    hold(len(found) == len(frames), f"{len(frames)} frames got {len(found)} percepts")
    for i, (percept, detection) in enumerate(zip(found.detections(), told, strict=True)):
        hold(_alike(percept, detection), f"perceive and detect tell frame {i} differently")
    hold(bool((kept == frames).all()), "perceive changes the frames")
    wrong: dict[str, Any] = {
        "floats": frames.astype(np.float64) / 255,
        "one frame without a batch": frames[0],
        "grey frames": frames[..., :1],
        "frames with four channels": np.concatenate([frames, frames[..., :1]], axis=3),
        "an empty batch": frames[:0],
        "a list": frames.tolist()[:1],
    }
    for what, batch in wrong.items():
        try:
            backend.perceive(batch)
        except UserError:
            continue
        except Exception as error:
            raise ConformanceError(
                f"{what} must be refused by a UserError, not {type(error).__name__}; "
                "use perception.percepts.checked_frames"
            ) from error
        raise ConformanceError(f"{what} must be refused; use perception.percepts.checked_frames")


def _check_saving(backend: FrameBackend, frames: Frames) -> None:
    """Refuse a backend that sees otherwise once it has been saved and loaded."""
    save, load = getattr(backend, "save", None), getattr(type(backend), "load", None)
    if save is None or load is None:
        return
    with TemporaryDirectory() as folder:
        path = Path(folder, "backend.safetensors")
        save(path)
        again = load(path, getattr(backend, "camera", Camera()))
        hold(
            _same(backend.perceive(frames), again.perceive(frames)),
            "it sees otherwise once saved and loaded; save all that it has learnt",
        )
        path.write_bytes(path.read_bytes()[:-1])
        try:
            load(path, getattr(backend, "camera", Camera()))
        except UserError:
            return
        raise ConformanceError("a broken weights file must be refused; use perception.models.load_model")


def _check_fit(fit: Callable[[int], FrameBackend], frames: Frames) -> None:
    first, _, last = (fit(seed).perceive(frames) for seed in (1, 2, 1))
    hold(
        _same(first, last),
        "fitted twice with one seed it sees otherwise; draw every random number from the seed, and keep "
        "nothing between fits",
    )


def _same(one: Percepts, other: Percepts) -> bool:
    pairs = (
        (one.probabilities, other.probabilities),
        (one.distances, other.distances),
        (one.abstains, other.abstains),
    )
    return all(np.array_equal(a, b) for a, b in pairs)
