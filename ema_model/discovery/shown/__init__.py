"""What words, reports, recordings and the page show of a discovery: titles, sentences, tables, lines over time."""
