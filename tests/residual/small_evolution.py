"""Something quick to evolve towards."""

from truepath.residual.limits import Settings

SMALL = Settings(individuals=12, smallest=2, largest=9, generations=25, sizes_every=5)
