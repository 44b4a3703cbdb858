"""Real robots: a Clearpath Warthog and a Husky, and a Hunter of someone else's simulator."""
