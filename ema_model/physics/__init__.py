"""The physics: scalar functions that numba inlines into the kernels.

Units are SI (rad, rad/s, A, V, N·m, s), on the motor side unless a name says `user`.
"""
