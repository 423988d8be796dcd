"""Studies: many drops around one case, or the search for the parameters that fit a target.

A kind of study is a module of this package and one line in `thud.studies.kinds`.
"""
