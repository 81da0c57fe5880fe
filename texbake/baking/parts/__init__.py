"""Assets of many parts: who is baked from whom, onto which set of maps, in which tile."""
