"""Room: fitting."""
