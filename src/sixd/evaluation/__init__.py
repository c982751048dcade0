"""From results and truth to scores: protocols, selection, errors, matching, statistics."""
