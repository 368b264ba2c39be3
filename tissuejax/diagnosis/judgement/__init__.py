"""From a search to a verdict: sets of effects weighed by their evidence, and the judgement of it."""
