"""What `emaviz` can be asked: each file is one verb.

It has `HELP`, its `PLACE` in the list, `add_arguments(parser)` and `run(arguments)`.
"""
