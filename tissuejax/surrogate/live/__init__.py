"""Asking a surrogate, or the full model, step by step while the user's hand moves."""
