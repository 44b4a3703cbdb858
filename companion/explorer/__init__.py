"""The suspension under one's fingers: robots over the same ground, what their springs do, and how they drive.

`views` draws charts; `live` has sliders that simulate anew, and `grid` and `page` make
the book's page, whose sliders choose among rides that were simulated before.
`predictions` puts models' predictions beside robots as ghosts.
"""
