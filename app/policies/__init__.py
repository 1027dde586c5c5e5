"""Learning and deciding: torch and Stable-Baselines3. Knows sim; nothing of web, api, store."""
