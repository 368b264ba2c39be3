"""Traction-separation laws: one a file, found by walking this folder; what they all share is in `engine.py`."""
