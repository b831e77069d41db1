"""The benchmark of Wee and Ahmad 2025 (doi:10.32604/cmes.2025.063611), done again in the open."""
