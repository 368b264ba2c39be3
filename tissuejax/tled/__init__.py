"""Room: tled."""
