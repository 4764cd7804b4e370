"""Commands of `affordant`, as functions that `comparisons.cli` takes. Each loads what it needs as it runs."""
