"""Comparisons of Genu with other programs; run by scripts/compare_peers."""
