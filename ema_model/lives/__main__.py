"""`python -m ema_model.lives`: finds anew how well identifications tell k."""

from ema_model.lives.life import write_accuracy

if __name__ == "__main__":
    print(write_accuracy())
