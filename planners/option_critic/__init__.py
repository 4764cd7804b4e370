"""The neural target: an option-critic in TorchRL, compiled from a ground graph."""
