"""The models' kernels, written once and compiled per stack of effects.

`ema_model.stacks` executes these files beside a generated `composition` module, which inlines the chosen
circuit and effects.  Imported from here they are the bare models: `composition` holds no effect.
"""
