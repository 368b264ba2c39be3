"""The explicit total Lagrangian simulator: step, contact, statics, saving."""
