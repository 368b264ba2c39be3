"""Room: elements."""
