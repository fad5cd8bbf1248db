"""Materials: their file, their rates and what follows from them."""
