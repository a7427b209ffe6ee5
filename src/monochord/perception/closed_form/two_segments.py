"""The least score of a reading by trained networks, which `monochord.perception.model` compares with."""

MIN_SCORE = 0.25
