"""What stands between a browser and the app: who may come in, and what may be said.

door: who gets an answer, what the page may do there, and one line about the rest; messages: what a page can mean;
safe_server: the server that holds to it; uploads: files; viser_private: the inside of viser that this needs.
"""
