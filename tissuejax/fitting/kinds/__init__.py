"""Kinds of recordings as a fit goes about them, one a file."""
