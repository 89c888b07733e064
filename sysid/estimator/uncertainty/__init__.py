"""How sure the estimates are: standard errors, what was held, whether flights agree."""
