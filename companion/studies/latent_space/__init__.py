"""How alike the two systems' latents are."""
