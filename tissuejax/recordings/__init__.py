"""Room: recordings."""
