"""`python -m ema_model.lives`: finds anew how well identifications tell k."""

from ema_model.lives.life import accuracy_write

if __name__ == "__main__":
    print(accuracy_write())
