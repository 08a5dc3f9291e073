"""Time loop, observation of the response, and ground acceleration over a step."""
