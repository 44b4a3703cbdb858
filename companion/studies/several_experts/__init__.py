"""An SIDM of several experts before the novice is met."""
