"""Playing: a surrogate, the full model or a stored run in a browser, in a haptic loop, or beside a recording."""
