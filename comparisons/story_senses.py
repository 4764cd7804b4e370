"""The report on the maze, on pushing obstacles and on seeing them (figures 3, 11 and section 6.1)."""

from __future__ import annotations

from comparisons.experiment import Experiment
from comparisons.figures import confusion_figure, detections_figure, layout_figure, push_figure
from comparisons.report import Section, Table
from comparisons.results import Findings
from comparisons.story_parts import Part, percent, share
from perception.frames import fresh_views
from perception.protocol import LABELS, Explains, Frame

_SHOWN = 6
_SEARCHED = 60  # frames among which one of each kind is found


def maze(experiment: Experiment, _found: Findings) -> Part:
    """Describe the maze."""
    layout = experiment.layout
    text = (
        f"{layout.rows} by {layout.cols} grids in {len(layout.rooms)} rooms. The doors open when the robot "
        "reaches its trigger; every action moves one grid and costs 1."
    )
    chosen = (
        "Fixed by the paper's figures: "
        + (", ".join(sorted(set(layout.marks) - layout.chosen)) or "nothing")
        + ". Chosen here, once, where its text gives no position: "
        + (", ".join(sorted(layout.chosen)) or "nothing")
        + "."
    )
    caption = "The maze, and the obstacles of the example run where they appear."
    section = Section("The maze", (text, chosen), figures=(("maze", caption),))
    return Part(section, {"maze": layout_figure(layout)})


def static(_experiment: Experiment, found: Findings) -> Part:
    """Report which obstacles roll (section 6.1)."""
    pushes = found.pushes
    text = (
        f"{pushes.trials} goal-free push trials over shapes, sizes, frictions (ice included) and speeds, "
        "rolling told by rotation over path. The rule 'a sphere is rollable, a cube is not' (equation "
        f"8) held in {pushes.rotation} of them. Had displacement alone decided, it would have seemed to "
        f"hold in {pushes.displacement}."
    )
    figure = push_figure(
        {kind: {str(label): n for label, n in labels.items()} for kind, labels in pushes.counts.items()}
    )
    section = Section(
        "Static affordances: what rolls", (text,), figures=(("pushes", "What pushed obstacles did."),)
    )
    return Part(section, {"pushes": figure})


def seeing(experiment: Experiment, found: Findings) -> Part:
    """Report how well the backend tells shapes (figure 11)."""
    seen = found.seen
    matrix = [[seen.confusion[true][told] for told in LABELS] for true in LABELS]
    figures = {"confusion": confusion_figure(matrix, LABELS)}
    captions = [("confusion", f"What the backend said of {seen.frames} fresh frames, against the truth.")]
    items = _explained(experiment)
    if items:
        figures["detections"] = detections_figure(items)
        captions.append(("detections", "Frames of the robot's camera, and the shapes found (figure 11)."))
    text = (
        f"The backend '{experiment.spec.perception}' told none, cube and sphere apart in "
        f"{percent(seen.accuracy)} of {seen.frames} fresh frames (three sizes, random colours, one and two "
        f"grids ahead). Of the obstacles that it recognised it told the distance right in "
        f"{percent(seen.distance_accuracy)}."
    )
    rows = tuple(
        (name, n["frames"], n["right"], share(n["right"], n["frames"])) for name, n in seen.groups.items()
    )
    table = Table("By shape, size and grids ahead", ("obstacle", "frames", "right", "share"), rows)
    return Part(Section("Perception", (text,), tuple(captions), (table,)), figures)


def _explained(experiment: Experiment) -> list[tuple[str, Frame, Frame]]:
    """Return a frame of each shape and distance, plain and drawn upon, if the backend explains itself."""
    backend = experiment.backend
    if not isinstance(backend, Explains):
        return []
    shown: dict[str, tuple[str, Frame, Frame]] = {}
    for view in fresh_views(experiment.layout, _SEARCHED, experiment.spec.seed + 1, experiment.camera):
        title = f"{view.truth.label}, {view.truth.distance} ahead" if view.truth.distance else "none"
        if title not in shown and len(shown) < _SHOWN:
            assert view.frame is not None, "fresh views are rendered"
            shown[title] = (title, view.frame, backend.sketch(view.frame))
    return [shown[title] for title in sorted(shown)]
