"""Room: diagnosis."""
