"""Canon EOS: Canon's vendor operations, events and properties, as far as a PC needs them."""
