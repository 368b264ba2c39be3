"""Material cards for other solvers, one solver a file, found by walking this folder."""
