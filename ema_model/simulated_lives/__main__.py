"""`python -m ema_model.simulated_lives`: finds anew how well identifications tell k."""

from ema_model.simulated_lives.life import write_accuracy

if __name__ == "__main__":
    print(write_accuracy())
