"""Loops over elements as compiled C, written from what JAX traced; their derivatives are loops of the same kind."""
