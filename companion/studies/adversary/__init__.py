"""How strong the adversary must be until the latents are alike or the loss breaks."""
