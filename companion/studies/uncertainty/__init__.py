"""How certain models are of their predictions, and whether rightly so."""
