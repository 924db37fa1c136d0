"""The vibration job: a gear train in its elastic housing, from job file to response, spectrum, power, fields."""
