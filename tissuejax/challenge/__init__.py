"""Room: challenge."""
