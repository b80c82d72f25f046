"""Genu's contact beside Drake's and OpenSim's, on the same surfaces, material and loads; run by scripts/compare_peers --part contact, settle, gait."""
