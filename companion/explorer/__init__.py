"""The suspension explorer: robots on the same ground, their struts and their motion.

`views` draws figures; `live` has sliders that simulate new rides; `grid` and `page`
make the book's page, whose sliders choose among rides that were simulated before;
`predictions` shows predictions of models as ghosts beside robots.
"""
