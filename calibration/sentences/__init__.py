"""Sentences for people, each made from an id and its parameters by one table."""
