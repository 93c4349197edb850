"""Fault feature table, Bayes, the next best feature and the next best test."""
