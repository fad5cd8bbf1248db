"""What is in a scene: objects, materials, lamps, cameras, from a scene file or from a run."""
