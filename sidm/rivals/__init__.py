"""What the paper only names, or a reviewer asks for."""
