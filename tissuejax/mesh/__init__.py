"""Room: mesh."""
