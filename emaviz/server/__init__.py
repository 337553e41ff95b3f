"""What stands between a browser and the app: who may come in, and what may be said.

door: who gets an answer; policy: what the page may do there; messages, values: what a page can mean;
gate: lets that through; complaints: one line about the rest; viser_private: the inside of viser that this needs.
"""
