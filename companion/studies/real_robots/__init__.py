"""Real robots: a Clearpath Warthog and a Husky, and a Hunter of another simulator."""
