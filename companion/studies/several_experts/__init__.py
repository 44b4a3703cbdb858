"""An SIDM that is trained on several experts before it is given to a novice."""
