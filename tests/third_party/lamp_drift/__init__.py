"""How steady a lamp is: driver, protocol, analysis and result in a package of one's own."""
