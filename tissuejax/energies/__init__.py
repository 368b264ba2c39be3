"""Strain energies, one a file, found by walking this folder."""
