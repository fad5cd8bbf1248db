"""Paths of light over meshes: traced once without wavelength, folded by the materials."""
