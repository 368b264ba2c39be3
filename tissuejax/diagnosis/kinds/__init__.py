"""Kinds of recordings as a diagnosis goes about them, one a file."""
