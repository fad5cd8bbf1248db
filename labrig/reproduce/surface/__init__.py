"""How a surface answers light: matrices on bands, and levels of its states through time."""
