"""The simulated camera as a Canon EOS 5D Mark II."""
