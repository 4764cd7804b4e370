"""The few lines that the command line prints at the end of a reproduction."""

from __future__ import annotations

from typing import Any


def summarise(results: dict[str, Any]) -> str:
    """Return what matters most in results.json, a line each."""
    pairs, dynamic, seen = results["pairs"], results["dynamic"], results["perception"]
    optimal = sum(pair["optimal"] for pair in pairs)
    met = [row for row in results["affordances"] if row["action"]]
    shown = ", ".join(f"{row['obstacle']} {row['action']} ({row['subtask']})" for row in met)
    outcomes = ", ".join(f"{name}: {n}" for name, n in dynamic["outcomes"].items())
    share = f"{100 * seen['accuracy']:.1f} %"
    proved = f"replanning {dynamic['optimal_replanning']}, local rule {dynamic['optimal_local_rule']}"
    snapshots = ", ".join(f"{reading} {tally['optimal']}" for reading, tally in results["snapshots"].items())
    spheres = max(tally["affordances"] for tally in results["snapshots"].values())
    lines = (
        f"pairs learnt to optimality: {optimal} of {len(pairs)}",
        f"perception ({seen['backend']}): {share} of {seen['frames']} fresh frames told right",
        f"example run: {shown}",
        f"proved optimal of {dynamic['affordances']} affordances in {dynamic['episodes']} episodes: {proved}",
        f"optimal by a snapshot, of {spheres} affordances with a sphere known, spheres read: {snapshots}",
        f"ends: {outcomes}",
    )
    return "\n".join(lines)
