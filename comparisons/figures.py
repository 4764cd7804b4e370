"""Every figure of a report: pure functions from plain data to a matplotlib Figure.

They use no pyplot and no global state, and the same data gives the same bytes (`save_figure`).
"""

from comparisons.figures_graph import task_graph_figure
from comparisons.figures_learning import band, convergence_figure, step_tables_figure, value_counts_figure
from comparisons.figures_perception import confusion_figure, detections_figure
from comparisons.figures_pushes import push_figure
from comparisons.figures_routes import counterexample_figure, layout_figure, trajectories_figure
from comparisons.style import save_figure

__all__ = [
    "band",
    "confusion_figure",
    "convergence_figure",
    "counterexample_figure",
    "detections_figure",
    "layout_figure",
    "push_figure",
    "save_figure",
    "step_tables_figure",
    "task_graph_figure",
    "trajectories_figure",
    "value_counts_figure",
]
