"""How alike the latents of the two systems are."""
